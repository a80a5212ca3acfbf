"""Sets that nearly tie, of channels that nearly coincide: the right one, or "not proven"; told in exact arithmetic."""

from fractions import Fraction
from itertools import combinations

import numpy as np
import pytest
from numpy.typing import NDArray

from thermocomp.models.selection.subsets import best_subsets

FloatArray = NDArray[np.float64]


def exact_rss(X: FloatArray, y: FloatArray, columns: tuple[int, ...], intercept: bool) -> Fraction:
    """Return the residual sum of squares of these very numbers, by Gram and Schmidt without rounding."""
    left = [[Fraction(float(v)) for v in X[:, j]] for j in columns] + [[Fraction(float(v)) for v in y]]
    if intercept:
        left = [[v - sum(a, Fraction()) / len(a) for v in a] for a in left]
    while len(left) > 1:
        q, *left = left
        length = sum(v * v for v in q)
        if length:
            shares = [sum(a * b for a, b in zip(q, c, strict=True)) / length for c in left]
            left = [[v - f * w for v, w in zip(c, q, strict=True)] for f, c in zip(shares, left, strict=True)]
    return Fraction(sum(v * v for v in left[0]))


def tie(rng: np.random.Generator, apart: float, offset: float, intercept: bool) -> tuple[FloatArray, FloatArray]:
    """Return three channels `apart` from each other, one more, and a y for which two pairs of them nearly tie."""
    a, u, v, w = rng.normal(size=(4, 14))
    a = 10 * a + offset
    X = np.column_stack([a, a + apart * u, a + apart * v, w])
    base = np.column_stack([X[:, 0], np.ones(14)] if intercept else [X[:, 0]])
    away = []
    for d in (X[:, 1] - X[:, 0], X[:, 2] - X[:, 0]):
        rest = d - base @ np.linalg.lstsq(base, d, rcond=None)[0]
        away.append(rest / np.linalg.norm(rest))
    return X, away[0] + away[1] + 10.0 ** -rng.integers(2, 12) * rng.normal(size=14)


@pytest.mark.parametrize("apart", [1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-12])
def test_never_silently_wrong(apart: float) -> None:
    rng = np.random.default_rng(5)
    proven = 0
    for k in range(12):
        intercept = bool(k % 2)
        X, y = tie(rng, apart, 293.0 if k % 3 == 0 else 0.0, intercept)
        for found in best_subsets(X, y, intercept=intercept, max_size=3).best:
            proven += found.proven
            if found.proven:
                sets = combinations(range(4), len(found.columns))
                assert found.columns == min(sets, key=lambda c: exact_rss(X, y, c, intercept))
    assert proven > 0  # the single ones, at least, can be told apart


def test_a_copy_to_the_last_bit_costs_no_proof() -> None:
    rng = np.random.default_rng(0)
    X = rng.normal(size=(30, 3)) + 20
    y = X @ [1.0, -2.0, 0.0] + 0.1 * rng.normal(size=30)
    found = best_subsets(np.column_stack([X, X[:, 1]]), y)
    assert found.left_out == (3,)
    assert found.proven
    other = best_subsets(np.column_stack([X, 1.8 * X[:, 1] + 32]), y)  # the same sensor in degF
    assert other.left_out == (3,)
    assert not other.proven
    assert [s.columns for s in other.best] == [s.columns for s in found.best]
