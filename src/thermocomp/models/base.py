"""What all estimators of the training wing share: scikit-learn's contract and `freeze`."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar

from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.utils.validation import check_is_fitted

from thermocomp.core.exceptions import InputError
from thermocomp.core.model import ErrorModel, Input, Provenance, Support


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
            What the model does outside its trained range.
        provenance : Provenance, optional
            Where it comes from.

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
