"""The free run of an autoregressive model, literally: one test, one loop over the ticks, integrals by their definition.

Slow and plain: the oracle for `thermocomp.core.autoregressive` and `thermocomp.models.numerics.freerun`. And the series
with known orders that the tests of the estimators share.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
#: from past deviations (newest first, as many as there are) and inputs (now first) to the next deviation
Tick = Callable[[list[float], list[FloatArray]], float]


def mean_input(time: FloatArray, inputs: FloatArray, start: float, end: float) -> FloatArray:
    """Return the mean over start .. end, each reading standing for the time since the reading before it."""
    total = np.zeros(inputs.shape[1])
    for k in range(1, len(time)):
        overlap = min(time[k], end) - max(time[k - 1], start)
        if overlap > 0:
            total += overlap * inputs[k]
    return total / (end - start)


def linear(a: FloatArray, b: FloatArray, intercept: float) -> Tick:
    """Return the tick of dz(t) = intercept + sum a_i dz(t-i) + sum b_i . n(t-i); b is (m + 1, n_inputs)."""

    def tick(own: list[float], driven: list[FloatArray]) -> float:
        value = intercept
        for i in range(len(a)):
            if i < len(own):
                value += a[i] * own[i]
        for i in range(len(b)):
            if i < len(driven):
                value += float(b[i] @ driven[i])
        return value

    return tick


def free_run(time: FloatArray, inputs: FloatArray, interval: float, tick: Tick) -> FloatArray:
    """Return the deviation at every reading of one test, from a cold start at the first one."""
    out = np.zeros(len(time))
    own, driven = [0.0], [inputs[0]]  # newest first
    made = 0
    for k in range(1, len(time)):
        since = time[k] - time[0]
        while (made + 1) * interval <= since * (1 + 1e-12):
            start = time[0] + made * interval
            driven.insert(0, mean_input(time[: k + 1], inputs, start, start + interval))
            own.insert(0, tick(own, driven))
            made += 1
        rest = since - made * interval
        out[k] = own[0]
        if rest > 1e-9 * interval:
            so_far = mean_input(time[: k + 1], inputs, time[0] + made * interval, time[k])
            out[k] += rest / interval * (tick(own, [so_far, *driven]) - own[0])
    return out


SYSTEMS: dict[tuple[int, int], tuple[FloatArray, FloatArray]] = {
    (1, 0): (np.array([0.9]), np.array([[0.002]])),
    (2, 1): (np.array([1.5, -0.56]), np.array([[0.002], [-0.0015]])),
    (3, 2): (np.array([1.9, -1.16, 0.224]), np.array([[0.003], [-0.004], [0.0025]])),
}


def series(order: tuple[int, int], seed: int, n: int = 800, equation: float = 0.02) -> tuple[FloatArray, FloatArray]:
    """Speed in steps, and the displacement of a system with known orders; noise in the equation, as for FPE."""
    a, b = SYSTEMS[order]
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(0, 5000, n // 5 + 1), 5)[:n, None] + rng.normal(0, 50, (n, 1))
    z = np.zeros(n)
    for t in range(1, n):
        z[t] = sum(a[i - 1] * z[t - i] for i in range(1, len(a) + 1) if t >= i)
        z[t] += sum(float(b[i] @ u[t - i]) for i in range(len(b)) if t >= i) + equation * rng.normal()
    return u, np.asarray(z)


def clock(n: int, interval: float = 600.0) -> FloatArray:
    """Return the time steps of one test."""
    return np.asarray(np.r_[np.inf, np.full(n - 1, interval)])
