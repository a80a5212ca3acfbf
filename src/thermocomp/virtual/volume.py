"""True errors of the virtual machining centre in its work volume, as a reference for assessing compensation.

The structure ``w X' b Z Y (C1) t`` is implemented here independently of the package's own kinematics: rotations are
composed as matrices, from the tool back to the workpiece.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thermocomp.virtual.axes import AXES, STATIONS, TEST_BAR, TEST_POSITION, weigh_stations
from thermocomp.virtual.geometry import SQUARENESS, find_cold_component
from thermocomp.virtual.probes import COMPONENTS, station

FloatArray = NDArray[np.float64]

_MIDDLE = np.array([TEST_POSITION[axis] for axis in AXES], dtype=np.float64)
_SPINDLE = {"X0C": "x", "Y0C": "y", "Z0C": "z", "A0C": "a", "B0C": "b"}


class VolumetricTruth:
    """Errors of the tool point at any point of the work volume, in any thermal state.

    Parameters
    ----------
    observables : sequence of str
        Names of the machine's observables, in order: ``machine.observables``.
    geometry : bool
        Whether to include the cold geometry (`thermocomp.virtual.geometry`); False: thermal changes only.
    """

    def __init__(self, observables: Sequence[str], *, geometry: bool = True) -> None:
        self.geometry = geometry
        index = {name: k for k, name in enumerate(observables)}
        # rows (n, n_observables) @ of[code] = values at the stations of its axis; empty if not modelled
        self._stations: dict[str, FloatArray] = {}
        for code in COMPONENTS:
            at = STATIONS[code[2].lower()]
            self._stations[code] = np.zeros((len(observables), len(at)))
            for k, p in enumerate(at):
                for name in station(code, p):
                    self._stations[code][index[name], k] = 1.0
        # The spindle contributes the rest of the tool point's deviation at the test position.
        self._spindle: dict[str, FloatArray] = {}
        for code, name in _SPINDLE.items():
            row = np.zeros(len(observables))
            row[index[name]] = 1.0
            for axis in AXES:
                row -= self._stations[f"E{code[0]}{axis.upper()}"] @ weigh_stations(axis, [TEST_POSITION[axis]])[0]
            self._spindle[code] = row

    def components(self, rows: FloatArray, points: ArrayLike) -> dict[str, FloatArray]:
        """Return the components at points, as deviations of the tool side relative to the workpiece side.

        Parameters
        ----------
        rows : ndarray of shape (n_observables,) or (n, n_observables)
            Observables in one state, or one state per point, such as ``SimulatedTest.observables``: relative to the
            machine at 20 degC with its cold geometry.
        points : array-like of shape (n, 3)
            Positions of X, Y and Z [mm].

        Returns
        -------
        dict of str to ndarray of shape (n,)
            The 18 axis components, valid at the tip of the test bar with the other axes at `TEST_POSITION`; three
            squareness errors; five spindle drifts [um, urad].
        """
        points = np.asarray(points, dtype=np.float64)
        found = {}
        weights = {axis: weigh_stations(axis, points[:, k]) for k, axis in enumerate(AXES)}
        for code in COMPONENTS:
            found[code] = np.einsum("...k,...k->...", rows @ self._stations[code], weights[code[2].lower()])
            if self.geometry:
                found[code] = found[code] + find_cold_component(code, points)
        for code, value in SQUARENESS.items():
            found[code] = np.full(len(points), value if self.geometry else 0.0)
        for code, row in self._spindle.items():
            found[code] = np.broadcast_to(rows @ row, (len(points),))
        return found

    def error(self, rows: FloatArray, points: ArrayLike, tool: ArrayLike | None = None) -> FloatArray:
        """Return the error of the tool tip relative to the workpiece, actual minus commanded.

        Parameters
        ----------
        rows : ndarray of shape (n_observables,) or (n, n_observables)
            See `components`.
        points : array-like of shape (n, 3)
            Positions of X, Y and Z [mm].
        tool : array-like of shape (3,) or (n, 3), optional
            Vector from the gauge point of the spindle to the tip [mm]. Default: that of the test bar.

        Returns
        -------
        ndarray of shape (n, 3)
            Along X, Y, Z [um].
        """
        points = np.asarray(points, dtype=np.float64)
        c = self.components(rows, points)
        way = points - _MIDDLE
        overhang = np.asarray(TEST_BAR if tool is None else tool, dtype=np.float64) - np.asarray(TEST_BAR)
        none = np.zeros(len(points))

        def shift(*codes: str) -> FloatArray:
            return 1e-3 * np.stack([c[code] for code in codes], axis=-1)

        def turn(a: FloatArray, b: FloatArray, g: FloatArray, at: FloatArray) -> FloatArray:
            return np.asarray(np.einsum("nij,nj->ni", _about(0, a) @ _about(1, b) @ _about(2, g), at))

        # Tip relative to the tip of the test bar; then each body rotates about it and moves [mm].
        at = turn(c["A0C"], c["B0C"], none, np.broadcast_to(overhang, points.shape)) + shift("X0C", "Y0C", "Z0C")
        guides = {
            "y": np.stack([-1e-6 * c["C0Y"], none + 1.0, none], axis=-1),
            "z": np.stack([1e-6 * c["B0Z"], -1e-6 * c["A0Z"], none + 1.0], axis=-1),
            "x": np.array([1.0, 0.0, 0.0]),
        }
        for axis, guide in guides.items():
            name = axis.upper()
            at = turn(c[f"EA{name}"], c[f"EB{name}"], c[f"EC{name}"], at)
            at = at + shift(f"EX{name}", f"EY{name}", f"EZ{name}") + way[:, [AXES.index(axis)]] * guide
        return np.asarray(1e3 * (at - way - overhang))


def _about(axis: int, angle: FloatArray) -> FloatArray:
    """Return the matrices of rotations about an axis by angles [urad], (n,) -> (n, 3, 3)."""
    s, c = np.sin(1e-6 * angle), np.cos(1e-6 * angle)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.zeros((*angle.shape, 3, 3))
    matrix[:, axis, axis] = 1.0
    matrix[:, i, i] = matrix[:, j, j] = c
    matrix[:, j, i], matrix[:, i, j] = s, -s
    return matrix
