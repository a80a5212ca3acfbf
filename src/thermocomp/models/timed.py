"""Time in scikit-learn: how an estimator with a memory gets the time, and when it refuses to work.

scikit-learn takes rows as exchangeable and hands any part of them on. A model with a memory that is given a part
without its past predicts something else and no warning comes; so it demands a declaration, and rows it can follow from
the start of each test.
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
from thermocomp.models.numerics.ticks import check_steps as checked_steps

Time = Literal["column", "routed", "none"]

#: a step this many times the usual one is no pause of the logger: rows are missing
GAP = 10.0
#: a column that ends before this is no time [s] of a thermal test: it was scaled, or counts hours
LEAST = 60.0

REMEDY = (
    "time='column' if the first column of X is the time since the start of the row's test [s], or time='routed' to "
    "pass dt by scikit-learn's metadata routing"
)
_WHOLE = "give every test from its start: leave whole tests out (groups=, LeaveOneGroupOut)"
_OURS = "thermocomp.compare(..., leave_one='cycle') judges a thermal cycle from the middle of a test"


class TimedRegressor(ThermalRegressor):
    """A regressor with a memory; ``time`` specifies the source of the time.

    ``"column"``
        The first column of X is the time since the start of the row's test [s]. A row that is not later than the one
        before starts a new test, at 0.
    ``"routed"``
        `fit`, `predict` and `score` get ``dt``, the time since the row before [s], ``inf`` where a test starts; from
        scikit-learn by ``set_fit_request(dt=True)`` and the like. With metadata routing enabled it must be a pandas
        Series: its index shows rows that were left out.
    ``"none"``
        Every row is a machine at rest in that state. For scikit-learn's own checks: it cannot be frozen or compared.
    ``None``
        Nothing was declared: `fit`, `predict` and `score` refuse.
    """

    columns: ClassVar[str] = "inputs"  #: its parameter that names columns of X
    time: Time | None

    def routed(self) -> Self:
        """Return an unfitted copy with ``time="routed"``, for those who pass dt themselves.

        Raises
        ------
        InputError
            It was given ``time="none"``, so it was not meant for a machine.
        """
        if self.time == "none":
            raise InputError(
                f"{type(self).__name__}(time='none') treats every row as a machine at rest; give it {REMEDY}"
            )
        named = getattr(self, self.columns)
        if named is not None:
            named = tuple(c if isinstance(c, str) else c - self._hidden for c in named)
        copy: Self = clone(self).set_params(time="routed", **{self.columns: named})
        return copy

    def fit(self, X: ArrayLike, y: ArrayLike, *, dt: ArrayLike | None = None, cycle: ArrayLike | None = None) -> Self:
        """Fit; the class documents the additional data that a method refuses.

        Parameters
        ----------
        X : array-like of shape (n_rows, n_features)
            Inputs minus their reference, in the order of time; with ``time="column"`` behind the time.
        y : array-like of shape (n_rows,)
            Deviation; without meaning where `cycle` is -1.
        dt : array-like of shape (n_rows,), optional
            With ``time="routed"``: time since the row before [s], ``inf`` in the first row of each test.
        cycle : array-like of int of shape (n_rows,), optional
            Thermal cycle of each row, by which settings are chosen. Rows with -1 drive the memory but are not learned
            from. Without it each test of several is one (``time="column"``), or five stretches of equal length take the
            place of the cycles.

        Returns
        -------
        self

        Raises
        ------
        FitError
            No row to learn from.
        InputError
            The time was not declared, the rows are not those of whole tests, or a setting is out of its range.
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
        """Fit to data that were checked: inputs without the time, y, time steps [s], and folds (-1: not learned)."""

    def predict(self, X: ArrayLike, *, dt: ArrayLike | None = None) -> FloatArray:
        """Predict the deviation from a cold start of each test; never from measured ones (P-05).

        Parameters
        ----------
        X : array-like of shape (n_rows, n_features)
            As in `fit`.
        dt : array-like of shape (n_rows,), optional
            As in `fit`. With ``time="none"``, what is predicted is where the machine would settle in each row.

        Returns
        -------
        ndarray of shape (n_rows,)
        """
        return self._predict(*self._given(X, dt))

    @abstractmethod
    def _predict(self, rows: FloatArray, step: FloatArray) -> FloatArray:
        """Predict from inputs without the time, and time steps [s]."""

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
            As there. The time is no input.

        Returns
        -------
        ErrorModel

        Raises
        ------
        FitError
            It was fitted with ``time="none"``: it has learned nothing of time.
        """
        if self.time == "none":
            raise FitError(
                f"{type(self).__name__}(time='none') treats every row as a machine at rest; fit it with {REMEDY}"
            )
        return super().freeze(**header)

    # -- for the methods -----------------------------------------------------------------------------------------------

    def _declared(self) -> None:
        """Refuse to work without a declaration of time, or with another than in `fit`."""
        name = type(self).__name__
        if self.time is None:
            raise InputError(f"{name} has a memory and was not given the time: give it {REMEDY}")
        if self.time not in ("column", "routed", "none"):
            raise InputError(f"{name}: time={self.time!r} is not known; give it {REMEDY}")
        fitted = getattr(self, "_time", self.time)
        if fitted != self.time:
            raise InputError(f"{name} was fitted with time={fitted!r} and has time={self.time!r} now: fit it again")

    def _given(self, X: ArrayLike, dt: ArrayLike | None) -> tuple[FloatArray, FloatArray]:
        """Check X and time against what was fitted; return the inputs without the time, and the time steps."""
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
        """Return the inputs without the time, and the time since the row before [s], inf where a test starts."""
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
        """Return the thermal cycles to choose settings by: those given, else the tests if there are several."""
        if cycle is not None or self.time != "column":
            return cycle
        tests = np.cumsum(np.isinf(step)) - 1
        return tests if tests[-1] > 0 else None

    def _names(self) -> tuple[str, ...]:
        return super()._names()[self._hidden :]

    def _place(self, column: str | int, what: str) -> int:
        """Return the input denoted by a name or by an index into the columns of X.

        Raises
        ------
        InputError
            There is none of that name, or it is the time.
        """
        names = [str(n) for n in self._names()]
        if isinstance(column, str):
            if column not in names:
                raise InputError(f"{what} {column!r}: the columns are {', '.join(names)}")
            return names.index(column)
        place = int(column) - self._hidden
        if not 0 <= place < len(names):
            wrong = "is the time" if place == -1 and self._hidden else f"is beyond the {len(names)} columns"
            raise InputError(f"{what} {column!r} {wrong}")
        return place

    @property
    def _hidden(self) -> int:
        """Columns of X in front of the inputs."""
        return int(self.time == "column")


def _is_plain(X: ArrayLike, n_columns: int) -> TypeGuard[FloatArray]:
    """Return True for an array that scikit-learn would accept unchanged; its own check takes as long as a free run."""
    if not (type(X) is np.ndarray and X.dtype == np.float64 and X.ndim == 2 and len(X) and X.shape[1] == n_columns):
        return False
    with np.errstate(over="ignore", invalid="ignore"):
        return math.isfinite(X.sum())


def derive_steps(time: FloatArray, index: object = None, *, fitting: bool = False) -> FloatArray:
    """Return the time since the row before from a column that counts from the start of each test.

    Parameters
    ----------
    time : ndarray of shape (n_rows,)
        [s]; a row that is not later than the one before starts a new test.
    index : pandas.Index, optional
        Index of the rows; whole numbers show rows that were left out.
    fitting : bool
        Also refuse what is too short to be learned from.

    Returns
    -------
    ndarray of shape (n_rows,)
        [s]; inf in the first row of each test.

    Raises
    ------
    InputError
        It is not a time, or a test does not begin at 0, or rows are missing.
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
            f"time='column': at row {late[0]} a test begins at {time[late[0]]:g} s and not at 0. Either the first "
            "column of X is not the time since the start of the test [s], or the start was left out: "
            f"{_WHOLE}; {_OURS}"
        )
    if fitting and time.max() < LEAST:
        raise InputError(
            f"time='column': the first column of X ends at {time.max():g} s, which is no thermal test. It must be "
            "seconds, and not scaled: in a Pipeline let it through by a ColumnTransformer"
        )
    inside = step[~starts]
    if inside.size and inside.max() > GAP * np.median(inside):
        row = int(np.flatnonzero(~starts & (step > GAP * np.median(inside)))[0])
        raise InputError(
            f"time='column': {step[row]:g} s pass before row {row}, {np.median(inside):g} s as a rule, so rows are "
            f"missing: {_WHOLE}; {_OURS}. A pause that is in the recording itself needs time='routed'"
        )
    _refuse_holes(index, starts)
    return step


def _routed(dt: ArrayLike | None, n_rows: int, name: str) -> FloatArray:
    if dt is None:
        raise InputError(
            f"{name}(time='routed') was given no dt. Under scikit-learn: set_config(enable_metadata_routing=True) and "
            ".set_fit_request(dt=True).set_predict_request(dt=True).set_score_request(dt=True); a scorer by name "
            "passes none to predict: score with scoring=None, or use time='column'"
        )
    step = checked_steps(dt, n_rows)
    if n_rows and not np.isinf(step[0]):
        raise InputError(
            f"dt: the first row comes {step[0]:g} s after another, and its test must start with inf. Its start was "
            f"left out: {_WHOLE}; {_OURS}"
        )
    if not hasattr(dt, "index") and get_config()["enable_metadata_routing"]:
        raise InputError(f"{name}: give dt as a pandas Series, pd.Series(dt): its index shows rows that were left out")
    _refuse_holes(getattr(dt, "index", None), np.isinf(step))
    return step


def _refuse_holes(index: Any, starts: NDArray[np.bool_]) -> None:
    """Refuse rows that are no longer adjacent; labels that are not integers are not checked."""
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
            f"rows are missing between index {labels[row - 1]} and {labels[row]}: {_WHOLE}; {_OURS}. "
            "If these rows never existed: reset_index(drop=True)"
        )
