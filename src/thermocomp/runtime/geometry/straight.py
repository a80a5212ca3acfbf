"""Straight lines: the part correctable by a controller with K0 + tanb (P - P0) per axis, and the remaining error."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thermocomp.core.correction import Correction, Deviation
from thermocomp.core.machine import Vector
from thermocomp.core.size import Size
from thermocomp.runtime.geometry.field import ErrorField, check_finite

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class StraightLine:
    """The best straight line of one axis: least squares fit of the error along the axis over its travel.

    Parameters
    ----------
    deviation : Deviation
        Fitted line; its reference position is that of the axis.
    along : Size
        Residual of the error along this axis, on the line through which it was fitted.
    volume : Size
        The same over the work volume, with every axis corrected by its own line.
    """

    axis: str
    deviation: Deviation
    along: Size
    volume: Size

    @property
    def correction(self) -> Correction:
        """Correction to be added by the controller along this axis."""
        return Correction.opposing(self.deviation)


@dataclass(frozen=True)
class StraightLines:
    """The best straight line of every axis, and the remaining error of all together.

    Parameters
    ----------
    at : tuple of float
        Positions of the other axes [mm].
    lines : tuple of StraightLine
        One line per axis of the machine, X first.
    before, after : Size
        Length of the error vector over the work volume, without and with the correction by all lines.
    """

    at: Vector
    lines: tuple[StraightLine, ...]
    before: Size
    after: Size


def straight_lines(
    field: ErrorField,
    at: ArrayLike,
    tool: ArrayLike | None = None,
    *,
    stations: int = 41,
    grid: int = 9,
    exact: bool = False,
) -> StraightLines:
    """Fit the best straight line to the error of every axis.

    Parameters
    ----------
    at : array-like of shape (3,)
        Positions of the other axes while one moves [mm].
    tool : array-like of shape (3,), optional
        Vector from the gauge point to the tip [mm]; default: that of the machine.

    Notes
    -----
    With a correction c at a position P, the remaining error is e(P + c) + c, since the machine moves to P + c.
    """
    machine = field.kinematics.machine
    place = check_finite("at", at)
    axes = [(k, machine.axis(name)) for k, name in enumerate("XYZ") if name in machine.structure.axes]

    deviations = best_lines(field, place, tool, stations=stations, exact=exact)
    sides = [np.array([p]) for p in place]
    found: list[tuple[int, str, Deviation, Size]] = []
    corrections: dict[str, Correction] = {}
    for k, axis in axes:
        sides[k] = np.linspace(*axis.travel, grid)
        points = np.tile(place, (stations, 1))
        points[:, k] = np.linspace(*axis.travel, stations)
        deviation = deviations[axis.name]
        corrections[axis.name] = Correction.opposing(deviation)
        along = find_remaining_error(field, points, {axis.name: corrections[axis.name]}, tool, exact=exact)
        found.append((k, axis.name, deviation, Size.of(along[:, k])))

    volume = np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, 3)
    before, after = (
        field.error(volume, tool, exact=exact),
        find_remaining_error(field, volume, corrections, tool, exact=exact),
    )
    return StraightLines(
        at=(float(place[0]), float(place[1]), float(place[2])),
        lines=tuple(StraightLine(name, d, along, Size.of(after[:, k])) for k, name, d, along in found),
        before=Size.of(np.linalg.norm(before, axis=-1)),
        after=Size.of(np.linalg.norm(after, axis=-1)),
    )


def best_lines(
    field: ErrorField,
    at: ArrayLike,
    tool: ArrayLike | None = None,
    *,
    axes: str = "XYZ",
    stations: int = 41,
    exact: bool = False,
) -> dict[str, Deviation]:
    """Fit the best straight line to the error of selected axes, as `straight_lines`, without remaining errors.

    Parameters
    ----------
    at : array-like of shape (3,)
        Positions of the other axes while one moves [mm].
    tool : array-like of shape (3,), optional
        Vector from the gauge point to the tip [mm]; default: that of the machine.

    Returns
    -------
    dict of str to Deviation
        By axis [um, um/m].
    """
    machine, place = field.kinematics.machine, check_finite("at", at)
    found: dict[str, Deviation] = {}
    for name in axes:
        if name in machine.structure.axes:
            axis, k = machine.axis(name), "XYZ".index(name)
            points = np.tile(place, (stations, 1))
            points[:, k] = np.linspace(*axis.travel, stations)
            found[name] = best_line(points[:, k], field.error(points, tool, exact=exact)[:, k], axis.reference_position)
    return found


def best_line(positions: FloatArray, errors: FloatArray, reference: float) -> Deviation:
    """Return the least-squares straight line of errors against positions.

    Parameters
    ----------
    positions : ndarray of shape (n,)
        [mm]
    errors : ndarray of shape (n,)
        [um]
    reference : float
        Position at which the offset of the line is valid [mm].
    """
    middle, mean = positions.mean(), errors.mean()
    way = 1e-3 * (positions - middle)
    slope = float(way @ (errors - mean) / (way @ way))
    return Deviation(float(mean + slope * 1e-3 * (reference - middle)), slope, reference)


def find_remaining_error(
    field: ErrorField,
    points: FloatArray,
    corrections: Mapping[str, Correction],
    tool: ArrayLike | None = None,
    *,
    exact: bool = False,
) -> FloatArray:
    """Return the remaining error with corrections of selected axes.

    Parameters
    ----------
    points : ndarray of shape (..., 3)
        Commanded positions of the axes [mm].
    tool : array-like of shape (3,), optional
        Vector from the gauge point to the tip [mm]; default: that of the machine.

    Returns
    -------
    ndarray of shape (..., 3)
        Along X, Y, Z [um].
    """
    added = np.zeros(points.shape)
    for axis, correction in corrections.items():
        k = "XYZ".index(axis)
        added[..., k] = correction.at(points[..., k])
    return field.error(points + 1e-3 * added, tool, exact=exact) + added
