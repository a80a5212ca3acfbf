"""Exact transforms against rotations of scipy, branch by branch, and the first order against both."""

import math

import numpy as np
import pytest
from hypothesis import given
from scipy.spatial.transform import Rotation
from volumetricmachine import FloatArray, machines, random_machine, random_values

from thermocomp.core.components import COMPONENTS
from thermocomp.core.machine import Machine
from thermocomp.runtime.geometry import exact
from thermocomp.runtime.geometry.kinematics import Kinematics

CODES = [c.code for c in COMPONENTS]


class Joint:
    """An axis in one state: takes points of its tool's side to its workpiece's side, and back."""

    def __init__(self, machine: Machine, name: str, of: dict[str, float], point: FloatArray) -> None:
        axis, k = machine.axis(name), "XYZ".index(name)
        chain = [*machine.structure.workpiece, *machine.structure.tool]
        self.pivot = np.array(axis.measured_tool)
        for beyond in chain[chain.index(name) + 1 :]:
            self.pivot["XYZ".index(beyond)] += axis.measured_at["XYZ".index(beyond)]
        lean = {
            "X": (0.0, 0.0, 0.0),
            "Y": (0.0, 0.0, of.get("C0Y", 0.0)),
            "Z": (of.get("A0Z", 0.0), of.get("B0Z", 0.0), 0.0),
        }
        self.stays = axis.measured_on == "workpiece"
        if self.stays:
            self.pivot[k] += axis.measured_at[k]
        straight = np.eye(3)[k]
        guide = Rotation.from_rotvec(1e-6 * np.array(lean[name])).apply(straight)
        # the carriage continues the axis itself to the reference position, and along the guide from there
        self.move = axis.reference_position * straight + (point[k] - axis.reference_position) * guide
        self.move = self.move + 1e-3 * np.array([of[f"E{a}{name}"] for a in "XYZ"])
        self.way = point[k] * straight
        self.turn = Rotation.from_rotvec(1e-6 * np.array([of[f"E{a}{name}"] for a in "ABC"]))

    def forth(self, points: FloatArray) -> FloatArray:
        if self.stays:  # moved beside the pivot, and turned there
            return np.asarray(self.turn.apply(points + self.way - self.pivot) + self.pivot + self.move - self.way)
        return np.asarray(self.turn.apply(points - self.pivot) + self.pivot + self.move)

    def back(self, points: FloatArray) -> FloatArray:
        if self.stays:
            returned = self.turn.inv().apply(points - self.pivot - self.move + self.way)
            return np.asarray(returned + self.pivot - self.way)
        return np.asarray(self.turn.inv().apply(points - self.pivot - self.move) + self.pivot)


def branchwise(machine: Machine, values: FloatArray, point: FloatArray, tool: FloatArray) -> FloatArray:
    """Return the error of the tip: from the bed to the tool, from the bed to the workpiece, then between the two."""
    of = dict(zip(CODES, values.tolist(), strict=True))
    held = np.array(machine.spindle_tool)
    lean = Rotation.from_rotvec(1e-6 * np.array([of["A0C"], of["B0C"], 0.0]))
    drift = np.array([of[f"{a}0C"] + of[f"{a}OX"] + of[f"{a}OY"] for a in "XYZ"])
    tip = held + 1e-3 * drift + lean.apply(tool - held)
    for name in reversed(machine.structure.tool):
        tip = Joint(machine, name, of, point).forth(tip)
    # three points on the axes, a metre out, and the origin are carried along with the workpiece
    frame = np.vstack([1e3 * np.eye(3), np.zeros(3)])
    for name in machine.structure.workpiece:
        frame = Joint(machine, name, of, point).back(frame)
    axes = 1e-3 * (frame[:3] - frame[3])
    seen = axes @ (tip - frame[3])
    wanted = tool + np.array([point[k] if a in machine.structure.axes else 0.0 for k, a in enumerate("XYZ")])
    return np.asarray(1e3 * (seen - wanted))


@given(machines)
def test_exact_is_what_the_branches_say(drawn: tuple[Machine, np.random.Generator]) -> None:
    """Angles of up to 50 mrad and millimetres: only the true transforms say the same."""
    machine, rng = drawn
    values = random_values(machine, rng, 50_000.0, 5000.0)[0]
    point, tool = rng.uniform(-400, 400, 3), rng.uniform(-200, 200, 3)
    found = exact.error(machine, values, point, tool)
    assert found == pytest.approx(branchwise(machine, values, point, tool), abs=1e-8)
    first = Kinematics(machine).synthesize(values, point, tool)[0]
    assert np.abs(first - found).max() > 1.0


def second_order(machine: Machine, values: FloatArray, point: FloatArray) -> float:
    """Return a bound of what the first order leaves out [um].

    The tip is a sum of ways v_j, each turned by every angle before it. With T the sum of all angles' magnitudes a
    product of rotations differs from 1 by at most e^T - 1, and from 1 + their sum by at most e^T - 1 - T, which is at
    most T^2 e^T / 2, in the spectral norm. So the ways' lengths count with the second; what is itself an error
    (translations, and the guides' lean over their way) with the first; and the guides' own lean S with S^2 e^S / 2
    over its way.
    """
    of = dict(zip(CODES, np.abs(values).tolist(), strict=True))
    size = {a: 1e-6 * math.hypot(*(of[f"E{b}{a}"] for b in "ABC")) for a in machine.structure.axes}
    total = sum(size.values()) + 1e-6 * math.hypot(of["A0C"], of["B0C"])
    levers, at, ways, errors, leaning = Kinematics(machine), np.zeros(3), 0.0, 0.0, 0.0
    lean = {"X": 0.0, "Y": 1e-6 * of["C0Y"], "Z": 1e-6 * math.hypot(of["A0Z"], of["B0Z"])}
    for name in machine.structure.axes:
        k, reference = "XYZ".index(name), levers.reference(name)
        ways += float(np.linalg.norm(reference - at)) + abs(point[k])
        at = reference
        beside = abs(point[k] - machine.axis(name).reference_position)
        errors += 1e-3 * math.hypot(*(of[f"E{b}{name}"] for b in "XYZ")) + beside * math.expm1(lean[name])
        leaning += beside * 0.5 * lean[name] ** 2 * math.exp(lean[name])
    spindle = np.array(machine.spindle_tool)
    ways += float(np.linalg.norm(spindle - at)) + float(np.linalg.norm(np.array(machine.tool) - spindle))
    errors += 1e-3 * math.hypot(*(of[f"{b}0C"] + of[f"{b}OX"] + of[f"{b}OY"] for b in "XYZ"))
    return 1e3 * (ways * 0.5 * total**2 * math.exp(total) + errors * math.expm1(total) + leaning)


@given(machines)
def test_first_order_is_right_to_second_order(drawn: tuple[Machine, np.random.Generator]) -> None:
    machine, rng = drawn
    for urad, um in ((200.0, 100.0), (20_000.0, 1000.0)):
        values = random_values(machine, rng, urad, um)[0]
        point = rng.uniform(-400, 400, 3)
        first = Kinematics(machine).synthesize(values, point)[0]
        left = np.linalg.norm(exact.error(machine, values, point) - first)
        assert left <= second_order(machine, values, point) + 1e-8  # rounding: a metre in doubles is known to 1e-10 um


@pytest.mark.parametrize("code", ["XYZ", "XFZY", "YXFZ", "XYZF"])
def test_ten_times_smaller_errors_leave_a_hundredth(code: str) -> None:
    rng = np.random.default_rng(5)
    machine = random_machine(code, rng)
    values, point = random_values(machine, rng, 2000.0, 1000.0)[0], np.array([250.0, -120.0, 330.0])
    kinematics = Kinematics(machine)

    def left(scale: float) -> FloatArray:
        return exact.error(machine, scale * values, point) - kinematics.synthesize(scale * values, point)[0]

    assert 100 * left(0.1) == pytest.approx(left(1.0), rel=0.05, abs=1e-3)
    assert np.abs(left(1.0)).max() > 0.05


@given(machines)
def test_no_error_is_no_error(drawn: tuple[Machine, np.random.Generator]) -> None:
    machine, rng = drawn
    point = rng.uniform(-400, 400, (5, 3))
    assert exact.error(machine, np.zeros(len(COMPONENTS)), point) == pytest.approx(np.zeros((5, 3)), abs=1e-9)
