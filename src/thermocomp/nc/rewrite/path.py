"""Length of a move, and positions of the tool along it."""

import math

from thermocomp.nc.interpreter import arcs
from thermocomp.nc.interpreter.block import PLANES, Move, Point, triple


def length(move: Move) -> float:
    """Return the length of a move [mm]."""
    if move.arc is None:
        return math.dist(move.start, move.end)
    return arcs.length(move.arc, move.start, move.end)


def find_point(move: Move, share: float) -> Point:
    """Return the position of the tool after a fraction of a move [mm, machine coordinates]."""
    point = [a + share * (b - a) for a, b in zip(move.start, move.end, strict=True)]
    arc = move.arc
    if arc is not None:
        i, j, _ = PLANES[arc.plane]
        p, q = arc.centre
        turned = share * arcs.sweep(arc, move.start, move.end)
        angle = math.atan2(move.start[j] - q, move.start[i] - p) + (-turned if arc.clockwise else turned)
        radius = math.hypot(move.start[i] - p, move.start[j] - q)
        point[i], point[j] = p + radius * math.cos(angle), q + radius * math.sin(angle)
    return triple(point)
