"""The watch as machine code of the program finds what the watch in numpy finds."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache
from unittest.mock import Mock, patch

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from watchedmachine import failing

from thermocomp.core.arrays import FloatArray
from thermocomp.core.watch import Watch
from thermocomp.judging import watchrun
from thermocomp.judging.compiled import machine
from thermocomp.judging.compiled.machine import run
from thermocomp.judging.watchrun import run_watch
from thermocomp.models.watching import find_watch
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack
from thermocomp.runtime.program.memory import FlatMemory
from thermocomp.runtime.watch import look
from thermocomp.runtime.watchstate import SWAPPED, UNEXPLAINED, begin
from thermocomp.virtual import datasets as virtual

SIX = ("t_housing_C", "t_motor_C", "t_column_front_left_C", "t_z_bearing_C", "t_table_C", "t_enclosure_C")
#: values that no sensor of a healthy machine reads
STRANGE = (np.nan, np.inf, -np.inf, 1e300, -273.15, 0.0, 1e5, 85.0)


@cache
def watched() -> tuple[Watch, Samples]:
    samples = stack([failing()], ["z_um"])
    watch = find_watch(samples, np.ones(len(samples), np.bool_))
    assert watch is not None
    return watch, samples


@cache
def six(rezero: bool = True) -> tuple[Watch, Samples]:
    """Return six temperatures of the virtual machine: enough for swaps to be told from single failures."""
    whole = stack(virtual.record("demo"), ["z_um"])
    samples = replace(whole.take(np.arange(len(whole)) % 3 == 0).only([*SIX, "spindle_rpm"]), rezero=rezero)
    watch = find_watch(samples, samples.cycle != 3)
    assert watch is not None
    return watch, samples


def check(
    time: FloatArray, values: FloatArray, resting: np.ndarray, zero: FloatArray | None, watch: Watch | None = None
) -> np.ndarray:
    """Compare both over the same readings; return the faults."""
    watch = watch or watched()[0]
    state = begin(watch, zero)
    memories: list[FlatMemory] = []

    def kept(procedure: Callable[..., None], memory: FlatMemory) -> None:
        memories.append(memory)
        run(procedure, memory)

    with patch.object(watchrun, "run", kept):
        passed, faults = run_watch(watch, time, values, resting, zero)
    for row, now in enumerate(time.tolist()):
        state, believed = look(watch, state, now, values[row], resting=bool(resting[row]))
        assert faults[row].tolist() == state.faults(watch).tolist(), row
        np.testing.assert_allclose(passed[row], believed, rtol=1e-12, atol=1e-12)
    if not np.isnan(state.time):  # what later decisions rest on
        (memory,) = memories
        for name in ("predicted", "usual", "memory", "traces"):
            np.testing.assert_allclose(memory.find("s", name), getattr(state, name), rtol=1e-10, atol=1e-10)
        for name, own in (("heat", "heat"), ("stored", "stored"), ("estimate", "estimate"), ("states", "estimated")):
            np.testing.assert_allclose(memory.find("s", own), getattr(state.heat, name), rtol=1e-9, atol=1e-10)
        cleared = memory.find("s", "cleared") != 0
        assert cleared.tolist() == np.isneginf(state.evidence).tolist()
        found = memory.find("s", "evidence")[~cleared]
        np.testing.assert_allclose(found, state.evidence[~cleared], rtol=1e-9, atol=1e-9)
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


@pytest.mark.parametrize("kind", ["slow", "swapped", "gone", "stuck", "none"])
@pytest.mark.parametrize("begin_at", [950, 1100])
def test_failures_of_a_day_are_found_alike(kind: str, begin_at: int) -> None:
    watch, samples = six()
    values = samples.values[:, [[c.name for c in samples.inputs].index(i.name) for i in watch.inputs]].copy()
    one, other = watch.bank.temperatures[:2].tolist()
    later = slice(begin_at, None)
    if kind == "slow":
        values[later, one] += np.minimum(np.arange(len(values) - begin_at) * 0.02, 4.0)
    elif kind == "swapped":
        values[later, [one, other]] = values[later][:, [other, one]]
    elif kind == "gone":
        values[begin_at : begin_at + 90, one] = np.nan
    elif kind == "stuck":
        values[later, one] = values[begin_at, one]
    faults = check(samples.time, values, samples.stands, None, watch)
    assert faults.any() == (kind != "none")


@pytest.mark.parametrize(
    ("rezero", "pair", "expected"), [(True, [0, 2], SWAPPED), (False, [0, 3], SWAPPED), (False, [1, 5], UNEXPLAINED)]
)
def test_two_sensors_swapped_from_the_start_are_found_alike(rezero: bool, pair: list[int], expected: int) -> None:
    """Not all swaps are certain."""
    watch, samples = six(rezero)
    places = [[c.name for c in samples.inputs].index(i.name) for i in watch.inputs]
    values = samples.values[:1200, places].copy()
    zero = values[:20].mean(axis=0) if rezero else np.zeros(len(places))
    values[:, pair] = (values - zero)[:, pair[::-1]] + zero[pair]
    faults = check(samples.time[:1200], values, samples.stands[:1200], None, watch)
    assert set(faults[:, pair].ravel().tolist()) == {0, expected}
    assert len(set((faults[:, pair] != 0).argmax(axis=0).tolist())) == 1  # at once


@pytest.mark.parametrize("rows", range(4, 100, 6))
def test_what_is_kept_after_the_first_readings_is_alike(rows: int) -> None:
    watch, samples = six()
    places = [[c.name for c in samples.inputs].index(i.name) for i in watch.inputs]
    check(samples.time[:rows], samples.values[:rows, places], samples.stands[:rows], None, watch)


@pytest.mark.parametrize("machine", [watched, six])
@pytest.mark.parametrize("kind", ["zero", "half", "stuck", "double", "gone", "per second", "zero, gone"])
def test_wrong_speeds_are_found_alike(kind: str, machine: Callable[[], tuple[Watch, Samples]]) -> None:
    watch, samples = machine()
    values = samples.values[:, [[c.name for c in samples.inputs].index(i.name) for i in watch.inputs]].copy()
    found = set[int]()
    for row in np.flatnonzero(np.diff(values[:, -1])).tolist()[1:7:3]:  # where the spindle starts and stops
        wrong, begin_at = values.copy(), row + 20
        right, mine = wrong[begin_at:, -1], slice(begin_at + 400)
        changed = {"zero": 0.0 * right, "half": right / 2, "double": 2.0 * right, "per second": right / 60}
        changed["zero, gone"] = np.where(np.arange(len(right)) < 7, 0.0, np.nan)
        wrong[begin_at:, -1] = changed.get(kind, np.full_like(right, values[row, -1] if kind == "stuck" else np.nan))
        found |= set(check(samples.time[mine], wrong[mine], samples.stands[mine], None, watch)[:, -1])
    assert found & {1, 4} or machine is watched
    assert machine is watched or kind == "zero, gone" or (1 if kind == "gone" else 4) in found


def test_code_that_runs_long_is_optimised_and_says_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    watch, samples = six()
    values = samples.values[:, [[c.name for c in samples.inputs].index(i.name) for i in watch.inputs]].copy()
    values[600:, 1], values[900:, 2] = values[600, 1], values[900:, 2] + 8.0
    found = []
    for spent, effort in ((0.0, 0), (machine._PATIENCE, 2)):
        monkeypatch.setattr(machine, "_spent", spent)
        with patch.object(machine, "_compiled", Mock(wraps=machine._compiled)) as compiled:
            found.append(run_watch(watch, samples.time, values, samples.stands))
        compiled.assert_called_once_with("believe_rows", effort)
        assert machine._spent > spent
    for quick, optimised in zip(*found, strict=True):
        np.testing.assert_array_equal(quick, optimised)
    assert found[0][1].any()


def test_threads_that_begin_at_once_share_one_machine_code() -> None:
    """Of a second one, compiled at the same time, a thread would run what the other had discarded."""
    watch, samples = six()
    values = samples.values[:, [[c.name for c in samples.inputs].index(i.name) for i in watch.inputs]]
    compiled = Mock(wraps=machine.compile_module)
    machine._engine.cache_clear()
    machine._compiled.cache_clear()
    with patch.object(machine, "compile_module", compiled), ThreadPoolExecutor(8) as threads:
        found = list(threads.map(lambda _: run_watch(watch, samples.time, values, samples.stands)[1], range(8)))
    assert compiled.call_count == 1
    assert not np.any(found)


def test_a_start_with_a_turning_spindle_is_alike() -> None:
    watch, samples = six()
    values = samples.values[:, [[c.name for c in samples.inputs].index(i.name) for i in watch.inputs]]
    later = slice(int(np.flatnonzero(values[:, -1])[60]), None)
    assert not check(samples.time[later][:90], values[later][:90], samples.stands[later][:90], values[0], watch).any()


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
