"""Times of a recording: numbers with a unit, or timestamps."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from thermocomp.core.exceptions import RecordingError
from thermocomp.core.units import find_unit
from thermocomp.files.columns import ColumnPlan
from thermocomp.files.mapping import Mapping
from thermocomp.files.tables import FileTable

FloatArray = NDArray[np.float64]

_CHUNK = 100_000
# Only what cannot be read in two ways: 06/07/2021 needs a mapping. The last two tell the time of day only.
_FORMATS = (
    "ISO8601",
    "%Y/%m/%d %H:%M:%S",
    "%Y/%m/%d-%H:%M:%S",
    "%d.%m.%Y %H:%M:%S",
    "%d.%m.%Y %H:%M:%S.%f",
    "%d.%m.%Y %H:%M",
    "%H:%M:%S",
    "%H:%M:%S.%f",
)


def read_times(
    cells: pd.DataFrame,
    columns: ColumnPlan,
    mapping: Mapping,
    table: FileTable,
    source: Path,
    *,
    is_stamp: bool,
    rising: bool,
) -> tuple[FloatArray, str]:
    """Read the times of a recording's rows.

    Parameters
    ----------
    cells : DataFrame
        With the columns of time and date, named by position.
    columns : ColumnPlan
    mapping : Mapping
    table : FileTable
        That the cells come from.
    source : Path
        The file.
    is_stamp : bool
        They are timestamps, no numbers.
    rising : bool
        Each must be later than the one before; else it must not be earlier.

    Returns
    -------
    time : ndarray of shape (n_rows,)
        Seconds since the first row [s].
    start : str
        ISO timestamp of the first row; empty if it is not known.

    Raises
    ------
    RecordingError
        A time is missing, cannot be read, or does not rise.
    """
    shown = cells[columns.time]
    start = ""
    if is_stamp:
        if columns.date is not None:
            shown = cells[columns.date].astype(str).str[:10] + " " + shown.astype(str)
        stamps, start = _timestamps(shown, mapping.time.format, table, source, table.headings[columns.time])
        time = np.asarray((stamps - stamps.iloc[0]).dt.total_seconds(), dtype=np.float64)
    else:
        raw = shown.to_numpy(dtype=np.float64)
        time = (raw - raw[0]) * find_unit(columns.time_unit or "s", "time").scale
        missing = np.flatnonzero(~np.isfinite(raw))
        if missing.size:
            _refuse_missing(table, source, int(missing[0]), table.headings[columns.time])
    steps = np.diff(time)
    wrong = np.flatnonzero(~(steps > 0) if rising else steps < 0) + 1
    if wrong.size:
        row = int(wrong[0])
        what = "comes twice" if time[row] == time[row - 1] else f"is before {shown.iloc[row - 1]}"
        more = f" ({wrong.size} rows like this)" if wrong.size > 1 else ""
        # a clock that is set back falls by an hour less one interval
        falls_by_an_hour = abs(steps[row - 1] - np.median(steps) + 3600) < 300
        if is_stamp and falls_by_an_hour and pd.Timestamp(start).tzinfo is None:
            more += ", perhaps as the clock was set back (daylight saving): use UTC, or timestamps with an offset"
        raise RecordingError(
            f"{source}: {table.place(row)}, column {table.headings[columns.time]!r}: time {shown.iloc[row]} {what}, in "
            f"{table.place(row - 1)}{more}; time must rise: delete or correct the row, or split the file into tests"
        )
    return time, start


def _timestamps(
    cells: "pd.Series[Any]", wanted: str, table: FileTable, source: Path, heading: str
) -> tuple["pd.Series[pd.Timestamp]", str]:
    """Parse timestamps; mixed offsets (summer time) are brought to one clock."""
    if cells.isna().any():
        _refuse_missing(table, source, int(np.flatnonzero(cells.isna())[0]), heading)
    if pd.api.types.is_datetime64_any_dtype(cells.dtype):
        return cells, cells.iloc[0].isoformat()
    text = cells.astype(str)
    first = text.iloc[:1]
    formats = [wanted] if wanted else _FORMATS
    fitting = [f for f in formats if pd.to_datetime(first, format=f, utc=True, errors="coerce").notna().all()]
    if not fitting:
        hint = f"does not fit the format {wanted!r}" if wanted else "is not an ISO timestamp"
        raise RecordingError(
            f"{source}: {table.place(0)}, column {heading!r}: {first.iloc[0]!r} {hint}; say how it is written in a "
            f'mapping: [time] column = "{heading}" and format = "%d/%m/%Y %H:%M:%S"'
        )
    # in parts, and without a cache of the texts seen: pandas makes objects of them, far bigger than the times
    parts = [text.iloc[k : k + _CHUNK] for k in range(0, len(text), _CHUNK)]
    stamps = pd.concat(pd.to_datetime(p, format=fitting[0], utc=True, errors="coerce", cache=False) for p in parts)
    bad = np.flatnonzero(stamps.isna())
    if bad.size:
        row = int(bad[0])
        raise RecordingError(
            f"{source}: {table.place(row)}, column {heading!r}: {text.iloc[row]!r} is not a timestamp like "
            f"{first.iloc[0]!r}; correct or delete the row"
        )
    if fitting[0].startswith("%H"):
        return stamps, ""
    return stamps, pd.to_datetime(first, format=fitting[0]).iloc[0].isoformat()


def _refuse_missing(table: FileTable, source: Path, row: int, heading: str) -> None:
    raise RecordingError(
        f"{source}: {table.place(row)}, column {heading!r}: the time is missing; fill it in or delete the row"
    )
