"""Ridge regression from moments: only sums of products of [features, 1, y] are required."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

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
    values, vectors = np.linalg.eigh(gram / scale[:, None] / scale)
    damped = np.maximum(values, 0.0)[:, None] + n * np.asarray(strengths)
    weights = (vectors @ ((vectors.T @ (right / scale))[:, None] / damped)) / scale[:, None]
    intercepts = mean_y - means @ weights if fit_intercept else np.zeros(len(strengths))
    return weights, intercepts
