"""The resting tool system as a part: heat from the bearing fit to the tip, and what it displaces (W-08)."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import spsolve

from finite_elements.materials import data
from finite_elements.part import Part
from finite_elements.revolution import Revolution, with_joints
from finite_elements.toolholder import toolholder
from finite_elements.transient import Stepper
from thermocomp.virtual.toolsystem import FOOT

FloatArray = NDArray[np.float64]


@pytest.fixture(scope="module")
def part() -> Part:
    return toolholder()


def with_films(part: Part) -> csr_matrix:
    film = data("tool.toml")["film"]
    assert set(film) == set(part.surfaces)
    return csr_matrix(part.conduction + sum(h * part.surfaces[name].mass for name, h in film.items()))


def rises(part: Part, heater: float, tip: float) -> dict[str, float]:
    heat = heater * part.patches["heater"] + tip * part.patches["tip"]
    rise = spsolve(with_films(part).tocsc(), heat)
    return {name: float(row @ rise) for name, row in {**part.patches, **part.observables}.items()}


def test_it_has_the_papers_places(part: Part) -> None:
    assert {f"t{k}" for k in range(1, 9)} | {"heater", "tip"} <= set(part.patches)
    assert set(part.observables) == {"s1", "s2", "s3"}


def test_the_air_is_taken_where_the_surface_is(part: Part) -> None:
    middle = {name: s.height.sum() / s.area + 1.2 for name, s in part.surfaces.items()}
    assert middle["foot"] == pytest.approx(1.0, abs=1e-9)
    assert data("tool.toml")["film"]["foot"] * part.surfaces["foot"].area == pytest.approx(FOOT, rel=1e-9)  # W-15
    assert 1.39 < middle["tool"] < 1.5
    assert middle["body"] < middle["shaft"] < middle["chuck"] < middle["tool"]


def test_heated_at_the_bearing_fit_it_cools_towards_tip_and_body(part: Part) -> None:
    found = rises(part, 45.0, 0.0)
    order = ["t8", "t6", "t5", "t4", "t3", "t1", "t7"]
    assert [found[a] > found[b] for a, b in pairwise(order)] == [True] * 6
    assert 25.0 < found["t8"] < 40.0  # 47 to 62 degC in a cell of 22 degC
    assert 20.0 < found["s3"] < found["s2"] < found["s1"] < 150.0


def test_heated_at_the_tip_the_tool_is_the_warmest(part: Part) -> None:
    found = rises(part, 0.0, 5.0)
    order = ["tip", "t1", "t2", "t3", "t4", "t5", "t6", "t8", "t7"]
    assert [found[a] > found[b] for a, b in pairwise(order)] == [True] * 8
    assert found["s1"] - found["s2"] > found["s2"] - found["s3"]


def test_evenly_warm_it_grows_like_its_materials(part: Part) -> None:
    """Steel of 11.6 um/(m K) up to somewhere in the clamping, carbide of 5.5 from there."""
    assert part.observables["s3"].sum() == pytest.approx(11.6 * 0.226, rel=0.02)
    assert part.observables["s2"].sum() == pytest.approx(11.6 * 0.290, rel=0.02)
    least, most = 11.6 * 0.240 + 5.5 * 0.160, 11.6 * 0.290 + 5.5 * 0.110
    assert least < part.observables["s1"].sum() < most


def test_one_temperature_does_not_tell_the_displacement(part: Part) -> None:
    """Warming up and cooling down make a loop: at the same t8 the tip stands elsewhere."""
    film = data("tool.toml")["film"]
    air = sum(h * part.surfaces[name].load for name, h in film.items())
    stepper = Stepper(part.capacity, with_films(part), 60.0)

    def heat(time: float) -> FloatArray:
        return np.asarray(22.0 * air + (45.0 if time < 14_400 else 0.0) * part.patches["heater"])

    fields = np.array([s.temperatures for s in stepper.march(np.full(part.n, 22.0), heat, 480)])
    fit, tip = fields @ part.patches["t8"], (fields - 22.0) @ part.observables["s1"]
    up, down = slice(0, 240), slice(240, 480)
    warming = np.interp(35.0, fit[up], tip[up])
    cooling = np.interp(-35.0, -fit[down], tip[down])
    assert cooling - warming > 5.0
    assert fields.min() > 21.9  # heat goes from warm to cold, in space and in time


def test_a_mesh_of_half_the_size_says_the_same(part: Part) -> None:
    fine = Revolution({**data("tool.toml"), "size": 0.003}).part("tool")
    for heater, tip in ((45.0, 0.0), (0.0, 5.0)):
        coarse_found, fine_found = rises(part, heater, tip), rises(fine, heater, tip)
        greatest = max(coarse_found[f"t{k}"] for k in range(1, 9))
        for name in part.patches:
            assert fine_found[name] == pytest.approx(coarse_found[name], abs=0.005 * greatest), name
        for name in part.observables:
            assert fine_found[name] == pytest.approx(coarse_found[name], rel=0.005), name


def test_the_sides_of_named_joints_are_places(part: Part) -> None:
    table = data("tool.toml")
    joined = toolholder(with_joints(table))
    assert set(joined.patches) - set(part.patches) == {"taper_a", "taper_b", "grip_a", "grip_b"}
    # far from the tip's heat the chuck is the colder side; heat from behind comes from the shaft
    conduction = csr_matrix(joined.conduction + sum(h * joined.surfaces[k].mass for k, h in table["film"].items()))
    from_tip, from_behind = (spsolve(conduction.tocsc(), joined.patches[place]) for place in ("tip", "heater"))
    assert joined.patches["grip_b"] @ from_tip > joined.patches["grip_a"] @ from_tip
    assert joined.patches["taper_a"] @ from_behind > joined.patches["taper_b"] @ from_behind
    assert "name" not in table["contact"][0]
    assert part.patches.keys() == toolholder(table).patches.keys()
