"""When a correction is renewed, and how far it may go."""

import math
from types import SimpleNamespace
from typing import Any

import pytest
from nc_law import Growing, Steady

from thermocomp.core.exceptions import InputError
from thermocomp.nc.interpreter.block import Point
from thermocomp.nc.rewrite.coordinates import Coordinates
from thermocomp.nc.rewrite.demand import Demand, oppose_deviation
from thermocomp.nc.rewrite.text import Vector

HERE = (0.0, 0.0, 0.0)


def test_a_growth_of_ten_um_is_answered_by_minus_ten() -> None:
    """Deviation is actual minus commanded: what is added to the program is its opposite (E-P4)."""
    assert oppose_deviation((0.0, 0.0, 10.0)) == (0.0, 0.0, -10.0)


def test_by_tolerance_it_is_renewed_when_the_drift_has_moved() -> None:
    drift, demand, seen = Growing(slope=0.0), Demand(1.0), []
    for second in range(60):
        seen.append(demand.at(float(second), drift, HERE)[2])
        drift.advance(1.0, 0.0)
    assert seen[0] == -25.0
    assert len(set(seen)) == pytest.approx(6, abs=1)  # 6 um in a minute
    assert all(abs(c + 25 + 0.1 * t) <= 1.0 + 1e-9 for t, c in enumerate(seen))


def test_every_ten_minutes_it_stays_in_between() -> None:
    """As in the paper (P-06): computed every 10 min, from the drift of that moment."""
    drift, demand, seen = Growing(slope=0.0), Demand(1.0, every=600.0), []
    for minute in range(31):
        seen.append(demand.at(60.0 * minute, drift, HERE)[2])
        drift.advance(60.0, 0.0)
    assert seen == [-25.0] * 10 + [-85.0] * 10 + [-145.0] * 10 + [-205.0]


def test_a_small_change_is_taken_when_it_is_due() -> None:
    """P-06: what is computed after ten minutes counts, also below the tolerance by which others are renewed."""
    drift, demand = _Set(3.0), Demand(1.0, every=600.0)
    assert demand.at(0.0, drift, HERE)[2] == -3.0
    drift.z = 3.4
    assert demand.at(599.0, drift, HERE)[2] == -3.0
    assert demand.at(600.0, drift, HERE)[2] == -3.4


def test_what_moved_by_the_tolerance_stays() -> None:
    """P-06: each axis for itself, once one of them has moved by more."""
    drift, demand = SimpleNamespace(deviation=lambda _: (2.0, 0.0, 3.0)), Demand(1.0)
    assert demand.at(0.0, drift, HERE) == (-2.0, 0.0, -3.0)
    drift.deviation = lambda _: (3.0, -1.0, 4.0)
    assert demand.at(1.0, drift, HERE) == (-2.0, 0.0, -3.0)
    drift.deviation = lambda _: (3.0, -1.25, 4.0)
    assert demand.at(2.0, drift, HERE) == (-2.0, 1.25, -3.0)


def test_a_drift_that_changes_its_sign_is_followed() -> None:
    """P-06, E-P4: the correction is minus the deviation, so one of the same sign is as wrong as can be."""
    drift, demand = _Set(3.0), Demand(1.0)
    assert demand.at(0.0, drift, HERE)[2] == -3.0
    drift.z = -2.5
    assert demand.at(1.0, drift, HERE)[2] == 2.5


def test_between_the_times_it_follows_the_place() -> None:
    drift, demand = Growing(), Demand(1.0, every=600.0)
    assert demand.at(0.0, drift, HERE) == (-3.0, 5.0, -25.0)
    drift.advance(300.0, 0.0)
    assert demand.at(300.0, drift, (0.0, 0.0, 100.0)) == (-5.0, 5.0, -27.0)


class _Set(Steady):
    def __init__(self, z: float) -> None:
        self.z = z

    def deviation(self, point: Point) -> Vector:
        return 0.0, 0.0, self.z


@pytest.mark.parametrize(
    ("z", "said"), [(math.nan, "finite"), (math.inf, "finite"), (401.0, "is not plausible as thermal drift")]
)
@pytest.mark.parametrize("every", [None, 60.0])
def test_what_is_no_thermal_drift_is_refused(z: float, said: str, every: float | None) -> None:
    with pytest.raises(InputError, match=said):
        Demand(1.0, every).at(0.0, _Set(z), HERE)


@pytest.mark.parametrize("optional", [False, True])
@pytest.mark.parametrize("moved", [False, True])
def test_an_axis_placed_by_an_optional_line_is_in_doubt(optional: bool, moved: bool) -> None:
    """P-06: it is fixed no more; where it is, is known if the line is run for certain."""
    doubts: list[tuple[int, float]] = []
    state: Any = SimpleNamespace(fixed=[True] * 3, doubtful=[True] * 3, doubt=lambda *d: doubts.append(d))
    block: Any = SimpleNamespace(line=SimpleNamespace(optional=optional))
    Coordinates._placed(state, block, 1, 4.5, moved=moved)
    assert state.fixed == [True, False, True]
    assert state.doubtful == [True, optional, True]
    assert doubts == [(1, 4.5)] * (optional and moved)
