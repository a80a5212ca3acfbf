"""Where in a file its headings, its units and its first row stand: loggers write more than a table."""

import re
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from thermocomp.core.headings import BRACKETS
from thermocomp.core.units import is_unit
from thermocomp.files.tables import MISSING_TEXT

#: numbers and times, in all their habits
_VALUE = re.compile(
    r"[-+]?[.,]?\d[\d.,:/\-+ eETZ]*(?: ?(?:[AaPp]\.?[Mm]\.?|UTC|GMT))?|\d{1,2}[-. ]\w{3,9}\.?[-. ]\d{2,4}[\d:., ]*"
)
#: share of the columns of numbers that have one in a row of the table
_ROW = 0.5
#: what stands for no unit in a row of units
_NO_UNIT = frozenset(("", "-", "--", "1"))


class Layout(NamedTuple):
    """Rows of a file, counted from 0 as they were given."""

    heading: int  #: of the headings
    units: int  #: of units below them; that of the headings if there are none


def find_layout(rows: Sequence[Sequence[str]]) -> Layout | None:
    """Find the headings of a table: the first row that is text, has the table's width, and numbers below it.

    Parameters
    ----------
    rows : sequence of sequence of str
        Cells of the first rows of a file.

    Returns
    -------
    Layout or None
        None if there is no such row.
    """
    if len(rows) < 2:
        return None
    width = _find_width(rows)
    columns = _find_number_columns(rows, width)
    for k, names in enumerate(rows):
        if not _is_heading(names, width) or _is_units(names):
            continue
        for below, row in enumerate(rows[k + 1 : k + 3], k + 1):
            if _is_row(row, columns) and (below == k + 1 or _is_units(rows[k + 1])):
                return Layout(k, below - 1)
    return None


def tell_layout(numbers: Sequence[int], layout: Layout, word: str) -> tuple[str, ...]:
    """Return what was passed over and taken for units, in words.

    Parameters
    ----------
    numbers : sequence of int
        Places of the rows in the file, from 1.
    layout : Layout
    word : str
        What a row is called there.

    Returns
    -------
    tuple of str
    """
    found = []
    if layout.heading:
        few = layout.heading == 1
        place = f"{word} {numbers[0]}" if few else f"{word}s {numbers[0]} to {numbers[layout.heading - 1]}"
        found.append(f"{place} above the headings {'is' if few else 'are'} passed over")
    if layout.units > layout.heading:
        found.append(f"{word} {numbers[layout.units]} holds the units")
    return tuple(found)


def join_units(headings: Sequence[str], units: Sequence[str]) -> list[str]:
    """Put the units of a row into the headings above them, where these have none."""
    found = []
    for k, heading in enumerate(headings):
        unit = units[k].strip().strip("[]()") if k < len(units) else ""
        found.append(heading if unit in _NO_UNIT or BRACKETS.fullmatch(heading) else f"{heading} [{unit}]")
    return found


def _find_width(rows: Sequence[Sequence[str]]) -> int:
    """Return the commonest number of cells in the later half of the rows, where a preamble is over."""
    counts = Counter(len(row) for row in rows[len(rows) // 2 :])
    return max(counts, key=lambda width: (counts[width], width))


def _find_number_columns(rows: Sequence[Sequence[str]], width: int) -> list[int]:
    """Return the columns that hold values in most of the later rows."""
    later = [row for row in rows[len(rows) // 2 :] if len(row) == width]
    counts = Counter(k for row in later for k, cell in enumerate(row) if _is_value(cell))
    return [k for k in range(width) if 2 * counts[k] >= len(later) and counts[k]]


def _is_heading(row: Sequence[str], width: int) -> bool:
    filled = [cell for cell in row if cell.strip()]
    # a logger may end its rows, but not its headings, with a delimiter
    return len(row) in (width, width - 1) and len(filled) >= min(2, width) and not any(map(_is_value, filled))


def _is_row(row: Sequence[str], columns: Sequence[int]) -> bool:
    values = sum(k < len(row) and (_is_value(row[k]) or row[k].strip().casefold() in MISSING_TEXT) for k in columns)
    some = any(k < len(row) and _is_value(row[k]) for k in columns)
    return some and values > _ROW * len(columns)


def _is_units(row: Sequence[str]) -> bool:
    """Return whether most of a row's filled cells are units."""
    filled = [cell.strip().strip("[]()") for cell in row if cell.strip() not in _NO_UNIT]
    return bool(filled) and 2 * sum(map(is_unit, filled)) > len(filled)


def _is_value(cell: str) -> bool:
    return _VALUE.fullmatch(cell.strip()) is not None
