"""Outputs of the models: generated from their formulas (`thermocomp.export.block.models`); nothing runs here."""

from thermocomp.export.block.names import Names


def models_absolute(s: Names, w: Names, t: Names) -> None:
    """Work out the deviations of the models that count from nothing."""


def models_rezeroed(s: Names, w: Names, t: Names) -> None:
    """Work out the deviations of the models that count from the start."""


def tick(s: Names, w: Names, t: Names, c: int) -> None:
    """Compute a value with a separate clock at its next tick.

    Parameters
    ----------
    s, w, t : Names
        Variables that are kept, worked out again, and known.
    c : int
        Index of the clock.
    """
