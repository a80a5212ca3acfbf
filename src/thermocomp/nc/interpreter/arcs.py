"""Centres and lengths of arcs, with LinuxCNC's tolerances."""

import math
from typing import Final

from thermocomp.nc.interpreter.block import PLANES, Arc, Point

#: the letters of the centre
CENTRE: Final = {17: ("I", "J", "K"), 18: ("K", "I", "J"), 19: ("J", "K", "I")}

# Found by trying G2 in LinuxCNC 2.9: the radius at the end may differ from that at the start by 0.1 % of the radius or
# by this much, whatever is more [mm], and never by 100 times this much.
_SPIRAL: Final = {False: 0.02 * math.sqrt(2.0), True: 0.002 * math.sqrt(2.0) * 25.4}
_RELATIVE: Final = 0.001
#: smaller radii are none, and half the way may be longer than R by so much [mm]
_SMALLEST: Final = 0.00127
#: an arc that turns through less ends where it starts: a full circle [rad]
_FULL: Final = 1e-6

Flat = tuple[float, float]


class ArcError(Exception):
    """The arc is impossible; the text contains the reason."""


def check_centre(start: Flat, end: Flat, centre: Flat, inch: bool) -> None:
    """Refuse arcs whose radii at start and end [mm] differ as the interpreter does.

    Parameters
    ----------
    start, end, centre : tuple of float
        In the arc's plane [mm].
    inch : bool
        Its tolerance is another one in inches.

    Raises
    ------
    ArcError
    """
    first, last = math.dist(start, centre), math.dist(end, centre)
    if min(first, last) < _SMALLEST:
        raise ArcError("the arc has no radius; check its centre")
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
        In the arc's plane [mm].
    radius : float
        A negative one takes the longer way [mm].
    clockwise : bool

    Raises
    ------
    ArcError
    """
    chord = math.dist(start, end)
    if not chord:
        raise ArcError("an arc with R ends at its start point: its centre is undefined; write I J K")
    half, size = chord / 2.0, abs(radius)
    if half - size > _SMALLEST:
        raise ArcError(f"R{size:g} mm is too small: start and end are {chord:g} mm apart")
    height = math.sqrt(max(size * size - half * half, 0.0))
    # the centre of the shorter clockwise arc is to the right of the way from start to end
    side = height if clockwise == (radius > 0.0) else -height
    x, y = (end[0] - start[0]) / chord, (end[1] - start[1]) / chord
    return ((start[0] + end[0]) / 2.0 + y * side, (start[1] + end[1]) / 2.0 - x * side)


def sweep(arc: Arc, start: Point, end: Point) -> float:
    """Return the angle that an arc turns through, in its own sense [rad]; start and end in machine coordinates."""
    first, second, _ = PLANES[arc.plane]
    begin = math.atan2(start[second] - arc.centre[1], start[first] - arc.centre[0])
    finish = math.atan2(end[second] - arc.centre[1], end[first] - arc.centre[0])
    angle = (begin - finish if arc.clockwise else finish - begin) % math.tau
    if angle < _FULL:
        angle = math.tau
    return angle + (arc.turns - 1) * math.tau


def length(arc: Arc, start: Point, end: Point) -> float:
    """Return the length of an arc or helix [mm]; start and end in machine coordinates."""
    first, second, across = PLANES[arc.plane]
    radius = math.dist((start[first], start[second]), arc.centre)
    return math.hypot(radius * sweep(arc, start, end), end[across] - start[across])
