"""Check of the times of the rows against dates in the file that were not used."""

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from thermocomp.core.arrays import FloatArray
from thermocomp.core.exceptions import Remedy, TwoReadingsError
from thermocomp.core.messages import Message
from thermocomp.recordings.readers.cellkinds import CLOCK, find_kind, is_compact_date, plain_clocks, plain_dates
from thermocomp.recordings.readers.dateorder import IntArray
from thermocomp.recordings.readers.dayforms import read_other_days
from thermocomp.recordings.readers.filecells import FileCells
from thermocomp.recordings.readers.numbers import is_filler
from thermocomp.recordings.readers.stamps import has_day, read_days
from thermocomp.recordings.readers.tables import FileTable
from thermocomp.recordings.readers.timecolumns import has_passed, is_ignored

_DAY = 86_400.0
#: tolerance for clock adjustments, including daylight saving [s]
_SET = 5400.0

#: a date anywhere in a line, with any text around it
_SOME_DATE = re.compile(
    r"(?<!\d)(?:\d{1,2}|\d{4}) ?([./-]) ?\d{1,2} ?\1 ?(?:\d{4}|\d{1,2})(?!\d)"
    r"|(?<!\d)(?:19|20)\d\d(?:0[1-9]|1[0-2])(?:0[1-9]|[12]\d|3[01])(?!\d)"
    r"|(?<!\d)\d{1,2}[.-]? ?[^\s\d.,;:]{3,10}[.,-]? ?'?(?:\d{4}|\d\d)(?!\d)"
    r"|[^\W\d_]{3,9}\.? \d{1,2},? \d{4}(?!\d)"
    r"|\b(?:day|tag|jour|giorno) *\d"
    r"|\b(?:mon|tues|wednes|thurs|fri|satur|sun)day\b|\b(?:mon|diens|donners|frei|sams|sonn)tag\b|\bmittwoch\b",
    re.IGNORECASE,
)


def holds_date(text: str) -> bool:
    """Return whether a text contains a date or a day among other words."""
    return _SOME_DATE.search(text) is not None


def holds_own_date(table: FileTable, number: int) -> bool:
    """Return whether a row contains a date where other rows have none, such as a separator between daily tests."""
    columns = [k for k in range(len(table.headings)) if find_kind(table.head(k)) not in ("date", "stamp")]
    cells = table.load([], columns)[0]
    row = next((k for k in range(len(cells)) if int(table.place(k).split()[-1]) == number), None)
    return row is not None and any(map(holds_date, map(str, cells.iloc[row].dropna())))


def check_dates(time: FloatArray, file: FileCells, others: Sequence[int] = ()) -> tuple[str, ...]:
    """Reject times without a date that are inconsistent with the dates of another column.

    Parameters
    ----------
    time : ndarray of shape (n_rows,)
        Time since the first row [s].
    """
    notes = []
    heading, table, is_stamp, form = file.heading, file.table, file.is_stamp, file.mapping.time.format
    date = file.times.date
    # a number has no date even if the mapping names a date column
    ignores = not is_stamp or (form and not has_day(form))
    more = (date,) if date is not None and ignores else ()
    clock = _find_clock(file) if is_stamp else None
    others = (*others, *more) if clock is not None else others
    for k in dict.fromkeys((*file.times.unused, *more, *others)):
        cells, name = file.cells[k], table.headings[k] or k + 1
        ignored = is_ignored(table.headings[k], k, file.mapping)
        mend = Message(
            "name it in a mapping, [time] column = {time} and date = {date}", time=_quoted(heading), date=_quoted(name)
        )
        if k in others:
            row = _find_other(time, cells, table.headings[k], clock, is_stamp=is_stamp)
        else:
            row = _find_contradiction(time, cells, clock)
        if row is None:
            if is_stamp and k not in others and date is None and not has_passed(heading) and not ignored:
                notes.append(
                    Message(
                        "left out: {name!r} holds dates, and {heading!r} only a time of day: {mend}",
                        name=name,
                        heading=heading,
                        mend=mend,
                    )
                )
            continue
        first = cells.dropna().iloc[0]
        said = Message(
            "{name!r} contains {cell} in {place}, which is not the day {hours:.2f} h after {first}, as the time in "
            "{heading!r} requires",
            name=name,
            cell=_shown(cells.iloc[row]),
            place=table.place(row),
            hours=float(time[row]) / 3600,
            first=_shown(first),
            heading=heading,
        )
        if ignored:
            notes.append(
                Message(
                    "left out, as the mapping specifies: {what}; the times between the rows may be wrong by days",
                    what=said,
                )
            )
            continue
        use: Remedy = {"time": {"column": heading, "date": name, **({"format": ""} if form else {})}}
        usable = is_stamp and k != date and (k not in others or is_compact_date([str(first)]))
        raise TwoReadingsError(
            f"{file.source}: column {said}; if it holds the dates of the rows, "
            f'{mend if usable else "split the file into tests"}; if not, leave it out, role = "ignore"',
            [*([use] if usable else []), {"columns": {str(name): {"column": name, "role": "ignore"}}}],
        )
    return tuple(notes)


def _shown(cell: object) -> str:
    return str(cell).removesuffix(".0")  # added by a spreadsheet


def _quoted(place: str | int) -> str:
    return f'"{place}"' if isinstance(place, str) else str(place)


def _find_contradiction(time: FloatArray, cells: "pd.Series[Any]", clock: float | None) -> int | None:
    """Return the first row whose date contradicts every possible time of day of the first row; None if none does."""
    there = np.flatnonzero(cells.notna())
    texts = plain_dates(cells.iloc[there])
    if texts.nunique() < 2:
        return None  # date of the whole test, or of the sensor
    wrong = [_find_wrong(days, time[there], clock) for days in read_days(texts)]
    if not wrong:
        return int(there[np.flatnonzero(texts != texts.iloc[0])[0]])
    return None if None in wrong else int(there[max(k for k in wrong if k is not None)])


def _find_other(
    time: FloatArray, cells: "pd.Series[Any]", heading: str, clock: float | None, *, is_stamp: bool
) -> int | None:
    """Return the first row whose date, in a form other than a timestamp, contradicts the time."""
    filled = cells.notna() & ~cells.astype(str).map(is_filler)
    there = np.flatnonzero(filled)
    texts = cells.iloc[there].astype(str)
    if texts.nunique() < 2:
        return None
    read = read_other_days(texts, heading, beside_clock=is_stamp)
    wrong = [_find_wrong(days, time[there], clock) for days in read]
    return None if not wrong or None in wrong else int(there[max(k for k in wrong if k is not None)])


def _find_wrong(days: IntArray, t: FloatArray, clock: float | None) -> int | None:
    since = (days - days[0]) * _DAY - (t - t[0])
    # bounds of the time of the first row after midnight
    wrong = np.maximum.accumulate(since) >= np.minimum.accumulate(since) + _DAY + _SET
    if clock is not None and not wrong.any() and not (clock <= _usual(t) and _runs_on(days, t)):
        wrong = days - days[0] != (clock + t) // _DAY - (clock + t[0]) // _DAY
    rows = np.flatnonzero(wrong)
    return int(rows[0]) if rows.size else None


def _usual(t: FloatArray) -> float:
    return float(np.median(np.diff(t))) if len(t) > 1 else 0.0


def _runs_on(days: IntArray, t: FloatArray) -> bool:
    """Return whether no pause spans a change of date: times that start at zero may then be elapsed times."""
    return bool((np.diff(t)[np.diff(days) != 0] <= 2 * _usual(t)).all())


def _find_clock(file: FileCells) -> float | None:
    """Return the time of day of the first row [s]; None where the times are not known to be times of day."""
    form, texts, date = file.mapping.time.format, file.cells[file.times.time].astype(str).str.strip(), file.times.date
    if has_passed(file.heading):
        return None
    if form:
        if not re.search(r"%[HIXTRc]", form):
            return None
        shown = texts.iloc[0] if date is None else f"{file.cells[date].iloc[0]} {texts.iloc[0]}"
        first = pd.to_datetime(shown, format=form, errors="coerce")
    elif date is not None:
        return None
    else:
        clocks = plain_clocks(texts)
        parts = clocks.str.extract(CLOCK)
        if parts["days"].notna().any() or (pd.to_numeric(parts["hours"]) > 23).any():
            return None
        first = pd.to_datetime(clocks.iloc[0].replace(".", ""), errors="coerce")
    if pd.isna(first):
        return None
    plain = first.tz_localize(None)
    return float((plain - plain.normalize()).total_seconds())
