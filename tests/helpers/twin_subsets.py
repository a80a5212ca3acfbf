"""Best subset regression the slow way: every set by itself, orthogonalised in extended precision."""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def residual_sum(X: FloatArray, y: FloatArray, columns: tuple[int, ...], intercept: bool = True) -> float:
    """Return the residual sum of squares on some columns; infinite if they depend on each other."""
    basis: list[NDArray[np.longdouble]] = []
    rest = y.astype(np.longdouble)
    given = [np.ones(len(y))] if intercept else []
    for column in [*given, *(X[:, k] for k in columns)]:
        v = column.astype(np.longdouble)
        size = np.sqrt(v @ v)
        for _ in range(3):  # orthogonal to the last digit
            for q in basis:
                v = v - q * (q @ v)
        left = np.sqrt(v @ v)
        if left <= 1e-13 * size:
            return float("inf")
        basis.append(v / left)
        for _ in range(2):
            rest = rest - basis[-1] * (basis[-1] @ rest)
    return float(rest @ rest)


def every_set(
    X: FloatArray, y: FloatArray, max_size: int, intercept: bool = True
) -> list[list[tuple[float, tuple[int, ...]]]]:
    """Return all sets of each size from 1 on, with their residual sums of squares, the best first."""
    found = []
    for size in range(1, max_size + 1):
        sets = [(residual_sum(X, y, c, intercept), c) for c in combinations(range(X.shape[1]), size)]
        found.append(sorted(s for s in sets if np.isfinite(s[0])))
    return found
