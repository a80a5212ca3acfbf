"""Outputs of the models: replaced by functions from the formulas of a compensator (`models.Formulas`)."""

from thermocomp.runtime.program.constants import Constants
from thermocomp.runtime.program.language import procedure
from thermocomp.runtime.program.values import Whole
from thermocomp.runtime.program.variables import Kept, Work


@procedure
def models_absolute(s: Kept, w: Work, t: Constants) -> None:
    """Compute the deviations of the models whose inputs are not relative to the start."""


@procedure
def models_rezeroed(s: Kept, w: Work, t: Constants) -> None:
    """Compute the deviations of the models whose inputs are relative to the start."""


@procedure
def tick(s: Kept, w: Work, t: Constants, c: Whole) -> None:
    """Compute a value that is updated at fixed intervals at its next tick."""
