"""Linear model for simple controllers: a few current temperatures, each times a printable coefficient."""

from itertools import combinations
from math import comb

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thermocomp.core.exceptions import InputError
from thermocomp.models.base import FloatArray, IntArray
from thermocomp.models.linear import TermRegressor

Sets = NDArray[np.intp]

#: minimum relative decrease of the RMS on the left-out cycles for a further sensor
GAIN = 0.05
#: a set that does no harm with an input lost is preferred up to this ratio of its RMS to the best RMS
DEAR = 2.0
#: above this number of sets of a size, only supersets of the best smaller set are tried
_MOST_SETS = 50_000
#: regularization strength for collinear columns, relative to columns scaled to 1
_LITTLE = 1e-12


class LinearReduction(TermRegressor):
    """Least squares on the one to `max_sensors` inputs that best predict unseen cycles, with printable coefficients.

    Every set is fitted with each thermal cycle left out in turn and tested on that cycle, complete and with each input
    lost: a simple controller does not detect a lost input. Sets that are worse than no model with an input lost are
    passed over, unless the RMS of the others exceeds `DEAR` times the best one. The smallest set that no larger one
    beats by `GAIN` is fitted to all cycles, and its coefficients are rounded as in the controller's file: the judged
    model is the printed one.

    Parameters
    ----------
    fit_intercept : bool
        False: the output is zero in the reference state.
    digits : int
        Significant digits of a coefficient.

    Attributes
    ----------
    selected_ : tuple of int
        Indices of the features in the model, in ascending order.
    unseen_ : float
        RMS over the left-out cycles [unit of y].
    chosen_by_ : str
        Parts of the data left out in turn for the selection, as text.
    terms_, coef_, intercept_, r_squared_, adjusted_r_squared_, standard_error_, n_effective_, condition_
        See `thermocomp.models.linear.TermRegressor`; they refer to the coefficients before rounding.

    Examples
    --------
    >>> import numpy as np
    >>> from thermocomp.export.reduction.models import LinearReduction
    >>> rng = np.random.default_rng(0)
    >>> rises = rng.uniform(0, 10, (100, 4))  # of four temperatures, one of which matters [degC]
    >>> y = 12.3456789 * rises[:, 2] + rng.normal(size=100)
    >>> model = LinearReduction(digits=4).fit(rises, y, cycle=np.arange(100) // 20)
    >>> print(model.selected_, model.coef_.tolist())
    (2,) [12.35]
    """

    def __init__(self, *, max_sensors: int = 1, fit_intercept: bool = False, digits: int = 5) -> None:
        self.max_sensors = max_sensors
        self.fit_intercept = fit_intercept
        self.digits = digits

    def fit(self, X: ArrayLike, y: ArrayLike, *, cycle: ArrayLike | None = None) -> "LinearReduction":
        """Select sensors, fit the model and round the coefficients.

        Parameters
        ----------
        X : array-like of shape (n_rows, n_features)
            Temperatures minus their reference.
        y : array-like of shape (n_rows,)
            Deviation.
        cycle : array-like of int of shape (n_rows,), optional
            Thermal cycle of each row; rows with -1 are not used for training. Default: five blocks of equal length as
            cycles.
        """
        if self.max_sensors < 1 or not 1 <= self.digits <= 17:
            raise InputError(
                f"max_sensors {self.max_sensors}, digits {self.digits}: expected max_sensors of at least 1, and digits "
                "from 1 to 17"
            )
        change, deviation, folds, self.chosen_by_ = self._learned(X, y, cycle)
        self.selected_, self.unseen_ = self._choose(change, deviation, folds)
        self._regress(change, deviation, self.selected_)
        self.coef_ = np.array([self._rounded(c) for c in self.coef_.tolist()])
        self.intercept_ = self._rounded(self.intercept_)
        return self

    def _rounded(self, value: float) -> float:
        return float(f"{value:.{self.digits}g}")

    def _choose(self, X: FloatArray, y: FloatArray, folds: IntArray) -> tuple[tuple[int, ...], float]:
        """Return the set with the smallest RMS on unseen cycles, and this RMS."""
        moving = np.flatnonzero(np.ptp(X, axis=0) > 0)
        if not moving.size:
            return (), float(np.sqrt(np.mean(y**2)))
        scale = np.sqrt((X[:, moving] ** 2).mean(axis=0))
        table = np.column_stack([X[:, moving] / scale, *([np.ones(len(y))] if self.fit_intercept else []), y])
        parts = np.stack([table[folds == k].T @ table[folds == k] for k in range(int(folds.max()) + 1)])
        safe, any_ = (self._best(parts, moving.size, len(y), fragile=fragile) for fragile in (False, True))
        best, least = safe if safe[1] <= DEAR * any_[1] else any_
        return tuple(moving[best].tolist()), least

    def _best(self, parts: FloatArray, n: int, rows: int, *, fragile: bool) -> tuple[Sets, float]:
        """Return the best set of n columns and its RMS; `fragile` admits sets that do harm with an input lost."""
        none = float(parts[:, -1, -1].sum())
        best: Sets = np.empty(0, np.intp)
        least = np.inf
        for size in range(1, min(self.max_sensors, n) + 1):
            sets = _sets(n, size, best)
            unseen, lost = _unseen(parts, sets, intercept=self.fit_intercept)
            squares = np.where(fragile | (size == 1) | (lost <= none), np.maximum(unseen, 0.0), np.inf)
            left = np.sqrt(squares / rows)
            first = int(np.argmin(left))
            if size > 1 and not left[first] < (1 - GAIN) * least:
                break
            best, least = sets[first], float(left[first])
        return best, least


def _sets(n: int, size: int, best: Sets) -> Sets:
    """Return sets of the n columns, (n_sets, size), each in ascending order."""
    if comb(n, size) <= _MOST_SETS:
        return np.array(list(combinations(range(n), size)), dtype=np.intp)
    return np.array([sorted([*best.tolist(), j]) for j in range(n) if j not in best], dtype=np.intp)


def _unseen(parts: FloatArray, sets: Sets, *, intercept: bool) -> tuple[FloatArray, FloatArray]:
    """Return the residual sums of squares of sets on parts left out in turn, complete and with the worst input lost.

    Parameters
    ----------
    parts : ndarray of shape (n_parts, n_columns + 1, n_columns + 1)
        Products of the columns with each other and with the target, per part.
    sets : ndarray of int of shape (n_sets, size)

    Returns
    -------
    unseen, lost : ndarray of shape (n_sets,)
    """
    inputs = sets.shape[1]
    if intercept:
        sets = np.hstack([sets, np.full((len(sets), 1), parts.shape[1] - 2, dtype=np.intp)])
    across, down = sets[:, :, None], sets[:, None, :]
    whole, found = parts.sum(axis=0), np.zeros((1 + inputs, len(sets)))
    for part in parts:
        rest = whole - part if len(parts) > 1 else whole
        little = _LITTLE * max(float(np.trace(rest[:-1, :-1])), _LITTLE)
        weights = np.linalg.solve(rest[across, down] + little * np.eye(sets.shape[1]), rest[sets, -1][..., None])
        for lost in range(1 + inputs):  # last iteration: no input lost
            w = weights[..., 0].copy()
            if lost < inputs:
                w[:, lost] = 0.0
            cross = (w * part[sets, -1]).sum(axis=1)
            found[lost] += part[-1, -1] - 2 * cross + np.einsum("ij,ijk,ik->i", w, part[across, down], w)
    return found[-1], found[:-1].max(axis=0)
