"""Parts put together: against matrices written by hand, and what every machine must obey."""

import numpy as np
import pytest
from numpy.typing import NDArray

from finite_elements.assembly import Assembly, Film, FullModel, Link, lump
from finite_elements.machines import centre, tool
from finite_elements.materials import material
from finite_elements.screw import Screw
from finite_elements.transient import factorised
from thermocomp.core.exceptions import InputError
from thermocomp.virtual.axes import STATIONS, TEST_POSITION

FloatArray = NDArray[np.float64]
RUNNING = {"rotation": 0.8, "flow": 1.0, "feed_x": 0.2, "feed_y": 0.2, "feed_z": 0.2}


@pytest.fixture(scope="module")
def machine() -> FullModel:
    return centre()


def steady(model: FullModel, heat: dict[str, float], air: FloatArray, theta: dict[str, float]) -> FloatArray:
    loads = model.air_heat(theta) @ air
    for name, watts in heat.items():
        loads = loads + watts * model.heat[:, model.inputs.index(name)]
    return factorised(model.stiffness(theta))(loads)


def test_two_lumps_in_air_are_the_matrix_written_by_hand() -> None:
    parts = Assembly([lump("a", 100.0, height=2.2, side=0.5), lump("b", 200.0)])
    model = parts.join(
        [Film("a.air", 3.0), Film("a.air", 5.0, theta="rotation"), Film("b.air", 2.0, to="a")],
        [Link("a", "b", 4.0), Link("a", "b", 7.0, theta="flow")],
        {"heater": "b"},
        {"here": "a"},
        {"growth": parts.place("a") * 2.0},
        ("rotation", "flow"),
    )
    assert np.diag([100.0, 200.0]) == pytest.approx(model.capacity.toarray())
    assert np.array([[9.0, -6.0], [-6.0, 6.0]]) == pytest.approx(model.stiffness({}).toarray())
    assert np.array([[19.0, -13.0], [-13.0, 13.0]]) == pytest.approx(
        model.stiffness({"rotation": 0.6, "flow": 1.0}).toarray()
    )
    assert model.air_heat({"rotation": 1.0}) == pytest.approx(np.array([[8.0, 8.0, 4.0], [0.0, 0.0, 0.0]]))
    assert model.heat == pytest.approx(np.array([[0.0], [1.0]]))
    assert model.places["here"] == pytest.approx([1.0, 0.0])
    assert model.observables["growth"] == pytest.approx([2.0, 0.0])


def test_a_film_to_a_place_carries_what_the_whole_surface_gives_off() -> None:
    screw = Screw(diameter=0.04, length=1.0, nut=(0.2, 0.8)).part("screw", material("steel"))
    parts = Assembly([screw, lump("nut", 2000.0)])
    model = parts.join([Film("screw.nut", 50.0, to="nut")], [], {}, {}, {"none": np.zeros(parts.size)}, ())
    field = parts.spread("screw", np.full(screw.n, 3.0)) + parts.place("nut")
    film = model.stiffness({}) - Assembly([screw, lump("nut", 1.0)]).join([], [], {}, {}, {}, ()).stiffness({})
    flow = film @ field
    given = 50.0 * np.pi * 0.04 * 0.6 * 2.0
    assert flow[parts.where("nut")] == pytest.approx([-given])
    assert flow[parts.where("screw")].sum() == pytest.approx(given)


@pytest.mark.parametrize(
    ("films", "links", "match"),
    [
        ([Film("c.air", 1.0)], [], "no part 'c'"),
        ([Film("a.side", 1.0)], [], "has the surfaces air"),
        ([Film("a.air", -1.0)], [], "must not be negative"),
        ([Film("a.air", 1.0, theta="flow")], [], "its theta one of none"),
        ([], [Link("a", "a.x", 1.0)], "has the patches"),
        ([], [Link("a", "a", float("nan"))], "must not be negative"),
    ],
)
def test_what_leads_nowhere_is_refused(films: list[Film], links: list[Link], match: str) -> None:
    with pytest.raises(InputError, match=match):
        Assembly([lump("a", 1.0)]).join(films, links, {}, {}, {}, ())


def test_two_parts_of_one_name_are_refused() -> None:
    with pytest.raises(InputError, match="same name"):
        Assembly([lump("a", 1.0), lump("a", 1.0)])
    with pytest.raises(InputError, match="no observable 'x'"):
        Assembly([lump("a", 1.0)]).observable("a", "x")


@pytest.mark.parametrize("theta", [{}, RUNNING])
def test_no_heat_is_lost_but_to_the_air(machine: FullModel, theta: dict[str, float]) -> None:
    stiffness = machine.stiffness(theta)
    assert abs(stiffness - stiffness.T).max() < 1e-9
    # warm by 1 degC in air of 1 degC: nothing flows anywhere
    assert np.abs(stiffness @ machine.one - machine.air_heat(theta)[:, 0]).max() < 1e-9
    assert machine.heat.sum(axis=0) == pytest.approx(np.ones(len(machine.inputs)))
    assert [float(row.sum()) for row in machine.places.values()] == pytest.approx([1.0] * len(machine.places))


def test_an_evenly_warm_machine_is_almost_as_accurate_as_a_cold_one(machine: FullModel) -> None:
    # C-03: the loop of lengths nearly closes; its pieces grow by 10 to 20 um/K
    grown = {name: float(row.sum()) for name, row in machine.observables.items()}
    for name in ("x", "y", "z", "slide"):
        assert abs(grown[name]) < 1.0
    for name in ("a", "b"):
        assert grown[name] == pytest.approx(0.0, abs=1e-4)
    assert grown["tip"] > 2.0


def test_each_axis_counts_its_own_screw_at_the_position_of_the_tests(machine: FullModel) -> None:
    steel = 1e6 * material("steel").expansion
    for axis, positions in STATIONS.items():
        rows = [machine.observables[f"{axis}{axis}@{p}"] for p in positions]
        # the farther, the more screw: an even rise is a slope of alpha
        for p, row in zip(positions, rows, strict=True):
            assert (row - rows[0]).sum() == pytest.approx(steel * (p - positions[0]) / 1000, abs=1e-3)
        rest = machine.observables[axis] - rows[positions.index(TEST_POSITION[axis])]
        nut = steady(machine, {f"{axis}_nut": 50.0}, np.zeros(3), RUNNING)
        # the screw itself is in no other term: what is left is small beside it
        assert abs(rest @ nut) < 0.5 * np.ptp([r @ nut for r in rows])


def test_heat_drives_the_tool_where_mechanics_say(machine: FullModel) -> None:
    def moved(**heat: float) -> dict[str, float]:
        field = steady(machine, heat, np.zeros(3), RUNNING)
        return {name: float(row @ field) for name, row in machine.observables.items()}

    spindle = moved(front_bearing=100.0)
    assert spindle["z"] < -10 < 10 < spindle["tip"]
    assert spindle["z"] == pytest.approx(-spindle["tip"], abs=8.0)
    assert spindle["a"] > 0  # the warm front of the column bends it back
    cabinet = moved(cabinet=100.0)
    assert cabinet["a"] < 0  # rear right: it bends forward, leans left, turns its right front forward
    assert cabinet["b"] > 0
    assert cabinet["x"] < 0
    assert moved(tool_tip=20.0)["tip"] > 5
    # the screw of Y hangs from its top bearing: warmer, it lowers the headstock
    assert moved(y_screw_3=20.0)["y"] < 0
    assert moved(x_screw_3=20.0)["x"] > 0
    assert moved(z_screw_3=20.0)["z"] < 0


def test_layers_of_air_and_a_warm_side_are_felt(machine: FullModel) -> None:
    layers = steady(machine, {}, np.array([0.0, 1.0, 0.0]), {})
    assert machine.places["column_front_right"] @ layers > machine.places["column_front_right_low"] @ layers
    assert machine.places["column_front_right_low"] @ layers > machine.places["bed_front"] @ layers
    side = steady(machine, {}, np.array([0.0, 0.0, 1.0]), {})
    assert machine.places["column_rear_right"] @ side > 0.05 > -0.05 > machine.places["column_rear_left"] @ side
    assert machine.observables["b"] @ side > 0


def test_the_coolant_takes_the_spindles_heat(machine: FullModel) -> None:
    without = steady(machine, {"stator": 300.0}, np.zeros(3), {"rotation": 0.8})
    with_it = steady(machine, {"stator": 300.0, "coolant": -200.0}, np.zeros(3), {"rotation": 0.8, "flow": 1.0})
    assert machine.places["motor"] @ with_it < 0.7 * (machine.places["motor"] @ without)


def test_the_tool_is_a_machine_too() -> None:
    model = tool()
    assert model.inputs == ("heater", "tip", "surface")
    assert {"t1", "t8", "surface"} <= set(model.places)
    assert np.abs(model.stiffness({}) @ model.one - model.air_heat({})[:, 0]).max() < 1e-9
    warm = steady(model, {"heater": 30.0}, np.zeros(3), {})
    assert model.places["t8"] @ warm > model.places["t1"] @ warm > 0
    assert model.observables["s1"] @ warm > model.observables["s2"] @ warm > model.observables["s3"] @ warm > 0
