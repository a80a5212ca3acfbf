"""Invalid times of a recording: decreasing times, or clock changes."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NoReturn

import numpy as np
import pandas as pd

from thermocomp.core.arrays import FloatArray, IntArray
from thermocomp.core.exceptions import RecordingError, TwoReadingsError
from thermocomp.recordings.readers.filecells import FileCells
from thermocomp.recordings.readers.tables import skip_row

_DAY = 86_400.0
_ZONE = (
    'use UTC or timestamps with an offset, or name the zone in a mapping, [time] zone = "Europe/Berlin" ("UTC" for a '
    "clock without daylight saving)"
)


def refuse_falling(wrong: IntArray, time: FloatArray, shown: "pd.Series[Any]", start: str, file: FileCells) -> NoReturn:
    """Raise the error for times that do not increase.

    Parameters
    ----------
    time : ndarray of shape (n_rows,)
        [s]
    """
    is_stamp, table = file.is_stamp, file.table
    row, local = int(wrong[0]), is_stamp and pd.Timestamp(start).tzinfo is None
    what = "occurs twice" if time[row] == time[row - 1] else f"is before {shown.iloc[row - 1]}"
    more = f" ({wrong.size} rows like this)" if wrong.size > 1 else ""
    text = f"{file.at(row)}: time {shown.iloc[row]} {what}, in {table.place(row - 1)}{more}"
    lines = [int(table.place(k).split()[-1]) for k in (0, row - 1, row, len(time) - 1)]
    if any(lines[1] < again < lines[2] for again in table.again):
        ends = [lines[0] - 1, *table.again, lines[3] + 1]
        refuse_tests(file.at(row), [[a + 1, b - 1] for a, b in pairwise(ends) if a + 1 < b])
    steps = np.diff(time)
    if len(steps) > 1 and (steps < 0).all():
        raise RecordingError(f"{text}: the newest row comes first; sort the rows by time, the oldest first")
    # setting a clock back causes a step of minus one hour plus one interval
    recorded = bool(abs(steps[row - 1] - np.median(steps) + 3600) < 300)
    if local and (recorded or _may_be_set_back(start, time, row)):
        when = "" if recorded else " while nothing was recorded"
        raise RecordingError(f"{text}, perhaps because the clock was set back (daylight saving){when}: {_ZONE}")
    never_again = steps[row - 1] < 0 and time[row:].max() < time[row - 1]
    if is_stamp and steps[row - 1] < 0 and abs(steps[row - 1] + 43_200) <= max(600, 2 * float(np.median(steps))):
        raise TwoReadingsError(
            f"{text}: perhaps a 12-hour clock whose AM and PM are missing in the file, or not recognised; append them "
            "to the times, put them in a column headed AM/PM, or use 24-hour times",
            [skip_row(table, row)],
        )
    if is_stamp and not start and never_again:
        raise TwoReadingsError(
            f"{text}, and no later row reaches it: the next day, a 12-hour clock without AM and PM, or a clock that "
            "was reset? Add dates to the times, or split the file into tests",
            [skip_row(table, row)],
        )
    raise RecordingError(
        f"{text}; time must increase: delete or correct the row, or split the file into tests", [skip_row(table, row)]
    )


def refuse_tests(where: str, spans: Sequence[Sequence[int]]) -> NoReturn:
    """Raise the error for times that start again below a repeated heading, in tests with these first and last lines."""
    raise TwoReadingsError(
        f"{where}: the time starts again below a repeated heading: the file holds {len(spans)} tests; read one of them "
        "by skipping the lines of the others in a mapping, [read] skip",
        [{"read": {"skip": [[*span] for span in spans if span is not kept]}} for kept in spans],
    )


def _may_be_set_back(start: str, time: FloatArray, row: int) -> bool:
    """Return whether a decrease between two rows falls on a Sunday in the night when clocks are set back."""
    if not start or time[row] < time[row - 1] - 3600:
        return False
    before, after = (pd.Timestamp(start) + pd.Timedelta(seconds=time[k]) for k in (row - 1, row))
    return after.weekday() == 6 and after.month in (4, 10, 11) and after.hour <= 3 and before.hour <= 3


def refuse_passed(time: FloatArray, start: str, file: FileCells) -> None:
    """Reject times that start at zero and continue across a change of date, because they are elapsed times.

    Parameters
    ----------
    time : ndarray of shape (n_rows,)
        [s]
    """
    if file.times.date is None or file.mapping.time.format or not start:
        return
    dates, begin = file.cells[file.times.date], pd.Timestamp(start)
    changes = (dates != dates.shift()).to_numpy(dtype=np.bool_)[1:]
    steps = np.diff(time)
    usual = float(np.median(steps[~changes])) if not changes.all() else 0.0
    more = steps - _DAY
    rows = np.flatnonzero(changes & (more > 0) & (more <= 2 * usual)) + 1
    if rows.size and (begin - begin.normalize()).total_seconds() <= usual:
        heading, name = file.heading, file.table.headings[file.times.date]
        raise TwoReadingsError(
            f"{file.source}: {file.table.place(int(rows[0]))}: {name!r} changes, but {heading!r}, which starts at "
            f"zero, increases by only {more[rows[0] - 1]:g} s: is it an elapsed time, or was there a pause of a whole "
            f'day? If it is an elapsed time, leave out {name!r} in a mapping: [time] column = "{heading}" and '
            f'[columns."{name}"] role = "ignore"; if not, state how both are written: [time] column, date and format',
            [{"time": {"column": heading}, "columns": {name: {"role": "ignore"}}}],
        )


def refuse_set_forward(time: FloatArray, start: str, file: FileCells) -> None:
    """Reject a gap of an hour at the time when clocks are set forward, because its real duration is unknown.

    Parameters
    ----------
    time : ndarray of shape (n_rows,)
        [s]
    """
    steps = np.diff(time)
    usual = float(np.median(steps)) if steps.size else np.inf
    if not usual <= 900:
        return
    for row in np.flatnonzero(np.abs(steps - usual - 3600) < min(usual, 60)) + 1:
        before, after = (pd.Timestamp(start) + pd.Timedelta(seconds=time[k]) for k in (row - 1, row))
        spring = after.month in (3, 4, 9, 10, 11) and after.weekday() in (4, 5, 6) and before.hour <= 3
        if spring and after.hour == before.hour + (1 if after.minute >= before.minute else 2):
            raise TwoReadingsError(
                f"{file.at(int(row))}: an hour is missing between {before} and {after}, perhaps because the clock was "
                f"set forward (daylight saving), perhaps because nothing was recorded: {_ZONE}",
                [{"time": {"zone": "UTC"}}],
            )
