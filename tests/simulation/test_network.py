"""The thermal network and the machine built on it, against physics worked out independently."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from thermocomp.core.exceptions import InputError
from thermocomp.simulation.centre import CentreState, MachiningCentre
from thermocomp.simulation.expansion import Geometry
from thermocomp.simulation.heat import BearingFriction
from thermocomp.simulation.machine import Air, Drive, Truth, VirtualMachine
from thermocomp.simulation.network import Link, Network, Node, Regime
from thermocomp.simulation.parts import LINKS, NODES

FloatArray = NDArray[np.float64]
HOUR = 3600.0
AIR = Air(20.0)
RUNNING = Regime(rotation=0.6, flow=True)


@pytest.fixture(scope="module")
def centre() -> MachiningCentre:
    return MachiningCentre()


def by_hand(regime: Regime) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Capacities, conductances to the air, and K, put together without the code under test."""
    names = [n.name for n in NODES]
    to_air = np.array([n.convection + regime.rotation * n.rotating for n in NODES])
    stiffness = np.diag(to_air)
    for link in LINKS:
        if link.flow and not regime.flow:
            continue
        unit = np.zeros(len(names))
        unit[names.index(link.a)], unit[names.index(link.b)] = 1.0, -1.0
        stiffness = stiffness + link.conductance * np.outer(unit, unit)
    return np.array([n.capacity for n in NODES]), to_air, stiffness


def some_power() -> FloatArray:
    return np.random.default_rng(3).uniform(0.0, 200.0, len(NODES))


def test_without_air_all_heat_is_stored() -> None:
    network = Network([replace(n, convection=0.0, rotating=0.0) for n in NODES], LINKS)
    power = some_power()
    before = np.linspace(15.0, 45.0, len(NODES))
    after = network.advance(before, power, np.zeros(len(NODES)), RUNNING, 5000.0)
    stored = network.capacity @ (after - before)
    assert stored == pytest.approx(power.sum() * 5000.0, rel=1e-9)


def test_heat_put_in_is_stored_or_given_to_the_air(centre: MachiningCentre) -> None:
    network, power, air = centre.network, some_power(), np.full(len(NODES), 20.0)
    _, to_air, _ = by_hand(RUNNING)
    temperatures = [air]
    for _ in range(3600):
        temperatures.append(network.advance(temperatures[-1], power, air, RUNNING, 1.0))
    losses = np.array([to_air @ (t - air) for t in temperatures])
    given = (losses.sum() - (losses[0] + losses[-1]) / 2) * 1.0
    stored = network.capacity @ (temperatures[-1] - air)
    assert given > 0.02 * stored  # the loss matters in this balance
    assert stored + given == pytest.approx(power.sum() * 3600.0, rel=1e-6)


def test_steady_state_is_the_linear_solve(centre: MachiningCentre) -> None:
    power, air = some_power(), np.linspace(18.0, 24.0, len(NODES))
    _, to_air, stiffness = by_hand(RUNNING)
    solved = np.linalg.solve(stiffness, power + to_air * air)
    reached = np.full(len(NODES), 20.0)
    for _ in range(200):
        reached = centre.network.advance(reached, power, air, RUNNING, 86400.0)
    np.testing.assert_allclose(reached, solved, atol=1e-6)
    np.testing.assert_allclose(centre.network.steady(power, air, RUNNING), solved, atol=1e-9)


def test_a_step_follows_the_differential_equation(centre: MachiningCentre) -> None:
    power, air = some_power(), np.full(len(NODES), 21.0)
    capacity, to_air, stiffness = by_hand(RUNNING)
    slow = np.linspace(20.0, 40.0, len(NODES))
    fast = centre.network.advance(slow, power, air, RUNNING, 120.0)
    h = 0.25
    for _ in range(480):  # the classical Runge-Kutta method
        k1, k2, k3, k4 = np.zeros((4, len(NODES)))
        for k, (at, share) in enumerate(((None, 0.0), (0, 0.5), (1, 0.5), (2, 1.0))):
            rates = (k1, k2, k3, k4)
            here = slow if at is None else slow + share * h * rates[at]
            rates[k][:] = (power + to_air * air - stiffness @ here) / capacity
        slow = slow + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    np.testing.assert_allclose(fast, slow, atol=1e-7)


@pytest.mark.parametrize("parts", [7, 600])
def test_the_step_size_does_not_matter_to_the_network(centre: MachiningCentre, parts: int) -> None:
    power, air = some_power(), np.full(len(NODES), 21.0)
    start = np.linspace(20.0, 40.0, len(NODES))
    once = centre.network.advance(start, power, air, RUNNING, 7200.0)
    often = start
    for _ in range(parts):
        often = centre.network.advance(often, power, air, RUNNING, 7200.0 / parts)
    np.testing.assert_allclose(often, once, atol=1e-8)


def test_time_constants_reach_from_minutes_to_hours(centre: MachiningCentre) -> None:
    found = centre.network.time_constants(Regime())
    assert (found > 0).all()
    assert found.min() < 120.0
    assert np.count_nonzero((found > 300.0) & (found < 1800.0)) >= 3
    assert np.count_nonzero(found > 2 * HOUR) >= 3


@pytest.mark.parametrize(
    ("nodes", "links", "says"),
    [
        ([Node("a", 1.0), Node("a", 1.0)], [], "same name"),
        ([Node("a", 0.0)], [], "positive capacity"),
        ([Node("a", 1.0, convection=-1.0)], [], "node a"),
        ([Node("a", 1.0)], [Link("a", "b", 1.0)], "no node 'b'"),
        ([Node("a", 1.0), Node("b", 1.0)], [Link("a", "b", -1.0)], "negative conductance"),
        ([Node("a", 1.0)], [Link("a", "a", 1.0)], "two nodes"),
    ],
)
def test_an_impossible_network_is_refused(nodes: list[Node], links: list[Link], says: str) -> None:
    with pytest.raises(InputError, match=says):
        Network(nodes, links)


def run(machine: MachiningCentre, state: CentreState, drive: Drive, hours: float, dt: float = 60.0) -> list[Truth]:
    truths = []
    for _ in range(round(hours * HOUR / dt)):
        state, truth = machine.step(state, drive, dt)
        truths.append(truth)
    return truths


def test_the_machine_fills_the_interface(centre: MachiningCentre) -> None:
    machine: VirtualMachine[CentreState] = centre
    state, truth = machine.step(machine.init(AIR), Drive(AIR), 10.0)
    assert truth.temperatures.shape == state.temperatures.shape == (len(machine.places),)


def test_a_machine_at_rest_in_its_air_stays_as_it_is(centre: MachiningCentre) -> None:
    air = Air(23.0, stratification=0.6, side=0.3)
    start = centre.init(air)
    after, truth = centre.step(start, Drive(air, powered=False), 5 * HOUR)
    np.testing.assert_allclose(after.temperatures, start.temperatures, atol=1e-9)
    even = centre.step(centre.init(AIR), Drive(AIR, powered=False), 10.0)[1]
    for axis in (even.x, even.y, even.z):
        assert axis.offset == pytest.approx(0.0, abs=1e-9)
    assert abs(truth.y.offset) > 1.0


def test_the_running_machine_rests_in_its_own_steady_state(centre: MachiningCentre) -> None:
    drive = Drive(AIR, speed=3000.0, feed=(500.0, 1000.0, 500.0), cooled=False)
    regime = Regime(centre.heat.rotation(3000.0))
    _, to_air, stiffness = by_hand(regime)
    temperatures = np.full(len(NODES), 30.0)
    for _ in range(200):  # friction depends on temperature
        power = centre.heat.power(temperatures, centre.network.index, drive, chilling=0.0)
        temperatures = np.linalg.solve(stiffness, power + to_air * 20.0)
    after, _ = centre.step(CentreState(temperatures, chilling=False, slid=0.0), drive, HOUR)
    np.testing.assert_allclose(after.temperatures, temperatures, atol=1e-6)


def test_the_machine_cools_to_its_air() -> None:
    machine = MachiningCentre(longest_step=300.0)
    state = machine.init(AIR)
    for _ in range(6):
        state, warm = machine.step(state, Drive(AIR, speed=3000.0), HOUR)
    for _ in range(5 * 24):
        state, cold = machine.step(state, Drive(AIR, powered=False), HOUR)
    assert warm.temperatures.max() > 40.0
    np.testing.assert_allclose(cold.temperatures, 20.0, atol=0.05)
    # friction under the column keeps what it holds
    assert abs(cold.z.offset) <= machine.geometry.stiction + 0.5
    assert abs(cold.x.offset) < 0.5


@pytest.mark.parametrize("cooled", [False, True])
def test_the_step_size_hardly_matters_to_the_machine(cooled: bool) -> None:
    results = []
    for longest in (2.5, 20.0):
        machine = MachiningCentre(longest_step=longest)
        state, truths = machine.init(AIR), []
        for k in range(48):
            state, truth = machine.step(state, Drive(AIR, 3000.0 * (k // 12 % 2 == 0), cooled=cooled), 300.0)
            truths.append((truth.temperatures, truth.z.offset, truth.y.offset))
        results.append(truths)
    for fine, coarse in zip(*results, strict=True):
        np.testing.assert_allclose(coarse[0], fine[0], atol=0.05)
        np.testing.assert_allclose(coarse[1:], fine[1:], atol=0.1)


def test_the_state_is_all_there_is(centre: MachiningCentre) -> None:
    drive = Drive(AIR, speed=2000.0)
    state, _ = centre.step(centre.init(AIR), drive, HOUR)
    kept = state.temperatures.copy()
    first, truth = centre.step(state, drive, HOUR)
    again, same = centre.step(state, drive, HOUR)
    np.testing.assert_array_equal(state.temperatures, kept)
    np.testing.assert_array_equal(first.temperatures, again.temperatures)
    assert (truth.x, truth.y, truth.z) == (same.x, same.y, same.z)


def test_magnitudes_at_top_speed_are_those_of_a_machine_tool(centre: MachiningCentre) -> None:
    rest = centre.init(Air(22.0))
    for _ in range(24):
        rest, before = centre.step(rest, Drive(Air(22.0)), HOUR)
    truths = run(centre, rest, Drive(Air(22.0), speed=3500.0), 5.0)
    rise = dict(zip(centre.places, truths[-1].temperatures - before.temperatures, strict=True))
    assert 15.0 < rise["front_bearing"] < 35.0
    assert 2.0 < np.mean([rise["column_front_right"], rise["column_front_left"]]) < 6.5
    assert rise["bed_front"] < 1.0
    z = np.array([t.z.offset - before.z.offset for t in truths])
    assert -110.0 < z[-1] < -40.0  # towards the workpiece
    assert z[19] > 0.75 * z[-1] > z[119]  # neither there after 20 min, nor far from it after 2 h
    for other in (truths[-1].x.offset - before.x.offset, truths[-1].y.offset - before.y.offset):
        assert 10.0 < abs(other) < 60.0


def test_heat_and_cooling_are_nonlinear_in_speed(centre: MachiningCentre) -> None:
    index = centre.network.index["front_bearing"]
    start = centre.init(AIR)
    rise = {}
    for speed in (0.0, 1500.0, 3000.0):
        drive = Drive(AIR, speed=speed, cooled=False)
        rise[speed] = run(centre, start, drive, 1.0)[-1].temperatures[index] - 20.0
    ratio = (rise[3000.0] - rise[0.0]) / (rise[1500.0] - rise[0.0])
    assert 2.2 < ratio < 3.2  # 2 if heat went with n, 3.2 with n^(5/3) and no thinner oil, no more air


def test_bearing_friction_is_that_of_palmgren() -> None:
    bearing = BearingFriction(viscous=300.0, load=60.0, thinning=0.01, preload_gain=0.05)
    assert bearing.heat(1.0, 40.0, 0.0) == pytest.approx(360.0)
    assert bearing.heat(0.125, 40.0, 0.0) == pytest.approx(300.0 / 32 + 7.5)
    assert bearing.heat(1.0, 50.0, 0.0) == pytest.approx(300.0 * np.exp(-0.1) + 60.0)
    assert bearing.heat(1.0, 40.0, 10.0) == pytest.approx(300.0 + 90.0)
    assert bearing.heat(1.0, 40.0, -10.0) == pytest.approx(360.0)  # a cold shaft does not loosen it
    assert bearing.heat(0.0, 40.0, 10.0) == 0.0


def test_the_chiller_cycles(centre: MachiningCentre) -> None:
    truths = run(centre, centre.init(AIR), Drive(AIR), 24.0)
    index = centre.network.index
    excess = np.array([t.temperatures[index["coolant"]] - t.temperatures[index["bed_front"]] for t in truths])[360:]
    heat = centre.heat
    assert excess.min() == pytest.approx(heat.setpoint - heat.half_band, abs=0.1)
    assert excess.max() == pytest.approx(heat.setpoint + heat.half_band, abs=0.1)
    middle = excess > heat.setpoint
    n_cycles = np.count_nonzero(~middle[:-1] & middle[1:])
    assert 15.0 < 18 * 60 / n_cycles < 90.0  # minutes


def test_friction_under_the_column_is_a_play() -> None:
    geometry = Geometry(stiction=2.0)
    slid, path = 0.0, []
    for wish in [*np.arange(0.0, 10.5, 0.5), *np.arange(10.0, -0.5, -0.5)]:
        slid = geometry.slide(slid, float(wish))
        path.append(slid)
    up, down = path[:21], path[20:][::-1]
    assert up[4] == 0.0
    assert up[10] == pytest.approx(3.0)
    assert down[10] == pytest.approx(7.0)  # 2 stiction higher on the way back


def truth_at(centre: MachiningCentre, **rise: float) -> Truth:
    temperatures = np.full(len(NODES), 20.0)
    for name, value in rise.items():
        temperatures[centre.network.index[name]] += value
    return centre.geometry.truth(temperatures, centre.network.index, 0.0, 0.0)


def test_an_even_temperature_hurts_little(centre: MachiningCentre) -> None:
    even = truth_at(centre, **dict.fromkeys(centre.places, 10.0))
    head = truth_at(centre, headstock_front=10.0, headstock_rear=10.0, housing=10.0, shaft=10.0, tool=10.0)
    assert abs(even.y.offset) < 12.0
    assert abs(even.z.offset) < 12.0
    assert head.z.offset < -80.0


def test_column_differences_bend_the_column(centre: MachiningCentre) -> None:
    front = truth_at(centre, column_front_right_low=1.0, column_front_left_low=1.0)
    rear = truth_at(centre, column_rear_right_low=1.0, column_rear_left_low=1.0)
    right = truth_at(centre, column_front_right=1.0, column_rear_right=1.0)
    left = truth_at(centre, column_front_left=1.0, column_rear_left=1.0)
    # a warm front leans the column back: the nose rises, the tool leaves the workpiece
    assert front.tilt_a == pytest.approx(10.8 / 0.65 * 0.6)
    assert front.z.offset > 3.0
    assert front.z.offset == pytest.approx(-rear.z.offset)
    assert front.x.offset == pytest.approx(0.0)
    assert right.x.offset < -3.0
    assert right.x.offset == pytest.approx(-left.x.offset)
    assert right.tilt_b > 5.0


def test_shaft_growth_is_length_times_expansion_and_a_quadratic_term(centre: MachiningCentre) -> None:
    g = centre.geometry
    for rise in (5.0, 10.0):
        expected = -g.steel * g.nose * rise - g.preload * rise**2
        assert truth_at(centre, shaft=rise).z.offset == pytest.approx(expected)
    # with the housing as warm there is no thermal preload
    both = truth_at(centre, shaft=10.0, housing=10.0)
    assert both.z.offset == pytest.approx(-10.0 * (g.steel * g.nose + g.iron * g.housing))


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_a_warm_screw_changes_the_slope_of_its_axis(centre: MachiningCentre, axis: str) -> None:
    truth = truth_at(centre, **{f"{axis}_screw": 2.0})
    for other in "xyz":
        assert getattr(truth, other).slope == pytest.approx(2 * 11.7 if other == axis else 0.0)
    # The bearings of Y and Z sit at the positive ends: their nuts are pushed back. X pushes the table, not the tool.
    offset = getattr(truth, axis).offset
    assert offset > 0 if axis == "x" else offset < 0


def test_the_column_slides_only_when_friction_gives_way(centre: MachiningCentre) -> None:
    foot = [centre.network.index[n] for n in centre.places if n.endswith("_low")]
    start = centre.init(AIR)
    assert start.slid == pytest.approx(0.0, abs=1e-9)
    uneven = centre.init(Air(22.0, stratification=2.0))
    assert uneven.slid == pytest.approx(centre.geometry.wish(uneven.temperatures, centre.network.index))
    assert uneven.slid > 1.0
    for rise, moves in ((0.2, False), (2.0, True)):
        temperatures = start.temperatures.copy()
        temperatures[foot] += rise
        after, _ = centre.step(replace(start, temperatures=temperatures), Drive(AIR, powered=False), 20.0)
        assert (after.slid > 1.0) == moves
        if moves:
            wish = centre.geometry.wish(after.temperatures, centre.network.index)
            assert after.slid == pytest.approx(wish - centre.geometry.stiction, abs=1e-9)


def test_unusable_steps_are_refused(centre: MachiningCentre) -> None:
    state = centre.init(AIR)
    for dt in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(InputError, match="must be positive"):
            centre.step(state, Drive(AIR), dt)
    for speed in (4000.0, float("nan")):
        with pytest.raises(InputError, match="beyond the machine's 3500"):
            centre.step(state, Drive(AIR, speed=speed), 1.0)
