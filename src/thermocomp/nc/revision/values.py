"""Values of the options of ``thermocomp revise``, parsed from their texts."""

import re
from collections.abc import Callable, Sequence
from typing import NamedTuple

from thermocomp.core.exceptions import InputError, UnitError
from thermocomp.core.units import read_with_unit as with_unit
from thermocomp.nc.interpreter import startup
from thermocomp.nc.interpreter.block import Point, triple
from thermocomp.nc.interpreter.codes import find_code
from thermocomp.nc.parser.line import Controller

_ANGLE = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+))\s*(?:deg|°)")
_PERCENT = re.compile(r"(\d+\.?\d*|\.\d+)\s*%")
#: assumed value, and the ends of its range
_SPREAD = re.compile(r"\s*([^,]+?)\s*(?:,\s*(.+?)\s+to\s+(.+?)\s*)?")
_SYSTEM = re.compile(r"G?5([4-9])(?:\.([1-3]))?(?:\s*P(\d+))?", re.IGNORECASE)


def read_value(text: str, quantity: str, option: str, example: str, *, positive: bool = False) -> float:
    """Return the value of an option in internal units."""
    try:
        number = with_unit(text, quantity)
    except UnitError as e:
        raise InputError(f"{option} {text!r}: {e}") from e
    if number is None:
        raise InputError(f'{option} {text!r}: write a value with its unit, such as "{example}"')
    if positive and not number > 0:
        raise InputError(f"{option} {text!r}: must be positive")
    return number


class Spread(NamedTuple):
    """Assumed value and the ends of its range, each with its text."""

    text: str
    value: float
    ends: tuple[tuple[str, float], ...]  #: empty: the value is certain


def spread_of(text: str, read: Callable[[str], float], option: str, example: str) -> Spread:
    """Return an assumed value and its range."""
    found = _SPREAD.fullmatch(text)
    if found is None:
        raise InputError(f'{option} {text!r}: write a value, or a value and its range, such as "{example}"')
    taken, *ends = (t for t in found.groups() if t is not None)
    spread = Spread(taken, read(taken), tuple((t, read(t)) for t in ends))
    if spread.ends and not spread.ends[0][1] <= spread.value <= spread.ends[1][1]:
        raise InputError(f"{option} {text!r}: the value must be within its range, and the range from low to high")
    return spread


def percent_of(text: str) -> float:
    """Return the fraction for a feed override."""
    found = _PERCENT.fullmatch(text)
    if found is None or not float(found[1]) > 0:
        raise InputError(f'--override {text!r}: expected a positive percentage, such as "100 %"')
    return float(found[1]) / 100.0


def origin_of(text: str) -> tuple[int, Point]:
    """Return number and origin [mm] of a work coordinate system."""
    name, _, place = text.partition("=")
    said = f"--origin {text!r}"
    return _system(name, said, "G54=100 mm, 50 mm, 0 mm"), point_of(place, said)


def rotations_of(texts: Sequence[str]) -> dict[int, float]:
    """Return the stored rotations of work coordinate systems [deg]."""
    if [text.strip().lower() for text in texts] == ["none"]:
        return dict.fromkeys(range(1, 10), 0.0)
    found = {}
    for text in texts:
        name, _, angle = text.partition("=")
        said, example = f"--rotation {text!r}", "G54=12 deg"
        system, turned = _system(name, said, example), _ANGLE.fullmatch(angle.strip())
        if turned is None:
            raise InputError(f'{said}: write an angle in degrees, such as "{example}", or "none" as the only value')
        found[system] = float(turned[1])
    return found


def _system(name: str, said: str, example: str) -> int:
    """Return the number of a work coordinate system."""
    found = _SYSTEM.fullmatch(name.strip())
    if found is None or (found[2] and found[3] and found[2] != "1"):
        raise InputError(f'{said}: expected a work coordinate system, such as "{example}"')
    base, decimal, extra = int(found[1]), found[2], found[3]
    if extra:  # G54.1 P3
        return 100 + int(extra)
    if decimal and base != 9:
        raise InputError(f"{said}: expected G54 to G59, G59.1 to G59.3, or G54.1 P1 and up")
    return 6 + int(decimal) if decimal else base - 3


def point_of(text: str, said: str) -> Point:
    """Return the point in a text with three lengths [mm]."""
    parts = [part.strip() for part in text.split(",")]
    if len(parts) != 3:
        raise InputError(f"{said}: expected X, Y and Z, such as 100 mm, 50 mm, 0 mm")
    return triple(read_value(part, "position", said, "100 mm") for part in parts)


def startup_of(text: str, controller: Controller) -> str:
    """Return codes in force at the start of a program."""
    try:
        return startup.tidy(text, controller)
    except InputError as e:
        raise InputError(f"--startup {e}") from e


def m_code_of(text: str, controller: Controller) -> int:
    """Return the number of an M code whose meaning is unknown."""
    number = text.upper().removeprefix("M")
    if not number.isdecimal():
        raise InputError(f"--harmless {text!r}: expected an M code, such as M{101 if controller == 'linuxcnc' else 88}")
    if (code := find_code("M", float(number), controller)) is not None:
        raise InputError(
            f"--harmless {text!r}: {code.name} is a known code ({code.does}), whose effect is taken into account; "
            "remove the option"
        )
    if controller == "linuxcnc" and not 100 <= int(number) < 200:
        raise InputError(f"--harmless {text!r}: LinuxCNC has no such code; user-defined codes are M100 to M199")
    return int(number)


def tool_of(text: str, option: str, example: str) -> tuple[int, float]:
    """Return number and length, or diameter, of a tool [mm]."""
    name, _, length = (part.strip() for part in text.partition("="))
    number = name.upper().removeprefix("T")
    if not number.isdecimal():
        raise InputError(f'{option} {text!r}: expected the number of a tool and a length, such as "1={example}"')
    return int(number), read_value(length, "position", f"{option} {text!r}", example)
