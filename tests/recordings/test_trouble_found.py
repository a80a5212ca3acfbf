"""Faults that a logger, its set-up or a hand puts into a sound recording, and near misses that must stay silent."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from thermocomp.recordings.checks.findings import Finding, Signal, speed_changes
from thermocomp.recordings.checks.jumps import find_edges
from thermocomp.recordings.checks.quality import check, lasting_trouble, troubled_rows
from thermocomp.recordings.readers.mapping import ColumnMap, Mapping, TimeColumn
from thermocomp.recordings.readers.recordings import read
from thermocomp.recordings.recording import Recording
from thermocomp.virtual import datasets as virtual

FloatArray = NDArray[np.float64]


@cache
def _demo() -> Recording:
    return virtual.record("demo")[0]


@pytest.fixture(scope="module")
def demo() -> Recording:
    """30 h, a row every 20 s, 16 temperatures, 5 probes, six runs of the spindle."""
    return _demo()


@pytest.fixture(scope="module")
def real(shared_data: Path) -> Recording:
    """37 h of a real machine."""
    return read(shared_data / "fl_thermal" / "recording.csv")


def _changed(recording: Recording, names: Sequence[str], change: Callable[[FloatArray], FloatArray]) -> Recording:
    table = recording.table.copy()
    for name in names:
        table[name] = change(table[name].to_numpy(dtype=np.float64).copy())
    return replace(recording, table=table)


def _from(row: int, height: float, until: int | None = None) -> Callable[[FloatArray], FloatArray]:
    def step(x: FloatArray) -> FloatArray:
        x[row:until] += height
        return x

    return step


def _trouble(recording: Recording) -> list[Finding]:
    return [f for f in check(recording) if f.severity == "trouble"]


def _told(recording: Recording) -> list[tuple[str, str]]:
    return [(f.channel, f.kind) for f in _trouble(recording)]


def _names(recording: Recording, quantity: str) -> list[str]:
    return [c.name for c in recording.of_quantity(quantity)]


# -- units ------------------------------------------------------------------------------------------------------------

UNITS = {"K": lambda x: x + 273.15, "degF": lambda x: 1.8 * x + 32}


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("which", ["demo", "real", "random", "wessel-tool"])
def test_temperatures_in_another_unit_are_told(unit: str, which: str, request: pytest.FixtureRequest) -> None:
    recording = request.getfixturevalue(which) if which in ("demo", "real") else virtual.record(which)[0]
    names = _names(recording, "temperature")

    found = _trouble(_changed(recording, names, UNITS[unit]))

    assert [(f.channel, f.kind) for f in found] == [(n, "unit") for n in names]
    assert all(f'unit = "{unit}"' in f.text and f.rows is None for f in found)


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("name", ["t_motor_C", "t_air_C", "t_bed_front_C"])
def test_one_sensor_in_another_unit_is_told(unit: str, name: str, demo: Recording) -> None:
    assert _told(_changed(demo, [name], UNITS[unit])) == [(name, "unit")]


def test_a_hot_part_is_no_fahrenheit(demo: Recording) -> None:
    """A heated bed at 70 degC, a spindle of up to 85 degC, a machine in a hall of 38 degC."""
    rng = np.random.default_rng(1)
    assert _told(_changed(demo, ["t_motor_C"], lambda x: 70 + 0.1 * rng.normal(size=len(x)))) == []
    assert _told(_changed(demo, ["t_motor_C"], lambda x: 21 + 4 * (x - x[0]))) == []
    assert _told(_changed(demo, _names(demo, "temperature"), lambda x: x + 16)) == []


@pytest.mark.parametrize("which", ["demo", "real", "random", "precompensation"])
def test_millimetres_called_micrometres_are_told(which: str, request: pytest.FixtureRequest) -> None:
    recording = request.getfixturevalue(which) if which in ("demo", "real") else virtual.record(which)[0]
    names = _names(recording, "displacement")

    for wrong in (names, names[-1:]):
        found = _trouble(_changed(recording, wrong, lambda x: x / 1000))
        assert [(f.channel, f.kind) for f in found] == [(n, "unit") for n in wrong]
        assert all('unit = "mm"' in f.text for f in found)


def test_a_probe_that_hardly_moves_is_no_millimetre(demo: Recording) -> None:
    """Noise of 0.1 um alone; and a still machine, where it is but a warning."""
    rng = np.random.default_rng(2)
    assert _told(_changed(demo, ["x1_um"], lambda x: 0.1 * rng.normal(size=len(x)))) == []
    still = _changed(demo, _names(demo, "temperature"), lambda x: x[0] + 0.04 * rng.normal(size=len(x)))
    still = _changed(still, ["x1_um"], lambda x: 0.01 * rng.normal(size=len(x)))
    assert [(f.severity, f.channel) for f in check(still) if f.kind == "unit"] == [("warning", "x1_um")]


@pytest.mark.parametrize("which", ["demo", "real", "random", "hwang", "wessel-tool"])
def test_milliseconds_called_seconds_are_told(which: str, request: pytest.FixtureRequest) -> None:
    recording = request.getfixturevalue(which) if which in ("demo", "real") else virtual.record(which)[0]

    found = _trouble(replace(recording, time=1000 * recording.time))

    assert [(f.channel, f.kind) for f in found] == [("", "time unit")]
    assert '[time] unit = "ms"' in found[0].text


@pytest.mark.parametrize("interval", [1.0, 2.0])
def test_milliseconds_are_told_by_the_slowness_of_the_sensors_too(interval: float, demo: Recording) -> None:
    """Rows a second apart are 17 min apart as ms, which alone would be nothing special."""
    time = np.arange(0.0, 6 * 3600.0, interval)
    fine = {n: np.interp(time, demo.time, demo.table[n]) for n in demo.table.columns}
    cycles = (replace(demo.cycles[0], stop=len(time)),)
    recording = replace(demo, time=time, table=pd.DataFrame(fine), cycles=cycles)

    assert "time unit" not in [k for _, k in _told(recording)]
    told = [f for f in _trouble(replace(recording, time=1000 * time)) if f.kind == "time unit"]
    assert len(told) == 1
    assert "days for half of their range" in told[0].text


def test_a_slow_test_is_no_millisecond(demo: Recording) -> None:
    """A row every 20 min, and a machine ten times as slow."""
    assert _told(virtual.record("chen1996-slope")[0]) == []
    assert "time unit" not in [k for _, k in _told(replace(demo, time=10 * demo.time))]


def test_what_a_unit_is_told_to_be_can_be_said_in_a_mapping(tmp_path: Path, demo: Recording) -> None:
    wrong = _changed(demo, ["t_motor_C"], UNITS["K"])
    wrong = _changed(wrong, ["z_um"], lambda x: x / 1000)
    path = tmp_path / "rec.csv"
    wrong.table.assign(time_s=1000 * wrong.time).to_csv(path, index=False)
    columns = {"t_motor": ColumnMap("t_motor_C", unit="K"), "z": ColumnMap("z_um", role="displacement", unit="mm")}

    mended = read(path, Mapping(TimeColumn(unit="ms"), columns))

    assert {k for _, k in _told(read(path))} == {"unit", "time unit"}
    assert _told(mended) == []
    np.testing.assert_allclose(mended.table["z"], demo.table["z_um"])


# -- steps and swaps --------------------------------------------------------------------------------------------------


@settings(deadline=None, max_examples=10)
@given(row=st.integers(30, 5400), pick=st.integers(0, 20), up=st.booleans())
def test_a_step_of_one_channel_is_told_wherever_it_is(row: int, pick: int, up: bool) -> None:
    recording = _demo()
    names = _names(recording, "temperature") + _names(recording, "displacement")
    name = names[pick]
    height = (1 if up else -1) * (3.0 if name.endswith("_C") else 30.0)

    found = _trouble(_changed(recording, [name], _from(row, height)))

    assert [(f.channel, f.kind) for f in found] == [(name, "step")]
    if name.endswith("_C"):  # its values from there on are left out
        assert found[0].rows is not None
        assert abs(found[0].rows[0] - row) <= 1
        assert found[0].rows[-1] == len(recording) - 1
    else:
        assert found[0].rows is None
    told = float(found[0].text.split("by ")[1].split()[0])
    # what the channel itself does there, as where the spindle's speed changes, cannot be told from the step
    own = float(recording.table[name].diff()[row - 1 : row + 2].abs().max())
    assert told == pytest.approx(height, abs=own + (0.25 if name.endswith("_C") else 1.0))
    rows = int(found[0].text.split("row ")[1].split()[0])
    assert abs(rows - row) <= 1


@pytest.mark.parametrize(("name", "height"), [("ch1_um", 30.0), ("ch5_um", -30.0), ("t1_C", 3.0), ("t9_C", -3.0)])
@pytest.mark.parametrize("row", [700, 4446, 8000])
def test_a_step_is_told_on_a_real_machine(name: str, height: float, row: int, real: Recording) -> None:
    found = _trouble(_changed(real, [name], _from(row, height)))
    assert [(f.channel, f.kind) for f in found] == [(name, "step")]
    assert f"row {row} " in found[0].text or f"row {row + 1} " in found[0].text


@pytest.mark.parametrize(("name", "silent", "told"), [("x1_um", 4.0, 6.0), ("t_air_C", 1.3, 2.0)])
def test_where_the_finding_of_steps_begins(name: str, silent: float, told: float, demo: Recording) -> None:
    """At 5 um and 1.5 degC where the noise is 0.15 um and 0.05 degC; below it is left to the eye."""
    for row in (1000, 3000):
        assert _told(_changed(demo, [name], _from(row, silent))) == []
        assert _told(_changed(demo, [name], _from(row, told))) == [(name, "step")]


def test_a_step_that_takes_two_rows_is_told(demo: Recording) -> None:
    """A logger that writes means splits a step."""

    def split(x: FloatArray) -> FloatArray:
        x[2000] += 14.0
        x[2001:] += 30.0
        return x

    assert _told(_changed(demo, ["y1_um"], split)) == [("y1_um", "step")]


def test_jumps_that_the_machine_makes_are_no_steps(demo: Recording) -> None:
    """All probes or two of them together; what happens at each start of the spindle; a slow rise; a thermostat."""
    probes = _names(demo, "displacement")
    assert _told(_changed(demo, probes, _from(2000, 30.0))) == []
    assert _told(_changed(demo, probes[:2], _from(2000, 30.0))) == []
    speed = demo.table["spindle_rpm"].to_numpy()
    changes = speed_changes(speed, len(demo))
    turning = np.concatenate([[0.0], (speed[1:] > 0)])
    assert changes.any()
    assert _told(_changed(demo, ["z_um"], lambda x: x + 30 * turning)) == []
    assert _told(_changed(demo, ["z_um"], lambda x: x + np.interp(np.arange(len(x)), [2000, 2300], [0, 30]))) == []
    cycling = 3.0 * (np.arange(len(demo)) // 90 % 2)
    assert (
        _told(_changed(demo, ["t_coolant_C" if "t_coolant_C" in demo.table else "t_air_C"], lambda x: x + cycling))
        == []
    )


def test_a_step_that_comes_back_names_its_rows(demo: Recording) -> None:
    found = _trouble(_changed(demo, ["y2_um"], _from(2000, 40.0, 2100)))

    assert [(f.channel, f.kind) for f in found] == [("y2_um", "step")]
    (rows,) = troubled_rows(demo, found).values()
    assert set(range(2000, 2100)) <= set(np.flatnonzero(rows))
    assert rows.sum() <= 103
    assert lasting_trouble(found) == ()


@settings(deadline=None, max_examples=10)
@given(row=st.integers(700, 5200), a=st.integers(0, 15), b=st.integers(0, 15))
def test_two_sensors_that_change_places_are_told(row: int, a: int, b: int) -> None:
    """Where they differ by over 1.5 degC at that moment, and no third one may have jumped."""
    recording = _demo()
    names = _names(recording, "temperature")
    one, two = (recording.table[names[k]].to_numpy() for k in (a, b))
    apart = abs(float(np.median(one[row - 5 : row + 5] - two[row - 5 : row + 5])))
    swapped = _swapped(recording, names[a], names[b], row)
    third = any(
        find_edges(Signal(c, x, np.isfinite(x))).near(row, clearly=False)
        for c in recording.channels
        if c.name not in (names[a], names[b])
        for x in [recording.table[c.name].to_numpy()]
    )

    if apart > 2.0 and not third:  # the noise of a row may take some of it
        assert set(_told(swapped)) == {(names[a], "swapped"), (names[b], "swapped")}
    else:
        assert {k for _, k in _told(swapped)} <= {"swapped"}


@pytest.mark.parametrize(("a", "b"), [("t5_C", "t9_C"), ("t1_C", "t9_C"), ("ch1_um", "ch5_um")])
@pytest.mark.parametrize("row", [3000, 5000])
def test_a_swap_is_told_on_a_real_machine(a: str, b: str, row: int, real: Recording) -> None:
    found = _trouble(_swapped(real, a, b, row))
    assert {(f.channel, f.kind) for f in found} == {(a, "swapped"), (b, "swapped")}
    assert all(f"row {row} " in f.text and f.rows is None for f in found)


def _swapped(recording: Recording, a: str, b: str, row: int) -> Recording:
    table = recording.table.copy()
    one, two = table[a].to_numpy().copy(), table[b].to_numpy().copy()
    table[a] = np.r_[one[:row], two[row:]]
    table[b] = np.r_[two[:row], one[row:]]
    return replace(recording, table=table)


# -- clocks -----------------------------------------------------------------------------------------------------------


def _late(recording: Recording, names: Sequence[str], minutes: float) -> Recording:
    """Return the columns as a logger with a late clock writes them: what they say comes later."""
    table = recording.table.copy()
    time = recording.time
    rng = np.random.default_rng(3)
    for name in names:
        x = table[name].to_numpy()
        table[name] = np.interp(time - 60 * minutes, time, x)
        beyond = (time - 60 * minutes < time[0]) | (time - 60 * minutes > time[-1])
        noise = np.median(np.abs(np.diff(x)))
        table.loc[beyond, name] += noise * rng.normal(size=int(beyond.sum()))
    return replace(recording, table=table)


@pytest.mark.parametrize("minutes", [-20.0, 20.0, -12.0, 35.0])
@pytest.mark.parametrize("which", ["demo", "real", "random"])
def test_a_clock_that_is_off_is_told(which: str, minutes: float, request: pytest.FixtureRequest) -> None:
    recording = request.getfixturevalue(which) if which in ("demo", "real") else virtual.record(which)[0]
    temperatures, probes = (_names(recording, q) for q in ("temperature", "displacement"))
    for group in (temperatures, probes, temperatures + probes):
        (found,) = [f for f in _trouble(_late(recording, group, minutes)) if f.kind == "clock"]
        told = float(found.text.split("about ")[1].split()[0])
        assert told == pytest.approx(abs(minutes), abs=4)
        assert f"min {'before' if minutes < 0 else 'after'} the changes of the spindle speed" in found.text
        names = found.text.split("responses of ")[1].split(" come about")[0].split(" and ")[0].split(", ")
        assert set(names) <= set(group)
        assert found.rows is None


def test_single_sensors_of_another_logger_are_told(real: Recording) -> None:
    (found,) = [f for f in _trouble(_late(real, ["t5_C"], -20)) if f.kind == "clock"]
    assert found.channel == "t5_C"
    assert "the responses of t5_C come about 20 min before the changes of the spindle speed" in found.text


@pytest.mark.parametrize("name", ["t_front_seat_C", "t_motor_C"])
@pytest.mark.parametrize("minutes", [-40.0, -45.0, -50.0])
def test_a_clock_that_is_off_by_more_than_is_tried_is_found(demo: Recording, name: str, minutes: float) -> None:
    (found,) = [f for f in _trouble(_late(demo, [name], minutes)) if f.kind == "clock"]
    assert found.channel == name
    assert "before the changes of the spindle speed" in found.text


def test_the_lag_of_heat_and_of_a_sensor_is_no_clock(demo: Recording) -> None:
    """Sensors far from the spindle; all of them behind a lag of 20 min; a clock that is 3 min off."""
    alpha = 1 - np.exp(-20 / 1200)

    def lagging(x: FloatArray) -> FloatArray:
        out = x.copy()
        for k in range(1, len(x)):
            out[k] = out[k - 1] + alpha * (x[k] - out[k - 1])
        return out + 0.04 * np.random.default_rng(4).normal(size=len(x))

    assert _told(_changed(demo, _names(demo, "temperature"), lagging)) == []
    assert "clock" not in [k for _, k in _told(_late(demo, _names(demo, "temperature"), 3))]


# -- spikes and resolution --------------------------------------------------------------------------------------------


@settings(deadline=None, max_examples=10)
@given(
    row=st.integers(20, 5400), length=st.integers(2, 10), pick=st.integers(0, 4), size=st.sampled_from([-4300.0, 200.0])
)
def test_outliers_in_a_row_are_told_with_their_rows(row: int, length: int, pick: int, size: float) -> None:
    recording = _demo()
    name = _names(recording, "displacement")[pick]
    rng = np.random.default_rng(row)

    def fault(x: FloatArray) -> FloatArray:
        x[row : row + length] += size * rng.uniform(0.5, 1.5, size=length)
        return x

    found = _trouble(_changed(recording, [name], fault))

    assert [(f.channel, f.kind) for f in found] == [(name, "spike")]
    assert f"1 spike of {length} rows" in found[0].text
    (rows,) = troubled_rows(recording, found).values()
    assert np.flatnonzero(rows).tolist() == list(range(row, row + length))


@pytest.mark.parametrize("row", [1000, 4445, 7000])
@pytest.mark.parametrize(("name", "size"), [("ch3_um", 4300.0), ("t5_C", 60.0), ("t16_C", -18.0)])
def test_two_outliers_are_told_on_a_real_machine(name: str, size: float, row: int, real: Recording) -> None:
    found = _trouble(_changed(real, [name], _from(row, size, row + 2)))
    assert [(f.channel, f.kind) for f in found] == [(name, "spike")]
    assert {row, row + 1} <= set(np.flatnonzero(troubled_rows(real, found)[name]))


def test_many_outliers_do_not_hide_each_other(demo: Recording) -> None:
    """Each of 60 pairs is 4.3 mm high: 2 % of the rows, so that a span of 1 to 99 % would be as wide as they are."""

    def fault(x: FloatArray) -> FloatArray:
        for row in range(100, 5200, 85):
            x[row : row + 2] += 4300.0
        return x

    (found,) = _trouble(_changed(demo, ["z_um"], fault))
    assert found.kind == "spike"
    assert found.text.startswith("60 spikes of up to 2 rows")


def test_a_short_run_of_the_spindle_is_no_outlier(demo: Recording) -> None:
    """Three rows at speed, in which the spindle grows by 8 um."""
    table = demo.table.copy()
    still = int(np.flatnonzero(table["spindle_rpm"].to_numpy() == 0)[-400])
    table.loc[still : still + 2, "spindle_rpm"] = 3000.0
    table.loc[still : still + 2, "z_um"] += 8.0
    assert [f for f in check(replace(demo, table=table)) if f.kind == "spike"] == []


@pytest.mark.parametrize("step", [0.1, 0.25, 0.5, 1.0])
def test_a_quantised_column_does_not_stand_still(step: float, demo: Recording) -> None:
    for seed in range(3):
        recording = virtual.record("demo", seed=seed)[0] if seed else demo
        coarse = _changed(recording, _names(recording, "displacement"), lambda x: np.round(x / step) * step)
        assert _told(coarse) == []


@pytest.mark.parametrize("step", [0.1, 0.25])
def test_a_quantised_column_of_a_real_machine_does_not_stand_still(step: float, real: Recording) -> None:
    names = _names(real, "displacement") + _names(real, "temperature")
    assert _told(_changed(real, names, lambda x: np.round(x / step) * step)) == []


def test_a_quantised_column_that_does_stand_still_is_told(demo: Recording) -> None:
    """Noise of one step and more never lets a value stand for a hundred rows."""

    def fault(x: FloatArray) -> FloatArray:
        x = np.round((x + 0.25 * np.random.default_rng(5).normal(size=len(x))) / 0.25) * 0.25
        x[3000:3100] = x[3000]
        return x

    found = _trouble(_changed(demo, ["z_um"], fault))
    assert [f.kind for f in found] == ["stuck"]
    assert np.flatnonzero(troubled_rows(demo, found)["z_um"]).tolist() == pytest.approx(list(range(3001, 3100)), abs=3)


# -- the start --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "start"), [("z_um", -25.0), ("y1_um", 10.0), ("x1_um", 3.0)])
def test_a_displacement_that_does_not_start_at_its_zero_is_a_warning(name: str, start: float, demo: Recording) -> None:
    found = [f for f in check(_changed(demo, [name], lambda x: x + start)) if f.kind == "not zeroed"]
    assert [(f.severity, f.channel) for f in found] == [("warning", name)]
    assert float(found[0].text.split("at ")[1].split()[0]) == pytest.approx(start, abs=0.5)


def test_a_continued_recording_is_told_and_a_noisy_start_is_not(demo: Recording, real: Recording) -> None:
    half = len(real) // 2
    rest = replace(
        real,
        time=real.time[half:] - real.time[half],
        table=real.table.iloc[half:].reset_index(drop=True),
        cycles=(replace(real.cycles[0], start=0, stop=len(real) - half),),
    )
    assert {f.channel for f in check(rest) if f.kind == "not zeroed"} >= {"ch3_um", "ch4_um"}
    assert [f for f in check(demo) if f.kind == "not zeroed"] == []

    def first(x: FloatArray) -> FloatArray:
        x[0] += 30.0
        return x

    assert [f.kind for f in check(_changed(demo, ["z_um"], first)) if f.kind == "not zeroed"] == []
