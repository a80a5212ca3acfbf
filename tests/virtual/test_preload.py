"""Bearings whose preload depends on temperatures, against Harris' formulas and limits."""

import math
from dataclasses import replace

import numpy as np
import pytest

from thermocomp.virtual.nonlinear import FRONT, REAR
from thermocomp.virtual.preload import EXPANSION, Grease


def test_oil_thins_by_the_standard() -> None:
    oil = Grease()
    assert [oil.viscosity(t) for t in (40.0, 100.0)] == pytest.approx([22.0, 4.3])
    assert 45.0 < oil.viscosity(20.0) < 65.0  # a chart of ISO VG 22 says some 55 mm2/s
    assert oil.viscosity(20.0) > oil.viscosity(30.0) > oil.viscosity(40.0)


def test_the_mounted_approach_is_palmgrens() -> None:
    """delta = 4.36e-4 (Q^2 / D)^(1/3) mm; the pair shares the load, so its balls yield 2^(-2/3) as much."""
    load = 600.0 / (20 * math.sin(math.radians(25.0)))
    single = 0.436 * (load**2 / 12.7) ** (1 / 3)
    assert FRONT.mounted == pytest.approx((single + single / 2 ** (2 / 3)) / 2)
    assert FRONT.approach(20.0, 20.0) == pytest.approx(FRONT.mounted)
    assert FRONT.force(FRONT.mounted) == pytest.approx(600.0)


def test_a_warm_inner_ring_tightens_and_a_warm_outer_one_loosens_until_the_preload_is_gone() -> None:
    tight, loose = float(FRONT.approach(30.0, 20.0)), float(FRONT.approach(20.0, 23.0))
    assert FRONT.force(tight) > 3.0 * 600.0 > 600.0 > FRONT.force(loose) > 0.0
    angle = math.radians(25.0)
    per_kelvin = 1e-3 * EXPANSION * (45.0 * math.cos(angle) - 15.0 * math.sin(angle))
    assert tight - FRONT.mounted == pytest.approx(10.0 * per_kelvin)
    gone = FRONT.mounted / per_kelvin
    assert FRONT.approach(20.0, 20.0 + gone - 0.01) > 0.0
    assert FRONT.approach(20.0, 20.0 + gone + 0.01) == 0.0 == FRONT.force(0.0)
    # Hertz: the force goes with the power 3/2 of the approach
    assert FRONT.force(4.0) / FRONT.force(2.0) == pytest.approx(2.0**1.5)
    # the housing squeezes as a ring does
    assert FRONT.approach(20.0, 20.0, 1.0) - FRONT.mounted == pytest.approx(math.cos(angle))


def test_springs_hold_the_preload() -> None:
    np.testing.assert_array_equal(REAR.approach(np.array([20.0, 60.0]), 20.0), [REAR.mounted] * 2)
    assert REAR.force(REAR.mounted) == pytest.approx(300.0)
    alone = replace(FRONT, sprung=True)
    assert alone.approach(60.0, 20.0) == pytest.approx(FRONT.mounted)


def test_the_shaft_goes_where_the_single_bearing_yields() -> None:
    """Equal axial forces: 2 (D + s sin a)^1.5 = (D - s sin a)^1.5; outwards is where the single bearing is pressed."""
    angle = math.sin(math.radians(25.0))
    for approach in (1.0, 2.5, 8.0):
        inward = -float(FRONT.shift(approach) - FRONT.shift(0.0))
        assert 2.0 * (approach + inward * angle) ** 1.5 == pytest.approx((approach - inward * angle) ** 1.5)
    assert FRONT.shift(FRONT.mounted) == 0.0 < FRONT.shift(8.0)
    assert replace(FRONT, pair=1).shift(8.0) == pytest.approx(0.0)


def test_the_heat_is_that_of_palmgrens_torques() -> None:
    n, viscosity = 3000.0, Grease().viscosity(50.0)
    viscous = 3 * 1e-7 * 2.0 * (viscosity * n) ** (2 / 3) * 90.0**3
    lever = 0.9 / math.tan(math.radians(25.0)) * 90.0
    loaded = sum(1e-3 * (f / 44e3) ** 0.33 * f * lever for f in (600.0, 300.0, 300.0))
    watts = (viscous + loaded) * 1e-3 * 2.0 * math.pi * n / 60.0
    assert FRONT.heat(n, 50.0, FRONT.mounted) == pytest.approx(watts)
    assert FRONT.heat(-n, 50.0, FRONT.mounted) == pytest.approx(watts)
    assert FRONT.heat(0.0, 50.0, FRONT.mounted) == 0.0
    # tight bearings make more heat, warm oil less; slow ones have a torque that does not depend on the oil
    assert FRONT.heat(n, 50.0, 2.0 * FRONT.mounted) > watts > FRONT.heat(n, 70.0, FRONT.mounted)
    assert FRONT.heat(10.0, 50.0, 0.0) == pytest.approx(FRONT.heat(10.0, 70.0, 0.0))
