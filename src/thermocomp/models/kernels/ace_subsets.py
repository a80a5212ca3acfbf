"""ACE of many subsets of the same variables, computed eight at a time in SIMD lanes; see `kernels.ace`."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.models.kernels.ace import MOMENTUM, VANISHES
from thermocomp.models.kernels.lanes import LANES, add, load, multiply, splat, store, subtract
from thermocomp.models.kernels.ranks import RankArray, Smoothing, compiled, dot, running_sums, smooth

State = tuple[FloatArray, FloatArray, FloatArray, FloatArray]  # phi, phi before, sum of phi, lanes that use a variable
Work = tuple[FloatArray, FloatArray, FloatArray, FloatArray]  # residual, running sums twice, new phi

# rows of `result`: sum of squared changes (before: scale of theta), residual^2, sum^2 and theta * sum; what is kept
_MOVE, _ERROR, _NORM, _CROSS, _MOMENTUM, _BEFORE = range(6)


@compiled
def _lane_boxcar(sums: FloatArray, half: int, bounds: RankArray, groups: Any, out: FloatArray) -> Any:
    """Apply `boxcar` of `thermocomp.models.kernels.ranks` in all lanes; return the mean, which is not subtracted."""
    n = len(out)
    mean = splat(0.0)
    for i in range(min(half, n)):
        top = min(i + half + 1, n)
        value = multiply(load(sums, top), splat(1.0 / top))
        store(out, i, value)
        mean = add(mean, value)
    share = splat(1.0 / (2 * half + 1))
    for i in range(half, n - half):
        value = multiply(subtract(load(sums, i + half + 1), load(sums, i - half)), share)
        store(out, i, value)
        mean = add(mean, value)
    whole = load(sums, n)
    for i in range(max(half, n - half), n):
        value = multiply(subtract(whole, load(sums, i - half)), splat(1.0 / (n - i + half)))
        store(out, i, value)
        mean = add(mean, value)
    _lane_level(bounds, groups, out)
    return multiply(mean, splat(1.0 / n))


@compiled
def _lane_level(bounds: RankArray, groups: Any, out: FloatArray) -> None:
    """Replace the values of tied ranks by their mean."""
    n = len(out)
    if groups < n:
        for g in range(groups):
            first, last = bounds[g], bounds[g + 1]
            if last - first > 1:
                tied = splat(0.0)
                for i in range(first, last):
                    tied = add(tied, load(out, i))
                tied = multiply(tied, splat(1.0 / (last - first)))
                for i in range(first, last):
                    store(out, i, tied)


@compiled
def _lane_margins(sums: FloatArray, half: int) -> None:
    """Extend running sums by their `half` spare rows at either end, as if the underlying values were mirrored."""
    top = len(sums) - 1 - half
    zero = splat(0.0)
    whole = add(load(sums, top), load(sums, top))
    for k in range(1, half + 1):
        store(sums, half - k, subtract(zero, load(sums, half + k)))
        store(sums, top + k, subtract(whole, load(sums, top - k)))


@compiled
def _lane_twice(sums: FloatArray, again: FloatArray, half: int, bounds: RankArray, groups: Any) -> Any:
    """Run the first half of `triangle`: level, smooth once, and write the running sums of the result to `again`.

    Return the mean, which mirrored boxcars preserve.
    """
    n = len(sums) - 1 - 2 * half
    if groups < n:
        for g in range(groups):
            first, last = bounds[g] + half, bounds[g + 1] + half
            if last - first > 1:
                low = load(sums, first)
                step = multiply(subtract(load(sums, last), low), splat(1.0 / (last - first)))
                for i in range(first + 1, last):
                    store(sums, i, add(low, multiply(step, splat(1.0 * (i - first)))))
    _lane_margins(sums, half)
    share, running = splat(1.0 / (2 * half + 1)), splat(0.0)
    store(again, half, running)
    for i in range(n):
        running = add(running, multiply(subtract(load(sums, i + 2 * half + 1), load(sums, i)), share))
        store(again, i + half + 1, running)
    _lane_margins(again, half)
    return multiply(running, splat(1.0 / n))


@compiled
def _lane_smooth(work: Work, how: Smoothing, j: int, out: FloatArray) -> Any:
    """Apply `smooth` in all lanes without subtracting the mean; return the mean."""
    _, sums, again, _ = work
    half, twice, bounds, groups = how[0], how[1], how[3][j], how[4][j]
    if not twice:
        return _lane_boxcar(sums, half, bounds, groups, out)
    h = (half + 1) // 2
    mean, share = _lane_twice(sums, again, h, bounds, groups), splat(1.0 / (2 * h + 1))
    for i in range(len(out)):
        store(out, i, multiply(subtract(load(again, i + 2 * h + 1), load(again, i)), share))
    _lane_level(bounds, groups, out)
    return mean


@compiled
def _lane_theta(
    total: FloatArray, last_total: FloatArray, how: Smoothing, theta: FloatArray, work: Work, result: FloatArray
) -> None:
    """Compute theta, normalised, from the (extrapolated) sum of phi; row `_MOVE` of `result` is 0 where theta is 0."""
    residual, sums, _, _ = work
    n = len(theta)
    spare = (len(sums) - 1 - n) // 2
    store(sums, spare, splat(0.0))
    share, running = load(result, _MOMENTUM), splat(0.0)
    for i in range(n):
        new = load(total, i)
        ahead = add(new, multiply(share, subtract(new, load(last_total, i))))
        store(last_total, i, new)
        store(total, i, ahead)
        running = add(running, ahead)
        store(sums, i + 1 + spare, running)
    mean, square = _lane_smooth(work, how, len(how[2]) - 1, theta), splat(0.0)
    for i in range(n):
        value = subtract(load(theta, i), mean)
        store(theta, i, value)
        square = add(square, multiply(value, value))
    store(result, _MOVE, square)
    for v in range(LANES):
        root = np.sqrt(result[_MOVE, v] / n)
        result[_MOVE, v] = 1.0 / root if root > VANISHES else 0.0
    scale = load(result, _MOVE)
    for i in range(n):
        value = multiply(load(theta, i), scale)
        store(theta, i, value)
        store(residual, i, subtract(value, load(total, i)))


@compiled
def _lane_settle(phi: FloatArray, i: int, residual: FloatArray, at: Any, new: Any) -> Any:
    """Store a new value of phi and subtract its step from the residual; return the square of the step."""
    step = subtract(new, load(phi, i))
    store(phi, i, new)
    store(residual, at, subtract(load(residual, at), step))
    return multiply(step, step)


@compiled
def _lane_phi(j: int, how: Smoothing, state: State, work: Work, result: FloatArray) -> Any:
    """Back-fit one phi in the lanes that use it; return the square of its change."""
    half, accelerate, index, bounds, groups = how[0], how[1], how[2][j], how[3][j], how[4][j]
    residual, sums, again, smoothed = work
    phi, last = state[0][j], state[1][j]
    n = len(phi)
    spare = (len(sums) - 1 - n) // 2
    store(sums, spare, splat(0.0))
    share, running = load(result, _MOMENTUM), splat(0.0)
    if accelerate:
        for i in range(n):
            new = load(phi, i)
            ahead = add(new, multiply(share, subtract(new, load(last, i))))
            store(last, i, new)
            store(phi, i, ahead)
            running = add(running, add(load(residual, index[i]), ahead))
            store(sums, i + 1 + spare, running)
    else:
        for i in range(n):
            running = add(running, add(load(residual, index[i]), load(phi, i)))
            store(sums, i + 1 + spare, running)
    mine, square = load(state[3], j), splat(0.0)
    if accelerate and groups == n:  # same as below, in a single pass
        h = (half + 1) // 2
        mean, width = _lane_twice(sums, again, h, bounds, groups), splat(1.0 / (2 * h + 1))
        for i in range(n):
            value = multiply(subtract(load(again, i + 2 * h + 1), load(again, i)), width)
            square = add(square, _lane_settle(phi, i, residual, index[i], multiply(subtract(value, mean), mine)))
        return square
    mean = _lane_smooth(work, how, j, smoothed)
    for i in range(n):
        new = multiply(subtract(load(smoothed, i), mean), mine)
        square = add(square, _lane_settle(phi, i, residual, index[i], new))
    return square


@compiled
def _lane_sums(theta: FloatArray, residual: FloatArray, total: FloatArray, result: FloatArray) -> None:
    """Update the sum of phi; write the sums of residual^2, sum^2 and theta * sum to `result`."""
    error = norm = cross = splat(0.0)
    for i in range(len(theta)):
        left, ours = load(residual, i), load(theta, i)
        fitted = subtract(ours, left)
        store(total, i, fitted)
        error = add(error, multiply(left, left))
        norm = add(norm, multiply(fitted, fitted))
        cross = add(cross, multiply(fitted, ours))
    store(result, _ERROR, error)
    store(result, _NORM, norm)
    store(result, _CROSS, cross)


@compiled
def _take(v: int, subset: BoolArray, first: FloatArray, how: Smoothing, state: State) -> bool:
    """Start a subset in lane `v`; return False if E[S|T] vanishes for all its variables."""
    _, accelerate, order, _, groups = how
    phi, last, total, on = state
    p, n, _ = phi.shape
    begun = False
    for j in range(p):
        if on[j, v] > 0:
            for i in range(n):
                phi[j, i, v] = 0.0
            if accelerate:
                for i in range(n):
                    last[j, i, v] = 0.0
        on[j, v] = 1.0 if subset[j] and groups[j] > 1 else 0.0
        if on[j, v] > 0 and not begun and dot(first[j], first[j]) > n * VANISHES**2:
            begun = True
            for i in range(n):
                phi[j, i, v] = first[j, i]
                total[order[j, i], v] = first[j, i]
    return begun


@compiled
def _first_phi(how: Smoothing, start: FloatArray) -> FloatArray:
    """Return E[S|T] of each variable, (p, n); 0 for a constant variable."""
    order, groups = how[2], how[4]
    p, n = len(order) - 1, len(start)
    first = np.zeros((p, n))
    sums, zero = np.empty(n + 1), np.zeros(n)
    for j in range(p):
        if groups[j] > 1:
            running_sums(start, zero, order[j], sums)
            smooth(sums, how, j, first[j])
    return first


@compiled
def _note_used(on: FloatArray, idle: BoolArray, used: BoolArray) -> None:
    """Mark in `used` the variables that any active lane needs."""
    for j in range(len(used)):
        used[j] = False
        for v in range(LANES):
            used[j] |= on[j, v] > 0 and not idle[v]


@compiled
def _ended(
    v: int, n: int, sweep: int, result: FloatArray, age: NDArray[np.int64], accelerate: bool, tolerance: float
) -> bool:
    """Update the momentum of lane `v` after a sweep; return whether its subset is finished."""
    now = np.sqrt(result[_MOVE, v] / n) if accelerate else result[_ERROR, v] / n
    before = result[_BEFORE, v]
    if accelerate:
        age[v] = 0 if sweep == 1 or now > before else age[v] + 1
        result[_MOMENTUM, v] = min(MOMENTUM, age[v] / (age[v] + 3.0))
        ended = now <= tolerance
    else:
        ended = sweep > 1 and not before - now > tolerance
    result[_BEFORE, v] = now
    return bool(ended)


@compiled
def correlations(
    order: RankArray,
    bounds: RankArray,
    groups: Any,
    start: FloatArray,
    half: int,
    tolerance: float,
    max_sweeps: int,
    accelerate: bool,
    subsets: BoolArray,
) -> tuple[FloatArray, NDArray[np.int64]]:
    """Compute psi of many subsets of the variables, eight at a time.

    Parameters
    ----------
    subsets : ndarray of bool of shape (n_subsets, p)
        Consecutive subsets should share most of their variables.

    Returns
    -------
    psi : ndarray of shape (n_subsets,)
    sweeps : ndarray of int64 of shape (n_subsets,)
    """
    p, n, count = len(order) - 1, len(start), len(subsets)
    psi, sweeps = np.zeros(count), np.zeros(count, np.int64)
    how = (half, accelerate, order, bounds, groups)
    first = _first_phi(how, start)
    theta, total, residual = np.empty((n, LANES)), np.empty((n, LANES)), np.empty((n, LANES))
    last_total, smoothed = np.zeros((n, LANES)), np.empty((n, LANES))
    spare = (half + 1) // 2 if accelerate else 0
    sums, again = np.empty((n + 1 + 2 * spare, LANES)), np.empty((n + 1 + 2 * spare, LANES))
    on, used = np.zeros((p, LANES)), np.zeros(p, np.bool_)
    state = (np.zeros((p, n, LANES)), np.zeros((p, n, LANES)), total, on)
    work, result = (residual, sums, again, smoothed), np.zeros((6, LANES))
    age, holds, idle = np.empty(LANES, np.int64), np.full(LANES, -1), np.ones(LANES, np.bool_)
    queue = 0
    while True:
        for v in range(LANES):  # a finished lane starts the next subset
            while idle[v] and queue < count:
                holds[v] = queue
                result[_MOMENTUM, v] = 0.0  # the last sum is multiplied by this, then overwritten
                idle[v] = not _take(v, subsets[queue], first, how, state)
                queue += 1
        if idle.all():
            return psi, sweeps
        _note_used(on, idle, used)
        _lane_theta(total, last_total, how, theta, work, result)
        for v in range(LANES):
            if result[_MOVE, v] == 0.0 and not idle[v]:
                idle[v] = True
                psi[holds[v]] = 0.0
        move = splat(0.0)
        for j in range(p):
            if used[j]:
                move = add(move, _lane_phi(j, how, state, work, result))
        store(result, _MOVE, move)
        _lane_sums(theta, residual, total, result)
        for v in range(LANES):
            if not idle[v]:
                k = holds[v]
                sweeps[k] += 1
                square = result[_NORM, v]
                psi[k] = abs(result[_CROSS, v]) / np.sqrt(square * n) if square > 0 else 0.0
                ended = _ended(v, n, sweeps[k], result, age, accelerate, tolerance)
                idle[v] = ended or sweeps[k] == max_sweeps
