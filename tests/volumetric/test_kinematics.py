"""First-order synthesis against levers counted by hand (C-08)."""

import numpy as np
import pytest
from hypothesis import given
from volumetricmachine import FloatArray, by_hand, machines, random_values

from thermocomp.core.components import COMPONENTS
from thermocomp.core.exceptions import InputError
from thermocomp.core.machine import Axis, Machine
from thermocomp.core.structure import Structure
from thermocomp.runtime.geometry import exact
from thermocomp.runtime.geometry.kinematics import INDEX, Kinematics

POINT = np.array([100.0, 200.0, 300.0])

#: from the reference point to the tip at POINT: with a tool of (5, 0, -150) after one of (0, 0, -50) every lever has
#: (5, 0, -100); each axis beyond adds what it went from (10, 20, 30): 90, 180 or 270 mm
LEVERS = {
    # all axes carry the tool: X stands on the bed, Z carries the spindle
    "FXYZ": {"X": (5.0, 180.0, 170.0), "Y": (5.0, 0.0, 170.0), "Z": (5.0, 0.0, -100.0)},
    "XYZ": {"X": (5.0, 180.0, 170.0), "Y": (5.0, 0.0, 170.0), "Z": (5.0, 0.0, -100.0)},
    # the table moves in X and Y, the head in Z: seen from the workpiece the same order
    "XYFZ": {"X": (5.0, 180.0, 170.0), "Y": (5.0, 0.0, 170.0), "Z": (5.0, 0.0, -100.0)},
    # the other way round: the table moves in X on a saddle that moves in Y
    "YXFZ": {"Y": (95.0, 0.0, 170.0), "X": (5.0, 0.0, 170.0), "Z": (5.0, 0.0, -100.0)},
    # the table moves in X; on the column the head goes up and down and the ram in and out
    "w X' b Z Y (C1) t": {"X": (5.0, 180.0, 170.0), "Z": (5.0, 180.0, -100.0), "Y": (5.0, 0.0, -100.0)},
    # the spindle is stopped: between Z and the tool nothing moves
    "XYZF": {"X": (5.0, 180.0, 170.0), "Y": (5.0, 0.0, 170.0), "Z": (5.0, 0.0, -100.0)},
    "XZY": {"X": (5.0, 180.0, 170.0), "Z": (5.0, 180.0, -100.0), "Y": (5.0, 0.0, -100.0)},
}


def test_rotary_axes_are_refused_not_passed_over() -> None:
    machine = Machine("Mill 5", Structure.parse("w C' X' b Z B (C1) t"), tuple(Axis(a, (0.0, 600.0)) for a in "XZ"))
    with pytest.raises(InputError, match=r"Mill 5: rotary axis C, B in the structure \"w C' X' b Z B \(C1\) t\""):
        Kinematics(machine)
    with pytest.raises(InputError, match="rotary axis C, B"):
        exact.error(machine, np.zeros(len(COMPONENTS)), POINT)


def first_and_exact(machine: Machine, **components: float) -> tuple[FloatArray, FloatArray]:
    values = np.zeros(len(COMPONENTS))
    for code, value in components.items():
        values[INDEX[code]] = value
    return Kinematics(machine).synthesize(values, POINT)[0], exact.error(machine, values, POINT)


@pytest.mark.parametrize("code", LEVERS)
@pytest.mark.parametrize("axis", ["X", "Y", "Z"])
def test_an_angle_moves_the_tip_by_its_lever(code: str, axis: str) -> None:
    machine = by_hand(code)
    x, y, z = LEVERS[code][axis]
    assert Kinematics(machine).lever(axis, POINT) == pytest.approx((x, y, z))
    # 10 urad times mm are hundredths of a micrometre
    expected = {"A": (0.0, -z, y), "B": (z, 0.0, -x), "C": (-y, x, 0.0)}
    for letter, moved in expected.items():
        first, exactly = first_and_exact(machine, **{f"E{letter}{axis}": 10.0})
        assert first == pytest.approx(1e-2 * np.array(moved), abs=1e-12)
        # 1 - cos of 10 urad is 5e-11: half a tenth of a nanometre at a metre
        assert exactly == pytest.approx(1e-2 * np.array(moved), abs=5e-5)


@pytest.mark.parametrize("code", LEVERS)
def test_where_it_was_measured_no_angle_moves_anything(code: str) -> None:
    machine = by_hand(code)
    values = np.zeros(len(COMPONENTS))
    for k, c in enumerate(COMPONENTS):
        if c.group == "axis" and c.unit == "urad":
            values[k] = 100.0
    at = np.array([10.0, 20.0, 30.0])
    assert Kinematics(machine).synthesize(values, at, (0.0, 0.0, -50.0))[0] == pytest.approx(np.zeros(3), abs=1e-12)


@pytest.mark.parametrize("code", LEVERS)
def test_squareness_bends_the_way_from_the_reference_position(code: str) -> None:
    machine = by_hand(code, reference=50.0)
    expected = {"C0Y": (-1.5, 0.0, 0.0), "B0Z": (2.5, 0.0, 0.0), "A0Z": (0.0, -2.5, 0.0)}  # ways of 150 and 250 mm
    for component, moved in expected.items():
        first, exactly = first_and_exact(machine, **{component: 10.0})
        assert first == pytest.approx(moved, abs=1e-12)
        assert exactly == pytest.approx(moved, abs=5e-5)


def test_squareness_turns_the_guide_and_not_the_tool() -> None:
    values = np.zeros(len(COMPONENTS))
    values[[INDEX["C0Y"], INDEX["B0Z"], INDEX["A0Z"]]] = 100.0
    assert not Kinematics(by_hand("XYZ")).synthesize(values, POINT)[1].any()


def test_spindle_tilt_grows_with_the_tool() -> None:
    machine = by_hand("XFZY", spindle_tool=(0.0, 0.0, -50.0))
    kinematics, values = Kinematics(machine), np.zeros(len(COMPONENTS))
    values[INDEX["A0C"]] = 20.0
    for length in (50.0, 150.0, 250.0):
        # y = -A z: the tip is (length - 50) below where the drift was measured
        moved = (0.0, 1e-3 * 20.0 * (length - 50.0), 0.0)
        assert kinematics.synthesize(values, POINT, (0.0, 0.0, -length))[0] == pytest.approx(moved, abs=1e-12)
        assert exact.error(machine, values, POINT, (0.0, 0.0, -length)) == pytest.approx(moved, abs=1e-4)
    values = np.zeros(len(COMPONENTS))
    values[INDEX["B0C"]] = 20.0
    # x = B z, z = -B x
    assert kinematics.synthesize(values, POINT)[0] == pytest.approx((-2.0, 0.0, -0.1), abs=1e-12)
    assert kinematics.synthesize(values, POINT)[1] == pytest.approx((0.0, 20.0, 0.0))


def test_drifts_and_shifts_are_added() -> None:
    first, exactly = first_and_exact(by_hand("XYFZ"), X0C=1.0, Y0C=2.0, Z0C=3.0, XOX=10.0, YOX=20.0, ZOY=30.0, ZOX=-5.0)
    assert first == pytest.approx((11.0, 22.0, 28.0))
    assert exactly == pytest.approx(first)


@given(machines)
def test_tilt_is_the_sum_of_all_angles(drawn: tuple[Machine, np.random.Generator]) -> None:
    machine, rng = drawn
    values = random_values(machine, rng, 100.0, 50.0)[0]
    tilt = Kinematics(machine).synthesize(values, rng.uniform(-400, 400, 3))[1]
    for k, letter in enumerate("ABC"):
        codes = [f"E{letter}X", f"E{letter}Y", f"E{letter}Z", *([f"{letter}0C"] if letter != "C" else [])]
        assert tilt[k] == pytest.approx(sum(values[INDEX[code]] for code in codes))


@given(machines)
def test_error_is_the_sum_of_components_times_sensitivities(drawn: tuple[Machine, np.random.Generator]) -> None:
    machine, rng = drawn
    kinematics, tool = Kinematics(machine), rng.uniform(-200, 200, 3)
    values, points = random_values(machine, rng, 100.0, 50.0, rows=4), rng.uniform(-400, 400, (4, 3))
    for chosen in (None, tool):
        together = kinematics.synthesize(values, points, chosen)[0]
        for row, (value, point) in enumerate(zip(values, points, strict=True)):
            assert together[row] == pytest.approx(value @ kinematics.sensitivity(point, chosen), abs=1e-9)


@given(machines)
def test_levers_and_sensitivities_say_the_same(drawn: tuple[Machine, np.random.Generator]) -> None:
    machine, rng = drawn
    kinematics, point, tool = Kinematics(machine), rng.uniform(-400, 400, 3), rng.uniform(-200, 200, 3)
    sensitivity = kinematics.sensitivity(point, tool)
    for axis in machine.structure.axes:
        turns = 1e-3 * np.cross(np.eye(3), kinematics.lever(axis, point, tool))
        assert sensitivity[INDEX[f"EA{axis}"] : INDEX[f"EC{axis}"] + 1] == pytest.approx(turns, abs=1e-12)


def test_values_and_points_are_broadcast() -> None:
    kinematics, rng = Kinematics(by_hand("XYFZ")), np.random.default_rng(0)
    states, points = rng.normal(size=(4, 1, len(COMPONENTS))), rng.uniform(0, 600, (7, 3))
    error, tilt = kinematics.synthesize(states, points)
    assert error.shape == tilt.shape == (4, 7, 3)
    assert error[2, 5] == pytest.approx(kinematics.synthesize(states[2, 0], points[5])[0])
    assert exact.error(kinematics.machine, states, points)[2, 5] == pytest.approx(
        exact.error(kinematics.machine, states[2, 0], points[5])
    )
