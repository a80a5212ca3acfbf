"""Outputs of the models: replaced by functions from the formulas of a compensator (`models.Formulas`)."""

from thermocomp.runtime.program.language import procedure
from thermocomp.runtime.program.values import Whole
from thermocomp.runtime.program.variables import State, Tables, Work


@procedure
def models_absolute(s: State, w: Work, t: Tables) -> None:
    """Compute the deviations of the models without inputs relative to the start."""


@procedure
def models_rezeroed(s: State, w: Work, t: Tables) -> None:
    """Compute the deviations of the models with inputs relative to the start."""


@procedure
def tick(s: State, w: Work, t: Tables, c: Whole) -> None:
    """Compute a value with a separate clock at its next tick."""
