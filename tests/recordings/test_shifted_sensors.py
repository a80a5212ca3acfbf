"""Temperatures that start off the others in some recordings: named with the recordings in which they do."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
import pytest

import thermocomp as tc
from thermocomp.core.machine import Channel
from thermocomp.judging.guards import find_guard
from thermocomp.models.watching import find_watch
from thermocomp.recordings.checks.findings import Finding
from thermocomp.recordings.checks.offsets import compare_starts
from thermocomp.recordings.cycles import make_single_cycle
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.stacking import stack


def day(number: int, off: Sequence[float] = (), sensors: int = 6) -> Recording:
    """Return a warm-up of a machine on a day of its own temperature; `off` is added to its first sensors."""
    rng = np.random.default_rng(number)
    time = np.arange(0.0, 3600.0, 30.0)
    rise = np.outer(1 - np.exp(-time / 1200), np.linspace(1.0, 8.0, sensors)) + rng.normal(0, 0.1, (len(time), sensors))
    values = 18.0 + 3.0 * np.sin(number) + np.linspace(0.0, 1.0, sensors) + rise
    values[:, : len(off)] += off
    table = pd.DataFrame(values, columns=[f"t{k}_C" for k in range(sensors)])
    table["z_um"] = rise.sum(axis=1)
    channels = [Channel(c, "temperature", "degC", "") for c in table.columns[:-1]]
    channels.append(Channel("z_um", "displacement", "um", ""))
    return Recording(f"day {number}", time, table, tuple(channels), make_single_cycle(len(time)))


def found(recordings: Sequence[Recording]) -> list[tuple[int, Finding]]:
    return [(k, f) for k, of in enumerate(compare_starts(recordings)) for f in of]


def test_days_of_other_temperatures_are_alike() -> None:
    assert not found([day(k) for k in range(8)])


@pytest.mark.parametrize("off", [(1.5,), (-31.0,), (40.0, -5.0), (20.0, 20.0, 20.0), (-3.0, 8.0, 40.0)])
@pytest.mark.parametrize(("begin", "end"), [(3, 4), (5, 8), (0, 1)])
def test_shifted_sensors_are_named_since_when_and_until_when(off: Sequence[float], begin: int, end: int) -> None:
    told = found([day(k, off if begin <= k < end else ()) for k in range(8)])
    assert [k for k, _ in told] == [begin] * len(off)
    for (_, f), name, amount in zip(told, ("t0_C", "t1_C", "t2_C"), off, strict=False):
        assert (f.severity, f.channel, f.kind) == ("warning", name, "offset")
        assert float(f.text.split()[1]) == pytest.approx(amount, abs=0.3)
        until = f"until day {end - 1}" if end < 8 else "to the last one"
        assert f"from here {until} ({end - begin} of 8)" in f.text


def test_a_machine_that_started_warm_has_no_shifted_sensors() -> None:
    assert not found([day(k, (4.0, 3.0, 5.0, 2.5, 6.0) if k == 3 else (), sensors=8) for k in range(8)])


def test_few_recordings_or_sensors_are_not_compared() -> None:
    assert not found([])
    assert not found([day(0, (30.0,))])
    assert not found([day(0, (30.0,), sensors=2), day(1, sensors=2)])


def test_a_missing_first_value_is_no_offset() -> None:
    broken = day(2)
    broken.table.loc[:3, "t1_C"] = np.nan
    assert not found([day(0), day(1), broken, day(3)])


def test_with_a_file_left_out_lost_sensors_are_replaced_as_at_the_machine() -> None:
    days = [day(k) for k in range(4)]
    samples = stack(days, ["z_um"])
    assert find_watch(samples, samples.test != 2) is not None
    guard = find_guard(samples, samples.test != 2, samples.test == 2)
    assert guard is not None
    last = guard.readings["t5_C",][5][samples.test == 2]
    assert np.ptp(last) > 4.0  # it read its zero all day; the others tell its rise of 8 degC


def test_check_and_fit_report_it() -> None:
    days = [day(k, (31.0,) if k > 3 else ()) for k in range(6)]
    assert "offset" in [f.kind for f in tc.check(days).findings[4]]
    fitted = tc.fit(days, "z_um", "ols", leave_one="file", jobs=1)
    assert any("t0_C starts +30." in text for text in fitted.trouble)
    assert fitted.models["z_um"].inputs[0].reference < 25.0
    judged = tc.assess(fitted, [day(9, (-20.0,))]).judged
    assert judged.offsets["day 9"] == {"t0_C": pytest.approx(-20.0, abs=2.0)}


@pytest.mark.parametrize(("sensors", "off"), [(3, 20.0), (4, 20.0), (5, -40.0), (3, 5.0), (4, 5.0), (5, 5.0)])
def test_of_few_sensors_most_of_which_are_off_all_are_told(sensors: int, off: float) -> None:
    """Two of three to five, on one day: the sound one was named, or none. By 5 degC nothing tells which are right."""
    for shifted in (2, 3) if sensors > 3 else (2,):
        told = found([day(k, [off] * shifted if k == 4 else (), sensors=sensors) for k in range(8)])
        assert {k for k, _ in told} == {4}
        named = {f.channel for _, f in told}
        if abs(off) > 15.0 or 2 * shifted < sensors:  # no day is so much warmer
            assert named == {f"t{k}_C" for k in range(shifted)}
        for _, f in told:
            assert ("or the others are off" in f.text) == (abs(off) <= 15.0)


def test_sensors_that_are_off_by_different_amounts_are_told() -> None:
    told = found([day(k, (5.0, -5.0, 20.0) if k == 4 else (), sensors=5) for k in range(8)])
    assert {f.channel for _, f in told} == {"t0_C", "t1_C", "t2_C"}


def test_a_sensor_far_off_is_named_on_a_machine_that_started_warm() -> None:
    told = found([day(k, (4.0, 3.0, 5.0, 2.5, 30.0) if k == 3 else (), sensors=16) for k in range(8)])
    assert [f.channel for _, f in told] == ["t4_C"]
