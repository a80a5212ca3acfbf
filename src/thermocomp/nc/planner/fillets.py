"""Arcs in corners: maximum radius, and length removed from the adjacent moves."""

import math

from thermocomp.nc.planner.segment import Segment, Vector


class Straight:
    """Corner of two lines."""

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
    before, after : Segment
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
    """Return the points on a line at a distance from a centre."""
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
