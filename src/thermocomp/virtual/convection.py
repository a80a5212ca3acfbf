"""Heat loss of surfaces to the air as a function of temperature and speed: free and forced convection, radiation.

References
----------
S. W. Churchill and H. H. S. Chu, Correlating equations for laminar and turbulent free convection from a vertical plate,
Int. J. Heat Mass Transfer 18 (1975) 1323; from a horizontal cylinder, 18 (1975) 1049. T. Fujii and H. Uehara, Laminar
natural-convective heat transfer from the outer surface of a vertical cylinder, 13 (1970) 607. K. M. Becker,
Measurements of convective heat transfer from a horizontal cylinder rotating in a tank of water, 6 (1963) 1053. S. W.
Churchill, A comprehensive correlating equation for laminar, assisting, forced and free convection, AIChE J. 23 (1977)
10. F. P. Incropera and D. P. DeWitt, Fundamentals of Heat and Mass Transfer, Tables A.4 (air) and A.11 (emissivity).
"""

from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

GRAVITY, STEFAN_BOLTZMANN, KELVIN = 9.81, 5.670e-8, 273.15


@dataclass(frozen=True)
class Face:
    """A surface cooled by air.

    Parameters
    ----------
    area : float
        [m2]
    length : float
        Height of the surface, or diameter of a horizontal cylinder [m].
    films : float
        Heat transfer coefficient of the linear model [W/(m2 K)].
    curvature : float
        Length over diameter of a vertical cylinder; 0: flat.
    lying : bool
        Cylinder with a horizontal axis, which may rotate.
    wind : float
        Forced convection from neighbouring rotating parts at top speed; proportional to speed^(2/3) [W/(m2 K)].
    films_turning : float
        Increase of `films` in the linear model at top speed [W/(m2 K)].
    """

    area: float
    length: float
    films: float
    emissivity: float
    curvature: float = 0.0
    lying: bool = False
    wind: float = 0.0
    films_turning: float = 0.0


class Faces:
    """Several surfaces, evaluated together."""

    def __init__(self, faces: Sequence[Face]) -> None:
        columns = np.array([astuple(face) for face in faces], dtype=np.float64).reshape(-1, len(fields(Face))).T
        self._area, self._length, self._films, self._emissivity, self._curvature = columns[:5]
        self._lying, self._wind, self._films_turning = columns[5:]

    def linear(self, rotation: float) -> FloatArray:
        """Return the conductances of the surfaces in the linear model [W/K]."""
        result: FloatArray = self._area * (self._films + self._films_turning * rotation)
        return result

    def conductance(self, surface: ArrayLike, air: ArrayLike, speed: float = 0.0, wind: float = 0.0) -> FloatArray:
        """Return the conductances [W/K].

        Parameters
        ----------
        surface, air : ndarray of shape (n,)
            Temperatures [degC].
        speed : float
            Speed of the horizontal rotating part [1/min].
        """
        hot, cold = (np.asarray(t, dtype=np.float64) + KELVIN for t in (surface, air))
        film = (hot + cold) / 2.0
        conductivity, viscosity, prandtl = air_at(film)
        grashof = GRAVITY * np.abs(hot - cold) / film * self._length**3 / viscosity**2
        nusselt = free_convection(grashof * prandtl, prandtl, self._lying) + 0.435 * self._curvature
        if speed:
            reynolds = self._lying * np.pi * abs(speed) / 60.0 * self._length**2 / viscosity
            nusselt = np.cbrt(nusselt**3 + rotating_convection(reynolds, prandtl) ** 3)
        radiation = self._emissivity * STEFAN_BOLTZMANN * (hot**2 + cold**2) * (hot + cold)
        result: FloatArray = self._area * (conductivity / self._length * nusselt + radiation + self._wind * wind)
        return result


def air_at(temperature: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return conductivity [W/(m K)], kinematic viscosity [m2/s] and Prandtl number of air.

    A straight line through Incropera's values at 300 and 350 K.

    Parameters
    ----------
    temperature : ndarray
        [K]
    """
    share = (temperature - 300.0) / 50.0
    return 26.3e-3 + 3.7e-3 * share, 15.89e-6 + 5.03e-6 * share, 0.707 - 0.007 * share


def free_convection(rayleigh: FloatArray, prandtl: FloatArray, lying: FloatArray) -> FloatArray:
    """Return the Nusselt numbers of vertical plates and horizontal cylinders (Churchill and Chu 1975)."""
    base, inner = np.where(lying > 0, 0.60, 0.825), np.where(lying > 0, 0.559, 0.492)
    result: FloatArray = (base + 0.387 * rayleigh ** (1 / 6) / (1.0 + (inner / prandtl) ** (9 / 16)) ** (8 / 27)) ** 2
    return result


def rotating_convection(reynolds: FloatArray, prandtl: FloatArray) -> FloatArray:
    """Return the Nusselt numbers of rotating cylinders (Becker 1963)."""
    result: FloatArray = 0.133 * reynolds ** (2 / 3) * np.cbrt(prandtl)
    return result
