"""A journal becomes a recording: the uncompensated deviation is that of the machine, or the cell is empty."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from smallmachine import small_machine

import thermocomp as tc
from thermocomp.core.correction import Correction, uncompensated
from thermocomp.core.exceptions import InputError, RecordingError
from thermocomp.core.machine import Channel
from thermocomp.live.journal.journal import Journal, JournalLimits
from thermocomp.live.journal.journalexport import Exported, export
from thermocomp.live.journal.journalreader import JournalReader
from thermocomp.live.journal.journalrows import (
    ConfirmationRow,
    DemandRow,
    MeasurementRow,
    ReadingRow,
    Row,
    StartRow,
    TargetRow,
)
from thermocomp.recordings.checks.quality import check
from thermocomp.recordings.readers import recordings
from thermocomp.recordings.recording import Recording
from thermocomp.virtual import datasets as virtual

FloatArray = NDArray[np.float64]
BEGIN = 1_790_000_000.0
Z = Channel("z_um", "displacement", "um")
HEAT = Channel("t1_C", "temperature", "degC")


def start_of(test: Recording, targets: Sequence[str], *, measured: bool = True, **how: Any) -> StartRow:
    kept = [c for c in test.channels if c.quantity != "displacement" or (measured and c.name in targets)]
    start = StartRow(BEGIN, tuple(TargetRow(t) for t in targets), tuple(kept), "off", 100.0)
    return start._replace(**how)


def fake_correction(time: FloatArray, k: int = 0) -> FloatArray:
    """What a controller had in force: a ramp that no model would make."""
    return np.asarray(-20.0 * np.sin(time / 5000.0 + k) - 5.0)


def journal_of(path: Path, start: StartRow, rows: Sequence[Row], **limits: int) -> JournalReader:
    journal = Journal.open(path, JournalLimits(**limits), start)
    for k, row in enumerate(rows):
        journal.add(row)
        assert k % 500 or journal.flush()
    assert journal.status().refused == 0, journal.status()
    journal.close()
    return JournalReader(path)


def lived(test: Recording, targets: Sequence[str], known: Callable[[float], bool] = lambda _: True) -> list[Row]:
    """The rows of a run under a correction: the probes measure what is left, the demand is another thing."""
    rows: list[Row] = []
    inputs = [c.name for c in test.channels if c.quantity != "displacement"]
    for k, time in enumerate(test.time.tolist()):
        values = {n: float(test.table[n].iloc[k]) for n in inputs}
        for j, target in enumerate(targets):
            c = float(fake_correction(np.array(time), j))
            values[target] = float(test.table[target].iloc[k]) + c
            rows.append(DemandRow(BEGIN + time, target, Correction(1000.0)))
            if known(time):
                rows.append(ConfirmationRow(BEGIN + time - 0.01, target, Correction(c)))
        rows.append(ReadingRow(BEGIN + time, values))
    return rows


def saved(found: Exported, folder: Path) -> Recording:
    recordings.write(found.recording, folder / "out.csv", overwrite=True)
    again = recordings.read(folder / "out.csv")
    assert [(c.name, c.quantity, c.unit) for c in again.channels] == [
        (c.name, c.quantity, c.unit) for c in found.recording.channels
    ]
    assert again.compensation == found.recording.compensation
    assert again.start == found.recording.start
    np.testing.assert_array_equal(again.table.to_numpy(), found.recording.table.to_numpy())
    return again


def test_the_sign_stands_in_one_place() -> None:
    assert uncompensated(2.0, -10.0) == 12.0  # a deviation of 12, corrected by -10, leaves 2


def test_the_deviation_of_a_virtual_machine_comes_back(tmp_path: Path) -> None:
    (test,) = virtual.record(virtual.find_experiment("demo"), seed=3)
    targets = ("z_um", "y1_um")
    rows = lived(test, targets)
    reader = journal_of(tmp_path / "live.db", start_of(test, targets), rows, size_bytes=2**18, files=100)
    assert len(reader.paths) > 2
    again = saved(export(reader), tmp_path)
    assert again.compensation == "known"
    np.testing.assert_allclose(again.time, test.time, atol=1e-6)
    for j, target in enumerate(targets):
        base = target.removesuffix("_um")
        np.testing.assert_allclose(again.table[target], test.table[target], atol=1e-9)
        correction = fake_correction(test.time, j)
        np.testing.assert_allclose(again.table[f"{base}_correction_um"], correction)
        np.testing.assert_allclose(again.table[f"{base}_residual_um"], test.table[target] + correction, atol=1e-9)
    for c in test.channels:
        if c.quantity != "displacement":
            np.testing.assert_array_equal(again.table[c.name], test.table[c.name])


def test_a_fit_takes_the_uncompensated_deviation(tmp_path: Path) -> None:
    test = small_machine()
    reader = journal_of(tmp_path / "live.db", start_of(test, ["z_um"]), lived(test, ["z_um"]))
    recordings.write(test, tmp_path / "plain.csv")
    saved(export(reader), tmp_path)
    models = [tc.fit(tmp_path / name, "z_um", model="ols", jobs=1) for name in ("out.csv", "plain.csv")]
    by_journal, by_test = (m.models["z_um"] for m in models)
    assert by_journal.target == "z_um"
    assert [i.name for i in by_journal.inputs] == [i.name for i in by_test.inputs]
    np.testing.assert_allclose(by_journal.honest_error.rms, by_test.honest_error.rms, rtol=1e-6)  # type: ignore[union-attr]


@pytest.mark.parametrize("own", ["on", "unknown"])
def test_beside_another_compensation_nothing_is_known(own: str, tmp_path: Path) -> None:
    test = small_machine()
    start = start_of(test, ["z_um"], own_compensation=own)
    found = export(journal_of(tmp_path / "live.db", start, lived(test, ["z_um"])))
    assert found.targets == (("z_um", len(test), 0),)
    again = saved(found, tmp_path)
    assert again.compensation == "unknown"
    assert again.table["z_um"].isna().all()
    assert again.table["z_correction_um"].isna().all()
    assert again.table["z_residual_um"].notna().all()
    for verb in (tc.fit, tc.compare):
        with pytest.raises(RecordingError, match=r"out\.csv: compensation: unknown: .* temperature compensation off"):
            verb(tmp_path / "out.csv", "z_um", jobs=1)


def test_without_a_fresh_confirmation_a_cell_is_empty(tmp_path: Path) -> None:
    test = small_machine()
    hours = (10_000.0, 20_000.0)
    start = start_of(test, ["z_um"], confirm_within=130.0)
    found = export(
        journal_of(tmp_path / "live.db", start, lived(test, ["z_um"], lambda t: not hours[0] <= t <= hours[1]))
    )
    again = saved(found, tmp_path)
    assert again.compensation == "known"
    # a confirmation holds for 130 s: the rows at 60 and 120 s after the last one are known yet
    empty = (test.time >= hours[0] + 120.0) & (test.time <= hours[1])
    late = (test.time >= hours[0]) & ~empty & (test.time <= hours[1])
    assert empty.sum() > 100
    assert np.array_equal(again.table["z_um"].isna(), empty)
    assert np.array_equal(again.table["z_correction_um"].isna(), empty)
    sound = ~empty & ~late
    np.testing.assert_allclose(again.table["z_um"][sound], test.table["z_um"][sound], atol=1e-9)
    assert any(f"{empty.sum():,} have no deviation" in note for note in found.notes)


def test_a_confirmation_is_of_its_run(tmp_path: Path) -> None:
    path = tmp_path / "live.db"
    one = StartRow(BEGIN, (TargetRow("z_um"),), (HEAT, Z), "off", 1000.0)
    journal_of(path, one, [ConfirmationRow(BEGIN, "z_um", Correction(-5.0)), ReadingRow(BEGIN + 1, {"z_um": 3.0})])
    two = one._replace(time=BEGIN + 2)
    reader = journal_of(path, two, [ReadingRow(BEGIN + 3, {"z_um": 3.0})])
    assert export(reader).recording.table["z_um"].tolist() == [8.0, pytest.approx(np.nan, nan_ok=True)]


def test_a_correction_along_the_axis_is_taken_where_it_is_measured(tmp_path: Path) -> None:
    start = StartRow(BEGIN, (TargetRow("z_um", position=300.0),), (HEAT, Z), "off", 10.0)
    rows: list[Row] = [ConfirmationRow(BEGIN, "z_um", Correction(-5.0, 20.0, 100.0)), ReadingRow(BEGIN, {"z_um": 3.0})]
    table = export(journal_of(tmp_path / "live.db", start, rows)).recording.table
    assert table["z_correction_um"].tolist() == [-1.0]
    assert table["z_um"].tolist() == [4.0]


# -- probings ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("includes_offset", [True, False])
@pytest.mark.parametrize("in_force", [Correction(-12.0), None])
def test_probings_by_either_frame_say_the_same(
    includes_offset: bool, in_force: Correction | None, tmp_path: Path
) -> None:
    deviation, c = 15.0, -12.0
    seen = deviation if includes_offset else deviation + c  # trap 5
    rows: list[Row] = []
    for k in range(100):
        rows.append(ConfirmationRow(BEGIN + 10.0 * k, "Z", Correction(c)))
        rows.append(ReadingRow(BEGIN + 10.0 * k, {"t1_C": 20.0 + k}))
    rows.append(MeasurementRow(BEGIN + 503.0, "Z", seen, "probing", includes_offset, 250.0, in_force))
    for kind in ("work_offset", "tool_length"):
        rows.append(MeasurementRow(BEGIN + 600.0, "Z", 77.0, kind, includes_offset, 250.0, in_force))
    start = StartRow(BEGIN, (TargetRow("Z"),), (HEAT,), "off", 15.0)
    found = export(journal_of(tmp_path / "live.db", start, rows))
    assert found.targets == (("Z", 1, 1),)
    assert any("2 work offsets and tool lengths are not exported" in n for n in found.notes)
    table = saved(found, tmp_path).table
    for name, value in (("Z", deviation), ("Z_residual_um", deviation + c)):
        assert np.flatnonzero(table[name].notna()).tolist() == [50]
        assert table[name][50] == pytest.approx(value)
    np.testing.assert_allclose(table["Z_correction_um"], c)


@pytest.mark.parametrize(("includes_offset", "known"), [(True, 1), (False, 0)])
def test_a_probing_without_a_confirmation(includes_offset: bool, known: int, tmp_path: Path) -> None:
    rows: list[Row] = [
        ReadingRow(BEGIN, {"t1_C": 20.0}),
        MeasurementRow(BEGIN, "z_um", 3.0, "probing", includes_offset),
    ]
    start = StartRow(BEGIN, (TargetRow("z_um"),), (HEAT,), "off", 15.0)
    found = export(journal_of(tmp_path / "live.db", start, rows))
    assert found.targets == (("z_um", 1, known),)
    assert found.recording.compensation == ("known" if known else "unknown")
    table = found.recording.table
    assert table["z_um"].notna().tolist() == [bool(known)]
    assert table["z_residual_um"].notna().tolist() == [not known]


@pytest.mark.parametrize("own", ["on", "unknown"])
@pytest.mark.parametrize("includes_offset", [True, False])
def test_a_probing_beside_another_compensation(own: Any, includes_offset: bool, tmp_path: Path) -> None:
    rows: list[Row] = [
        ConfirmationRow(BEGIN, "z_um", Correction(-12.0)),
        ReadingRow(BEGIN, {"t1_C": 20.0}),
        MeasurementRow(BEGIN, "z_um", 3.0, "probing", includes_offset, 0.0, Correction(-12.0)),
        ReadingRow(BEGIN + 1, {"t1_C": 20.0}),
        MeasurementRow(BEGIN + 1, "z_um", 3.0, "probing", False, 0.0, Correction(-12.0)),
    ]
    found = export(journal_of(tmp_path / "live.db", StartRow(BEGIN, (TargetRow("z_um"),), (HEAT,), own, 15.0), rows))
    assert found.recording.compensation == "unknown"
    table = found.recording.table
    assert table["z_um"].isna().all()
    assert table["z_correction_um"].isna().all()
    assert table["z_residual_um"].notna().tolist() == [not includes_offset, True]


def test_a_probing_far_from_any_reading_is_told(tmp_path: Path) -> None:
    rows: list[Row] = [ReadingRow(BEGIN, {"t1_C": 20.0}), MeasurementRow(BEGIN + 61.0, "z_um", 3.0, "probing", True)]
    start = StartRow(BEGIN, (TargetRow("z_um"),), (HEAT,), "off", 15.0)
    found = export(journal_of(tmp_path / "live.db", start, rows))
    assert found.notes == ("z_um: 1 probings are not exported: there is no reading within 60 s",)


# -- odd journals ------------------------------------------------------------------------------------------------------


def test_readings_of_one_time_and_those_between(tmp_path: Path) -> None:
    rows: list[Row] = [ReadingRow(BEGIN + t, {"t1_C": 20.0 + t}) for t in (0.0, 0.0, 2.0, 1.0, 5.0, 9.0, 10.0)]
    start = StartRow(BEGIN, (), (HEAT,), "off", 15.0)
    reader = journal_of(tmp_path / "live.db", start, rows)
    assert export(reader).recording.time.tolist() == [0.0, 1.0, 2.0, 5.0, 9.0, 10.0]
    assert export(reader, every=5.0).recording.time.tolist() == [0.0, 5.0, 10.0]


def test_an_angle_has_its_deviation_alone(tmp_path: Path) -> None:
    tilt = Channel("a_urad", "angle", "urad")
    start = StartRow(BEGIN, (TargetRow("a_urad", "angle", "urad"),), (HEAT, tilt), "off", 15.0)
    rows: list[Row] = [
        ConfirmationRow(BEGIN, "a_urad", Correction(-5.0)),
        ReadingRow(BEGIN, {"a_urad": 3.0, "t1_C": 20.0}),
    ]
    again = saved(export(journal_of(tmp_path / "live.db", start, rows)), tmp_path)
    assert [c.name for c in again.channels] == ["t1_C", "a_urad"]
    assert again.table["a_urad"].tolist() == [8.0]


def test_what_was_never_measured_has_its_correction(tmp_path: Path) -> None:
    start = StartRow(BEGIN, (TargetRow("z_um"),), (HEAT,), "off", 15.0)
    rows: list[Row] = [ConfirmationRow(BEGIN, "z_um", Correction(-5.0)), ReadingRow(BEGIN, {"t1_C": 20.0})]
    again = saved(export(journal_of(tmp_path / "live.db", start, rows)), tmp_path)
    assert [c.name for c in again.channels] == ["t1_C", "z_correction_um"]
    with pytest.raises(InputError, match="no channel is named 'z_um'"):
        tc.fit(tmp_path / "out.csv", "z_um", jobs=1)


def test_journals_that_are_no_recording(tmp_path: Path) -> None:
    start = StartRow(BEGIN, (TargetRow("z_um"),), (HEAT,), "off", 15.0)
    with pytest.raises(InputError, match=r"live\.000001\.db: the journal contains no reading yet"):
        export(journal_of(tmp_path / "live.db", start, []))
    other = start._replace(channels=(Channel("t1_C", "displacement", "um"),))
    with pytest.raises(
        InputError, match="t1_C is a displacement in um in one run and a temperature in degC in another"
    ):
        export(journal_of(tmp_path / "live.db", other, [ReadingRow(BEGIN, {"t1_C": 1.0})]))
    twice = start._replace(channels=(Channel("z_residual_um", "residual", "um"), Z))
    rows: list[Row] = [ReadingRow(BEGIN, {"z_um": 1.0, "z_residual_um": 1.0})]
    with pytest.raises(InputError, match="z_residual_um would occur twice"):
        export(journal_of(tmp_path / "twice.db", twice, rows))


def test_a_clock_that_was_never_set(tmp_path: Path) -> None:
    start = StartRow(0.0, (), (HEAT,), "off", 15.0)
    found = export(journal_of(tmp_path / "live.db", start, [ReadingRow(1e14, {"t1_C": 20.0})]))
    assert found.recording.start == ""


def test_a_model_is_fitted_to_probings_alone(tmp_path: Path) -> None:
    test = small_machine()
    rows: list[Row] = []
    for row in lived(test, ["z_um"]):
        if not isinstance(row, ReadingRow):
            rows.append(row)
            continue
        values = dict(row.values)
        residual = values.pop("z_um")
        rows.append(ReadingRow(row.time, values))
        if round(row.time - BEGIN) % 1200 == 0:  # every 20 min
            rows.append(MeasurementRow(row.time, "z_um", residual, "probing", False))
    found = export(journal_of(tmp_path / "live.db", start_of(test, ["z_um"], measured=False), rows))
    assert 20 < found.targets[0].measured == found.targets[0].known < 100
    again = saved(found, tmp_path)
    there = again.table["z_um"].notna()
    np.testing.assert_allclose(again.table["z_um"][there], test.table["z_um"][there], atol=1e-9)
    assert [f for f in check(again) if f.severity == "trouble"] == []
    model = tc.fit(again, "z_um", model="ols", jobs=1).models["z_um"]
    assert model.honest_error is not None
    assert model.honest_error.rms < 4.0  # of a drift of 60 um


@pytest.mark.parametrize("again", [False, True])
def test_a_clock_that_is_set_back_mixes_no_times(again: bool, tmp_path: Path) -> None:
    """The first hour says 100 um and 1 um are corrected, the second, from the same half hour on, 200 and 2."""
    path, start = tmp_path / "live.db", StartRow(BEGIN, (TargetRow("z_um"),), (HEAT, Z), "off", 30.0)
    journal = Journal.open(path, JournalLimits(), start)
    for part, (begin, size) in enumerate(((0.0, 1.0), (1800.0, 2.0))):
        if part and again:  # the service was started again, by the other clock
            journal.close()
            journal = Journal.open(path, JournalLimits(), start._replace(time=BEGIN + begin))
        for k in range(360):
            now = BEGIN + begin + 10.0 * k
            journal.add(ConfirmationRow(now, "z_um", Correction(-size)))
            journal.add(ReadingRow(now, {"t1_C": 20.0 + size, "z_um": 100.0 * size - size}))
            if k == 300:  # at 50 min of the first clock, which came again
                journal.add(MeasurementRow(now, "z_um", 5.0, "work_offset", False))
    assert journal.flush()
    journal.close()
    found = export(JournalReader(path))
    table, time = found.recording.table, found.recording.time
    assert (np.diff(time) > 0).all()
    first = time < 1800.0
    assert table["z_um"][first].tolist() == [100.0] * 180
    assert table["z_um"][~first].tolist() == [200.0] * 360
    assert table["t1_C"][~first].tolist() == [22.0] * 360
    assert any("361 rows are not exported: the clock was set back" in note for note in found.notes)
