"""Interface of a family of models; everything else is in `thermocomp.core.model.ErrorModel`."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.expression import Node


class ModelFamily(ABC):
    """Methods of a family, such as `thermocomp.core.polynomial.Polynomial`."""

    remembers: ClassVar[bool]  #: False: the deviation depends only on the current reading

    @abstractmethod
    def _check(self) -> None:
        """Raise `InputError` if the numbers are inconsistent."""

    @abstractmethod
    def _begin(self, change: FloatArray) -> FloatArray:
        """Return the memory of a machine at steady state for `change`."""

    @abstractmethod
    def _advance(self, memory: FloatArray, change: FloatArray, dt: float) -> tuple[FloatArray, FloatArray]:
        """Return (memory, deviation) `dt` seconds later, after the inputs changed to `change`."""

    def _directions(self, memory: FloatArray, change: FloatArray) -> FloatArray:  # noqa: ARG002
        """Return the principal directions in which the structures averaged by the model differ [unit].

        Shape (..., n_directions); the root of the sum of their squares is the spread of the structures.
        """
        return np.zeros((*change.shape[:-1], 0))

    @abstractmethod
    def _expression(self, change: Sequence[Node]) -> Node:
        """Return the result of `_advance` as an expression of the clipped changes of the inputs."""

    @abstractmethod
    def coefficients_by_name(self) -> dict[str, float]:
        """Return the coefficient of each term of `formula`."""

    @property
    @abstractmethod
    def sensors(self) -> tuple[str, ...]:
        """Names of the inputs that affect the deviation."""
