"""Free run of linear autoregressive models, and the coefficients that minimise its error (output error)."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.autoregressive import find_largest_root
from thermocomp.core.ticker import companion
from thermocomp.models.numerics import ticks
from thermocomp.models.numerics.ticks import TickedRun

#: number of time constants combined in starting values, from the interval to the length of the data
N_START = 7
#: number of starting values that are optimised
FOLLOWED = 2
_STEPS = 60
_GAIN = 1e-8  # relative decrease of the squared error at which the optimisation ends


@dataclass(frozen=True, eq=False)
class Coefficients:
    """Coefficients of a linear autoregressive model.

    Parameters
    ----------
    a : ndarray of shape (k,)
    b : ndarray of shape (m + 1, n_inputs)
    """

    a: FloatArray
    b: FloatArray
    intercept: float = 0.0

    def ticked(self, run: TickedRun) -> FloatArray:
        """Return the deviation at each tick in free run from a cold start, (n_ticks + 1,)."""
        products = self.b @ run.drive.T
        driven = products[0] + self.intercept
        for i in range(1, len(self.b)):
            driven[i:] += products[i, :-i]
        driven[0] = 0.0
        return _recursion(self.a, driven) if len(self.a) else driven

    def one_step(self, regressors: FloatArray) -> FloatArray:
        """Return dz(t) for rows of [dz(t-h) .. dz(t-kh), inputs(t), .. inputs(t-mh)]."""
        value: FloatArray = regressors @ np.concatenate([self.a, self.b.ravel()]) + self.intercept
        return value

    def at_rows(self, run: TickedRun) -> FloatArray:
        """Return the deviation at each row of the test in free run from a cold start."""
        ticked = self.ticked(run)
        k, m = len(self.a), len(self.b) - 1
        return ticks.interpolate_at_rows(
            run, ticked, lambda t, now: self.one_step(ticks.regressors(ticked, run.drive, t + 1, k, m, now))
        )

    def settled(self, inputs: FloatArray) -> FloatArray:
        """Return the deviation at which the free run settles with constant inputs."""
        value: FloatArray = (inputs @ self.b.sum(axis=0) + self.intercept) / (1.0 - self.a.sum())
        return value


def _recursion(a: FloatArray, driven: FloatArray) -> FloatArray:
    from scipy.signal import lfilter  # slow to import

    found: FloatArray = lfilter([1.0], np.concatenate([[1.0], -a]), driven, axis=0)
    return found


def polynomial(poles: FloatArray) -> FloatArray:
    """Return a_1 .. a_k of the recursion with these real poles."""
    found = np.ones(1)
    for p in poles:
        found = np.append(found, 0.0) - p * np.append(0.0, found)
    return np.asarray(-found[1:])


def output_error(
    runs: Sequence[TickedRun],
    targets: Sequence[FloatArray],
    k: int,
    m: int,
    *,
    intercept: bool,
    largest_root: float,
) -> Coefficients | None:
    """Find the coefficients with the smallest squared error in free run from a cold start.

    Least squares on one-step errors is biased by the noise of the probe, which enters through the past displacements
    (E-P3); in free run only the inputs enter. All poles are real and between 0 and `largest_root`: heat flow does not
    oscillate, and a model that can oscillate fits the daily cycle of the ambient temperature. The error is not convex:
    Levenberg-Marquardt is run from the best of several starts, all combinations of k (at most 3) time constants, for
    which b is linear least squares. It first varies a_1 .. a_k freely; only if the resulting poles are not real, it
    varies the poles themselves. The poles alone are not sufficient, since two coinciding poles cannot separate again.

    Parameters
    ----------
    targets : sequence of ndarray of shape (n_ticks + 1,)
        Displacement at each tick of each run; nan where unknown.

    Returns
    -------
    Coefficients or None
        None if the number of known ticks does not exceed the number of coefficients.
    """
    bound = _Problem(runs, targets, k, m, intercept, largest_root, by_poles=True)
    if sum(int(np.isfinite(y[1:]).sum()) for y in targets) <= bound.size:
        return None
    starts = sorted(bound.starts(), key=bound.squares)[:FOLLOWED]
    free = _Problem(runs, targets, k, m, intercept, largest_root, by_poles=False)
    theta = _least(free.descend(np.concatenate([polynomial(s[:k]), s[k:]])) for s in starts)
    roots = np.linalg.eigvals(companion(theta[:k]))
    if np.isreal(roots).all() and (roots.real >= 0).all():
        return free.split(theta)
    starts.append(bound.best_for(np.clip(roots.real, 0.0, bound.most)))
    return bound.split(_least(bound.descend(s) for s in starts))


def _least(ends: Iterable[tuple[FloatArray, float]]) -> FloatArray:
    return min(ends, key=lambda end: end[1])[0]


class _Problem:
    """Squared error of the free run as a function of theta = [a or poles, b by lag, intercept]."""

    def __init__(
        self,
        runs: Sequence[TickedRun],
        targets: Sequence[FloatArray],
        k: int,
        m: int,
        intercept: bool,
        largest_root: float,
        *,
        by_poles: bool,
    ) -> None:
        self._runs, self._k, self._m = runs, k, m
        self._n_inputs = runs[0].drive.shape[1]
        self._intercept, self._largest = intercept, largest_root
        self.most = largest_root * (1 - 1e-9)
        self._by_poles = by_poles
        self._known = [np.flatnonzero(np.isfinite(y) & (np.arange(len(y)) > 0)) for y in targets]
        self._y = np.concatenate([y[known] for y, known in zip(targets, self._known, strict=True)])
        self.size = k + (m + 1) * self._n_inputs + int(intercept)

    def split(self, theta: FloatArray) -> Coefficients:
        k, until = self._k, self._k + (self._m + 1) * self._n_inputs
        constant = float(theta[-1]) if self._intercept else 0.0
        a = polynomial(theta[:k]) if self._by_poles else theta[:k].copy()
        return Coefficients(a, theta[k:until].reshape(-1, self._n_inputs).copy(), constant)

    def starts(self) -> list[FloatArray]:
        """Return theta for combinations of poles whose time constants range from the interval to the data length."""
        longest = max(len(r.drive) for r in self._runs)
        poles = np.exp(-1.0 / np.geomspace(1.0, max(longest / 3, 2.0), N_START))
        poles = poles[poles < self._largest]
        chosen = combinations(poles, min(self._k, 3, len(poles)))
        return [self.best_for(np.array([*some, *[0.0] * (self._k - len(some))])) for some in chosen]

    def best_for(self, poles: FloatArray) -> FloatArray:
        """Return theta for given poles, with the other parameters by linear least squares."""
        table = self._driven(polynomial(poles))
        scale = np.linalg.norm(table, axis=0)
        scale[scale == 0] = 1.0
        rest = np.linalg.lstsq(table / scale, self._y, rcond=1e-10)[0] / scale
        return np.concatenate([poles, rest])

    def squares(self, theta: FloatArray) -> float:
        error = self._error(theta)
        return float(error @ error)

    def _error(self, theta: FloatArray) -> FloatArray:
        c = self.split(theta)
        free = np.concatenate([c.ticked(r)[t] for r, t in zip(self._runs, self._known, strict=True)])
        return np.asarray(self._y - free)

    def _driven(self, a: FloatArray) -> FloatArray:
        """Return the derivative of the free run with respect to b and intercept at the known ticks."""
        parts = []
        for run, known in zip(self._runs, self._known, strict=True):
            later = run.drive.copy()
            later[0] = 0.0
            columns = [_recursion(a, later)]
            past = _recursion(a, run.drive)
            columns += [_shifted(past, i) for i in range(1, self._m + 1)]
            if self._intercept:
                ones = np.ones((len(later), 1))
                ones[0] = 0.0
                columns.append(_recursion(a, ones))
            parts.append(np.hstack([c[known] for c in columns]))
        return np.concatenate(parts)

    def jacobian(self, theta: FloatArray) -> FloatArray:
        """Return the derivative of the free run with respect to theta at the known ticks, (n_known, size)."""
        c = self.split(theta)
        parts = []
        for run, known in zip(self._runs, self._known, strict=True):
            past = _shifted(c.ticked(run)[:, None], 1)
            if self._by_poles:
                columns = [_recursion(theta[i : i + 1], past)[known] for i in range(self._k)]
            else:
                past = _recursion(c.a, past)
                columns = [_shifted(past, i)[known] for i in range(self._k)]
            parts.append(np.hstack([np.empty((len(known), 0)), *columns]))
        return np.hstack([np.concatenate(parts), self._driven(c.a)])

    def descend(self, theta: FloatArray) -> tuple[FloatArray, float]:
        """Minimise by Levenberg-Marquardt; poles are kept within bounds, and no step leads to a growing free run."""
        now = self.squares(theta)
        damping = 1e-3
        for _ in range(_STEPS):
            J = self.jacobian(theta)
            gram, right = J.T @ J, J.T @ self._error(theta)
            scale = np.sqrt(np.maximum(np.diag(gram), np.finfo(np.float64).tiny))
            gram /= np.outer(scale, scale)
            before = now
            while damping < 1e8:
                trial = theta + np.linalg.solve(gram + damping * np.eye(self.size), right / scale) / scale
                first = trial[: self._k]
                if self._by_poles:
                    first[:] = np.clip(first, 0.0, self.most)
                if (self._by_poles or find_largest_root(first) < self._largest) and (
                    value := self.squares(trial)
                ) < now:
                    theta, now, damping = trial, value, max(damping / 10, 1e-12)
                    break
                damping *= 10
            if before - now <= _GAIN * before:
                break
        return theta, now


def _shifted(columns: FloatArray, by: int) -> FloatArray:
    out = np.zeros_like(columns)
    out[by:] = columns[: len(columns) - by]
    return out
