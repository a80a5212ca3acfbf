"""Machines of bodies with frames, and instruments that are fixed to bodies: what these read, put together again.

Nothing in here knows levers or reference points. A body is a pose in the world; every slide goes astray in its own way,
about a bearing of its own; an instrument compares a place on the tool's side with one on the workpiece's.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from volumetricmachine import FloatArray, random_machine

from thermocomp.core.components import COMPONENTS
from thermocomp.core.machine import Axis, Machine
from thermocomp.core.structure import Structure
from thermocomp.runtime.geometry import exact
from thermocomp.runtime.geometry.kinematics import INDEX, Kinematics

Pose = FloatArray  # 4 x 4: from the body's frame to the world
STRUCTURES = ("w X' b Z Y (C1) t", "w Y' X' b Z t", "XYZF", "YXFZ", "FXYZ", "XFZY", "XFZ", "ZF")


def pose(turn: FloatArray, shift: FloatArray) -> Pose:
    found = np.eye(4)
    found[:3, :3], found[:3, 3] = Rotation.from_rotvec(turn).as_matrix(), shift
    return found


def place(body: Pose, at: FloatArray) -> FloatArray:
    return np.asarray((body @ np.append(at, 1.0))[:3])


@dataclass(frozen=True)
class Slide:
    """How a slide continues its guide: turns and shifts that change with the position, about a bearing of its own."""

    axis: int
    sense: float  # +1: it carries the tool, to plus; -1: it carries the workpiece, to minus
    bearing: FloatArray
    turns: FloatArray  # (2, 3) [rad], constant and per 400 mm
    shifts: FloatArray  # (2, 3) [mm]

    def pose(self, position: float, *, perfect: bool) -> Pose:
        way = self.sense * position * np.eye(3)[self.axis]
        if perfect:
            return pose(np.zeros(3), way)
        u = position / 400.0
        turn, shift = self.turns[0] + u * self.turns[1], self.shifts[0] + u * u * self.shifts[1]
        about = pose(np.zeros(3), self.bearing) @ pose(turn, np.zeros(3)) @ pose(np.zeros(3), -self.bearing)
        return pose(np.zeros(3), way + shift) @ about


class Bodies:
    """A machine of bodies."""

    def __init__(self, structure: Structure, rng: np.random.Generator, urad: float, um: float) -> None:
        self.structure = structure
        self.slides = {
            name: Slide(
                "XYZ".index(name),
                -1.0 if name in structure.workpiece else 1.0,
                rng.uniform(-300, 300, 3),
                1e-6 * rng.uniform(-urad, urad, (2, 3)),
                1e-3 * rng.uniform(-um, um, (2, 3)),
            )
            for name in structure.axes
        }

    def between(self, point: FloatArray, wrong: str) -> Pose:
        """Return the tool's frame as seen from the workpiece's; only the slides in `wrong` go astray."""
        table = carriage = np.eye(4)
        for name in reversed(self.structure.workpiece):  # the slide on the bed comes last in the code
            table = table @ self.slides[name].pose(point["XYZ".index(name)], perfect=name not in wrong)
        for name in self.structure.tool:
            carriage = carriage @ self.slides[name].pose(point["XYZ".index(name)], perfect=name not in wrong)
        return np.asarray(np.linalg.inv(table) @ carriage)

    def read(self, axis: Axis, position: float) -> tuple[FloatArray, FloatArray]:
        """Return shifts [um] and turns [urad] of one axis at a position, as the instruments on it read them.

        The other axes stand, and are right; `axis.measured_at` is where they stand.
        """
        k, stood = "XYZ".index(axis.name), np.array(axis.measured_at)
        there = np.where(np.arange(3) == k, position, stood)
        right, actual = self.between(there, ""), self.between(there, axis.name)
        if axis.measured_on == "tool":
            # a reflector in the spindle, looked at from the table
            reflector = np.array(axis.measured_tool)
            shift = place(actual, reflector) - place(right, reflector)
        else:
            # a reflector on the table, put where the tool was; what of the tool's side ought to be there, where is it?
            reflector = place(self.between(stood, ""), np.array(axis.measured_tool))
            shift = place(actual, place(np.asarray(np.linalg.inv(right), dtype=np.float64), reflector)) - reflector
        return 1e3 * shift, 1e6 * Rotation.from_matrix(actual[:3, :3]).as_rotvec()

    def error(self, point: FloatArray, tool: FloatArray) -> FloatArray:
        return 1e3 * (place(self.between(point, "XYZ"), tool) - place(self.between(point, ""), tool))


def measured(bodies: Bodies, machine: Machine, point: FloatArray) -> FloatArray:
    values = np.zeros(len(COMPONENTS))
    for axis in machine.axes:
        shift, turn = bodies.read(axis, point["XYZ".index(axis.name)])
        first = INDEX[f"EX{axis.name}"]
        values[first : first + 3], values[first + 3 : first + 6] = shift, turn
    return values


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("side", ["tool", "workpiece", "mixed"])
@pytest.mark.parametrize("code", STRUCTURES)
def test_what_the_instruments_read_is_put_together_again(code: str, side: str, seed: int) -> None:
    """Turns of 20 mrad and more than a millimetre: to rounding, from either side, on any machine."""
    rng = np.random.default_rng(seed)
    machine = random_machine(code, rng)
    if side != "mixed":
        machine = replace(machine, axes=tuple(replace(a, measured_on=side) for a in machine.axes))  # type: ignore[arg-type]
    bodies = Bodies(machine.structure, rng, 20_000.0, 2000.0)
    for _ in range(3):
        point, tool = rng.uniform(-400, 400, 3), rng.uniform(-200, 200, 3)
        truth = bodies.error(point, tool)
        found = exact.error(machine, measured(bodies, machine, point), point, tool)
        assert found == pytest.approx(truth, abs=1e-6)  # of some thousand um
        assert np.linalg.norm(truth) > 50.0


@pytest.mark.parametrize("side", ["tool", "workpiece"])
@pytest.mark.parametrize("code", STRUCTURES)
def test_the_first_order_is_left_behind_with_the_square(code: str, side: str) -> None:
    left = []
    for urad in (2000.0, 200.0):
        rng = np.random.default_rng(7)
        machine = random_machine(code, rng)
        machine = replace(machine, axes=tuple(replace(a, measured_on=side) for a in machine.axes))  # type: ignore[arg-type]
        bodies = Bodies(machine.structure, rng, urad, urad)
        point, tool = np.array([310.0, -250.0, 190.0]), np.array([40.0, -60.0, -150.0])
        first = Kinematics(machine).synthesize(measured(bodies, machine, point), point, tool)[0]
        left.append(float(np.linalg.norm(first - bodies.error(point, tool))))
    # second order; with one axis, and seen from the tool's side, there is next to none
    assert left[1] < 0.02 * left[0]
    assert left[0] < 50.0


def test_where_the_place_stays_makes_a_difference() -> None:
    """A yaw of 20 urad, 300 mm from where X was measured: 6 um in Y if the reflector stayed on the table."""
    structure, point = Structure.parse("w X' b Z t"), np.array([400.0, 0.0, 0.0])
    values = np.zeros(len(COMPONENTS))
    values[INDEX["ECX"]] = 20.0
    for side, moved in (("tool", 0.0), ("workpiece", 6.0)):
        x = Axis("X", (0.0, 600.0), measured_at=(100.0, 0.0, 0.0), measured_on=side)  # type: ignore[arg-type]
        machine = Machine("mill", structure, (x, Axis("Z", (0.0, 300.0))))
        assert Kinematics(machine).synthesize(values, point)[0] == pytest.approx([0.0, moved, 0.0])
        assert exact.error(machine, values, point) == pytest.approx([0.0, moved, 0.0], abs=1e-4)
        assert Kinematics(machine).ways("X") == (("X", "Z") if side == "workpiece" else ("Z",))


@pytest.mark.parametrize("code", ["w X' b Z Y (C1) t", "w Y' X' b Z t", "XYZF", "FXYZ"])
def test_raw_readings_of_a_laser_are_used_as_they_are(code: str) -> None:
    """Turns count from where their axis stood while those beyond it were measured: then nothing is there twice.

    The laser sees the machine as it is, all axes wrong at once, and is zeroed where it begins.
    """
    rng = np.random.default_rng(3)
    machine = random_machine(code, rng)
    cross, reflector, tool = (float(v) for v in rng.uniform(-200, 200, 3)), (0.0, 0.0, -150.0), np.array([9.0, 0, -230])
    x, y, z = cross
    crossing = np.array([x, y, z])
    axes = tuple(replace(a, measured_at=(x, y, z), measured_tool=reflector, measured_on="tool") for a in machine.axes)
    machine = replace(machine, axes=axes)
    bodies = Bodies(machine.structure, rng, 50.0, 30.0)

    def seen(point: FloatArray) -> tuple[FloatArray, FloatArray]:
        turn = bodies.between(point, "XYZ")[:3, :3]
        return bodies.error(point, np.array(reflector)), 1e6 * Rotation.from_matrix(turn).as_rotvec()

    kinematics, zero, absolute = Kinematics(machine), seen(crossing), {}
    for name in "XYZ":
        absolute[name] = bodies.read(machine.axis(name), crossing["XYZ".index(name)])[1]
    for point in rng.uniform(-400, 400, (4, 3)):
        values, twice = np.zeros(len(COMPONENTS)), np.zeros(len(COMPONENTS))
        for k, name in enumerate("XYZ"):
            shift, turn = seen(np.where(np.arange(3) == k, point, crossing))
            first = INDEX[f"EX{name}"]
            values[first : first + 6] = np.append(shift - zero[0], turn - zero[1])
            twice[first + 3 : first + 6] = absolute[name]
        truth = bodies.error(point, tool) - bodies.error(crossing, tool)
        assert kinematics.synthesize(values, point, tool)[0] == pytest.approx(truth, abs=0.1)
        # the same readings with turns that count from elsewhere: off by turn times way
        wrong = kinematics.synthesize(values + twice, point, tool)[0]
        off = wrong - kinematics.synthesize(values + twice, crossing, tool)[0] - truth
        assert np.abs(off).max() > 1.0
