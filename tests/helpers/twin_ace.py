"""ACE of Wessel 2004, Appendix A, in plain numpy: literal and slow, the oracle of the compiled kernel."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

VANISHES = 1e-9


class Transforms(NamedTuple):
    theta: FloatArray  # (n_rows,)
    phi: FloatArray  # (n_variables, n_rows)
    psi: float
    errors: list[float]  # E[(theta - sum phi)^2] after each sweep


def expectation(y: FloatArray, x: FloatArray, half: int) -> FloatArray:
    """E[y|x]: boxcar of 2 half + 1 ranks, cut at the ends, averaged over ties, of zero mean."""
    index = np.argsort(x, kind="stable")
    ranked = y[index]
    smooth = np.array([ranked[max(0, i - half) : i + half + 1].mean() for i in range(len(y))])
    out = np.empty(len(y))
    out[index] = level(smooth, x[index])
    return np.asarray(out - out.mean())


def triangle(y: FloatArray, x: FloatArray, half: int) -> FloatArray:
    """E[y|x]: averaged over ties, two boxcars of half the width, mirrored at the ends, averaged over ties again."""
    index, h, n = np.argsort(x, kind="stable"), (half + 1) // 2, len(y)
    boxcar = np.zeros((n, n))
    for i in range(n):
        for k in range(i - h, i + h + 1):
            boxcar[i, -1 - k if k < 0 else 2 * n - 1 - k if k >= n else k] += 1 / (2 * h + 1)
    ties = (x[index][:, None] == x[index]).astype(np.float64)
    ties /= ties.sum(axis=1)
    out = np.empty(n)
    out[index] = ties @ boxcar @ boxcar @ ties @ y[index]
    return np.asarray(out - out.mean())


def level(values: FloatArray, x: FloatArray) -> FloatArray:
    """Mean over ties in x."""
    return np.array([values[x == v].mean() for v in x])


def fit(
    T: FloatArray,
    S: FloatArray,
    half: int,
    tolerance: float,
    max_sweeps: int,
    *,
    twice: bool = False,
    momentum: float = 0.0,
) -> Transforms:
    """Fit theta(S) = sum of phi_j(T_j); `momentum`: at most this share of the last change is added to a sweep's."""
    n, p = T.shape
    smooth = triangle if twice else expectation
    s = (S - S.mean()) / S.std()
    phi = np.zeros((p, n))
    for j in range(p):
        start = smooth(s, T[:, j], half)
        if np.sqrt(np.mean(start**2)) > VANISHES:
            phi[j] = start
            break
    errors: list[float] = []
    theta = np.zeros(n)
    last, moved, age = np.zeros((p, n)), 0.0, 0
    for _ in range(max_sweeps):
        before = phi.copy()
        theta = smooth(phi.sum(axis=0), S, half)
        norm = np.sqrt(np.mean(theta**2))
        if norm <= VANISHES:
            return Transforms(np.zeros(n), np.zeros((p, n)), 0.0, errors)
        theta /= norm
        for j in range(p):
            others = [k for k in range(p) if k != j]
            phi[j] = smooth(theta - phi[others].sum(axis=0), T[:, j], half)
        errors.append(float(np.mean((theta - phi.sum(axis=0)) ** 2)))
        if len(errors) > 1 and not errors[-2] - errors[-1] > tolerance:
            break
        previous, moved = moved, float(np.sqrt(np.sum((phi - before) ** 2) / n))
        age = 0 if len(errors) == 1 or moved > previous else age + 1
        phi, last = phi + min(momentum, age / (age + 3)) * (phi - last), phi.copy()
    total = phi.sum(axis=0)
    psi = abs(np.mean(theta * total)) / np.sqrt(np.mean(theta**2) * np.mean(total**2))
    return Transforms(theta, phi, float(psi), errors)


def neighbours(at: FloatArray, x: Sequence[float], y: Sequence[float], k: int) -> FloatArray:
    """Mean y of the k entries whose x is nearest; of two equally near the one with the greater x."""
    table_x, table_y = np.asarray(x), np.asarray(y)
    out = np.empty(len(at))
    for i, v in enumerate(at):
        nearest = sorted(range(len(table_x)), key=lambda m: (abs(table_x[m] - v), -table_x[m]))[:k]
        out[i] = table_y[nearest].mean()
    return out
