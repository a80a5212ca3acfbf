"""Ranks, and conditional expectations on them: a single sort, then sliding means by running sums.

All data are in rank order. Row ``j < p`` of `order` contains, for each rank of T_j, the rank of S of the same sample;
row p contains the sample of each rank of S. `bounds` and `groups` give the first ranks of the groups of tied values of
each variable and their number.

numba does not detect changes to a function that is called from another file: delete ``__pycache__`` after an edit.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from thermocomp.core.arrays import FloatArray

RankArray = NDArray[np.uint32]
# half width of the boxcar, whether `triangle` replaces it, and `order`, `bounds` and `groups` of all variables
Smoothing = tuple[int, bool, RankArray, RankArray, NDArray[np.int64]]

compiled: Any = njit(cache=True, nogil=True)


@compiled
def _argsort(x: FloatArray, index: RankArray, keys: RankArray, bins: RankArray) -> None:
    """Sort stably into `index`: one counting pass on a linear scale, then insertion sort within the bins."""
    n = len(x)
    low = high = x[0]
    for i in range(n):
        low = min(low, x[i])
        high = max(high, x[i])
    if not low < high:
        for i in range(n):
            index[i] = i
        return
    size = len(bins) - 1
    scale = (size - 1) / (high - low)
    bins[:] = 0
    for i in range(n):
        place = (x[i] - low) * scale
        keys[i] = np.uint32(place) if place < size - 1 else np.uint32(size - 1)  # also catches nan
        bins[keys[i] + 1] += 1
    for k in range(size):
        bins[k + 1] += bins[k]
    for i in range(n):
        k = keys[i]
        index[bins[k]] = i
        bins[k] += 1
    budget = 8 * n
    for i in range(1, n):
        mine = index[i]
        value = x[mine]
        k = i
        while k > 0 and x[index[k - 1]] > value:
            index[k] = index[k - 1]
            k -= 1
        index[k] = mine
        budget -= i - k
        if budget < 0:  # outliers have squeezed most values into a few bins
            index[:] = np.argsort(x, kind="mergesort")
            return


@compiled
def rank(columns: FloatArray) -> tuple[RankArray, RankArray, NDArray[np.int64], FloatArray]:
    """Rank variables.

    Parameters
    ----------
    columns : ndarray of shape (p + 1, n), C order
        T_1 ... T_p, S.

    Returns
    -------
    order : ndarray of uint32 of shape (p + 1, n)
    bounds : ndarray of uint32 of shape (p + 1, n + 1)
        Ranks at which the groups of equal values begin; the last value is n.
    groups : ndarray of int64 of shape (p + 1,)
        Number of groups.
    start : ndarray of shape (n,)
        S in rank order, with zero mean and unit variance.
    """
    m, n = columns.shape
    order = np.empty((m, n), np.uint32)
    bounds = np.empty((m, n + 1), np.uint32)
    groups = np.empty(m, np.int64)
    keys = np.empty(n, np.uint32)
    size = 64
    while size < n and size < 8192:
        size *= 2
    bins = np.empty(size + 1, np.uint32)
    for j in range(m):
        x = columns[j]
        index = order[j]
        _argsort(x, index, keys, bins)
        count = 0
        last = np.nan
        for i in range(n):
            if x[index[i]] != last:
                last = x[index[i]]
                bounds[j, count] = i
                count += 1
        bounds[j, count] = n
        groups[j] = count
    for i in range(n):
        keys[order[m - 1, i]] = i
    for j in range(m - 1):
        for i in range(n):
            order[j, i] = keys[order[j, i]]
    start = np.empty(n)
    mean = 0.0
    for i in range(n):
        mean += columns[m - 1, i]
    mean /= n
    square = 0.0
    for i in range(n):
        start[i] = columns[m - 1, order[m - 1, i]] - mean
        square += start[i] * start[i]
    if groups[m - 1] == 1:
        start[:] = 0.0  # otherwise rounding would be mistaken for a signal
    else:
        start /= np.sqrt(square / n)
    return order, bounds, groups, start


@compiled
def running_sums(residual: FloatArray, phi: FloatArray, order: RankArray, sums: FloatArray) -> None:
    """Fill `sums` with the running sums of residual + phi in rank order, in four independent chains."""
    n = len(phi)
    m = n // 4
    a = b = c = d = 0.0
    sums[0] = 0.0
    for i in range(m):
        a += residual[order[i]] + phi[i]
        b += residual[order[i + m]] + phi[i + m]
        c += residual[order[i + 2 * m]] + phi[i + 2 * m]
        d += residual[order[i + 3 * m]] + phi[i + 3 * m]
        sums[i + 1] = a
        sums[i + m + 1] = b
        sums[i + 2 * m + 1] = c
        sums[i + 3 * m + 1] = d
    for i in range(4 * m, n):
        d += residual[order[i]] + phi[i]
        sums[i + 1] = d
    b += a
    c += b
    for i in range(m):
        sums[i + m + 1] += a
        sums[i + 2 * m + 1] += b
    for i in range(3 * m, n):
        sums[i + 1] += c


@compiled
def boxcar(sums: FloatArray, half: int, bounds: RankArray, groups: Any, out: FloatArray) -> None:
    """Compute the mean of the 2 half + 1 ranks around each rank, truncated at the ends, levelled over ties, centred."""
    n = len(out)
    for i in range(min(half, n)):
        top = min(i + half + 1, n)
        out[i] = sums[top] / top
    share = 1.0 / (2 * half + 1)
    for i in range(half, n - half):
        out[i] = (sums[i + half + 1] - sums[i - half]) * share
    for i in range(max(half, n - half), n):
        out[i] = (sums[n] - sums[i - half]) / (n - i + half)
    _level(bounds, groups, out)
    _centre(out)


@compiled
def _level(bounds: RankArray, groups: Any, out: FloatArray) -> None:
    """Replace the values of tied ranks by their mean."""
    if groups == len(out):
        return
    for g in range(groups):
        first, last = bounds[g], bounds[g + 1]
        tied = 0.0
        for i in range(first, last):
            tied += out[i]
        tied /= last - first
        for i in range(first, last):
            out[i] = tied


@compiled
def _centre(out: FloatArray) -> None:
    n = len(out)
    m = n // 4 * 4
    a = b = c = d = 0.0
    for i in range(0, m, 4):
        a += out[i]
        b += out[i + 1]
        c += out[i + 2]
        d += out[i + 3]
    for i in range(m, n):
        a += out[i]
    mean = (a + b + c + d) / n
    for i in range(n):
        out[i] -= mean


@compiled
def _mirrored(sums: FloatArray, half: int, out: FloatArray) -> None:
    """Compute the mean of the 2 half + 1 ranks around each rank, mirrored at the ends."""
    n = len(out)
    share = 1.0 / (2 * half + 1)
    for i in range(half):
        out[i] = (sums[i + half + 1] + sums[half - i]) * share
    for i in range(half, n - half):
        out[i] = (sums[i + half + 1] - sums[i - half]) * share
    for i in range(n - half, n):
        out[i] = (2 * sums[n] - sums[i - half] - sums[2 * n - i - half - 1]) * share


@compiled
def triangle(sums: FloatArray, half: int, bounds: RankArray, groups: Any, out: FloatArray) -> None:
    """Apply two boxcars of half the width, mirrored at the ends; average over ties before and after; centre.

    This operator is symmetric with eigenvalues from 0 to 1, so that sweeps converge. A boxcar has eigenvalues down to
    -0.22: with more than five variables that increase together its equations are singular, and sweeps diverge.
    """
    if groups < len(out):
        for g in range(groups):
            first, last = bounds[g], bounds[g + 1]
            step = (sums[last] - sums[first]) / (last - first)
            for i in range(first + 1, last):
                sums[i] = sums[first] + step * (i - first)
    _mirrored(sums, (half + 1) // 2, out)
    for i in range(len(out)):
        sums[i + 1] = sums[i] + out[i]
    _mirrored(sums, (half + 1) // 2, out)
    _level(bounds, groups, out)
    _centre(out)


@compiled
def smooth(sums: FloatArray, how: Smoothing, j: int, out: FloatArray) -> None:
    """Estimate E[z|x] of variable `j` in rank order from the running sums of z, which may be overwritten."""
    half, twice, _, bounds, groups = how
    if twice:
        triangle(sums, half, bounds[j], groups[j], out)
    else:
        boxcar(sums, half, bounds[j], groups[j], out)


@compiled
def dot(x: FloatArray, y: FloatArray) -> float:
    """Return the sum of x * y, computed in four independent chains."""
    n = len(x)
    m = n // 4 * 4
    a = b = c = d = 0.0
    for i in range(0, m, 4):
        a += x[i] * y[i]
        b += x[i + 1] * y[i + 1]
        c += x[i + 2] * y[i + 2]
        d += x[i + 3] * y[i + 3]
    for i in range(m, n):
        a += x[i] * y[i]
    return a + b + c + d
