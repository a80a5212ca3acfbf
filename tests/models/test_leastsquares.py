"""Least squares: NIST's certified digits, the rule for dependent columns, effective sample size."""

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from thermocomp.models.numerics.leastsquares import effective_sample_size, join_columns, lstsq, solve, triangle
from thermocomp.models.ols import LeastSquares

FloatArray = NDArray[np.float64]

# correct digits that must be reached; the certified numbers have 15
DIGITS = {
    "Norris": 11.5,
    "Pontius": 12.5,
    "NoInt1": 14,
    "NoInt2": 14,
    "Longley": 12.5,
    "Wampler1": 9,
    "Wampler2": 12,
    "Wampler3": 9,
    "Wampler4": 7.5,
    "Wampler5": 5.5,
    "Filip": 7.5,
}


def read_nist(file: Path) -> tuple[FloatArray, float, FloatArray, FloatArray]:
    """Return the certified parameters and residual standard deviation, X with its powers, and y."""
    text = file.read_text()
    lines = text.splitlines()
    first, last = (int(k) for k in re.findall(r"Data\s+\(lines (\d+) to (\d+)\)", text)[0])
    certified = np.array([float(v) for v in re.findall(r"^\s+B\d+\s+(\S+)\s+\S+\s*$", text, re.MULTILINE)])
    sd = float(re.findall(r"Standard Deviation\s+(\S+)\s*$", text, re.MULTILINE)[-1])
    data = np.array([[float(v) for v in line.split()] for line in lines[first - 1 : last]])
    y, x = data[:, 0], data[:, 1:]
    degree = len(certified) - 1
    if x.shape[1] == 1 and degree > 0:
        x = x ** np.arange(1, degree + 1)
    return certified, sd, x, y


@pytest.mark.parametrize("name", DIGITS)
def test_nist_certified_digits(shared_data: Path, name: str) -> None:
    certified, sd, X, y = read_nist(shared_data / "nist_strd" / f"{name}.dat")
    intercept = X.shape[1] < len(certified)
    found = lstsq(X, y, intercept=intercept)
    parameters = np.r_[found.intercept, found.coefficients] if intercept else found.coefficients
    assert found.dependent == ()
    assert found.rank == X.shape[1]
    digits = -np.log10(np.maximum(np.abs(parameters - certified) / np.abs(certified), 1e-15))
    assert digits.min() >= DIGITS[name]
    spread = np.sqrt(found.rss / (len(y) - len(certified)))
    assert spread == pytest.approx(sd, rel=1e-7, abs=1e-9)


def test_filip_is_hard_but_not_called_deficient(shared_data: Path) -> None:
    _, _, X, y = read_nist(shared_data / "nist_strd" / "Filip.dat")
    assert 1e9 < lstsq(X, y).condition < 1e11
    model = LeastSquares().fit(X, y)
    assert model.dependent_ == ()
    assert model.r_squared_ == pytest.approx(0.996727416185620, abs=1e-9)


def test_columns_of_a_wider_table(shared_data: Path) -> None:
    _, _, X, y = read_nist(shared_data / "nist_strd" / "Longley.dat")
    whole = triangle(join_columns(X, y), intercept=True)
    part = solve(X, y, whole, columns=[4, 0, 2])
    alone = lstsq(X[:, [4, 0, 2]], y)
    np.testing.assert_allclose(part.coefficients, alone.coefficients, rtol=1e-9)
    assert part.intercept == pytest.approx(alone.intercept, rel=1e-10)
    assert part.rss == pytest.approx(alone.rss, rel=1e-12)


@given(st.integers(0, 10_000), st.integers(1, 6), st.booleans(), st.floats(-1e4, 1e4))
@settings(max_examples=60, deadline=None)
def test_agrees_with_numpy(seed: int, n_columns: int, intercept: bool, offset: float) -> None:
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(n_columns + 5, n_columns)) + offset
    y = rng.normal(size=len(X)) + offset
    found = lstsq(X, y, intercept=intercept)
    design = np.column_stack([np.ones(len(X)), X]) if intercept else X
    expected = np.linalg.lstsq(design, y)[0]
    fitted = X @ found.coefficients + found.intercept
    np.testing.assert_allclose(fitted, design @ expected, rtol=1e-7, atol=1e-7)
    np.testing.assert_allclose(found.residual, y - fitted, rtol=0, atol=1e-10 * (1 + abs(offset)))
    assert found.rss == pytest.approx(found.residual @ found.residual)
    # orthogonal to all that was fitted
    assert np.abs(design.T @ found.residual).max() <= 1e-9 * (1 + abs(offset)) ** 2


def test_dependent_columns_get_zero_and_are_told() -> None:
    rng = np.random.default_rng(3)
    a, b = rng.normal(size=(2, 40)) + 20
    X = np.column_stack([a, np.full(40, 0.1), b, a, a - b])
    y = 3 * a - 2 * b + 7
    found = lstsq(X, y)
    assert found.rank == 2
    assert 1 in found.dependent
    assert len(found.dependent) == 3
    assert (found.coefficients[list(found.dependent)] == 0).all()
    np.testing.assert_allclose(X @ found.coefficients + found.intercept, y, rtol=1e-12)
    model = LeastSquares().fit(X, y)
    assert model.dependent_ == tuple(f"x{i}" for i in found.dependent)


def test_a_constant_column_is_used_without_intercept() -> None:
    x = np.arange(10.0)
    found = lstsq(np.column_stack([np.full(10, 0.1), x]), 2 * x + 1, intercept=False)
    np.testing.assert_allclose(found.coefficients, [10, 2], rtol=1e-13)


def test_nearly_dependent_is_not_dependent() -> None:
    # the difference of two sensors of 20 degC that agree to 1e-6 K is still information
    rng = np.random.default_rng(4)
    a = 20 + rng.normal(size=200)
    b = a + 1e-6 * rng.normal(size=200)
    found = lstsq(np.column_stack([a, b]), 5 * a + 1000 * (b - a))
    assert found.dependent == ()
    np.testing.assert_allclose(found.coefficients, [-995, 1000], rtol=1e-6)


def test_more_columns_than_rows_and_no_columns() -> None:
    rng = np.random.default_rng(5)
    X, y = rng.normal(size=(6, 20)), rng.normal(size=6)
    found = lstsq(X, y)
    assert found.rank == 5
    np.testing.assert_allclose(X @ found.coefficients + found.intercept, y, atol=1e-12)
    empty = lstsq(np.empty((6, 0)), y)
    assert empty.intercept == pytest.approx(y.mean())
    assert empty.condition == 1.0
    zeros = lstsq(np.zeros((6, 2)), y, intercept=False)
    assert zeros.dependent == (0, 1)
    assert zeros.rss == pytest.approx(y @ y)


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9, 0.98])
def test_effective_sample_size_of_a_first_order_process(rho: float) -> None:
    # E-C12: for AR(1) it is n (1 - rho) / (1 + rho)
    n = 40_000
    rng = np.random.default_rng(6)
    noise = rng.normal(size=n)
    series = np.empty(n)
    series[0] = noise[0]
    for k in range(1, n):
        series[k] = rho * series[k - 1] + noise[k]
    assert effective_sample_size(series) == pytest.approx(n * (1 - rho) / (1 + rho), rel=0.25)


def test_effective_sample_size_at_the_ends() -> None:
    assert effective_sample_size(np.full(12, 3.0)) == 12
    assert effective_sample_size(np.array([1.0, -1.0] * 20)) == 40
    assert 1 <= effective_sample_size(np.linspace(0, 1, 50)) < 5
