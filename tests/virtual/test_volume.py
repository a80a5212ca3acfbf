"""The errors in the whole work volume: composed in another way, and from what instruments read."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from thermocomp.core.machine import Axis, Machine
from thermocomp.core.structure import Structure
from thermocomp.runtime.geometry.kinematics import INDEX, Kinematics
from thermocomp.virtual.axes import AXES, STATIONS, TEST_BAR, TEST_POSITION, TRAVEL, weigh_stations
from thermocomp.virtual.centre import MachiningCentre
from thermocomp.virtual.climate import STILL
from thermocomp.virtual.experiments import SimulatedTest, run
from thermocomp.virtual.geometry import PROFILES, SAG, SQUARENESS, cold_profile, find_cold_component
from thermocomp.virtual.kits import CENTRE
from thermocomp.virtual.machine import FeedDrive
from thermocomp.virtual.probes import COMPONENTS, PROBE_DISTANCE, weigh_tool_point
from thermocomp.virtual.protocol import Programme
from thermocomp.virtual.segments import SteadySegment
from thermocomp.virtual.volume import VolumetricTruth

FloatArray = NDArray[np.float64]
HOUR = 3600.0
MIDDLE = (300.0, 250.0, 300.0)
MOVING = (600.0, 1000.0, 600.0)
WARM = {
    "spindle": FeedDrive(2600.0),
    "both": FeedDrive(2600.0, MOVING),
    "axes": FeedDrive(0.0, (6000.0, 6000.0, 6000.0)),
}
SIX = ("X_six", "Y_six", "Z_six")
#: the same machine as the package's own kinematics know it
KINEMATICS = Kinematics(
    Machine(
        "centre",
        Structure.parse("w X' b Z Y (C1) t"),
        tuple(Axis(a.upper(), (0.0, TRAVEL[a]), p, MIDDLE, TEST_BAR) for a, p in zip(AXES, MIDDLE, strict=True)),
        spindle_tool=TEST_BAR,
        tool=TEST_BAR,
    )
)


@dataclass(frozen=True, eq=False)
class Warm:
    """A test without noise: cold, then six hours of a drive."""

    test: SimulatedTest
    truth: VolumetricTruth
    names: tuple[str, ...]

    @property
    def row(self) -> FloatArray:
        assert self.test.observables is not None
        return np.asarray(self.test.observables[-1])

    @property
    def start(self) -> FloatArray:
        assert self.test.observables is not None
        return np.asarray(self.test.observables[0])

    def error(self, where: FloatArray, tool: Sequence[float] = TEST_BAR) -> FloatArray:
        """Errors since the zero was set at the test position, when the test began."""
        return self.truth.error(self.row, where, tool) - self.truth.error(self.start, [MIDDLE], tool)

    def told(self, name: str) -> float:
        return float(self.row[self.names.index(name)])

    def read(self, channel: str) -> float:
        return float(self.test.values[-1, [c.name for c in self.test.channels].index(channel)])


def measured(drive: FeedDrive) -> SimulatedTest:
    programme = Programme(
        name="t",
        sampling=1200.0,
        segments=(SteadySegment(1200.0), SteadySegment(6 * HOUR, drive)),
        climate=replace(STILL, mean=23.0),
        probes=("nest", *SIX, "EYX_z0", "EYX_z600", "squareness"),
        perfect=True,
    )
    rngs = (np.random.default_rng(k) for k in (1, 2))
    return run(MachiningCentre(), CENTRE, programme, *rngs, whole=True)


@pytest.fixture(scope="module", params=list(WARM))
def warm(request: pytest.FixtureRequest) -> Warm:
    names = MachiningCentre().observables
    return Warm(measured(WARM[request.param]), VolumetricTruth(names), names)


def points(n: int = 1000, seed: int = 0) -> FloatArray:
    return np.random.default_rng(seed).uniform(0.0, [TRAVEL[a] for a in AXES], (n, 3))


def test_at_the_test_position_it_is_what_the_nest_reads(warm: Warm) -> None:
    assert tuple(TEST_POSITION.values()) == MIDDLE
    found = warm.truth.components(warm.row, [MIDDLE])
    for k, axis in enumerate("XYZ"):
        total = found[f"{axis}0C"] + sum(found[f"E{axis}{a}"] for a in "XYZ")
        assert total == pytest.approx(warm.told(axis.lower()), abs=1e-9)
        # the composed error differs from the sum by products of turns and shifts alone
        assert warm.truth.error(warm.row, [MIDDLE])[0, k] == pytest.approx(warm.told(axis.lower()), abs=5e-3)
    for turn in "AB":
        total = found[f"{turn}0C"] + sum(found[f"E{turn}{a}"] for a in "XYZ")
        assert total == pytest.approx(warm.told(turn.lower()), abs=1e-9)
    # a longer tool, or a shorter one, is tilted about the tip of the test bar
    back = np.add(TEST_BAR, (0.0, 0.0, 1e3 * PROBE_DISTANCE))
    x, y, _ = warm.error(np.array([MIDDLE]), tuple(back))[0]
    assert (x, y) == pytest.approx((warm.read("x2_um"), warm.read("y2_um")), abs=5e-3)


def test_a_chain_of_transforms_says_the_same(warm: Warm) -> None:
    """Brute force: one 4 x 4 exponential after the other, point by point."""
    where, tool = points(60, 3), np.array([20.0, -30.0, -260.0])
    # whatever the machine tells, also what this one never does
    row = warm.row + 5.0 * np.random.default_rng(4).standard_normal(len(warm.row))
    c = warm.truth.components(row, where)
    assert abs(c["B0C"][0]) > 1.0
    overhang = tool - np.array(TEST_BAR)

    def moved(shift: FloatArray) -> FloatArray:
        matrix = np.eye(4)
        matrix[:3, 3] = shift
        return matrix

    def turned(a: float, b: float, g: float) -> FloatArray:
        generator = np.zeros((4, 4))
        generator[:3, :3] = 1e-6 * np.array([[0.0, -g, b], [g, 0.0, -a], [-b, a, 0.0]])
        return np.asarray(expm(generator))

    found = np.empty((len(where), 3))
    for n, (x, y, z) in enumerate(where - MIDDLE):
        ways = {"X": [x, 0.0, 0.0], "Z": turned(17.0, -21.0, 0.0)[:3, 2] * z, "Y": turned(0.0, 0.0, 14.0)[:3, 1] * y}
        chain = np.eye(4)
        for axis, way in ways.items():
            six = [float(c[f"E{m}{axis}"][n]) for m in "XYZABC"]
            chain = chain @ moved(np.array(way) + 1e-3 * np.array(six[:3])) @ turned(*six[3:])
        chain = chain @ moved(1e-3 * np.array([c[f"{a}0C"][n] for a in "XYZ"]))
        chain = chain @ turned(float(c["A0C"][n]), float(c["B0C"][n]), 0.0)
        found[n] = 1e3 * ((chain @ [*overhang, 1.0])[:3] - (x, y, z) - overhang)
    assert SQUARENESS == {"C0Y": 14.0, "B0Z": -21.0, "A0Z": 17.0}
    np.testing.assert_allclose(warm.truth.error(row, where, tool), found, atol=2e-3)


def test_lasers_squareness_and_nest_determine_the_error_everywhere(warm: Warm) -> None:
    """The closure: what instruments read without noise, put into the package's kinematics, is the truth (C-35)."""
    where = points()
    values = np.zeros((len(where), 32))
    still = np.array([MIDDLE])
    for code in COMPONENTS:
        k = "XYZ".index(code[2])
        axis, unit = AXES[k], "um" if code[1] in "XYZ" else "urad"
        at = still.repeat(len(STATIONS[axis]), axis=0)
        at[:, k] = STATIONS[axis]
        reading = np.array([warm.read(f"{code}_{p}_{unit}") for p in STATIONS[axis]])
        # heat is smooth between the stations; the geometry is known from a laser run with small steps
        values[:, INDEX[code]] = weigh_stations(axis, where[:, k]) @ (
            reading - find_cold_component(code, at)
        ) + find_cold_component(code, where)
    for code in SQUARENESS:
        values[:, INDEX[code]] = warm.read(f"{code}_urad")
    values[:, INDEX["X0C"]], values[:, INDEX["Y0C"]] = warm.read("x1_um"), warm.read("y1_um")
    values[:, INDEX["Z0C"]] = warm.read("z_um")
    values[:, INDEX["A0C"]] = (warm.read("y1_um") - warm.read("y2_um")) / PROBE_DISTANCE
    values[:, INDEX["B0C"]] = (warm.read("x2_um") - warm.read("x1_um")) / PROBE_DISTANCE
    for tool in (TEST_BAR, (0.0, 0.0, -60.0), (30.0, 0.0, -250.0)):
        true = warm.error(where, tool)
        assert np.linalg.norm(true, axis=1).max() > 30.0
        # about Z the nest sees no turn: only a tool beside the spindle's axis would tell
        about_z = 1e-3 * abs(tool[0]) * 2.0
        assert np.abs(KINEMATICS.synthesize(values, where, tool)[0] - true).max() < 0.01 + about_z
    # each of the five sums of the nest, and what a laser sees of the turns of the axes that carry, is needed
    for code in ("X0C", "Y0C", "Z0C"):
        off = values.copy()
        off[:, INDEX[code]] = 0.0
        assert np.abs(KINEMATICS.synthesize(off, where)[0] - warm.error(where)).max() > 0.1


def test_it_agrees_with_what_the_machine_tells_of_y_at_other_positions(warm: Warm) -> None:
    heat = VolumetricTruth(warm.names, geometry=False)
    for p in STATIONS["y"]:
        found = heat.error(warm.row, [(300.0, p, 300.0)])[0]
        for k in (1, 2):
            known = sum(w * warm.told(name) for name, w in weigh_tool_point(AXES[k], {"y": p}).items())
            assert found[k] == pytest.approx(known, abs=5e-3)


def test_what_six_degrees_read(warm: Warm) -> None:
    """A laser between table and spindle, zeroed at the test position, reads what the tool point does there."""
    for state, row in ((0, warm.start), (-1, warm.row)):
        zero = warm.truth.error(row, [MIDDLE])[0]
        for k, channel in enumerate(warm.test.displacements):
            code, _, at = channel.name.rpartition("_")[0].rpartition("_")
            code, _, aside = code.partition("_z")
            if code not in COMPONENTS:
                continue
            axis, unit = "XYZ".index(code[2]), channel.unit
            point = np.array([MIDDLE])
            point[0, axis] = float(at)
            if unit == "um":
                if aside:
                    point[0, 2] = float(aside)
                    there = np.array([[300.0, 250.0, float(aside)]])
                    zero_here = warm.truth.error(row, there)[0]
                else:
                    zero_here = zero
                seen = warm.truth.error(row, point)[0] - zero_here
                way = np.zeros(3)
                way[axis] = float(at) - MIDDLE[axis]
                square = {"Y": (-14.0, 0.0, 0.0), "Z": (-21.0, -17.0, 0.0), "X": (0.0, 0.0, 0.0)}[code[2]]
                seen = seen - 1e-3 * np.array(square) * way[axis]  # an artefact tells the squareness
                expected = seen["XYZ".index(code[1])]
            else:
                components = [warm.truth.components(row, p)[code].item() for p in (point, [MIDDLE])]
                expected = components[0] - components[1]
            assert warm.test.truth[state, k] == pytest.approx(expected, abs=5e-3), channel.name
    # under the column the bed gives way: the profile at another Z is another one
    tilt = 1e-3 * 300.0 * warm.read("EAX_600_urad")
    assert warm.read("EYX_z600_600_um") - warm.read("EYX_600_um") == pytest.approx(-SAG - tilt, abs=5e-3)
    assert warm.read("EYX_z0_600_um") - warm.read("EYX_600_um") == pytest.approx(SAG + tilt, abs=5e-3)
    assert warm.read("EYX_z0_300_um") == 0.0


def test_heat_moves_what_has_a_reason_to_move(warm: Warm) -> None:
    heat = VolumetricTruth(warm.names, geometry=False)
    found = heat.components(warm.row, points(200))
    still = {"EXZ", "EBZ", "ECZ", "B0C", *SQUARENESS}  # no right and left in the bed, none in the headstock
    for code, values in found.items():
        assert (np.abs(values).max() < 1e-9) == (code in still), code
    assert np.ptp(found["EAX"]) < 1e-9  # a tilt of the table is the same all along X


def test_the_cold_machine_has_its_geometry_and_none_at_the_test_position() -> None:
    names = MachiningCentre().observables
    truth, row = VolumetricTruth(names), np.zeros(len(names))
    np.testing.assert_allclose(truth.error(row, [MIDDLE]), 0.0, atol=1e-9)
    assert set(COMPONENTS) == set(PROFILES) | {"EYY"}
    found = truth.components(row, points())
    for code in COMPONENTS:
        size = np.ptp(found[code])
        low, high = (8.0, 45.0) if code[1] in "ABC" else (5.0, 30.0) if code[1] == code[2] else (3.0, 9.0)
        assert low < size < high, f"{code}: {size:.1f}"
    assert found["EYY"] == pytest.approx(cold_profile(points()[:, 1]) - cold_profile(250.0))
    assert {code: found[code][0] for code in SQUARENESS} == SQUARENESS
    # one by one against its own words: squareness far from the middle, a turn with its lever
    corner = np.array([[300.0, 550.0, 300.0]])
    y = {code: float(v[0]) for code, v in truth.components(row, corner).items()}
    assert truth.error(row, corner)[0, 0] == pytest.approx(y["EXY"] - 14.0 * 0.3, abs=2e-3)
    longer = truth.error(row, corner, (0.0, 0.0, -250.0)) - truth.error(row, corner)
    assert longer[0] == pytest.approx([-0.1 * y["EBY"], 0.1 * y["EAY"], 0.0], abs=2e-3)
    none = VolumetricTruth(names, geometry=False)
    np.testing.assert_array_equal(none.error(row, points(50)), 0.0)


def test_each_point_may_have_a_state_of_its_own(warm: Warm) -> None:
    assert warm.test.observables is not None
    rows, where = warm.test.observables[[0, 5, 19]], points(3)
    together = warm.truth.error(rows, where)
    alone = np.vstack([warm.truth.error(row, [point]) for row, point in zip(rows, where, strict=True)])
    np.testing.assert_allclose(together, alone, atol=1e-12)
    assert np.abs(rows[0]).max() > 1.0  # at 23 degC the machine is not what it is at 20


def test_between_the_stations_it_is_smooth() -> None:
    for axis in AXES:
        at = np.array(STATIONS[axis], dtype=np.float64)
        p = np.linspace(0.0, TRAVEL[axis], 1001)
        w = weigh_stations(axis, p)
        np.testing.assert_allclose(w.sum(axis=1), 1.0)
        np.testing.assert_allclose(weigh_stations(axis, at), np.eye(len(at)), atol=1e-12)
        np.testing.assert_allclose(w @ (at - 200.0) ** 2, (p - 200.0) ** 2, atol=1e-8)
        wave = w @ np.sin(at / 50.0)
        assert np.abs(np.diff(wave, 2)).max() < 1e-3  # no kink
        np.testing.assert_array_equal(weigh_stations(axis, [-10.0, 1e4]), weigh_stations(axis, [0.0, TRAVEL[axis]]))


def test_components_leave_the_older_recordings_as_they_were() -> None:
    """A machine that tells nothing of them is read alike by nest, lasers and touch probes."""
    machine = MachiningCentre()
    old = [k for k, name in enumerate(machine.observables) if name[0] != "E"]
    model = replace(
        machine.model,
        observable=machine.model.observable[old],
        observables=tuple(machine.observables[k] for k in old),
    )
    probes = ("nest", "x_laser", "y_laser", "z_laser", "x_at_500", "z_at_40")
    programme = Programme(name="t", sampling=600.0, segments=(SteadySegment(HOUR, WARM["both"]),), probes=probes)
    tests = [
        run(m, CENTRE, programme, np.random.default_rng(1), np.random.default_rng(2))
        for m in (machine, MachiningCentre(model))
    ]
    np.testing.assert_allclose(tests[0].values, tests[1].values, atol=1e-9)
    assert tests[0].observables is None
