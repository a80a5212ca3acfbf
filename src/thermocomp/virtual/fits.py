"""Joints that open and close: concentric cylinders that expand by their own temperatures.

References
----------
M. G. Cooper, B. B. Mikic and M. M. Yovanovich, Thermal contact conductance, Int. J. Heat Mass Transfer 12 (1969) 279,
with the constants of M. M. Yovanovich, Four decades of research on thermal contact, gap, and joint resistance in
microelectronics, IEEE Trans. Compon. Packag. Technol. 28 (2005) 182. S. P. Timoshenko, Strength of Materials, part II
(Lame's rings). B. Bossmanns and J. F. Tu, A thermal model for high speed motorized spindles, Int. J. Mach. Tools Manuf.
39 (1999) 1345: the gap of a ring in its housing closes as the ring warms up.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thermocomp.virtual.statespace import REFERENCE_TEMPERATURE

FloatArray = NDArray[np.float64]

#: conductivity of air near 30 degC [W/(m K)]; temperature jump at two steel walls as a gap [um] (Yovanovich)
AIR_CONDUCTIVITY, AIR_JUMP = 0.026, 0.37


@dataclass(frozen=True)
class Fit:
    """A cylinder in a ring; friction between them resists axial slip.

    Parameters
    ----------
    radius, bore, outside : float
        Radii of the joint, the bore of the inner part (0: solid) and the outside of the outer part [mm].
    length : float
        Length of the joint [mm].
    squeeze : float
        Radial interference at 20 degC; negative: a gap [um].
    linear : float
        Conductance of the joint in the linear model [W/(m2 K)].
    expansion : tuple of float
        Thermal expansion coefficients of inner and outer part [um/(m K)].
    modulus, poisson : tuple of float
        Young's modulus [MPa] and Poisson's ratio of inner and outer part.
    behind : float
        Conductance in series, such as that of an oil film behind a sleeve [W/(m2 K)].
    friction : float
        Coulomb friction coefficient, dry steel: 0.1 to 0.2; an engineering value.
    roughness, slope : float
        Combined roughness of both surfaces, ground to Ra 0.4: rms height [um], mean slope; engineering values.
    hardness : float
        Hardness of the softer surface, 60 HRC [MPa].
    conductivity : float
        Harmonic mean of the conductivities of both parts [W/(m K)].
    """

    radius: float
    bore: float
    outside: float
    length: float
    squeeze: float
    linear: float
    expansion: tuple[float, float] = (11.6, 11.6)
    modulus: tuple[float, float] = (210e3, 210e3)
    poisson: tuple[float, float] = (0.3, 0.3)
    behind: float = math.inf
    friction: float = 0.15
    roughness: float = 0.7
    slope: float = 0.1
    hardness: float = 6500.0
    conductivity: float = 42.0

    @property
    def area(self) -> float:
        """Area of the joint [m2]."""
        return 2e-6 * math.pi * self.radius * self.length

    @property
    def compliances(self) -> tuple[float, float]:
        """Radial compliance of the inner and of the outer part of the joint to pressure (Lame) [um/MPa]."""
        r, b, o = self.radius**2, self.bore**2, self.outside**2
        inner = ((r + b) / (r - b) - self.poisson[0]) / self.modulus[0]
        outer = ((o + r) / (o - r) + self.poisson[1]) / self.modulus[1]
        return 1e3 * self.radius * inner, 1e3 * self.radius * outer

    def squeezed(self, inner: ArrayLike, outer: ArrayLike) -> FloatArray:
        """Return the radial interference at two temperatures [degC]; negative: a gap [um]."""
        grown = [
            a * (np.asarray(t) - REFERENCE_TEMPERATURE) for a, t in zip(self.expansion, (inner, outer), strict=True)
        ]
        return np.asarray(self.squeeze + 1e-3 * self.radius * (grown[0] - grown[1]), dtype=np.float64)

    def pressure(self, inner: ArrayLike, outer: ArrayLike) -> FloatArray:
        """Return the pressure in the joint at two temperatures [degC]; 0 where it is open [MPa]."""
        return np.asarray(np.maximum(0.0, self.squeezed(inner, outer)) / sum(self.compliances))

    def conductance(self, inner: float, outer: float) -> float:
        """Return the conductance at two temperatures [degC]: contact spots in parallel with the air gap [W/K]."""
        squeeze = float(self.squeezed(inner, outer))
        pressure = max(0.0, squeeze) / sum(self.compliances)
        touching = math.pow(pressure / self.hardness, 0.95)
        spots = 1.25 * self.conductivity * self.slope / (1e-6 * self.roughness) * touching
        gap = 3.0 * self.roughness + max(0.0, -squeeze)
        air = AIR_CONDUCTIVITY / (1e-6 * (gap + AIR_JUMP))
        return self.area / (1.0 / (spots + air) + 1.0 / self.behind)

    def wish(self, inner: ArrayLike, outer: ArrayLike) -> FloatArray:
        """Return the axial displacement of the inner end relative to the outer one without friction [um]."""
        own, other = (np.asarray(t) - REFERENCE_TEMPERATURE for t in (inner, outer))
        return np.asarray(5e-4 * self.length * (self.expansion[1] * other - self.expansion[0] * own))

    def hold(self, pressure: ArrayLike) -> FloatArray:
        """Return the free displacement at which the whole length of the joint slips [um]."""
        sections = (self.radius**2 - self.bore**2, self.outside**2 - self.radius**2)
        stretch = 1.0 / sum(1.0 / (e * math.pi * s) for e, s in zip(self.modulus, sections, strict=True))
        drag = 2.0 * math.pi * self.radius * self.friction * np.asarray(pressure)
        return np.asarray(1e3 * drag * self.length**2 / (8.0 * stretch))
