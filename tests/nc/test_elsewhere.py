"""What another work offset would cost: the drift 100 mm away."""

import pytest
from nc_law import Growing

from thermocomp.nc.interpreter.block import Point
from thermocomp.nc.rewrite.demand import Elsewhere, Field
from thermocomp.nc.rewrite.text import Vector


class Kinked(Growing):
    """X grows along Y by 0.01 um/mm and second, Z does along X, but up to 250 mm only."""

    by_position = True

    def deviation(self, point: Point) -> Vector:
        return 0.01 * self.time * point[1], 0.0, 0.02 * self.time * min(point[0], 250.0)

    def field(self) -> Field:
        return Kinked(self.time).deviation


def test_both_ways_along_each_axis() -> None:
    told, drift = Elsewhere(), Kinked(1.0)
    told.take(0.0, (200.0, 0.0, 0.0), drift)
    assert told.most == pytest.approx([1.0, 0.0, 2.0])  # only 50 mm of the way up count
    drift.time = 3.0
    told.take(5.0, (201.0, 0.0, 0.0), drift)  # near, and soon
    assert told.most == pytest.approx([1.0, 0.0, 2.0])
    told.take(6.0, (200.0, 30.0, 0.0), drift)
    assert told.most == pytest.approx([3.0, 0.0, 6.0])
    drift.time = 4.0
    told.take(30.0, (200.0, 30.0, 0.0), drift)
    assert told.most == pytest.approx([4.0, 0.0, 8.0])
    drift.time = 1.0
    told.take(90.0, (900.0, 30.0, 0.0), drift)
    assert told.most == pytest.approx([4.0, 0.0, 8.0])
