"""Times of a recording: numbers with a unit, timestamps, or times of day."""

import re
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from thermocomp.core.exceptions import RecordingError, TwoReadingsError
from thermocomp.core.units import find_unit
from thermocomp.recordings.readers.cellkinds import CLOCK, HALF, plain_clocks, plain_dates
from thermocomp.recordings.readers.columns import ColumnPlan
from thermocomp.recordings.readers.mapping import Mapping
from thermocomp.recordings.readers.stamps import AmbiguousDatesError, Parsed, has_day, parse, parse_stamps
from thermocomp.recordings.readers.tables import FileTable, skip_row, tell_places
from thermocomp.recordings.readers.timefaults import refuse_falling, refuse_passed, refuse_set_forward
from thermocomp.recordings.readers.timehints import find_formats

FloatArray = NDArray[np.float64]

#: seconds since 1970 between the years 2000 and 2100, whole or in parts of a second
_EPOCH = 946684800.0, 2240611200.0
_PARTS = {1: "seconds", 1000: "milliseconds", 1000000: "microseconds", 1000000000: "nanoseconds"}
#: days since 1899-12-30, as spreadsheets count, between the same years
_SERIAL = 36526.0, 73050.0
_SERIAL_BEGIN = -25569 * 86400
_DATE_WORDS = ("date", "datum", "dat", "stamp", "stempel", "fecha")
_DAY = 86_400_000_000_000  # [ns]


def read_times(
    cells: pd.DataFrame,
    columns: ColumnPlan,
    mapping: Mapping,
    table: FileTable,
    source: Path,
    *,
    is_stamp: bool,
    rising: bool,
) -> tuple[FloatArray, str, tuple[str, ...]]:
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
    notes : tuple of str
        How it was read, where that is not plain.

    Raises
    ------
    RecordingError
        A time is missing, cannot be read, can be read in two ways, or does not rise.
    """
    heading = table.headings[columns.time]
    shown = cells[columns.time]
    for k in columns.beside:
        other = np.flatnonzero(((cells[k] != shown) & ~(cells[k].isna() & shown.isna())).to_numpy())
        if other.size:
            raise RecordingError(
                f"{source}: columns {columns.time + 1} and {k + 1} are both named {heading!r} and hold different "
                f"times, such as {shown.iloc[other[0]]} and {cells[k].iloc[other[0]]} in "
                f"{table.place(int(other[0]))}; channels that were sampled at different times are no recording: "
                "resample them to one time"
            )
    notes: tuple[str, ...] = ()
    if columns.beside:
        notes = (
            f"columns {', '.join(str(k + 1) for k in columns.beside)} hold the same times as column {columns.time + 1}",
        )
    if is_stamp:
        if columns.date is not None:
            shown = _join_dates(cells, columns, mapping, table, source)
        time, start, found = _read_stamps(shown, columns, mapping, table, source)
        refuse_passed(time, start, cells, columns, mapping, table, source)
    else:
        raw = shown.to_numpy(dtype=np.float64)
        missing = np.flatnonzero(~np.isfinite(raw))
        if missing.size:
            _refuse_missing(table, source, int(missing[0]), heading)
        time, start, found = _read_numbers(raw, heading, columns, mapping, source)
    notes += found
    if columns.fraction is not None and is_stamp:
        part = cells[columns.fraction].to_numpy(dtype=np.float64)
        if part.any() and (time % 1 == 0).all():
            time = ((time * 1000 + part) - part[0]) / 1000
            notes += (f"{table.headings[columns.fraction]!r} is added to the time",)
    if mapping.time.zone and start and pd.Timestamp(start).tzinfo is None:
        time, start = _in_zone(time, start, mapping.time.zone, f"{source}: column {heading!r}")
        notes += (f"{heading!r} is taken as the time in {mapping.time.zone}",)
    steps = np.diff(time)
    wrong = np.flatnonzero(~(steps > 0) if rising else steps < 0) + 1
    if wrong.size:
        where = f"{source}: {{}}, column {heading!r}"
        refuse_falling(wrong, time, shown, table, where, start, is_stamp=is_stamp)
    if is_stamp and start and pd.Timestamp(start).tzinfo is None:
        refuse_set_forward(time, steps, start, table, source, heading)
    return time, start, notes


def _read_stamps(
    cells: "pd.Series[Any]", columns: ColumnPlan, mapping: Mapping, table: FileTable, source: Path
) -> tuple[FloatArray, str, tuple[str, ...]]:
    """Read timestamps, times of day, or durations; mixed offsets (summer time) are brought to one clock."""
    heading, wanted = table.headings[columns.time], mapping.time.format
    if cells.isna().any():
        _refuse_missing(table, source, int(np.flatnonzero(cells.isna())[0]), heading)
    if pd.api.types.is_timedelta64_dtype(cells.dtype):
        return _seconds(cells - cells.iloc[0]), "", ()
    if pd.api.types.is_datetime64_any_dtype(cells.dtype):
        return _seconds(cells - cells.iloc[0]), cells.iloc[0].isoformat(), ()
    text = cells.astype(str)
    first = text.iloc[0].strip()
    if not wanted and columns.date is None and (CLOCK.fullmatch(first) or HALF.fullmatch(first)):
        return _read_clock(text, table, source, heading)
    if wanted:
        begin = pd.to_datetime(text.iloc[:1], format=wanted, errors="coerce").iloc[0]
        dated = has_day(wanted) and re.search("%[YycxDFG]", wanted) is not None and not pd.isna(begin)
        found: Parsed | None = Parsed(parse(text, wanted), begin.isoformat() if dated else "", ())
    else:
        titles = [table.headings[k] for k in (columns.date, columns.time) if k is not None]
        try:
            found = parse_stamps(text, titles[0])
        except AmbiguousDatesError as e:
            ways = " or ".join(f'format = "{form}"' for form in e.readings)
            place = {"column": heading, **({"date": titles[0]} if columns.date is not None else {})}
            where = ", ".join(f'{key} = "{title}"' for key, title in place.items())
            differ = e.differ()
            raise (TwoReadingsError if differ else RecordingError)(
                f"{source}: {table.place(0)}, column {titles[0]!r}: {first!r} can be read as {e}, and no row "
                f"tells which{f' ({e.tell()})' if differ else ''}; say how it is written in a mapping: [time] {where} "
                f"and {ways}",
                [{"time": {**place, "format": form}} for form in e.readings],
            ) from e
    if found is None or pd.isna(found.stamps.iloc[0]):
        _refuse_form(text, columns, wanted, table, source)
    stamps, start, notes = found
    bad = np.flatnonzero(stamps.isna())
    if bad.size:
        row = int(bad[0])
        raise RecordingError(
            f"{source}: {table.place(row)}, column {heading!r}: {text.iloc[row]!r} is not a timestamp like "
            f"{first!r}; correct or delete the row",
            [skip_row(table, row)],
        )
    return _seconds(stamps - stamps.iloc[0]), start, notes


def _join_dates(
    cells: pd.DataFrame, columns: ColumnPlan, mapping: Mapping, table: FileTable, source: Path
) -> "pd.Series[str]":
    """Return dates with their times of day behind them; where a format is given, as they stand in the file."""
    dates, clocks = cells[columns.date], cells[columns.time]
    lost = np.flatnonzero(dates.isna() & clocks.notna())
    if lost.size:
        row, name = int(lost[0]), table.headings[columns.date or 0]
        more = f" (in {lost.size} rows, of {len(dates)})" if lost.size > 1 else ""
        raise RecordingError(
            f"{source}: {table.place(row)}, column {name!r}: the date is missing{more}; the time of day "
            f"{clocks.iloc[row]} is there: write its date into every row",
            [skip_row(table, row)] if 4 * lost.size <= len(dates) else [],
        )
    there = dates.notna() & clocks.notna()
    form, plain = mapping.time.format, plain_dates(dates) + " " + plain_clocks(clocks)
    if form and pd.isna(pd.to_datetime(plain.iloc[0], format=form, utc=True, errors="coerce")):
        written = dates.astype(str).str.strip().str.removesuffix(".0") + " " + clocks.astype(str).str.strip()
        return written.where(there)
    return plain.where(there)


def _refuse_form(text: "pd.Series[str]", columns: ColumnPlan, wanted: str, table: FileTable, source: Path) -> NoReturn:
    """Refuse times in a form that is not known, with formats that fit."""
    heading, first = table.headings[columns.time], text.iloc[0].strip()
    place = {"column": heading}
    if columns.date is not None:
        place["date"] = table.headings[columns.date]
    forms = find_formats(text)
    where = ", ".join(f'{key} = "{title}"' for key, title in place.items())
    ways = " or ".join(f'format = "{form}"' for form in forms) or "format, in the letters of strptime"
    hint = f"does not fit the format {wanted!r}" if wanted else "is not an ISO timestamp"
    if columns.date is not None and not forms:
        ways += f'; if {place["date"]!r} holds no dates, leave it out: role = "ignore"'
    # minutes and seconds alone: the hours may be lost
    doubtful = len(forms) > 1 or not any(map(has_day, forms))
    raise (TwoReadingsError if doubtful and forms else RecordingError)(
        f"{source}: {table.place(0)}, column {heading!r}: {first!r} {hint}; say how it is written in a mapping: [time] "
        f"{where} and {ways}",
        [{"time": {**place, "format": form}} for form in forms],
    )


def _read_clock(
    text: "pd.Series[Any]", table: FileTable, source: Path, heading: str
) -> tuple[FloatArray, str, tuple[str, ...]]:
    """Read times of day, or times that have passed: neither says the day."""
    first = text.iloc[0].strip()
    halves = HALF.fullmatch(first) is not None
    parts = text.str.strip().str.extract(CLOCK)
    if not halves and pd.isna(parts["seconds"].iloc[0]):
        raise TwoReadingsError(
            f"{source}: {table.place(0)}, column {heading!r}: {first!r} can be read as hours and minutes or as "
            f'minutes and seconds; say how it is written in a mapping: [time] column = "{heading}" and format = '
            '"%H:%M" or format = "%M:%S"',
            [{"time": {"column": heading, "format": form}} for form in ("%H:%M", "%M:%S")],
        )
    if halves:
        upper = text.str.strip().str.upper().str.replace(r" ?([AP])\.?M\.?$", r" \1M", regex=True)
        form = "%I:%M:%S %p" if first.count(":") == 2 else "%I:%M %p"
        stamps = parse(upper, form.replace("%S", "%S.%f") if "." in first.upper().rstrip("M.PA ") else form)
        seconds = ((stamps - stamps.dt.normalize()).dt.total_seconds()).to_numpy(dtype=np.float64)
    else:
        texts = parts["seconds"].str.replace(r"[,:]", ".", regex=True)
        days, hours, minutes, rest = (
            pd.to_numeric(c, errors="coerce").to_numpy(dtype=np.float64)
            for c in (parts["days"].fillna("0"), parts["hours"], parts["minutes"], texts)
        )
        seconds = ((days * 24 + hours) * 60 + minutes) * 60 + rest
    bad = np.flatnonzero(~np.isfinite(seconds))
    if bad.size:
        row = int(bad[0])
        raise RecordingError(
            f"{source}: {table.place(row)}, column {heading!r}: {text.iloc[row]!r} is not a time like {first!r}; "
            "correct or delete the row",
            [skip_row(table, row)],
        )
    # exact where the file has no more than nanoseconds
    whole = np.rint(seconds * 1e9).astype(np.int64)
    steps = np.diff(whole)
    usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    midnights = (steps < 0) & (steps + _DAY > 0) & (steps + _DAY <= 2 * usual)
    if not midnights.any() or whole.max() >= _DAY:
        return (whole - whole[0]) / 1e9, "", ()
    places = tell_places((np.flatnonzero(midnights) + 1).tolist(), table.place)
    days_on = np.concatenate([[0], np.cumsum(midnights)])
    return (whole - whole[0] + days_on * _DAY) / 1e9, "", (f"the time of day goes over midnight in {places}",)


def _read_numbers(
    raw: FloatArray, heading: str, columns: ColumnPlan, mapping: Mapping, source: Path
) -> tuple[FloatArray, str, tuple[str, ...]]:
    """Read times that are numbers: seconds that passed, or counted from 1970 or as spreadsheets count days."""
    if columns.time_unit:
        unit = find_unit(columns.time_unit, "time")
        time = (raw - raw[0]) * unit.scale if unit.scale >= 1 else (raw - raw[0]) / round(1 / unit.scale)
        known = unit.scale in (1, 1e-3)
        counted = known and _EPOCH[0] <= raw[0] * unit.scale < _EPOCH[1] and not mapping.time.start
        if not counted:
            return time, "", ()
        note = f"{heading!r} counts from 1970-01-01 UTC"
        return time, pd.Timestamp(raw[0] * unit.scale, unit="s", tz="UTC").isoformat(), (note,)
    for parts, word in _PARTS.items():
        if _EPOCH[0] * parts <= raw.min() and raw.max() < _EPOCH[1] * parts:
            # whole microseconds are exact
            time = raw - raw[0] if parts == 1 else (raw - raw[0]) / parts
            start = pd.Timestamp(raw[0] / parts, unit="s", tz="UTC").isoformat()
            return time, start, (f"{heading!r} is taken as {word} since 1970-01-01 UTC",)
    if _SERIAL[0] <= raw.min() and raw.max() < _SERIAL[1] and any(w in heading.casefold() for w in _DATE_WORDS):
        milliseconds = np.rint(raw * 86400e3)
        start = pd.Timestamp(milliseconds[0] / 1e3 + _SERIAL_BEGIN, unit="s").isoformat()
        return (
            (milliseconds - milliseconds[0]) / 1e3,
            start,
            (f"{heading!r} is taken as days since 1899-12-30, as Excel counts",),
        )
    ways: list[dict[str, str]] = [{"unit": unit} for unit in find_likely_units(raw)]
    if compact := raw.min() > 19e12 and raw.max() < 21e12:  # written without signs: 20240305080010
        ways = [{"format": "%Y%m%d%H%M%S"}]
    raise (RecordingError if compact else TwoReadingsError)(
        f"{source}: column {heading!r} holds numbers from {raw[0]:.14g} to {raw[-1]:.14g} and says no unit: seconds, "
        f'minutes, hours or milliseconds? Put it behind the name, such as "{heading} [s]", or write a mapping: [time] '
        f'column = "{heading}" and unit = "s"',
        [{"time": {"column": heading, **way}} for way in ways],
    )


def find_likely_units(raw: FloatArray) -> tuple[str, ...]:
    """Return the units that numbers may be times in: rows 50 ms to an hour apart, over a minute at least.

    Parameters
    ----------
    raw : ndarray of shape (n_rows,)

    Returns
    -------
    tuple of str
        The likeliest first; none where they are no times of a test.
    """
    if len(raw) < 2 or not (np.diff(raw) > 0).all():
        return ()
    step, span = float(np.median(np.diff(raw))), float(raw[-1] - raw[0])
    scales = {unit: find_unit(unit, "time").scale for unit in ("s", "min", "h", "d", "ms")}
    return tuple(u for u, s in scales.items() if 0.05 <= step * s <= 3600 and (span * s >= 60 or len(raw) < 10))


def _in_zone(time: FloatArray, start: str, zone: str, where: str) -> tuple[FloatArray, str]:
    """Return times and the first timestamp of a clock that follows daylight saving."""
    local = pd.DatetimeIndex(pd.Timestamp(start) + pd.to_timedelta(time, unit="s"))
    try:
        zoned = local.tz_localize(zone, ambiguous="infer")
    except ValueError as e:  # an hour that the zone does not have, or has twice without a way to tell
        raise RecordingError(f"{where}: these are no times in {zone}: {e}; correct [time] zone in the mapping") from e
    return _seconds(pd.Series(zoned - zoned[0])), zoned[0].isoformat()


def _seconds(passed: "pd.Series[pd.Timedelta]") -> FloatArray:
    return np.asarray(passed.dt.total_seconds(), dtype=np.float64)


def _refuse_missing(table: FileTable, source: Path, row: int, heading: str) -> None:
    raise RecordingError(
        f"{source}: {table.place(row)}, column {heading!r}: the time is missing; fill it in or delete the row",
        [skip_row(table, row)],
    )
