"""The resting tool: its own heat loss, its slipping shank, and where heat goes, against the reduced model by hand."""

import numpy as np
import pytest
from numpy.typing import NDArray

from thermocomp.core.exceptions import InputError
from thermocomp.virtual.machine import Air, FeedDrive, Truth, VirtualMachine
from thermocomp.virtual.nonlinear import MOUNTINGS, NonlinearTool
from thermocomp.virtual.statespace import REFERENCE_TEMPERATURE
from thermocomp.virtual.toolsystem import FOOT, STICTION, RestingTool, ToolState

FloatArray = NDArray[np.float64]
AIR = Air(20.0)
HEATED = FeedDrive(loads={"heater": 40.0})
REST = FeedDrive()


@pytest.fixture(scope="module")
def tool() -> RestingTool:
    return RestingTool()


def run(
    tool: RestingTool, state: ToolState, drive: FeedDrive, hours: float, air: Air = AIR, dt: float = 20.0
) -> tuple[ToolState, Truth]:
    n = round(hours * 3600.0 / dt)
    return tool.run(state, [drive] * n, np.tile(air.values, (n, 1)), dt)


def seen(tool: RestingTool, truth: Truth, name: str) -> FloatArray:
    if name in tool.places:
        return truth.temperatures[:, tool.places.index(name)]
    return truth.observables[:, tool.observables.index(name)]


def long_heated(tool: RestingTool, watts: float, extra: float) -> FloatArray:
    """Return the temperatures that constant heat leads to, with extra heat put in over the surface [W]."""
    model = tool.model
    heat = np.zeros(len(model.inputs))
    heat[model.inputs.index("heater")], heat[model.inputs.index("surface")] = watts, extra
    return np.asarray(model.temperature @ model.steady(heat, AIR.values, ()))


def test_it_fills_the_interface_and_stays_as_it_is(tool: RestingTool) -> None:
    machine: VirtualMachine[ToolState] = tool
    air = Air(24.0)
    _, truth = machine.run(machine.init(air), [REST] * 50, np.tile(air.values, (50, 1)), 60.0)
    assert truth.temperatures.shape == (50, len(tool.places))
    np.testing.assert_allclose(truth.temperatures, 24.0, atol=1e-8)
    # evenly warm it is longer than at 20 degC by alpha (T - 20 degC): 5 to 12 um/K times 0.2 to 0.4 m
    for name, low, high in (("s1", 4.0, 20.0), ("s2", 4.0, 15.0), ("s3", 3.0, 12.0)):
        course = seen(tool, truth, name)
        assert low < course[0] < high
        np.testing.assert_allclose(course, course[0], atol=1e-8)


@pytest.mark.parametrize(("watts", "warmer"), [(100.0, False), (3.0, True)])
def test_its_loss_grows_faster_than_its_temperature(tool: RestingTool, watts: float, warmer: bool) -> None:
    surface = tool.places.index("surface")

    def correction(rise: float) -> float:
        """Heat that free convection, with the power 5/4 of the rise, takes less than the films of the model do."""
        linear = tool.convection * rise
        return float(linear - linear * (rise / tool.usual_rise) ** 0.25)

    # the surface's rise that fits: the correction makes less of it the greater it is
    low, high = 0.0, 500.0
    for _ in range(60):
        rise = (low + high) / 2.0
        fits = long_heated(tool, watts, correction(rise))[surface] - AIR.temperature
        low, high = (rise, high) if fits > rise else (low, rise)
    expected = long_heated(tool, watts, correction(rise))
    _, truth = run(tool, tool.init(AIR), FeedDrive(loads={"heater": watts}), 60.0, dt=60.0)
    np.testing.assert_allclose(truth.temperatures[-1], expected, atol=0.01)
    # beside the linear model: warmer below the usual rise, colder above
    linear = long_heated(tool, watts, 0.0)
    assert (rise < tool.usual_rise) == warmer
    assert abs(rise - (linear[surface] - AIR.temperature)) > 0.02 * rise
    assert bool(expected[surface] > linear[surface]) == warmer


def test_without_the_correction_it_is_the_reduced_model() -> None:
    tool = RestingTool(convection=0.0, stiction=0.0)
    state, truth = run(tool, tool.init(AIR), HEATED, 1.0)
    model = tool.model
    heat = np.zeros(len(model.inputs))
    heat[model.inputs.index("heater")] = 40.0
    operators = model.operators((), 3600.0)
    field = operators.state @ tool.init(AIR).field + operators.heat @ heat + operators.air @ AIR.values
    np.testing.assert_allclose(state.field, field, atol=1e-6)
    np.testing.assert_allclose(truth.temperatures[-1], model.temperature @ field, atol=1e-6)
    linear = model.observable @ (field - REFERENCE_TEMPERATURE * model.one)
    np.testing.assert_allclose(truth.observables[-1], linear, atol=1e-6)


def test_only_the_clamped_tool_slips() -> None:
    held, free = RestingTool(stiction=0.8), RestingTool(stiction=0.0)
    warm, cold = [], []
    for tool in (held, free):
        state, up = run(tool, tool.init(AIR), HEATED, 2.0)
        warm.append(up)
        cold.append(run(tool, state, REST, 2.0)[1])
    for name in ("s2", "s3"):
        for pair in (warm, cold):
            np.testing.assert_allclose(seen(held, pair[0], name), seen(free, pair[1], name), atol=1e-9)
    rising, falling = (seen(held, pair[0], "s1") - seen(free, pair[1], "s1") for pair in (warm, cold))
    # From rest friction holds the shank until it wants to slip 0.8 um; then it lags by so much, on the way back too.
    assert np.abs(np.concatenate([rising, falling])).max() <= 0.8 + 1e-9
    assert rising[-1] == pytest.approx(-0.8)
    assert falling[-1] == pytest.approx(0.8)
    wish = seen(free, warm[1], "s1") - seen(free, warm[1], "s2")
    still = np.abs(wish) < 0.8
    assert 5 < still.sum() < len(still)
    np.testing.assert_allclose(rising[still], -wish[still], atol=1e-9)
    np.testing.assert_allclose(warm[0].temperatures, warm[1].temperatures)


def test_a_warm_start_has_slipped_already() -> None:
    tool = RestingTool()
    state = tool.init(Air(30.0))
    rise = tool.model.observable @ (state.field - REFERENCE_TEMPERATURE * tool.model.one)
    s1, s2 = (rise[tool.observables.index(n)] for n in ("s1", "s2"))
    assert state.slipped == pytest.approx(s1 - s2)
    assert abs(state.slipped) > 1.0
    cold, _ = run(tool, state, REST, 60.0, dt=60.0)
    assert cold.slipped == pytest.approx(tool.stiction, abs=0.01)  # it keeps what friction holds


@pytest.mark.parametrize(("load", "at"), [("heater", "t8"), ("hot_air", "t1"), ("tip", "t1")])
def test_heat_goes_in_where_it_should(tool: RestingTool, load: str, at: str) -> None:
    for hours in (0.1, 3.0):
        _, truth = run(tool, tool.init(AIR), FeedDrive(loads={load: 20.0}), hours)
        rises = {f"t{k}": seen(tool, truth, f"t{k}")[-1] - 20.0 for k in range(1, 9)}
        assert max(rises, key=lambda place: rises[place]) == at
        assert min(rises.values()) > -1e-6
    # away from where it goes in it falls
    order = [f"t{k}" for k in (8, 6, 5, 4, 3, 2, 1)]
    steps = np.diff([rises[place] for place in order])
    assert (steps < 0).all() if load == "heater" else (steps > 0).all()


def test_loads_add_up_and_need_power(tool: RestingTool) -> None:
    start, air = tool.init(AIR), AIR.values[None]
    linear = RestingTool(convection=0.0)

    def warmed(**loads: float) -> FloatArray:
        rise: FloatArray = linear.run(start, [FeedDrive(loads=loads)], air, 20.0)[1].temperatures[0] - 20.0
        return rise

    np.testing.assert_allclose(warmed(heater=30.0, tip=5.0), 3.0 * warmed(heater=10.0) + warmed(tip=5.0), atol=1e-9)
    # W-15: half of the hot air acts at the tip, where the soldering iron acts with all of its heat
    assert warmed(hot_air=5.0)[tool.places.index("tip")] < 0.7 * warmed(tip=5.0)[tool.places.index("tip")]
    np.testing.assert_allclose(
        tool._given(FeedDrive(loads={"heater": 3.0, "hot_air": 4.0, "tip": 1.0}))[[0, 1, 7]], [3.0, 3.0, 2.0]
    )
    _, off = tool.run(start, [FeedDrive(loads={"heater": 30.0}, powered=False)] * 5, np.tile(air, (5, 1)), 20.0)
    np.testing.assert_allclose(off.temperatures, 20.0, atol=1e-8)


def test_in_blocks_it_is_the_same_and_nothing_hides_in_the_machine(tool: RestingTool) -> None:
    drives = [HEATED] * 70 + [FeedDrive(loads={"tip": 8.0})] * 60 + [REST] * 70
    air = np.tile(AIR.values, (200, 1))
    air[:, 0] += np.linspace(0.0, 3.0, 200)
    start = tool.init(AIR)
    kept = start.field.copy()
    end, whole = tool.run(start, drives, air, 30.0)
    state, parts = start, []
    # the last block begins while friction holds the shank on its way back
    for block in (slice(0, 1), slice(1, 100), slice(100, 140), slice(140, 200)):
        state, truth = tool.run(state, drives[block], air[block], 30.0)
        parts.append(truth)
    np.testing.assert_allclose(np.vstack([p.observables for p in parts]), whole.observables, atol=1e-9)
    np.testing.assert_allclose(np.vstack([p.temperatures for p in parts]), whole.temperatures, atol=1e-9)
    np.testing.assert_allclose(state.field, end.field, atol=1e-9)
    assert state.slipped == pytest.approx(end.slipped)
    np.testing.assert_array_equal(start.field, kept)
    again, _ = tool.run(start, drives, air, 30.0)
    np.testing.assert_array_equal(again.field, end.field)


def test_a_room_that_changes_is_felt_in_its_own_step(tool: RestingTool) -> None:
    # three parts to a step: every part has the air of its step
    air = np.array([[20.0, 0.0, 0.0], [30.0, 0.0, 0.0], [20.0, 0.0, 0.0]])
    _, truth = tool.run(tool.init(AIR), [REST] * 3, air, 60.0)
    t1 = seen(tool, truth, "t1")
    assert t1[0] == pytest.approx(20.0, abs=1e-8)
    assert t1[1] > 20.1
    fine = tool.run(tool.init(AIR), [REST] * 9, np.repeat(air, 3, axis=0), 20.0)[1]
    np.testing.assert_allclose(fine.temperatures[2::3], truth.temperatures, atol=1e-9)
    np.testing.assert_allclose(fine.observables[2::3], truth.observables, atol=1e-9)


@pytest.mark.parametrize("load", ["coolant", "surface", "t1"])
def test_heat_without_a_place_is_refused(tool: RestingTool, load: str) -> None:
    with pytest.raises(InputError, match=f"no heat can be applied at '{load}', only at heater, hot_air, tip$"):
        tool.run(tool.init(AIR), [FeedDrive(loads={load: 5.0})], AIR.values[None], 1.0)


@pytest.mark.parametrize("drive", [FeedDrive(100.0), FeedDrive(feed=(0.0, 0.0, 5.0))])
def test_it_neither_turns_nor_moves(tool: RestingTool, drive: FeedDrive) -> None:
    with pytest.raises(InputError, match="cannot turn or move"):
        tool.run(tool.init(AIR), [REST, drive], np.tile(AIR.values, (2, 1)), 1.0)


def test_unusable_steps_are_refused(tool: RestingTool) -> None:
    state, row = tool.init(AIR), AIR.values[None]
    for dt in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(InputError, match="must be positive"):
            tool.run(state, [REST], row, dt)
    for drives, air in (([], row[:0]), ([REST], np.tile(row, (2, 1))), ([REST] * 2, row)):
        with pytest.raises(InputError, match="one row of three numbers per drive"):
            tool.run(state, drives, air, 1.0)
    with pytest.raises(InputError, match="must be finite"):
        tool.run(state, [REST], np.array([[20.0, float("nan"), 0.0]]), 1.0)
    for load in (float("nan"), float("inf")):
        with pytest.raises(InputError, match="finite"):
            FeedDrive(loads={"heater": load})


@pytest.mark.parametrize("machine", [RestingTool(), NonlinearTool()])
def test_a_warm_foundation_warms_the_foot(machine: RestingTool) -> None:
    """W-15: with a foundation at room temperature nothing flows."""
    warm = machine.mounted("hydraulic", foundation=5.0)
    assert machine.mounted("hydraulic").foundation == 0.0
    rises = {}
    for tool in (machine, warm):
        _, truth = run(tool, tool.init(AIR), REST, 60.0, dt=60.0)
        rises[tool.foundation] = [seen(tool, truth, place)[-1] - 20.0 for place in ("foot", "t7", "t8", "t1")]
    np.testing.assert_allclose(rises[0.0], 0.0, atol=1e-6)
    assert 5.0 > rises[5.0][0] > rises[5.0][1] > rises[5.0][2] > rises[5.0][3] > 0.0
    model = machine.model
    heat = np.zeros(len(model.inputs))
    heat[model.inputs.index("on_foot")] = 5.0 * FOOT
    steady = model.steady(heat, AIR.values, ())
    np.testing.assert_allclose(warm.init(AIR).field, steady)


def test_each_mounting_holds_the_shank_as_its_joint_does() -> None:
    """W-10: slip limit in proportion to pressure and squared length; heat passes a shrink chuck best."""
    hold = {m: float(fit.pressure(20.0, 20.0)) * fit.length**2 for m, fit in MOUNTINGS.items()}
    for mounting, limit in STICTION.items():
        assert limit == pytest.approx(STICTION["hydraulic"] * hold[mounting] / hold["hydraulic"], rel=0.1)
        assert RestingTool().mounted(mounting).stiction == limit
        assert NonlinearTool().mounted(mounting).grip is MOUNTINGS[mounting]
    conducts = {m: fit.conductance(30.0, 30.0) for m, fit in MOUNTINGS.items()}
    assert conducts["shrink"] > 2.0 * max(conducts["hydraulic"], conducts["collet"])
    # torque that slips: 2 pi r^2 L friction p [N m]
    torque = {
        m: 2e-3 * np.pi * f.radius**2 * f.length * f.friction * float(f.pressure(20.0, 20.0))
        for m, f in MOUNTINGS.items()
    }
    assert {m: round(t, -1) for m, t in torque.items()} == {"hydraulic": 330.0, "shrink": 530.0, "collet": 200.0}
