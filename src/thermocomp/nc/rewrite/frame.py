"""Conversion of corrections between machine axes and words of a program."""

import math
from dataclasses import dataclass

from thermocomp.nc.interpreter.block import Modal
from thermocomp.nc.rewrite.text import Digits

Vector = tuple[float, float, float]

_MM = 1e-3  # mm per um


@dataclass(frozen=True)
class Frame:
    """Conversion of a tool shift [um, machine axes] into words of X, Y and Z, under one modal state.

    Parameters
    ----------
    scale : tuple of float
        Program units per um, of X, Y and Z.
    cosine, sine : float
        Cosine and sine of the rotation of the work coordinate system about Z.
    digits : int
        Number of decimals.
    """

    scale: Vector
    cosine: float
    sine: float
    digits: int

    @classmethod
    def of(cls, modal: Modal, digits: Digits) -> "Frame":
        """Return the frame of a modal state."""
        unit = _MM / 25.4 if modal.inch else _MM
        turned = math.radians(modal.rotation)
        scale = (2 * unit if modal.diameter else unit, unit, unit)
        return cls(scale, math.cos(turned), math.sin(turned), digits.of(modal.inch))

    @property
    def turned(self) -> bool:
        """Whether X and Y of the program differ in direction from those of the machine."""
        return self.sine != 0 or self.cosine != 1

    def words(self, shift: Vector) -> Vector:
        """Return the amounts that a shift [um, machine axes] adds to absolute words, rounded to the decimals."""
        x, y, z = shift
        if self.turned:
            x, y = self.cosine * x + self.sine * y, self.cosine * y - self.sine * x
        digits = self.digits
        a, b, c = self.scale
        return round(a * x, digits) + 0.0, round(b * y, digits) + 0.0, round(c * z, digits) + 0.0

    def shift(self, words: Vector) -> Vector:
        """Return the shift [um, machine axes] for given amounts added to words."""
        x, y, z = (w / s for w, s in zip(words, self.scale, strict=True))
        if self.turned:
            x, y = self.cosine * x - self.sine * y, self.cosine * y + self.sine * x
        return x, y, z
