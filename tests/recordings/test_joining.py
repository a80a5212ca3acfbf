"""Two loggers, two clocks: what tells their offset, what is applied, and what becomes of the channels."""

import json
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import thermocomp as tc
from thermocomp.cli.app import run
from thermocomp.core.arrays import FloatArray
from thermocomp.core.exceptions import InputError
from thermocomp.recordings.clockoffset import ClockOffset, find_offset
from thermocomp.recordings.joining import join_two
from thermocomp.recordings.readers import recordings as files
from thermocomp.recordings.recording import Recording

BEGIN = datetime(2026, 3, 2, 7, 30)
SPEED, PROBES, HEAT = "spindle_rpm", ["y1_um", "z_um"], ["t_front_seat_C", "t_motor_C", "t_air_C"]


@pytest.fixture(scope="module")
def table() -> pd.DataFrame:
    """Twelve hours with 16 runs of the spindle, a row every minute."""
    return tc.simulate("random", seed=3)[0].to_frame()


def logged(table: pd.DataFrame, columns: list[str], offset: float = 0.0, drift: float = 0.0) -> Recording:
    """Return what a logger records whose clock is ahead, and gains."""
    clock = table["time_s"].to_numpy() * (1 + drift) + offset
    made = Recording.from_dataframe(
        table[columns].assign(time_s=clock - clock[0]).reset_index(drop=True), name="probes"
    )
    start = (BEGIN + timedelta(seconds=float(clock[0]))).isoformat()
    return replace(made, start=start, source=f"{columns[0][0]}.csv")


def jumping(table: pd.DataFrame) -> pd.DataFrame:
    """Return a spindle that grows by centrifugal force as soon as it turns, 5 um."""
    return table.assign(z_um=table["z_um"] + 5 * (table[SPEED] / table[SPEED].max()) ** 2)


def joined_z(recording: Recording, table: pd.DataFrame) -> FloatArray:
    """Return how far z is from that of the same moments in one clock [um]."""
    started = (datetime.fromisoformat(recording.start) - BEGIN).total_seconds()
    right = np.interp(started + recording.time, table["time_s"], table["z_um"])
    return np.asarray(recording.table["z_um"] - right)


@pytest.mark.parametrize("offset", [-7000.0, 460.0, 5000.0])
def test_a_speed_in_both_tells_the_offset_and_it_is_corrected(table: pd.DataFrame, offset: float) -> None:
    joined, told = join_two(logged(table, [*HEAT, SPEED]), logged(table[5:], [*PROBES, SPEED], offset))
    assert told.estimate is not None
    assert told.estimate.clear
    assert abs(told.estimate.offset - offset) < min(told.estimate.half, 60)
    assert told.applied == told.estimate.offset
    assert told.once == (SPEED,)
    assert [c.name for c in joined.channels] == [*HEAT, SPEED, *PROBES]
    assert np.sqrt(np.nanmean(joined_z(joined, table) ** 2)) < 1.0  # 30 um off by as much as the clocks
    assert len(joined.cycles) == 16
    assert "ahead" in joined.clocks or "behind" in joined.clocks


@pytest.mark.parametrize("swapped", [False, True])
def test_a_jump_with_the_spindle_tells_the_offset_whichever_logger_has_the_speed(
    table: pd.DataFrame, swapped: bool
) -> None:
    heat, probes = logged(table, [*HEAT, SPEED]), logged(jumping(table)[::2], PROBES, 1800)
    found = find_offset(probes, heat) if swapped else find_offset(heat, probes)
    assert found is not None
    assert abs(found.offset + (1800 if swapped else -1800)) < min(found.half, found.limit)
    assert found.clear
    assert found.limit == 240
    assert "after spindle_rpm" in found.evidence


def test_a_drift_is_told_where_it_is_clear(table: pd.DataFrame) -> None:
    days = pd.concat([table.assign(time_s=table["time_s"] + k * 45000.0) for k in range(8)], ignore_index=True)
    found = find_offset(logged(days, [*HEAT, SPEED]), logged(days, [*PROBES, SPEED], 900, 200e-6))
    assert found is not None
    assert abs(found.drift - 200e-6) < found.drift_half < 200e-6
    assert abs(found.offset - (900 + 200e-6 * found.middle)) < found.half


@pytest.mark.parametrize("step", [300.0, -900.0])
@pytest.mark.parametrize("share", [0.1, 0.3, 0.5])
def test_a_clock_that_was_set_meanwhile_is_not_corrected(table: pd.DataFrame, share: float, step: float) -> None:
    """One offset does not hold for the whole recording, however clear it is in most of it."""
    seconds = table["time_s"] + step * (np.arange(len(table)) > share * len(table))
    probes = table[[*PROBES, SPEED]].assign(time_s=seconds).sort_values("time_s")
    made = Recording.from_dataframe(probes.drop_duplicates("time_s").reset_index(drop=True), name="probes")
    _, told = join_two(logged(table, [*HEAT, SPEED]), replace(made, start=BEGIN.isoformat()))
    assert told.applied == 0
    assert told.estimate is None or not told.estimate.clear


@pytest.mark.parametrize("offset", [-900.0, 0.0, 700.0])
def test_on_a_measured_machine(shared_data: Path, offset: float) -> None:
    """There, the displacements seem to be 99 s before the spindle: a response alone is no proof of an offset."""
    measured = files.read(shared_data / "fl_thermal" / "recording.csv").to_frame().iloc[:6669]
    heat = [str(c) for c in measured if str(c).startswith("t") and str(c).endswith("_C")]
    probes = [str(c) for c in measured if str(c).endswith("_um")]
    first = logged(measured, [*heat, SPEED])
    for columns, applied in ((probes, False), ([*probes, SPEED], offset != 0)):
        joined, told = join_two(first, logged(measured, columns, offset))
        assert told.estimate is not None
        assert told.estimate.interval[0] <= offset <= told.estimate.interval[1]
        assert (told.applied != 0) == applied
        assert len(joined) > 6000


def test_heat_alone_is_not_clear_and_nothing_is_applied(table: pd.DataFrame) -> None:
    joined, told = join_two(logged(table, HEAT), logged(table[3:], PROBES, 300))
    assert told.estimate is None or not told.estimate.clear
    assert (told.applied, told.applied_drift) == (0, 0)
    assert "clocks taken as equal" in joined.clocks


@pytest.mark.parametrize(("half", "applied"), [(125, 0), (120, 400)])
def test_only_a_clear_offset_is_applied_and_the_file_says_so(
    table: pd.DataFrame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, half: float, applied: float
) -> None:
    told = ClockOffset(offset=400.0, half=half, drift=3e-4, drift_half=1e-4, limit=120.0, evidence="z_um after n")
    monkeypatch.setattr("thermocomp.recordings.joining.find_offset", lambda *_: told)
    joined, made = join_two(logged(table, HEAT), logged(table, PROBES))
    assert (made.applied, made.applied_drift) == (applied, 3e-4 if applied else 0)
    assert ("too uncertain to be applied" in joined.clocks) == (not applied)
    assert ("corrected, with a drift of +300 ppm" in joined.clocks) == bool(applied)
    for name in ("joined.csv", "joined.parquet"):
        files.write(joined, tmp_path / name)
        again = files.read(tmp_path / name)
        assert again.clocks == joined.clocks
        assert joined.clocks in again.notes


def test_an_interval_with_zero_changes_nothing(table: pd.DataFrame, monkeypatch: pytest.MonkeyPatch) -> None:
    told = ClockOffset(offset=40.0, half=60.0, drift=0.0, drift_half=1e-4, limit=120.0, evidence="z_um after n")
    monkeypatch.setattr("thermocomp.recordings.joining.find_offset", lambda *_: told)
    joined, made = join_two(logged(table, HEAT), logged(table, PROBES))
    assert made.applied == 0
    assert joined.clocks.startswith("probes: clocks agree: 40 s ahead")


def test_the_model_file_tells_how_the_clocks_were_brought_together(table: pd.DataFrame) -> None:
    joined, _ = join_two(logged(table, [*HEAT, SPEED]), logged(table, PROBES), 0.0)
    model = tc.fit(joined, "z_um", "ols", jobs=1).model
    assert model.provenance is not None
    assert model.provenance.clocks == (joined.clocks,)
    assert "as given" in model.provenance.clocks[0]


def test_nothing_is_told_by_recordings_without_common_cause(table: pd.DataFrame) -> None:
    noise = np.random.default_rng(0).normal(size=(len(table), 2))
    first = logged(table.assign(t_air_C=20 + noise[:, 0]), ["t_air_C", SPEED])
    joined, told = join_two(first, logged(table.assign(z_um=noise[:, 1]), ["z_um"]))
    assert told.estimate is None or not told.estimate.clear
    assert told.applied == 0
    assert "clocks taken as equal" in joined.clocks


def test_a_gap_is_not_interpolated_and_the_slower_clock_gives_the_rows(table: pd.DataFrame) -> None:
    there = (table["time_s"] < 20000) | (table["time_s"] > 23600)
    joined, _ = join_two(logged(table[there], [*HEAT, SPEED]), logged(table[::2], PROBES, 30.0), 0.0)
    assert joined.sampling_interval == 120
    started = (datetime.fromisoformat(joined.start) - BEGIN).total_seconds()
    inside = (started + joined.time > 20000) & (started + joined.time < 23600)
    assert inside.any()
    assert (joined.table[HEAT[0]].isna() == inside).all()
    assert joined.table[PROBES].notna().all(axis=None)
    assert set(joined.table[SPEED].dropna()) <= set(table[SPEED])  # no speed between two


def test_a_name_of_two_quantities_is_kept_twice(table: pd.DataFrame) -> None:
    other = table.assign(t_motor_C=table["t_air_C"] ** 2 / 20, t_air_C=table["t_air_C"] + 0.3)
    joined, told = join_two(logged(table, HEAT), logged(other, ["z_um", "t_motor_C", "t_air_C"]), 0.0)
    assert told.once == ("t_air_C",)
    assert told.renamed == (("t_motor_C", "t_motor_probes_C"),)
    assert joined.channel("t_motor_probes_C").quantity == "temperature"
    assert joined.table["t_motor_probes_C"].to_numpy() == pytest.approx(other["t_motor_C"].to_numpy())


def test_two_sensors_of_one_name_do_not_tell_the_offset(table: pd.DataFrame) -> None:
    late = table.assign(t_motor_C=table["t_column_front_left_C"])
    found = find_offset(logged(table, ["t_motor_C"]), logged(late, ["t_motor_C", "z_um"], 600))
    assert found is None or not found.clear


def test_what_cannot_be_joined_is_refused(table: pd.DataFrame) -> None:
    heat, probes = logged(table, HEAT), logged(table, PROBES, 86400)
    with pytest.raises(InputError, match=r"no hours in common.*\+24\.00 h.*--offset"):
        tc.join([heat, probes])
    assert len(tc.join([heat, probes], offset=86400).recording) == len(table)
    with pytest.raises(InputError, match="single recording"):
        tc.join(heat)
    with pytest.raises(InputError, match=r"2 offset\(s\) for 2 recordings"):
        tc.join([heat, probes], offset=[1.0, 2.0])


def test_files_of_two_loggers_get_the_command(
    table: pd.DataFrame, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    files.write(logged(table, [*HEAT, SPEED]), "heat.csv")
    files.write(logged(table, [*PROBES, SPEED], 460), "my probes.csv")
    command = "thermocomp join heat.csv 'my probes.csv' -o joined.parquet"
    assert [f.text for f in tc.check(["heat.csv", "my probes.csv"]).findings[0] if command in f.text]
    for verb in (tc.compare, tc.fit):
        with pytest.raises(InputError, match=command):
            verb(["heat.csv", "my probes.csv"], "z_um")
    assert run(["join", "heat.csv", "my probes.csv", "-o", "joined.parquet", "--json"]) == 0
    (told,) = json.loads(capsys.readouterr().out)["clocks"]
    assert abs(told["applied_offset_s"] - 460) < 60
    assert tc.read("joined.parquet").clocks == told["text"]
    assert run(["join", "heat.csv", "my probes.csv", "--offset", "-20", "-o", "joined.csv"]) == 0
    assert "20 s behind, as given" in " ".join(capsys.readouterr().out.split())


def test_complete_recordings_and_other_days_are_left_alone(table: pd.DataFrame) -> None:
    both = logged(table, [*HEAT, *PROBES])
    later = logged(table, PROBES, 200_000)
    found = tc.check([both, logged(table, HEAT, 100_000), later])
    assert not [f for each in found.findings for f in each if f.kind == "loggers"]


@pytest.mark.parametrize("rows", [2, 5, 59, 61, 130])
@pytest.mark.parametrize("dt", [0.1, 1.0, 60.0])
def test_a_short_recording_tells_nothing_wrong(table: pd.DataFrame, rows: int, dt: float) -> None:
    short = table[:rows].assign(time_s=dt * np.arange(rows))
    joined, told = join_two(logged(short, [*HEAT, SPEED]), logged(short, [*PROBES, SPEED, "t_air_C"]))
    assert len(joined) == rows
    assert told.applied == 0
