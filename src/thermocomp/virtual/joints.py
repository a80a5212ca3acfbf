"""Nonlinear joints of the virtual machining centre: preload, rotating shaft, sliding foot; engineering values."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Joints:
    """Displacements of the joints, in addition to the linear thermo-elastic displacements.

    Parameters
    ----------
    preload : float
        Axial shift of the shaft by thermal preload per kelvin above the temperature of its seat; no shift if colder
        [um/K].
    centrifugal, lift : float
        Shift of the shaft along Z and Y at top speed by centrifugal forces, proportional to speed squared [um].
    stiction : float
        Free displacement of the column's foot on the bed at which it starts to slide [um].
    share : float
        Fraction of the blocked sliding that moves the tool: the column is located midway between the carriages.
    """

    preload: float = 0.4
    centrifugal: float = 1.0
    lift: float = -0.5
    stiction: float = 1.0
    share: float = 0.5

    def shaft(self, tightening: FloatArray, ratio: FloatArray) -> FloatArray:
        """Return the shift of the shaft towards the workpiece [um].

        Parameters
        ----------
        tightening : ndarray of shape (n_steps,)
            Shaft minus housing [K].
        ratio : ndarray of shape (n_steps,)
            Speed over top speed.
        """
        result: FloatArray = self.preload * np.maximum(0.0, tightening) - self.centrifugal * ratio**2
        return result


def slide_with_friction(slid: float, wish: FloatArray, stiction: float | FloatArray) -> FloatArray:
    """Return the sliding of a part that follows its free displacement against friction.

    Parameters
    ----------
    slid : float
        Sliding before the first step [um].
    wish : ndarray of shape (n_steps,)
        Free displacement without friction [um].
    stiction : float, or ndarray of shape (n_steps,)
        Free displacement at which sliding starts [um].

    Returns
    -------
    ndarray of shape (n_steps,)
    """
    result = np.empty(len(wish))
    for k, (low, high) in enumerate(zip((wish - stiction).tolist(), (wish + stiction).tolist(), strict=True)):
        slid = min(max(slid, low), high)
        result[k] = slid
    return result
