"""`Method`: name and summary of a modelling method, and construction of its estimator."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any, Literal

from thermocomp.models.base import ThermalRegressor


@dataclass(frozen=True)
class Method:
    """A modelling method.

    Parameters
    ----------
    name : str
        Name on the command line.
    summary : str
        One-line summary.
    estimator : str
        Module and class, such as ``package.module:Class``; imported on use, since some load a compiler.
    speed : str
        Parameter of the estimator for the names of the spindle speeds; empty if there is none.
    takes : tuple of {'dt', 'cycle'}
        Arguments of `fit` other than X and y. With ``dt`` the method has a memory and also receives the inputs of rows
        not used for training.
    settings : dict of str to object
        Parameters that differ from the estimator's defaults.
    """

    name: str
    summary: str
    estimator: str
    speed: str = ""
    takes: tuple[Literal["dt", "cycle"], ...] = ()
    settings: dict[str, Any] = field(default_factory=dict)

    @property
    def kind(self) -> type[ThermalRegressor]:
        """Class of the estimator, imported on first use."""
        module, _, name = self.estimator.partition(":")
        found: type[ThermalRegressor] = getattr(import_module(module), name)
        return found

    def build(self, speeds: Sequence[str]) -> ThermalRegressor:
        """Create the estimator for the given names of spindle speeds among its inputs."""
        columns = {self.speed: tuple(speeds)} if self.speed else {}
        return self.kind(**self.settings, **columns, **({"time": "routed"} if "dt" in self.takes else {}))
