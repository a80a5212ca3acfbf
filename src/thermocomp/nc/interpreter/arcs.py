"""Centres of arcs, with the tolerances of LinuxCNC; lengths of moves, and positions along them."""

import math
from typing import Final

from thermocomp.nc.interpreter.block import PLANES, Arc, Move, Point, triple

#: letters of the centre coordinates, by plane; the third is the axis perpendicular to the plane
CENTRE: Final = {17: ("I", "J", "K"), 18: ("K", "I", "J"), 19: ("J", "K", "I")}

# Measured with G2 in LinuxCNC 2.9: the radii at start and end may differ by 0.1 % of the radius or by this value [mm],
# whichever is greater, but never by more than 100 times this value.
_SPIRAL: Final = {False: 0.02 * math.sqrt(2.0), True: 0.002 * math.sqrt(2.0) * 25.4}
_RELATIVE: Final = 0.001
#: minimum radius; also the tolerance by which half the chord may exceed R [mm]
_SMALLEST: Final = 0.00127
#: an arc of a smaller angle ends at its start point: a full circle [rad]
_FULL: Final = 1e-6

Flat = tuple[float, float]


class ArcError(Exception):
    """Error for an arc that is geometrically impossible; the message gives the reason."""


def check_centre(start: Flat, end: Flat, centre: Flat, inch: bool) -> None:
    """Refuse arcs whose radii at start and end [mm] differ by more than the interpreter allows.

    Parameters
    ----------
    start, end, centre : tuple of float
        In the plane of the arc [mm].
    """
    first, last = math.dist(start, centre), math.dist(end, centre)
    if min(first, last) < _SMALLEST:
        raise ArcError("the radius of the arc is zero, its centre is its start; check I, J and K")
    apart, spiral = abs(first - last), _SPIRAL[inch]
    if apart > 100.0 * spiral or (apart > spiral and apart / max(first, last) > _RELATIVE):
        raise ArcError(
            f"the radius is {first:.4f} mm at the start of the arc and {last:.4f} mm at its end; check centre and end"
        )


def centre_of_radius(start: Flat, end: Flat, radius: float, clockwise: bool) -> Flat:
    """Return the centre of an arc in the R form.

    Parameters
    ----------
    start, end : tuple of float
        In the plane of the arc [mm].
    radius : float
        Radius; negative for the longer arc [mm].
    """
    chord = math.dist(start, end)
    if not chord:
        raise ArcError("an arc with R ends at its start point: its centre is undefined; write I J K")
    half, size = chord / 2.0, abs(radius)
    if half - size > _SMALLEST:
        raise ArcError(f"R{size:g} mm is too small: start and end are {chord:g} mm apart")
    height = math.sqrt(max(size * size - half * half, 0.0))
    # the centre of the shorter clockwise arc is to the right of the direction from start to end
    side = height if clockwise == (radius > 0.0) else -height
    x, y = (end[0] - start[0]) / chord, (end[1] - start[1]) / chord
    return ((start[0] + end[0]) / 2.0 + y * side, (start[1] + end[1]) / 2.0 - x * side)


def sweep(arc: Arc, start: Point, end: Point) -> float:
    """Return the angle of an arc in its direction of rotation [rad]; start and end in machine coordinates."""
    first, second, _ = PLANES[arc.plane]
    begin = math.atan2(start[second] - arc.centre[1], start[first] - arc.centre[0])
    finish = math.atan2(end[second] - arc.centre[1], end[first] - arc.centre[0])
    angle = (begin - finish if arc.clockwise else finish - begin) % math.tau
    if angle < _FULL:
        angle = math.tau
    return angle + (arc.turns - 1) * math.tau


def length(move: Move) -> float:
    """Return the length of a move [mm]."""
    start, end, arc = move.start, move.end, move.arc
    if arc is None:
        return math.dist(start, end)
    first, second, across = PLANES[arc.plane]
    radius = math.dist((start[first], start[second]), arc.centre)
    return math.hypot(radius * sweep(arc, start, end), end[across] - start[across])


def find_point(move: Move, share: float) -> Point:
    """Return the position of the tool after a fraction of a move [mm, machine coordinates]."""
    point = [a + share * (b - a) for a, b in zip(move.start, move.end, strict=True)]
    arc = move.arc
    if arc is not None:
        i, j, _ = PLANES[arc.plane]
        p, q = arc.centre
        turned = share * sweep(arc, move.start, move.end)
        angle = math.atan2(move.start[j] - q, move.start[i] - p) + (-turned if arc.clockwise else turned)
        radius = math.hypot(move.start[i] - p, move.start[j] - q)
        point[i], point[j] = p + radius * math.cos(angle), q + radius * math.sin(angle)
    return triple(point)
