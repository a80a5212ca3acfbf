"""Common base of all estimators: the contract of scikit-learn and `freeze`."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.utils.validation import check_is_fitted, validate_data

from thermocomp.core.exceptions import FitError, InputError
from thermocomp.core.inputs import Input, Support
from thermocomp.core.model import ErrorModel
from thermocomp.core.provenance import Provenance
from thermocomp.models.numerics.folds import number_folds

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


class ThermalRegressor(RegressorMixin, BaseEstimator, ABC):
    """A regressor that freezes into plain numbers.

    The columns of X are the inputs minus their reference ("change"). `fit` leaves the trained range behind, as
    ``data_min_`` and ``data_max_`` of shape (n_features,).
    """

    freezable: ClassVar[bool] = True  #: False: can be compared, not deployed; see `thermocomp.models.unfrozen`

    def freeze(
        self,
        *,
        target: str,
        unit: str = "um",
        inputs: Sequence[Input] | None = None,
        support: Support = Support(),
        provenance: Provenance | None = None,
    ) -> ErrorModel:
        """Return the fitted model as plain numbers, without the inputs it has no use for.

        A sensor that was not selected may die without a consequence.

        Parameters
        ----------
        target : str
            Displacement channel (or error component) it predicts.
        unit : str
            Unit of the deviation it gives.
        inputs : sequence of Input, optional
            One per feature. Without it they are made from the training data: named like the features, without unit,
            with reference 0 and the range seen in `fit`.
        support : Support
            Behaviour of the model outside its training range.
        provenance : Provenance, optional
            Origin of the model.

        Returns
        -------
        ErrorModel

        Raises
        ------
        InputError
            `inputs` are not as many as the features.
        FitError
            The method cannot be frozen; see `freezable`.
        """
        return self._frozen(
            self._inputs(inputs), {"target": target, "unit": unit, "support": support, "provenance": provenance}
        )

    @abstractmethod
    def _frozen(self, inputs: Sequence[Input], header: dict[str, Any]) -> ErrorModel:
        """Build the model of the method's family; `header` holds what is the same for all families."""

    def _names(self) -> tuple[str, ...]:
        """Return the names of the features: those of the table given to `fit`, else x0, x1, ..."""
        return tuple(getattr(self, "feature_names_in_", [f"x{i}" for i in range(self.n_features_in_)]))

    def _inputs(self, inputs: Sequence[Input] | None) -> tuple[Input, ...]:
        """Return the inputs of the frozen model: those given, else made from the training data."""
        check_is_fitted(self)
        names = self._names()
        if inputs is None:
            return tuple(
                Input(name, "dimensionless", "1", reference=0.0, rezero=False, low=float(low), high=float(high))
                for name, low, high in zip(names, self.data_min_, self.data_max_, strict=True)
            )
        if len(inputs) != len(names):
            raise InputError(
                f"{len(inputs)} inputs given, but the model was fitted to {len(names)}: {', '.join(names)}"
            )
        return tuple(inputs)

    # -- for the methods -----------------------------------------------------------------------------------------------

    def _read(self, X: ArrayLike, y: ArrayLike, *, multi_output: bool = False) -> tuple[FloatArray, FloatArray]:
        """Check the training data; return X by column in memory, and y."""
        change, deviation = validate_data(
            self, X, y, y_numeric=True, multi_output=multi_output, dtype=np.float64, order="F", ensure_min_samples=2
        )
        return change, np.asarray(deviation, dtype=np.float64)

    def _note_range(self, change: FloatArray) -> None:
        """Note the trained range; ten times as fast by column in memory as by row."""
        self.data_min_, self.data_max_ = change.min(axis=0), change.max(axis=0)


class MemorylessRegressor(ThermalRegressor):
    """A regressor whose output depends only on the present row."""

    def predict(self, X: ArrayLike) -> FloatArray:
        """Predict the deviation.

        Parameters
        ----------
        X : array-like of shape (n_rows, n_features)
            Inputs minus their reference.

        Returns
        -------
        ndarray of shape (n_rows,)
            A net that was fitted to several columns of y gives as many: (n_rows, n_outputs).
        """
        return self._predict(self._checked(X))

    @abstractmethod
    def _predict(self, change: FloatArray) -> FloatArray:
        """Predict for rows that were checked, (n_rows, n_features)."""

    def _checked(self, X: ArrayLike) -> FloatArray:
        """Check rows against what was fitted."""
        check_is_fitted(self)
        change: FloatArray = validate_data(self, X, dtype=np.float64, reset=False)
        return change

    def _learned(
        self, X: ArrayLike, y: ArrayLike, cycle: ArrayLike | None
    ) -> tuple[FloatArray, FloatArray, IntArray, str]:
        """Check the training data, note the range of the rows that may be learned from, and return these alone.

        Beside X and y come the fold of each row and, in words, what is left out in turn.
        """
        change, deviation = self._read(X, y)
        folds, description = number_folds(cycle, len(change))
        if folds.min() < 0:
            learned = folds >= 0
            if learned.sum() < 2:
                raise FitError("a single row to learn from: at least 2 are needed")
            # by column again: rows left out must not change a single digit
            change, deviation, folds = np.asfortranarray(change[learned]), deviation[learned], folds[learned]
        self._note_range(change)
        return change, deviation, folds, description


class StaticRegressor(MemorylessRegressor):
    """A memoryless regressor whose fit needs only X and y."""

    def fit(self, X: ArrayLike, y: ArrayLike) -> Self:
        """Fit; the class documents the additional data that a method refuses.

        Parameters
        ----------
        X : array-like of shape (n_rows, n_features)
            Inputs minus their reference, in the order of time.
        y : array-like of shape (n_rows,)
            Deviation; a net takes several columns, (n_rows, n_outputs).

        Returns
        -------
        self

        Raises
        ------
        InputError
            A setting is out of its range.
        """
        change, deviation = self._read(X, y)
        self._note_range(change)
        self._fit(change, deviation)
        return self

    @abstractmethod
    def _fit(self, change: FloatArray, deviation: FloatArray) -> None:
        """Fit to data that were checked, (n_rows, n_features) and (n_rows,)."""


class CycledRegressor(MemorylessRegressor):
    """A memoryless regressor that chooses its settings by leaving out thermal cycles.

    Attributes
    ----------
    chosen_by_ : str
        Units left out for the choice.
    """

    def fit(self, X: ArrayLike, y: ArrayLike, *, cycle: ArrayLike | None = None) -> Self:
        """Fit; the class documents the additional data that a method refuses.

        Parameters
        ----------
        X : array-like of shape (n_rows, n_features)
            Inputs minus their reference, in the order of time.
        y : array-like of shape (n_rows,)
            Deviation.
        cycle : array-like of int of shape (n_rows,), optional
            Thermal cycle of each row; rows with -1 are not learned from. Without it, five stretches of equal length
            take the place of the cycles.

        Returns
        -------
        self

        Raises
        ------
        FitError
            Fewer than two rows to learn from.
        InputError
            A setting is out of its range.
        """
        change, deviation, folds, self.chosen_by_ = self._learned(X, y, cycle)
        self._fit(change, deviation, folds)
        return self

    @abstractmethod
    def _fit(self, change: FloatArray, deviation: FloatArray, folds: IntArray) -> None:
        """Fit to data that were checked; `folds` of shape (n_rows,), 0, 1, ..., are left out in turn."""
