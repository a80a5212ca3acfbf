"""The virtual machining centre behaves as a machine tool does."""

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from thermocomp.core.exceptions import InputError
from thermocomp.virtual.axes import N_HATS
from thermocomp.virtual.centre import CentreState, MachiningCentre
from thermocomp.virtual.heat import BearingFriction, HeatSources, swept
from thermocomp.virtual.joints import Joints, slide_with_friction
from thermocomp.virtual.machine import Air, FeedDrive, Truth, VirtualMachine
from thermocomp.virtual.statespace import REFERENCE_TEMPERATURE

FloatArray = NDArray[np.float64]
HOUR = 3600.0
AIR = Air(20.0)
OFF = FeedDrive(powered=False)


@pytest.fixture(scope="module")
def centre() -> MachiningCentre:
    return MachiningCentre()


def run(
    machine: MachiningCentre, state: CentreState, drive: FeedDrive, hours: float, air: Air = AIR, dt: float = 20.0
) -> tuple[CentreState, Truth]:
    n = round(hours * HOUR / dt)
    return machine.run(state, [drive] * n, np.tile(air.values, (n, 1)), dt)


def seen(machine: MachiningCentre, truth: Truth, name: str) -> FloatArray:
    if name in machine.places:
        return truth.temperatures[:, machine.places.index(name)]
    return truth.observables[:, machine.observables.index(name)]


def test_the_machine_fills_the_interface(centre: MachiningCentre) -> None:
    machine: VirtualMachine[CentreState] = centre
    _, truth = machine.run(machine.init(AIR), [FeedDrive()] * 3, np.tile(AIR.values, (3, 1)), 10.0)
    assert truth.temperatures.shape == (3, len(machine.places))
    assert truth.observables.shape == (3, len(machine.observables))


def test_a_machine_at_rest_in_its_air_stays_as_it_is(centre: MachiningCentre) -> None:
    for air in (Air(23.0, stratification=0.6, side=0.3), AIR):
        _, truth = run(centre, centre.init(air), OFF, 5.0, air)
        np.testing.assert_allclose(truth.temperatures, truth.temperatures[:1].repeat(len(truth.temperatures), 0))
        np.testing.assert_allclose(truth.observables[-1], truth.observables[0], atol=1e-8)
    np.testing.assert_allclose(truth.temperatures, 20.0, atol=1e-8)
    np.testing.assert_allclose(truth.observables, 0.0, atol=1e-6)


def test_the_machine_cools_to_its_air(centre: MachiningCentre) -> None:
    state, warm = run(centre, centre.init(AIR), FeedDrive(3000.0), 6.0)
    _, cold = run(centre, state, OFF, 8 * 24.0)
    assert warm.temperatures.max() > 35.0
    np.testing.assert_allclose(cold.temperatures[-1], 20.0, atol=0.1)
    # friction under the column keeps what it holds
    assert abs(seen(centre, cold, "z")[-1]) <= centre.joints.stiction + 1.0
    assert abs(seen(centre, cold, "x")[-1]) < 1.0


@pytest.mark.parametrize("cooled", [False, True])
def test_the_step_size_hardly_matters(cooled: bool) -> None:
    drives = [FeedDrive(3000.0 * (k // 12 % 2 == 0), cooled=cooled) for k in range(48)]
    results = []
    for longest in (2.5, 20.0):
        machine = MachiningCentre(longest_step=longest)
        results.append(machine.run(machine.init(AIR), drives, np.tile(AIR.values, (48, 1)), 300.0)[1])
    fine, coarse = results
    np.testing.assert_allclose(coarse.temperatures, fine.temperatures, atol=0.05)
    np.testing.assert_allclose(coarse.observables, fine.observables, atol=0.15)


def test_in_blocks_it_is_the_same(centre: MachiningCentre) -> None:
    drives = [FeedDrive(2000.0, (600.0, 1000.0, 600.0))] * 100 + [FeedDrive()] * 100
    air = np.column_stack([np.linspace(20.0, 24.0, 200), np.full(200, 0.4), np.linspace(0.0, 0.2, 200)])
    state = centre.init(AIR)
    kept = state.field.copy()
    _, whole = centre.run(state, drives, air, 20.0)
    parts = []
    for block in (slice(0, 1), slice(1, 130), slice(130, 200)):
        state, truth = centre.run(state, drives[block], air[block], 20.0)
        parts.append(truth)
    np.testing.assert_allclose(np.vstack([p.observables for p in parts]), whole.observables, atol=1e-9)
    np.testing.assert_allclose(np.vstack([p.temperatures for p in parts]), whole.temperatures, atol=1e-9)
    np.testing.assert_array_equal(centre.init(AIR).field, kept)  # nothing hides in the machine


def test_another_arithmetic_gives_the_same_machine() -> None:
    """Kernels of linear algebra for other processors round differently: far below the instruments' resolution."""
    script = (
        "import numpy as np\n"
        "from thermocomp.virtual.centre import MachiningCentre\n"
        "from thermocomp.virtual.machine import Air, FeedDrive\n"
        "m = MachiningCentre()\n"
        "d = [FeedDrive(2600.0, (600.0, 1000.0, 600.0))] * 2000 + [FeedDrive()] * 2000\n"
        "_, t = m.run(m.init(Air(22.0)), d, np.tile(Air(22.0).values, (4000, 1)), 20.0)\n"
        "print(*np.hstack([t.temperatures, t.observables])[::500].ravel().tolist())\n"
    )
    said = []
    for core in ("Prescott", "Haswell"):
        environment = {**os.environ, "OPENBLAS_CORETYPE": core}
        done = subprocess.run([sys.executable, "-c", script], env=environment, check=True, capture_output=True)
        said.append(np.array(done.stdout.split(), dtype=float))
    np.testing.assert_allclose(said[0], said[1], atol=1e-6)


def test_magnitudes_are_those_of_a_machine_tool(centre: MachiningCentre) -> None:
    """Chen's warm-up and cool-down at his highest speed (C-14)."""
    air = Air(22.0)
    rest, soaked = run(centre, centre.init(air), FeedDrive(), 12.0, air)
    state, warm = run(centre, rest, FeedDrive(2600.0, (600.0, 1000.0, 600.0)), 6.0, air)
    _, cold = run(centre, state, FeedDrive(), 10.0, air)
    z = seen(centre, warm, "z") - seen(centre, soaked, "z")[-1]
    assert -200.0 < z.min() < -20.0  # towards the workpiece
    for axis in "xy":
        drift = seen(centre, warm, axis) - seen(centre, soaked, axis)[-1]
        assert 3.0 < np.abs(drift).max() < 150.0
    rise = dict(zip(centre.places, warm.temperatures[-1] - soaked.temperatures[-1], strict=True))
    assert 8.0 < rise["front_seat"] < 35.0
    assert rise["front_bearing"] > rise["front_seat"] > rise["housing"] > 1.0
    assert 0.5 < np.mean([rise["column_front_right"], rise["column_front_left"]]) < 8.0
    assert rise["bed_front"] < 2.0
    back = seen(centre, cold, "z")[-1] - seen(centre, soaked, "z")[-1]
    assert abs(back) < 0.3 * abs(z.min())


def rising(course: FloatArray, dt: float) -> float:
    """Time until 63 % of the change is done [s]."""
    change = np.abs(course - course[0])
    return dt * int(np.argmax(change >= 0.632 * change.max()))


def test_the_spindle_is_much_quicker_than_the_column(centre: MachiningCentre) -> None:
    _, truth = run(centre, centre.init(AIR), FeedDrive(2600.0), 16.0)
    spindle = rising(seen(centre, truth, "tip"), 20.0)
    column = rising(seen(centre, truth, "column_front_right"), 20.0)
    assert 3 * 60.0 < spindle < HOUR
    assert column > 2.5 * spindle


def test_temperature_against_displacement_is_a_loop(centre: MachiningCentre) -> None:
    """Hysteresis: at one temperature of the housing, z on the way down is not z on the way up."""
    state, warm = run(centre, centre.init(AIR), FeedDrive(2600.0), 6.0)
    _, cold = run(centre, state, FeedDrive(), 10.0)
    t_up, z_up, t_down, z_down = (seen(centre, x, name) for x in (warm, cold) for name in ("housing", "z"))
    levels = np.linspace(t_up.min(), t_up.max(), 12)[2:-2]
    up = np.interp(levels, t_up, z_up)
    down = np.interp(levels, t_down[::-1], z_down[::-1])
    assert np.abs(up - down).max() > 0.1 * np.ptp(z_up)


def test_heat_and_cooling_are_nonlinear_in_speed(centre: MachiningCentre) -> None:
    rise = {}
    for speed in (0.0, 1500.0, 3000.0):
        _, truth = run(centre, centre.init(AIR), FeedDrive(speed, cooled=False), 1.0)
        rise[speed] = seen(centre, truth, "front_bearing")[-1]
    ratio = (rise[3000.0] - rise[0.0]) / (rise[1500.0] - rise[0.0])
    assert 2.1 < ratio < 3.2  # 2 if heat went with n, 3.2 with n^(5/3) and no thinner oil, no more air


def test_bearing_friction_is_that_of_palmgren() -> None:
    bearing = BearingFriction(viscous=300.0, load=60.0, thinning=0.01, preload_gain=0.05)
    assert bearing.heat(1.0, 40.0, 0.0) == pytest.approx(360.0)
    assert bearing.heat(0.125, 40.0, 0.0) == pytest.approx(300.0 / 32 + 7.5)
    assert bearing.heat(1.0, 50.0, 0.0) == pytest.approx(300.0 * np.exp(-0.1) + 60.0)
    assert bearing.heat(1.0, 40.0, 10.0) == pytest.approx(300.0 + 90.0)
    assert bearing.heat(1.0, 40.0, -10.0) == pytest.approx(360.0)  # a cold shaft does not loosen it
    assert bearing.heat(0.0, 40.0, 10.0) == 0.0


def test_the_chiller_cycles(centre: MachiningCentre) -> None:
    _, truth = run(centre, centre.init(AIR), FeedDrive(), 24.0)
    excess = (seen(centre, truth, "coolant") - seen(centre, truth, "bed_front"))[1080:]
    heat = centre.heat
    assert excess.min() == pytest.approx(heat.setpoint - heat.half_band, abs=0.15)
    assert excess.max() == pytest.approx(heat.setpoint + heat.half_band, abs=0.15)
    middle = excess > heat.setpoint
    n_cycles = np.count_nonzero(~middle[:-1] & middle[1:])
    assert 15.0 < 18 * 60 / n_cycles < 90.0  # minutes


@pytest.mark.parametrize(
    ("stroke", "shares"),
    [
        ((0.0, 600.0), [1 / 12, 1 / 6, 1 / 6, 1 / 6, 1 / 6, 1 / 6, 1 / 12]),
        ((100.0, 100.0), [0, 1, 0, 0, 0, 0, 0]),
        ((150.0, 150.0), [0, 0.5, 0.5, 0, 0, 0, 0]),
        ((100.0, 0.0), [0.5, 0.5, 0, 0, 0, 0, 0]),
        ((50.0, 100.0), [0.25, 0.75, 0, 0, 0, 0, 0]),
        ((-50.0, -20.0), [1, 0, 0, 0, 0, 0, 0]),
    ],
)
def test_a_nut_warms_its_screw_where_it_moves(stroke: tuple[float, float], shares: list[float]) -> None:
    found = swept(stroke, 600.0)
    assert len(found) == N_HATS
    assert found == pytest.approx(shares)


def test_where_the_nut_moves_matters_to_the_screw(centre: MachiningCentre) -> None:
    """Near the bearing's end the whole screw beyond is pushed; at the far end only the rest."""
    profiles = []
    for stroke in ((0.0, 100.0), (450.0, 550.0)):
        drive = FeedDrive(0.0, (0.0, 8000.0, 0.0), (None, stroke, None))
        _, truth = run(centre, centre.init(AIR), drive, 2.0)
        profiles.append([seen(centre, truth, f"yy@{p}")[-1] for p in range(0, 551, 50)])
    slopes = np.abs(np.diff(np.array(profiles), axis=1))
    assert slopes[0, 0] > slopes[0, -1]
    assert slopes[1, -1] > slopes[1, 0]


def test_loads_of_a_drive_are_heat(centre: MachiningCentre) -> None:
    _, cutting = run(centre, centre.init(AIR), FeedDrive(1000.0, loads={"tool_tip": 60.0}), 1.0)
    _, idle = run(centre, centre.init(AIR), FeedDrive(1000.0), 1.0)
    assert seen(centre, cutting, "tool")[-1] > seen(centre, idle, "tool")[-1] + 2.0
    assert seen(centre, cutting, "z")[-1] < seen(centre, idle, "z")[-1] - 1.0


def test_all_heat_has_a_place(centre: MachiningCentre) -> None:
    given = HeatSources().given(FeedDrive(3000.0, (500.0, 600.0, 700.0)))
    assert set(given) <= set(centre.model.inputs)
    assert sum(v for k, v in given.items() if k.startswith("x_")) == pytest.approx(0.5 * (9.0 + 16.0))
    assert HeatSources().given(OFF) == {}


def test_friction_under_the_column_is_a_play() -> None:
    wish = np.array([*np.arange(0.0, 10.5, 0.5), *np.arange(10.0, -0.5, -0.5)])
    path = slide_with_friction(0.0, wish, 2.0)
    up, down = path[:21], path[20:][::-1]
    assert up[4] == 0.0
    assert up[10] == pytest.approx(3.0)
    assert down[10] == pytest.approx(7.0)  # 2 stiction higher on the way back


def test_joints_that_are_not_linear() -> None:
    joints = Joints(preload=0.1, centrifugal=4.0)
    np.testing.assert_allclose(joints.shaft(np.array([10.0, -10.0, 0.0]), np.array([0.0, 0.0, 0.5])), [1, 0, -1])


def test_joints_act_on_the_tool_point_in_the_right_direction(centre: MachiningCentre) -> None:
    _, truth = run(centre, centre.init(AIR), FeedDrive(3000.0, cooled=False), 2.0)
    tight = MachiningCentre(joints=replace(centre.joints, preload=centre.joints.preload + 1.0))
    _, tighter = run(tight, tight.init(AIR), FeedDrive(3000.0, cooled=False), 2.0)
    warmer = seen(centre, truth, "shaft") - seen(centre, truth, "front_seat")
    assert warmer[-1] > 3.0
    # a shaft that is pushed out comes nearer to the workpiece
    np.testing.assert_allclose(seen(centre, tighter, "z") - seen(centre, truth, "z"), -warmer, atol=1e-9)
    np.testing.assert_allclose(seen(centre, tighter, "tip") - seen(centre, truth, "tip"), warmer, atol=1e-9)
    spun = MachiningCentre(joints=replace(centre.joints, centrifugal=2.0, lift=-1.5))
    _, drawn = run(spun, spun.init(AIR), FeedDrive(3500.0 / 2), 20.0 / HOUR)
    _, plain = run(centre, centre.init(AIR), FeedDrive(3500.0 / 2), 20.0 / HOUR)
    # centrifugal forces draw the shaft in, and let it sink
    assert (seen(centre, drawn, "z") - seen(centre, plain, "z"))[0] == pytest.approx(1.0 / 4)
    assert (seen(centre, drawn, "y") - seen(centre, plain, "y"))[0] == pytest.approx(-1.0 / 4)


def test_an_even_temperature_hurts_little(centre: MachiningCentre) -> None:
    """The loop of lengths nearly closes (C-03)."""
    linear = dict(zip(centre.observables, centre.model.observable @ centre.model.one, strict=True))
    assert max(abs(linear[axis]) for axis in "xyz") < 1.5  # um/K
    assert max(abs(linear[tilt]) for tilt in "ab") < 0.5  # urad/K
    np.testing.assert_allclose(centre.model.temperature @ centre.model.one, 1.0, atol=1e-8)
    assert REFERENCE_TEMPERATURE == 20.0


def test_unusable_steps_are_refused(centre: MachiningCentre) -> None:
    state, air = centre.init(AIR), AIR.values[None]
    for dt in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(InputError, match="must be positive"):
            centre.run(state, [FeedDrive()], air, dt)
    with pytest.raises(InputError, match="exceeds the top speed of the machine, 3500"):
        centre.run(state, [FeedDrive(4000.0)], air, 1.0)
    for drives, given in (([], air), ([FeedDrive()] * 2, air), ([FeedDrive()], air[:, :2])):
        with pytest.raises(InputError, match="three numbers per"):
            centre.run(state, drives, given, 1.0)
    with pytest.raises(InputError, match="air: temperatures must be finite"):
        centre.run(state, [FeedDrive()], air * np.nan, 1.0)
    for wrong in (
        {"speed": float("nan")},
        {"feed": (0.0, float("inf"), 0.0)},
        {"loads": {"tool_tip": float("nan")}},
        {"stroke": (None, (0.0, 600.0), None)},
        {"speed": 100.0, "powered": False},
        {"feed": (1.0, 0.0, 0.0), "powered": False},
    ):
        with pytest.raises(InputError, match="drive"):
            FeedDrive(**wrong)
    with pytest.raises(InputError, match="'tool_tp'; the nearest are tool_tip"):
        centre.run(state, [FeedDrive(loads={"tool_tp": 5.0})], air, 1.0)
