"""Joints that open and close, against Lame's rings and limits."""

import math
from dataclasses import replace

import numpy as np
import pytest

from thermocomp.virtual.fits import AIR_CONDUCTIVITY, AIR_JUMP, Fit
from thermocomp.virtual.nonlinear import GRIP, SEAT, TAPER

SOLID = Fit(radius=10.0, bore=0.0, outside=25.0, length=50.0, squeeze=6.0, linear=1000.0)


def test_a_pressed_joint_has_the_pressure_of_lames_rings() -> None:
    """A solid shaft in a ring of the same steel: p = E delta / r (1 - r^2 / R^2) / 2."""
    expected = 210e3 * 6e-3 / 10.0 * (1.0 - (10.0 / 25.0) ** 2) / 2.0
    assert SOLID.pressure(20.0, 20.0) == pytest.approx(expected)


def test_the_joint_opens_at_the_temperature_foretold() -> None:
    """A socket that is warmer by squeeze / (alpha r) lets go; it has the gap that its growth makes beyond."""
    opens = TAPER.squeeze / (11.6e-3 * TAPER.radius)
    assert opens == pytest.approx(18.04, abs=0.01)
    assert TAPER.pressure(20.0, 20.0 + opens - 0.01) > 0.0
    assert TAPER.pressure(20.0, 20.0 + opens) == pytest.approx(0.0, abs=1e-9)
    assert TAPER.squeezed(20.0, 20.0 + opens + 4.0) == pytest.approx(-11.6e-3 * TAPER.radius * 4.0)
    # together they stay as they were mounted; the carbide in its chuck lets go as both warm
    assert TAPER.squeezed(60.0, 60.0) == pytest.approx(TAPER.squeeze)
    assert GRIP.squeezed(60.0, 60.0) == pytest.approx(GRIP.squeeze - 40.0 * 6.1e-3 * GRIP.radius)
    # and the outer ring closes its gap as it is warmer than the housing
    closes = -SEAT.squeeze / (12.0e-3 * SEAT.radius)
    assert SEAT.pressure(20.0 + closes + 0.1, 20.0) > 0.0 == SEAT.pressure(20.0 + closes - 0.1, 20.0)


def test_spots_conduct_with_the_power_of_pressure_and_a_gap_like_its_air() -> None:
    def spots(squeeze: float) -> float:
        """What the pressure adds to a joint that just touches [W/K]."""
        touching, pressed = (replace(SOLID, squeeze=s).conductance(20.0, 20.0) for s in (0.0, squeeze))
        return pressed - touching

    assert spots(8.0) / spots(4.0) == pytest.approx(2.0**0.95)
    pressure = float(SOLID.pressure(20.0, 20.0))
    assert spots(6.0) / SOLID.area == pytest.approx(1.25 * 42.0 * 0.1 / 0.7e-6 * (pressure / 6500.0) ** 0.95)
    for gap in (0.0, 5.0, 50.0):
        air = AIR_CONDUCTIVITY / (1e-6 * (gap + 3 * 0.7 + AIR_JUMP))
        assert replace(SOLID, squeeze=-gap).conductance(20.0, 20.0) == pytest.approx(SOLID.area * air)
    # what lies behind it limits it
    assert GRIP.conductance(20.0, 20.0) / GRIP.area == pytest.approx(1200.0, rel=0.02)


def test_friction_gives_way_as_the_shear_of_a_bar_does() -> None:
    """Fully slipped, drag q [N/mm] over half the length has strained both parts by q L^2 / (8 EA) at the end."""
    pressure = 70.0
    drag = 2.0 * math.pi * 10.0 * 0.15 * pressure
    shank, chuck = 210e3 * math.pi * 100.0, 210e3 * math.pi * (625.0 - 100.0)
    expected = 1e3 * drag * 50.0**2 / 8.0 * (1.0 / shank + 1.0 / chuck)
    assert SOLID.hold(pressure) == pytest.approx(expected)
    assert SOLID.hold(0.0) == 0.0
    assert SOLID.wish(45.0, 45.0) == pytest.approx(0.0)
    # half the length, the difference of the strains
    assert GRIP.wish(40.0, 50.0) == pytest.approx(25e-3 * (11.6 * 30.0 - 5.5 * 20.0))
    np.testing.assert_allclose(GRIP.wish(np.array([20.0, 30.0]), np.array([20.0, 30.0])), [0.0, 25e-3 * 61.0])
