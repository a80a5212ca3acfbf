"""Linear axes of the virtual machining centre, shared by finite elements, heat and instruments."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

#: names of the linear axes
AXES = ("x", "y", "z")
#: travel, from 0 [mm]
TRAVEL = {"x": 600.0, "y": 550.0, "z": 600.0}
#: axis positions to which the tool-point deviations x, y, z apply; elsewhere the axes' positioning errors add [mm]
TEST_POSITION = {"x": 300, "y": 250, "z": 300}
#: from the gauge point at the spindle nose to the tip of the test bar, which is the tool point [mm]
TEST_BAR = (0.0, 0.0, -150.0)
#: stations at which the machine model outputs the positioning error of each axis [mm]
STATIONS = {"x": tuple(range(0, 601, 100)), "y": tuple(range(0, 551, 50)), "z": tuple(range(0, 601, 100))}
#: number of hat functions that distribute the heat of the nut along each screw
N_HATS = 7


def weigh_stations(axis: str, positions: ArrayLike) -> FloatArray:
    """Return the interpolation weights of an axis' stations: cubic pieces with a continuous slope.

    Parameters
    ----------
    positions : array-like of shape (n,)
        [mm]; beyond the travel the value at its end is used.

    Returns
    -------
    ndarray of shape (n, n_stations)
        Rows that sum to 1. Hermite pieces with second-order difference slopes: parabolas are reproduced exactly.
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
