"""Common base of all estimators: the scikit-learn interface and `freeze`."""

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


def plain_inputs(names: Sequence[str], low: FloatArray, high: FloatArray) -> tuple[Input, ...]:
    """Return inputs of which only names and trained ranges are known."""
    return tuple(
        Input(name, "dimensionless", "1", reference=0.0, rezero=False, low=a, high=b)
        for name, a, b in zip(names, low.tolist(), high.tolist(), strict=True)
    )


class ThermalRegressor(RegressorMixin, BaseEstimator, ABC):
    """A regressor that can be frozen into plain numbers.

    The columns of X are the inputs minus their reference ("change"). `fit` sets the trained range as ``data_min_`` and
    ``data_max_`` of shape (n_features,).
    """

    freezable: ClassVar[bool] = True  #: False: comparison only, no deployment; see `thermocomp.models.unfrozen`

    def freeze(
        self,
        *,
        target: str,
        unit: str = "um",
        inputs: Sequence[Input] | None = None,
        support: Support = Support(),
        provenance: Provenance | None = None,
    ) -> ErrorModel:
        """Return the fitted model as plain numbers, without unused inputs.

        Failure of a sensor that was not selected therefore does not affect the model.

        Parameters
        ----------
        target : str
            Displacement channel (or error component) that the model predicts.
        unit : str
            Unit of the predicted deviation.
        inputs : sequence of Input, optional
            One per feature. Default: created from the training data, with the names of the features, no unit, reference
            0 and the trained range.
        support : Support
            Behaviour of the model outside its trained range.
        provenance : Provenance, optional
            Origin of the model.

        Returns
        -------
        ErrorModel

        Raises
        ------
        InputError
            The number of `inputs` differs from the number of features.
        FitError
            The method cannot be frozen; see `freezable`.
        """
        return self._frozen(
            self._inputs(inputs), {"target": target, "unit": unit, "support": support, "provenance": provenance}
        )

    @abstractmethod
    def _frozen(self, inputs: Sequence[Input], header: dict[str, Any]) -> ErrorModel:
        """Build the model of the method's family; `header` contains the fields common to all families."""

    def _names(self) -> tuple[str, ...]:
        """Return the names of the features: those of the table given to `fit`, else x0, x1, ..."""
        return tuple(getattr(self, "feature_names_in_", [f"x{i}" for i in range(self.n_features_in_)]))

    def _inputs(self, inputs: Sequence[Input] | None) -> tuple[Input, ...]:
        """Return the inputs of the frozen model: as given, or created from the training data."""
        check_is_fitted(self)
        names = self._names()
        if inputs is None:
            return plain_inputs(names, self.data_min_, self.data_max_)
        if len(inputs) != len(names):
            raise InputError(
                f"{len(inputs)} inputs given, but the model was fitted to {len(names)}: {', '.join(names)}"
            )
        return tuple(inputs)

    # -- for the methods -----------------------------------------------------------------------------------------------

    def _read(self, X: ArrayLike, y: ArrayLike, *, multi_output: bool = False) -> tuple[FloatArray, FloatArray]:
        """Check the training data; return X (column-major) and y."""
        change, deviation = validate_data(
            self, X, y, y_numeric=True, multi_output=multi_output, dtype=np.float64, order="F", ensure_min_samples=2
        )
        return change, np.asarray(deviation, dtype=np.float64)

    def _note_range(self, change: FloatArray) -> None:
        """Store the trained range; column-major data is ten times as fast as row-major."""
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
            For a net that was fitted to several columns of y: (n_rows, n_outputs).
        """
        return self._predict(self._checked(X))

    @abstractmethod
    def _predict(self, change: FloatArray) -> FloatArray:
        """Return the prediction for validated rows, (n_rows, n_features)."""

    def _checked(self, X: ArrayLike) -> FloatArray:
        """Validate rows: their features must be those of the fit."""
        check_is_fitted(self)
        change: FloatArray = validate_data(self, X, dtype=np.float64, reset=False)
        return change

    def _learned(
        self, X: ArrayLike, y: ArrayLike, cycle: ArrayLike | None
    ) -> tuple[FloatArray, FloatArray, IntArray, str]:
        """Check the training data, store the range of the training rows, and return only these rows.

        Also return the fold of each row and a text that describes what is left out in turn.
        """
        change, deviation = self._read(X, y)
        folds, description = number_folds(cycle, len(change))
        if folds.min() < 0:
            learned = folds >= 0
            if learned.sum() < 2:
                raise FitError("only one training row; at least 2 are required")
            # column-major again: rows that are left out must not change a single digit
            change, deviation, folds = np.asfortranarray(change[learned]), deviation[learned], folds[learned]
        self._note_range(change)
        return change, deviation, folds, description


class StaticRegressor(MemorylessRegressor):
    """A memoryless regressor whose fit needs only X and y."""

    def fit(self, X: ArrayLike, y: ArrayLike) -> Self:
        """Fit the model; see the class for cases in which a method rejects the data.

        Parameters
        ----------
        X : array-like of shape (n_rows, n_features)
            Inputs minus their reference, in chronological order.
        y : array-like of shape (n_rows,)
            Deviation; a net accepts several columns, (n_rows, n_outputs).

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
        """Fit to validated data, (n_rows, n_features) and (n_rows,)."""


class CycledRegressor(MemorylessRegressor):
    """A memoryless regressor that chooses its settings by cross-validation over thermal cycles.

    Attributes
    ----------
    chosen_by_ : str
        Description of the cross-validation folds.
    """

    def fit(self, X: ArrayLike, y: ArrayLike, *, cycle: ArrayLike | None = None) -> Self:
        """Fit the model; see the class for cases in which a method rejects the data.

        Parameters
        ----------
        X : array-like of shape (n_rows, n_features)
            Inputs minus their reference, in chronological order.
        y : array-like of shape (n_rows,)
            Deviation.
        cycle : array-like of int of shape (n_rows,), optional
            Thermal cycle of each row; rows with -1 are not used for training. Default: five blocks of equal length
            replace the cycles.

        Returns
        -------
        self

        Raises
        ------
        FitError
            Fewer than two training rows.
        InputError
            A setting is out of its range.
        """
        change, deviation, folds, self.chosen_by_ = self._learned(X, y, cycle)
        self._fit(change, deviation, folds)
        return self

    @abstractmethod
    def _fit(self, change: FloatArray, deviation: FloatArray, folds: IntArray) -> None:
        """Fit to validated data; `folds` of shape (n_rows,), numbered 0, 1, ..., are left out in turn."""
