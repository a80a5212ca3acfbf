"""Keys of a machine file: their types, and the conversion to house units; all errors are collected."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from thermocomp.core.bounds import RANGE, check_name
from thermocomp.core.exceptions import SettingError, UnitError, explain_unknown
from thermocomp.core.structure import Structure
from thermocomp.core.units import read_with_unit

Keys = tuple[str | int, ...]
#: converts the value of a key to house units; takes the path of the key for error messages
Convert = Callable[[Any, Keys], Any]

#: name of a value with a unit, and an example of it
_SAID = {
    "position": ("length", "600 mm"),
    "displacement": ("length", "12 um"),
    "angle": ("angle", "12 urad"),
    "temperature": ("temperature", "20 degC"),
    "feed": ("speed", "30 m/min"),
    "acceleration": ("acceleration", "3 m/s2"),
}
QUANTITY = {"um": "displacement", "urad": "angle"}


class ManyError(SettingError):
    """Several errors of a list or table, with the values that were valid."""

    def __init__(self, errors: Sequence[SettingError], found: dict[str, Any]) -> None:
        super().__init__(str(errors[0]))
        self.errors, self.found = list(errors), found


@contextmanager
def kept(errors: list[SettingError]) -> Iterator[None]:
    """Collect an error raised in the ``with`` block, and continue after the block."""
    try:
        yield
    except SettingError as e:
        errors += e.errors if isinstance(e, ManyError) else [e]


def each(values: Mapping[str, Any], convert: Callable[[str, Any], Any]) -> dict[str, Any]:
    """Return the converted values; if some are invalid, raise `ManyError` with all of them."""
    errors: list[SettingError] = []
    found = {}
    for key, value in values.items():
        try:
            found[key] = convert(key, value)
        except ManyError as e:
            errors, found[key] = [*errors, *e.errors], e.found
        except SettingError as e:
            errors.append(e)
    if errors:
        raise ManyError(errors, found)
    return found


def read_table(value: Any, known: Mapping[str, Convert], where: Keys) -> dict[str, Any]:
    """Return a table of a machine file with its values converted to house units."""
    if not isinstance(value, dict):
        raise SettingError(f"{value!r}: must be a table", where)

    def read(key: str, inner: Any) -> Any:
        if key not in known:
            raise explain_unknown("key", key, known, (*where, key))
        return known[key](inner, (*where, key))

    return each(value, read)


def measure(quantity: str) -> Convert:
    """Return a function that converts a text with a number and a unit to house units."""
    what, example = _SAID[quantity]

    def convert(value: Any, where: Keys) -> float:
        try:
            number = read_with_unit(value, quantity)
        except UnitError as e:
            raise SettingError(f'"{value}": {e}', where) from e
        if number is None:
            shown = json.dumps(value) if isinstance(value, str | float | int) else repr(value)
            raise SettingError(
                f'{shown}: write a{"n" * (what[0] in "a")} {what} with its unit, such as "{example}"', where
            )
        if abs(number) > RANGE:
            raise SettingError(f'"{value}": larger than on any machine; check the unit', where)
        return number

    return convert


def _several(convert: Convert, n: int, example: str) -> Convert:
    """Return a function that converts a list of n values."""

    def converted(value: Any, where: Keys) -> tuple[Any, ...]:
        if not isinstance(value, list) or len(value) != n:
            raise SettingError(f"{value!r}: write {n} values, such as {example}", where)
        return tuple(convert(v, where) for v in value)

    return converted


def _text(value: Any, where: Keys) -> str:
    if not isinstance(value, str) or not value:
        raise SettingError(f"{value!r}: must be a text in quotes", where)
    try:
        check_name("text", value)
    except SettingError as e:
        raise SettingError(str(e), where) from e
    return value


def _structure(value: Any, where: Keys) -> Structure:
    try:
        return Structure.parse(_text(value, where))
    except SettingError as e:
        raise SettingError(str(e), where) from e


def _rows(value: Any, where: Keys) -> list[Any]:
    if not isinstance(value, list):
        raise SettingError('must be a list of points, such as [["0 mm", "0 um"], ["600 mm", "2 um"]]', where)
    return value


def _same(value: Any, where: Keys) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise SettingError(f"{value!r}: must be a table", where)
    return value


def _axes(value: Any, where: Keys) -> dict[str, Any]:
    return each(_same(value, where), lambda name, inner: read_table(inner, AXIS, (*where, name)))


TRAVEL: Keys = ("travel",)
_LENGTH = measure("position")
_VECTOR = _several(_LENGTH, 3, '["0 mm", "0 mm", "-150 mm"]')
AXIS: dict[str, Convert] = {
    "travel": _several(_LENGTH, 2, '["0 mm", "600 mm"]'),
    "reference_position": _LENGTH,
    "measured_at": _VECTOR,
    "measured_tool": _VECTOR,
    "measured_on": _text,
    "rapid": measure("feed"),
    "acceleration": measure("acceleration"),
}
#: keys that define the point from which the lever of a component in urad is measured
COUNTED_FROM = {
    "axis": ("measured_at", "measured_tool"),
    "squareness": ("reference_position",),
    "spindle": ("measured_tool",),
}
PLACES = {
    "measured_at": "the positions of X, Y and Z while it was measured",
    "measured_tool": "the vector from the gauge point to the point where the translations were measured",
    "reference_position": "the position at which it causes no displacement",
}
COMPONENT: dict[str, Convert] = {"model": _text, "target": _text, "profile": _rows}
MACHINE: dict[str, Convert] = {
    "name": _text,
    "structure": _structure,
    "reference_temperature": measure("temperature"),
    "tool": _VECTOR,
    "axes": _axes,
    "spindle": lambda value, where: read_table(value, {"measured_tool": _VECTOR}, where),
    "components": _same,
}
