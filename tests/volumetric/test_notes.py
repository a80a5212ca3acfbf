"""Notes on a machine: turns that would be counted twice, profiles that are held."""

from itertools import pairwise

import pytest
from volumetricmachine import line

from thermocomp.core.machine import Axis, Machine, Source, Vector
from thermocomp.core.position import PositionModel
from thermocomp.core.profile import SplineProfile
from thermocomp.core.structure import Structure
from thermocomp.volumetric.notes import note_counted_twice, note_short_profiles, note_untilted, notes


def mill(components: dict[str, Source], code: str = "w X' b Z Y (C1) t", side: str = "tool") -> Machine:
    """Return a machine of 600, 500 and 400 mm, each axis measured where X, Y, Z stood at 300, 250, 100 mm."""
    at: Vector = (300.0, 250.0, 100.0)
    travels = {"X": (0.0, 600.0), "Y": (0.0, 500.0), "Z": (0.0, 400.0)}
    structure = Structure.parse(code)
    axes = tuple(Axis(a, travels[a], measured_at=at, measured_on=side) for a in structure.axes)  # type: ignore[arg-type]
    return Machine("mill", structure, axes, components)


def along(axis: str, unit: str, *points: tuple[float, float]) -> PositionModel:
    profile = SplineProfile(
        axis=axis,
        knots=tuple(p for p, _ in points),
        pieces=tuple((a, b - a, 0.0, 0.0) for (_, a), (_, b) in pairwise(points)),
    )
    return PositionModel(target="e", unit=unit, axis=axis, travel=(0.0, 1.0), profile=profile)  # type: ignore[arg-type]


def test_a_turn_that_was_there_while_another_axis_was_measured() -> None:
    """20 urad over 500 mm of Y are 10 um."""
    (found,) = note_counted_twice(mill({"ECX": 20.0}))
    assert found == (
        "ECX is 20 urad at X 300 mm, its position while Y was measured: over the travel of Y it moves the tip by 10 um "
        "along X. EXY or C0Y already contains this if it was measured between table and spindle: then make ECX "
        "relative to its value at X 300 mm"
    )


@pytest.mark.parametrize(
    ("code", "component", "told"),
    [
        # of X, both others are levers: A moves along Z and Y, B along X over Z, C along X over Y
        ("w X' b Z Y (C1) t", "EAX", [("Y", "Z", 10.0), ("Z", "Y", 8.0)]),
        ("w X' b Z Y (C1) t", "EBX", [("Z", "X", 8.0)]),
        ("w X' b Z Y (C1) t", "EAZ", [("Y", "Z", 10.0)]),
        ("w X' b Z Y (C1) t", "EBZ", []),
        ("w X' b Z Y (C1) t", "ECZ", [("Y", "X", 10.0)]),
        ("w X' b Z Y (C1) t", "EAY", []),
        ("YXFZ", "ECY", [("X", "Y", 12.0)]),
        ("YXFZ", "EBY", [("X", "Z", 12.0), ("Z", "X", 8.0)]),
    ],
)
def test_the_axes_beyond_are_named(code: str, component: str, told: list[tuple[str, str, float]]) -> None:
    found = note_counted_twice(mill({component: -20.0}, code))
    assert len(found) == len(told)
    for other, towards, effect in told:
        words = f"over the travel of {other} it moves the tip by {effect:g} um along {towards}"
        (note,) = (n for n in found if words in n)
        assert f"E{towards}{other}" in note
        assert f"{component} is -20 urad" in note


def test_a_turn_that_counts_from_there_is_told_once() -> None:
    zero, other = (along("X", "urad", (0.0, a), (300.0, 0.0), (600.0, b)) for a, b in ((-30.0, 30.0), (0.0, 30.0)))
    shifted = along("X", "urad", (0.0, 0.0), (600.0, 30.0))
    assert note_counted_twice(mill({"ECX": zero})) == note_counted_twice(mill({"ECX": other})) == ()
    (found,) = note_counted_twice(mill({"ECX": shifted}))
    assert "ECX is 15 urad at X 300 mm" in found
    assert "by 7.5 um along X" in found
    # models of time begin at zero; what nobody sees is not given; nothing else turns
    quiet: dict[str, Source] = {"ECX": line("ECX", "urad", {"t": 9.0}), "EAX": 0.05, "EXX": 9.0, "C0Y": 9.0, "A0C": 9.0}
    assert note_counted_twice(mill(quiet)) == ()


def test_its_own_way_counts_if_the_place_stays_with_the_workpiece() -> None:
    (found,) = note_counted_twice(mill({"ECY": 20.0}, side="workpiece"))
    assert "ECY is 20 urad at Y 250 mm, its position while Y was measured: over the travel of Y" in found
    assert note_counted_twice(mill({"ECY": 20.0})) == ()


def test_what_is_known_of_a_part_of_the_travel_is_held() -> None:
    whole, part = (along("X", "um", (a, 0.0), (b, 1.0)) for a, b in ((0.0, 600.0), (100.0, 600.0)))
    slope = PositionModel(
        target="EYY", unit="um", axis="Y", travel=(0.0, 450.0), slopes=(line("EYY", "um/m", {"t": 1.0}),)
    )
    machine = mill({"EXX": whole, "EYX": part, "EYY": slope, "EZZ": 3.0, "ECX": 20.0})
    assert note_short_profiles(machine) == (
        "EYX: its profile is known for X = 100 to 600 mm, but the axis travels from 0 to 600 mm: beyond, the value at "
        "the end is held",
        "EYY: its slope is known for Y = 0 to 450 mm, but the axis travels from 0 to 500 mm: beyond, the value at "
        "the end is held",
    )
    assert notes(machine) == (*note_counted_twice(machine), *note_short_profiles(machine))
    assert len(notes(machine)) == 3


def test_a_tool_of_another_length_wants_the_tilt() -> None:
    def told(tool: float, **components: Source) -> tuple[str, ...]:
        machine = Machine(
            "mill",
            Structure.parse("XYZ"),
            tuple(Axis(a, (0.0, 500.0)) for a in "XYZ"),
            components,
            spindle_tool=(0.0, 0.0, -150.0),
            tool=(0.0, 0.0, -tool),
        )
        return note_untilted(machine)

    assert told(150.0, Z0C=5.0) == ()
    assert told(250.0) == ()  # nothing is said of the spindle at all
    (both,) = told(250.0, Z0C=5.0)
    assert both.startswith("A0C and B0C are not known: the tip of the tool is 100 mm")
    assert both.endswith("10 urad of tilt would move it by 1.0 um")
    (one,) = told(250.0, Z0C=5.0, A0C=1.0)
    assert one.startswith("B0C is not known")
    assert told(250.0, Z0C=5.0, A0C=1.0, B0C=0.0) == ()
