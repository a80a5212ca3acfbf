"""ACE on ranks: compiled sweeps; see `kernels.ranks` for the data structures."""

from typing import Any

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.models.kernels.ranks import RankArray, Smoothing, compiled, dot, running_sums, smooth

Work = tuple[FloatArray, FloatArray, FloatArray]  # residual, running sums, new phi


VANISHES = 1e-9  # a function with a smaller norm (theta has norm 1) counts as zero
MOMENTUM = 0.95  # maximum momentum coefficient of the accelerated sweeps


@compiled
def _begin(how: Smoothing, start: FloatArray, phi: FloatArray, total: FloatArray, sums: FloatArray) -> None:
    """Initialise phi_j = E[S|T_j] of the first variable with a non-zero result; without one, the sweep ends it."""
    order = how[2]
    n = len(start)
    for j in range(len(phi)):
        running_sums(start, phi[j], order[j], sums)
        smooth(sums, how, j, phi[j])
        if np.sqrt(dot(phi[j], phi[j]) / n) > VANISHES:
            for i in range(n):
                total[order[j, i]] = phi[j, i]
            return
        phi[j] = 0.0


@compiled
def _sweep(how: Smoothing, theta: FloatArray, phi: FloatArray, total: FloatArray, work: Work) -> float:
    """Run one sweep: theta from the sum of phi, then each phi from theta; return E[(theta - sum)^2], or nan."""
    order = how[2]
    residual, sums, new = work
    p, n = phi.shape
    residual[:] = 0.0
    running_sums(residual, total, order[p], sums)
    smooth(sums, how, p, theta)
    norm = np.sqrt(dot(theta, theta) / n)
    if not norm > VANISHES:
        return np.nan
    for i in range(n):
        theta[i] /= norm
        residual[i] = theta[i] - total[i]
    for j in range(p):
        mine, index = phi[j], order[j]
        running_sums(residual, mine, index, sums)
        smooth(sums, how, j, new)
        for i in range(n):
            residual[index[i]] += mine[i] - new[i]
            mine[i] = new[i]
    for i in range(n):
        total[i] = theta[i] - residual[i]
    return float(dot(residual, residual) / n)


@compiled
def _correlation(x: FloatArray, y: FloatArray) -> float:
    square = dot(x, x) * dot(y, y)
    return float(abs(dot(x, y)) / np.sqrt(square)) if square > 0 else 0.0


@compiled
def _moved(phi: FloatArray, before: FloatArray, work: FloatArray) -> float:
    """Return the root of the mean square of the change over the rows, summed over all phi."""
    p, n = phi.shape
    square = 0.0
    for j in range(p):
        for i in range(n):
            work[i] = phi[j, i] - before[j, i]
        square += dot(work, work) / n
    return float(np.sqrt(square))


@compiled
def solve(
    order: RankArray,
    bounds: RankArray,
    groups: Any,
    start: FloatArray,
    half: int,
    tolerance: float,
    max_sweeps: int,
    converged: bool,
) -> tuple[FloatArray, FloatArray, float, FloatArray]:
    """Sweep until the error fails to decrease by more than `tolerance`, or to convergence.

    Returns
    -------
    theta : ndarray of shape (n,)
        In the order of the ranks of S.
    phi : ndarray of shape (p, n)
        Each phi in the order of the ranks of its variable.
    errors : ndarray of shape (n_sweeps,)
        E[(theta - sum phi)^2] after each sweep.
    """
    n = len(start)
    how = (half, converged, order, bounds, groups)
    theta, work = np.zeros(n), (np.empty(n), np.empty(bounds.shape[1]), np.empty(n))
    state = np.zeros(order.shape)  # all phi, and their sum in rank order of S
    last = np.zeros_like(state)
    phi, total = state[:-1], state[-1]
    before = np.empty_like(phi)
    errors = np.empty(max_sweeps)
    sweeps = age = 0
    moved = 0.0
    _begin(how, start, phi, total, work[1])
    while True:
        if converged:
            before[:] = phi
        error = _sweep(how, theta, phi, total, work)
        if np.isnan(error):
            theta[:] = 0.0
            state[:] = 0.0
            return theta, phi, 0.0, errors[:sweeps]
        errors[sweeps] = error
        sweeps += 1
        previous = moved
        if converged:
            moved = _moved(phi, before, work[2])
            ended = moved <= tolerance
        else:
            ended = sweeps > 1 and not errors[sweeps - 2] - error > tolerance
        if ended or sweeps == max_sweeps:
            return theta, phi, _correlation(theta, total), errors[:sweeps]
        if converged:
            age = 0 if sweeps == 1 or moved > previous else age + 1
            momentum = min(MOMENTUM, age / (age + 3.0))
            for j in range(len(state)):
                for i in range(n):
                    new = state[j, i]
                    state[j, i] = new + momentum * (new - last[j, i])
                    last[j, i] = new
