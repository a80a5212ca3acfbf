"""Error of a program when run with work offsets other than those of its revision, for position-dependent drift."""

import math
from dataclasses import dataclass, field

from thermocomp.nc.interpreter.block import Point, triple
from thermocomp.nc.rewrite.demand import DriftSource

#: distance of the compared positions [mm]
AWAY = 100.0
#: sampling intervals: in time [s], and along the path [mm]
OFTEN = 20.0
DENSE = 20.0


@dataclass
class Elsewhere:
    """Comparison of the drift in the cuts with the drift 100 mm away, along each axis in both directions.

    Parameters
    ----------
    most : list of float
        Largest change of the drift, per axis [um].
    """

    most: list[float] = field(default_factory=lambda: [0.0] * 3)
    _time: float = field(default=-math.inf, init=False)
    _place: Point = field(default=(math.inf,) * 3, init=False)

    def take(self, time: float, point: Point, drift: DriftSource) -> None:
        """Process the position of a cut [mm, machine coordinates] at a time [s], if far enough from the last sample."""
        if time - self._time < OFTEN and math.dist(point, self._place) < DENSE:
            return
        self._time, self._place = time, point
        now = drift.field()
        here = now(point)
        for axis in range(3):
            for away in (-AWAY, AWAY):
                place = triple(p + away * (k == axis) for k, p in enumerate(point))
                for k, (there, was) in enumerate(zip(now(place), here, strict=True)):
                    self.most[k] = max(self.most[k], abs(there - was))
