"""Films that depend on temperature and speed, against worked examples and limits."""

import math

import numpy as np
import pytest

from thermocomp.virtual.convection import (
    KELVIN,
    STEFAN_BOLTZMANN,
    Face,
    Faces,
    air_at,
    free_convection,
    rotating_convection,
)


def test_air_is_that_of_the_table() -> None:
    for kelvin, conductivity, viscosity, prandtl in (
        (300.0, 26.3e-3, 15.89e-6, 0.707),
        (350.0, 30.0e-3, 20.92e-6, 0.7),
    ):
        assert [float(v) for v in air_at(np.array(kelvin))] == pytest.approx([conductivity, viscosity, prandtl])


def test_free_convection_is_that_of_incroperas_examples() -> None:
    """Examples 9.2 (fire screen, Ra = 1.813e9, Pr = 0.690: Nu = 147) and 9.4 (pipe, Ra = 5.073e6, Pr = 0.697: 23.3)."""
    found = free_convection(np.array([1.813e9, 5.073e6]), np.array([0.690, 0.697]), np.array([0.0, 1.0]))
    assert found == pytest.approx([147.0, 23.3], rel=1e-2)


def test_rotating_convection_is_beckers() -> None:
    found = rotating_convection(np.array([1e4, 8e4]), np.array(0.7))
    assert found[0] == pytest.approx(0.133 * 1e4 ** (2 / 3) * 0.7 ** (1 / 3))
    assert found[1] / found[0] == pytest.approx(4.0)


def test_with_emissivity_alone_it_is_the_fourth_power() -> None:
    face, still = (Faces([Face(0.5, 1.0, 8.0, e)]) for e in (0.9, 0.0))
    by_radiation = 70.0 * (face.conductance([90.0], [20.0]) - still.conductance([90.0], [20.0]))
    expected = 0.9 * 0.5 * STEFAN_BOLTZMANN * ((90.0 + KELVIN) ** 4 - (20.0 + KELVIN) ** 4)
    assert by_radiation == pytest.approx(expected)


def test_laminar_convection_grows_with_a_power_of_the_rise_between_a_sixth_and_a_third() -> None:
    bare = Faces([Face(1.0, 0.2, 8.0, 0.0)])
    low, high = (float(bare.conductance([20.0 + rise], [20.0])[0]) for rise in (5.0, 40.0))
    assert 1 / 6 < math.log(high / low) / math.log(8.0) < 1 / 3
    # it does not matter which side is the warm one
    assert bare.conductance([60.0], [20.0]) == pytest.approx(bare.conductance([20.0], [60.0]))


def test_speed_counts_only_for_what_lies_and_blends_with_free_convection() -> None:
    lying, upright = (Faces([Face(1.0, 0.06, 8.0, 0.0, lying=flag)]) for flag in (True, False))
    conductivity, viscosity, prandtl = air_at(np.array([30.0 + KELVIN]))
    still = lying.conductance([40.0], [20.0])
    turning = lying.conductance([40.0], [20.0], speed=3000.0)
    reynolds = math.pi * 50.0 * 0.06**2 / viscosity
    alone = conductivity / 0.06 * rotating_convection(reynolds, prandtl)
    assert turning == pytest.approx(np.cbrt(still**3 + alone**3))
    assert 40.0 < alone[0] < 80.0  # the linear model has 60 W/(m2 K) at top speed
    assert upright.conductance([40.0], [20.0], speed=3000.0) == pytest.approx(upright.conductance([40.0], [20.0]))
    slow = lying.conductance([40.0], [20.0], speed=10.0)
    assert slow == pytest.approx(still, rel=0.05)


def test_wind_and_what_the_linear_model_has() -> None:
    faces = Faces([Face(2.0, 0.2, 8.0, 0.0, wind=12.0, films_turning=12.0), Face(1.0, 0.2, 7.0, 0.0)])
    assert faces.linear(0.0) == pytest.approx([16.0, 7.0])
    assert faces.linear(0.5) == pytest.approx([28.0, 7.0])
    more = faces.conductance([30.0, 30.0], [20.0, 20.0], wind=0.5) - faces.conductance([30.0, 30.0], [20.0, 20.0])
    assert more == pytest.approx([12.0, 0.0])


def test_a_slender_cylinder_that_stands_loses_more_than_a_plate() -> None:
    """Fujii and Uehara: Nu + 0.435 L / D."""
    plate, slender = (Faces([Face(2.0, 0.11, 9.0, 0.0, curvature=c)]) for c in (0.0, 5.5))
    more = slender.conductance([40.0], [20.0]) - plate.conductance([40.0], [20.0])
    assert more == pytest.approx(2.0 * air_at(np.array([303.15]))[0] / 0.11 * 0.435 * 5.5)
