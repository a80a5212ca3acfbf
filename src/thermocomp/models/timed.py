"""Time in scikit-learn: how an estimator with a memory receives the time, and when it raises an error.

scikit-learn treats rows as exchangeable and passes on any subset of them. A model with a memory that receives a part
without its past predicts different values without a warning; it therefore requires a declaration of the time, and rows
that are complete from the start of each test.
"""

import math
from abc import abstractmethod
from typing import Any, ClassVar, Literal, Self, TypeGuard

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn import get_config
from sklearn.base import clone
from sklearn.utils.validation import check_is_fitted, validate_data

from thermocomp.core.exceptions import FitError, InputError
from thermocomp.core.model import ErrorModel
from thermocomp.models.base import FloatArray, IntArray, ThermalRegressor
from thermocomp.models.numerics.folds import number_folds
from thermocomp.models.numerics.ticks import check_steps

Time = Literal["column", "routed", "none"]

#: a step longer than this many usual steps means missing rows, not a pause of the logger
GAP = 10.0
#: a time column that ends before this cannot be the time [s] of a thermal test: it was scaled, or is in hours
LEAST = 60.0

REMEDY = (
    "time='column' if the first column of X is the time since the start of the row's test [s], or time='routed' to "
    "pass dt by scikit-learn's metadata routing"
)
_WHOLE = (
    "leave whole tests out (groups=table.test), or judge the cycles of one recording with thermocomp.compare(..., "
    "leave_one='cycle')"
)


class TimedRegressor(ThermalRegressor):
    """A regressor with a memory; ``time`` defines the source of the time.

    ``"column"``
        The first column of X is the time since the start of the row's test [s]. A row that is not later than the
        previous row starts a new test, at 0.
    ``"routed"``
        `fit`, `predict` and `score` receive ``dt``, the time since the previous row [s], ``inf`` at the start of a
        test; from scikit-learn through ``set_fit_request(dt=True)`` etc. With metadata routing enabled it must be a
        pandas Series: its index reveals missing rows.
    ``"none"``
        Every row is treated as a steady state. For scikit-learn's own checks; cannot be frozen or compared.
    ``None``
        Not declared: `fit`, `predict` and `score` raise an error.
    """

    columns: ClassVar[str] = "inputs"  #: name of the parameter that selects columns of X
    time: Time | None

    def routed(self) -> Self:
        """Return an unfitted copy with ``time="routed"``, for callers that pass dt themselves.

        Raises
        ------
        InputError
            The estimator has ``time="none"``, which is not intended for use on a machine.
        """
        if self.time == "none":
            raise InputError(f"{type(self).__name__}(time='none') treats every row as a steady state; give it {REMEDY}")
        named = getattr(self, self.columns)
        if named is not None:
            named = tuple(c if isinstance(c, str) else c - self._hidden for c in named)
        copy: Self = clone(self).set_params(time="routed", **{self.columns: named})
        return copy

    def fit(self, X: ArrayLike, y: ArrayLike, *, dt: ArrayLike | None = None, cycle: ArrayLike | None = None) -> Self:
        """Fit the model; see the class for cases in which a method rejects the data.

        Parameters
        ----------
        X : array-like of shape (n_rows, n_features)
            Inputs minus their reference, in chronological order; with ``time="column"`` preceded by the time.
        y : array-like of shape (n_rows,)
            Deviation; ignored where `cycle` is -1.
        dt : array-like of shape (n_rows,), optional
            With ``time="routed"``: time since the previous row [s], ``inf`` in the first row of each test.
        cycle : array-like of int of shape (n_rows,), optional
            Thermal cycle of each row, for the choice of settings. Rows with -1 drive the memory but are not used for
            training. Default: each of several tests is a cycle (``time="column"``), otherwise five blocks of equal
            length replace the cycles.

        Returns
        -------
        self

        Raises
        ------
        FitError
            There are no training rows.
        InputError
            The time was not declared, the rows do not form complete tests, or a setting is out of range.
        """
        self._time = self.time
        self._declared()
        given, deviation = self._read(X, y)
        rows, step = self._clock(X, given, dt, fitting=True)
        folds, self.chosen_by_ = number_folds(self._cycles(cycle, step), len(rows))
        self._note_range(rows if folds.min() >= 0 else rows[folds >= 0])
        self._fit(rows, deviation, step, folds)
        return self

    @abstractmethod
    def _fit(self, rows: FloatArray, deviation: FloatArray, step: FloatArray, folds: IntArray) -> None:
        """Fit to validated data: inputs without the time, y, time steps [s], and folds (-1: not used for training)."""

    def predict(self, X: ArrayLike, *, dt: ArrayLike | None = None) -> FloatArray:
        """Predict the deviation from a cold start of each test; never from measured deviations (P-05).

        Parameters
        ----------
        X : array-like of shape (n_rows, n_features)
            As in `fit`.
        dt : array-like of shape (n_rows,), optional
            As in `fit`. With ``time="none"``, the deviation at which the machine would settle is predicted for each
            row.

        Returns
        -------
        ndarray of shape (n_rows,)
        """
        return self._predict(*self._given(X, dt))

    @abstractmethod
    def _predict(self, rows: FloatArray, step: FloatArray) -> FloatArray:
        """Return the prediction for inputs without the time column, and time steps [s]."""

    def score(
        self, X: ArrayLike, y: ArrayLike, sample_weight: ArrayLike | None = None, *, dt: ArrayLike | None = None
    ) -> float:
        """Return R2 of the prediction.

        Parameters
        ----------
        X : array-like of shape (n_rows, n_features)
        y : array-like of shape (n_rows,)
        sample_weight : array-like of shape (n_rows,), optional
        dt : array-like of shape (n_rows,), optional
            With ``time="routed"`` only, as in `fit`.

        Returns
        -------
        float
        """
        from sklearn.metrics import r2_score

        return float(r2_score(y, self.predict(X, dt=dt), sample_weight=sample_weight))

    def freeze(self, **header: Any) -> ErrorModel:
        """Return the fitted model as plain numbers; see `thermocomp.models.base.ThermalRegressor.freeze`.

        Parameters
        ----------
        **header
            As in that method. The time is not an input.

        Returns
        -------
        ErrorModel

        Raises
        ------
        FitError
            The model was fitted with ``time="none"`` and has learned nothing about time.
        """
        if self.time == "none":
            raise FitError(
                f"{type(self).__name__}(time='none') treats every row as a steady state; fit it with {REMEDY}"
            )
        return super().freeze(**header)

    # -- for the methods -----------------------------------------------------------------------------------------------

    def _declared(self) -> None:
        """Raise an error if the time was not declared or differs from the declaration in `fit`."""
        name = type(self).__name__
        if self.time is None:
            raise InputError(f"{name} has a memory and was not given the time: give it {REMEDY}")
        if self.time not in ("column", "routed", "none"):
            raise InputError(f"{name}: unknown time={self.time!r}; give it {REMEDY}")
        fitted = getattr(self, "_time", self.time)
        if fitted != self.time:
            raise InputError(f"{name} was fitted with time={fitted!r} but now has time={self.time!r}: fit it again")

    def _given(self, X: ArrayLike, dt: ArrayLike | None) -> tuple[FloatArray, FloatArray]:
        """Check X and time against the fitted model; return the inputs without the time, and the time steps."""
        self._declared()
        check_is_fitted(self)
        if _is_plain(X, self.n_features_in_) and not hasattr(self, "feature_names_in_"):
            rows = X
        else:
            rows = validate_data(self, X, dtype=np.float64, reset=False)
        return self._clock(X, rows, dt)

    def _clock(
        self, X: ArrayLike, rows: FloatArray, dt: ArrayLike | None, *, fitting: bool = False
    ) -> tuple[FloatArray, FloatArray]:
        """Return the inputs without the time, and the time since the previous row [s], inf at the start of a test."""
        if self.time == "routed":
            return rows, _routed(dt, len(rows), type(self).__name__)
        if dt is not None:
            raise InputError(
                f"dt was given to {type(self).__name__}(time={self.time!r}): dt is accepted only with time='routed'"
            )
        if self.time == "none":
            return rows, np.full(len(rows), np.inf)
        if rows.shape[1] < 2:
            raise InputError("time='column': X has one column, the time, and no input")
        return rows[:, 1:], derive_steps(rows[:, 0], getattr(X, "index", None), fitting=fitting)

    def _cycles(self, cycle: ArrayLike | None, step: FloatArray) -> ArrayLike | None:
        """Return the thermal cycles for the choice of settings: as given, or the tests if there are several."""
        if cycle is not None or self.time != "column":
            return cycle
        tests = np.cumsum(np.isinf(step)) - 1
        return tests if tests[-1] > 0 else None

    def _names(self) -> tuple[str, ...]:
        return super()._names()[self._hidden :]

    def _place(self, column: str | int, what: str) -> int:
        """Return the input specified by a name or by an index into the columns of X."""
        names = [str(n) for n in self._names()]
        if isinstance(column, str):
            if column not in names:
                raise InputError(f"{what} {column!r}: no such column; the columns are {', '.join(names)}")
            return names.index(column)
        place = int(column) - self._hidden
        if not 0 <= place < len(names):
            wrong = "is the time" if place == -1 and self._hidden else f"is beyond the {len(names)} columns"
            raise InputError(f"{what} {column!r} {wrong}")
        return place

    @property
    def _hidden(self) -> int:
        """Number of columns of X before the inputs: 1 if the first one is the time, else 0."""
        return int(self.time == "column")


def _is_plain(X: ArrayLike, n_columns: int) -> TypeGuard[FloatArray]:
    """Return True for an array that scikit-learn would accept unchanged; its own check is as slow as a free run."""
    if not (type(X) is np.ndarray and X.dtype == np.float64 and X.ndim == 2 and len(X) and X.shape[1] == n_columns):
        return False
    with np.errstate(over="ignore", invalid="ignore"):
        return math.isfinite(X.sum())


def derive_steps(time: FloatArray, index: object = None, *, fitting: bool = False) -> FloatArray:
    """Return the time since the previous row from a column with the time since the start of each test.

    Parameters
    ----------
    time : ndarray of shape (n_rows,)
        [s]; a row that is not later than the previous row starts a new test.
    index : pandas.Index, optional
        Index of the rows; integers reveal missing rows.
    fitting : bool
        Also reject data that are too short for training.

    Returns
    -------
    ndarray of shape (n_rows,)
        [s]; inf in the first row of each test.

    Raises
    ------
    InputError
        The column is not a time, a test does not begin at 0, or rows are missing.
    """
    step = np.diff(time, prepend=np.inf)
    step[step <= 0] = np.inf
    step[0] = np.inf
    starts = np.isinf(step)
    if len(time) > 1 and starts.all():
        raise InputError("time='column': the first column of X never increases, so it is not the time [s]")
    late = np.flatnonzero(starts & (np.abs(time) > 1e-6))
    if late.size:
        raise InputError(
            f"time='column': at row {late[0]} a test begins at {time[late[0]]:g} s and not at 0. Its start was left "
            f"out: {_WHOLE}; or the first column of X is not the time since the start of the test [s]"
        )
    if fitting and time.max() < LEAST:
        raise InputError(
            f"time='column': the first column of X ends at {time.max():g} s, which is too short for a thermal test. It "
            "must be in seconds and not scaled: in a Pipeline, pass it through with a ColumnTransformer"
        )
    inside = step[~starts]
    if inside.size and inside.max() > GAP * np.median(inside):
        row = int(np.flatnonzero(~starts & (step > GAP * np.median(inside)))[0])
        raise InputError(
            f"time='column': row {row} comes {step[row]:g} s after the previous row, where {np.median(inside):g} s are "
            f"usual, so rows are missing: {_WHOLE}. For a pause in the recording itself, use time='routed'"
        )
    _refuse_holes(index, starts)
    return step


def _routed(dt: ArrayLike | None, n_rows: int, name: str) -> FloatArray:
    if dt is None:
        raise InputError(
            f"{name}(time='routed') was given no dt. Under scikit-learn: set_config(enable_metadata_routing=True) and "
            ".set_fit_request(dt=True).set_predict_request(dt=True).set_score_request(dt=True); a scorer given by "
            "name passes no dt to predict: use scoring=None, or use time='column'"
        )
    step = check_steps(dt, n_rows)
    if n_rows and not np.isinf(step[0]):
        raise InputError(
            f"dt: the first row is {step[0]:g} s after another row, but a test must start with inf. The start of the "
            f"test was left out: {_WHOLE}"
        )
    if not hasattr(dt, "index") and get_config()["enable_metadata_routing"]:
        raise InputError(
            f"{name}: dt has no index, so missing rows cannot be detected; give pd.Series(dt), made before rows are "
            "left out"
        )
    _refuse_holes(getattr(dt, "index", None), np.isinf(step))
    return step


def _refuse_holes(index: Any, starts: NDArray[np.bool_]) -> None:
    """Reject rows that are not adjacent; labels that are not integers are not checked."""
    labels = None if index is None or callable(index) else np.asarray(index)
    if labels is None or labels.ndim != 1 or not np.issubdtype(labels.dtype, np.integer):
        return
    apart = np.diff(labels, prepend=labels[:1])[~starts]
    if not apart.size:
        return
    usual = np.median(apart)
    if (apart != usual).any():
        row = int(np.flatnonzero(~starts)[np.argmax(apart != usual)])
        raise InputError(
            f"rows are missing between index {labels[row - 1]} and {labels[row]}: {_WHOLE}. "
            "If these rows never existed: reset_index(drop=True)"
        )
