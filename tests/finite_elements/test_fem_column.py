"""The column against closed forms: fields that are linear in the sheet displace it without any stress."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse.linalg import spsolve

from finite_elements.column import Column
from finite_elements.machines import dimensions
from finite_elements.materials import data, material
from finite_elements.part import Part

FloatArray = NDArray[np.float64]
IRON = material("grey_iron")
COLUMN = Column(**dimensions(data("centre.toml")["column"]))
POSITIONS = (0, 250, 550)
ALPHA = 1e6 * IRON.expansion


@pytest.fixture(scope="module")
def part() -> Part:
    return COLUMN.part("column", IRON, POSITIONS)


def field(rise: Callable[[FloatArray, FloatArray, FloatArray], FloatArray]) -> FloatArray:
    """Temperatures from a function of z, y and the side (1 right, -1 left)."""
    points = COLUMN.space().points
    left = points[0] > COLUMN.depth
    return np.asarray(rise(np.where(left, points[0] - 10.0, points[0]), points[1], np.where(left, -1.0, 1.0)))


def test_it_has_the_mass_of_its_walls(part: Part) -> None:
    c = COLUMN
    walls = c.width * (c.front_wall + c.rear_wall) + 2 * c.side_wall * (c.depth - c.front_wall - c.rear_wall)
    assert part.capacity.sum() == pytest.approx(IRON.heat_capacity * walls * c.height)
    outside = 2 * c.height * (c.depth + c.width)
    assert part.surfaces["outside"].area + part.surfaces["front_low"].area == pytest.approx(outside)
    assert part.surfaces["inside"].area == pytest.approx(
        2 * c.height * (c.width + c.depth - c.front_wall - c.rear_wall)
    )


def test_its_surfaces_know_their_height_and_side(part: Part) -> None:
    outside = part.surfaces["outside"]
    below = COLUMN.first - COLUMN.carriage
    front, rest = (COLUMN.height - below) * COLUMN.width, COLUMN.height * (2 * COLUMN.depth + COLUMN.width)
    middle = COLUMN.base + COLUMN.height / 2 - 1.2
    assert outside.height.sum() == pytest.approx(rest * middle + front * (middle + below / 2))
    assert outside.side.sum() == pytest.approx(0.0, abs=1e-12)
    right = field(lambda _z, _y, s: (s > 0).astype(float))
    sides, walls = COLUMN.height * COLUMN.depth, (2 * COLUMN.height - below) * COLUMN.width / 2
    assert outside.side @ right == pytest.approx(sides * COLUMN.width / 2 + walls * COLUMN.width / 4)


def test_an_evenly_warm_column_only_grows(part: Part) -> None:
    grown = {name: float(row.sum()) for name, row in part.observables.items()}
    assert grown["lift"] == pytest.approx(ALPHA * COLUMN.bearing, rel=1e-3)
    assert grown["z"] == pytest.approx(-ALPHA * COLUMN.depth / 2, rel=1e-3)
    assert grown["foot"] == pytest.approx(ALPHA * 2 * COLUMN.shoe, rel=0.02)
    for name in ("a", "b", "c", "x", *(f"ay@{p}" for p in POSITIONS)):
        assert grown[name] == pytest.approx(0.0, abs=1e-6)


def test_a_warm_front_bends_it_back_with_the_curvature_alpha_times_gradient(part: Part) -> None:
    gradient = -4.0 / COLUMN.depth  # the front 4 K warmer than the rear
    rise = field(lambda z, _y, _s: gradient * z)
    for p in POSITIONS:
        height = COLUMN.first + p / 1000
        tilt = -ALPHA * gradient * height
        assert part.observables[f"ay@{p}"] @ rise == pytest.approx(tilt, rel=1e-3)
        # u_z = alpha gradient (z^2 - y^2) / 2; the carriages are spots of a raised cosine of 0.1 m
        spot, front = 0.1**2 * (1 / 3 - 2 / np.pi**2), (COLUMN.depth / 2) ** 2
        square = height**2 + COLUMN.carriage**2 + spot
        assert part.observables[f"zy@{p}"] @ rise == pytest.approx(
            ALPHA * gradient * (front - spot - square) / 2, rel=2e-3
        )
    assert part.observables["a"] @ rise == part.observables["ay@250"] @ rise > 0


def test_a_warm_right_side_leans_it_to_the_left_and_turns_its_front(part: Part) -> None:
    rise = field(lambda _z, _y, s: s)  # the right sheet 2 K warmer than the left one
    width, height = COLUMN.width, COLUMN.test
    assert part.observables["c"] @ rise == pytest.approx(2 * ALPHA * height / width, rel=2e-3)
    assert part.observables["x"] @ rise == pytest.approx(-ALPHA * height**2 / width, rel=5e-3)
    assert part.observables["b"] @ rise == pytest.approx(ALPHA * COLUMN.depth / width, rel=2e-3)
    for name in ("z", "a", "lift"):
        assert part.observables[name] @ rise == pytest.approx(0.0, abs=1e-9)


def test_heat_passes_between_the_sheets_through_front_and_rear(part: Part) -> None:
    right = field(lambda _z, _y, s: (s > 0).astype(float))
    flow = float(right @ (part.conduction @ right))
    walls = COLUMN.front_wall + COLUMN.rear_wall
    assert flow == pytest.approx(IRON.conductivity * walls * COLUMN.height / (COLUMN.width / 2))


def test_heat_passes_from_front_to_rear_through_the_side_walls(part: Part) -> None:
    # Little resistance in the thick edges: a linear fall across the thin wall is nearly the solution.
    front = sum(part.patches[f"front{k}_{s}"] for k in ("", "_low") for s in ("right", "left")) / 4
    rear = sum(part.patches[f"rear{k}_{s}"] for k in ("", "_low") for s in ("right", "left")) / 4
    c = COLUMN
    across = c.depth - c.front_wall - c.rear_wall

    def rise(z: FloatArray, _y: FloatArray, _s: FloatArray) -> FloatArray:
        return np.clip((c.depth / 2 - c.rear_wall - z) / across, 0.0, 1.0)

    values = field(rise)
    conductance = float(values @ (part.conduction @ values))
    assert (front @ values, rear @ values) == pytest.approx((1.0, 0.0), abs=1e-9)
    assert conductance == pytest.approx(IRON.conductivity * 2 * c.side_wall * c.height / across, rel=1e-9)


def test_heat_of_the_guide_bends_it_back_first_and_finer_elements_say_the_same(part: Part) -> None:
    fine = replace(COLUMN, cells=(12, 48)).part("column", IRON, POSITIONS)
    answers = []
    for p in (part, fine):
        heat = 100.0 * p.patches["guide_right"] + 50.0 * p.patches["guide_left"]
        stiffness = p.conduction + 8.0 * p.surfaces["outside"].mass
        rise = spsolve(stiffness.tocsc(), heat)
        answers.append([float(p.observables[k] @ rise) for k in ("z", "a", "x", "c", "b", "lift")])
    coarse, finer = np.array(answers)
    assert finer[0] > 0
    assert finer[1] > 0
    assert finer[2] < 0
    assert coarse == pytest.approx(finer, rel=0.01)
