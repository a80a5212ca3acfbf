"""The do-no-harm gate."""

import numpy as np
import pytest
from scipy.signal import lfilter

from thermocomp.assessment import harm

RNG = np.random.default_rng(0)


def drift(n: int = 600) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return 20 * (1 - np.exp(-np.arange(n) / 150))


def everything(n: int = 600) -> list[tuple[str, np.ndarray[tuple[int], np.dtype[np.bool_]]]]:
    return [("cycle 1", np.ones(n, np.bool_))]


def test_a_good_model_passes() -> None:
    measured = drift()
    verdict = harm.judge(measured, 0.9 * measured, everything())
    assert verdict.accepted
    assert verdict.word == "accepted"
    assert verdict.cycles[0].ratio == pytest.approx(0.1)
    assert verdict.cycles[0].ratio_bound == pytest.approx(0.1)
    assert "better than none wherever it was judged" in verdict.reason


def test_a_harmful_model_is_refused_with_figures() -> None:
    measured = drift()
    verdict = harm.judge(measured, -0.5 * measured, everything())
    assert not verdict.accepted
    assert verdict.reason.startswith("worse than none in cycle 1: RMS ")


def test_no_compensation_is_not_better_than_none() -> None:
    assert not harm.judge(drift(), np.zeros(600), everything()).accepted


def test_one_bad_cycle_refuses_the_model() -> None:
    measured = np.concatenate([drift(), 0.2 * drift()])
    predicted = np.concatenate([0.95 * drift(), -0.5 * drift()])
    rows = np.arange(1200) < 600
    verdict = harm.judge(measured, predicted, [("first", rows), ("second", ~rows)])
    assert [c.passed for c in verdict.cycles] == [True, False]
    assert not verdict.accepted
    assert "second" in verdict.reason


def test_a_gain_that_chance_could_explain_is_refused() -> None:
    """A slightly better RMS from one lucky stretch must not pass; rows of a drift depend on each other."""
    measured = np.full(600, 10.0)
    residual = np.full(600, 10.5)
    residual[:90] = 0.0  # one sixth of the test is perfect, the rest a little worse than none
    verdict = harm.judge(measured, measured - residual, everything())
    assert verdict.cycles[0].ratio < 1
    assert not verdict.accepted
    assert "not surely better" in verdict.reason


def test_bound_tightens_with_independent_rows() -> None:
    measured = 10 + RNG.normal(size=5000)
    predicted = measured - RNG.normal(0, 9, 5000)
    verdict = harm.judge(measured, predicted, everything(5000))
    assert verdict.cycles[0].ratio < verdict.cycles[0].ratio_bound < verdict.cycles[0].ratio * 1.05


def test_too_few_rows_prove_nothing() -> None:
    verdict = harm.judge(np.ones(19), np.ones(19), everything(19))
    assert not verdict.accepted
    assert "fewer than 20 rows" in verdict.reason
    assert not harm.judge(np.ones(3), np.ones(3), []).accepted


def test_a_machine_that_does_not_drift_needs_no_model() -> None:
    verdict = harm.judge(np.zeros(100), np.full(100, 0.1), everything(100))
    assert not verdict.accepted


def test_a_model_as_bad_as_none_is_mostly_refused() -> None:
    """Residual and drift are independent slow series of one size: few pass by luck."""
    rng = np.random.default_rng(11)
    accepted = 0
    for _ in range(100):
        measured, residual = (lfilter([1.0], [1.0, -0.98], rng.normal(size=2000)) for _ in range(2))
        accepted += harm.judge(measured, measured - residual, everything(2000), draws=300).accepted
    assert accepted <= 15
