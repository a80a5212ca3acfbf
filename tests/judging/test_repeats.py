"""Cycles or files that are one observation."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from thermocomp.core.learned import Learned
from thermocomp.judging.baselines import Series
from thermocomp.judging.do_no_harm import Verdict
from thermocomp.judging.judgedunits import measure
from thermocomp.judging.recommend import holm
from thermocomp.judging.repeats import group_repeats

FloatArray = NDArray[np.float64]
LEARNED = Learned(mean=0.0, last=0.0, noise=0.05, largest=20.0)


def wander(seed: int, rows: int) -> FloatArray:
    x = np.cumsum(np.random.default_rng(seed).normal(size=rows))
    return np.asarray(20.0 * x / np.ptp(x))


def series(drift: FloatArray, first: float = 0.0, interval: float = 60.0) -> Series:
    return Series("a", first + interval * np.arange(float(len(drift))), drift, (drift,))


@given(st.integers(0, 2**32 - 1), st.floats(-50, 50), st.integers(0, 30), st.floats(0, 1e6))
def test_a_copy_is_known_again_after_a_shift_of_rows_zero_and_clock(
    seed: int, zero: float, shift: int, first: float
) -> None:
    long = wander(seed, 150)
    noise = 0.05 * np.random.default_rng(seed).normal(size=(2, 120))
    copies = [long[:120] + noise[0], long[shift : shift + 120] + zero + noise[1]]
    assert group_repeats([series(copies[0]), series(copies[1], first)]) == [[0, 1]]


def test_a_copy_is_known_again_at_another_interval() -> None:
    drift = wander(3, 121)
    coarse = np.interp(np.arange(0, 120, 1.25), np.arange(121), drift)
    assert group_repeats([series(drift), series(coarse, interval=75.0)]) == [[0, 1]]


def test_other_drifts_are_other_observations() -> None:
    units = [series(wander(k, 100)) for k in (1, 2, 4)]
    assert group_repeats([*units, units[1]]) == [[0], [1, 3], [2]]
    assert group_repeats([series(np.zeros(1)), series(np.zeros(30))]) == [[0], [1]]


def test_alike_in_part_is_not_the_same() -> None:
    details, ramp = wander(1, 100), np.linspace(0.0, 40.0, 100)
    assert group_repeats([series(details), series(details + ramp)]) == [[0], [1]]
    slow = 60.0 * (1 - np.exp(-np.arange(100) / 30.0))
    assert group_repeats([series(slow + 0.2 * wander(k, 100)) for k in (1, 2)]) == [[0], [1]]
    assert group_repeats([series(slow + 0.2 * details)] * 2) == [[0, 1]]


def verdict(of: list[int], left: list[float]) -> Verdict:
    """Return the verdict over copies of drifts, with the share that the model leaves of each."""
    units = []
    for k, (seed, share) in enumerate(zip(of, left, strict=True)):
        drift = wander(seed, 100) + 0.05 * np.random.default_rng(100 + k).normal(size=100)
        drift -= drift[0]
        predicted = drift - share * (wander(seed + 50, 100))
        told = (f"recording {k}", 60.0 * np.arange(100.0))
        units.append(measure(str(k), drift, predicted, LEARNED, series=told, margin=100.0))
    return Verdict(tuple(units))


def test_repeats_count_once() -> None:
    others = verdict([1, 2, 4, 5, 6, 7], [0.2] * 6)
    assert others.word == "accepted"
    two = verdict([1, 2, 1, 2, 1, 2], [0.2] * 6)  # two observations, however often
    assert two.word == "accepted for this duty"
    # one drift that the model knows, five times, and two that it hardly knows
    three = verdict([1, 1, 1, 1, 1, 2, 4], [0.05] * 5 + [0.9, 0.9])
    assert three.p_value < 0.05
    assert three.word == "accepted for this duty"
    assert "other speeds and durations are not proved" in three.reason


def test_repeats_count_once_after_the_correction_for_the_number_of_methods() -> None:
    found = verdict([1] * 6 + [2, 4, 5], [0.1] * 6 + [0.3, 0.8, 0.9])
    assert found.word == "accepted"
    one, *_ = holm([found] * 100)
    assert one.p_value < 0.05
    assert one.word == "accepted for this duty"


def test_warm_ups_of_other_sizes_are_no_repeats() -> None:
    """Each is the other one, shifted."""
    warm_up = 1 - np.exp(-np.arange(100) / 30.0)
    assert group_repeats([series(10 * size * warm_up) for size in (0.6, 0.8, 1.0)]) == [[0], [1], [2]]


@pytest.mark.parametrize("n", [0, 1])
def test_too_few_for_groups(n: int) -> None:
    assert verdict([1] * n, [0.2] * n).word == "unproven"
