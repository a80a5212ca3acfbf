"""Segments of a controller's path planner: pieces of the path, with limits along them."""

import math
from dataclasses import dataclass, field

from thermocomp.nc.interpreter.arcs import sweep
from thermocomp.nc.interpreter.block import PLANES, Block, Move, triple

Vector = tuple[float, float, float]

#: fraction of the acceleration available across the path, and fraction then left along an arc
ACROSS, ALONG = math.sqrt(0.75), 0.5
#: moves that follow the spindle, whatever the feed override
_SYNCHRONISED = frozenset(("G33", "G33.1", "G74", "G84"))
#: minimum duration of every segment [cycles]
LEAST = 1.02


@dataclass(slots=True)
class Segment:
    """Piece of the path with constant speed, except at its ends.

    Parameters
    ----------
    owner : int
        Number of the block it belongs to.
    length : float
        Length [mm], or [deg] if only rotary axes move.
    entry, leave : tuple of float
        Directions at the ends.
    top, speed : float
        Speed allowed by the axes, and programmed speed [mm/s].
    acceleration : float
        Acceleration [mm/s2].
    radius : float
        Radius of an arc; 0 for a line [mm].
    bend : float
        Radius used to compute the centripetal acceleration [mm].
    sweep : float
        Angle of an arc [rad].
    axis : tuple of float
        Rotation axis of an arc, in the right-hand sense.
    """

    owner: int
    length: float
    entry: Vector
    leave: Vector
    top: float
    speed: float
    acceleration: float
    rapid: bool = False
    rotary: bool = False
    radius: float = 0.0
    bend: float = 0.0
    sweep: float = 0.0
    axis: Vector = (0.0, 0.0, 1.0)
    nominal: float = field(init=False)  #: length as programmed
    gives: float = field(default=0.0, init=False)  #: fraction of the acceleration reserved for kinks at its ends
    #: half of its acceleration is reserved for an overlapping neighbour
    halved: bool = field(default=False, init=False)
    through: float = field(default=0.0, init=False)  #: maximum speed at its end [mm/s]
    #: if the next segment begins before the end of this one: tolerance [mm], cosine of half the angle between them
    overlap: tuple[float, float] | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        self.nominal = self.length
        self.speed = min(self.speed, self.top)

    def finish(self, cycle: float, last: bool = False) -> float:
        """Set the speed, when length and neighbours are final, and return the acceleration [mm/s2].

        Parameters
        ----------
        cycle : float
            Interpolation cycle [s].
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
        """Return the acceleration along the path that is available whatever move follows [mm/s2]."""
        return 0.5 * self.acceleration * (1.0 - self.gives) * (ALONG if self.radius else 1.0)


class Segments:
    """Factory of segments from moves.

    Parameters
    ----------
    speeds, accelerations : tuple of float
        Limits of each axis [mm/s, mm/s2].
    feed : float
        Maximum feed rate along the path [mm/s].
    rotary : tuple of float
        Maximum speed and acceleration of a rotary axis [deg/s, deg/s2].
    override : float
        Fraction of the programmed feed; threads and taps are not affected.
    """

    def __init__(
        self, speeds: Vector, accelerations: Vector, feed: float, rotary: tuple[float, float], override: float
    ) -> None:
        self.speeds, self.accelerations, self.feed, self.rotary = speeds, accelerations, feed, rotary
        self.override = override

    def of(self, serial: int, move: Move, block: Block) -> Segment | None:
        """Return the segment of a move; None if it has no length."""
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
        return Segment(
            owner=serial,
            length=length,
            entry=along,
            leave=along,
            top=top,
            speed=speed,
            acceleration=a,
            rapid=move.rapid,
            rotary=move.rotary != 0.0,
        )

    def _asked(self, move: Move, length: float, block: Block) -> float:
        """Return the programmed speed of a move [mm/s]."""
        speed = length / move.seconds if move.seconds else move.feed / 60.0
        if not speed > 0.0:
            raise block.error("a feed move, but no feed is in force: write F before it")
        return min(speed * (1.0 if block.modal.motion in _SYNCHRONISED else self.override), self.feed)

    def _arc(self, serial: int, move: Move, block: Block) -> Segment:
        """Return the segment of an arc or a helix."""
        arc = move.arc
        assert arc is not None
        i, j, k = PLANES[arc.plane]
        ci, cj = arc.centre
        pi, pj = move.start[i] - ci, move.start[j] - cj
        qi, qj = move.end[i] - ci, move.end[j] - cj
        first, second = math.hypot(pi, pj), math.hypot(qi, qj)
        if not first or not second:
            raise block.error("the centre of the arc is at its start or end: check the centre")
        sense = -1.0 if arc.clockwise else 1.0
        turned = sweep(arc, move.start, move.end)
        climb = move.end[k] - move.start[k]
        flat = math.hypot(turned * (first + second) / 2.0, second - first)
        length = math.hypot(flat, climb)

        def direction(a: float, b: float, r: float) -> Vector:
            along = [0.0, 0.0, 0.0]
            s = sense * flat / length / r
            along[i], along[j], along[k] = -s * b, s * a, climb / length
            return triple(along)

        ai, aj, ak = (self.accelerations[axis] for axis in (i, j, k))
        vi, vj, vk = (self.speeds[axis] for axis in (i, j, k))
        axis = [0.0, 0.0, 0.0]
        axis[k] = sense
        return Segment(
            owner=serial,
            length=length,
            entry=direction(pi, pj, first),
            leave=direction(qi, qj, second),
            top=length / max(flat / min(vi, vj, math.sqrt(ACROSS * min(ai, aj) * first)), abs(climb) / vk),
            speed=self._asked(move, length, block),
            acceleration=length / max(flat / min(ai, aj), abs(climb) / ak),
            radius=first,
            bend=first + climb * climb / first,
            sweep=turned,
            axis=triple(axis),
        )
