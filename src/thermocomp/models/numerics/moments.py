"""Ridge regression from moments: only sums of products of [features, 1, y] are required."""

from collections.abc import Iterable, Sequence
from functools import partial
from typing import Any

import numpy as np
from scipy.linalg import lapack

from thermocomp.core.arrays import FloatArray, IntArray


def accumulate(tables: Iterable[tuple[slice, FloatArray]], targets: FloatArray, parts: IntArray) -> FloatArray:
    """Sum the products of [features, targets] over the rows of each part.

    Parameters
    ----------
    targets : ndarray of shape (n_rows, n_targets)
    parts : ndarray of int of shape (n_rows,)
        Part of each row; -1: unused.

    Returns
    -------
    ndarray of shape (n_parts, n_features + n_targets, n_features + n_targets)
    """
    sums: Any = 0.0
    for own, features in tables:
        table = np.hstack([features, targets[own]])
        chosen = [table[parts[own] == k] for k in range(int(parts.max()) + 1)]
        sums = sums + np.array([mine.T @ mine for mine in chosen])
    return np.asarray(sums)


def part(moments: FloatArray, columns: IntArray) -> FloatArray:
    """Return the part of a moment matrix that belongs to selected features, the constant and y."""
    keep = np.append(columns, [len(moments) - 2, len(moments) - 1])
    return np.asarray(moments[np.ix_(keep, keep)])


def solve(moments: FloatArray, strengths: Sequence[float], fit_intercept: bool) -> tuple[FloatArray, FloatArray]:
    """Solve ridge regressions from their moments.

    Returns
    -------
    weights : ndarray of shape (n_features, n_strengths)
    intercepts : ndarray of shape (n_strengths,)
    """
    n = moments[-2, -2]
    gram, right = moments[:-2, :-2], moments[:-2, -1]
    means, mean_y = moments[:-2, -2] / n, moments[-2, -1] / n
    if fit_intercept:
        gram = gram - n * np.outer(means, means)
        right = right - n * means * mean_y
    scale = np.sqrt(np.maximum(np.diag(gram), 0.0) / n)
    scale[scale <= 1e-12 * max(scale.max(initial=0.0), np.finfo(np.float64).tiny)] = np.inf  # constant columns
    weights = _solve_shifted(gram / scale[:, None] / scale, right / scale, n * np.asarray(strengths)) / scale[:, None]
    intercepts = mean_y - means @ weights if fit_intercept else np.zeros(len(strengths))
    return weights, intercepts


def _solve_shifted(gram: FloatArray, right: FloatArray, shifts: FloatArray) -> FloatArray:
    """Solve (gram + shift I) x = right for each shift, (n_features, n_shifts)."""
    if len(shifts) > 1 and len(gram) > 2:
        # a tridiagonal form takes any shift at once, and a quarter of the time of the eigenvalues
        form, diagonal, beside, reflectors, _ = lapack.dsytrd(gram, lower=1)
        turn = partial(lapack.dormqr, "L", a=form[1:, :-1], tau=reflectors, lwork=64 * len(shifts))
        turned = np.append(right[:1], turn(trans="T", c=right[1:, None])[0])
        solved = [lapack.dptsv(diagonal + shift, beside, turned) for shift in shifts]
        if not any(info for *_, info in solved):  # else not positive definite by rounding
            found = np.column_stack([x for *_, x, _ in solved])
            return np.vstack([found[:1], turn(trans="N", c=found[1:])[0]])
    values, vectors = np.linalg.eigh(gram)
    damped = np.maximum(values, 0.0)[:, None] + shifts
    return np.asarray(vectors @ ((vectors.T @ right)[:, None] / damped))
