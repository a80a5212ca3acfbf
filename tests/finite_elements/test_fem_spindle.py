"""The spindle as a part: its measures, its heat, its growth, and that a finer mesh says the same."""

from typing import Any

import numpy as np
import pytest
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import eigsh, spsolve

from finite_elements.blocks import Blocks
from finite_elements.materials import data, material
from finite_elements.part import Part
from finite_elements.revolution import Revolution
from finite_elements.spindle import spindle
from thermocomp.core.exceptions import InputError

#: heat at 3500 1/min, of the order that the lumped machine has [W]
HEAT = {"front_bearing": 390.0, "rear_bearing": 155.0, "stator": 230.0, "rotor": 160.0}
FILMS = {"front": 7.0, "rear": 5.0, "flange": 2000.0, "housing": 100.0}


@pytest.fixture(scope="module")
def part() -> Part:
    return spindle()


def matrix(part: Part, rotation: float, jacket: float) -> csc_matrix:
    """Conduction with films: a headstock and a coolant of one temperature."""
    films = {**FILMS, "rotating": 6.0 + 55.0 * rotation, "jacket": jacket}
    k = part.conduction + rotation * part.switched["rotation"]
    return csc_matrix(k + sum(h * part.surfaces[name].mass for name, h in films.items()))


def steady(part: Part, jacket: float) -> dict[str, float]:
    """Rises and growths at top speed, above headstock, coolant and air."""
    rise = spsolve(matrix(part, 1.0, jacket), sum(q * part.patches[name] for name, q in HEAT.items()))
    return {name: float(row @ rise) for name, row in {**part.patches, **part.observables}.items()}


def test_it_has_all_that_the_machine_needs(part: Part) -> None:
    assert set(part.surfaces) == {"rotating", "front", "housing", "rear", "flange", "jacket"}
    sensors = {"front_seat", "rear_seat", "motor", "housing", "shaft", "shaft_mean", "tool", "flange", "jacket"}
    assert set(part.patches) == {*HEAT, "tool_tip", *sensors}
    assert {"nose", "tip"} <= set(part.observables)


def test_capacity_is_that_of_the_blocks(part: Part) -> None:
    blocks = data("spindle.toml")["block"]
    volumes = [np.pi * (b["r"][1] ** 2 - b["r"][0] ** 2) * (b["z"][1] - b["z"][0]) for b in blocks]
    total = sum(v * material(b["material"]).heat_capacity for v, b in zip(volumes, blocks, strict=True))
    assert part.capacity.sum() == pytest.approx(total, rel=1e-9)


def test_the_air_gap_opens_with_rotation(part: Part) -> None:
    """A step of 1 K between rotor and stator carries the gap's conductance times its area."""
    revolution = Revolution(data("spindle.toml"))
    rotor = np.zeros(part.n)
    cells = revolution.blocks.elements({"body": "shaft", "r": [0.016, 0.060], "z": [-0.420, 0.075]})
    rotor[np.unique(revolution.space.basis.element_dofs[:, cells])] = 1.0
    gap = part.switched["rotation"]
    assert rotor @ gap @ rotor == pytest.approx(90.0 * 2 * np.pi * 0.060 * 0.200, rel=1e-9)


def test_evenly_warm_it_grows_like_its_material(part: Part) -> None:
    """Shaft and bar 75 and 225 mm before the flange, of a steel of 11.6 um/(m K)."""
    assert part.observables["nose"].sum() == pytest.approx(11.6 * 0.075, rel=0.01)
    assert part.observables["tip"].sum() == pytest.approx(11.6 * 0.225, rel=0.01)
    # nothing is squeezed, but for the little by which the steels differ
    assert abs(part.observables["preload_front"].sum()) < 0.005


def test_a_warm_shaft_squeezes_the_balls_and_slides_in_the_rear_bearing(part: Part) -> None:
    revolution = Revolution(data("spindle.toml"))
    cells = revolution.blocks.elements({"body": "shaft", "r": [0.016, 0.060], "z": [-0.420, 0.075]})
    warm = np.zeros(part.n)
    warm[np.unique(revolution.space.basis.element_dofs[:, cells])] = 10.0
    assert part.observables["preload_front"] @ warm > 0.1
    # from the front bearings' middle to the rear bearings' middle: 332 mm, away from the tool
    assert part.observables["float"] @ warm == pytest.approx(-10 * 11.6 * 0.332, rel=0.05)


def test_time_constants_are_those_of_spindles(part: Part) -> None:
    """Slowest from a quarter of an hour to 40 min, and faster with coolant."""

    def slowest(rotation: float, jacket: float) -> float:
        rates = eigsh(matrix(part, rotation, jacket), 1, csc_matrix(part.capacity), sigma=0, return_eigenvectors=False)
        return float(1.0 / rates[0] / 60.0)

    at_rest, turning, cooled = slowest(0.0, 0.0), slowest(1.0, 0.0), slowest(1.0, 250.0)
    assert 15.0 < cooled < turning < at_rest < 45.0


def test_rises_at_top_speed(part: Part) -> None:
    found = steady(part, 250.0)
    assert 10.0 < found["front_seat"] < 25.0
    assert found["front_bearing"] > found["front_seat"] + 5.0
    assert found["shaft_mean"] > found["housing"] + 10.0
    assert found["tool"] < found["shaft"]
    assert 15.0 < found["nose"] < found["tip"] < 150.0
    assert found["preload_front"] > 0
    uncooled = steady(part, 0.0)
    assert all(uncooled[name] > found[name] for name in ("front_seat", "rear_seat", "motor", "tip"))


def test_steady_heat_goes_out_where_the_films_are(part: Part) -> None:
    rise = spsolve(matrix(part, 1.0, 250.0), part.patches["front_bearing"])
    films = {**FILMS, "rotating": 61.0, "jacket": 250.0}
    assert sum(h * part.surfaces[n].load @ rise for n, h in films.items()) == pytest.approx(1.0, rel=1e-9)


def test_a_mesh_of_half_the_size_says_the_same(part: Part) -> None:
    """Rises within 0.5 % of the greatest rise, growths within 0.5 % of the tip's."""
    fine = Revolution({**data("spindle.toml"), "size": 0.006}).part("spindle")
    assert fine.n > 2 * part.n
    coarse_found, fine_found = steady(part, 250.0), steady(fine, 250.0)
    greatest = max(coarse_found[name] for name in part.patches)
    for name in part.patches:
        assert fine_found[name] == pytest.approx(coarse_found[name], abs=0.005 * greatest), name
    for name in part.observables:
        assert fine_found[name] == pytest.approx(coarse_found[name], abs=0.005 * coarse_found["tip"]), name


def block(**change: Any) -> dict[str, Any]:
    return {"body": "a", "material": "steel", "r": [0.0, 0.02], "z": [0.0, 0.1], **change}


def test_blocks_refuse_what_makes_no_mesh() -> None:
    with pytest.raises(InputError, match="overlaps"):
        Blocks([block(), block(body="b", z=[0.09, 0.2])], 0.01)
    with pytest.raises(InputError, match="empty or negative"):
        Blocks([block(r=[0.02, 0.02])], 0.01)
    with pytest.raises(InputError, match="unknown material 'cheese'"):
        Blocks([block(material="cheese")], 0.01)


def test_blocks_find_places() -> None:
    blocks = Blocks([block(), block(z=[0.1, 0.2]), block(body="b", r=[0.02, 0.03])], 0.01)
    # the two blocks of a share the vertices of their joint, b stands alone
    assert blocks.mesh.nvertices == 3 * 21 + 2 * 11
    assert len(blocks.line({"body": "a", "r": 0.02, "z": [0.0, 0.1]})) == 10
    assert len(blocks.line({"body": "b", "r": 0.02, "z": [0.0, 0.1]})) == 10
    with pytest.raises(InputError, match="unknown body 'c'"):
        blocks.elements({"body": "c", "r": [0.0, 0.02], "z": [0.0, 0.1]})
    with pytest.raises(InputError, match="nothing of the part"):
        blocks.line({"body": "b", "r": 0.01, "z": [0.0, 0.1]})
    with pytest.raises(InputError, match=r"r = 0\.015 inside of elements; name it in cuts"):
        blocks.line({"body": "a", "r": 0.015, "z": [0.0, 0.1]})
    cut = Blocks([block()], 0.01, {"r": [0.015]})
    assert len(cut.line({"body": "a", "r": 0.015, "z": [0.0, 0.1]})) == 10
