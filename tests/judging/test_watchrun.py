"""The watch as machine code of the program finds what the watch in numpy finds."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from watchedmachine import failing

from thermocomp.core.arrays import FloatArray
from thermocomp.core.watch import Watch
from thermocomp.judging.watchrun import run_watch
from thermocomp.models.watching import find_watch
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack
from thermocomp.runtime.watch import begin, look

#: values that no sensor of a healthy machine reads
STRANGE = (np.nan, np.inf, -np.inf, 1e300, -273.15, 0.0, 1e5, 85.0)


@cache
def watched() -> tuple[Watch, Samples]:
    samples = stack([failing()], ["z_um"])
    watch = find_watch(samples, np.ones(len(samples), np.bool_))
    assert watch is not None
    return watch, samples


def check(time: FloatArray, values: FloatArray, resting: np.ndarray, zero: FloatArray | None) -> np.ndarray:
    """Compare both over the same readings; return the faults."""
    watch, _ = watched()
    state = begin(watch, zero)
    passed, faults = run_watch(watch, time, values, resting, zero)
    for row, now in enumerate(time.tolist()):
        state, believed = look(watch, state, now, values[row], resting=bool(resting[row]))
        assert faults[row].tolist() == state.fault.tolist(), row
        np.testing.assert_allclose(passed[row], believed, rtol=1e-12, atol=1e-12)
    return faults


@pytest.mark.parametrize("known", ["first", "given", "partly"])
def test_planted_failures_are_found_alike(known: str) -> None:
    watch, samples = watched()
    mine = samples.test == 0
    values = samples.values[mine][:, [[c.name for c in samples.inputs].index(i.name) for i in watch.inputs]].copy()
    time, resting = samples.time[mine], samples.stands[mine]
    zero = None if known == "first" else values[0].copy()
    if known == "partly" and zero is not None:
        zero[0] = np.nan
    heat = watch.bank.temperatures.tolist()
    values[40:60, heat[0]] = np.nan
    values[100:, heat[1]] += 6.0
    values[150:, heat[2]] = values[150, heat[2]]
    faults = check(time, values, resting, zero)
    assert {1, 2} <= set(np.unique(faults).tolist())


@given(st.data())
def test_hostile_readings_are_found_alike(data: st.DataObject) -> None:
    watch, samples = watched()
    places = [[c.name for c in samples.inputs].index(i.name) for i in watch.inputs]
    begin_at = data.draw(st.integers(0, len(samples) - 80))
    values = samples.values[begin_at : begin_at + 60, places].copy()
    steps = data.draw(st.lists(st.sampled_from([0.01, 1.0, 9.99, 10.0, 60.0, 4e3, 3e5]), min_size=60, max_size=60))
    cells = st.tuples(st.integers(0, 59), st.integers(0, len(places) - 1))
    for (row, column), value in data.draw(st.dictionaries(cells, st.sampled_from(STRANGE), max_size=20)).items():
        values[row, column] = value
    for (row, column), value in data.draw(st.dictionaries(cells, st.floats(-20.0, 20.0), max_size=4)).items():
        values[row:, column] += value
    resting = np.array(data.draw(st.lists(st.booleans(), min_size=60, max_size=60)))
    check(np.cumsum(steps), values, resting, None)


def test_the_caller_s_values_stay_as_they_are() -> None:
    watch, _ = watched()
    values = np.full((3, len(watch.inputs)), 20.0)
    run_watch(watch, np.arange(3.0), values, np.ones(3, np.bool_))
    assert (values == 20.0).all()
