"""Heat of the virtual machining centre: where it is put in, when it is taken away, and what the foot keeps of it."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from thermocomp.core.exceptions import InputError
from thermocomp.virtual.centre import CentreState, MachiningCentre
from thermocomp.virtual.heat import BearingFriction, HeatSources
from thermocomp.virtual.joints import Joints
from thermocomp.virtual.machine import Air, FeedDrive, Truth
from thermocomp.virtual.statespace import REFERENCE_TEMPERATURE, ReducedModel

FloatArray = NDArray[np.float64]
AIR = Air(20.0)
HEAT = HeatSources()
NONE = BearingFriction(viscous=0.0, load=0.0)
#: no heat of its own: bearings, motor, pump, cabinet, hydraulics, Y
COLD = replace(
    HEAT, front=NONE, rear=NONE, motor_on=0.0, motor_top=0.0, pump=0.0, cabinet=0.0, hydraulics=0.0, hold=0.0
)
TOP = FeedDrive(HEAT.top_speed, cooled=False)


@pytest.fixture(scope="module")
def model() -> ReducedModel:
    return ReducedModel.load("centre")


@pytest.fixture(scope="module")
def hot(model: ReducedModel) -> CentreState:
    """A machine that has turned for hours, the coolant off."""
    machine = MachiningCentre(model, longest_step=60.0)
    return run(machine, machine.init(AIR), FeedDrive(3000.0, cooled=False), 3.0, dt=60.0)[0]


def run(
    machine: MachiningCentre, state: CentreState, drive: FeedDrive, hours: float, air: Air = AIR, dt: float = 20.0
) -> tuple[CentreState, Truth]:
    """Run with one drive; one step at least."""
    n = max(1, round(hours * 3600.0 / dt))
    return machine.run(state, [drive] * n, np.tile(air.values, (n, 1)), dt)


def seen(machine: MachiningCentre, truth: Truth, name: str) -> FloatArray:
    if name in machine.places:
        return truth.temperatures[:, machine.places.index(name)]
    return truth.observables[:, machine.observables.index(name)]


def warm_at(model: ReducedModel, **heat: float) -> CentreState:
    """Return a machine that this heat has warmed for long, without its foot having slipped."""
    watts = np.array([heat.get(name, 0.0) for name in model.inputs])
    return CentreState(model.steady(watts, AIR.values, (0.0,) * len(model.theta)), chilling=False, slid=0.0)


def temperature(model: ReducedModel, state: CentreState, place: str) -> float:
    return float((model.rows((place,)) @ state.field).item())


# ------------------------------------------------------------------------------------------------------- what is given
def test_the_motors_loss_is_split() -> None:
    sources = HeatSources(motor_on=40.0, motor_top=400.0, rotor_share=0.25, cabinet=10.0, cabinet_share=0.1)
    half = sources.given(FeedDrive(sources.top_speed / 2.0))
    assert half["rotor"] == pytest.approx(0.25 * 140.0)  # iron and windage with the square of speed
    assert half["stator"] == pytest.approx(0.75 * 140.0)
    assert half["cabinet"] == pytest.approx(10.0 + 0.1 * 140.0)
    assert sources.given(FeedDrive(-sources.top_speed / 2.0)) == half
    at_rest = sources.given(FeedDrive())
    assert (at_rest["rotor"], at_rest["stator"], at_rest["cabinet"]) == (0.0, 0.0, 10.0)  # not even magnetised


def test_what_runs_whenever_the_machine_is_on() -> None:
    on = HEAT.given(FeedDrive(cooled=False))
    assert {k: v for k, v in on.items() if v} == {
        "cabinet": HEAT.cabinet,
        "hydraulics": HEAT.hydraulics,
        "y_bearing": HEAT.hold,
    }
    assert HEAT.given(FeedDrive()) == on | {"coolant": HEAT.pump}
    assert HEAT.given(FeedDrive(powered=False, loads={"tool_tip": 50.0})) == {}


def test_a_feed_drive_warms_nut_screw_and_bearing() -> None:
    sources = HeatSources(drive_nut=10.0, drive_bearing=20.0, screw_share=0.3, hold=7.0)
    given = sources.given(FeedDrive(feed=(500.0, -2000.0, 0.0), stroke=(None, (100.0, 300.0), None)))
    rest = sources.given(FeedDrive())
    extra = {k: v - rest[k] for k, v in given.items()}
    assert (extra["x_nut"], extra["y_nut"], extra["z_nut"]) == pytest.approx((3.5, 14.0, 0.0))
    assert (extra["x_bearing"], extra["y_bearing"], extra["z_bearing"]) == pytest.approx((10.0, 40.0, 0.0))
    assert rest["y_bearing"] == 7.0  # Y hangs: its motor holds
    screws = {axis: [extra[f"{axis}_screw_{k}"] for k in range(7)] for axis in "xyz"}
    assert [sum(s) for s in screws.values()] == pytest.approx([1.5, 6.0, 0.0])
    assert screws["x"] == pytest.approx([1.5 / 12, *[1.5 / 6] * 5, 1.5 / 12])
    # its hats are 550 mm / 6 apart: nothing of 100 to 300 mm is at the first one or beyond the fifth
    assert screws["y"][0] == screws["y"][5] == screws["y"][6] == 0.0
    assert min(screws["y"][1:5]) > 0.0


def test_loads_come_on_top() -> None:
    drive = FeedDrive(1000.0)
    loads = {"tool_tip": 60.0, "stator": 5.0, "coolant": -30.0, "y_bearing": 1.0}
    given, own = HEAT.given(replace(drive, loads=loads)), HEAT.given(drive)
    assert {k: v - own.get(k, 0.0) for k, v in given.items() if v != own.get(k, 0.0)} == pytest.approx(loads)
    assert HEAT.given(drive) == own


def test_convection_grows_with_speed_to_the_power_of_two_thirds() -> None:
    # Becker 1963: Nu = 0.133 Re^(2/3) Pr^(1/3)
    assert HEAT.rotation(HEAT.top_speed / 8.0) == pytest.approx(0.25)
    assert HEAT.rotation(-HEAT.top_speed) == 1.0
    assert HEAT.rotation(0.0) == 0.0
    assert HEAT.moving(HEAT.top_feed / 27.0) == pytest.approx(1.0 / 9.0)
    assert HEAT.moving(-3.0 * HEAT.top_feed) == 1.0


# -------------------------------------------------------------------------------------------------------- the chiller
@pytest.mark.parametrize(
    ("chilling", "before", "after", "share"),
    [
        # starts at 0.3 K, stops at -1.3 K above the bed
        (False, -0.1, 0.2, 1.0),
        (False, -0.1, 0.5, 2.0 / 3.0),
        (True, 0.0, -1.2, 1.0),
        (True, -0.9, -1.7, 0.5),
        # beyond the limit already: at once, wherever it goes
        (False, 0.5, 1.0, 0.0),
        (False, 0.5, 0.4, 0.0),
        (False, 0.5, 0.5, 0.0),
        (False, 0.5, 0.1, 0.0),
        (True, -1.5, -1.7, 0.0),
        (True, -1.5, -1.4, 0.0),
        (True, -1.5, -1.0, 0.0),
        # of the other switch's limit it knows nothing
        (False, -2.0, -1.9, 1.0),
        (True, 2.0, 1.0, 1.0),
    ],
)
def test_the_thermostat_switches_where_the_limit_is_crossed(
    chilling: bool, before: float, after: float, share: float
) -> None:
    sources = HeatSources(setpoint=-0.5, half_band=0.8)
    assert sources.until_switch(chilling, before, after) == pytest.approx(share)


def test_the_chiller_comes_on_after_a_start_with_warm_coolant(model: ReducedModel) -> None:
    machine, without = (MachiningCentre(model, heat=replace(HEAT, chiller=watts)) for watts in (1500.0, 0.0))
    warm, _ = run(machine, machine.init(AIR), FeedDrive(cooled=False, loads={"coolant": 600.0}), 0.5)
    assert temperature(model, warm, "coolant") > temperature(model, warm, "bed_front") + 2.0
    assert not warm.chilling
    after, chilled = run(machine, warm, FeedDrive(), 60.0 / 3600.0)
    assert after.chilling
    _, pumped = run(without, warm, FeedDrive(), 60.0 / 3600.0)
    falls = seen(machine, chilled, "coolant") - seen(machine, pumped, "coolant")
    # from the first step on, and all of it: 1500 W taken from the coolant
    theta, at = tuple(float(name == "flow") for name in model.theta), model.inputs.index("coolant")
    gains = [model.operators(theta, dt, ("coolant",)).heat[-1, at] for dt in (20.0, 40.0, 60.0)]
    assert falls == pytest.approx([-1500.0 * gain for gain in gains])
    assert falls[-1] < -0.3


def test_a_machine_switched_off_hot_neither_chills_nor_warms_itself(model: ReducedModel) -> None:
    machine = MachiningCentre(model)
    state, truth = run(machine, machine.init(AIR), FeedDrive(3500.0), 2.0)
    chilling = state
    while not chilling.chilling:  # stop it while the chiller runs
        chilling, _ = run(machine, chilling, FeedDrive(3500.0), 0.0)
    off = FeedDrive(powered=False)
    end, alone = run(machine, chilling, off, 1.0)
    assert not run(machine, chilling, off, 0.0)[0].chilling
    assert not end.chilling
    # only conduction and air: one exact step of the reduced model without heat, coolant loop and rotation
    step = model.operators((0.0,) * len(model.theta), 3600.0)
    np.testing.assert_allclose(end.field, step.state @ chilling.field + step.air @ AIR.values, atol=1e-6)
    assert seen(machine, alone, "front_bearing")[-1] < seen(machine, truth, "front_bearing")[-1] - 1.0
    # the loop stands still without power, whatever is asked of it
    loaded, _ = run(machine, chilling, FeedDrive(powered=False, cooled=True, loads={"coolant": 500.0}), 1.0)
    np.testing.assert_allclose(loaded.field, end.field, atol=1e-9)


@pytest.mark.parametrize(("speed", "feed"), [(100.0, (0.0, 0.0, 0.0)), (0.0, (0.0, 5.0, 0.0))])
def test_a_machine_switched_off_cannot_be_driven(speed: float, feed: tuple[float, float, float]) -> None:
    with pytest.raises(InputError, match="switched off"):
        FeedDrive(speed, feed, powered=False)


@pytest.mark.parametrize("stroke", [(-1.0, 100.0), (0.0, 551.0), (float("nan"), 100.0)])
def test_what_cannot_be_driven_is_refused(stroke: tuple[float, float]) -> None:
    with pytest.raises(InputError, match="of Y is beyond 0 to 550 mm"):
        FeedDrive(feed=(0.0, 500.0, 0.0), stroke=(None, stroke, None))
    with pytest.raises(InputError, match="y = nan"):
        FeedDrive(feed=(0.0, float("nan"), 0.0))
    with pytest.raises(InputError, match="speed = inf"):
        FeedDrive(float("inf"))


def test_a_run_needs_drives_and_an_air_for_each(model: ReducedModel) -> None:
    machine, row = MachiningCentre(model), AIR.values[None]
    for drives, air in (([], row[:0]), ([FeedDrive()], np.tile(row, (2, 1))), ([FeedDrive()] * 2, row)):
        with pytest.raises(InputError, match="one row of three numbers per drive"):
            machine.run(machine.init(AIR), drives, air, 20.0)


# ------------------------------------------------------------------------------------------------ rotation and friction
def test_a_turning_spindle_cools_faster_than_a_standing_one(model: ReducedModel, hot: CentreState) -> None:
    machine = MachiningCentre(model, heat=COLD)
    _, stands = run(machine, hot, FeedDrive(cooled=False), 0.5)
    _, turns = run(machine, hot, TOP, 0.5)
    # the wind was strong before: in still air the hot shaft warms the tool, in wind it falls with all others
    assert seen(machine, turns, "tool")[-1] < seen(machine, stands, "tool")[-1] - 5.0
    assert seen(machine, turns, "tool")[-1] < temperature(model, hot, "tool") - 1.0
    assert seen(machine, turns, "shaft")[-1] < seen(machine, stands, "shaft")[-1] - 1.0
    # the share in force is that of Becker's power, in 64ths
    eighth, _ = run(machine, hot, FeedDrive(HEAT.top_speed / 8.0, cooled=False), 0.0)
    theta = tuple(0.25 * (name == "rotation") for name in model.theta)
    step = model.operators(theta, 20.0)
    np.testing.assert_allclose(eighth.field, step.state @ hot.field + step.air @ AIR.values, atol=1e-9)


@pytest.mark.parametrize("warm", ["front_bearing", "rear_bearing"])
@pytest.mark.parametrize("bearing", ["front", "rear"])
def test_each_bearings_friction_has_its_own_temperature(model: ReducedModel, warm: str, bearing: str) -> None:
    """One step with the friction and one without: the rest is what one watt does, times Palmgren's watts."""
    friction = BearingFriction(viscous=200.0, load=80.0, thinning=0.02, preload_gain=0.05)
    heat = replace(COLD, front=friction) if bearing == "front" else replace(COLD, rear=friction)
    state = warm_at(model, **{warm: 200.0})
    rubbing, free = (MachiningCentre(model, heat=h).run(state, [TOP], AIR.values[None], 20.0)[0] for h in (heat, COLD))
    place = f"{bearing}_bearing"
    theta = tuple(float(name == "rotation") for name in model.theta)
    watt = model.operators(theta, 20.0).heat[:, model.inputs.index(place)]
    own = temperature(model, state, place)
    tightening = temperature(model, state, "shaft") - temperature(model, state, "front_seat")
    # the springs of the rear bearing give way: its preload stays
    tight = 1.0 + 0.05 * max(0.0, tightening) if bearing == "front" else 1.0
    expected = 200.0 * np.exp(-0.02 * (own - 40.0)) + 80.0 * tight
    np.testing.assert_allclose(rubbing.field - free.field, expected * watt, atol=1e-8)
    # and the two temperatures are far enough apart to be told
    other = temperature(model, state, "front_bearing" if bearing == "rear" else "rear_bearing")
    assert abs(own - other) > 5.0
    if warm == "front_bearing":
        assert tightening > 1.0


# ------------------------------------------------------------------------------------------------------------ the foot
def test_a_foot_that_has_rested_long_has_slid_as_it_wished(model: ReducedModel) -> None:
    machine = MachiningCentre(model)
    state = machine.init(Air(32.0, stratification=1.0))
    rise = state.field - REFERENCE_TEMPERATURE * model.one
    wish = float(model.observable[model.observables.index("slide")] @ rise)
    assert state.slid == pytest.approx(wish)
    assert abs(wish) > 0.1
    _, truth = run(machine, state, FeedDrive(powered=False), 0.0, Air(32.0, stratification=1.0))
    z = float(model.observable[model.observables.index("z")] @ rise)
    assert seen(machine, truth, "z")[0] == pytest.approx(z, abs=1e-6)  # nothing is held back
    assert not state.chilling


def test_half_of_what_the_foot_does_not_slide_moves_the_tool(model: ReducedModel) -> None:
    held, free = (MachiningCentre(model, joints=Joints(stiction=s, preload=0.0)) for s in (1.0, 0.0))
    drive = FeedDrive(feed=(0.0, 0.0, 10_000.0), loads={"cabinet": 300.0})
    (_, stuck), (_, slides) = (run(m, m.init(AIR), drive, 6.0, dt=60.0) for m in (held, free))
    short = seen(held, stuck, "slide") - seen(free, slides, "slide")
    # without friction it is the linear model; the foot has grown on the bed by more than friction holds
    assert seen(free, slides, "slide")[-1] > 1.5
    assert short[-1] == pytest.approx(-1.0)
    assert short.min() >= -1.0 - 1e-9
    np.testing.assert_allclose(seen(held, stuck, "z") - seen(free, slides, "z"), 0.5 * short, atol=1e-9)
    for name in ("x", "y", "a", "b", "nose", "tip", "zz@300"):
        np.testing.assert_allclose(seen(held, stuck, name), seen(free, slides, name), atol=1e-9)


def test_without_friction_speed_and_warm_shaft_the_tool_point_is_linear(model: ReducedModel, hot: CentreState) -> None:
    joints = Joints(stiction=0.0, preload=0.7, centrifugal=3.0, lift=-2.0)
    machine = MachiningCentre(model, joints=joints)

    def beyond(state: CentreState, drive: FeedDrive) -> tuple[dict[str, float], float]:
        """Return what is more than linear, and how much warmer the shaft is than its seat."""
        end, truth = run(machine, state, drive, 0.0)
        linear = model.observable @ (end.field - REFERENCE_TEMPERATURE * model.one)
        extra = dict(zip(machine.observables, truth.observables[-1] - linear, strict=True))
        return extra, temperature(model, end, "shaft") - temperature(model, end, "front_seat")

    cold, _ = beyond(warm_at(model, front_bearing=0.0), FeedDrive())
    assert max(map(abs, cold.values())) < 0.1
    turning, tight = beyond(hot, FeedDrive(-1750.0))
    assert tight > 1.0
    shift = 0.7 * tight - 3.0 / 4.0  # out of the housing by preload, back by centrifugal forces
    named = {name: value for name, value in turning.items() if abs(value) > 1e-9}
    assert named == pytest.approx({"z": -shift, "nose": shift, "tip": shift, "y": -2.0 / 4.0})
    loose = warm_at(model, stator=200.0, front_bearing=-100.0)
    extra, tight = beyond(loose, FeedDrive(cooled=False))
    assert tight < -1.0
    assert {name: value for name, value in extra.items() if abs(value) > 1e-9} == {}
