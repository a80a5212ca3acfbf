"""Cold geometry of the virtual machining centre: errors of its axes at 20 degC.

A machine of the usual class (ISO 10791-2, ISO 10791-4): positioning within 5 to 27 um, straightness 3 to 8 um, angles
10 to 40 urad, squareness 14 to 21 urad. Engineering values, except for the positioning of Y, which is Chen's. All
errors are relative to `thermocomp.virtual.axes.TEST_POSITION`, the workpiece zero, where they vanish.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thermocomp.virtual.axes import TEST_POSITION

FloatArray = NDArray[np.float64]

#: cold positioning error of Y in mm as a polynomial of y in mm: Chen 1996, Eq. 6 (C-22), constant term first
CHEN_COLD_PROFILE = (2.424e-4, 3.096e-4, -3.571e-6, 1.474e-8, -2.662e-11, 1.738e-14)


def cold_profile(position: ArrayLike) -> FloatArray:
    """Return the geometric positioning error of Y according to Chen [um] at a position [mm]."""
    p = np.asarray(position, dtype=np.float64)
    return np.asarray(1e3 * sum(c * p**k for k, c in enumerate(CHEN_COLD_PROFILE)))


@dataclass(frozen=True)
class Wave:
    """A cold profile: a polynomial plus a sine wave.

    Parameters
    ----------
    slope, curvature, cubic : float
        Coefficients of u, u^2, u^3 [um, urad]; u is the distance from the middle of the travel divided by 300 mm.
    amplitude : float
        Amplitude of the sine wave [um, urad].
    length : float
        Wavelength [mm].
    """

    slope: float = 0.0
    curvature: float = 0.0
    cubic: float = 0.0
    amplitude: float = 0.0
    length: float = 500.0

    def __call__(self, position: FloatArray, middle: float) -> FloatArray:
        """Return the values at positions [mm]; zero at the middle."""
        away = position - middle
        u = away / _HALF
        wave = np.sin(2.0 * np.pi * away / self.length)
        value: FloatArray = ((self.cubic * u + self.curvature) * u + self.slope) * u + self.amplitude * wave
        return value


_HALF = 300.0
#: profiles by ISO 230-1 code; EYY is given by `cold_profile`
PROFILES: dict[str, Wave] = {
    "EXX": Wave(slope=8.0, cubic=-3.0, amplitude=1.5, length=460.0),
    "EYX": Wave(curvature=-2.5, amplitude=0.8, length=520.0),
    "EZX": Wave(curvature=3.0, cubic=1.0, amplitude=1.0, length=430.0),
    "EAX": Wave(slope=9.0, amplitude=3.0, length=480.0),
    "EBX": Wave(slope=-12.0, curvature=4.0, amplitude=2.0, length=450.0),
    "ECX": Wave(slope=-14.0, cubic=3.0, amplitude=3.0, length=500.0),
    "EXY": Wave(curvature=4.0, amplitude=1.0, length=440.0),
    "EZY": Wave(slope=1.0, curvature=-3.0, amplitude=0.9, length=510.0),
    "EAY": Wave(slope=-8.0, curvature=3.0, amplitude=2.0, length=470.0),
    "EBY": Wave(slope=8.0, amplitude=2.5, length=420.0),
    "ECY": Wave(slope=7.0, curvature=-4.0, amplitude=2.0, length=490.0),
    "EXZ": Wave(curvature=-3.2, cubic=1.5, amplitude=1.0, length=450.0),
    "EYZ": Wave(slope=-1.0, curvature=3.5, amplitude=1.1, length=500.0),
    "EZZ": Wave(slope=-6.0, curvature=2.0, amplitude=1.4, length=480.0),
    "EAZ": Wave(slope=15.0, curvature=-5.0, amplitude=3.0, length=520.0),
    "EBZ": Wave(slope=-9.0, cubic=2.0, amplitude=2.0, length=440.0),
    "ECZ": Wave(slope=5.0, curvature=4.0, amplitude=2.0, length=460.0),
}
#: squareness errors by code [urad]
SQUARENESS = {"C0Y": 14.0, "B0Z": -21.0, "A0Z": 17.0}
#: The weight of the column bends the bed (C-06): with Z at the front, near the X guides, these sag in the middle. Value
#: at half of the travel of Z from the test position, at an end of the travel of X [um].
SAG = 2.0


def find_cold_component(code: str, points: FloatArray) -> FloatArray:
    """Return a component of an axis of the cold machine.

    Parameters
    ----------
    points : ndarray of shape (..., 3)
        Positions of X, Y and Z [mm]. Each component depends only on its own axis, except EYX, which also depends on Z.

    Returns
    -------
    ndarray of shape (...,)
        [um] or [urad]
    """
    axis = code[2].lower()
    own, middle = points[..., "xyz".index(axis)], float(TEST_POSITION[axis])
    if code == "EYY":
        return cold_profile(own) - cold_profile(middle)
    value = PROFILES[code](own, middle)
    if code == "EYX":
        value = value - SAG * ((own - middle) / _HALF) ** 2 * (points[..., 2] - TEST_POSITION["z"]) / _HALF
    return value
