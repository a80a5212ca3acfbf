"""Notes on a machine before its errors are summed: possible double counting, values held beyond their range."""

import numpy as np

from thermocomp.core.components import BY_CODE
from thermocomp.core.machine import Machine, Source
from thermocomp.core.position import PositionModel
from thermocomp.runtime.geometry.kinematics import Kinematics

#: negligible lever effect [um]
NEGLIGIBLE = 0.5
#: tolerance for reaching the end of a travel [mm]
_NEAR = 1e-3


def notes(machine: Machine) -> tuple[str, ...]:
    """Return the notes on a machine as sentences: `note_untilted`, `note_counted_twice`, `note_short_profiles`."""
    return (*note_untilted(machine), *note_counted_twice(machine), *note_short_profiles(machine))


def note_untilted(machine: Machine) -> tuple[str, ...]:
    """Return a note if the spindle tilt is unknown and the tool length differs from that of the drift measurement."""
    longer = float(np.linalg.norm(np.subtract(machine.tool, machine.spindle_tool)))
    unknown = [code for code in ("A0C", "B0C") if code not in machine.components]
    drifts = any(code in machine.components for code in ("X0C", "Y0C", "Z0C"))
    if not (unknown and drifts and longer > _NEAR):
        return ()
    verb = "is" if len(unknown) == 1 else "are"
    return (
        f"{' and '.join(unknown)} {verb} not known: the tip of the tool is {longer:g} mm from where the drift of the "
        f"spindle was measured, and 10 urad of tilt would move it by {1e-2 * longer:.1f} um",
    )


def note_counted_twice(machine: Machine) -> tuple[str, ...]:
    """Return notes on rotations that were not zero while another axis was measured.

    An instrument between table and spindle that measures axis j also measures the rotation of an axis i nearer to the
    workpiece as rotation times travel of j, because the travel of j is a lever of i. Unless the rotation is relative to
    the position of i during that measurement, readings and rotation contain the same error.
    """
    kinematics, found = Kinematics(machine), []
    for axis in machine.structure.axes:
        for other in kinematics.ways(axis):
            stood = machine.axis(other).measured_at
            low, high = machine.axis(other).travel
            for about, letter in enumerate("ABC"):
                along = "XYZ".index(other)
                if about == along:  # a travel along the axis of rotation is not a lever
                    continue
                code, towards = f"E{letter}{axis}", "XYZ"[3 - about - along]
                turn = _static(machine.components.get(code), np.array(stood))
                effect = 1e-3 * abs(turn) * (high - low)
                if effect < NEGLIGIBLE:
                    continue
                straightness, square = f"E{towards}{other}", _squareness(letter, other)
                found.append(
                    f"{code} is {turn:.3g} urad at {axis} {stood['XYZ'.index(axis)]:g} mm, its position while {other} "
                    f"was measured: over the travel of {other} it moves the tip by {effect:.3g} um along {towards}. "
                    f"{' or '.join((straightness, *square))} already contains this if it was measured between table "
                    f"and spindle: then make {code} relative to its value at {axis} {stood['XYZ'.index(axis)]:g} mm"
                )
    return tuple(found)


def note_short_profiles(machine: Machine) -> tuple[str, ...]:
    """Return notes on profiles and slopes that are known for part of the travel only, one sentence each."""
    found = []
    for code, source in machine.components.items():
        if not isinstance(source, PositionModel):
            continue
        for what, name, (low, high) in source.ranges():
            first, last = machine.axis(name).travel
            if low > first + _NEAR or high < last - _NEAR:
                found.append(
                    f"{code}: its {what} is known for {name} = {low:g} to {high:g} mm, but the axis travels "
                    f"from {first:g} to {last:g} mm: beyond, the value at the end is held"
                )
    return tuple(found)


def _static(source: Source | None, point: np.ndarray[tuple[int], np.dtype[np.float64]]) -> float:
    """Return the value of a component at a point in the reference state."""
    if isinstance(source, PositionModel):
        return float(source.at(point, np.zeros(len(source.models))))
    return float(source) if isinstance(source, float | int) else 0.0


def _squareness(letter: str, axis: str) -> tuple[str, ...]:
    code = f"{letter}0{axis}"
    return (code,) if code in BY_CODE else ()
