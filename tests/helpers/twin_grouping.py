"""Hwang's method in plain loops, sentence by sentence from the paper; slow. The oracle of test_grouping.py."""

from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def correlation(X: FloatArray) -> FloatArray:
    """Eq. 1."""
    n, p = X.shape
    Z = [[0.0] * n for _ in range(p)]
    for i in range(p):
        mean = sum(X[k, i] for k in range(n)) / n
        length = sum((X[k, i] - mean) ** 2 for k in range(n)) ** 0.5
        for k in range(n):
            Z[i][k] = (X[k, i] - mean) / length
    return np.array([[sum(Z[i][k] * Z[j][k] for k in range(n)) for j in range(p)] for i in range(p)])


def grouped(C: FloatArray, threshold: float, absolute: bool = False) -> list[list[int]]:  # noqa: PLR0912
    """Section 2.1."""

    def c(i: int, j: int) -> float:
        return float(abs(C[i, j]) if absolute else C[i, j])

    variables = list(range(len(C)))
    groups: list[list[int]] = []
    # Until all temperature variables are grouped
    while variables:
        if len(variables) == 1:  # rule: a single one is a group
            groups.append(variables)
            break
        # "starts from the two temperature variables with the smallest correlation coefficient"
        first, second = variables[0], variables[1]
        for i in variables:
            for j in variables:
                if i < j and c(i, j) < c(first, second):
                    first, second = i, j
        if c(first, second) > threshold:  # rule: all pairs are above, one group
            groups.append([first, second] + [k for k in variables if k not in (first, second)])
            break
        one, two = [first], [second]
        for k in variables:
            if k in (first, second):
                continue
            # "the other variables are gathered to these two if the coefficient is greater than the boundary"
            if c(first, k) > threshold and c(second, k) > threshold:  # E-H3
                if c(second, k) > c(first, k):
                    two.append(k)
                else:
                    one.append(k)
            elif c(first, k) > threshold:
                one.append(k)
            elif c(second, k) > threshold:
                two.append(k)
        groups += [one, two]
        variables = [k for k in variables if k not in one and k not in two]
    return groups


def residual(columns: list[FloatArray], y: FloatArray, constant: bool) -> FloatArray:
    """What least squares leaves of y."""
    design = [np.ones(len(y))] * constant + columns
    if not design:
        return y
    A = np.column_stack(design)
    left: FloatArray = y - A @ np.linalg.lstsq(A, y, rcond=1e-13)[0]
    return left


def represented(X: FloatArray, y: FloatArray, groups: list[list[int]], intercept: bool) -> list[int]:
    """Eq. 2, the constant in its first line only."""
    found: list[int] = []
    rest = y
    while len(found) < len(groups):
        outcomes = []
        for members in groups:
            if not set(members) & set(found):
                for k in members:
                    left = residual([X[:, k]], rest, constant=intercept and not found)
                    outcomes.append((float(left @ left), k, left))
        _, best, rest = min(outcomes, key=lambda o: (o[0], o[1]))
        found.append(best)
    return found


def mse(X: FloatArray, y: FloatArray, columns: tuple[int, ...], intercept: bool) -> float:
    """Eq. 4."""
    left = residual([X[:, k] for k in columns], y, intercept)
    return float(left @ left) / (len(y) - len(columns) - intercept)


def curve(X: FloatArray, y: FloatArray, candidates: list[int], intercept: bool) -> list[tuple[float, tuple[int, ...]]]:
    """Fig. 4: the smallest MSE_p of each number of variables, and the variables."""
    found = []
    for p in range(1, len(candidates) + 1):
        if len(y) - p - intercept > 0:
            found.append(min((mse(X, y, s, intercept), s) for s in combinations(candidates, p)))
    return found


def optimum(
    X: FloatArray, y: FloatArray, groups: list[list[int]], taking_part: tuple[int, ...], intercept: bool
) -> tuple[float, tuple[int, ...]]:
    """Section 2.4: all k x l x ... x m combinations; `taking_part` are representatives."""
    members = [g for g in groups if set(g) & set(taking_part)]
    return min((mse(X, y, s, intercept), s) for s in product(*members))
