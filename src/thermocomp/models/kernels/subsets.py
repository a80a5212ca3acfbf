"""Common part of both searches for best subsets, compiled: the lists of good sets, and QR.

They work on the triangular factor of the columns (scaled to norm 1) and y. The lists are a tuple of, for each size:
residual sums of squares in ascending order; the corresponding sets; the smallest sum dropped from the list; the limit
below which a set is of interest; the greatest limit of this or any larger size; the required number of sets; and, last,
the margin of `thermocomp.models.selection.subsetsearch.Problem`.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from thermocomp.core.arrays import FloatArray

IntArray = NDArray[np.int64]
ByteArray = NDArray[np.uint8]
Lists = tuple[FloatArray, ByteArray, FloatArray, FloatArray, FloatArray, IntArray, FloatArray]

# "contract": products and sums may be fused, with one rounding instead of two
compiled: Any = njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})


@compiled
def offer(lists: Lists, size: int, value: float, inside: ByteArray, a: int, b: int) -> None:
    """Add the set `inside` without `a` and `b` to the list of its size; update the limits."""
    values, sets, lost, limit, bound, wanted, margin = lists
    last = values.shape[1] - 1
    if values[size, last] < np.inf:
        lost[size] = min(lost[size], max(value, values[size, last]))
    if value >= values[size, last]:
        return
    k = last
    while k > 0 and values[size, k - 1] > value:
        values[size, k] = values[size, k - 1]
        sets[size, k] = sets[size, k - 1]
        k -= 1
    values[size, k] = value
    sets[size, k] = inside
    if a >= 0:
        sets[size, k, a] = 0
    if b >= 0:
        sets[size, k, b] = 0
    worst = values[size, wanted[size] - 1]
    if worst < np.inf:
        root = np.sqrt(worst) + 2 * (margin[0] + margin[1] * np.sqrt(max(worst - margin[2], 0.0)))
        new = min(root * root, worst * (1 + margin[3]))
        if new < limit[size]:
            limit[size] = new
            most = -np.inf
            for s in range(len(limit) - 1, 0, -1):
                most = max(most, limit[s])
                bound[s] = most


@compiled
def householder(columns: FloatArray, n: int) -> None:
    """Triangularise the first `n` columns and apply the same reflections to the others; columns are stored as rows."""
    width, rows = columns.shape
    for k in range(min(n, rows)):
        x = columns[k]
        square = 0.0
        for i in range(k, rows):
            square += x[i] * x[i]
        if square == 0.0:
            continue
        length = np.copysign(np.sqrt(square), x[k])
        x[k] += length
        for c in range(k + 1, width):
            other = columns[c]
            dot = 0.0
            for i in range(k, rows):
                dot += x[i] * other[i]
            dot /= x[k] * length
            for i in range(k, rows):
                other[i] -= dot * x[i]
        x[k] = -length
        for i in range(k + 1, rows):
            x[i] = 0.0


@compiled
def exact(columns: FloatArray, least: FloatArray, chosen: IntArray, n: int) -> float:
    """Return the residual sum of squares of the first `n` of `chosen` by QR; inf if the columns are dependent."""
    p, rows = columns.shape[0] - 1, columns.shape[1]
    some = np.empty((n + 1, rows))
    for i in range(n):
        some[i] = columns[chosen[i]]
    some[n] = columns[p]
    householder(some, n)
    for i in range(n):
        if i >= rows or abs(some[i, i]) <= least[chosen[i]]:
            return np.inf
    total = 0.0
    for i in range(n, rows):
        total += some[n, i] ** 2
    return total
