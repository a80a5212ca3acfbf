"""Moves as the planner of a controller sees them: pieces of the path, with limits along it."""

import math

from thermocomp.core.exceptions import ProgramError
from thermocomp.nc.interpreter.arcs import sweep
from thermocomp.nc.interpreter.block import PLANES, Block, Move

Vector = tuple[float, float, float]

#: share of the acceleration that may turn a move aside, and what is left of it along an arc that takes so much
ACROSS, ALONG = math.sqrt(0.75), 0.5
#: cycles that every piece of the path takes at least
LEAST = 1.02


class Segment:
    """A piece of the path that is run at one speed, but for its ends.

    Parameters
    ----------
    owner : int
        Number of its block.
    length : float
        [mm], or [deg] if only rotary axes move.
    entry, leave : tuple of float
        Directions at its ends.
    top, speed : float
        Speed that the axes allow and that is asked for [mm/s].
    acceleration : float
        [mm/s2]
    rapid, rotary : bool
    radius : float
        Radius of an arc, 0: a line [mm].
    bend : float
        The radius that its acceleration is counted with [mm].
    sweep : float
        Angle of an arc [rad].
    axis : tuple of float
        About which an arc turns, by the right hand.
    """

    __slots__ = (
        "acceleration",
        "axis",
        "bend",
        "entry",
        "gives",
        "halved",
        "leave",
        "length",
        "nominal",
        "overlap",
        "owner",
        "radius",
        "rapid",
        "rotary",
        "speed",
        "sweep",
        "through",
        "top",
    )

    def __init__(
        self,
        owner: int,
        length: float,
        entry: Vector,
        leave: Vector,
        top: float,
        speed: float,
        acceleration: float,
        rapid: bool = False,
        rotary: bool = False,
        radius: float = 0.0,
        bend: float = 0.0,
        sweep: float = 0.0,
        axis: Vector = (0.0, 0.0, 1.0),
    ) -> None:
        self.owner, self.length, self.nominal = owner, length, length
        self.entry, self.leave, self.top, self.acceleration = entry, leave, top, acceleration
        self.speed = min(speed, top)
        self.rapid, self.rotary, self.radius, self.sweep, self.axis = rapid, rotary, radius, sweep, axis
        self.bend = bend
        self.gives = 0.0  #: share of the acceleration that kinks at its ends take
        self.halved = False  #: half of its acceleration is left to a neighbour that it overlaps
        self.through = 0.0  #: most speed at its end [mm/s]
        #: the next one begins before its end: tolerance [mm] and cosine of half the angle between them
        self.overlap: tuple[float, float] | None = None

    def finish(self, cycle: float, last: bool = False) -> float:
        """Settle its speed, now that its length and neighbours are known, and return its acceleration [mm/s2].

        Parameters
        ----------
        cycle : float
            Interpolation cycle [s].
        last : bool
            Nothing follows: LinuxCNC keeps back half of the acceleration for what may still come.
        """
        self.top = min(self.top, self.length / (LEAST * cycle))
        a = self.acceleration * (1.0 - self.gives)
        if last:
            a = self.kept()
        else:
            if self.halved:
                a *= 0.5
            if self.radius:
                across = self.top * self.top / self.bend
                if across > ACROSS * a:
                    self.top = math.sqrt(ACROSS * a * self.bend)
                    a *= ALONG
                else:
                    a = math.sqrt(a * a - across * across)
        self.speed = min(self.speed, self.top)
        return a

    def kept(self) -> float:
        """Return the acceleration that it has for sure along the path, whatever comes next [mm/s2]."""
        return 0.5 * self.acceleration * (1.0 - self.gives) * (ALONG if self.radius else 1.0)


class Segments:
    """Makes segments of moves.

    Parameters
    ----------
    speeds, accelerations : tuple of float
        Most of each axis [mm/s, mm/s2].
    feed : float
        Most feed along the path [mm/s].
    rotary : tuple of float
        Most speed and acceleration of a rotary axis [deg/s, deg/s2].
    """

    def __init__(self, speeds: Vector, accelerations: Vector, feed: float, rotary: tuple[float, float]) -> None:
        self.speeds, self.accelerations, self.feed, self.rotary = speeds, accelerations, feed, rotary

    def of(self, serial: int, move: Move, block: Block) -> Segment | None:
        """Return the planner's segment of a move; None if it has no length."""
        if move.arc is not None:
            return self._arc(serial, move, block)
        (x, y, z), (ex, ey, ez) = move.start, move.end
        dx, dy, dz = ex - x, ey - y, ez - z
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        if length > 0.0:
            vx, vy, vz = self.speeds
            ax, ay, az = self.accelerations
            along = (dx / length, dy / length, dz / length)
            dx, dy, dz = abs(dx), abs(dy), abs(dz)
            top = length / max(dx / vx, dy / vy, dz / vz)
            a = length / max(dx / ax, dy / ay, dz / az)
        else:
            along = (0.0, 0.0, 0.0)
            top = a = math.inf
        if move.rotary:
            length = length or abs(move.rotary)
            share = length / abs(move.rotary)
            top = min(top, share * self.rotary[0])
            a = min(a, share * self.rotary[1])
        elif length == 0.0:
            return None
        speed = top if move.rapid else self._asked(move, length, block)
        return Segment(serial, length, along, along, top, speed, a, move.rapid, move.rotary != 0.0)

    def _asked(self, move: Move, length: float, block: Block) -> float:
        """Return the speed that the program asks for [mm/s]."""
        speed = length / move.seconds if move.seconds else move.feed / 60.0
        if not speed > 0.0:
            raise ProgramError(block.line.number, "a feed move, but no feed is in force: write F before it")
        return min(speed, self.feed)

    def _arc(self, serial: int, move: Move, block: Block) -> Segment:
        """Return the planner's segment of an arc or a helix."""
        arc = move.arc
        assert arc is not None
        i, j, k = PLANES[arc.plane]
        ci, cj = arc.centre
        pi, pj = move.start[i] - ci, move.start[j] - cj
        qi, qj = move.end[i] - ci, move.end[j] - cj
        first, second = math.hypot(pi, pj), math.hypot(qi, qj)
        if not first or not second:
            raise ProgramError(block.line.number, "the centre of the arc is at its start or end: check the centre")
        sense = -1.0 if arc.clockwise else 1.0
        turned = sweep(arc, move.start, move.end)
        climb = move.end[k] - move.start[k]
        flat = math.hypot(turned * (first + second) / 2.0, second - first)
        length = math.hypot(flat, climb)

        def direction(a: float, b: float, r: float) -> Vector:
            along = [0.0, 0.0, 0.0]
            s = sense * flat / length / r
            along[i], along[j], along[k] = -s * b, s * a, climb / length
            return (along[0], along[1], along[2])

        ai, aj, ak = (self.accelerations[axis] for axis in (i, j, k))
        vi, vj, vk = (self.speeds[axis] for axis in (i, j, k))
        axis = [0.0, 0.0, 0.0]
        axis[k] = sense
        return Segment(
            serial,
            length,
            direction(pi, pj, first),
            direction(qi, qj, second),
            length / max(flat / min(vi, vj, math.sqrt(ACROSS * min(ai, aj) * first)), abs(climb) / vk),
            self._asked(move, length, block),
            length / max(flat / min(ai, aj), abs(climb) / ak),
            radius=first,
            bend=first + climb * climb / first,
            sweep=turned,
            axis=(axis[0], axis[1], axis[2]),
        )
