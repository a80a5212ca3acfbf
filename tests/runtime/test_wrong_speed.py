"""A spindle speed that is wrong or missing: found by the heat that it should cause, named, and replaced."""

from dataclasses import replace
from functools import cache
from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray

from thermocomp.core.exceptions import SettingError
from thermocomp.core.heatcheck import SpeedFault
from thermocomp.core.watch import Watch
from thermocomp.judging.watchrun import run_watch
from thermocomp.models.watching import find_watch
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack
from thermocomp.runtime.watchstate import MISSING, OFF
from thermocomp.virtual import datasets as virtual

FloatArray = NDArray[np.float64]
Physics = Literal["linear", "nonlinear"]
SIX = ("t_front_seat_C", "t_motor_C", "t_housing_C", "t_column_front_right_C", "t_enclosure_C", "t_air_C")
FAULTS = ("zero", "per second", "stuck", "half", "far too high")
WITHIN = 20 * 60.0


@cache
def day(physics: Physics, seed: int, few: bool) -> Samples:
    whole = stack(virtual.record("demo", physics=physics, seed=seed), ["z_um"])
    return whole.only([*SIX, "spindle_rpm"]) if few else whole


@cache
def fitted(physics: Physics, few: bool) -> Watch:
    samples = day(physics, 0, few)
    found = find_watch(samples, samples.cycle >= 0)
    assert found is not None
    return found


def spoil(speed: FloatArray, row: int, kind: str) -> FloatArray:
    found = speed.copy()
    right = speed[row:]
    found[row:] = {
        "zero": 0.0 * right,
        "per second": right / 60.0,
        "stuck": np.full_like(right, speed[row]),
        "half": right / 2.0,
        "far too high": np.full_like(right, 12_000.0),
    }[kind]
    return found


def run(watch: Watch, samples: Samples, speed: FloatArray) -> tuple[FloatArray, NDArray[np.int8]]:
    """Return the speed passed on, and the faults, (n_rows, n_failing)."""
    names = [c.name for c in samples.inputs]
    values = samples.values[:, [names.index(i.name) for i in watch.inputs]].copy()
    values[:, -1] = speed
    passed, faults = run_watch(watch, samples.time, values, samples.stands)
    return passed[:, -1], faults


@pytest.mark.parametrize("few", [False, True], ids=["all", "six"])
@pytest.mark.parametrize("physics", ["linear", "nonlinear"])
def test_a_wrong_speed_is_named_within_20_minutes_of_running(physics: Physics, few: bool) -> None:
    """Of a quarter of the top speed and more; another seed than in the training, 20 instants of each fault."""
    watch, samples = fitted(physics, few), day(physics, 11, few)
    right = samples.values[:, [c.name for c in samples.inputs].index("spindle_rpm")]
    rng, delays, sound = np.random.default_rng(4), list[float](), 0
    for kind in FAULTS:
        done = 0
        while done < 20:
            row = int(rng.integers(90, len(right) - 90))
            speed = spoil(right, row, kind)
            wrong = np.abs(speed - right) >= 0.25 * watch.top_speed
            lasted = np.cumsum(np.where(wrong, np.diff(samples.time, prepend=samples.time[0]), 0.0))
            if lasted[-1] < WITHIN:
                continue
            done += 1
            _, faults = run(watch, samples, speed)
            named = np.flatnonzero(faults[:, -1] == OFF)
            delays.append(float(lasted[named[0]]) if named.size else np.inf)
            sound += bool(faults[:, :-1].any())
    assert np.mean(np.array(delays) <= WITHIN) >= 0.95
    assert sound <= 0.02 * len(delays)


@pytest.mark.parametrize("few", [False, True], ids=["all", "six"])
def test_a_right_speed_is_never_named(few: bool) -> None:
    watch = fitted("linear", few)
    for seed in (11, 12, 13):
        samples = day("linear", seed, few)
        right = samples.values[:, [c.name for c in samples.inputs].index("spindle_rpm")]
        passed, faults = run(watch, samples, right)
        assert not faults.any()
        assert np.array_equal(passed, right)


def test_what_stands_in_for_a_wrong_speed_is_near_the_right_one() -> None:
    watch, samples = fitted("linear", few=False), day("linear", 11, few=False)
    right = samples.values[:, [c.name for c in samples.inputs].index("spindle_rpm")]
    passed, faults = run(watch, samples, spoil(right, 1200, "zero"))
    later = slice(int(np.flatnonzero(faults[:, -1] == OFF)[0]) + 30, None)
    apart = passed[later] - right[later]
    assert np.sqrt(np.mean(apart**2)) < 0.35 * np.sqrt(np.mean(right[later] ** 2))


def test_what_stands_in_for_a_missing_speed_does_not_lag_behind_it() -> None:
    """The heat is estimated after a lag of ten minutes; six minutes after a start, 0.4 of the speed were passed on."""
    watch, samples = fitted("linear", True), day("linear", 11, True)
    right = samples.values[:, [c.name for c in samples.inputs].index("spindle_rpm")]
    passed, _ = run(watch, samples, np.where(np.arange(len(right)) < 60, right, np.nan))
    pace = float(samples.time[1] - samples.time[0])
    rest, soon = round(1800.0 / pace), round(360.0 / pace)
    starts = [k for k in range(60 + rest, len(right) - soon) if right[k] > 0.0 and not right[k - rest : k].any()]
    assert len(starts) > 3
    shares = [passed[k + soon] / right[k + soon] for k in starts]
    assert 0.6 < float(np.median(shares)) < 1.2, shares
    assert float(np.mean(passed[60:])) == pytest.approx(float(np.mean(right[60:])), rel=0.1)


@pytest.mark.parametrize("rows", [1, 30, 1000])
def test_a_missing_speed_is_replaced_at_once_and_trusted_again_as_soon_as_it_was_gone(rows: int) -> None:
    watch, samples = fitted("linear", few=False), day("linear", 11, few=False)
    right = samples.values[:, [c.name for c in samples.inputs].index("spindle_rpm")]
    speed, row = right.copy(), 1200
    speed[row : row + rows] = np.nan
    passed, faults = run(watch, samples, speed)
    gone = faults[:, -1] == MISSING
    assert np.isfinite(passed[30:]).all()
    assert gone[row : row + rows].all()
    assert not faults[:, :-1].any()
    until = samples.time[row + rows] + min(20.0 * rows, 600.0) + 40.0
    assert not gone[samples.time > until].any()


@pytest.mark.parametrize("kind", ["zero", "far too high"])
def test_a_speed_that_is_missing_after_it_was_wrong_is_wrong(kind: str) -> None:
    """The models remember it: with a substitute a correction would go on from wrong states."""
    watch, samples = fitted("linear", few=False), day("linear", 11, few=False)
    right = samples.values[:, [c.name for c in samples.inputs].index("spindle_rpm")]
    speed = spoil(right, 1200, kind)
    speed[1218:] = np.nan
    _, faults = run(watch, samples, speed)
    assert set(faults[1230:, -1].tolist()) == {OFF}
    assert not faults[:, :-1].any()


def test_a_right_speed_that_was_wrong_is_trusted_again_after_eight_hours_with_the_spindle_turning() -> None:
    """The command goes on for half an hour at a stopped spindle: behind an open door."""
    watch, samples = fitted("linear", few=False), day("linear", 11, few=False)
    right, time = samples.values[:, [c.name for c in samples.inputs].index("spindle_rpm")], samples.time
    _, faults = run(watch, samples, np.where((time > 3.5 * 3600.0) & (time < 4.0 * 3600.0), watch.top_speed, right))
    named = np.flatnonzero(faults[:, -1] == OFF)
    assert 3.5 <= time[named[0]] / 3600.0 <= 4.0
    assert 12.0 <= time[named[-1]] / 3600.0 <= 13.0
    assert right[named[-1]] > 0.0
    assert not faults[named[-1] + 1 :].any()


def test_a_speed_is_not_trusted_again_while_a_temperature_is_wrong() -> None:
    """Which nobody has judged meanwhile: the predictions are not sure with an estimated speed."""
    watch, samples = fitted("linear", few=True), day("linear", 11, few=True)
    names, time = [c.name for c in samples.inputs], samples.time
    right, values = samples.values[:, names.index("spindle_rpm")], samples.values.copy()
    command = np.where((time > 3.5 * 3600.0) & (time < 4.0 * 3600.0), watch.top_speed, right)
    values[:, names.index("t_column_front_right_C")] += 0.7 * np.maximum(time / 3600.0 - 5.0, 0.0)  # [degC]
    _, faults = run(watch, replace(samples, values=values), command)
    rejected = np.flatnonzero(faults[:, -1] == OFF)
    assert np.array_equal(rejected, np.arange(rejected[0], len(time)))
    _, faults = run(watch, samples, command)
    assert faults[-1, -1] == 0


@pytest.mark.parametrize("kind", ["zero", "half"])
def test_a_speed_that_stays_wrong_is_not_trusted_after_a_night_at_rest(kind: str) -> None:
    """For which two hours stand here: at rest it agrees; half the speed is then trusted until the spindle is warm."""
    few, samples = fitted("linear", few=False), day("linear", 11, few=False)
    watch = replace(few, thresholds=replace(few.thresholds, speed_return=3600.0))
    right = samples.values[:, [c.name for c in samples.inputs].index("spindle_rpm")]
    _, faults = run(watch, samples, spoil(right, 300, kind))
    named = int(np.flatnonzero(faults[:, -1] == OFF)[0])
    running = right[named:] >= 0.5 * watch.top_speed
    found = faults[named:, -1][running] == OFF
    assert np.mean(found) >= (1.0 if kind == "zero" else 0.8)


def test_more_heat_than_the_speed_explains_is_cutting() -> None:
    """The temperatures rise by 30 % more; the speed is right, and so are the sensors."""
    watch, samples = fitted("linear", few=True), day("linear", 11, few=True)
    names = [c.name for c in samples.inputs]
    heat = [names.index(n) for n in watch.names]
    change = samples.values - samples.reference()[0]
    room = change[:, [names.index("t_air_C")]]
    hotter = samples.values.copy()
    hotter[:, heat] += 0.3 * np.where(np.array(watch.names) == "t_air_C", 0.0, change[:, heat] - room)
    _, faults = run(watch, replace(samples, values=hotter), samples.values[:, -1])
    assert not faults.any()


def test_what_is_seen_is_what_the_fit_says() -> None:
    watch = fitted("linear", few=True)
    found = {f.fault: f for f in watch.speed_faults}
    assert set(found) == {"zero", "stuck", "halved", "beyond"}
    assert all(f.found > 0.9 and 5.0 <= f.minutes <= 40.0 for f in found.values())
    assert found["beyond"].minutes < found["halved"].minutes


def test_a_spindle_that_never_turned_is_not_supervised() -> None:
    samples = day("linear", 0, few=True)
    stopped = samples.values.copy()
    stopped[:, -1] = 0.0
    watch = find_watch(replace(samples, values=stopped), samples.cycle >= 0)
    assert watch is not None
    assert not watch.checks
    assert not watch.speed_faults


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"input": 0}, "it is not a spindle speed"),
        ({"weights": (1.0,)}, "has 1 weights; expected"),
        ({"power": 0.0}, "power"),
        ({"off": float("nan")}, "off"),
    ],
)
def test_a_check_that_does_not_fit_is_refused(change: dict[str, object], message: str) -> None:
    watch = fitted("linear", few=True)
    with pytest.raises(SettingError, match=message):
        replace(watch, checks=(replace(watch.checks[0], **change),))  # type: ignore[arg-type]


def test_a_fault_of_an_unknown_speed_is_refused() -> None:
    with pytest.raises(SettingError, match="not a spindle speed"):
        replace(fitted("linear", few=True), speed_faults=(SpeedFault(99, "zero", 1.0, 5.0),))
