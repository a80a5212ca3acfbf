"""Common part of the autoregressive estimators: resampled data, inputs, and the candidates tried."""

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from thermocomp.core.arrays import BoolArray
from thermocomp.core.exceptions import FitError, InputError
from thermocomp.models.base import FloatArray, IntArray
from thermocomp.models.numerics import ticks
from thermocomp.models.numerics.ticks import TickedRun
from thermocomp.models.timed import TimedRegressor

#: a recording cannot determine a memory much longer than itself: the free run must decay by a factor e within this many
#: lengths of the longest test
MEMORY = 1.0

NO_SPEED = (
    "there is no spindle speed to predict from, the default input of an autoregressive model (P-01). Record the "
    "spindle speed and map its channel, name other inputs, or use a method that predicts from temperatures, such as "
    "dynamic"
)


@dataclass(frozen=True)
class TriedSetting:
    """One setting that was tried, assessed in free run on left-out thermal cycles.

    Parameters
    ----------
    interval : float
        [s]
    hidden : int
        Hidden nodes; 0 for a linear model.
    cv_rms : float
        Mean of the RMS values of the left-out cycles [unit of y]; inf if the setting cannot be fitted.
    """

    interval: float
    k: int
    m: int
    intercept: bool
    hidden: int
    cv_rms: float


@dataclass(frozen=True, eq=False)
class Clocked:
    """Training data resampled at one interval.

    Parameters
    ----------
    interval : float
        [s]
    y, dt : ndarray of shape (n_rows,)
    folds : ndarray of int of shape (n_rows,)
        -1 for rows that are not used for training.
    """

    interval: float
    runs: list[TickedRun]
    y: FloatArray
    dt: FloatArray
    folds: IntArray

    @classmethod
    def of(cls, inputs: FloatArray, y: FloatArray, dt: FloatArray, folds: IntArray, interval: float) -> "Clocked":
        """Resample the rows of a test at a constant interval.

        Parameters
        ----------
        inputs : ndarray of shape (n_rows, n_inputs)
        """
        return cls(interval, ticks.put_on_clock(inputs, dt, interval), y, dt, folds)

    def targets(self, without: int | None = None) -> list[FloatArray]:
        """Return the known displacement at each tick of each run, nan elsewhere and in the left-out fold."""
        known = (self.folds >= 0) & (self.folds != without) if without is not None else self.folds >= 0
        return ticks.displacements(self.runs, self.y, self.dt, known, self.interval)

    def lagged(self, targets: Sequence[FloatArray], k: int, m: int) -> FloatArray:
        """Return the regressors and dz at all ticks whose entire past is measured, not predicted.

        Returns
        -------
        ndarray of shape (n_ticks, k + (m + 1) n_inputs + 1), Fortran order
            [dz(t-h) .. dz(t-kh), inputs(t) .. inputs(t-mh), dz(t)]
        """
        start, blocks = max(k, m), []
        for run, own in zip(self.runs, targets, strict=True):
            n, J = max(len(own) - start, 0), run.drive.shape[1]
            block = np.empty((n, k + (m + 1) * J + 1), order="F")
            if n:
                for i in range(1, k + 1):
                    block[:, i - 1] = own[start - i : start - i + n]
                for i in range(m + 1):
                    block[:, k + i * J : k + (i + 1) * J] = run.drive[start - i : start - i + n]
                block[:, -1] = own[start:]
            if np.isnan(own).any():
                block = np.asfortranarray(block[np.isfinite(block).all(axis=1)])
            blocks.append(block)
        return blocks[0] if len(blocks) == 1 else np.asfortranarray(np.vstack(blocks))

    def free_run_rms(self, model: "Recursion", rows: BoolArray) -> float:
        """Return the RMS error of a model's free run on selected rows [unit of y]; nan if there are none."""
        free = np.concatenate([model.at_rows(r) for r in self.runs])
        return rms(self.y[rows] - free[rows])

    @property
    def largest_root(self) -> float:
        """Largest permitted modulus of the roots of the polynomial in past deviations."""
        longest = max(len(r.drive) - 1 for r in self.runs)
        return math.exp(-1.0 / (MEMORY * max(longest, 1)))


class Recursion(Protocol):
    """Fitted recursion of an autoregressive estimator."""

    def settled(self, inputs: FloatArray) -> FloatArray:
        """Return the deviation at which the model settles with the inputs of each row."""

    def at_rows(self, run: TickedRun) -> FloatArray:
        """Return the deviation in free run at each row of a test."""


class ClockedRegressor(TimedRegressor):
    """Base of the autoregressive estimators: the inputs used, and the selection by left-out thermal cycles."""

    inputs: Sequence[str | int] | None
    interval_: float

    @property
    @abstractmethod
    def _recursion(self) -> Recursion:
        """The fitted recursion, which computes the free run."""

    @abstractmethod
    def _learn(self, inputs: FloatArray, deviation: FloatArray, step: FloatArray, folds: IntArray) -> None:
        """Fit the recursion to the inputs, (n_rows, n_inputs), and the deviation."""

    def _fit(self, rows: FloatArray, deviation: FloatArray, step: FloatArray, folds: IntArray) -> None:
        self._columns = self._resolve()
        self._some = not np.array_equal(self._columns, np.arange(rows.shape[1]))
        names = ", ".join(self._names()[j] for j in self._columns)
        self.caution_ = (
            f"Its only inputs are {names}: it does not represent other influences, such as a change of the ambient "
            "temperature (E-P6). Judge it in free run under other conditions, never one step ahead (E-P3)."
        )
        self._learn(self._used(rows), deviation, step, folds)

    def _predict(self, rows: FloatArray, step: FloatArray) -> FloatArray:
        inputs = self._used(rows)
        if self.time == "none":
            return self._recursion.settled(inputs)
        runs = ticks.put_on_clock(inputs, step, self.interval_)
        parts = [self._recursion.at_rows(r) for r in runs]
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    def _resolve(self) -> IntArray:
        """Return the indices of the columns used as inputs."""
        if self.inputs is None:
            return np.arange(len(self._names()))
        if not len(self.inputs):
            raise FitError(NO_SPEED)
        found = [self._place(s, "input") for s in self.inputs]
        if len(set(found)) < len(found):
            raise InputError(f"inputs {list(self.inputs)}: a column is given twice; give each one once")
        return np.array(found, dtype=np.intp)

    def _used(self, rows: FloatArray) -> FloatArray:
        """Return the columns of the inputs; without a copy if all are used, since copying would double the run time."""
        return rows[:, self._columns] if self._some else rows

    def _chosen(self, trials: Sequence[TriedSetting]) -> int:
        """Store the assessed settings; return the index of the best, or 0 if none was assessed."""
        self.trials_ = tuple(trials)
        best = int(np.argmin([t.cv_rms for t in trials])) if trials else 0
        self.cv_rms_ = trials[best].cv_rms if trials else math.nan
        return best

    def _note_free_run(self, data: Clocked) -> None:
        """Store the free-run error on the training data; nan with ``time="none"``."""
        self.free_run_rms_ = math.nan if self.time == "none" else data.free_run_rms(self._recursion, data.folds >= 0)

    @staticmethod
    def _intervals(interval: float | Sequence[float] | None, dt: FloatArray) -> list[float]:
        if interval is None:
            return [ticks.median_step(dt)]
        found = [float(h) for h in np.atleast_1d(interval)]
        if not found or not all(0 < h < math.inf for h in found):
            raise InputError(f"interval {interval}: expected positive, finite seconds")
        return found

    @staticmethod
    def _orders(given: int | None, most: int, name: str) -> tuple[int, ...]:
        if given is None and most >= 0:
            return tuple(range(most + 1))
        if given is None or given < 0:
            raise InputError(f"order {name}: {most if given is None else given} must not be negative")
        return (given,)


def rms(error: FloatArray) -> float:
    """Return the root mean square; nan for an empty array."""
    return float(np.sqrt(np.mean(error**2))) if error.size else math.nan


def too_few(n: int, k: int, m: int, data: Clocked) -> str:
    """Return the message that there are too few rows for the given orders."""
    return (
        f"k = {k} and m = {m} at an interval of {data.interval:g} s: only {n} time steps have all the earlier values "
        "that the model needs, no more than it has coefficients; use a shorter interval, smaller orders or a longer "
        "recording"
    )
