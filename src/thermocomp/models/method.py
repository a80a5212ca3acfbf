"""A method: its name, what it is, and how its estimator is made."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any, Literal

from thermocomp.models.base import ThermalRegressor


@dataclass(frozen=True)
class Method:
    """A way to get a model.

    Parameters
    ----------
    name : str
        On the command line.
    summary : str
        One line.
    estimator : str
        Module and class, such as ``package.module:Class``; imported when it is built, for some bring a compiler along.
    speed : str
        Its parameter that takes the names of the spindle speeds; empty for a method that has no use for them.
    takes : tuple of {'dt', 'cycle'}
        Arguments of `fit` other than X and y. With ``dt`` it has a memory, and also gets rows not used for training.
    settings : dict of str to object
        Other parameters than the estimator's own defaults.
    """

    name: str
    summary: str
    estimator: str
    speed: str = ""
    takes: tuple[Literal["dt", "cycle"], ...] = ()
    settings: dict[str, Any] = field(default_factory=dict)

    @property
    def kind(self) -> type[ThermalRegressor]:
        """Class of the estimator."""
        module, _, name = self.estimator.partition(":")
        found: type[ThermalRegressor] = getattr(import_module(module), name)
        return found

    def build(self, speeds: Sequence[str]) -> ThermalRegressor:
        """Make the estimator, given the names of the spindle speeds among its inputs."""
        columns = {self.speed: tuple(speeds)} if self.speed else {}
        return self.kind(**self.settings, **columns, **({"time": "routed"} if "dt" in self.takes else {}))
