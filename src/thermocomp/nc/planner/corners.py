"""Cornering of a controller: the transition from one move to the next.

The controller is LinuxCNC 2.9. Moves that meet at a small angle run through; else an arc is put into the corner, as
wide as the tolerance and half of each move allow; where no arc fits, the next move begins while the last one brakes.
Other controllers do alike under other names.
"""

import math

from thermocomp.nc.planner.fillets import Bent, Straight
from thermocomp.nc.planner.segment import ACROSS, ALONG, Segment, Vector

#: share of an axis' acceleration that a kink between two moves may take
KINK = 0.1
#: moves that turn back sharper than that stop in between [rad]
SHARP = math.radians(2.0)
#: a rest of a move that would take less than so many cycles becomes part of the corner
REST = 4


class Corners:
    """Transition between two moves.

    Parameters
    ----------
    speeds, accelerations : tuple of float
        Most of each axis [mm/s, mm/s2].
    cycle : float
        Interpolation cycle [s].
    """

    def __init__(self, speeds: Vector, accelerations: Vector, cycle: float) -> None:
        self.speeds, self.accelerations, self.cycle = speeds, accelerations, cycle

    def join(self, before: Segment, after: Segment, tolerance: float | None) -> Segment | None:
        """Join two segments: settle the speed between them, and shorten them for an arc.

        Parameters
        ----------
        before, after : Segment
            Changed in place.
        tolerance : float or None
            Largest deviation of the path from the corner [mm]; 0: as far as the moves allow; None: none.

        Returns
        -------
        Segment or None
            The arc in the corner.
        """
        if before.rapid != after.rapid:
            return None
        if before.rotary or after.rotary:
            if tolerance is not None:
                self._overlap(before, after, tolerance, 0.0)
            return None
        (ux, uy, uz), (wx, wy, wz) = before.leave, after.entry
        dx, dy, dz = wx - ux, wy - uy, wz - uz
        if (ux + wx) ** 2 + (uy + wy) ** 2 + (uz + wz) ** 2 < SHARP * SHARP:
            return None
        ax, ay, az = self.accelerations
        speed = min(before.speed, after.speed)
        kink = max(abs(dx) / ax, abs(dy) / ay, abs(dz) / az) * (speed / self.cycle + after.acceleration)
        if before.radius or after.radius:
            kink /= ALONG
        if kink < KINK:
            before.through = speed
            before.gives, after.gives = max(before.gives, kink), max(after.gives, kink)
            return None
        if tolerance is None:
            # that is how it is: the corner is a stop, and the share of a kink is kept back all the same
            before.gives = after.gives = KINK
            return None
        return self._around(before, after, tolerance, speed * KINK / kink)

    def _around(self, before: Segment, after: Segment, tolerance: float, kinked: float) -> Segment | None:
        """Put an arc into a corner, or what is faster."""
        u, w = before.leave, after.entry
        dot = max(-1.0, min(1.0, u[0] * w[0] + u[1] * w[1] + u[2] * w[2]))
        turn = math.acos(dot)
        sin = math.sqrt((1.0 - dot) * (1.0 + dot))
        b = (
            (u[1] * w[2] - u[2] * w[1]) / sin,
            (u[2] * w[0] - u[0] * w[2]) / sin,
            (u[0] * w[1] - u[1] * w[0]) / sin,
        )
        a, most = self._in_plane(b)
        across = ACROSS * a
        quarter = 0.25 * min(before.nominal, after.nominal)
        within = min(tolerance or quarter, quarter)
        goal = max(before.speed, after.speed)
        if goal > most:
            goal = min(goal, max(most, _altitude(before, after, dot, turn)))
        curved = before.radius or after.radius
        corner = Bent(before, after, b, turn) if curved else Straight(before, after, turn)
        half, room = corner.half, corner.room
        speed = 0.0
        cut = None
        if room > 0.0:
            reach = min(room, math.cos(half) * within / (1.0 - math.sin(half)))
            widest = math.tan(half) * reach
            speed = min(math.sqrt(across * widest), goal)
            # as wide as the speed needs, and as far as a blend of two brakings would begin
            blend = min(math.sqrt(a * reach), speed) / (0.5 * a) * speed
            radius = max(speed * speed / across, min(blend / (math.pi - 2.0 * half), widest))
            cut = corner.cut(radius, within)
        if cut is None:
            speed = 0.0
        if speed < goal and self._overlap(before, after, tolerance, max(speed, kinked)):
            return None
        if cut is None or speed < kinked:
            before.through = kinked
            before.gives, after.gives = max(before.gives, KINK), max(after.gives, KINK)
            return None
        first, length, second = cut
        arc = Segment(after.owner, length, u, w, speed, goal, a * ALONG, before.rapid)
        before.length -= first
        after.length -= second
        if not before.radius and before.length < REST * self.cycle * speed:
            arc.length += before.length
            before.length = 0.0
        before.through = arc.through = speed
        return arc

    def _in_plane(self, b: Vector) -> tuple[float, float]:
        """Return the acceleration and speed that the axes allow in any direction across b."""
        (ax, ay, az), (vx, vy, vz) = self.accelerations, self.speeds
        x, y, z = b
        x = 1.0 / math.sqrt(max(1.0 - x * x, 1e-12))
        y = 1.0 / math.sqrt(max(1.0 - y * y, 1e-12))
        z = 1.0 / math.sqrt(max(1.0 - z * z, 1e-12))
        return min(ax * x, ay * y, az * z), min(vx * x, vy * y, vz * z)

    def _overlap(self, before: Segment, after: Segment, tolerance: float, otherwise: float) -> bool:
        """Let the second move begin while the first one brakes, if that is faster than a corner at a speed."""
        dot = 0.0
        if not before.rotary and not after.rotary:
            u, w = before.leave, after.entry
            dot = max(-1.0, min(1.0, u[0] * w[0] + u[1] * w[1] + u[2] * w[2]))
        overlap = (tolerance, math.sqrt((1.0 - dot) / 2.0))
        # a later corner may take half of each
        first, second = find_overlap_speeds(overlap, before, before.kept(), after, after.kept(), 0.5)
        if math.sqrt((1.0 + dot) / 2.0) * (first + second) / 4.0 < otherwise:
            return False
        before.halved = after.halved = True
        before.overlap = overlap
        return True


def find_overlap_speeds(
    overlap: tuple[float, float], before: Segment, a: float, after: Segment, b: float, share: float
) -> tuple[float, float]:
    """Return below which speeds one move brakes while the next one speeds up [mm/s].

    Parameters
    ----------
    overlap : tuple of float
        See `Segment`.
    before : Segment
    a : float
        Its acceleration [mm/s2].
    after : Segment
    b : float
        Its acceleration [mm/s2].
    share : float
        Fraction of their lengths that is certainly available.
    """
    tolerance, cos = overlap
    first = min(math.sqrt(a * before.length * share), before.speed)
    second = min(math.sqrt(b * after.length * share), after.speed)
    if not first or not second:
        return 0.0, 0.0
    time = min(before.length / first, after.length / second, max(first / a, second / b))
    first, second = min(first, time * a), min(second, time * b)
    if tolerance and cos > 1e-3:
        most = 2.0 * math.sqrt(a * tolerance / cos)
        first, second = min(first, most), min(second, most)
    return first, second


def _altitude(before: Segment, after: Segment, dot: float, turn: float) -> float:
    """Return the speed at which the straight way between the two speeds passes by standstill, 0 beside an arc."""
    if before.radius or after.radius:
        return 0.0
    steep = math.cos(min(turn, 0.49 * math.pi))
    v, w = min(before.top, after.top / steep), min(after.top, before.top / steep)
    base = math.sqrt(max(v * v + w * w - 2.0 * v * w * dot, 1e-12))
    return v * w * math.sin(turn) / base
