"""Methods that cannot be frozen: for comparison with other methods, never deployed."""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from pickle import PicklingError
from typing import Any, ClassVar, NoReturn, Self

import joblib
import numpy as np
from sklearn.utils.validation import check_is_fitted

from thermocomp.core.exceptions import FitError, InputError
from thermocomp.core.expression import Node
from thermocomp.core.inputs import Input
from thermocomp.core.layers import Layers
from thermocomp.core.model import ErrorModel
from thermocomp.models.base import FloatArray, StaticRegressor


class UnfrozenRegressor(StaticRegressor):
    """A regressor that cannot be frozen; `unfrozen` returns a substitute for replay in a comparison."""

    freezable: ClassVar[bool] = False
    name: ClassVar[str]  #: name of the method

    @abstractmethod
    def _bulk(self) -> str:
        """Return the reason why the regressor cannot be frozen, as text."""

    def unfrozen(self, *, inputs: Sequence[Input] | None = None, **header: Any) -> "EstimatorModel":
        """Wrap the fitted estimator as a model for replay and validation only: not saved, exported or run live."""
        given = self._inputs(inputs)
        try:
            fingerprint = str(joblib.hash(self))
        except PicklingError:  # class defined inside a function: use its predictions instead
            made = self._predict(np.array([self.data_min_, (self.data_min_ + self.data_max_) / 2, self.data_max_]))
            fingerprint = str(joblib.hash((self.name, self.data_min_, self.data_max_, made)))
        return EstimatorModel(
            **{"unit": "um", **header},
            inputs=given,
            estimator=self,
            fingerprint=fingerprint,
        )

    def _frozen(self, inputs: Sequence[Input], header: dict[str, Any]) -> NoReturn:  # noqa: ARG002 - always raises
        raise FitError(
            f"{self.name} cannot be stored as coefficients: {self._bulk()}; use it only in compare, and deploy "
            "another method"
        )


@dataclass(frozen=True, kw_only=True)
class EstimatorModel(ErrorModel):
    """A fitted estimator that is replayed like a frozen model; it cannot be saved to a file.

    Parameters
    ----------
    family : str
        Name of the family, not used in any file.
    estimator : UnfrozenRegressor
        Fitted estimator.
    fingerprint : str
        Hash of its numbers, used to compare two models.
    """

    family: str = "estimator"
    estimator: UnfrozenRegressor = field(compare=False)
    fingerprint: str

    def _check(self) -> None:
        check_is_fitted(self.estimator)

    def layers_with(self, further: Sequence[Node] = ()) -> Layers:  # noqa: ARG002 - an estimator is no expression
        """Return an object that evaluates the estimator instead of compiled expressions."""
        return _Estimated(self)

    def merged(self) -> Self:
        """Return this model: an estimator has no lags."""
        return self

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of all inputs, since the estimator uses all of them."""
        return tuple(i.name for i in self.inputs)

    def coefficients_by_name(self) -> dict[str, float]:
        """Return an empty dict, since there are no coefficients."""
        return {}

    def _expression(self, change: Sequence[Node]) -> NoReturn:  # noqa: ARG002 - always raises
        raise InputError(f"{self.estimator.name} has no formula, so it cannot be exported; export another method")

    def formula(self) -> str:
        """Return a description of the model in one line of text."""
        return f"{self.estimator.name} of {', '.join(self.sensors)}: no formula"


class _Estimated(Layers):
    """Evaluates an estimator instead of compiled expressions."""

    def __init__(self, model: EstimatorModel) -> None:
        super().__init__([], len(model.inputs))
        self._model = model

    def advance(self, memory: FloatArray, change: FloatArray, dt: float) -> tuple[FloatArray, FloatArray]:  # noqa: ARG002
        rows = change.reshape(-1, change.shape[-1])
        return memory, self._model.estimator._predict(rows).reshape(*change.shape[:-1], 1)

    def run(self, memory: FloatArray, changes: FloatArray, steps: FloatArray) -> tuple[FloatArray, FloatArray]:  # noqa: ARG002
        return self.advance(memory, changes, 0.0)
