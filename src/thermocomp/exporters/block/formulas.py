"""What the models say: written from their formulas (`thermocomp.exporters.cexpression`); nothing runs here."""

from thermocomp.exporters.block.names import Names


def models_absolute(s: Names, w: Names, t: Names) -> None:
    """Work out the deviations of the models that count from nothing."""


def models_rezeroed(s: Names, w: Names, t: Names) -> None:
    """Work out the deviations of the models that count from the start."""
