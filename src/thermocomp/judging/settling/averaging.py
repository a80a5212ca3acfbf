"""Averages over a given time and their uncertainty: no single noisy row determines the result of a curve.

Estimation of the noise: the robust scatter of second differences between rows gives the noise that is independent from
row to row; the scatter of third differences of means over `WINDOW` gives the noise left in a mean, whatever the
correlation of neighbouring rows. The larger of the two is used. Noise with a correlation time much longer than `WINDOW`
cannot be distinguished from a drift, and counts as drift.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import median_filter
from scipy.stats import t as student

from thermocomp.core.arrays import FloatArray

#: averaging time [s]
WINDOW = 600.0
#: shorter curves are averaged over this fraction of their length, so that enough means are left for comparison
SHARE = 1.0 / 8.0
#: probability that a curve of pure noise is reported as changing
RISK = 0.01
#: coverage factor of an expanded uncertainty (GUM)
K = 2.0
#: a single row that differs from its neighbours by more than this multiple of the noise is an outlier
OUTLIER = 8.0
_MEANS = 6  # fewer means give no estimate of their scatter


@dataclass(frozen=True)
class Noise:
    """Scatter of the rows of one curve.

    Parameters
    ----------
    sigma : float
        Standard deviation from row to row [unit of the curve].
    inflation : float
        Standard error of a mean over the window, relative to that of the same number of independent rows; at least 1.
    resolution : float
        Smallest difference between two values; without noise, the standard uncertainty that it causes remains.
    window : float
        Averaging time [s].
    moves : bool
        The means of the first and the last third, or any two means, differ by more than their noise would explain
        (`RISK`; Student's t, Bonferroni over all pairs).
    """

    sigma: float
    inflation: float
    resolution: float
    window: float
    moves: bool = False

    def of_mean(self, rows: FloatArray | float) -> FloatArray:
        """Return the standard uncertainty of means over a number of rows [unit of the curve]."""
        floor = self.resolution / np.sqrt(12.0) if self.sigma == 0.0 else 0.0
        return np.asarray(np.maximum(self.inflation * self.sigma / np.sqrt(np.maximum(rows, 1.0)), floor))


@dataclass(frozen=True)
class Zero:
    """Reference state of a curve.

    Parameters
    ----------
    value, u : float
        Mean, and its standard uncertainty [unit of the curve].
    rows : int
        Number of rows.
    """

    value: float
    u: float
    rows: int


@dataclass(frozen=True, eq=False)
class AveragedCurve:
    """An averaged curve relative to its zero.

    Parameters
    ----------
    values : ndarray of shape (n_rows,)
        Averages minus the zero; 0 in the first row; nan where missing [unit of the curve].
    u : ndarray of shape (n_rows,)
        Standard uncertainty of the averages, without the contribution of the zero.
    """

    values: FloatArray
    u: FloatArray
    zero: Zero
    noise: Noise


def window_of(duration: float) -> float:
    """Return the averaging time for a curve of a given duration [s]."""
    return min(WINDOW, SHARE * duration)


def scatter(values: FloatArray) -> float:
    """Return the standard deviation from row to row, independent of the trend: robust, from second differences.

    Parameters
    ----------
    values : ndarray of shape (n_rows,)
        nan where missing.

    Returns
    -------
    float
        nan if there are fewer than three values.
    """
    known = values[np.isfinite(values)]
    if len(known) < 3:
        return float("nan")
    return float(1.4826 / np.sqrt(6.0) * np.median(np.abs(np.diff(known, 2))))


def replace_outliers(values: FloatArray) -> FloatArray:
    """Return values of a smooth curve, with single outliers replaced by values from the neighbouring rows.

    Parameters
    ----------
    values : ndarray of shape (n_rows,)
        nan where missing; such rows are ignored.

    Returns
    -------
    ndarray of shape (n_rows,)
    """
    there = np.isfinite(values)
    y = values[there]
    if len(y) < 8:
        return values
    limit = OUTLIER * scatter(y)
    # a median over five rows leaves a monotonic curve unchanged
    calm = median_filter(y, size=5, mode="nearest")
    y = np.where(np.abs(y - calm) > limit, calm, y)
    ahead = 2.0 * y[-2] - y[-3]
    y[-1] = ahead if abs(y[-1] - ahead) > limit * np.sqrt(6.0) else y[-1]
    found = values.copy()
    found[there] = y
    return found


def noise_of(time: FloatArray, values: FloatArray, stop: int | None = None) -> Noise:
    """Estimate the noise of a curve, and detect whether the curve changes by more than its noise.

    Parameters
    ----------
    time : ndarray of shape (n_rows,)
        [s]
    values : ndarray of shape (n_rows,)
        nan where missing.
    """
    there = np.isfinite(values)
    t, y = time[there], values[there]
    if len(y) < 3:
        return Noise(sigma=float("nan"), inflation=1.0, resolution=0.0, window=WINDOW)
    sigma, window = scatter(y), window_of(float(t[-1] - t[0]))
    steps = np.diff(np.unique(y))
    # rounding errors of the arithmetic are not a resolution
    steps = steps[steps > 1e-9 * max(1.0, float(np.abs(y).max()))]
    resolution = float(steps.min()) if steps.size else 0.0
    bend = len(y) if stop is None else int(there[: stop + 1].sum())
    parts = [_means(t[part], y[part], window) for part in (slice(None, bend), slice(bend, None)) if len(y[part])]
    means, rows = np.concatenate([m for m, _ in parts]), np.concatenate([n for _, n in parts])
    per_mean = float(np.median(rows))
    white, own = sigma / np.sqrt(per_mean), 0.0
    if len(means) >= _MEANS and per_mean >= 2:
        own = _scatter_of_means([m for m, _ in parts])
    noise = Noise(
        sigma=sigma,
        inflation=float(max(1.0, own / white)) if white > 0 else 1.0,
        resolution=resolution,
        window=window,
    )
    white = max(white, float(noise.of_mean(np.inf)))
    return replace(noise, moves=_moves(means, white, len(y), own))


def _means(t: FloatArray, y: FloatArray, window: float) -> tuple[FloatArray, FloatArray]:
    """Return means over consecutive windows, and the number of rows of each."""
    _, block, rows = np.unique(np.floor((t - t[0]) / window), return_inverse=True, return_counts=True)
    return np.bincount(block, y) / rows, rows.astype(np.float64)


def _scatter_of_means(parts: Sequence[FloatArray]) -> float:
    """Return the robust standard deviation of means from their third differences; 0 if there are too few.

    In long series, means at a distance are compared, because neighbouring means may still be correlated.
    """
    differences = []
    for means in parts:
        apart = max(1, len(means) // 36)
        differences += [np.diff(means[k::apart], 3) for k in range(apart)]
    found = np.abs(np.concatenate(differences))
    return float(1.4826 / np.sqrt(20.0) * np.median(found)) if len(found) >= 3 else 0.0


def _moves(means: FloatArray, white: float, rows: int, own: float) -> bool:
    """Return whether the last and first third of the means, or any two, differ by more than their standard errors."""
    third = max(1, len(means) // 3)
    rise = abs(float(means[-third:].mean() - means[:third].mean())) / np.sqrt(2.0 / third)
    span = float(np.ptp(means)) / np.sqrt(2.0)
    pairs = max(len(means) * (len(means) - 1), 2)
    for found, risk in ((rise, RISK / 4.0), (span, RISK / 2.0 / pairs)):
        # degrees of freedom of the noise: number of differences in its robust estimate
        errors = ((white, rows / 4.0), (own, len(means) / 4.0))
        if found > max(1e-9, *(u * float(student.isf(risk, max(2.0, df))) for u, df in errors)):
            return True
    return False


def zero_of(time: FloatArray, values: FloatArray, noise: Noise, *, rests: bool = True) -> Zero:
    """Return the reference state at the last given row, from the rows in the window before it.

    Parameters
    ----------
    time, values : ndarray of shape (n_rows,)
        Rows up to the one in which the test begins; nan where missing.

    Returns
    -------
    Zero
        nan if no row of the window has a value.
    """
    near = np.isfinite(values) & (time >= time[-1] - noise.window)
    t, y = time[near], values[near]
    if not len(y):
        return Zero(float("nan"), float("nan"), 0)
    if rests or len(y) < 4:
        return Zero(float(y.mean()), float(noise.of_mean(len(y))), len(y))
    value, u = _line(t, y, noise, time[-1:])
    return Zero(float(value[0]), float(u[0]), len(y))


def average_test(
    time: FloatArray, values: FloatArray, start: int, stop: int, *, rests: bool, smooth: bool = False
) -> AveragedCurve:
    """Average the curve of a test, separately before and after the drives stop, and subtract its zero.

    Parameters
    ----------
    time, values : ndarray of shape (n_rows,)
        Including the rows before the test; nan where missing.
    """
    parts = (slice(None, start + 1), slice(start + 1, stop + 1), slice(stop + 1, None))
    clean = np.concatenate([replace_outliers(values[part]) for part in parts])
    t, y = time[start:], clean[start:]
    noise = noise_of(t, y, stop - start)
    if smooth:
        zero = zero_of(-t[::-1], y[::-1], noise, rests=False)
    else:
        zero = zero_of(time[: start + 1], clean[: start + 1], noise, rests=rests)
    there = np.flatnonzero(np.isfinite(y))
    if not zero.rows and there.size:  # without a value at the start of the test, use the first value
        zero = Zero(float(y[there[0]]), float(noise.of_mean(1.0)), 1)
    run, run_u = average_curve(t[: stop - start + 1], y[: stop - start + 1], noise)
    rest, rest_u = average_curve(t[stop - start :], y[stop - start :], noise)
    means = np.concatenate([run, rest[1:]]) - zero.value
    u = np.concatenate([run_u, rest_u[1:]])
    if there.size and there[0] == 0:
        means[0], u[0] = 0.0, 0.0
    return AveragedCurve(means, u, zero, noise)


def average_curve(time: FloatArray, values: FloatArray, noise: Noise) -> tuple[FloatArray, FloatArray]:
    """Average a curve that is smooth from its first to its last row.

    The average at a row is the mean over the window around it. Towards the first row, in which the drives start or
    stop, the window narrows, so that earlier values are not mixed in; near the last row, a straight line is fitted to
    the last window.

    Parameters
    ----------
    time, values : ndarray of shape (n_rows,)
        nan where missing.

    Returns
    -------
    averaged : ndarray of shape (n_rows,)
        nan where `values` is nan.
    u : ndarray of shape (n_rows,)
        Standard uncertainty.
    """
    out, u = np.full(len(values), np.nan), np.full(len(values), np.nan)
    there = np.isfinite(values)
    if not there.any():
        return out, u
    t, y = time[there], values[there]
    half = np.minimum(0.5 * noise.window, t - t[0])
    first = np.searchsorted(t, t - half - 1e-6)
    last = np.searchsorted(t, t + half + 1e-6)
    sums = np.concatenate([[0.0], np.cumsum(y - y[0])])
    rows = (last - first).astype(np.float64)
    mean, error = y[0] + (sums[last] - sums[first]) / rows, noise.of_mean(rows)
    end = t > t[-1] - 0.5 * noise.window
    near = t >= t[-1] - noise.window - 1e-6
    if near.sum() >= 4 and not near.all():
        mean[end], error[end] = _line(t[near], y[near], noise, t[end])
    else:  # too few rows for a line: use the rows themselves
        mean[end], error[end] = y[end], noise.of_mean(1.0)
    out[there], u[there] = mean, error
    return out, u


def _line(t: FloatArray, y: FloatArray, noise: Noise, at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the values of a straight line through the given rows at other times, and their standard uncertainty."""
    centre, away = t.mean(), at - t.mean()
    spread = float(((t - centre) ** 2).sum())
    slope = float(((t - centre) * (y - y.mean())).sum() / spread)
    # converted to the number of rows of a mean with the same uncertainty
    return y.mean() + slope * away, noise.of_mean(1.0 / (1.0 / len(t) + away**2 / spread))
