"""Interface of a family of models; everything else is in `thermocomp.core.model.ErrorModel`."""

from abc import ABC, abstractmethod
from collections.abc import Sequence

from thermocomp.core.expression import Node


class ModelFamily(ABC):
    """Methods of a family, such as `thermocomp.core.polynomial.Polynomial`."""

    @abstractmethod
    def _check(self) -> None:
        """Raise `InputError` if the parameters of the model are inconsistent."""

    @abstractmethod
    def _expression(self, change: Sequence[Node]) -> Node:
        """Return the deviation as an expression of the clipped changes of the inputs."""

    def spread_expressions(self, change: Sequence[Node]) -> Sequence[Node]:  # noqa: ARG002 - of a model that is no average
        """Return the principal directions in which the regressions averaged by the model differ, as expressions.

        The root of the sum of their squares is the spread of the averaged regressions [unit].
        """
        return ()

    def _order_memory(self, change: Sequence[Node]) -> Sequence[Node]:  # noqa: ARG002 - in the order of the expression
        """Return the lags in the order in which the memory stores them; empty: in the order of their first use."""
        return ()

    @abstractmethod
    def coefficients_by_name(self) -> dict[str, float]:
        """Return the coefficient of each term in `formula`, by its name."""

    @property
    @abstractmethod
    def sensors(self) -> tuple[str, ...]:
        """Names of the inputs that affect the deviation."""
