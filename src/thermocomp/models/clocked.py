"""What the autoregressive estimators share: their data on a clock, their inputs, and what was tried to choose."""

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, TypeGuard

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.utils.validation import check_is_fitted, validate_data

from thermocomp.core.exceptions import FitError, InputError
from thermocomp.models.numerics import ticks
from thermocomp.models.numerics.folds import number_folds
from thermocomp.models.numerics.ticks import Run
from thermocomp.models.timed import TimedRegressor

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

#: a memory much longer than the recording cannot be known from it: the free run must decay by e within this many times
#: the longest test
MEMORY = 1.0

NO_SPEED = (
    "there is no spindle speed to predict from: an autoregressive model knows nothing else (P-01). Record the spindle "
    "speed and map its channel, name other inputs, or take a method that predicts from temperatures, such as dynamic"
)


@dataclass(frozen=True)
class Trial:
    """One setting that was tried, judged in free run on thermal cycles left out.

    Parameters
    ----------
    interval : float
        [s]
    k, m : int
    intercept : bool
    hidden : int
        Hidden nodes; 0 for a linear model.
    cv_rms : float
        Mean over the cycles left out of their RMS [unit of y]; inf if the setting cannot be fitted.
    """

    interval: float
    k: int
    m: int
    intercept: bool
    hidden: int
    cv_rms: float


@dataclass(frozen=True, eq=False)
class Clocked:
    """Training data on the clock of one interval.

    Parameters
    ----------
    interval : float
        [s]
    runs : list of Run
    y, dt : ndarray of shape (n_rows,)
    folds : ndarray of int of shape (n_rows,)
        -1 for rows that are not learned from.
    """

    interval: float
    runs: list[Run]
    y: FloatArray
    dt: FloatArray
    folds: IntArray

    def targets(self, without: int | None = None) -> list[FloatArray]:
        """Return the known displacement at each tick of each run, nan elsewhere and in the fold left out."""
        known = (self.folds >= 0) & (self.folds != without) if without is not None else self.folds >= 0
        return ticks.displacements(self.runs, self.y, self.dt, known, self.interval)

    def lagged(self, targets: Sequence[FloatArray], k: int, m: int) -> FloatArray:
        """Return the regressors and dz at all ticks whose whole past is known: measured, not predicted.

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

    @property
    def largest_root(self) -> float:
        """Bound on the roots of the polynomial."""
        longest = max(len(r.drive) - 1 for r in self.runs)
        return math.exp(-1.0 / (MEMORY * max(longest, 1)))


class Recursion(Protocol):
    """What an autoregressive estimator fits."""

    def settled(self, inputs: FloatArray) -> FloatArray:
        """Return the deviation at which it would come to rest with each row's inputs."""

    def at_rows(self, run: Run) -> FloatArray:
        """Return its free run through a test, at the rows."""


class ClockedRegressor(TimedRegressor):
    """What the autoregressive estimators share: which inputs, on which clock, chosen by which cycles."""

    interval_: float

    @property
    @abstractmethod
    def _recursion(self) -> Recursion:
        """What was fitted."""

    def predict(self, X: ArrayLike, *, dt: ArrayLike | None = None) -> FloatArray:
        """Predict the deviation in free run from a cold start, never one step ahead (P-05).

        Parameters
        ----------
        X : array-like of shape (n_rows, n_features)
        dt : array-like of shape (n_rows,), optional
            As in `fit`. With ``time="none"``, the deviation at which each row would settle is given.

        Returns
        -------
        ndarray of shape (n_rows,)
        """
        inputs, step = self._given(X, dt)
        if self.time == "none":
            return self._recursion.settled(inputs)
        runs = ticks.on_clock(inputs, step, self.interval_)
        parts = [self._recursion.at_rows(r) for r in runs]
        return parts[0] if len(parts) == 1 else np.concatenate(parts)

    def _start(
        self, X: ArrayLike, y: ArrayLike, dt: ArrayLike | None, cycle: ArrayLike | None
    ) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
        """Check the training data; return inputs, y, time steps and folds."""
        self._time = self.time
        self._declared()
        checked = validate_data(self, X, y, y_numeric=True, dtype=np.float64, ensure_min_samples=2)
        rows, step = self._clock(X, checked[0], dt, fitting=True)
        folds, self.chosen_by_ = number_folds(self._cycles(cycle, step), len(rows))
        learned = np.ascontiguousarray(rows.T)  # by column in memory: the next two are ten times as fast
        if folds.min() < 0:
            learned = learned[:, folds >= 0]
        self.data_min_, self.data_max_ = learned.min(axis=1), learned.max(axis=1)
        self._columns = self._resolve()
        self._some = not np.array_equal(self._columns, np.arange(rows.shape[1]))
        names = ", ".join(self._names()[j] for j in self._columns)
        self.caution_ = (
            f"It knows {names} and nothing else: what comes from elsewhere, such as a change of the ambient "
            "temperature, is outside this model (E-P6). Judge it in free run on other conditions, never one step "
            "ahead (E-P3)."
        )
        return self._used(rows), np.asarray(checked[1], dtype=np.float64), step, folds

    def _resolve(self) -> IntArray:
        wanted = self._wanted()
        if wanted is None:
            return np.arange(len(self._names()))
        if not len(wanted):
            raise FitError(NO_SPEED)
        found = [self._place(s, "input") for s in wanted]
        if len(set(found)) < len(found):
            raise InputError(f"inputs {list(wanted)}: one is given twice")
        return np.array(found, dtype=np.intp)

    @abstractmethod
    def _wanted(self) -> Sequence[str | int] | None:
        """Return the inputs asked for."""

    def _given(self, X: ArrayLike, dt: ArrayLike | None) -> tuple[FloatArray, FloatArray]:
        """Check X and time against what was fitted; return the columns of the inputs, and the time steps."""
        self._declared()
        check_is_fitted(self)
        if _is_plain(X, self.n_features_in_) and not hasattr(self, "feature_names_in_"):
            rows = X
        else:
            rows = validate_data(self, X, dtype=np.float64, reset=False)
        inputs, step = self._clock(X, rows, dt)
        return self._used(inputs), step

    def _used(self, rows: FloatArray) -> FloatArray:
        """Return the columns of the inputs; no copy if that is all: it takes as long as the rest."""
        return rows[:, self._columns] if self._some else rows

    @staticmethod
    def _intervals(interval: float | Sequence[float] | None, dt: FloatArray) -> list[float]:
        if interval is None:
            return [ticks.usual(dt)]
        found = [float(h) for h in np.atleast_1d(interval)]
        if not found or not all(0 < h < math.inf for h in found):
            raise InputError(f"interval {interval}: want positive, finite seconds")
        return found

    @staticmethod
    def _orders(given: int | None, most: int, name: str) -> tuple[int, ...]:
        if given is None and most >= 0:
            return tuple(range(most + 1))
        if given is None or given < 0:
            raise InputError(f"order {name}: {most if given is None else given} must not be negative")
        return (given,)


def _is_plain(X: ArrayLike, n_columns: int) -> TypeGuard[FloatArray]:
    """Return True for an array that scikit-learn would let pass as it is; asking it takes as long as a free run."""
    if not (type(X) is np.ndarray and X.dtype == np.float64 and X.ndim == 2 and len(X) and X.shape[1] == n_columns):
        return False
    with np.errstate(over="ignore", invalid="ignore"):
        return math.isfinite(X.sum())


def rms(error: FloatArray) -> float:
    """Return the root of the mean square; nan of nothing."""
    return float(np.sqrt(np.mean(error**2))) if error.size else math.nan


def too_few(n: int, k: int, m: int, data: Clocked) -> str:
    """Say that there are too few rows for some orders.

    Parameters
    ----------
    n : int
        Ticks that could be learned from.
    k, m : int
    data : Clocked

    Returns
    -------
    str
    """
    return (
        f"k = {k} and m = {m} at an interval of {data.interval:g} s: only {n} ticks have a known past, fewer than "
        "there are coefficients or just as many; take a shorter interval, smaller orders or a longer recording"
    )
