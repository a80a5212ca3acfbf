"""Least-squares fit of one or two exponentials to a settling curve."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.optimize import least_squares

from thermocomp.core.arrays import FloatArray
from thermocomp.models.numerics.leastsquares import effective_sample_size


@dataclass(frozen=True)
class Exponential:
    """One term of a fit: ``amplitude (1 - exp(-t / tau))``.

    Parameters
    ----------
    amplitude, tau : float
        [unit of the channel], [s].
    amplitude_error, tau_error : float
        Standard errors of amplitude and time constant.
    """

    amplitude: float
    tau: float
    amplitude_error: float
    tau_error: float


@dataclass(frozen=True)
class ExponentialFit:
    """A curve of one or two exponentials.

    Parameters
    ----------
    start : float
        Value at the start [unit].
    terms : tuple of Exponential
        The faster one first.
    rms : float
        RMS of the residual [unit].
    duration : float
        Duration of the fitted data [s].
    """

    start: float
    terms: tuple[Exponential, ...]
    r_squared: float
    rms: float
    duration: float

    def __call__(self, t: FloatArray) -> FloatArray:
        """Return the curve at times since the start [s]."""
        return np.asarray(self.start + sum(e.amplitude * -np.expm1(-t / e.tau) for e in self.terms))

    @property
    def final(self) -> float:
        """Final value that the curve approaches [unit]."""
        return self.start + sum(e.amplitude for e in self.terms)

    @property
    def reliable(self) -> bool:
        """True if no time constant exceeds the duration, and no standard error exceeds half its time constant."""
        return all(e.tau <= self.duration and e.tau_error <= 0.5 * e.tau for e in self.terms)


def fit(t: FloatArray, y: FloatArray) -> tuple[ExponentialFit | None, ExponentialFit | None]:
    """Fit one and two exponentials by least squares.

    Time constants are sought between the shortest interval and ten times the duration; the amplitudes are linear and
    follow from them, so that the search has one or two unknowns only and is robust. Standard errors are based on the
    effective sample size of the residual, given its autocorrelation: neighbouring rows of a drift are almost equal.

    Parameters
    ----------
    t : ndarray of shape (n_rows,)
        Time since the start, in ascending order [s].
    y : ndarray of shape (n_rows,)

    Returns
    -------
    two : ExponentialFit or None
        None if the second exponential is not justified: it does not lower the BIC, or the two time constants differ by
        less than a factor of two, or an amplitude is below twice its standard error.
    """
    bounds = (float(np.log(np.diff(t).min())), float(np.log(10.0 * t[-1])))
    grid = np.linspace(*bounds, 16)
    one = _least_squares(t, y, [(g,) for g in grid], bounds)
    if one is None or one.r_squared > 1.0 - 1e-12:
        return one, None
    two = _least_squares(t, y, list(combinations(grid[::2], 2)), bounds)
    if two is None:
        return one, None
    fast, slow = two.terms
    n = effective_sample_size(y - two(t))
    called_for = n * 2.0 * np.log(one.rms / max(two.rms, 1e-300)) > 2.0 * np.log(n)
    apart = slow.tau > 2.0 * fast.tau
    sure = all(abs(e.amplitude) > 2.0 * e.amplitude_error for e in two.terms)
    return one, two if called_for and apart and sure else None


def _least_squares(
    t: FloatArray, y: FloatArray, starts: list[tuple[float, ...]], bounds: tuple[float, float]
) -> ExponentialFit | None:
    """Fit exponentials; each of `starts` holds the logarithm of one time constant per exponential."""
    k = len(starts[0])
    if len(y) < 2 * k + 3:
        return None
    residual = _residual(t, y)
    best = min(starts, key=lambda s: float(np.sum(residual(np.array(s)) ** 2)))
    low, high = bounds
    found = least_squares(
        residual, np.clip(best, low + 1e-9, high - 1e-9), bounds=bounds, x_scale=1.0, xtol=1e-13, ftol=1e-13, gtol=None
    )
    tau = np.exp(np.sort(found.x))
    decay = np.exp(-t[:, None] / tau)
    design = np.column_stack([np.ones(len(t)), 1.0 - decay])
    level, *amplitudes = np.linalg.lstsq(design, y, rcond=None)[0]
    left = y - design @ [level, *amplitudes]
    # correlated rows: the sum of squares is divided by the effective degrees of freedom
    variance = float(left @ left) / max(effective_sample_size(left) - 2 * k - 1, 1.0)
    jacobian = np.column_stack([design, -np.array(amplitudes) * decay * t[:, None] / tau**2])
    size = np.linalg.norm(jacobian, axis=0)
    errors = np.full(2 * k + 1, np.inf)
    if (size > 0).all() and np.linalg.cond(jacobian / size) < 1e10:
        scaled = jacobian / size
        errors = np.sqrt(np.diag(np.linalg.inv(scaled.T @ scaled)) * variance) / size
    terms = (
        Exponential(float(a), float(tau[j]), float(errors[1 + j]), float(errors[1 + k + j]))
        for j, a in enumerate(amplitudes)
    )
    total = float(np.sum((y - y.mean()) ** 2))
    share = 1.0 - float(left @ left) / total if total > 0 else float("nan")
    return ExponentialFit(
        start=float(level),
        terms=tuple(terms),
        r_squared=share,
        rms=float(np.sqrt(np.mean(left**2))),
        duration=float(t[-1]),
    )


def _residual(t: FloatArray, y: FloatArray) -> Callable[[FloatArray], FloatArray]:
    def residual(log_tau: FloatArray) -> FloatArray:
        design = np.column_stack([np.ones(len(t)), -np.expm1(-t[:, None] / np.exp(log_tau))])
        return np.asarray(y - design @ np.linalg.lstsq(design, y, rcond=None)[0])

    return residual
