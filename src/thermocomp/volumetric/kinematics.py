"""From the 32 components to the error of the tool point, to first order (C-08).

A machine is a chain from the workpiece to the tool. Every component is what the tool's side of its place in the chain
does against the workpiece's side, actual minus commanded, in machine coordinates (ISO 841), whichever side moves: what
an instrument between table and spindle reads. A turn e moves the tool's tip by e x lever; the lever goes from where the
translations were measured to the tip.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thermocomp.core.components import COMPONENTS
from thermocomp.core.machine import Machine

FloatArray = NDArray[np.float64]

#: index of each component in the arrays of this package
INDEX: dict[str, int] = {c.code: k for k, c in enumerate(COMPONENTS)}
#: urad times mm are thousandths of a micrometre
_LEVER = 1e-3


class Kinematics:
    """The levers of a machine.

    Parameters
    ----------
    machine : Machine
        Its structure, axes and reference points; its components play no part.
    """

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.structure = machine.structure
        self.axes = {a.name: a for a in machine.axes}

    def lever(self, axis: str, points: FloatArray, tool: ArrayLike | None = None) -> FloatArray:
        """Return the way from an axis' reference point to the tool's tip.

        Parameters
        ----------
        axis : {'X', 'Y', 'Z'}
        points : ndarray of shape (..., 3)
            Positions of the axes [mm].
        tool : array-like of shape (3,), optional
            From the gauge point to the tip [mm]; the machine's own if not given.

        Returns
        -------
        ndarray of shape (..., 3)
            [mm]
        """
        moving = np.array([float(a in self.structure.beyond(axis)) for a in "XYZ"])
        return moving * points + (self._tool(tool) - self.reference(axis))

    def reference(self, axis: str) -> FloatArray:
        """Return an axis' reference point from the gauge point while all axes stand at 0, of shape (3,) [mm]."""
        moving = np.array([float(a in self.structure.beyond(axis)) for a in "XYZ"])
        found = self.axes[axis]
        return np.asarray(moving * np.asarray(found.measured_at) + np.asarray(found.measured_tool))

    def synthesize(
        self, values: FloatArray, points: FloatArray, tool: ArrayLike | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return error and tilt of the tool against the workpiece.

        Parameters
        ----------
        values : ndarray of shape (..., 32)
            Components in the order of `thermocomp.core.components.COMPONENTS` [um, urad].
        points : ndarray of shape (..., 3)
            Positions of the axes [mm].
        tool : array-like of shape (3,), optional
            From the gauge point to the tip [mm]; the machine's own if not given.

        Returns
        -------
        error : ndarray of shape (..., 3)
            Of the tool's tip, actual minus commanded, along X, Y, Z [um].
        tilt : ndarray of shape (..., 3)
            Of the tool about X, Y, Z [urad].
        """
        shape = np.broadcast_shapes(values.shape[:-1], points.shape[:-1])
        error, tilt = np.zeros((*shape, 3)), np.zeros((*shape, 3))
        for name in self.axes:
            first = INDEX[f"EX{name}"]
            self._add(error, tilt, values[..., first : first + 6], self.lever(name, points, tool))
            if name != "Z":
                origin = INDEX[f"XO{name}"]
                error += values[..., origin : origin + 3]
        spindle = INDEX["X0C"]
        error += values[..., spindle : spindle + 3]
        turn = np.zeros((*values.shape[:-1], 3))
        turn[..., :2] = values[..., INDEX["A0C"] : INDEX["B0C"] + 1]
        tilt += turn
        error += _LEVER * np.cross(turn, self._tool(tool) - np.asarray(self.machine.spindle_tool))
        for code, along, towards, sign in (("C0Y", "Y", 0, -1.0), ("B0Z", "Z", 0, 1.0), ("A0Z", "Z", 1, -1.0)):
            if along in self.axes:
                way = points[..., "XYZ".index(along)] - self.axes[along].reference_position
                error[..., towards] += sign * _LEVER * values[..., INDEX[code]] * way
        return error, tilt

    def sensitivity(self, point: ArrayLike, tool: ArrayLike | None = None) -> FloatArray:
        """Return what one um or one urad of each component does to the tool's tip.

        Parameters
        ----------
        point : array-like of shape (3,)
            Positions of the axes [mm].
        tool : array-like of shape (3,), optional
            From the gauge point to the tip [mm]; the machine's own if not given.

        Returns
        -------
        ndarray of shape (32, 3)
            [um per um, um per urad]
        """
        return self.synthesize(np.eye(len(COMPONENTS)), np.asarray(point, dtype=np.float64), tool)[0]

    def _tool(self, tool: ArrayLike | None) -> FloatArray:
        return np.asarray(self.machine.tool if tool is None else tool, dtype=np.float64)

    @staticmethod
    def _add(error: FloatArray, tilt: FloatArray, six: FloatArray, lever: FloatArray) -> None:
        """Add what an axis does: three translations, three turns with their levers."""
        error += six[..., :3]
        tilt += six[..., 3:]
        a, b, c = (_LEVER * six[..., k] for k in (3, 4, 5))
        x, y, z = (lever[..., k] for k in range(3))
        error[..., 0] += b * z - c * y
        error[..., 1] += c * x - a * z
        error[..., 2] += a * y - b * x
