"""Bands from the errors on thermal cycles that were left out of the training, one after the other."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from thermocomp.core.band import Band

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

#: share of the rows of unseen cycles that a band is to hold
LEVEL = 0.9
#: cycles from which on a band is distribution-free: with fewer, the quantile of so many cycles is beyond all of them
CONFORMAL = 9


def find_band(
    residual: FloatArray,
    cycle: IntArray,
    turning: BoolArray,
    distance: FloatArray,
    speeds: Sequence[int] = (),
    level: float = LEVEL,
) -> Band | None:
    """Return the band of a model by the errors on its training's cycles, each left out.

    The error's size differs between run and stop, and grows in proportion to the distance from what was covered. Two
    sources of doubt widen it: a cycle errs as a whole, so n cycles say of its size what n independent numbers do
    (Student's t with n degrees of freedom, and one cycle more to come). From `CONFORMAL` cycles on nothing is assumed
    but that the cycles could have come in any order: the quantile of the errors, each cycle counting the same and one
    more, unknown, beside them.

    Parameters
    ----------
    residual : ndarray of shape (n_rows,)
        Error on rows whose cycle the model had not seen [unit].
    cycle : ndarray of int of shape (n_rows,)
    turning : ndarray of bool of shape (n_rows,)
        The spindle turns.
    distance : ndarray of shape (n_rows,)
        From what the other cycles cover, see `thermocomp.core.joint.JointSupport`.
    speeds : sequence of int
        Inputs that will say whether it turns.
    level : float

    Returns
    -------
    Band or None
        None with fewer than two cycles: nothing is known of an unseen one.

    References
    ----------
    Dunn, R., Wasserman, L., Ramdas, A.: Distribution-free prediction sets for two-layer hierarchical models. Journal of
    the American Statistical Association 118(544), 2023, 2491-2502. doi:10.1080/01621459.2022.2060112
    """
    labels = np.unique(cycle)
    n = len(labels)
    if n < 2:
        return None
    own = residual / np.maximum(1.0, distance)
    sizes = _sizes(own, cycle, turning)
    basis: Literal["assumption", "conformal"] = "conformal" if n >= CONFORMAL else "assumption"
    if basis == "conformal":
        scores = np.abs(own) / np.where(turning, sizes[1], sizes[0])
        weights = np.concatenate([np.full(int((cycle == c).sum()), 1 / (cycle == c).sum()) for c in labels]) / (n + 1)
        order = np.argsort(scores := np.concatenate([scores[cycle == c] for c in labels]))
        reached = np.cumsum(weights[order])
        factor = float(scores[order][min(int(np.searchsorted(reached, level - 1e-9)), len(order) - 1)])
    else:
        factor = float(stats.t.ppf(0.5 + level / 2, n) * np.sqrt(1 + 1 / n))
    return Band(level, basis, n, factor * sizes[1], factor * sizes[0], tuple(speeds))


def _sizes(residual: FloatArray, cycle: IntArray, turning: BoolArray) -> tuple[float, float]:
    """Return the size of the error in stops and in runs: root mean square, every cycle counting the same.

    Each is drawn towards that of both, which weighs as much as one cycle more.
    """
    both = np.mean([np.mean(residual[cycle == c] ** 2) for c in np.unique(cycle)])
    found = []
    for phase in (~turning, turning):
        squares = [np.mean(residual[rows] ** 2) for c in np.unique(cycle) if (rows := phase & (cycle == c)).any()]
        found.append(float(np.sqrt((sum(squares) + both) / (len(squares) + 1))))
    return max(found[0], np.finfo(np.float64).tiny), max(found[1], np.finfo(np.float64).tiny)
