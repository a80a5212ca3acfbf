"""A source that repeats its last values: found in time, not in health, and no sensor is accused for it."""

import csv
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from driftmodels import ACCEPTED
from numpy.typing import NDArray
from watchedmachine import watched_model

from thermocomp.core.correction import Limits
from thermocomp.core.model import ErrorModel
from thermocomp.core.reading import Reading
from thermocomp.core.thresholds import THRESHOLDS
from thermocomp.files import jsonfile, modelfile
from thermocomp.models.training import train
from thermocomp.models.watching import find_watch
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.feed import FeedState, TemperatureFeed
from thermocomp.runtime.state import Compensated, CompensatorState
from thermocomp.runtime.watch import look
from thermocomp.runtime.watchstate import GOOD, STUCK, begin
from thermocomp.virtual import datasets as virtual

FloatArray = NDArray[np.float64]
SIX = ("t_housing_C", "t_motor_C", "t_column_front_left_C", "t_z_bearing_C", "t_table_C", "t_enclosure_C")
#: jobs of any speed and length, and a night, four times in 40 h
JOBS = """description = "jobs"
sampling = "20 s"
places = "usual"
climate = {{ like = "workshop", mean = {mean}, begin = "7 h" }}
perfect = {perfect}
[[segments]]
duration = "15 min"
[[segments]]
repeat = {repeat}
segments = [
    {{ duration = {{ between = ["10 min", "3 h"], step = "5 min" }}, speed = {{ between = [300, 3200], step = 100 }} }},
    {{ duration = {{ between = ["10 min", "3 h"], step = "5 min" }} }},
    {{ duration = {{ between = ["10 min", "3 h"], step = "5 min" }}, speed = {{ between = [300, 3200], step = 100 }} }},
    {{ duration = "10 h" }},
]
"""

Rows = list[tuple[float, dict[str, float]]]


@cache
def demo() -> Samples:
    """A row a minute."""
    whole = stack(virtual.record("demo"), ["z_um"])
    return whole.take(np.arange(len(whole)) % 3 == 0)


def rounded(values: FloatArray, heat: Sequence[int], resolution: float, noise: float, seed: int) -> FloatArray:
    """Return temperatures with noise, as a coarse sensor shows them."""
    found = values.copy()
    found[:, heat] += noise * np.random.default_rng(seed).normal(size=(len(values), len(heat)))
    found[:, heat] = np.round(found[:, heat] / resolution) * resolution
    return found


@cache
def fitted(names: tuple[str, ...], resolution: float = 0.0, noise: float = 0.0) -> ErrorModel:
    """Return a model of the demo with its watch, from sensors of a resolution."""
    samples = demo().only([*names, "spindle_rpm"]) if names else demo()
    heat = [k for k, c in enumerate(samples.inputs) if c.quantity == "temperature"]
    if resolution:
        samples = replace(samples, values=rounded(samples.values, heat, resolution, noise, 1))
    every = np.ones(len(samples), dtype=np.bool_)
    found = train("dynamic", samples, 0, every).model
    return replace(found, watch=find_watch(samples, every), honest_error=ACCEPTED)


def names_of(model: ErrorModel) -> list[str]:
    assert model.watch is not None
    return [i.name for i in model.watch.inputs]


def rows_of(time: FloatArray, values: FloatArray, names: Sequence[str]) -> Rows:
    return [(t, dict(zip(names, v, strict=True))) for t, v in zip(time.tolist(), values.tolist(), strict=True)]


def repeated(rows: Rows, times: int) -> Rows:
    """Return each row as several readings until the next one."""
    step = (rows[1][0] - rows[0][0]) / times
    return [(time + k * step, values) for time, values in rows for k in range(times)]


def go(
    compensator: Compensator, rows: Rows, state: CompensatorState | None = None
) -> Iterator[tuple[CompensatorState, Compensated]]:
    state = state or compensator.start()
    for time, values in rows:
        state, said = compensator.step(state, Reading(time, values), time)
        yield state, said


def stopped(said: Compensated) -> bool:
    return said.rejected.endswith("the source has stopped")


def freeze(row: tuple[float, dict[str, float]], step: float, count: int = 1500) -> Rows:
    """Return readings that repeat a row."""
    return [(row[0] + k * step, row[1]) for k in range(1, count)]


def first_stop(
    compensator: Compensator, state: CompensatorState, rows: Rows
) -> tuple[int, CompensatorState, Compensated | None]:
    """Return how many readings it takes until the source counts as stopped, and what is said then; None: never."""
    for k, (after, said) in enumerate(go(compensator, rows, state), start=1):
        if stopped(said):
            return k, after, said
    return len(rows), state, None


# -- found -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("times", [1, 10, 60])
@pytest.mark.parametrize("names", [SIX, ()], ids=["six", "all"])
def test_repeated_values_are_found_within_20_updates(names: tuple[str, ...], times: int) -> None:
    model = fitted(names)
    compensator = Compensator.of([model])
    day = virtual.record("demo", seed=7)[0]
    count = 1500 if times == 1 else 150
    table = day.table[names_of(model)].to_numpy(np.float64)[:count]
    rows = repeated(rows_of(day.time[:count], table, names_of(model)), times)
    states = []
    for state, said in go(compensator, rows):
        assert not stopped(said)
        states.append(state)
    step = rows[1][0] - rows[0][0]
    for update in np.linspace(40, count - 1, 20).astype(int).tolist():
        last = times * (update + 1) - 1  # the last reading of an update: the next one should differ
        k, _, found = first_stop(compensator, states[last], freeze(rows[last], step))
        assert found is not None
        assert k <= 20 * times, (update, found)
        assert found.failed == {}
        assert found.states["z_um"].word == "holding"
        assert f"all {len(names) or 16} temperatures have repeated for" in found.states["z_um"].reason


@pytest.mark.parametrize(("resolution", "noise"), [(0.1, 0.01), (0.5, 0.05)])
def test_noise_below_the_resolution_is_found_by_what_should_have_moved(resolution: float, noise: float) -> None:
    """Frozen a minute to five after the spindle has started or stopped: the prediction goes on by its lags."""
    model = fitted(SIX, resolution, noise)
    compensator, names = Compensator.of([model]), names_of(model)
    assert model.watch is not None
    assert all(s.frozen >= 3.0 * resolution - 1e-9 for s in model.watch.sensors)
    day = virtual.record("demo", seed=5)[0]
    heat = list(range(len(SIX)))
    table = rounded(day.table[names].to_numpy(np.float64), heat, resolution, noise, 2)
    rows = rows_of(day.time, table, names)
    states = [state for state, said in go(compensator, rows) if not stopped(said)]
    assert len(states) == len(rows)
    turns = np.flatnonzero(np.diff(table[:, -1])).tolist()
    for last in [k + after for k in turns for after in (3, 15)]:
        k, state, found = first_stop(compensator, states[last], freeze(rows[last], 20.0))
        assert found is not None
        moved = np.abs(table[last:, heat] - table[last, heat]).max(axis=1) >= 3.0 * resolution - 1e-9
        should = int(np.flatnonzero(moved)[0])  # what the machine really did
        assert k <= 4 * should + 16, (last, k, should)
        assert found.failed == {}
        # readings that repeat do not enter the memory any more
        before = state.watches[0].memory
        *_, (later, said) = go(compensator, freeze(rows[last], 20.0)[k : k + 30], state)
        assert stopped(said)
        assert np.array_equal(later.watches[0].memory, before)
        # the next change is a reading again
        *_, (_, said) = go(compensator, [(rows[last][0] + 20.0 * (k + 31), rows[last + 1][1] | {SIX[0]: 30.0})], later)
        assert not stopped(said)


# -- not in health -----------------------------------------------------------------------------------------------------


def no_alarm(
    model: ErrorModel, folder: Path, mean: float, times: int, repeat: int, sensor: tuple[float, float]
) -> float:
    """Run other speeds in other weather; return the hours."""
    text = JOBS.format(mean=mean, repeat=repeat, perfect=str(bool(sensor[0])).lower())
    (folder / "jobs.toml").write_text(text, encoding="utf-8")
    day, names = virtual.record(folder / "jobs.toml", seed=times)[0], names_of(model)
    every = 1 if times == 1 else 3
    table = day.table[names].to_numpy(np.float64)[::every]
    if sensor[0]:
        table = rounded(table, list(range(len(names) - 1)), *sensor, seed=3)
    for k, (_, said) in enumerate(
        go(Compensator.of([model]), repeated(rows_of(day.time[::every], table, names), times))
    ):
        assert not stopped(said), (k, said.rejected)
    return float(day.time[-1]) / 3600.0


@pytest.mark.parametrize(("times", "repeat"), [(1, 1), (10, 1)])
def test_a_day_of_other_speeds_is_no_stop(tmp_path: Path, times: int, repeat: int) -> None:
    assert no_alarm(fitted(SIX), tmp_path, 26.0, times, repeat, (0.0, 0.0)) > 10.0


#: as they are (0.01 degC); coarse; coarser than the noise
SENSORS = [(0.0, 0.0), (0.0625, 0.03), (0.1, 0.02), (0.5, 0.05)]


@pytest.mark.parametrize("learned", ["averaged", "raw"])
@pytest.mark.parametrize("sensor", [SENSORS[2], SENSORS[3]])
def test_a_first_night_with_coarse_sensors_is_no_stop(
    tmp_path: Path, sensor: tuple[float, float], learned: str
) -> None:
    """Even if the recording of the training was averaged, and shows nothing of the resolution."""
    model = fitted(SIX, *(sensor if learned == "raw" else (0.0, 0.0)))
    assert no_alarm(model, tmp_path, 18.0, 1, 1, sensor) > 10.0


@pytest.mark.long
@pytest.mark.parametrize("times", [1, 10, 60])
@pytest.mark.parametrize("sensor", SENSORS)
@pytest.mark.parametrize("names", [SIX, ()], ids=["six", "all"])
def test_200_h_of_other_speeds_and_weather_are_no_stop(
    tmp_path: Path, names: tuple[str, ...], times: int, sensor: tuple[float, float]
) -> None:
    model = fitted(names, *sensor)
    assert no_alarm(model, tmp_path, 18.0 + times / 8.0, times, 16, sensor) > 200.0


def recorded(path: Path, names: Sequence[str]) -> list[dict[str, float]]:
    lines = [line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    return [{n: float(row[n]) for n in names} for row in csv.DictReader(lines)]


@pytest.mark.parametrize("times", [1, 10, pytest.param(60, marks=pytest.mark.long)])
@pytest.mark.parametrize("resolution", [0.0, 0.1, 0.5, 1.0])
def test_measured_raw_readings_are_no_stop(shared_data: Path, resolution: float, times: int) -> None:
    """Two printers that heat up and cool down, one of them without a sensor, and a machine tool; without a watch."""
    printers = {p: ["frame_t", "chamber_t", "bed_t", "he_t"] for p in sorted(shared_data.glob("voron_frame/*.csv"))}
    tool = {shared_data / "fl_thermal" / "recording.csv": [f"t{k}_C" for k in range(1, 17)]}
    assert len(printers) == 2
    for path, names in (printers | tool).items():
        feed, state = TemperatureFeed(names, [], THRESHOLDS), FeedState()
        for row in recorded(path, names):
            shown = {n: round(v / resolution) * resolution if resolution else v for n, v in row.items()}
            for _ in range(times):
                state, why = feed.heed(state, shown, 0.0, 10.0, 60.0)
                assert why == "", (path.name, why)
        assert state.changes == THRESHOLDS.repeat_memory


def test_while_all_temperatures_repeat_no_sensor_is_accused() -> None:
    """The watch alone, with a speed that goes on: its predictions move by more than any limit."""
    watch = watched_model().watch
    assert watch is not None
    values = np.array([22.0, 21.0, 20.5, 0.0])
    state, _ = look(watch, begin(watch, np.array([22.0, 21.0, 20.5, 0.0])), 0.0, values)
    values[:3] += 0.1
    for k in range(1, 400):
        state, _ = look(watch, state, 60.0 * k, np.append(values[:3], 3000.0))
    moved = np.abs(state.predicted - 0.1)
    assert (moved > watch.limits("off")).any()
    assert (moved > watch.limits("moved")).any()
    assert (state.fault == GOOD).all()


def test_a_failed_sensor_need_not_change() -> None:
    watch = watched_model().watch
    assert watch is not None
    feed = TemperatureFeed(watch.names, [watch], THRESHOLDS)
    limit = watch.limits("frozen")
    state = begin(watch)._replace(time=0.0, predicted=np.zeros(3))
    before = FeedState((20.0,) * 3, (0.01,) * 3, repeated=4.0, changes=50.0, usual=1.0, predicted=(np.zeros(3),))
    moved = state._replace(predicted=np.array([1.01 * limit[0], 0.99 * limit[1], 0.0]))
    _, why = feed.compare_predictions(before, [moved])
    assert f"({watch.names[0]} should have changed by +" in why
    faults = np.array([STUCK, GOOD, GOOD], dtype=np.int8)
    assert feed.compare_predictions(before, [moved._replace(fault=faults)])[1] == ""
    coarse = before._replace(steps=(limit[0], 0.01, 0.01))  # as seen live
    assert feed.compare_predictions(coarse, [moved])[1] == ""
    assert feed.compare_predictions(before._replace(repeated=3.0), [moved])[1] == ""


# -- what is learned ---------------------------------------------------------------------------------------------------


class Source:
    """A source of temperatures that are called by number."""

    def __init__(self, count: int) -> None:
        self.feed, self.state = TemperatureFeed([str(k) for k in range(count)], [], THRESHOLDS), FeedState()
        self.values, self.rng = np.full(count, 20.0), np.random.default_rng(1)

    def say(self, times: int, changed: int | None = None, counter: float = 0.0, travel: float = 1.0) -> list[str]:
        """Change some temperatures, or all, and repeat them in as many readings; return why each was not used."""
        self.values[:changed] += self.rng.uniform(0.1, 1.0, len(self.values[:changed]))
        table, said = {str(k): float(v) for k, v in enumerate(self.values)}, []
        for _ in range(times):
            self.state, why = self.feed.heed(self.state, table, counter, travel, 60.0)
            said.append(why)
        return said

    def stops(self, times: int = 1000, changed: int | None = None) -> int:
        """Return after how many repeated readings the source counts as stopped; 0: never."""
        said = self.say(times, changed)
        return next((k for k, why in enumerate(said) if why), 0)


@pytest.mark.parametrize("times", [1, 7])
def test_it_counts_once_enough_changes_are_known(times: int) -> None:
    few, enough = Source(4), Source(4)
    for _ in range(19):  # eighteen intervals, and the one that ends next
        few.say(times)
    assert few.stops() == 0
    for _ in range(20):
        enough.say(times)
    assert enough.stops() == 15 * times + 1
    assert enough.say(1) == [""]


def test_a_stop_of_the_source_is_hardly_learned_and_a_slower_source_is() -> None:
    source = Source(6)
    for _ in range(200):
        source.say(1)
    assert source.stops() == 16
    assert 16 <= source.stops() <= 20  # within 20 updates again, at once
    assert source.state.longest == 0.0
    for _ in range(20):
        source.say(60)
    assert not any(source.say(60))


def test_a_machine_at_rest_is_learned_at_once() -> None:
    source = Source(6)
    for _ in range(200):
        source.say(1)
    assert any(source.say(100))
    source.say(1, changed=2)  # the machine: few temperatures change, and by themselves
    assert source.state.longest == 100.0
    for _ in range(50):
        source.say(1)
    assert source.stops() == 0


def test_a_single_temperature_is_a_feed_and_none_is_not() -> None:
    one, none = Source(1), Source(0)
    for _ in range(50):
        one.say(1)
        assert none.say(1) == [""]
    why = next(filter(None, one.say(20)))
    assert why == "0 has repeated for 16 readings (usual: a change every reading): the source has stopped"


def test_values_that_are_missing_are_no_repetition() -> None:
    source = Source(3)
    for _ in range(50):
        source.say(1)
    source.values[:] = np.nan
    assert source.stops() == 0
    source.values[:] = [np.nan, 20.0, np.nan]
    assert source.stops() == 16


def test_recordings_that_repeat_forbid_to_count() -> None:
    watch = watched_model().watch
    assert watch is not None
    assert watch.repeats == 1.0
    assert TemperatureFeed([*watch.names], [watch], THRESHOLDS).counts
    assert TemperatureFeed([*watch.names], [replace(watch, repeats=5.0)], THRESHOLDS).counts
    assert not TemperatureFeed([*watch.names], [replace(watch, repeats=5.1)], THRESHOLDS).counts
    coarse = fitted(SIX, 0.5, 0.05).watch
    assert coarse is not None
    assert coarse.repeats > 5.0


# -- counters and reports by exception ---------------------------------------------------------------------------------


def test_a_counter_that_does_not_advance_is_a_stop() -> None:
    source = Source(3)
    first = "the counter of the readings has been 1 since the start: the source has stopped"
    assert source.say(9, counter=1.0, travel=10.0) == [first] * 9  # it may have stopped before
    said = source.say(8, counter=2.0, travel=10.0)
    assert [bool(why) for why in said] == [False] * 7 + [True]  # after more than 60 s
    assert said[-1] == "the counter of the readings has been 2 for 70 s: the source has stopped"
    assert source.say(1, counter=3.0) == [""]
    for _ in range(50):
        assert source.say(20, counter=source.state.counter + 1.0, travel=1.0)[-1] == ""  # one reading each
    assert source.state.usual == 1.0
    assert source.say(9, counter=0.0, travel=100.0) == [""] * 9  # the source does not count any more


def test_a_source_that_reports_changes_only_is_not_counted() -> None:
    compensator = replace(Compensator.of([watched_model()]), repeats="exception")
    noise, zero = np.random.default_rng(0).normal(size=(60, 4)), np.array([22.0, 21.0, 20.5, 0.0])
    table = zero + 0.02 * noise * (zero > 0.0)
    rows = rows_of(np.arange(0.0, 3600.0, 60.0), table, ["t1_C", "t2_C", "t3_C", "spindle_rpm"])
    *_, (state, said) = go(compensator, rows)
    *_, (state, said) = go(compensator, freeze(rows[-1], 60.0, 300), state)
    assert said.rejected == ""
    assert said.states["z_um"].word == "active"


# -- the ladder, and files ---------------------------------------------------------------------------------------------


def test_the_correction_is_held_and_fades() -> None:
    limits, model = Limits(hold=600.0, fade=600.0), watched_model()
    assert model.watch is not None
    unsupervised = replace(model.watch, checks=(), speed_faults=())  # the temperatures below are none of this speed
    compensator = Compensator.of([replace(model, watch=unsupervised)], limits)
    rows: list[tuple[float, Mapping[str, float]]] = []
    rng = np.random.default_rng(0)
    for k in range(120):
        warm = (
            {"t1_C": 22.0 + 0.1 * k, "t2_C": 21.0 + 0.07 * k, "t3_C": 20.5} if k > 10 else {"t1_C": 22.0, "t2_C": 21.0}
        )
        warm = {"t3_C": 20.5} | warm
        rows.append(
            (60.0 * k, {n: v + 0.02 * rng.normal() for n, v in warm.items()} | {"spindle_rpm": 2500.0 * (k > 10)})
        )
    *_, (state, said) = go(compensator, rows)  # type: ignore[arg-type]
    held = said.corrections["z_um"].offset
    assert abs(held) > 1.0
    words = []
    for _, said in go(compensator, freeze(rows[-1], 60.0, 200), state):  # type: ignore[arg-type]
        words.append(said.states["z_um"].word)
        if words[-1] == "holding":
            held = said.corrections["z_um"].offset
    assert list(dict.fromkeys(words)) == ["active", "holding", "fading"]
    assert abs(said.corrections["z_um"].offset) < 0.1 * abs(held)


def test_a_model_file_of_an_earlier_version_has_the_limits_of_its_time() -> None:
    model = watched_model()
    assert model.watch is not None
    assert (model.watch.limits("frozen") != model.watch.limits("moved")).all()
    content = json.loads(modelfile.dumps([model]))
    del content["watch"]["repeats"]
    for sensor in content["watch"]["sensors"]:
        del sensor["frozen"]
    content["sha256"] = jsonfile.digest(content["models"], {k: content[k] for k in ("watch", "thresholds")})
    (found,) = modelfile.loads(json.dumps(content))
    assert found.watch is not None
    assert found.watch.repeats == 1.0
    assert np.array_equal(found.watch.limits("frozen"), found.watch.limits("moved"))
    assert "frozen" not in modelfile.dumps([found])  # nor does its state belong to another model


# -- from the first reading on ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("names", [SIX, ()], ids=["six", "all"])
def test_values_that_never_change_from_the_start_are_found(names: tuple[str, ...]) -> None:
    """A gateway that delivers its last values since before the start, while the speed is that of the machine."""
    model = fitted(names)
    day = virtual.record("demo", seed=7)[0]
    table = day.table[names_of(model)].to_numpy(np.float64)[:1500]
    heat = [k for k, name in enumerate(names_of(model)) if name.endswith("_C")]
    frozen = table.copy()
    frozen[:, heat] = table[0, heat]
    runs = day.time[np.flatnonzero(table[:, -1] > 0)[0]]
    said = [said for _, said in go(Compensator.of([model]), rows_of(day.time[:1500], frozen, names_of(model)))]
    found = [t for t, one in zip(day.time.tolist(), said, strict=False) if stopped(one)]
    assert runs < found[0] <= runs + 1800.0
    assert stopped(said[-1])
    assert said[-1].states["z_um"].word == "fading"
    assert not any(one.failed for one in said)
    sound = [said for _, said in go(Compensator.of([model]), rows_of(day.time[:1500], table, names_of(model)))]
    assert not any(stopped(one) for one in sound)


@pytest.mark.parametrize("updates", [600.0, 900.0])
def test_a_source_that_is_slow_from_the_start_has_not_stopped_for_long(updates: float) -> None:
    """Values every ten minutes: until the second one it may be taken for a source that has stopped, then it is not."""
    model = fitted(())
    day = virtual.record("demo", seed=7)[0]
    table = day.table[names_of(model)].to_numpy(np.float64)[:1500].copy()
    heat = [k for k, name in enumerate(names_of(model)) if name.endswith("_C")]
    held = (day.time[:1500] // updates * updates / (day.time[1] - day.time[0])).astype(int)
    table[:, heat] = table[held][:, heat]
    said = [said for _, said in go(Compensator.of([model]), rows_of(day.time[:1500], table, names_of(model)))]
    assert not any(stopped(one) for one in said[int(updates / 20) + 1 :])
