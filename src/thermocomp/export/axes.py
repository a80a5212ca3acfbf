"""Axis of each correction, and its form for a controller: offset, slope, and reference position."""

from collections.abc import Mapping
from typing import NamedTuple

from thermocomp.core.exceptions import InputError
from thermocomp.export.reduction.reduced import find_axis
from thermocomp.export.st.structuredtext import SourceUnit
from thermocomp.export.st.ststatements import SCL, Dialect, array, number, quoted, section
from thermocomp.runtime.program.tables import Tables


class Drive(NamedTuple):
    """An axis of the controller, and the correction that is applied to it."""

    letter: str
    target: int  #: index of its correction
    position: float  #: reference position of the slope [mm]
    travel: tuple[float, float]  #: measured range [mm]; both ends equal without a slope


def find_drives(tables: Tables, named: Mapping[str, str]) -> list[Drive]:
    """Return the axes to which corrections are applied, by option or by the names of the targets."""
    if unknown := [t for t in named if t not in tables.targets]:
        raise InputError(f"--axes {unknown[0]}: no such target; there are {', '.join(tables.targets)}")
    found: dict[str, Drive] = {}
    for k, target in enumerate(tables.targets):
        letter = named.get(target, "") if named else find_axis(target, {})
        if letter in found:
            other = tables.targets[found[letter].target]
            raise InputError(
                f"{other} and {target} are both {letter}: state which one drives this axis, such as --axes "
                f"{target}={letter}"
            )
        if letter:
            values = tables.values
            travel = (values["travel_low"][k], values["travel_high"][k])
            found[letter] = Drive(letter, k, values["position"][k], travel)
    if not found:
        raise InputError(
            f"the axis of {', '.join(tables.targets)} is not known: give it, such as --axes {tables.targets[0]}=Z"
        )
    return list(found.values())


#: largest integer (DINT)
WHOLE = 2**31 - 1


class Value(NamedTuple):
    """A parameter or variable of a controller that receives part of a correction, per axis."""

    name: str
    about: str
    factor: float  #: conversion from um, um/m or mm
    whole: bool = False  #: an integer


def write_values(
    name: str, dialect: Dialect, drives: list[Drive], taken: Mapping[str, Value], direction: float
) -> SourceUnit:
    """Return a function block that converts the corrections to the inputs of a controller."""
    scl, n = dialect == "scl", len(drives)
    _check_whole(drives, taken["position"])
    mark = "#" if scl else ""
    most = 1 + max(d.target for d in drives)
    outputs = {v.name: array("int" if v.whole else "real", n) for v in taken.values()}
    parts = [
        f"FUNCTION_BLOCK {quoted(name, scl)}",
        *(SCL if scl else []),
        f"(* Values for the controller, by axis: {', '.join(f'{k}: {d.letter}' for k, d in enumerate(drives))} *)",
        *(f"(* {v.name}: {v.about} *)" for v in taken.values()),
        "(* direction: 1.0 if the controller adds the value to the command, -1.0 if it subtracts it. UNCONFIRMED: "
        "test it *)",
        section(
            "VAR_INPUT",
            {
                "correction": array("real", most),
                "slope": array("real", most),
                "direction": f"LREAL := {number(direction)}",
            },
        ),
        section("VAR_OUTPUT", outputs),
    ]
    lines = []
    for k, drive in enumerate(drives):
        signed = {
            "offset": f"{mark}direction * {mark}correction[{drive.target}]",
            "slope": f"{mark}direction * {mark}slope[{drive.target}]",
            "position": number(drive.position) if drive.position >= 0 else f"({number(drive.position)})",
        }
        for part, value in taken.items():
            said = f"{signed[part]} * {number(value.factor)}"
            place = f"{mark}{value.name}[{k}]"
            if value.whole:
                lines += [
                    f"IF {said} < 0.0 THEN",
                    f"    {place} := -TRUNC(0.5 - {said});",
                    "ELSE",
                    f"    {place} := TRUNC(0.5 + {said});",
                    "END_IF;",
                ]
            else:
                lines.append(f"{place} := {said};")
    return SourceUnit(name, "\n".join(parts), "\n".join(lines), "END_FUNCTION_BLOCK")


def _check_whole(drives: list[Drive], taken: Value) -> None:
    """Reject reference positions that exceed the integer range."""
    for drive in drives:
        if taken.whole and abs(drive.position * taken.factor) >= WHOLE:
            raise InputError(
                f"{drive.letter}: the reference position of its slope is {drive.position:g} mm, but {taken.about} "
                f"is limited to {WHOLE / taken.factor:.0f} mm: record with positions in machine coordinates [mm]"
            )
