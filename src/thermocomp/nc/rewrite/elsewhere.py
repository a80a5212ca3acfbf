"""Error of a program, revised for some work offsets, with others, where the drift depends on the position."""

import math
from dataclasses import dataclass, field

from thermocomp.nc.interpreter.block import Point
from thermocomp.nc.rewrite.demand import DriftSource

#: how far away it is asked [mm]
AWAY = 100.0
#: how often: in time [s], and along the way [mm]
OFTEN = 20.0
DENSE = 20.0


@dataclass
class Elsewhere:
    """Compares the drift in the cuts with that 100 mm away, along each axis, both ways.

    Parameters
    ----------
    most : list of float
        Per axis of the drift, its largest change [um].
    """

    most: list[float] = field(default_factory=lambda: [0.0] * 3)
    _time: float = field(default=-math.inf, init=False)
    _place: Point = field(default=(math.inf,) * 3, init=False)

    def take(self, time: float, point: Point, drift: DriftSource) -> None:
        """Process the position of a cut [mm, machine coordinates] at a time [s]; most of them add nothing new."""
        if time - self._time < OFTEN and math.dist(point, self._place) < DENSE:
            return
        self._time, self._place = time, point
        now = drift.field()
        here = now(point)
        for axis in range(3):
            for away in (-AWAY, AWAY):
                x, y, z = (p + away * (k == axis) for k, p in enumerate(point))
                for k, (there, was) in enumerate(zip(now((x, y, z)), here, strict=True)):
                    self.most[k] = max(self.most[k], abs(there - was))
