"""The zero: a mean over the first minutes at rest, never one reading where more are there, nor of a warming machine."""

import math
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from thermocomp.core.exceptions import InputError
from thermocomp.core.zero import FIRST_READING, Zeroing, ZeroMean, first_rows, mean_over_time

ZEROING = Zeroing()


def count(time: NDArray[np.float64], resting: NDArray[np.bool_], zeroing: Zeroing = ZEROING) -> int:
    return first_rows(zeroing, time, resting)[0]


@pytest.mark.parametrize(("interval", "rows"), [(1.0, 301), (15.0, 21), (60.0, 6), (400.0, 1), (0.25, 1201)])
def test_five_minutes_at_rest(interval: float, rows: int) -> None:
    time = np.array([k * interval for k in range(2000)])
    assert count(time, np.ones(2000, np.bool_)) == rows


@pytest.mark.parametrize(("interval", "rows"), [(60.0, 1), (15.0, 1), (10.0, 2), (1.0, 11)])
def test_what_warms_up_from_its_first_row_keeps_to_the_first_seconds(interval: float, rows: int) -> None:
    time = np.array([k * interval for k in range(2000)])
    assert count(time, np.zeros(2000, np.bool_)) == rows
    stops_later = np.arange(2000) > 3
    assert count(time, stops_later) == rows


def test_it_ends_where_the_spindle_starts() -> None:
    time = np.array([k * 15.0 for k in range(100)])
    assert first_rows(ZEROING, time, time < 70) == (5, 5)
    assert first_rows(ZEROING, time, time < 1) == (1, 1)


def test_the_first_reading_is_one() -> None:
    assert first_rows(FIRST_READING, np.arange(5.0), np.ones(5, np.bool_)) == (1, 0)
    assert first_rows(FIRST_READING, np.empty(0), np.empty(0, np.bool_)) == (0, 0)


@given(
    st.lists(st.tuples(st.floats(0.1, 90.0), st.booleans()), min_size=1, max_size=60),
    st.floats(0.0, 400.0),
    st.floats(0.0, 60.0),
)
def test_known_live_when_it_is_known_in_a_file(
    steps: list[tuple[float, bool]], at_rest: float, otherwise: float
) -> None:
    """The incremental words and the ones for a whole test are the same, and nothing later changes a zero."""
    zeroing = Zeroing(at_rest, otherwise)
    time = np.cumsum(np.array([dt for dt, _ in steps]), dtype=np.float64)
    resting = np.array([r for _, r in steps])
    rows, known = first_rows(zeroing, time, resting)
    assert rows <= known + 1
    for more in range(known + 1, len(time)):
        assert first_rows(zeroing, time[: more + 1], resting[: more + 1]) == (rows, known)
    averaged = ZeroMean()
    for k, (t, r) in enumerate(zip(time.tolist(), resting.tolist(), strict=True)):
        assert averaged.belongs(zeroing, t, r) == (k < rows)
        if k == rows:
            break
        averaged = averaged.add(t, np.zeros(1), r)
        assert averaged.complete(zeroing) == (k == known)
    limit = at_rest if resting[0] else otherwise
    assert time[rows - 1] - time[0] <= limit
    if resting[0]:
        assert resting[:rows].all()


@given(
    st.lists(st.tuples(st.floats(0.001, 60.0), st.floats(20.0, 25.0)), min_size=3, max_size=30),
    st.sampled_from([85.0, -127.0, 1e30]),
    st.integers(0, 29),
)
def test_one_wrong_reading_has_no_effect_wherever_it_is(
    rows: list[tuple[float, float]], dead: float, where: int
) -> None:
    time: NDArray[np.float64] = np.cumsum([dt for dt, _ in rows])
    values = np.array([v for _, v in rows])
    rest = np.delete(values, where % len(values))
    values[where % len(values)] = dead
    assert rest.min() - 1e-9 <= mean_over_time(time, values) <= rest.max() + 1e-9


@given(st.lists(st.tuples(st.floats(0.001, 60.0), st.floats(-30.0, 90.0)), min_size=3, max_size=60))
def test_each_median_counts_for_its_time(rows: list[tuple[float, float]]) -> None:
    time: NDArray[np.float64] = np.cumsum([dt for dt, _ in rows])
    values = np.array([v for _, v in rows])
    medians = [float(np.median(values[k : k + 3])) for k in range(len(rows) - 2)]
    expected = np.average(medians, weights=time[2:] - time[:-2])
    assert mean_over_time(time, values) == pytest.approx(expected, abs=1e-12)


def test_the_first_two_readings_count_equally() -> None:
    assert mean_over_time(np.array([5.0]), np.array([[20.1, 21.7]])).tolist() == [20.1, 21.7]
    assert mean_over_time(np.array([5.0, 6.0]), np.array([[20.0, 21.0], [22.0, 20.0]])).tolist() == [21.0, 20.5]


def test_noise_gets_less_by_the_number_of_readings() -> None:
    """Medians cost a tenth of it."""
    rng = np.random.default_rng(0)
    means = [mean_over_time(np.arange(0.0, 315.0, 15.0), 20 + 0.4 * rng.normal(size=(21, 3))) for _ in range(500)]
    assert np.std(means) == pytest.approx(1.1 * 0.4 / math.sqrt(21), rel=0.05)


def ramp(time: NDArray[np.float64]) -> NDArray[np.float64]:
    return 20.0 + time / 300.0


@pytest.mark.parametrize("cycle", [0.001, 0.1, 1.0, 15.0, 60.0])
def test_the_mean_does_not_depend_on_the_cycle(cycle: float) -> None:
    time = np.linspace(0.0, 300.0, round(300.0 / cycle) + 1)
    assert mean_over_time(time, ramp(time)) == pytest.approx(20.5, abs=1e-9)


def test_two_cycles_in_one_interval_weigh_by_their_time() -> None:
    """A logger that records each second for a minute, and each 15 s after that: readings would say 20.33."""
    time = np.concatenate([np.arange(60.0), np.arange(60.0, 301.0, 15.0)])
    assert mean_over_time(time, ramp(time)) == pytest.approx(20.5, abs=0.03)  # half a cycle at its end is missing
    assert ramp(time).mean() < 20.4


def test_a_gap_counts_half_as_the_readings_before_it() -> None:
    time = np.concatenate([np.arange(0.0, 50.0, 5.0), np.arange(250.0, 301.0, 5.0)])
    values = np.where(time < 100.0, 20.0, 21.0)
    assert mean_over_time(time, values) == pytest.approx(20.0 + 150.0 / 295.0)


def test_steps_of_a_sensor_are_averaged() -> None:
    """Its noise moves a coarse sensor between two steps; the most frequent of its values is 0.18 degC off."""
    rng, step = np.random.default_rng(3), 0.5
    time = np.arange(301.0)
    read = np.round((20.18 + 0.25 * rng.normal(size=(301, 200))) / step) * step
    assert abs(mean_over_time(time, read) - 20.18).mean() < 0.05


def test_only_a_number_near_zero_stands() -> None:
    assert all(ZEROING.stands(speed) for speed in (0.0, 0, 0.4, -10.0, np.float64(0.0)))
    assert not any(ZEROING.stands(speed) for speed in (math.nan, None, "0", True, False, 10.5, -3000.0, math.inf))


@pytest.mark.parametrize("bad", [-1.0, math.nan, math.inf])
def test_times_are_times(bad: float) -> None:
    for at_rest, otherwise in ((bad, 0.0), (0.0, bad)):
        with pytest.raises(InputError, match=r"zero: (at_rest|otherwise) must be from 0"):
            Zeroing(at_rest, otherwise)


def test_memory_of_a_fast_source_is_bounded() -> None:
    """Ten thousand readings take what three take."""
    averaged, sizes = ZeroMean(), set[int]()
    for k in range(10_000):
        assert averaged.belongs(ZEROING, 0.01 * k, resting=True)
        averaged = averaged.add(0.01 * k, np.zeros(2), resting=True)
        assert not averaged.complete(ZEROING)
        if k >= 2:
            sizes.add(len(pickle.dumps(averaged)))
    assert len(sizes) == 1


@pytest.mark.parametrize("time", [20.0, 10.0, -1e6])
@pytest.mark.parametrize("others", [1, 2, 3])
def test_a_reading_that_is_not_later_does_not_count(time: float, others: int) -> None:
    averaged = ZeroMean()
    for k in range(others):
        averaged = averaged.add(20.0 - 10.0 * (others - 1 - k), np.array([20.0 + k]), resting=True)
    assert averaged.add(time, np.array([99.0]), resting=True) is averaged
