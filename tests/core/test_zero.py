"""The zero: a mean over the first minutes at rest, never one reading where more are there, nor of a warming machine."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from thermocomp.core.exceptions import InputError
from thermocomp.core.zero import FIRST_READING, MOST, Gathered, Zeroing, first_rows, robust_mean

ZEROING = Zeroing()


def count(time: NDArray[np.float64], resting: NDArray[np.bool_], zeroing: Zeroing = ZEROING) -> int:
    return first_rows(zeroing, time, resting)[0]


@pytest.mark.parametrize(("interval", "rows"), [(1.0, 301), (15.0, 21), (60.0, 6), (400.0, 1), (0.1, MOST)])
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
    gathered = Gathered()
    for t, r in zip(time[:rows], resting[:rows], strict=True):
        assert gathered.belongs(zeroing, float(t), bool(r))
        gathered = gathered.add(float(t), np.zeros(1), bool(r))
    limit = at_rest if resting[0] else otherwise
    assert time[rows - 1] - time[0] <= limit
    if resting[0]:
        assert resting[:rows].all()


@given(
    st.lists(st.floats(20.0, 25.0), min_size=4, max_size=30),
    st.sampled_from([85.0, -127.0, 1e30]),
    st.integers(0, 29),
)
def test_one_outlier_moves_it_no_further_than_the_others_spread(values: list[float], dead: float, where: int) -> None:
    spoiled = np.array(values)
    spoiled[where % len(values)] = dead
    rest = np.delete(spoiled, where % len(values))
    assert rest.min() - 1e-9 <= robust_mean(spoiled) <= rest.max() + 1e-9


def test_noise_gets_less_by_the_number_of_readings() -> None:
    rng = np.random.default_rng(0)
    means = [robust_mean(20 + 0.4 * rng.normal(size=(21, 3))) for _ in range(500)]
    assert np.std(means) == pytest.approx(0.4 / math.sqrt(21), rel=0.1)
    assert robust_mean(np.array([[20.1, 21.7]])).tolist() == [20.1, 21.7]


def test_only_a_number_near_zero_stands() -> None:
    assert all(ZEROING.stands(speed) for speed in (0.0, 0, 0.4, -10.0, np.float64(0.0)))
    assert not any(ZEROING.stands(speed) for speed in (math.nan, None, "0", True, False, 10.5, -3000.0, math.inf))


@pytest.mark.parametrize("bad", [-1.0, math.nan, math.inf])
def test_times_are_times(bad: float) -> None:
    for at_rest, otherwise in ((bad, 0.0), (0.0, bad)):
        with pytest.raises(InputError, match=r"zero: (at_rest|otherwise) must be from 0"):
            Zeroing(at_rest, otherwise)


def test_memory_of_a_fast_source_is_bounded() -> None:
    gathered = Gathered()
    for k, (a, _) in enumerate(pairwise(np.arange(0.0, 60.0, 0.01))):
        if not gathered.belongs(ZEROING, a, True):
            assert k == MOST
            break
        gathered = gathered.add(a, np.zeros(2), True)
    assert len(gathered.times) == MOST
    assert gathered.complete(ZEROING)
