"""Where the virtual machining centre is not linear: preload, guide and sliding foot; plausible engineering values."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Joints:
    """How the joints yield, beside the linear thermo-elastic displacements.

    Parameters
    ----------
    preload : float
        Axial shift of the shaft by thermal preload, per squared difference of shaft and housing [um/K^2].
    gib : float
        Sinking of the headstock in its guide, per squared difference of headstock and column [um/K^2].
    centrifugal, lift : float
        Shift of the shaft along Z and Y at top speed by centrifugal forces, with the square of speed [um].
    stiction : float
        How far the column's foot may want to slide on the bed before it does [um].
    """

    preload: float = 0.06
    gib: float = 0.3
    centrifugal: float = 4.0
    lift: float = -1.5
    stiction: float = 1.0

    def shaft(self, tightening: FloatArray, ratio: FloatArray) -> FloatArray:
        """Shift of the shaft towards the workpiece [um].

        Parameters
        ----------
        tightening : ndarray of shape (n_steps,)
            Shaft minus housing [K].
        ratio : ndarray of shape (n_steps,)
            Share of top speed.
        """
        result: FloatArray = self.preload * tightening * np.abs(tightening) - self.centrifugal * ratio**2
        return result

    def headstock(self, difference: FloatArray, ratio: FloatArray) -> FloatArray:
        """Lift of the spindle [um], from headstock minus column [K] and the share of top speed."""
        result: FloatArray = self.lift * ratio**2 - self.gib * difference**2
        return result


def play(slid: float, wish: FloatArray, stiction: float) -> FloatArray:
    """Return how far a part has slid that follows its wish, but for the friction that holds it.

    Parameters
    ----------
    slid : float
        Before the first step [um].
    wish : ndarray of shape (n_steps,)
        Where it would be if nothing held it [um].
    stiction : float
        How far it may want to slide before it does [um].

    Returns
    -------
    ndarray of shape (n_steps,)
    """
    result = np.empty(len(wish))
    for k, (low, high) in enumerate(zip((wish - stiction).tolist(), (wish + stiction).tolist(), strict=True)):
        slid = min(max(slid, low), high)
        result[k] = slid
    return result
