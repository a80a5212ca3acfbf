"""Linear axes of the virtual machining centre, shared by finite elements, heat and instruments."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

#: names of the linear axes
AXES = ("x", "y", "z")
#: travel, from 0 [mm]
TRAVEL = {"x": 600.0, "y": 550.0, "z": 600.0}
#: where the deviations x, y, z of the tool point hold; the axes' own positioning comes on top elsewhere [mm]
TEST_POSITION = {"x": 300, "y": 250, "z": 300}
#: from the spindle's gauge point, its nose, to the tip of the test bar, which is the tool point [mm]
TEST_BAR = (0.0, 0.0, -150.0)
#: positions at which the machine tells the positioning of each axis [mm]
STATIONS = {"x": tuple(range(0, 601, 100)), "y": tuple(range(0, 551, 50)), "z": tuple(range(0, 601, 100))}
#: hat functions along each screw that take the heat of its nut
N_HATS = 7


def weigh_stations(axis: str, positions: ArrayLike) -> FloatArray:
    """Return the weights of an axis' stations in what is between them: cubic pieces with a continuous slope.

    Parameters
    ----------
    axis : {'x', 'y', 'z'}
    positions : array-like of shape (n,)
        [mm]; beyond the travel the value at its end holds.

    Returns
    -------
    ndarray of shape (n, n_stations)
        Rows that sum to 1. Hermite pieces with slopes by differences of second order: parabolas are met exactly.
    """
    at = np.asarray(STATIONS[axis], dtype=np.float64)
    p = np.clip(np.asarray(positions, dtype=np.float64), at[0], at[-1])
    k = np.clip(np.searchsorted(at, p, side="right") - 1, 0, len(at) - 2)
    unit = np.eye(len(at))
    slope = np.gradient(unit, at, axis=0, edge_order=2)
    step = (at[k + 1] - at[k])[:, None]
    u = (p - at[k])[:, None] / step
    low, high = (1.0 + 2.0 * u) * (1.0 - u) ** 2, u**2 * (3.0 - 2.0 * u)
    rise, fall = u * (1.0 - u) ** 2, u**2 * (u - 1.0)
    return np.asarray(low * unit[k] + high * unit[k + 1] + step * (rise * slope[k] + fall * slope[k + 1]))
