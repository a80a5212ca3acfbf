"""The watch over the temperatures: found in time, nothing accused that is sound, and nothing jumps."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from smallmachine import small_machine

from thermocomp.core.correction import Correction, Limits
from thermocomp.core.exceptions import ModelFileError, SettingError
from thermocomp.core.model import ErrorModel
from thermocomp.core.provenance import RULES, HonestError
from thermocomp.core.reading import Reading
from thermocomp.core.watch import Watch
from thermocomp.files import modelfile
from thermocomp.models.training import train
from thermocomp.models.watching import find_watch
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.limits import fade
from thermocomp.runtime.watch import look
from thermocomp.runtime.watchstate import GOOD, MISSING, STEPPED, STUCK, UNEXPLAINED, WORDS, WatchState, begin
from thermocomp.virtual import datasets as virtual

FloatArray = NDArray[np.float64]
SIX = ("t_housing_C", "t_motor_C", "t_column_front_left_C", "t_z_bearing_C", "t_table_C", "t_enclosure_C")


@pytest.fixture(scope="module")
def samples() -> Samples:
    """The virtual machine, a row a minute; the fourth cycle is not learned from."""
    whole = stack(virtual.record("demo"), ["z_um", "y1_um"])
    return whole.take(np.arange(len(whole)) % 3 == 0).only([*SIX, "spindle_rpm"])


@pytest.fixture(scope="module")
def watch(samples: Samples) -> Watch:
    found = find_watch(samples, samples.cycle != 3)
    assert found is not None
    return found


def run(watch: Watch, samples: Samples, values: FloatArray) -> tuple[WatchState, FloatArray, FloatArray, FloatArray]:
    """Return the last state, what was found first and when per run and sensor, and what was let through."""
    runs = values.shape[1]
    state, through = begin(watch, runs=(runs,)), np.empty_like(values)
    first, when = np.zeros((runs, len(watch.sensors))), np.full((runs, len(watch.sensors)), np.nan)
    for k, time in enumerate(samples.time.tolist()):
        state, through[k] = look(watch, state, time, values[k], resting=bool(samples.stands[k]))
        new = (state.fault != GOOD) & (first == GOOD)
        first[new], when[new] = state.fault[new], time
    return state, first, when, through


def test_a_spindle_that_starts_within_the_zero_accuses_nothing(samples: Samples) -> None:
    """Five minutes of rest were to be averaged; the states of the speed began as if it had always turned."""
    learned = find_watch(samples, samples.cycle >= 0)
    assert learned is not None
    begun = int(np.flatnonzero(~samples.stands)[0])
    cut = samples.take(np.arange(len(samples)) >= begun - 3)
    cut = replace(cut, time=cut.time - cut.time[0])
    assert learned.zeroing.at_rest > cut.time[3]
    _, first, _, _ = run(learned, cut, cut.values[:, None])
    assert not first.any()


def disturbed(samples: Samples, row: int) -> FloatArray:
    """Return one sound run, and one per sensor and kind of failure from a row on, (n_rows, n_runs, n_inputs)."""
    n, count = len(SIX), 1 + 4 * len(SIX)
    values = np.repeat(samples.values[:, None], count, axis=1)
    hours = (samples.time[row:] - samples.time[row]) / 3600.0
    for k in range(n):
        values[row:, 1 + k, k] = np.nan
        values[row:, 1 + n + k, k] += 3.0
        values[row:, 1 + 2 * n + k, k] = values[row, 0, k]
        values[row:, 1 + 3 * n + k, k] += hours
    return values


@pytest.mark.parametrize("row", [950, 1030, 1100])
def test_failures_are_found_in_time_and_the_sound_are_not_accused(watch: Watch, samples: Samples, row: int) -> None:
    """In a cycle that was not learned from: dead at once, 3 degC in 10 min, stuck in 30 min, 1 degC/h before 3 degC."""
    assert samples.cycle[row] == 3
    n = len(SIX)
    _, found, when, _ = run(watch, samples, disturbed(samples, row))
    assert not found[0].any()
    delay = when - samples.time[row]
    for k in range(n):
        for place, (fault, most) in enumerate(
            [(MISSING, 0.0), (STEPPED, 600.0), (STUCK, 1800.0), (UNEXPLAINED, 3 * 3600.0)]
        ):
            mine = found[1 + place * n + k]
            assert WORDS[int(mine[k])] == WORDS[fault]
            assert delay[1 + place * n + k, k] <= most
            assert not np.delete(mine, k).any()


def test_a_faster_spindle_than_in_the_training_is_no_failure(samples: Samples) -> None:
    unknown = find_watch(samples, samples.cycle != 4)  # 3200 1/min, the others up to 2800
    assert unknown is not None
    _, found, _, _ = run(unknown, samples, samples.values[:, None])
    assert not found.any()


@pytest.mark.parametrize("speed", [1e308, -1e308, 1e9, math.nan, math.inf])
def test_a_speed_that_no_spindle_has_leaves_nothing_behind(watch: Watch, samples: Samples, speed: float) -> None:
    names = [c.name for c in samples.inputs]
    row, values = 600, samples.values[:900].copy()
    values[row, names.index("spindle_rpm")] = speed
    if speed == 1e308:
        values[row] = speed  # and all temperatures with it
    part = samples.take(np.arange(900))
    _, found, _, through = run(watch, part, values[:, None])
    assert np.isfinite(through[row + 1 :]).all()
    assert np.array_equal(through[row + 1 :, 0], values[row + 1 :])
    assert not found.any()


def test_what_stands_in_does_not_jump_and_stays_near(watch: Watch, samples: Samples) -> None:
    row = 1000
    values = disturbed(samples, row)
    _, _, _, through = run(watch, samples, values)
    for k in range(len(SIX)):
        stands_in, true = through[row:, 1 + k, k], samples.values[row:, k]
        assert abs(stands_in[0] - true[0]) < 0.5
        assert np.abs(np.diff(stands_in)).max() < 0.3 + np.abs(np.diff(true)).max()
        assert np.sqrt(np.mean((stands_in - true) ** 2)) < 1.0
    others = [j for j in range(samples.values.shape[1]) if j != 0]
    assert np.array_equal(through[:, 1][:, others], values[:, 1][:, others])


def test_many_runs_at_once_are_what_each_is_alone(watch: Watch, samples: Samples) -> None:
    values = disturbed(samples, 900)[:1300]
    part = samples.take(np.arange(1300))
    _, found, when, through = run(watch, part, values)
    for k in (0, 1, 9, 15, 22):
        _, own, at, let = run(watch, part, values[:, k : k + 1])
        assert np.array_equal(own[0], found[k])
        assert np.array_equal(at[0], when[k], equal_nan=True)
        assert np.allclose(let[:, 0], through[:, k], rtol=0, atol=1e-9)


def test_a_sensor_that_comes_back_is_believed_again_and_one_that_failed_is_not(watch: Watch, samples: Samples) -> None:
    values = disturbed(samples, 800)[:, [1, 1 + len(SIX)]]  # the first is missing, or 3 degC off
    values[860:] = samples.values[860:, None]
    state, _, _, through = run(watch, samples, values)
    assert state.fault[:, 0].tolist() == [GOOD, STEPPED]
    assert np.array_equal(through[-1, 0], samples.values[-1])


def test_a_spike_is_no_failure(watch: Watch, samples: Samples) -> None:
    values = np.repeat(samples.values[:, None], 1, axis=1)
    values[900:903, 0, 1] += 6.0
    state, found, _, through = run(watch, samples, values)
    assert not found.any()
    assert np.isnan(state.jumped).all()
    assert np.abs(through[900:903, 0, 1] - samples.values[900:903, 1]).max() < 1.0


def test_a_machine_that_is_unlike_its_training_accuses_nobody(watch: Watch, samples: Samples) -> None:
    """Everything reads 4 degC more within an hour: no single sensor explains it."""
    values = np.repeat(samples.values[:, None], 1, axis=1)
    values[700:, 0, :-1] += np.minimum(np.arange(len(samples) - 700) / 15.0, 4.0)[:, None] * np.arange(1, 7) / 3
    _, found, _, _ = run(watch, samples, values)
    assert (found[0] == UNEXPLAINED).sum() <= 1


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_whatever_is_read_what_is_let_through_is_finite(watch: Watch, data: st.DataObject) -> None:
    state, time = begin(watch), 0.0
    zero = [i.reference for i in watch.inputs]
    for _ in range(40):
        time += data.draw(st.sampled_from([1e-6, 1.0, 15.0, 60.0, 1e5, 1e9]))
        bad = st.sampled_from([math.nan, math.inf, -math.inf, 1e300, -273.0, 0.0])
        values = np.array(
            [data.draw(bad | st.floats(z - 30, z + 30)) for z in zero[:-1]] + [data.draw(st.floats(0, 5000))]
        )
        state, through = look(watch, state, time, values)
        assert np.isfinite(through).all()
        assert (through[:-1] < 1e4).all()


def test_a_single_test_is_watched_by_stretches_and_one_temperature_by_nothing() -> None:
    whole = stack([small_machine()], ["z_um"])
    assert find_watch(whole.only(["t1_C", "spindle_rpm"]), whole.cycle >= 0) is None
    assert find_watch(whole, np.zeros(len(whole), dtype=np.bool_)) is None
    found = find_watch(whole, whole.cycle == 0)
    assert found is not None
    assert found.names == ("t1_C", "t2_C", "t3_C")


# -- in a compensator --------------------------------------------------------------------------------------------------


def judged(model: ErrorModel, watch: Watch, lost: dict[str, float]) -> ErrorModel:
    honest = HonestError(
        "cycles", 1.0, 1.0, 3.0, 5.0, 6.0, {"a": 1.0, "b": 1.0, "c": 1.0}, "accepted", "", 3, rules=RULES, lost=lost
    )
    return replace(model, watch=watch, honest_error=honest)


def test_a_dead_sensor_does_not_freeze_the_correction(watch: Watch, samples: Samples) -> None:
    learn = samples.cycle != 3
    lost = dict.fromkeys(SIX, 1.5)
    model = judged(train("averaged", samples, 0, learn).model, watch, lost)
    machine = Compensator.of([model], Limits(rate=1.0, reading_age=120.0))
    names = [c.name for c in samples.inputs]
    state, left, held = machine.start(), [], []
    for k in range(1250):
        values = dict(zip(names, samples.values[k].tolist(), strict=True))
        if k >= 900:
            values["t_motor_C"] = math.nan
        if k >= 1200:
            del values["t_table_C"]
        time = float(samples.time[k])
        state, said = machine.step(state, Reading(time, values), time)
        left.append(samples.deviations[k, 0] + said.corrections["z_um"].offset)
        held.append(said.held.get("z_um", ""))
        assert not said.rejected
    assert said.failed == {"t_motor_C": "missing", "t_table_C": "missing"}
    rms = np.sqrt(np.mean(np.square(left[900:1200])))
    assert rms < 0.3 * np.sqrt(np.mean(samples.deviations[900:1200, 0] ** 2))
    assert not any(held[:1200])
    assert "is not known to be better than no compensation" in held[1210]  # two of them


def test_models_of_two_files_are_watched_each_by_its_own(watch: Watch, samples: Samples) -> None:
    other = find_watch(samples.only([*SIX[:3], "spindle_rpm"]), samples.cycle != 3)
    assert other is not None
    models = [
        judged(train("ols", samples.only([*names, "spindle_rpm"]), k, samples.cycle != 3).model, w, {names[0]: 1.0})
        for k, (w, names) in enumerate([(watch, SIX), (other, SIX[:3])])
    ]
    machine = Compensator.of(models, Limits(reading_age=120.0))
    names, state = [c.name for c in samples.inputs], machine.start()
    for k in range(700):
        values = dict(zip(names, samples.values[k].tolist(), strict=True))
        if k >= 600:
            values[SIX[0]] = math.nan
            values[SIX[5]] = math.inf  # only the first watch knows it
        state, said = machine.step(state, Reading(float(samples.time[k]), values), float(samples.time[k]))
        assert not said.rejected
    assert said.failed == {SIX[0]: "missing", SIX[5]: "missing"}
    assert list(said.held) == ["z_um"]


def test_what_nothing_drives_is_held_and_then_fades(watch: Watch, samples: Samples) -> None:
    model = judged(train("averaged", samples, 0, samples.cycle != 3).model, watch, {})
    limits = Limits(rate=10.0, reading_age=60.0, hold=600.0, fade=1200.0, dead_band=2.0)
    machine = Compensator.of([model], limits)
    names = [c.name for c in samples.inputs]
    state, found, words = machine.start(), [], []
    for k in range(500):
        values = dict(zip(names, samples.values[min(k, 300)].tolist(), strict=True))
        if k > 300:
            values["t_motor_C"] = math.nan
        time = float(samples.time[k])
        state, said = machine.step(state, Reading(time, values), time)
        found.append(said.corrections["z_um"].offset)
        words.append(said.states["z_um"].word)
    assert abs(found[300]) > 5.0
    assert found[301:310] == [found[300]] * 9
    assert words[305] == "holding"
    assert words[400] == "fading"
    assert abs(found[-1]) < 0.02 * abs(found[300])
    assert np.abs(np.diff(found[300:])).max() < 0.06 * abs(found[300])


def test_a_clock_that_leaps_makes_nothing_fade(watch: Watch, samples: Samples) -> None:
    """One reading that comes with a clock years ahead counts for no more than its age may be."""
    model = judged(train("averaged", samples, 0, samples.cycle != 3).model, watch, {})
    machine = Compensator.of([model], Limits(rate=10.0, reading_age=120.0))
    names, state, before = [c.name for c in samples.inputs], machine.start(), 0.0
    for k in range(300):
        time = float(samples.time[k])
        values = dict(zip(names, samples.values[k].tolist(), strict=True))
        state, said = machine.step(state, Reading(time, values), time)
        before = said.corrections["z_um"].offset
    state, said = machine.step(state, Reading(time + 60.0, values), 1e9)
    assert said.rejected
    assert said.held["z_um"].startswith("no model has updated the correction for 120 s")
    assert said.corrections["z_um"].offset == before != 0.0


def test_no_fade_is_faster_than_the_rate() -> None:
    limits, now = Limits(rate=0.001, hold=1.0, fade=1.0), Correction(40.0, slope=-30.0, reference_position=100.0)
    after = fade(now, (0.0, 500.0), 2.0, 5.0, limits)
    moved = [abs(after.at(p) - now.at(p)) for p in (0.0, 250.0, 500.0)]
    assert max(moved) == pytest.approx(0.005)
    assert fade(now, (0.0, 500.0), 1.0, 5.0, limits) == fade(now, (0.0, 500.0), 9.0, 0.0, limits) == now


@pytest.mark.parametrize("known", ["absolute", "stated"])
def test_a_zero_that_is_known_is_watched_from_the_first_reading(samples: Samples, watch: Watch, known: str) -> None:
    """Temperatures as they are, and counted from a zero that is stated."""
    if known == "absolute":
        found = find_watch(replace(samples, rezero=False), samples.cycle != 3)
        assert found is not None
        state = begin(found, runs=(2,))
    else:
        found, state = watch, begin(watch, samples.reference()[0], (2,))
    first = samples.values[0].copy()
    for k in range(1100):
        values = np.repeat(samples.values[k][None], 2, axis=0)
        values[1, 0] = np.nan if k >= 600 else values[1, 0]
        state, through = look(found, state, float(samples.time[k]), values, resting=bool(samples.stands[k]))
        assert state.time == samples.time[k]
    assert not state.fault[0].any()
    assert state.fault[1].tolist() == [MISSING, 0, 0, 0, 0, 0]
    assert abs(through[1, 0] - samples.values[1099, 0]) < 1.5 < abs(through[1, 0] - first[0])


def test_a_coarse_sensor_at_rest_for_days_is_not_stuck(samples: Samples) -> None:
    """Of 0.5 degC: it reads the same all night, and its neighbours do not."""
    heat = [c.quantity == "temperature" for c in samples.inputs]
    coarse = replace(samples, values=np.where(heat, np.round(2 * samples.values) / 2, samples.values))
    found = find_watch(coarse, coarse.cycle >= 0)
    assert found is not None
    state, names = begin(found), set[int]()
    rng = np.random.default_rng(0)
    for k in range(3000):
        rest = coarse.values[0].copy()
        rest[:-1] += 0.5 * (rng.random(len(SIX)) < [0.3, 0, 0, 0, 0.3, 0])  # two flicker between digits
        state, _ = look(found, state, 60.0 * k, rest, resting=True)
        names |= set(np.flatnonzero(state.fault).tolist())
    assert not names


@pytest.mark.parametrize("minutes", [10, 30, 120])
def test_a_value_that_is_the_same_after_a_gap_is_not_stuck(minutes: int) -> None:
    """Half an hour of readings, then none: of 0.02 degC, after a gap one in some reads the same by chance."""
    whole = stack(virtual.record("demo"), ["z_um"])
    found = find_watch(whole.take(np.arange(len(whole)) % 3 == 0), np.ones((len(whole) + 2) // 3, np.bool_))
    assert found is not None
    heat = [k for k, c in enumerate(whole.inputs) if c.quantity == "temperature"]
    values = whole.values.copy()
    values[:, heat] = np.round(values[:, heat] / 0.02) * 0.02
    known = whole.time % (60.0 * (30 + minutes)) < 1800.0
    stuck, repeats = 0, 0
    for shift in range(3):  # three starts of the gaps
        state, last = begin(found), values[0]
        for k in np.flatnonzero(np.roll(known, 40 * shift)).tolist():
            repeats += int(whole.time[k] - state.time > 600.0 and (values[k] == last)[heat].any())
            state, last = (
                look(found, state, float(whole.time[k]), values[k], resting=bool(whole.stands[k]))[0],
                values[k],
            )
        stuck += int(np.count_nonzero(state.fault == STUCK))
    assert repeats or minutes == 10
    assert stuck == 0


def test_a_stuck_sensor_is_found_at_any_interval(watch: Watch, samples: Samples) -> None:
    for every in (1, 10, 20):  # [min]
        some = samples.take(np.arange(len(samples)) % every == 0)
        values = some.values.copy()
        row = np.flatnonzero(some.time > 40_000.0)[0]
        values[row:, 0] = values[row, 0]
        state = begin(watch)
        for k, time in enumerate(some.time.tolist()):
            state, _ = look(watch, state, time, values[k], resting=bool(some.stands[k]))
            if state.fault[0] == STUCK:
                break
        assert state.fault.tolist() == [STUCK, 0, 0, 0, 0, 0]
        assert time < some.time[row] + 4 * 3600.0


def test_a_file_holds_one_watch_for_all_its_models(watch: Watch, samples: Samples) -> None:
    models = [judged(train("ols", samples, k, samples.cycle != 3).model, watch, {SIX[0]: 2.0}) for k in (0, 1)]
    text = modelfile.dumps(models)
    assert text.count('"sensors"') == 1
    assert modelfile.loads(text) == tuple(models)
    with pytest.raises(ModelFileError, match="different watches"):
        modelfile.dumps([models[0], replace(models[1], watch=None)])
    with pytest.raises(ModelFileError, match="checksum"):
        modelfile.loads(text.replace('"off": 1.0', '"off": 9.0', 1))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"off": math.nan}, "off"),
        ({"jump": 0.0}, "jump"),
        ({"still": -1.0}, "still"),
        ({"weights": (1.0,)}, "has 1 weights; expected"),
        ({"input": 3}, "expected one per temperature"),
    ],
)
def test_numbers_that_do_not_fit_are_refused(watch: Watch, change: dict[str, Any], says: str) -> None:
    with pytest.raises(SettingError, match=says):
        replace(watch, sensors=(replace(watch.sensors[0], **change), *watch.sensors[1:]))


def test_no_temperature_is_predicted_by_itself(watch: Watch) -> None:
    first = watch.sensors[0]
    for place in (0, len(SIX)):
        own = tuple(0.1 if k == place else w for k, w in enumerate(first.weights))
        with pytest.raises(SettingError, match="from itself"):
            replace(watch, sensors=(replace(first, weights=own), *watch.sensors[1:]))


def follow(watch: Watch, samples: Samples, values: FloatArray) -> tuple[NDArray[np.int8], FloatArray]:
    """Return the faults and the predictions of a run, (n_rows, n_sensors)."""
    state, faults, predicted = begin(watch, runs=(1,)), list[NDArray[np.int8]](), list[FloatArray]()
    for k, time in enumerate(samples.time.tolist()):
        state, _ = look(watch, state, time, values[k], resting=bool(samples.stands[k]))
        faults.append(state.fault[0])
        predicted.append(state.predicted[0])
    return np.array(faults), np.array(predicted)


@pytest.mark.parametrize("sensor", range(len(SIX)))
def test_temperatures_near_heat_for_two_hours_are_unexplained_until_they_have_agreed_for_an_hour(
    watch: Watch, samples: Samples, sensor: int
) -> None:
    """As a bearing of an axis that moves for a while; of two neighbours, the other one may be reported.

    Agreement counts only while the temperature should be far from its zero: at rest any agrees.
    """
    place = [c.name for c in samples.inputs].index(SIX[sensor])
    values, begin_at, minutes = samples.values[:, None].copy(), 1000, np.arange(len(samples.values) - 1000.0)
    extra = 2.5 * np.where(minutes < 120.0, 1.0 - np.exp(-minutes / 20.0), np.exp(-(minutes - 120.0) / 20.0))
    values[begin_at:, 0, place] += extra
    found, predicted = follow(watch, samples, values)
    times = (samples.time[(found != GOOD).any(axis=1)] - samples.time[begin_at]) / 60.0
    assert set(found.ravel().tolist()) == {GOOD, UNEXPLAINED}
    assert (found != GOOD).any(axis=0).sum() <= 2
    assert 5.0 <= times[0] <= 120.0
    moved = np.abs(predicted) >= 2.0 * watch.limits("off")
    for row, k in zip(*np.nonzero((found[:-1] == UNEXPLAINED) & (found[1:] == GOOD)), strict=True):
        assert moved[row - 58 : row + 1, k].all()
    hot = (moved & (np.arange(len(moved)) > begin_at + 300)[:, None]).sum(axis=0) > 150
    assert (found[-1, hot] == GOOD).all()


@pytest.mark.parametrize("gain", [0.4, 1.8])
def test_a_sensor_with_a_wrong_gain_is_not_used_again_after_a_rest(watch: Watch, samples: Samples, gain: float) -> None:
    place = [c.name for c in samples.inputs].index(SIX[0])
    values = samples.values[:, None].copy()
    values[:, 0, place] = values[0, 0, place] + gain * (values[:, 0, place] - values[0, 0, place])
    found, _ = follow(watch, samples, values)
    own = found[:, watch.names.index(SIX[0])]
    (mine,) = np.nonzero(own != GOOD)
    assert mine.size
    assert (own[mine[0] :] != GOOD).all()
    assert (np.diff(samples.values[mine[0] :, -1]) != 0).sum() > 4  # with rests


@pytest.mark.parametrize("physics", ["linear", "nonlinear"])
@pytest.mark.parametrize("step", [0.1, 0.5, 1.0])
def test_sensors_coarser_than_in_training_are_not_stuck_and_stuck_ones_are_found(physics: str, step: float) -> None:
    """All sensors, and each alone, are rounded in use: warm-up, cool-down and rest of all cycles; then one sticks."""
    whole = stack(virtual.record("demo", physics=physics), ["z_um"])  # type: ignore[arg-type]
    fine = whole.take(np.arange(len(whole)) % 6 == 0).only([*SIX, "spindle_rpm"])
    found = find_watch(fine, fine.cycle != 3)
    assert found is not None
    row, n = int(np.flatnonzero((fine.cycle == 3) & ~fine.stands)[5]), len(SIX)
    values = np.repeat(fine.values[:, None], 2 * n + 1, axis=1)
    coarse = np.round(fine.values / step) * step
    values[:, : n + 1, :n] = coarse[:, None, :n]
    for k in range(n):
        values[row:, 1 + k, k] = coarse[row, k]
        values[:, 1 + n + k, k] = coarse[:, k]
    _, first, when, _ = run(found, fine, values)
    assert not (first[[0, *range(1 + n, 1 + 2 * n)]] == STUCK).any()
    for k in range(n):
        moved = np.abs(fine.values[row:, k] - fine.values[row, k]) > 3.5 * max(step, 0.3) + 1.0
        if moved.any():
            assert first[1 + k, k] in (STUCK, UNEXPLAINED)
            if step < 1.0:  # the stuck housing of 1 degC makes the speed look wrong first
                assert when[1 + k, k] <= fine.time[row:][moved][0] + 1800.0
        assert not (np.delete(first[1 + k], k) == STUCK).any()
