"""From the 32 components to the error of the tool point by homogeneous transforms, without small-angle assumption."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thermocomp.core.machine import Machine
from thermocomp.runtime.geometry.kinematics import INDEX, Kinematics

FloatArray = NDArray[np.float64]

_UNIT = {"X": np.array([1.0, 0.0, 0.0]), "Y": np.array([0.0, 1.0, 0.0]), "Z": np.array([0.0, 0.0, 1.0])}


def error(machine: Machine, values: FloatArray, points: FloatArray, tool: ArrayLike | None = None) -> FloatArray:
    """Return the error of the tool tip in the workpiece coordinate system.

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
    ndarray of shape (..., 3)
        Actual minus commanded, along X, Y, Z [um].

    Notes
    -----
    Every body is rotated about its reference point, which moves with it, and then translated by its position along its
    guide and by its translational errors. If the reference point is fixed on the workpiece side, the body is translated
    by its position first and then rotated about that point.
    """
    tip = np.asarray(machine.tool if tool is None else tool, dtype=np.float64)
    shape = np.broadcast_shapes(values.shape[:-1], points.shape[:-1])
    values, points = np.broadcast_to(values, (*shape, values.shape[-1])), np.broadcast_to(points, (*shape, 3))
    chain, at = np.broadcast_to(np.eye(4), (*shape, 4, 4)), np.zeros(3)
    levers = Kinematics(machine)
    for name in machine.structure.axes:
        point = levers.reference(name)
        way, beside = _moved(machine, name, values, points)
        turn = _turned(_three(values, f"EA{name}"))
        if machine.axis(name).measured_on == "workpiece":
            chain = chain @ _shifted(point - at + beside) @ turn @ _shifted(way)
        else:
            chain = chain @ _shifted(point - at + beside + way) @ turn
        at = point
    origins = sum((_three(values, f"XO{a}") for a in "XY" if a in machine.structure.axes), np.zeros((*shape, 3)))
    spindle = np.asarray(machine.spindle_tool, dtype=np.float64)
    drift = 1e-3 * (_three(values, "X0C") + origins)
    tilt = np.concatenate([values[..., INDEX["A0C"] : INDEX["B0C"] + 1], np.zeros((*shape, 1))], axis=-1)
    chain = chain @ _shifted(np.broadcast_to(spindle - at, (*shape, 3)) + drift) @ _turned(tilt)
    there = chain @ np.append(tip - spindle, 1.0)
    wanted = points * np.array([float(a in machine.structure.axes) for a in "XYZ"]) + tip
    return np.asarray(1e3 * (there[..., :3] - wanted))


def _moved(machine: Machine, name: str, values: FloatArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the travel along an axis, and the additional effect of its squareness and translational errors [mm]."""
    position = points[..., "XYZ".index(name)]
    way = position - machine.axis(name).reference_position
    square = np.zeros((*position.shape, 3))
    if name == "Y":
        square[..., 2] = values[..., INDEX["C0Y"]]
    elif name == "Z":
        square[..., 0], square[..., 1] = values[..., INDEX["A0Z"]], values[..., INDEX["B0Z"]]
    guide = _turned(square)[..., :3, :3] @ _UNIT[name]
    beside = way[..., None] * (guide - _UNIT[name]) + 1e-3 * _three(values, f"EX{name}")
    return position[..., None] * _UNIT[name], beside


def _three(values: FloatArray, first: str) -> FloatArray:
    """Return three consecutive components, such as the translational errors of an axis."""
    return values[..., INDEX[first] : INDEX[first] + 3]


def _shifted(by: FloatArray) -> FloatArray:
    """Return the transforms for translations in mm, (..., 3) -> (..., 4, 4)."""
    matrix = np.zeros((*by.shape[:-1], 4, 4))
    matrix[..., range(4), range(4)] = 1.0
    matrix[..., :3, 3] = by
    return matrix


def _turned(about: FloatArray) -> FloatArray:
    """Return the transforms for rotation vectors in urad, (..., 3) -> (..., 4, 4), by Rodrigues' formula."""
    x, y, z = (1e-6 * about[..., k] for k in range(3))
    angle = np.sqrt(x * x + y * y + z * z)[..., None, None]
    cross = np.zeros((*about.shape[:-1], 3, 3))
    cross[..., 0, 1], cross[..., 0, 2], cross[..., 1, 2] = -z, y, -x
    cross[..., 1, 0], cross[..., 2, 0], cross[..., 2, 1] = z, -y, x
    matrix = np.zeros((*about.shape[:-1], 4, 4))
    # (1 - cos) / angle^2 as a square of sinc avoids loss of digits near zero
    matrix[..., :3, :3] = (
        np.eye(3) + np.sinc(angle / np.pi) * cross + 0.5 * np.sinc(angle / 2.0 / np.pi) ** 2 * cross @ cross
    )
    matrix[..., 3, 3] = 1.0
    return matrix
