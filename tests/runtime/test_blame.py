"""Two temperature sensors that are swapped at the terminals: found by their responses, and by nothing else."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from numpy.typing import NDArray

from thermocomp.core.thresholds import THRESHOLDS
from thermocomp.core.watch import Watch
from thermocomp.models.watching import find_watch
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack
from thermocomp.runtime.watch import look
from thermocomp.runtime.watchstate import GOOD, MISSING, SWAPPED, UNEXPLAINED, begin
from thermocomp.virtual import datasets as virtual

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
SIX = ("t_housing_C", "t_motor_C", "t_column_front_left_C", "t_z_bearing_C", "t_table_C", "t_enclosure_C")
PAIRS = tuple(combinations(range(len(SIX)), 2))


@pytest.fixture(scope="module", params=["linear", "nonlinear"])
def samples(request: pytest.FixtureRequest) -> Samples:
    """The virtual machine, a row a minute; the first cycle is not learned from."""
    whole = stack(virtual.record("demo", physics=request.param), ["z_um"])
    return whole.take(np.arange(len(whole)) % 3 == 0).only([*SIX, "spindle_rpm"])


@pytest.fixture(scope="module")
def watch(samples: Samples) -> Watch:
    found = find_watch(samples, samples.cycle != 0)
    assert found is not None
    return found


def run(watch: Watch, samples: Samples, values: FloatArray) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return what each sensor was first found to be, when [s], and what was let through."""
    runs = values.shape[1]
    state, through = begin(watch, runs=(runs,)), np.empty_like(values)
    first, when = np.zeros((runs, len(watch.sensors)), dtype=np.int64), np.full((runs, len(watch.sensors)), np.inf)
    for k, time in enumerate(samples.time[: len(values)].tolist()):
        state, through[k] = look(watch, state, time, values[k], resting=bool(samples.stands[k]))
        new = (state.fault != GOOD) & (first == GOOD)
        first[new], when[new] = state.fault[new], time
    return first, when, through


def swapped(samples: Samples) -> FloatArray:
    """Return a run in order and one per pair that is swapped, each at its own zero, (n_rows, 1 + n_pairs, n_inputs)."""
    zero = samples.reference()[0]
    change = np.repeat((samples.values - zero)[:, None], 1 + len(PAIRS), axis=1)
    for k, (i, j) in enumerate(PAIRS, start=1):
        change[:, k, [i, j]] = change[:, k][:, [j, i]]
    return np.asarray(change + zero)


def test_every_pair_is_named_once_its_responses_differ(watch: Watch, samples: Samples) -> None:
    """Soon after the first lasting difference by more than both limits, but for one pair in which both are off alone.

    Of 224 pairs in 16 recordings of other seeds, 223 are named; in the other one, only sensors of the pair are off.
    """
    found, when, _ = run(watch, samples, swapped(samples))
    assert not found[0].any()
    change, off, differ, named = samples.change(), watch.limits("off"), 0, 0
    for k, (i, j) in enumerate(PAIRS, start=1):
        apart = samples.time[np.abs(change[:, i] - change[:, j]) > max(off[i], off[j])]
        if len(apart) * 60.0 <= THRESHOLDS.fault_duration:
            assert not np.delete(found[k], [i, j]).any()
            continue
        differ += 1
        assert np.flatnonzero(found[k]).tolist() == [i, j]
        if found[k, [i, j]].tolist() == [SWAPPED, SWAPPED]:
            named += 1
            assert when[k, i] == when[k, j] <= apart[0] + 30 * 60.0
    assert named >= differ - 1 >= 12


def test_what_stands_in_for_the_two_is_nearer_than_they_were(watch: Watch, samples: Samples) -> None:
    values = swapped(samples)
    found, when, through = run(watch, samples, values)
    k = 1 + PAIRS.index((0, 4))
    after = samples.time >= when[k, 0] + 3600.0
    for sensor in (0, 4):
        assert found[k, sensor] == SWAPPED
        left = np.sqrt(np.mean((through[after, k, sensor] - samples.values[after, sensor]) ** 2))
        assert left < 0.35 * np.sqrt(np.mean((values[after, k, sensor] - samples.values[after, sensor]) ** 2))
    others = [c for c in range(values.shape[2]) if c not in (0, 4)]
    assert np.array_equal(through[:, k][:, others], values[:, k][:, others])


def test_absolute_temperatures_are_exchanged_as_they_are(samples: Samples) -> None:
    found = find_watch(replace(samples, rezero=False), samples.cycle != 0)
    assert found is not None
    pairs = [(0, 1), (0, 2), (0, 3), (0, 5), (1, 3), (1, 5)]
    values = np.repeat(samples.values[:, None], 1 + len(pairs), axis=1)
    for k, (i, j) in enumerate(pairs, start=1):
        values[:, k, [i, j]] = values[:, k][:, [j, i]]
    first, _, _ = run(found, samples, values)
    assert not first[0].any()
    for k, pair in enumerate(pairs, start=1):
        assert np.flatnonzero(first[k]).tolist() == list(pair)
    assert set(first[first != GOOD].tolist()) <= {SWAPPED, UNEXPLAINED}  # most of these are not certain


def test_a_sensor_that_comes_to_read_what_another_does_is_alone(watch: Watch, samples: Samples) -> None:
    """The responses had differed as they should: since the start, nothing was swapped."""
    values = np.repeat(samples.values[:, None], len(PAIRS), axis=1)
    for k, (i, j) in enumerate(PAIRS):
        values[1000:, k, i] = samples.values[1000:, j]
    found, _, _ = run(watch, samples, values)
    assert not (found == SWAPPED).any()
    for k, (i, _) in enumerate(PAIRS):
        assert not np.delete(found[k], i).any()


@pytest.mark.parametrize("unseen", [1, 5])
def test_one_that_fails_is_not_two_that_are_swapped(samples: Samples, unseen: int) -> None:
    """Though exchanging two would explain it now: not that all was well before."""
    watch = find_watch(samples, samples.cycle != unseen)
    assert watch is not None
    places = [(row, kind, k) for row in (500, 700) for kind in range(5) for k in range(len(SIX))]
    values = np.repeat(samples.values[:, None], len(places), axis=1)
    for place, (row, kind, k) in enumerate(places):
        hours = (samples.time[row:] - samples.time[row]) / 3600.0
        values[row:, place, k] += [3.0, -3.0, hours, -hours, samples.values[row, k] - samples.values[row:, k]][kind]
    found, _, _ = run(watch, samples, values)
    assert not (found == SWAPPED).any()


def test_what_is_missing_is_not_swapped(watch: Watch, samples: Samples) -> None:
    """Two that never read, and are swapped: they are missing, and the others are in order."""
    values = swapped(samples)[:700, [1 + PAIRS.index((0, 4))]]
    values[5:, 0, [0, 4]] = np.nan
    found, _, _ = run(watch, samples, values)
    assert found.tolist() == [[MISSING, 0, 0, 0, MISSING, 0]]
