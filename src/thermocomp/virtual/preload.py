"""Bearings with temperature-dependent preload and friction: angular contact, back to back.

References
----------
T. A. Harris, Rolling Bearing Analysis, 4th ed. 2001: Palmgren's friction torques (ch. 14) and deflections (ch. 8).
J. L. Stein and J. F. Tu, A state-space model for monitoring thermally induced preload in anti-friction spindle bearings
of high-speed machine tools, J. Dyn. Syst. Meas. Control 116 (1994) 372; B. Bossmanns and J. F. Tu, A thermal model for
high speed motorized spindles, Int. J. Mach. Tools Manuf. 39 (1999) 1345: an inner ring warmer than the outer one
increases the preload, which generates heat. ASTM D341: viscosity against temperature.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

#: expansion of bearing steel [um/(m K)]
EXPANSION = 12.0


@dataclass(frozen=True)
class Grease:
    """Base oil of a spindle grease, ISO VG 22.

    Parameters
    ----------
    at_40, at_100 : float
        Kinematic viscosity at 40 and 100 degC [mm2/s].
    """

    at_40: float = 22.0
    at_100: float = 4.3

    def viscosity(self, temperature: float) -> float:
        """Return the kinematic viscosity at a temperature [degC] according to ASTM D341 (Walther) [mm2/s]."""
        low, high = (math.log10(math.log10(v + 0.7)) for v in (self.at_40, self.at_100))
        slope = (high - low) / math.log10(373.15 / 313.15)
        return float(10.0**10.0 ** (low + slope * math.log10((temperature + 273.15) / 313.15)) - 0.7)


@dataclass(frozen=True)
class AngularContact:
    """A set of angular contact bearings: `pair` of them take the load towards the machine, one the opposite load.

    Parameters
    ----------
    pitch, ball : float
        Diameters [mm].
    balls : int
        Number of balls per bearing.
    static : float
        Basic static load rating of one bearing [N].
    preload : float
        Axial preload at 20 degC [N].
    pair : int
        Number of bearings in tandem, against a single one.
    angle : float
        Contact angle [degrees].
    spread : float
        Length of rings between the two sides; a longer inner ring reduces the preload of a back-to-back set [mm].
    sprung : bool
        Whether springs keep the preload constant at any temperature.
    drag : float
        Palmgren's factor f0 for grease.
    """

    pitch: float
    ball: float
    balls: int
    static: float
    preload: float
    pair: int = 2
    angle: float = 25.0
    spread: float = 30.0
    sprung: bool = False
    grease: Grease = Grease()
    drag: float = 2.0

    @property
    def _unlike(self) -> float:
        """Ratio of the deflection of the single bearing to that of each bearing of the pair, which share its load."""
        return math.pow(self.pair, 2 / 3)

    @property
    def mounted(self) -> float:
        """Mean approach of balls and rings under the preload at 20 degC, normal to the contact (Palmgren) [um]."""
        load = self.preload / (self.balls * math.sin(math.radians(self.angle)))
        single = 0.436 * math.pow(load**2 / self.ball, 1 / 3)
        return single * (1.0 + 1.0 / self._unlike) / 2.0

    def approach(self, inner: ArrayLike, outer: ArrayLike, pressed: ArrayLike = 0.0) -> FloatArray:
        """Return the mean approach at the temperatures of both rings [degC]; 0: no preload left [um].

        Parameters
        ----------
        inner, outer : array-like
            [degC]
        pressed : array-like
            Contraction of the outer raceway by the housing [um].
        """
        if self.sprung:
            return np.full(np.broadcast(inner, outer, pressed).shape, self.mounted)
        warmer, angle = np.asarray(inner) - np.asarray(outer), math.radians(self.angle)
        radial = 5e-4 * self.pitch * EXPANSION * warmer + np.asarray(pressed)
        axial = 5e-4 * self.spread * EXPANSION * warmer
        return np.asarray(np.maximum(0.0, self.mounted + radial * math.cos(angle) - axial * math.sin(angle)))

    def force(self, approach: float) -> float:
        """Return the axial preload at a mean approach [um]: Hertz, power 3/2 [N]."""
        return self.preload * math.pow(approach / self.mounted, 1.5)

    def shift(self, approach: ArrayLike) -> FloatArray:
        """Return the displacement of the shaft since 20 degC: the pair is stiffer than the single bearing [um]."""
        lean = (self._unlike - 1.0) / (self._unlike + 1.0) / math.sin(math.radians(self.angle))
        return np.asarray(lean * (np.asarray(approach) - self.mounted))

    def heat(self, speed: float, temperature: float, approach: float) -> float:
        """Return the heat of the whole set according to Palmgren: viscous torque plus load torque of each bearing [W].

        Parameters
        ----------
        speed : float
            [1/min]
        temperature : float
            Temperature of the grease [degC].
        approach : float
            See `approach` [um].
        """
        n, force = abs(speed), self.force(approach)
        flow = max(2000.0, self.grease.viscosity(temperature) * n)
        viscous = (self.pair + 1) * 1e-7 * self.drag * flow ** (2 / 3) * self.pitch**3
        loads = [force] + [force / self.pair] * self.pair
        lever = 0.9 / math.tan(math.radians(self.angle)) * self.pitch
        loaded = sum(1e-3 * (f / self.static) ** 0.33 * f * lever for f in loads)
        return float((viscous + loaded) * 1e-3 * math.pi * n / 30.0)
