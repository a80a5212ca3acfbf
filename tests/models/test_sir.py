"""Sliced inverse regression: directions as by Li, and what is kept of them."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from sklearn.utils.estimator_checks import parametrize_with_checks

from thermocomp.core.exceptions import InputError
from thermocomp.models.base import ThermalRegressor
from thermocomp.models.sir import SlicedInverse
from thermocomp.papers import common
from thermocomp.virtual.datasets import record

FloatArray = NDArray[np.float64]


@parametrize_with_checks([SlicedInverse(), SlicedInverse(fit_intercept=False)])  # type: ignore[untyped-decorator]
def test_contract_of_scikit_learn(estimator: ThermalRegressor, check: Callable[[ThermalRegressor], None]) -> None:
    check(estimator)


def by_li(X: FloatArray, y: FloatArray, slices: int, directions: int) -> tuple[FloatArray, float]:
    """Return coefficients and intercept, step by step as in the paper of 1991 (section 5), on principal components."""
    covariance = np.cov(X.T, bias=True)
    values, axes = np.linalg.eigh(covariance)
    kept = values > 1e-4 * values.max()  # the others are noise
    root = axes[:, kept] / np.sqrt(values[kept])
    white = (X - X.mean(axis=0)) @ root
    between = np.zeros((kept.sum(), kept.sum()))
    for rows in np.array_split(np.argsort(y, kind="stable"), slices):
        mean = white[rows].mean(axis=0)
        between += len(rows) / len(y) * np.outer(mean, mean)
    onto = root @ np.linalg.eigh(between)[1][:, ::-1][:, :directions]
    design = np.column_stack([X @ onto, np.ones(len(y))])
    (*b, constant), *_ = np.linalg.lstsq(design, y, rcond=None)
    return onto @ np.array(b), float(constant)


@pytest.mark.parametrize(("slices", "directions"), [(10, 5), (4, 2)])
def test_as_by_li_on_24_temperatures(slices: int, directions: int) -> None:
    """T-10: on the test of the paper, of which most directions are noise."""
    (test,) = record("stepwise2017", seed=0)
    samples = common.stacked([test], ["x1_um"], [c.name for c in test.temperatures])
    X, y = samples.change(), samples.deviations[:, 0]
    model = SlicedInverse(slices=slices, directions=directions).fit(X, y)
    weights, constant = by_li(X, y, slices, directions)
    np.testing.assert_allclose(model.predict(X), X @ weights + constant, rtol=0, atol=1e-8)
    assert model.n_directions_ == directions
    assert model.r_squared_ == pytest.approx(
        1 - np.sum((y - X @ weights - constant) ** 2) / np.sum((y - y.mean()) ** 2)
    )


def test_it_finds_the_direction_of_a_curve() -> None:
    """T-10: the deviation depends on one direction of many, not linearly."""
    rng = np.random.default_rng(0)
    X = rng.normal(size=(400, 5)) @ rng.normal(size=(5, 5))
    w = rng.normal(size=5)
    model = SlicedInverse().fit(X, np.tanh(X @ w / np.std(X @ w)) * 10)
    assert np.corrcoef(X @ model.coef_, X @ w)[0, 1] > 0.995


def test_it_takes_the_leading_directions() -> None:
    """T-10: the slices differ most in the first direction; of many, the last ones hold nothing of the deviation."""
    X = np.random.default_rng(1).normal(size=(300, 24))
    model = SlicedInverse(directions=1).fit(X, 10 * X[:, 3] + 5 * X[:, 7])
    assert model.coef_[[3, 7]] == pytest.approx([10, 5], abs=1)
    assert np.abs(np.delete(model.coef_, [3, 7])).max() < 1
    y = 10 * X[:, 3] + 5 * X[:, 7] + 40  # about zero, if there is no constant
    through_zero = SlicedInverse(fit_intercept=False).fit(X, y)
    left = y - through_zero.predict(X)
    assert through_zero.r_squared_ == pytest.approx(1 - left @ left / (y @ y))


def test_frozen_it_says_the_same_without_constant_temperatures() -> None:
    rng = np.random.default_rng(2)
    X = np.column_stack([rng.normal(size=(60, 3)), np.full(60, 0.1)])
    for estimator in (SlicedInverse(), SlicedInverse(fit_intercept=False)):
        model = estimator.fit(X, X[:, 0] - 2 * X[:, 2] + 7).freeze(target="z_um")
        assert estimator.dependent_ == ("x3",)
        assert [i.name for i in model.inputs] == ["x0", "x1", "x2"]
        state, found = model.init(), []
        for row in X[:, :3]:
            state, deviation = model.step(state, row, 10.0)
            found.append(deviation)
        np.testing.assert_allclose(found, estimator.predict(X), rtol=0, atol=1e-10)
    assert estimator.intercept_ == 0.0


def test_few_rows_and_wrong_settings() -> None:
    X = np.random.default_rng(3).normal(size=(3, 8))
    assert np.isfinite(SlicedInverse().fit(X, X[:, 0]).predict(X)).all()
    assert SlicedInverse().fit(np.ones((9, 2)), np.arange(9.0)).predict(np.ones((1, 2))) == pytest.approx(4.0)
    for wrong in (SlicedInverse(slices=1), SlicedInverse(directions=0)):
        with pytest.raises(InputError, match="expected at least 2 and 1"):
            wrong.fit(X, X[:, 0])
