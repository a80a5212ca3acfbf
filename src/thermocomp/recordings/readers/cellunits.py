"""Units within cells: ``21.3 °C``, ``0,4 µm``."""

import re
from collections.abc import Callable, Sequence
from typing import Any

import pandas as pd

from thermocomp.core.exceptions import UnitError
from thermocomp.core.units import find_unit, is_unit
from thermocomp.recordings.headings import is_foreign_unit, understand
from thermocomp.recordings.readers.numbers import is_number_like

_CELL = re.compile(
    r"\s*(?P<number>[-+]?\d[\d.,]*(?:[eE][-+]?\d+)?)\s*(?P<unit>[^\d\s.,:;+/-][^\d\s.,:;]{0,7}(?:/\w+)?)\s*"
)


def has_unit(cell: str) -> bool:
    """Return whether a cell is a number with a unit behind it."""
    return _split(cell) is not None


def find_units(headings: Sequence[str], head: Callable[[int], Sequence[str]]) -> tuple[list[str], dict[int, str]]:
    """Return the headings with the units that stand in the cells of their columns, and these units by column."""
    headings, units = list(headings), dict[int, str]()
    for k, heading in enumerate(headings):
        cells = head(k)
        found = [parts for cell in cells if (parts := _split(cell)) is not None]
        if not found or 2 * len(found) <= len(cells):
            continue
        units[k] = found[0][1]
        try:
            meaning = understand(heading)
        except UnitError:
            continue
        if meaning is None:
            headings[k] = f"{heading} [{units[k]}]"
        else:
            units[k] = meaning.unit.symbol
    return headings, units


def strip_units(cells: "pd.Series[Any]", unit: str) -> "pd.Series[Any]":
    """Return cells without their unit, in the unit of the column; others, such as words, unchanged."""
    return cells.map(lambda cell: _in_unit(cell, unit) if isinstance(cell, str) else cell)


def _split(cell: str) -> tuple[str, str] | None:
    if not cell[:2].strip("+- \t")[:1].isdigit() or is_number_like(cell):
        return None
    found = _CELL.fullmatch(cell)
    if found is None or not is_number_like(found["number"]):
        return None
    return (found["number"], found["unit"]) if is_unit(found["unit"]) or is_foreign_unit(found["unit"]) else None


def _in_unit(cell: str, unit: str) -> str:
    parts = _split(cell)
    number, own = parts or (cell, unit)
    if own == unit:
        return number
    try:
        said, meant = find_unit(own), find_unit(unit)
    except UnitError:
        return cell
    if said.house != meant.house or ("," in number and "." in number):
        return cell
    if (said.scale, said.shift) == (meant.scale, meant.shift):
        return number
    value = (float(number.replace(",", ".")) * said.scale + said.shift - meant.shift) / meant.scale
    return repr(round(value, 12)).replace(".", "," if "," in number else ".")
