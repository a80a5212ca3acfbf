"""What the joints, films and bearings of the nonlinear machines do in them, one at a time."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from nonlinearmachines import AIR, HEATED, at, steps
from numpy.typing import NDArray

from thermocomp.virtual.convection import Faces
from thermocomp.virtual.machine import Air, FeedDrive
from thermocomp.virtual.nonlinear import CENTRE_FACES, SEAT, TAPER, NonlinearCentre, NonlinearTool
from thermocomp.virtual.statespace import REFERENCE_TEMPERATURE

FloatArray = NDArray[np.float64]


@pytest.fixture(scope="module")
def tool() -> NonlinearTool:
    return NonlinearTool()


@pytest.fixture(scope="module")
def centre() -> NonlinearCentre:
    return NonlinearCentre()


#: a joint of parts that grow as none does: the side that is warmer decides
EAGER: dict[str, Any] = {"squeeze": 0.0, "expansion": (2e4, 2e4), "behind": np.inf}


def test_a_warmer_outer_part_opens_its_joint_and_a_warmer_inner_one_closes_it(
    tool: NonlinearTool, centre: NonlinearCentre
) -> None:
    """In the taper heat comes from outside, in the other joints from inside."""
    assert tool.grip is not None
    apart = {}
    for name, machine in (
        ("eager", replace(tool, taper=replace(TAPER, **EAGER), grip=replace(tool.grip, **EAGER))),
        ("linear", replace(tool, taper=None, grip=None)),
    ):
        _, truth = machine.run(machine.init(AIR), [HEATED] * 200, steps(200), 60.0)
        for joint, warm, cold in (("taper", "taper_a", "taper_b"), ("grip", "grip_b", "grip_a")):
            apart[name, joint] = at(machine, truth, warm)[-1] - at(machine, truth, cold)[-1]
    assert apart["eager", "taper"] > 1.2 * apart["linear", "taper"] > 0.0  # the face conducts beside it
    assert 0.0 < apart["eager", "grip"] < apart["linear", "grip"] / 2.0
    # such a housing would crush the bearings
    free = replace(centre, front=None, seat=replace(SEAT, **EAGER), taper=replace(TAPER, **EAGER))
    drives = [FeedDrive(3000.0, loads={"tool_tip": 100.0})] * 100
    differences = {}
    for name, spindle in (("eager", free), ("linear", replace(free, seat=None, taper=None))):
        _, truth = spindle.run(spindle.init(AIR), drives, steps(100), 60.0)
        for joint, inner, outer in (("seat", "seat_a", "seat_b"), ("taper", "taper_b", "taper_a")):
            differences[name, joint] = at(spindle, truth, inner)[-1] - at(spindle, truth, outer)[-1]
    for joint in ("seat", "taper"):
        assert 0.0 < differences["eager", joint] < differences["linear", joint] / 2.0


def test_what_passes_is_what_each_path_conducts_beside_the_model(centre: NonlinearCentre) -> None:
    """In a step of a microsecond nothing has changed: heat is the conductance that is missing times the difference."""
    drive = FeedDrive(2000.0)
    watched = dict.fromkeys(centre._watched, 40.0) | {"enclosure": 60.0, "seat_a": 55.0, "taper_b": 35.0}
    temperatures = np.array(list(watched.values()))
    correct = centre._correction(centre.model.operators(centre._theta(drive), 1e-6, centre._watched), drive)
    after = np.concatenate([np.zeros(len(centre.model.one)), temperatures])
    passed = np.asarray(correct(after, temperatures.tolist(), AIR.values))
    around = np.array([60.0 if name in ("spindle_rotating", "spindle_front") else 22.0 for name in CENTRE_FACES])
    faces = Faces(list(CENTRE_FACES.values()))
    share = centre._theta(drive)[centre.model.theta.index("rotation")]
    extra = faces.conductance(np.full(10, 40.0), around, 2000.0, centre.heat.rotation(2000.0)) - faces.linear(share)
    np.testing.assert_allclose(passed[:10], -extra * (40.0 - around), rtol=1e-4)
    seat, taper = SEAT.conductance(55.0, 40.0), TAPER.conductance(35.0, 40.0)
    expected = [-(seat - 3500.0 * SEAT.area) * 15.0, -(taper - 4000.0 * TAPER.area) * 5.0]
    np.testing.assert_allclose(passed[10:], expected, rtol=1e-3)


def test_the_preload_falls_where_the_housing_is_the_warmer_part(centre: NonlinearCentre) -> None:
    """The hall is 30 K warmer at once: the housing follows first."""
    assert centre.front is not None
    air = steps(150, Air(20.0))
    air[50:, 0] = 50.0
    _, truth = centre.run(centre.init(Air(20.0)), [FeedDrive(powered=False)] * 150, air, 60.0)
    approach = centre.front.approach(at(centre, truth, "balls_a"), at(centre, truth, "balls_b"))
    assert approach[40] == pytest.approx(centre.front.mounted)
    assert 500.0 < centre.front.force(float(approach.min())) < 560.0


def test_an_open_taper_keeps_the_heat_behind(tool: NonlinearTool) -> None:
    """Mounted with a gap of 200 um of air, less comes through: the shaft is warmer, the chuck colder."""
    open_ = replace(tool, taper=replace(TAPER, squeeze=-200.0))
    heated = FeedDrive(loads={"heater": 60.0})
    shut, apart = (m.run(m.init(AIR), [heated] * 400, steps(400), 60.0)[1] for m in (tool, open_))
    for name, sign in (("taper_a", 1.0), ("taper_b", -1.0)):
        assert sign * (at(tool, apart, name)[-1] - at(tool, shut, name)[-1]) > 0.05


def test_the_shank_stays_behind_as_the_chuck_warms_and_keeps_some_of_it(tool: NonlinearTool) -> None:
    held = replace(tool, grip=replace(tool.grip, friction=1e3)) if tool.grip else tool
    drives = [HEATED] * 180 + [FeedDrive()] * 600
    free, stuck = (m.run(m.init(Air(20.0)), drives, steps(780, Air(20.0)), 60.0)[1] for m in (tool, held))
    behind = at(tool, stuck, "s1") - at(tool, free, "s1")
    assert tool.grip is not None
    wish = tool.grip.wish(at(tool, free, "grip_b"), at(tool, free, "grip_a"))
    hold = tool.grip.hold(tool.grip.pressure(at(tool, free, "grip_b"), at(tool, free, "grip_a")))
    assert behind[179] == pytest.approx(wish[179] - hold[179], abs=1e-9)
    assert behind[179] > 3.0
    # cold again it has not come back by what friction holds
    assert behind[-1] == pytest.approx(wish[-1] + hold[-1], abs=1e-9)
    assert behind[-1] > 1.0
    # friction is less where the chuck has let go: the pressure falls as both warm
    assert hold[179] < 0.8 * hold[0]
    for name in ("s2", "s3"):
        np.testing.assert_allclose(at(tool, free, name), at(tool, stuck, name), atol=1e-9)


def test_expansion_grows_as_it_warms(tool: NonlinearTool) -> None:
    """Evenly warm, everything is alpha (T + T^2 / 2 grows) long, whatever the field of temperatures is made of."""
    off = replace(tool, expansion_grows=0.0, grip=None)
    bent = replace(off, expansion_grows=1e-3)
    for warm in (30.0, 60.0):
        small, large = (m.run(m.init(Air(warm)), [FeedDrive()], steps(1, Air(warm)), 20.0)[1] for m in (off, bent))
        for name in ("s1", "s2", "s3"):
            share = at(bent, large, name)[0] / at(off, small, name)[0]
            assert share == pytest.approx(1.0 + 1e-3 * (warm - REFERENCE_TEMPERATURE) / 2.0, rel=2e-3)


def test_the_spindles_expansion_grows_too(centre: NonlinearCentre) -> None:
    flat = replace(centre, expansion_grows=0.0)
    bent, straight = (m.run(m.init(AIR), [FeedDrive(3000.0)] * 300, steps(300), 60.0)[1] for m in (centre, flat))
    more = at(centre, bent, "tip") - at(flat, straight, "tip")
    assert 0.1 < more[-1] < 1.0
    np.testing.assert_allclose(at(centre, bent, "z") - at(flat, straight, "z"), -more, atol=1e-9)
    np.testing.assert_allclose(bent.temperatures, straight.temperatures)


def test_the_gap_of_the_outer_rings_closes_and_cools_them(centre: NonlinearCentre) -> None:
    tight = replace(centre, seat=replace(SEAT, squeeze=1.0))
    loose = replace(centre, seat=replace(SEAT, squeeze=-20.0))
    drives = [FeedDrive(3000.0, cooled=True)] * 200
    rings = {}
    for name, machine in (("tight", tight), ("usual", centre), ("loose", loose)):
        _, truth = machine.run(machine.init(AIR), drives, steps(200), 60.0)
        rings[name] = at(machine, truth, "seat_a")[-1] - at(machine, truth, "seat_b")[-1]
        if name == "usual":
            gap = -SEAT.squeezed(at(machine, truth, "seat_a"), at(machine, truth, "seat_b"))
            assert gap[-1] < -SEAT.squeeze - 1.0  # it closes as the rings warm
    assert rings["tight"] < rings["usual"] < rings["loose"]


def test_a_tight_seat_squeezes_the_raceway(centre: NonlinearCentre) -> None:
    inner, outer = SEAT.compliances
    assert centre._pressed(20.0, 20.0) == 0.0
    closes = -SEAT.squeeze / (12.0e-3 * SEAT.radius)
    more = 12.0e-3 * SEAT.radius * 2.0
    assert centre._pressed(20.0 + closes + 2.0, 20.0) == pytest.approx(inner / (inner + outer) * more)
    assert replace(centre, seat=None)._pressed(60.0, 20.0) == 0.0


def test_the_shaft_is_pushed_out_by_its_preload(centre: NonlinearCentre) -> None:
    assert centre.front is not None
    drives = [FeedDrive(3000.0, cooled=False)] * 100
    _, truth = centre.run(centre.init(AIR), drives, steps(100), 60.0)
    still = replace(centre, joints=replace(centre.joints, centrifugal=0.0))
    _, drawn = still.run(still.init(AIR), drives, steps(100), 60.0)
    model, field = centre.model, {name: at(centre, truth, name) for name in ("balls_a", "balls_b", "seat_a", "seat_b")}
    pressed = centre._pressed(field["seat_a"], field["seat_b"])
    shift = centre.front.shift(centre.front.approach(field["balls_a"], field["balls_b"], pressed))
    assert shift[-1] > 0.5
    # what the reduced model and the growing expansion say of the nose comes without it
    flat = replace(still, expansion_grows=0.0)
    state, grown = flat.run(flat.init(AIR), drives, steps(100), 60.0)
    rest = model.observable[centre.observables.index("nose")] @ (state.field - REFERENCE_TEMPERATURE * model.one)
    assert at(flat, grown, "nose")[-1] == pytest.approx(rest + shift[-1], abs=1e-9)
    # and centrifugal forces draw it in, as in the linear machine
    back = at(still, drawn, "nose") - at(centre, truth, "nose")
    np.testing.assert_allclose(back, centre.joints.centrifugal * (3000.0 / 3500.0) ** 2, atol=1e-9)
