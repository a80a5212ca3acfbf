"""Cornering of a controller: the transition from one move to the next.

The controller is LinuxCNC 2.9. Moves that meet at a small angle are joined without a stop; otherwise an arc is inserted
in the corner, as large as the tolerance and half of each move allow; if no arc fits, the next move begins while the
previous one decelerates. Other controllers have similar functions under other names.
"""

import math

from thermocomp.nc.planner.segment import ACROSS, ALONG, Segment, Vector

#: fraction of the acceleration of an axis available for a kink between two moves
KINK = 0.1
#: two moves that enclose a smaller angle (reversal) stop in between [rad]
SHARP = math.radians(2.0)
#: the rest of a move becomes part of the corner if it would take fewer cycles
REST = 4


class Corners:
    """Corner transitions between two moves.

    Parameters
    ----------
    speeds, accelerations : tuple of float
        Limits of each axis [mm/s, mm/s2].
    cycle : float
        Interpolation cycle [s].
    """

    def __init__(self, speeds: Vector, accelerations: Vector, cycle: float) -> None:
        self.speeds, self.accelerations, self.cycle = speeds, accelerations, cycle

    def join(self, before: Segment, after: Segment, tolerance: float | None) -> Segment | None:
        """Join two segments: set the speed between them, and shorten them for an arc.

        Parameters
        ----------
        tolerance : float or None
            Maximum deviation of the path from the corner [mm]; 0: limited by the moves only; None: no deviation.
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
            # as in LinuxCNC: the moves stop in the corner, but the acceleration for a kink is nevertheless reserved
            before.gives = after.gives = KINK
            return None
        return self._around(before, after, tolerance, speed * KINK / kink)

    def _around(self, before: Segment, after: Segment, tolerance: float, kinked: float) -> Segment | None:
        """Insert an arc in the corner between two moves, or use a faster transition."""
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
            # as large as the speed requires, and as an overlap of both moves would extend
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
        arc = Segment(
            owner=after.owner,
            length=length,
            entry=u,
            leave=w,
            top=speed,
            speed=goal,
            acceleration=a * ALONG,
            rapid=before.rapid,
        )
        before.length -= first
        after.length -= second
        if not before.radius and before.length < REST * self.cycle * speed:
            arc.length += before.length
            before.length = 0.0
        before.through = arc.through = speed
        return arc

    def _in_plane(self, b: Vector) -> tuple[float, float]:
        """Return the acceleration and speed that the axes allow in any direction perpendicular to b."""
        (ax, ay, az), (vx, vy, vz) = self.accelerations, self.speeds
        x, y, z = b
        x = 1.0 / math.sqrt(max(1.0 - x * x, 1e-12))
        y = 1.0 / math.sqrt(max(1.0 - y * y, 1e-12))
        z = 1.0 / math.sqrt(max(1.0 - z * z, 1e-12))
        return min(ax * x, ay * y, az * z), min(vx * x, vy * y, vz * z)

    def _overlap(self, before: Segment, after: Segment, tolerance: float, otherwise: float) -> bool:
        """Let the second move begin while the first one decelerates, if this is faster than a given corner speed."""
        dot = 0.0
        if not before.rotary and not after.rotary:
            u, w = before.leave, after.entry
            dot = max(-1.0, min(1.0, u[0] * w[0] + u[1] * w[1] + u[2] * w[2]))
        overlap = (tolerance, math.sqrt((1.0 - dot) / 2.0))
        # the corner at the other end may take half of each
        first, second = find_overlap_speeds(overlap, before, before.kept(), after, after.kept(), 0.5)
        if math.sqrt((1.0 + dot) / 2.0) * (first + second) / 4.0 < otherwise:
            return False
        before.halved = after.halved = True
        before.overlap = overlap
        return True


def find_overlap_speeds(
    overlap: tuple[float, float], before: Segment, a: float, after: Segment, b: float, share: float
) -> tuple[float, float]:
    """Return the speeds below which one move decelerates while the next one accelerates [mm/s].

    Parameters
    ----------
    a : float
        Acceleration of `before` [mm/s2].
    b : float
        Acceleration of `after` [mm/s2].
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
    """Return the minimum speed on the straight line between the two velocity vectors [mm/s], 0 next to an arc."""
    if before.radius or after.radius:
        return 0.0
    steep = math.cos(min(turn, 0.49 * math.pi))
    v, w = min(before.top, after.top / steep), min(after.top, before.top / steep)
    base = math.sqrt(max(v * v + w * w - 2.0 * v * w * dot, 1e-12))
    return v * w * math.sin(turn) / base


class Straight:
    """Corner between two straight lines."""

    def __init__(self, before: Segment, after: Segment, turn: float) -> None:
        self.half = (math.pi - turn) / 2.0
        self.room = min(before.length, before.nominal / 2.0, after.length / 2.0)
        self.turn = turn

    def cut(self, radius: float, _: float) -> tuple[float, float, float]:
        """Return the length of the first line replaced by an arc, the arc length, and the same for the second line."""
        off = radius / math.tan(self.half)
        return off, radius * self.turn, off


class Bent:
    """Corner with arcs, in the plane of the two directions: corner at (0, 0), first move along x.

    Parameters
    ----------
    b : tuple of float
        Normal of the plane, oriented so that the corner turns in the right-hand sense.
    turn : float
        Angle of the corner [rad].
    """

    def __init__(self, before: Segment, after: Segment, b: Vector, turn: float) -> None:
        self.before, self.after, self.turn = before, after, turn
        self.half = self.open = (math.pi - turn) / 2.0
        self.most = [0.0, 0.0]
        self.inside = [False, False]
        rooms = []
        for k, (segment, share) in enumerate(((before, 2.0 / 3.0), (after, 1.0 / 3.0))):
            if not segment.radius:
                rooms.append(min(segment.length, segment.nominal / 2.0))
                continue
            about = segment.axis[0] * b[0] + segment.axis[1] * b[1] + segment.axis[2] * b[2]
            inside = about > 0.0
            most = min(segment.sweep * share, self.open if inside else math.pi / 2.0)
            if inside:  # the arc bends away from its tangent, which makes the corner sharper
                self.half = min(self.half, self.open - most / 4.0)
            self.most[k], self.inside[k] = most, inside
            flat = 1.0 - abs(about) < 1e-12
            rooms.append((math.sin(most / 4.0) if inside else most) * segment.radius if flat else 0.0)
        narrow = before.radius and after.radius and self.half < math.pi / 12.0
        self.room = 0.0 if narrow else min(rooms)

    def cut(self, radius: float, tolerance: float) -> tuple[float, float, float] | None:
        """Return the length of the first move replaced by an arc, the arc length, and the same for the second move."""
        cos, sin = math.cos(self.turn), math.sin(self.turn)
        r1, r2 = self.before.radius, self.after.radius
        # centres of the arcs, and distances from them to the centre of the new arc
        one = complex(0.0, r1 if self.inside[0] else -r1)
        two = complex(-sin, cos) * (r2 if self.inside[1] else -r2)
        d1, d2 = abs(r1 - radius * (1 if self.inside[0] else -1)), abs(r2 - radius * (1 if self.inside[1] else -1))
        centres: list[complex]
        if not r1:
            centres = _on_line(complex(0.0, radius), complex(1.0, 0.0), two, d2)
        elif not r2:
            centres = _on_line(complex(-sin, cos) * radius, complex(cos, sin), one, d1)
        else:
            centres = _on_circles(one, d1, two, d2)
        if not centres:
            return None
        centre = min(centres, key=abs)
        if abs(centre) - radius > tolerance:
            return None
        ends, takes = [], []
        for k, (r, c, along) in enumerate(((r1, one, complex(1.0, 0.0)), (r2, two, complex(cos, sin)))):
            if not r:
                way = (centre * along.conjugate()).real
                ends.append(way * along)
                takes.append(abs(way))
            else:
                angle = abs(_angle(centre - c, -c))
                if angle > self.most[k]:
                    return None
                ends.append(c + (centre - c) * (r / abs(centre - c)))
                takes.append(angle * r)
        length = radius * abs(_angle(ends[0] - centre, ends[1] - centre))
        return takes[0], length, takes[1]


def _angle(v: complex, w: complex) -> float:
    """Return the angle from v to w [rad]."""
    q = w * v.conjugate()
    return math.atan2(q.imag, q.real)


def _on_line(point: complex, along: complex, centre: complex, distance: float) -> list[complex]:
    """Return the points of a line at a given distance from a centre."""
    foot = ((centre - point) * along.conjugate()).real
    off = distance**2 - abs(point + foot * along - centre) ** 2
    return [point + (foot + s * math.sqrt(off)) * along for s in (-1.0, 1.0)] if off >= 0.0 else []


def _on_circles(one: complex, d1: float, two: complex, d2: float) -> list[complex]:
    """Return the points at distance d1 from one centre and d2 from another."""
    apart = abs(two - one)
    if apart < 1e-12:
        return []
    x = (d1 * d1 - d2 * d2 + apart * apart) / (2.0 * apart)
    off = d1 * d1 - x * x
    along = (two - one) / apart
    return [one + along * complex(x, s * math.sqrt(off)) for s in (-1.0, 1.0)] if off >= 0.0 else []
