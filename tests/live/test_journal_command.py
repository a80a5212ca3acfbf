"""``thermocomp journal``: what it shows and what it exports."""

import json
from pathlib import Path

import pytest
from smallmachine import small_machine

from thermocomp.cli.app import run
from thermocomp.core.correction import Correction, Deviation
from thermocomp.core.machine import Channel
from thermocomp.live.journal.journal import Journal, JournalLimits
from thermocomp.live.journal.journalrows import (
    AlarmRow,
    ConfirmationRow,
    MeasurementRow,
    ReadingRow,
    ReferenceRow,
    StartRow,
    StateRow,
    TargetRow,
    UpdateRow,
)
from thermocomp.recordings.readers import recordings

BEGIN = 1_790_000_000.0


@pytest.fixture
def live(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Journal:
    """A journal of a drift test under a correction, still open."""
    monkeypatch.chdir(tmp_path)
    test = small_machine()
    channels = tuple(c for c in test.channels if c.name != "x_um")
    start = StartRow(BEGIN, (TargetRow("z_um"),), channels, "off", 90.0)
    journal = Journal.open("live.db", JournalLimits(), start)
    for time, values in zip(test.time.tolist(), test.table.to_dict("records"), strict=True):
        c = -3.0 - time / 10_000
        journal.add(ConfirmationRow(BEGIN + time, "z_um", Correction(c)))
        journal.add(ReadingRow(BEGIN + time, {str(n): v for n, v in values.items()} | {"z_um": values["z_um"] + c}))
    end = BEGIN + float(test.time[-1])
    for row in (
        StateRow(end, "z_um", "holding", "no reading for [bold]3 s"),
        ReferenceRow(end, "z_um", "homing", Deviation(1.0)),
        MeasurementRow(end, "z_um", 2.0, "probing", False, 0.0, Correction(-10.0)),
        MeasurementRow(end, "z_um", 12.0, "work_offset", True, 0.0, Correction(-10.0)),
        MeasurementRow(end, "z_um", 12.0, "tool_length", True, 0.0, Correction(0.0)),
        MeasurementRow(end, "z_um", 12.0, "probing", False),
        AlarmRow(end, "sensor", "t1_C stuck"),
        UpdateRow(end, "z_um", 12.0, 10.0, 11.5, ""),
        UpdateRow(end, "z_um", 99.0, 10.0, 10.0, "measure again"),
    ):
        journal.add(row)
    assert journal.flush()
    return journal


def test_show(live: Journal, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["journal", "show", "live.db"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].endswith("live.000001.db")
    assert lines[1] == "from 2026-09-21T14:13:20+00:00 to 2026-09-22T03:32:20+00:00"
    assert lines[2] == "1 start, 800 reading, 800 confirmation, 1 state, 1 reference, 4 measurement, 1 alarm, 2 update"
    stamp = "2026-09-22T03:32:20+00:00  "
    assert [line.removeprefix(stamp) for line in lines[3:]] == [
        "state  z_um holding: no reading for [bold]3 s",
        "reference  z_um is re-zeroed: homing",
        "measurement  z_um probing +2.00 um, measured with a correction of -10.00 um, not included in the value; "
        "deviation +12.00 um",
        "measurement  z_um work_offset +12.00 um, measured with a correction of -10.00 um, included in the value; "
        "deviation +12.00 um; the correction is applied twice while it remains in force",
        "measurement  z_um tool_length +12.00 um, measured with no correction, included in the value; "
        "deviation +12.00 um",
        "measurement  z_um probing +12.00 um, measured with an unknown correction, not included in the value; "
        "the deviation is not known",
        "alarm  sensor: t1_C stuck",
        "update  z_um measured +12.00 um, +10.00 to +11.50 um",
        "update  z_um measured +99.00 um, refused: measure again",
    ]
    assert run(["journal", "show", "live.000001.db", "--last", "1"]) == 0
    assert capsys.readouterr().out.splitlines()[3:] == [
        f"{stamp}update  z_um measured +99.00 um, refused: measure again"
    ]


def test_export_and_fit(live: Journal, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["journal", "export", "live.db", "-o", "week.csv"]) == 0
    out = capsys.readouterr().out
    assert "week.csv: 800 rows, compensation: known" in out
    assert "z_um: measured in 800 rows, deviation known in 800" in out
    assert "2 probings are not exported" in " ".join(out.split())
    assert (recordings.read("week.csv").table["z_um"] - small_machine().table["z_um"]).abs().max() < 1e-9
    assert "compensation" in Path("week.csv").read_text(encoding="utf-8").splitlines()[0]
    assert run(["fit", "week.csv", "--target", "z_um", "--model", "ols", "--jobs", "1", "-o", "model.json"]) == 0
    assert run(["assess", "model.json", "week.csv"]) in (0, 1)
    assert run(["journal", "export", "live.db", "-o", "week.csv"]) == 2
    assert "week.csv: the file exists already" in capsys.readouterr().err
    assert run(["journal", "export", "live.db", "-o", "week.csv", "--overwrite", "--every", "600"]) == 0
    assert len(recordings.read("week.csv")) == 80


def test_a_run_beside_another_compensation_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    channels = (Channel("t1_C", "temperature", "degC"), Channel("z_um", "displacement", "um"))
    journal = Journal.open("live.db", JournalLimits(), StartRow(BEGIN, (TargetRow("z_um"),), channels, "unknown", 90.0))
    for k in range(300):
        journal.add(ConfirmationRow(BEGIN + 60 * k, "z_um", Correction(-3.0)))
        journal.add(ReadingRow(BEGIN + 60 * k, {"t1_C": 20.0 + k / 100, "z_um": k / 50}))
    journal.close()
    assert run(["journal", "export", "live.db", "-o", "week.csv"]) == 0
    assert "compensation: unknown" in capsys.readouterr().out
    for words in (["fit", "-o", "model.json"], ["compare"]):
        assert run([words[0], "week.csv", "--target", "z_um", "--jobs", "1", *words[1:]]) == 2
        assert "week.csv: compensation: unknown: the correction in force" in capsys.readouterr().err
    assert not Path("model.json").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["show", "other.db"], "other.db: there is no journal of that name"),
        (["show", "live.db", "-o", "x.csv"], "journal show writes no file"),
        (["show", "live.db", "--last", "-1"], "--last -1: must not be negative"),
        (["export", "live.db"], "name the recording to write"),
        (["export", "live.db", "-o", "x.xlsx"], "a recording can only be written as .csv or .parquet"),
        (["export", "live.db", "-o", "x.csv", "--every", "-1"], "--every -1: must not be negative"),
        (["export", "live.000001.db", "-o", "live.000001.db", "--overwrite"], "is also an input"),
    ],
)
def test_what_cannot_be_done(words: list[str], said: str, live: Journal, capsys: pytest.CaptureFixture[str]) -> None:
    before = Path("live.000001.db").read_bytes()
    assert run(["journal", *words]) == 2
    assert said in " ".join(capsys.readouterr().err.split())
    assert Path("live.000001.db").read_bytes() == before


def test_for_programs(live: Journal, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["journal", "show", "live.db", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown["counts"]["reading"] == 800
    assert len(shown["events"]) == 9
    assert run(["journal", "export", "live.db", "-o", "week.csv", "--json"]) == 0
    exported = json.loads(capsys.readouterr().out)
    assert exported["targets"] == [{"target": "z_um", "measured": 800, "known": 800}]
