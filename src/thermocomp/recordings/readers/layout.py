"""Position of the headings, the units, and the first and last row of the table in a file."""

import re
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from typing import NamedTuple

from thermocomp.core.exceptions import RecordingError, UnitError
from thermocomp.core.messages import Message
from thermocomp.core.units import find_unit, is_unit
from thermocomp.recordings.headings import (
    BRACKETS,
    DAY_FORMS,
    find_clock_form,
    find_date_order,
    find_date_orders,
    is_foreign_unit,
    is_time_name,
    is_understood,
    understand,
)
from thermocomp.recordings.readers.cellunits import has_unit
from thermocomp.recordings.readers.numbers import is_filler, is_number_like
from thermocomp.recordings.words import read_words

#: dates and times of day, in all usual forms
_TIME = re.compile(
    r"'?(?:\d{1,4}[-./ ] ?(?:\d{1,2}|[^\W\d_]{3,9}\.?)[-./ ] ?\d{1,4}|[^\W\d_]{3,9}\.? \d{1,2},? \d{4}"
    r"|(?:\d+ days? )?\d{1,4}:\d\d)"
    r"(?!\d)[-\dT.,:+ ]*(?:[AaPp]\.?[Mm]\.?)?(?: ?[A-Z]{1,4})?(?:[+-]\d\d:?\d\d)?|\d{8}T\d{4,6}[\dZ.,+:-]*"
)
#: a time that may be hours and minutes or minutes and seconds
_CLOCK = re.compile(r"\d+:\d\d")
#: maximum number of characters of a date with a time of day
_LONGEST = 60
#: minimum fraction of the numeric columns with a value in a row of the table
_ROW = 0.5
#: words that denote no unit in a row of units, in lower case: for numbers without unit, and in the first cell
_NO_UNIT = frozenset(("", *read_words("no_unit")))
#: maximum number of text rows between the headings and the first row of numbers
_MOST_BETWEEN = 12
#: maximum number of rows at the end of a file that are not part of the table
MOST_REMARKS = 40
#: labels of rows of statistics, in lower case
_STATISTICS = frozenset(read_words("statistics"))


class FileLayout(NamedTuple):
    """Rows of headings, units and table, as indices (0-based) into the examined rows."""

    heading: int  #: row of the headings
    units: int  #: row of the units; same as `heading` if there is none
    begin: int  #: first row of the table


def find_layout(rows: Sequence[Sequence[str]]) -> FileLayout | None:
    """Find the headings of a table, its units, and its first row.

    Above the longest block of rows of numbers there are rows of text. The headings are the first of those that name the
    largest number of numeric columns; a row of units is recognised by its units. A list of channels above the table, as
    some loggers write it, is a shorter block whose rows have words where the table has times.

    Returns
    -------
    FileLayout or None
        None if there is no row of headings.
    """
    if len(rows) < 2:
        return None
    # any preamble ends before the second half of the rows
    later = rows[len(rows) // 2 :]
    width, columns = find_columns(later)
    timed = find_timed(later)
    numbers = [k for k in columns if k not in timed]
    units_at = cache(lambda k: _is_units(rows[k], numbers))  # evaluated only as needed, because files may be wide

    def labels(k: int) -> bool:
        """Return whether a row labels channels, for example by number, because a row of units follows."""
        return k + 1 < len(rows) and units_at(k + 1)

    for begin in range(1, len(rows)):
        if not is_row(rows[begin], columns, timed) or labels(begin):
            continue
        first = begin
        while first and begin - first < _MOST_BETWEEN:
            above = rows[first - 1]
            if not any(map(str.strip, above)) and not any(map(_names_time, rows[first:begin])):
                first -= 1  # an empty row between the headings and the table
                continue
            if not _is_text(above, width):
                break
            if any(k < len(above) and _is_value(above[k]) for k in columns) and not labels(first - 1):
                break  # possibly a row of the table with words in it, which must not be skipped
            first -= 1
        block = range(first, begin)
        units = [k for k in block if units_at(k)]
        names = [k for k in block if k not in units and _is_heading(rows[k])]
        if not names and units and _names_time(rows[units[0]]):  # headings that are units: Time, rpm, um
            names = [units.pop(0)]
        if names:
            said = {k: sum(is_time_name(cell) or is_understood(cell) for cell in rows[k]) for k in names}
            known = sorted((k for k in names if said[k]), key=lambda k: -said[k])  # ties: the first
            # without known headings the first complete row; with two columns the last one, after the preamble
            order = 1 if width == 2 else -1
            heading = known[0] if known else max(names, key=lambda k: (_count_filled(rows[k], columns), order * k))
            if not _names_time(rows[heading]) and _has_longer_block(rows, begin):
                continue
            return FileLayout(heading, units[-1] if units else heading, begin)
    return None


def _has_longer_block(rows: Sequence[Sequence[str]], begin: int) -> bool:
    """Return whether headings with a time follow, with more rows below them than above them since `begin`."""
    below = range(begin + 1, (len(rows) + begin) // 2)
    return any(_names_time(rows[k]) and _is_heading(rows[k]) for k in below)


def find_end(first: Sequence[Sequence[str]], last: Sequence[Sequence[str]]) -> int:
    """Count the rows at the end of a file that are not part of its table: remarks and statistics."""
    if len(last) < 2:
        return 0
    width, columns = find_columns(first[: (len(first) + 1) // 2])
    count = 0
    for row in reversed(last[1:]):
        if not _is_remark(row, columns, width):
            break
        count += 1
    return count


def find_rest(rows: Sequence[Sequence[str]], layout: FileLayout) -> tuple[tuple[str, ...], ...]:
    """Return the rows of text around the headings: a preamble, a list of channels, a row of names."""
    return tuple(tuple(row) for k, row in enumerate(rows[: layout.begin]) if k not in (layout.heading, layout.units))


def tell_layout(numbers: Sequence[int], layout: FileLayout, word: str) -> tuple[str, ...]:
    """Return notes on the lines that were skipped and the lines that were read as units."""
    found = []
    above = [numbers[k] for k in range(layout.heading) if k != layout.units]
    between = [numbers[k] for k in range(layout.heading + 1, layout.begin) if k != layout.units]
    if above:
        skipped = "{rows} above the headings is skipped" if len(above) == 1 else "{rows} above the headings are skipped"
        found.append(Message(skipped, rows=tell_rows(above, word)))
    if between:
        found.append(
            Message(
                "between the headings and the table {rows} is skipped"
                if len(between) == 1
                else "between the headings and the table {rows} are skipped",
                rows=Message(
                    f"{word}s {{first}}" if len(between) > 1 else f"{word} {{first}}",
                    first=", ".join(map(str, between)),
                ),
            )
        )
    if layout.units != layout.heading:
        found.append(Message("{row} holds the units", row=tell_rows([numbers[layout.units]], word)))
    return tuple(found)


def tell_again(lines: Sequence[int]) -> tuple[str, ...]:
    """Return a note for the user on the lines that repeat the headings."""
    places = ", ".join(map(str, lines[:MOST_REMARKS])) + " ..." * (len(lines) > MOST_REMARKS)
    return (Message("the headings are repeated in line {places}; skipped", places=places),) if lines else ()


def tell_end(numbers: Sequence[int], word: str) -> tuple[str, ...]:
    """Return a note for the user on the rows omitted at the end of a file."""
    what = (
        "{rows} at the end is not part of the table, and left out"
        if len(numbers) == 1
        else "{rows} at the end are not part of the table, and left out"
    )
    return (Message(what, rows=tell_rows(numbers, word)),) if numbers else ()


def tell_rows(numbers: Sequence[int], word: str) -> str:
    """Return consecutive row numbers as text: ``line 3``, ``lines 3 to 7``."""
    text = f"{word} {{first}}" if len(numbers) == 1 else f"{word}s {{first}} to {{last}}"
    return Message(text, first=numbers[0], last=numbers[-1])


def join_units(
    headings: Sequence[str], units: Sequence[str], rows: Sequence[Sequence[str]], where: str, number: int
) -> list[str]:
    """Add the units of row `number` of a file to the headings above them that have none.

    The contents of a column decide: dates, times of day and words have no unit, whatever the row contains (``Unit``,
    ``hh:mm:ss``), but the order of a date (``mm/dd/yyyy``) is kept, and the form of a time that is not a time of day
    (``mm:ss``) or may be hours and minutes or minutes and seconds. The first column may contain a label of the row.
    """
    said = [_bare(unit) for unit in units]
    cells = [next((row[k] for row in rows if k < len(row) and not is_filler(row[k])), "") for k in range(len(headings))]
    dated = any(is_stamp(cell) and not _CLOCK.match(cell) for cell in cells)  # then a time of day is beside the date
    found = []
    for k, (heading, cell) in enumerate(zip(headings, cells, strict=True)):
        unit = said[k] if k < len(said) else ""
        known = is_unit(unit) or is_foreign_unit(unit)
        form = find_clock_form(unit) if is_stamp(cell) else ""
        if is_stamp(cell) and _CLOCK.fullmatch(cell.strip()) and not dated:
            fits = bool(form)
        elif is_stamp(cell):
            fits = bool(find_date_order(unit)) or form not in ("", *DAY_FORMS)
        elif k == 0 or is_time_name(heading) or (cell and not is_number_like(cell)):
            fits = known
        else:
            fits = known or not is_time_name(unit)
        fits = fits and unit.casefold().rstrip(".:") not in _NO_UNIT
        if fits and (own := _contradicted(heading, unit)):
            raise RecordingError(
                f"{where}, column {k + 1}: the heading {heading!r} specifies {own}, row {number} below it {unit!r}: "
                f"correct the wrong one; if it is row {number}, give a mapping with [read] skip = [{number}]"
            )
        other = fits and is_stamp(cell) and _states_other(heading, unit)
        added = fits and heading and (other or not BRACKETS.fullmatch(heading))
        found.append(f"{heading} [{unit}]" if added else heading)
    return found


def _states_other(heading: str, unit: str) -> bool:
    """Return whether a row of units specifies an order of day and month or a clock that the heading does not."""
    return len(find_date_orders(f"{heading} [{unit}]")) > 1 or find_clock_form(unit) not in (
        "",
        find_clock_form(heading),
    )


def _contradicted(heading: str, symbol: str) -> str:
    """Return the unit of a heading if a row of units gives another unit of the same quantity; else empty."""
    with suppress(UnitError):
        meant = understand(heading)
        if meant is not None and is_unit(symbol):
            given = find_unit(symbol)
            same = (given.scale, given.shift) == (meant.unit.scale, meant.unit.shift)
            return meant.unit.symbol if given.house == meant.unit.house and not same else ""
    return ""


def name_stamps(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> tuple[list[str], tuple[str, ...]]:
    """Name a first column without heading that contains dates, such as a data frame's index, and report this."""
    first = next((row[0].strip() for row in rows if row and row[0].strip()), "")
    if headings and not headings[0] and is_stamp(first):
        return ["timestamp", *headings[1:]], ("column 1 has no heading and holds dates: taken as the time",)
    return list(headings), ()


def is_stamp(cell: str) -> bool:
    """Return whether a cell contains a date or a time of day."""
    return len(cell) < _LONGEST and _TIME.fullmatch(cell.strip()) is not None


def find_columns(rows: Sequence[Sequence[str]]) -> tuple[int, list[int]]:
    """Return the most frequent number of cells of some rows, and the columns with values in most of them."""
    counts = Counter(len(row) for row in rows)
    width = max(counts, key=lambda width: (counts[width], width))
    even = [row for row in rows if len(row) == width]
    values = Counter(k for row in even for k, cell in enumerate(row) if _is_value(cell))
    return width, [k for k in range(width) if 2 * values[k] >= len(even) and values[k]]


def find_timed(rows: Sequence[Sequence[str]]) -> list[int]:
    """Return the columns with dates or times of day in most rows."""
    return [k for k in find_columns(rows)[1] if not _holds_numbers(rows, k)]


def _is_text(row: Sequence[str], width: int) -> bool:
    # a logger may end its rows, but not its headings, with a delimiter
    return len(row) in (width, width - 1) and any(cell.strip() for cell in row)


def _is_heading(row: Sequence[str]) -> bool:
    filled = [cell for cell in row if cell.strip()]
    return len(filled) >= min(2, len(row)) and not any(map(_is_value, filled))


def is_row(row: Sequence[str], columns: Sequence[int], timed: Sequence[int]) -> bool:
    """Return whether a row has values in most of some columns, and no words in those that hold dates and times."""
    values = {k: _is_value(row[k]) for k in columns if k < len(row)}
    full = [k for k, is_value in values.items() if is_value or is_filler(row[k])]
    worded = any(k < len(row) and not values[k] and not is_filler(row[k]) for k in timed)
    return any(values.values()) and full[0] == columns[0] and len(full) > _ROW * len(columns) and not worded


def _is_remark(row: Sequence[str], columns: Sequence[int], width: int) -> bool:
    """Return whether a row at the end is text or a statistic: no row of the table starts like this."""
    words = [k for k, cell in enumerate(row) if cell.strip() and not _is_value(cell) and not is_filler(cell)]
    if not words or not columns:
        return False
    values = any(k < len(row) and _is_value(row[k]) for k in columns)
    timed = columns[0] < len(row) and _is_value(row[columns[0]])
    counted = any(row[k].strip().strip(":.").casefold() in _STATISTICS for k in words)
    return not values or (not timed and (counted or (len(row) < width and columns[0] in words)))


def _is_units(row: Sequence[str], numbers: Sequence[int]) -> bool:
    """Return whether most cells above columns of numbers are units."""
    over = [row[k] for k in numbers if k < len(row)] if numbers else row
    filled = [unit for unit in map(_bare, over) if unit.casefold().rstrip(".:") not in _NO_UNIT]
    known = sum(map(is_unit, filled))
    return known > 0 and 2 * (known + sum(is_foreign_unit(u) and not is_unit(u) for u in filled)) > len(filled)


def _bare(unit: str) -> str:
    return unit.strip().strip("[]()").strip().replace("]:", ":")  # [mm]:ss, as a spreadsheet writes it


def _holds_numbers(rows: Sequence[Sequence[str]], column: int) -> bool:
    """Return whether most values of a column are numbers, not dates or times of day."""
    values = [row[column] for row in rows if column < len(row) and _is_value(row[column])]
    return 2 * sum(map(is_number_like, values)) > len(values)


def _names_time(row: Sequence[str]) -> bool:
    return any(map(is_time_name, row))


def _count_filled(row: Sequence[str], columns: Sequence[int]) -> int:
    return sum(k < len(row) and bool(row[k].strip()) for k in columns)


def _is_value(cell: str) -> bool:
    return is_number_like(cell) or is_stamp(cell) or has_unit(cell)
