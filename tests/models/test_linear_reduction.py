"""The estimator of reduced models: scikit-learn's contract, its choice, its digits."""

from collections.abc import Callable
from itertools import combinations

import numpy as np
import pytest
from numpy.typing import NDArray
from sklearn.utils.estimator_checks import parametrize_with_checks

from thermocomp.core.exceptions import InputError
from thermocomp.export.reduction import models as reduced
from thermocomp.export.reduction.models import LinearReduction
from thermocomp.models.base import ThermalRegressor

FloatArray = NDArray[np.float64]


@parametrize_with_checks([LinearReduction(), LinearReduction(max_sensors=3, fit_intercept=True)])  # type: ignore[untyped-decorator]
def test_contract_of_scikit_learn(estimator: ThermalRegressor, check: Callable[[ThermalRegressor], None]) -> None:
    check(estimator)


def drift(seed: int = 0, n: int = 300) -> tuple[FloatArray, FloatArray, NDArray[np.intp]]:
    rng = np.random.default_rng(seed)
    X = np.cumsum(rng.normal(size=(n, 6)), axis=0)
    return X, 5 * X[:, 1] - 3 * X[:, 4] + 0.5 * rng.normal(size=n), np.arange(n) // 60


@pytest.mark.parametrize("intercept", [False, True])
def test_the_set_that_predicts_unseen_cycles_best_is_taken(intercept: bool) -> None:
    X, y, cycle = drift()
    y = y + 40 * intercept
    found = LinearReduction(max_sensors=2, fit_intercept=intercept).fit(X, y, cycle=cycle)

    def unseen(columns: tuple[int, ...]) -> float:
        squares = 0.0
        for k in range(5):
            out = cycle == k
            A = np.column_stack([X[:, columns], np.ones(len(y))]) if intercept else X[:, columns]
            w = np.linalg.lstsq(A[~out], y[~out])[0]
            squares += float(((y[out] - A[out] @ w) ** 2).sum())
        return float(np.sqrt(squares / len(y)))

    scores = {c: unseen(c) for c in combinations(range(6), 2)}
    assert found.selected_ == min(scores, key=lambda c: scores[c]) == (1, 4)
    assert found.unseen_ == pytest.approx(scores[1, 4], rel=1e-6)
    assert found.coef_.tolist() == pytest.approx([5, -3], abs=0.1)
    assert found.intercept_ == pytest.approx(40 * intercept, abs=1)


def test_numbers_are_those_that_are_printed() -> None:
    X, y, cycle = drift()
    found = LinearReduction(max_sensors=2, fit_intercept=True, digits=3).fit(X, y, cycle=cycle)
    assert all(c == float(f"{c:.3g}") for c in (*found.coef_.tolist(), found.intercept_))


def test_a_further_sensor_has_to_earn_its_place() -> None:
    X, _, cycle = drift()
    y = 5 * X[:, 1] + 0.02 * X[:, 4] + np.random.default_rng(5).normal(size=len(X))  # 4 saves 2 % of what is left
    assert LinearReduction(max_sensors=4).fit(X, y, cycle=cycle).selected_ == (1,)


def test_what_does_harm_with_a_sensor_lost_is_passed_over(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(1)
    common = 10 * np.sin(np.linspace(0, 20, 300))[:, None]
    X = common + 0.3 * rng.normal(size=(300, 3))
    noise = rng.normal(size=300)
    cycle = np.arange(300) // 60
    # 0 and 1 cancel each other: with one of them lost what is said is several times what there is
    y = 4 * (X[:, 0] - X[:, 1]) + 0.5 * X[:, 2] + 2 * noise
    assert len(LinearReduction(max_sensors=2).fit(X, y, cycle=cycle).selected_) == 1
    with monkeypatch.context() as patched:
        patched.setattr(reduced, "DEAR", 0.0)
        assert LinearReduction(max_sensors=2).fit(X, y, cycle=cycle).selected_ == (0, 1)
    # if nothing else is any good, they are taken, and judging says so
    y = 30 * (X[:, 0] - X[:, 1]) + 0.5 * noise
    assert LinearReduction(max_sensors=2).fit(X, y, cycle=cycle).selected_ == (0, 1)


def test_beyond_many_sets_those_around_the_best_are_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    X, y, cycle = drift()
    monkeypatch.setattr(reduced, "_MOST_SETS", 10)
    assert LinearReduction(max_sensors=2).fit(X, y, cycle=cycle).selected_ == (1, 4)


def test_nothing_moves() -> None:
    found = LinearReduction().fit(np.full((40, 2), 20.0), np.arange(40.0), cycle=np.arange(40) // 20)
    assert (found.selected_, found.coef_.tolist()) == ((), [])


def test_bad_settings_are_refused() -> None:
    X, y, _ = drift()
    for sensors, digits in ((0, 5), (1, 0), (1, 18)):
        with pytest.raises(InputError, match="max_sensors"):
            LinearReduction(max_sensors=sensors, digits=digits).fit(X, y)
