"""Along a move: how long it is, and where the tool is on it."""

import math

from thermocomp.compensation.nc.following.block import Move, Point
from thermocomp.compensation.nc.revising.method import PLANES


def _sweep(move: Move) -> tuple[float, float, float]:
    """Return radius [mm], first angle and turned angle [rad, anticlockwise] of an arc; zeros for a straight move."""
    arc = move.arc
    if arc is None:
        return 0.0, 0.0, 0.0
    i, j, _ = PLANES[arc.plane]
    p, q = arc.centre
    first = math.atan2(move.start[j] - q, move.start[i] - p)
    last = math.atan2(move.end[j] - q, move.end[i] - p)
    turned = math.fmod(first - last if arc.clockwise else last - first, math.tau)
    if turned <= 1e-9:
        turned += math.tau
    turned += (arc.turns - 1) * math.tau
    return math.hypot(move.start[i] - p, move.start[j] - q), first, -turned if arc.clockwise else turned


def length(move: Move) -> float:
    """Return the length of a move [mm]."""
    if move.arc is None:
        return math.dist(move.start, move.end)
    radius, _, turned = _sweep(move)
    across = PLANES[move.arc.plane][2]
    return math.hypot(radius * turned, move.end[across] - move.start[across])


def at(move: Move, share: float) -> Point:
    """Return where the tool is when it has gone a share of a move [mm, machine coordinates]."""
    point = [a + share * (b - a) for a, b in zip(move.start, move.end, strict=True)]
    if move.arc is not None:
        radius, first, turned = _sweep(move)
        i, j, _ = PLANES[move.arc.plane]
        angle = first + share * turned
        point[i] = move.arc.centre[0] + radius * math.cos(angle)
        point[j] = move.arc.centre[1] + radius * math.sin(angle)
    return point[0], point[1], point[2]
