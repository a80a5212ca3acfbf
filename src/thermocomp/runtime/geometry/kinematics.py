"""From the 32 components to the error of the tool point, to first order (C-08).

A machine is a chain from the workpiece to the tool. Every component is the motion of the tool side relative to the
workpiece side at its place in the chain, actual minus commanded, in machine coordinates (ISO 841), regardless of which
side moves: the value that an instrument between table and spindle reads. A rotation e moves the tool tip by e x lever;
the lever is the vector from the point where the translations were measured to the tip.
"""

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thermocomp.core.components import COMPONENTS
from thermocomp.core.exceptions import InputError
from thermocomp.core.machine import Machine

FloatArray = NDArray[np.float64]

#: index of each component in the arrays of this package
INDEX: dict[str, int] = {c.code: k for k, c in enumerate(COMPONENTS)}
#: urad times mm are thousandths of a um
_LEVER = 1e-3


class Kinematics:
    """Levers of a machine.

    Parameters
    ----------
    machine : Machine
        Machine with its structure, axes and reference points; its components are not used.

    Raises
    ------
    InputError
        The machine has rotary axes: their errors and levers are not among the 32 components.
    """

    def __init__(self, machine: Machine) -> None:
        if machine.structure.rotary:
            raise InputError(
                f"{machine.name}: rotary axis {', '.join(machine.structure.rotary)} in the structure "
                f"{machine.structure.code!r}: only machines of the linear axes X, Y and Z are supported; remove "
                "the rotary axes from the structure if they are stationary"
            )
        self.machine = machine
        self.structure = machine.structure
        self.axes = {a.name: a for a in machine.axes}

    @cached_property
    def travel(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest positions, of shape (3,) each; infinite along a non-existent axis [mm]."""
        low, high = np.full(3, -np.inf), np.full(3, np.inf)
        for name, axis in self.axes.items():
            low["XYZ".index(name)], high["XYZ".index(name)] = axis.travel
        return low, high

    def lever(self, axis: str, points: FloatArray, tool: ArrayLike | None = None) -> FloatArray:
        """Return the vector from the reference point of an axis to the tool tip.

        Parameters
        ----------
        points : ndarray of shape (..., 3)
            Positions of the axes [mm].
        tool : array-like of shape (3,), optional
            Vector from the gauge point to the tip [mm]; default: that of the machine.

        Returns
        -------
        ndarray of shape (..., 3)
            [mm]
        """
        return self._moving(axis) * points + (self._tool(tool) - self.reference(axis))

    def reference(self, axis: str) -> FloatArray:
        """Return the reference point of an axis relative to the gauge point with all axes at 0, of shape (3,) [mm]."""
        found = self.axes[axis]
        return np.asarray(self._moving(axis) * np.asarray(found.measured_at) + np.asarray(found.measured_tool))

    def ways(self, axis: str) -> tuple[str, ...]:
        """Return the axes whose travel from `Axis.measured_at` contributes to the lever of an axis.

        These are the axes beyond it, and the axis itself if its measuring point is fixed on the workpiece side.
        """
        itself = (axis,) if self.axes[axis].measured_on == "workpiece" else ()
        return (*itself, *self.structure.beyond(axis))

    def _moving(self, axis: str) -> FloatArray:
        return np.array([float(a in self.ways(axis)) for a in "XYZ"])

    def synthesize(
        self, values: FloatArray, points: FloatArray, tool: ArrayLike | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return the error of the tool tip and the tilt of the tool relative to the workpiece.

        Parameters
        ----------
        values : ndarray of shape (..., 32)
            Components in the order of `thermocomp.core.components.COMPONENTS` [um, urad].
        points : ndarray of shape (..., 3)
            Positions of the axes [mm].
        tool : array-like of shape (3,), optional
            Vector from the gauge point to the tip [mm]; default: that of the machine.

        Returns
        -------
        error : ndarray of shape (..., 3)
            Error of the tool tip, actual minus commanded, along X, Y, Z [um].
        tilt : ndarray of shape (..., 3)
            Tilt of the tool about X, Y, Z [urad].
        """
        # the error is a sum of products: value of a component times 1, x, y or z
        shape = np.broadcast_shapes(values.shape[:-1], points.shape[:-1])
        parts = values @ self._at_tool(tool).transpose(1, 0, 2).reshape(len(COMPONENTS), 12)
        error = np.broadcast_to(parts[..., :3], (*shape, 3)).copy()
        for k in range(3):
            error += points[..., k : k + 1] * parts[..., 3 * k + 3 : 3 * k + 6]
        return error, np.broadcast_to(values @ _TILT, (*shape, 3)).copy()

    def sensitivity(self, point: ArrayLike, tool: ArrayLike | None = None) -> FloatArray:
        """Return the effect of one um or one urad of each component at the tool tip.

        Parameters
        ----------
        point : array-like of shape (3,)
            Positions of the axes [mm].
        tool : array-like of shape (3,), optional
            Vector from the gauge point to the tip [mm]; default: that of the machine.

        Returns
        -------
        ndarray of shape (32, 3)
            [um per um, um per urad]
        """
        return np.asarray(np.tensordot([1.0, *np.asarray(point, dtype=np.float64)], self._at_tool(tool), 1))

    def _at_tool(self, tool: ArrayLike | None) -> FloatArray:
        """Return the effect of components at the tip, per 1, x, y and z, of shape (4, 32, 3) [um per um, urad, mm]."""
        if tool is None:
            return self._own
        maps = self._maps[:4].copy()
        maps[0] += np.tensordot(np.asarray(tool, dtype=np.float64), self._maps[4:], 1)
        return maps

    @cached_property
    def _own(self) -> FloatArray:
        return self._at_tool(self.machine.tool)

    @cached_property
    def _maps(self) -> FloatArray:
        """Effects of the components at the tip, per 1, x, y, z and the three coordinates of the tool: (7, 32, 3)."""
        maps = np.zeros((7, len(COMPONENTS), 3))
        once, position, tool = maps[0], maps[1:4], maps[4:]
        for name in self.axes:
            shift, turn = INDEX[f"EX{name}"], INDEX[f"EA{name}"]
            once[shift : shift + 3] = np.eye(3)
            once[turn : turn + 3] = _turning(-self.reference(name))
            for k, unit in enumerate(np.eye(3)):
                tool[k, turn : turn + 3] = _turning(unit)
                if "XYZ"[k] in self.ways(name):
                    position[k, turn : turn + 3] = _turning(unit)
            if name != "Z":
                once[INDEX[f"XO{name}"] : INDEX[f"XO{name}"] + 3] = np.eye(3)
        once[INDEX["X0C"] : INDEX["X0C"] + 3] = np.eye(3)
        once[INDEX["A0C"] : INDEX["B0C"] + 1] = _turning(-np.asarray(self.machine.spindle_tool))[:2]
        for k, unit in enumerate(np.eye(3)):
            tool[k, INDEX["A0C"] : INDEX["B0C"] + 1] = _turning(unit)[:2]
        for code, along, towards, sign in (("C0Y", "Y", 0, -1.0), ("B0Z", "Z", 0, 1.0), ("A0Z", "Z", 1, -1.0)):
            if along in self.axes:
                position["XYZ".index(along), INDEX[code], towards] = sign * _LEVER
                once[INDEX[code], towards] = -sign * _LEVER * self.axes[along].reference_position
        return maps

    def _tool(self, tool: ArrayLike | None) -> FloatArray:
        return np.asarray(self.machine.tool if tool is None else tool, dtype=np.float64)


def _turning(lever: FloatArray) -> FloatArray:
    """Return the effect of 1 urad about X, Y and Z at the end of a lever [um], one row each."""
    return np.asarray(_LEVER * np.cross(np.eye(3), lever))


#: effect of each component on the tilt of the tool about X, Y and Z; a squareness turns a guide, not the tool
_TILT = np.array(
    [
        [float(c.unit == "urad" and c.group != "squareness" and letter in c.code[:2]) for letter in "ABC"]
        for c in COMPONENTS
    ]
)
