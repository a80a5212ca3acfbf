"""The nonlinear machines: the linear ones in the limit, energy, fixed points, and what opens and closes in them."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from nonlinearmachines import AIR, HEATED, at, steps
from numpy.typing import NDArray

from thermocomp.core.exceptions import InputError
from thermocomp.virtual.centre import CentreState, MachiningCentre
from thermocomp.virtual.convection import Face, Faces
from thermocomp.virtual.datasets import EXPERIMENTS, record
from thermocomp.virtual.machine import Air, FeedDrive
from thermocomp.virtual.nonlinear import CENTRE_FACES, TAPER, TOOL_FACES, NonlinearCentre, NonlinearTool
from thermocomp.virtual.statespace import ReducedModel
from thermocomp.virtual.toolsystem import RestingTool, ToolState

FloatArray = NDArray[np.float64]
HOUR = 3600.0
LINEAR_TOOL: dict[str, Any] = {"faces": {}, "taper": None, "grip": None, "expansion_grows": 0.0}
LINEAR_CENTRE: dict[str, Any] = LINEAR_TOOL | {"seat": None, "front": None, "rear": None}
del LINEAR_CENTRE["grip"]


@pytest.fixture(scope="module")
def tool() -> NonlinearTool:
    return NonlinearTool()


@pytest.fixture(scope="module")
def centre() -> NonlinearCentre:
    return NonlinearCentre()


# -- limits --------------------------------------------------------------------------------------------------------


def test_without_all_that_is_nonlinear_the_tool_is_the_linear_one() -> None:
    model = ReducedModel.load("tool_joints")
    machine = NonlinearTool(model=model, **LINEAR_TOOL)
    linear = RestingTool(model=model, convection=0.0, stiction=0.0)
    drives = [HEATED] * 200 + [FeedDrive()] * 100
    found, known = (m.run(m.init(AIR), drives, steps(300), 30.0)[1] for m in (machine, linear))
    np.testing.assert_allclose(found.temperatures, known.temperatures, atol=1e-9)
    np.testing.assert_allclose(found.observables, known.observables, atol=1e-9)


def test_without_all_that_is_nonlinear_the_centre_is_the_linear_one() -> None:
    model = ReducedModel.load("centre_joints")
    drives = (
        [FeedDrive(2600.0, (500.0, 500.0, 0.0))] * 200 + [FeedDrive(1000.0, cooled=False)] * 50 + [FeedDrive()] * 100
    )
    machines = (NonlinearCentre(model=model, **LINEAR_CENTRE), MachiningCentre(model=model))
    found, known = (m.run(m.init(AIR), drives, steps(350), 30.0)[1] for m in machines)
    np.testing.assert_allclose(found.temperatures, known.temperatures, atol=1e-9)
    np.testing.assert_allclose(found.observables, known.observables, atol=1e-9)


def test_films_that_do_not_change_are_those_of_the_model(tool: NonlinearTool) -> None:
    """A face whose conductance is a number: put in beside the model, or in the model, it is the same heat."""

    class Constant(Faces):
        def conductance(self, *_: object, **__: object) -> FloatArray:
            return self.linear(0.0)

    model = tool.model
    known = RestingTool(model=model, convection=0.0, stiction=0.0)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("thermocomp.virtual.nonlinear.Faces", Constant)
        machine = NonlinearTool(model=model, **LINEAR_TOOL | {"faces": TOOL_FACES})
        _, truth = machine.run(machine.init(AIR), [HEATED] * 100, steps(100), 60.0)
    _, expected = known.run(known.init(AIR), [HEATED] * 100, steps(100), 60.0)
    np.testing.assert_allclose(truth.temperatures, expected.temperatures, atol=1e-8)


def test_the_new_models_answer_like_the_old_ones() -> None:
    """Two reductions of one full model, each good to 1 % of a drift."""
    drives = [FeedDrive(2600.0)] * 540 + [FeedDrive()] * 540
    for old, new in ((MachiningCentre(), MachiningCentre(model=ReducedModel.load("centre_joints"))),):
        first, second = (m.run(m.init(AIR), drives, steps(1080), 20.0)[1] for m in (old, new))
        for name in ("z", "y", "tip", "front_seat", "shaft"):
            known, found = at(old, first, name), at(new, second, name)
            assert np.abs(known - found).max() < 0.01 * np.ptp(known), name


@pytest.mark.parametrize("machine", [NonlinearTool(), NonlinearCentre()])
def test_at_rest_in_its_air_it_stays_as_it_is(machine: Any) -> None:
    start = machine.init(AIR)
    _, truth = machine.run(start, [FeedDrive(powered=False)] * 200, steps(200), 60.0)
    np.testing.assert_allclose(truth.temperatures, 22.0, atol=1e-8)
    np.testing.assert_allclose(truth.observables, truth.observables[:1].repeat(200, 0), atol=1e-7)


# -- energy --------------------------------------------------------------------------------------------------------


def left_over(
    model: ReducedModel, fields: FloatArray, rates: Callable[[FloatArray], float], heat: FloatArray, dt: float
) -> float:
    """Return what is stored beyond what came in and went out, as a share of the heat that came in."""
    stored = model.one @ (fields[-1] - fields[0])
    went = np.array([rates(z) for z in fields])
    return float(abs(stored - np.trapezoid(heat + went, dx=dt)) / np.trapezoid(np.abs(heat), dx=dt))


def test_what_comes_into_the_tool_is_stored_or_lost_to_the_air(tool: NonlinearTool) -> None:
    model, dt = tool.model, 2.0
    faces = Faces(list(TOOL_FACES.values()))
    rows, air = model.rows(tuple(TOOL_FACES)), AIR.values

    def loss(z: FloatArray) -> float:
        rise = rows @ z - air[0]
        extra = (faces.conductance(rows @ z, air[0]) - faces.linear(0.0)) @ rise
        return float(model.one @ (model.to_air(()) @ air - model.stiffness(()) @ z) - extra)

    state, fields = tool.init(AIR), [tool.init(AIR).field]
    for _ in range(900):
        state, _ = tool.run(state, [HEATED], air[None], dt)
        fields.append(state.field)
    balance = left_over(model, np.array(fields), loss, np.full(901, 65.0), dt)
    assert balance < 1e-3
    # the joints move heat, and neither make nor lose it
    for joint in ("taper", "grip"):
        a, b = (model.inputs.index(f"{joint}_{side}") for side in "ab")
        assert model.one @ (model.heat[:, a] - model.heat[:, b]) == pytest.approx(0.0, abs=1e-9)


def test_long_heated_the_tool_loses_what_it_gets(tool: NonlinearTool) -> None:
    _, truth = tool.run(tool.init(AIR), [HEATED] * 1000, steps(1000), 300.0)
    names = list(TOOL_FACES)
    surface = np.array([at(tool, truth, name)[-1] for name in names])
    lost = Faces(list(TOOL_FACES.values())).conductance(surface, 22.0) @ (surface - 22.0)
    foot = 60.0 * np.pi * 0.1**2 * (at(tool, truth, "on_foot")[-1] - 22.0)
    assert lost + foot == pytest.approx(65.0, rel=2e-3)


def test_what_comes_into_the_centre_is_stored_or_lost(centre: NonlinearCentre) -> None:
    model, air, drive, dt = centre.model, AIR.values, FeedDrive(2560.0, cooled=False), 5.0
    faces = Faces(list(CENTRE_FACES.values()))
    theta = centre._theta(drive)
    rows = model.rows((*CENTRE_FACES, "enclosure"))
    given = sum(centre.heat.given(drive).values())

    def loss(z: FloatArray) -> float:
        *surface, enclosure = rows @ z
        room = np.array([name not in ("spindle_rotating", "spindle_front") for name in CENTRE_FACES])
        around = np.where(room, air[0], enclosure)
        wind = centre.heat.rotation(drive.speed)
        extra = faces.conductance(surface, around, drive.speed, wind) - faces.linear(
            theta[model.theta.index("rotation")]
        )
        return float(
            model.one @ (model.to_air(theta) @ air - model.stiffness(theta) @ z)
            - extra[room] @ (surface - around)[room]
        )

    def heat(z: FloatArray) -> float:
        return given + sum(centre._friction(drive, (model.rows(centre._watched) @ z).tolist()))

    state, fields = centre.init(AIR), [centre.init(AIR).field]
    for _ in range(720):
        state, _ = centre.run(state, [drive], air[None], dt)
        fields.append(state.field)
    put_in = np.array([heat(z) for z in fields])
    assert put_in[-1] > 400.0
    assert left_over(model, np.array(fields), loss, put_in, dt) < 2e-3


# -- what feeds back -----------------------------------------------------------------------------------------------


def test_preload_settles_where_its_fixed_point_is() -> None:
    """Friction warms the inner ring, which tightens the bearing, which makes heat: solved by hand, and by running."""
    machine = NonlinearCentre(faces={}, taper=None, seat=None, rear=None, longest_step=2000.0)
    drive = FeedDrive(3000.0, cooled=False)
    assert machine.front is not None
    model, theta = machine.model, machine._theta(drive)
    given = machine._given(drive)
    rows = model.rows(machine._watched)
    heat, front = given.copy(), 0.0
    for _ in range(200):
        z = model.steady(heat, AIR.values, theta)
        front, rear = machine._friction(drive, (rows @ z).tolist())
        heat = given.copy()
        heat[model.inputs.index("front_bearing")] += front
        heat[model.inputs.index("rear_bearing")] += rear
    state, truth = machine.run(machine.init(AIR), [drive] * 2000, steps(2000), 2000.0)
    np.testing.assert_allclose(truth.temperatures[-1], model.temperature @ z, atol=0.02)
    seen = dict(zip(machine._watched, machine.model.rows(machine._watched) @ state.field, strict=True))
    sprung = replace(machine, rear=NonlinearCentre().rear)
    assert sprung.rear is not None
    _, rear = sprung._friction(drive, list(seen.values()))
    assert rear == pytest.approx(sprung.rear.heat(3000.0, seen["rear_bearing"], sprung.rear.mounted))
    # without the feedback of temperatures it would be another one: the preload has grown, its heat too
    inner, outer = (at(machine, truth, name)[-1] for name in ("balls_a", "balls_b"))
    approach = float(machine.front.approach(inner, outer))
    assert machine.front.force(approach) > 1.5 * machine.front.preload
    fixed = machine.front.heat(3000.0, at(machine, truth, "front_bearing")[-1], machine.front.mounted)
    assert front > 1.05 * fixed


def test_a_stiffer_step_does_not_make_it_unstable() -> None:
    """A joint that conducts a hundred times as well, in steps of minutes: heat passes, and nothing rings."""
    machine = NonlinearTool(taper=replace(TAPER, conductivity=4200.0), longest_step=600.0)
    _, truth = machine.run(machine.init(AIR), [HEATED] * 60, steps(60), 600.0)
    shaft, shank = (at(machine, truth, f"taper_{side}") for side in "ab")
    assert np.abs(shaft - shank)[5:].max() < 0.1
    assert (np.diff(at(machine, truth, "t1"))[:20] > 0).all()


@pytest.mark.parametrize("cooled", [False, True])
def test_the_step_size_hardly_matters(cooled: bool) -> None:
    drives = [FeedDrive(3000.0 * (k // 12 % 2 == 0), cooled=cooled) for k in range(48)]
    fine, coarse = (
        m.run(m.init(AIR), drives, steps(48), 300.0)[1]
        for m in (NonlinearCentre(longest_step=2.5), NonlinearCentre(longest_step=20.0))
    )
    np.testing.assert_allclose(coarse.temperatures, fine.temperatures, atol=0.1)
    np.testing.assert_allclose(coarse.observables, fine.observables, atol=0.2)
    tools = NonlinearTool(longest_step=2.5), NonlinearTool(longest_step=20.0)
    fine, coarse = (m.run(m.init(AIR), [HEATED] * 48, steps(48), 300.0)[1] for m in tools)
    np.testing.assert_allclose(coarse.temperatures, fine.temperatures, atol=0.05)
    np.testing.assert_allclose(coarse.observables, fine.observables, atol=0.15)


# -- as all machines -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("machine", "drives"),
    [
        (NonlinearTool(), [HEATED] * 70 + [FeedDrive(loads={"tip": 8.0})] * 60 + [FeedDrive()] * 70),
        (NonlinearCentre(), [FeedDrive(2000.0, (600.0, 0.0, 600.0))] * 100 + [FeedDrive()] * 100),
    ],
)
def test_in_blocks_it_is_the_same_and_nothing_hides_in_it(machine: Any, drives: list[FeedDrive]) -> None:
    air = steps(200)
    air[:, 0] += np.linspace(0.0, 3.0, 200)
    start = machine.init(AIR)
    kept = start.field.copy()
    end, whole = machine.run(start, drives, air, 30.0)
    state, parts = start, []
    for block in (slice(0, 1), slice(1, 90), slice(90, 140), slice(140, 200)):
        state, truth = machine.run(state, drives[block], air[block], 30.0)
        parts.append(truth)
    np.testing.assert_allclose(np.vstack([p.observables for p in parts]), whole.observables, atol=1e-9)
    np.testing.assert_allclose(np.vstack([p.temperatures for p in parts]), whole.temperatures, atol=1e-9)
    np.testing.assert_array_equal(start.field, kept)
    assert machine.run(start, drives, air, 30.0)[0].field.tobytes() == end.field.tobytes()


def test_heat_without_a_place_is_refused(tool: NonlinearTool, centre: NonlinearCentre) -> None:
    for place in ("on_chuck", "taper_a", "surface"):
        with pytest.raises(InputError, match=f"'{place}', only at heater, hot_air, tip$"):
            tool.run(tool.init(AIR), [FeedDrive(loads={place: 5.0})], steps(1), 1.0)
    with pytest.raises(InputError, match="exceeds the top speed of the machine, 3500"):
        centre.run(centre.init(AIR), [FeedDrive(4000.0)], steps(1), 1.0)


def test_a_recording_can_be_made_on_either(tmp_path: Any) -> None:
    linear, same, other = (record("hwang", physics=p, seed=2)[0] for p in (None, "linear", "nonlinear"))
    assert linear.table.equals(same.table)
    assert list(linear.table) == list(other.table)
    assert not linear.table.equals(other.table)
    path = tmp_path / "mine.toml"
    text = 'sampling = "60 s"\nmachine = "tool"\nphysics = "nonlinear"\nduration = "30 min"\nloads = { heater = 40 }\n'
    path.write_text(text)
    (mine,) = record(path, seed=1)
    path.write_text(text.replace("nonlinear", "linear"))
    assert mine.table.equals(record(path, physics="nonlinear", seed=1)[0].table)
    assert not mine.table.equals(record(path, seed=1)[0].table)
    path.write_text(text.replace("nonlinear", "quadratic"))
    with pytest.raises(InputError, match="physics"):
        record(path)
    # only the joints of the nonlinear tool distinguish the mountings
    assert {e.name for e in EXPERIMENTS.values() if e.physics != "linear"} == {"wessel-tool", "wessel-sets"}
    unknown: Any = "quadratic"
    with pytest.raises(InputError, match="no physics 'quadratic'; there are linear, nonlinear"):
        record("hwang", physics=unknown)


def test_states_are_those_of_the_linear_machines(tool: NonlinearTool, centre: NonlinearCentre) -> None:
    assert isinstance(tool.init(AIR), ToolState)
    assert isinstance(centre.init(AIR), CentreState)
    assert tool.init(Air(20.0)).slipped == 0.0
    assert isinstance(TOOL_FACES["on_tool"], Face)
