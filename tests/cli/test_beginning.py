"""The four words for how a recording begins, from door to door."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from smallmachine import small_machine

from thermocomp.cli.app import run
from thermocomp.core.provenance import HonestError
from thermocomp.files import modelfile
from thermocomp.judging.replay import replay_compensated as replayed
from thermocomp.models.training import train
from thermocomp.recordings.cycles import Cycle
from thermocomp.recordings.readers import recordings
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.stacking import stack

ROW = 300


def part(test: Recording, name: str, rows: slice, start: str) -> Recording:
    time = test.time[rows] - test.time[rows][0]
    table = test.table.iloc[rows].reset_index(drop=True)
    return replace(test, name=name, time=time, table=table, cycles=(Cycle("1", 0, len(time)),), start=start)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A test in two files, with and without time stamps, and a model that was trained on another one."""
    there = tmp_path_factory.mktemp("beginning")
    whole = small_machine((2200.0, 1200.0), seed=3)
    for ending, stamps in (("", ("", "")), ("-stamped", ("2026-03-01T08:00:00", "2026-03-01T13:00:30"))):
        recordings.write(part(whole, "a", slice(0, ROW), stamps[0]), there / f"a{ending}.csv")
        recordings.write(part(whole, "b", slice(ROW, None), stamps[1]), there / f"b{ending}.csv")
    anew = part(whole, "again", slice(ROW, None), "2026-03-01T13:00:30")
    table = anew.table.assign(z_um=anew.table["z_um"] - anew.table["z_um"].iloc[0])
    recordings.write(replace(anew, table=table), there / "again-stamped.csv")
    recordings.write(whole, there / "whole.csv")
    samples = stack([small_machine()], ["z_um"])
    model = train("dynamic", samples, 0, np.ones(len(samples), np.bool_)).model
    honest = HonestError("none", 1.0, 1.0, 1.0, 9.0, 9.0, {"1": 1.0}, "accepted", "", 2)
    modelfile.write([replace(model, honest_error=honest)], there / "model.json")
    return there


def assessed(
    folder: Path, capsys: pytest.CaptureFixture[str], *arguments: str
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return how the last recording begins, and what was found over all its cycles."""
    assert run(["assess", str(folder / "model.json"), *arguments, "--json"]) in (0, 1), capsys.readouterr().err
    content = json.loads(capsys.readouterr().out)
    return content["starts"][-1], content["results"][-1]


def told(capsys: pytest.CaptureFixture[str]) -> str:
    return " ".join(capsys.readouterr().err.split())


def test_a_warm_start_is_not_taken_for_a_cold_one(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    b = str(folder / "b.csv")
    for command in (
        ["assess", str(folder / "model.json"), b],
        ["compare", b, "--target", "z_um", "--split", "0.5/0.5"],
        ["iso230", b, "--test", "etve", "--model", str(folder / "model.json")],
        ["fit", b, "--target", "z_um", "--split", "0.5/0.5", "-o", str(folder / "new.json")],
    ):
        assert run(command) == 2
        message = told(capsys)
        assert "b.csv: z_um begins at" in message
        assert "--continues EARLIER" in message
    assert not (folder / "new.json").exists()
    start, cold = assessed(folder, capsys, b, "--start", "cold")
    assert (start["start"], start["how_known"]) == ("cold", "stated")
    assert cold["rms_um"] > 5.0  # 0.6 um if it is known what it continues from


def test_continued_is_the_whole(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    b, a = str(folder / "b.csv"), str(folder / "a.csv")
    start, found = assessed(folder, capsys, b, "--continues", a)
    assert start["start"] == "continued"
    assert start["earlier"] == [a]
    assert (
        "b begins 60 s after the end of a (assumed to be one sampling interval: no time stamps, no stated gap)"
        in start["how_known"]
    )
    (model,) = modelfile.read(folder / "model.json")
    whole = stack([recordings.read(folder / "whole.csv")], ["z_um"])
    ran = replayed(model, whole, np.ones(len(whole), np.bool_))
    left = (whole.deviations[:, 0] - ran.compensated)[ROW:]
    assert found["rms_um"] == pytest.approx(np.sqrt(np.mean(left**2)), abs=1e-9)
    assert found["max_um"] == pytest.approx(np.abs(left).max(), abs=1e-9)
    alone = (whole.deviations[:, 0] - ran.deviation)[ROW:]
    assert found["alone_rms_um"] == pytest.approx(np.sqrt(np.mean(alone**2)), abs=1e-9)
    start, late = assessed(folder, capsys, b, "--continues", a, "--gap", "7200")
    assert "b begins 7200 s after the end of a (stated)" in start["how_known"]
    assert late["rms_um"] != found["rms_um"]


def test_found_out_by_time_stamps(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a, b, anew = (str(folder / f"{n}-stamped.csv") for n in ("a", "b", "again"))
    start, found = assessed(folder, capsys, a, b)
    assert (start["start"], start["earlier"]) == ("continued", [a])
    assert "by time stamps and displacements; b-stamped begins 90 s after the end of a-stamped" in start["how_known"]
    _, alone = assessed(folder, capsys, b, "--continues", a)
    assert alone["n_rows"] < found["n_rows"]
    start, _ = assessed(folder, capsys, a, anew)
    assert start["start"] == "rezeroed"
    assert "it follows a-stamped by its time stamps, and begins near zero again" in start["how_known"]
    start, _ = assessed(folder, capsys, anew)
    assert start["start"] == "cold"
    assert "begin near zero" in start["how_known"]
    assert run(["assess", str(folder / "model.json"), a, "--continues", b]) == 2
    assert "cannot continue b-stamped: by their time stamps it begins" in told(capsys)


def test_rezeroed_and_known(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a, b = str(folder / "a.csv"), str(folder / "b.csv")
    start, whole = assessed(folder, capsys, b, "--continues", a)
    start, found = assessed(folder, capsys, b, "--start", "rezeroed", "--continues", a)
    assert (start["start"], start["earlier"]) == ("rezeroed", [a])
    assert found["none_rms_um"] != whole["none_rms_um"]  # the displacement counts from there, too
    assert found["rms_um"] < 2 * whole["rms_um"] + 0.5
    start, blind = assessed(folder, capsys, b, "--start", "rezeroed")
    assert start["earlier"] == []
    assert blind["rms_um"] > found["rms_um"]
    start, by_file = assessed(folder, capsys, b, "--zero", a)
    assert start["start"] == "known"
    zero = ",".join(f"{n}={v!r}" for n, v in start["zero_degC"].items())
    start, by_values = assessed(folder, capsys, b, "--start", "known", "--zero", zero)
    assert by_values["rms_um"] == by_file["rms_um"]
    _, cold = assessed(folder, capsys, b, "--start", "cold")
    assert by_file["rms_um"] < cold["rms_um"]


def test_cold_is_said(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["assess", str(folder / "model.json"), str(folder / "whole.csv"), "--details"]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert (
        "Initial state of whole: cold (zeroed at its start, at rest); assumed, since the displacements begin near zero"
        in text
    )
    assert "and the limits (at most 500 um, 0.1 um/s, dead band 0 um)" in text


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--gap", "5"], "--gap is the time between two files"),
        (["--start", "continued"], "needs the earlier file: name it with --continues"),
        (
            ["--start", "cold", "--continues", "a.csv"],
            "--continues requires --start continued or rezeroed, not cold",
        ),
        (["--start", "rezeroed", "--zero", "t1_C=20"], "--zero requires --start known, not rezeroed"),
        (["--start", "known"], "the known zero has no value for t1_C, t2_C, t3_C"),
        (["--zero", "t1_C=20"], "the known zero has no value for t2_C, t3_C"),
        (["--zero", "t1_C=warm"], "write a channel and its temperature"),
        (["--zero", "t9_C=20"], "no channel is named 't9_C'"),
        (["--continues", "b.csv"], "is the recording itself"),
        (["--continues", "a.csv", "--gap", "-5"], "a gap of -5 s between two files"),
        (["a.csv", "--continues", "a.csv"], "2 recordings are given; give only the one that continues"),
        (["--magnitude", "0"], "limit magnitude = 0.0: must be positive"),
    ],
)
def test_what_does_not_go_together(
    folder: Path,
    arguments: list[str],
    message: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(folder)
    assert run(["assess", "model.json", "b.csv", *arguments]) == 2
    assert message in told(capsys)


def test_fit_and_compare_go_on(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What went before is gone through, and neither learned from nor judged."""
    b, a, model = str(folder / "b.csv"), str(folder / "a.csv"), folder / "late.json"
    study = ["--target", "z_um", "--split", "0.6/0.4", "--jobs", "1", "--continues", a, "--json"]
    assert run(["fit", b, *study, "--model", "averaged", "-o", str(model)]) in (0, 1)
    (start,) = json.loads(capsys.readouterr().out)["starts"]
    assert start["start"] == "continued"
    (frozen,) = modelfile.read(model)
    assert frozen.provenance is not None
    assert frozen.provenance.starts == ("continued",)
    assert frozen.provenance.rows == 400 - ROW
    assert frozen.zeroing.at_rest == 300.0
    assert run(["compare", b, *study, "--models", "dynamic", "--zero-over", "0"]) in (0, 1)
    content = json.loads(capsys.readouterr().out)
    assert content["starts"][0]["start"] == "continued"
    assert content["results"][0]["n_rows"] == round(0.4 * (400 - ROW))
    assert run(["compare", b, *study, "--models", "ols", "--start", "rezeroed", "--details"]) == 1
    assert "was re-zeroed on a machine that continued from a" in capsys.readouterr().out
    subsets = ["--target", "z_um", "--method", "subsets", "--jobs", "1"]
    assert run(["select", b, *subsets]) == 2
    assert "Specify its start: --continues EARLIER" in told(capsys)
    assert run(["select", b, *subsets, "--continues", a]) == 0


def test_iso230_says_it(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a, b, model = (str(folder / n) for n in ("a.csv", "b.csv", "model.json"))
    assert run(["iso230", b, "--test", "etve", "--model", model, "--continues", a, "--json"]) == 0
    (test,) = json.loads(capsys.readouterr().out)["thermal"]
    assert any(n.startswith("b: continued from a (") for n in test["notes"])
    assert run(["iso230", b, "--start", "cold", "--positioning", b]) in (0, 2)
    capsys.readouterr()
    assert run(["iso230", "--start", "cold", "--positioning", b]) == 2
    assert "applies to a single recording; name one" in told(capsys)
