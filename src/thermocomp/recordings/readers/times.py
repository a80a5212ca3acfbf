"""Times of a recording: numbers with a unit, timestamps, or times of day."""

import re
from typing import Any, NoReturn

import numpy as np
import pandas as pd

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.exceptions import RecordingError, TwoReadingsError
from thermocomp.core.messages import Message
from thermocomp.core.units import find_unit
from thermocomp.recordings.headings import DAY_FORMS, find_clock_form
from thermocomp.recordings.readers.cellkinds import CLOCK, HALF, plain_clocks, plain_dates
from thermocomp.recordings.readers.dayforms import EPOCH, PARTS, SERIAL
from thermocomp.recordings.readers.filecells import FileCells
from thermocomp.recordings.readers.stamps import AmbiguousDatesError, Parsed, has_day, parse, parse_stamps
from thermocomp.recordings.readers.tables import FrameTable, tell_places
from thermocomp.recordings.readers.timefaults import refuse_falling, refuse_passed, refuse_set_forward
from thermocomp.recordings.readers.timehints import find_formats

#: first day of a spreadsheet, from 1970 [s]
_SERIAL_BEGIN = -25569 * 86400
_DATE_WORDS = ("date", "datum", "dat", "stamp", "stempel", "fecha")
_DAY = 86_400_000_000_000  # [ns]
#: elapsed times by the format that the heading states; after a colon, a fraction with other than three digits may count
#: frames
_PASSED = {
    "ms": r"(?P<minutes>\d+):(?P<seconds>[0-5]\d(?:[.,]\d+)?)",
    "msf": r"(?P<minutes>\d+):(?P<seconds>[0-5]\d(?:[.,]\d+|:\d{3})?)",
    "dhm": r"(?P<days>\d+)[:. ](?P<hours>[01]?\d|2[0-3]):(?P<minutes>[0-5]\d)",
    "dhms": r"(?P<days>\d+)(?:[:. ]| days?,? )(?P<hours>[01]?\d|2[0-3]):(?P<minutes>[0-5]\d):"
    r"(?P<seconds>[0-5]\d(?:[.,]\d+)?)",
}
#: these formats as messages name them
_WRITTEN = {"ms": "%M:%S", "msf": "%M:%S.%f", "dhm": "d:hh:mm", "dhms": "d:hh:mm:ss"}
#: minimum fraction of equal steps of times that are equally spaced
_EVEN = 0.9
#: four parts that may be days to seconds, or a fraction or frames after the seconds
_FOUR_PARTS = r"(?:.* )?(\d+):(\d\d):(\d\d):([0-5]?\d)"


def read_times(file: FileCells, *, rising: bool) -> tuple[FloatArray, str, tuple[str, ...]]:
    """Read the times of the rows of a recording.

    Returns
    -------
    time : ndarray of shape (n_rows,)
        Seconds since the first row [s].
    """
    times, beside, table, source = file.times, file.columns.beside, file.table, file.source
    shown, zone = file.cells[times.time], file.mapping.time.zone
    for k in beside:
        other = file.cells[k]
        row = next(iter(np.flatnonzero(((other != shown) & ~(other.isna() & shown.isna())).to_numpy())), None)
        if row is not None:
            raise RecordingError(
                f"{source}: columns {times.time + 1} and {k + 1} are both named {file.heading!r} and hold different "
                f"times, such as {shown.iloc[row]} and {other.iloc[row]} in {table.place(int(row))}; channels that "
                "were sampled at different times cannot form one recording: resample them to common times"
            )
    notes: tuple[str, ...] = ()
    if beside:
        numbers = ", ".join(str(k + 1) for k in beside)
        notes = (Message("columns {numbers} hold the same times as column {n}", numbers=numbers, n=times.time + 1),)
    if file.is_stamp:
        if times.date is not None:
            shown = _join_dates(file, times.date)
        time, start, found = _read_stamps(shown, file)
        refuse_passed(time, start, file)
    else:
        raw = shown.to_numpy(dtype=np.float64)
        _refuse_missing(~np.isfinite(raw), file)
        time, start, found = _read_numbers(raw, file)
    notes += found
    if times.fraction is not None and file.is_stamp:
        part = file.cells[times.fraction].to_numpy(dtype=np.float64)
        if part.any() and (time % 1 == 0).all():
            time = ((time * 1000 + part) - part[0]) / 1000
            notes += (Message("{name!r} is added to the time", name=table.headings[times.fraction]),)
    if zone and start and pd.Timestamp(start).tzinfo is None:
        time, start = _in_zone(time, start, zone, f"{source}: column {file.heading!r}")
        notes += (Message("{name!r} is taken as the time in {zone}", name=file.heading, zone=zone),)
    steps = np.diff(time)
    wrong = np.flatnonzero(~(steps > 0) if rising else steps < 0) + 1
    if wrong.size:
        refuse_falling(wrong, time, shown, start, file)
    if file.is_stamp and start and pd.Timestamp(start).tzinfo is None:
        refuse_set_forward(time, start, file)
    return time, start, notes


def _read_stamps(cells: "pd.Series[Any]", file: FileCells) -> tuple[FloatArray, str, tuple[str, ...]]:
    """Read timestamps, times of day, or durations; mixed UTC offsets (daylight saving) are converted to one clock."""
    wanted = file.mapping.time.format
    _refuse_missing(cells.isna().to_numpy(), file)
    if pd.api.types.is_timedelta64_dtype(cells.dtype):
        return _seconds(cells - cells.iloc[0]), "", ()
    if pd.api.types.is_datetime64_any_dtype(cells.dtype):
        return _seconds(cells - cells.iloc[0]), cells.iloc[0].isoformat(), ()
    text = cells.astype(str)
    first = text.iloc[0].strip()
    if not wanted and (stated := find_clock_form(file.heading)) not in ("", *DAY_FORMS):
        spreadsheet = isinstance(file.table, FrameTable) and first.count(":") == 2  # its times have all their parts
        if not (spreadsheet and stated == "ms"):
            return _read_stated(text, "?" if spreadsheet else stated, file)
    elif not wanted and re.fullmatch(_FOUR_PARTS, first) and (stated == "hmsf" or re.match(r"\d+:", first)):
        _refuse_four_parts(text, stated, file)
    if not wanted and file.times.date is None and (CLOCK.fullmatch(first) or HALF.fullmatch(first)):
        return _read_clock(text, file)
    if wanted:
        begin = pd.to_datetime(text.iloc[:1], format=wanted, errors="coerce").iloc[0]
        dated = has_day(wanted) and re.search("%[YycxDFG]", wanted) is not None and not pd.isna(begin)
        found: Parsed | None = Parsed(parse(text, wanted), begin.isoformat() if dated else "", ())
    else:
        keys = file.time_keys
        titled = keys.get("date", file.heading)
        try:
            found = parse_stamps(text, titled)
        except AmbiguousDatesError as e:
            ways = " or ".join(f'format = "{form}"' for form in e.readings)
            # also where the duration is the same: the order is wrong for other tests of this logger
            raise TwoReadingsError(
                f"{file.source}: {file.table.place(0)}, column {titled!r}: {first!r} can be read as {e} ({e.tell()}); "
                f"state how it is written in a mapping: [time] {_told(keys)} and {ways}",
                [{"time": {**keys, "format": form}} for form in e.readings],
            ) from e
    if found is None or pd.isna(found.stamps.iloc[0]):
        _refuse_form(text, file)
    stamps, start, notes = found
    _refuse_unlike(stamps.isna().to_numpy(), text, f"a timestamp like {first!r}", file)
    return _seconds(stamps - stamps.iloc[0]), start, notes


def _join_dates(file: FileCells, date: int) -> "pd.Series[str]":
    """Return dates joined with their times of day; if a format is given, as written in the file."""
    dates, clocks, form = file.cells[date], file.cells[file.times.time], file.mapping.time.format
    lost = np.flatnonzero(dates.isna() & clocks.notna())
    if lost.size:
        more = f" (in {lost.size} rows, of {len(dates)})" if lost.size > 1 else ""
        said = f"the date is missing{more}; the time of day {clocks.iloc[lost[0]]} is there: write its date into every"
        raise file.refuse_row(int(lost[0]), f"{said} row", date, skip=4 * lost.size <= len(dates))
    there = dates.notna() & clocks.notna()
    plain = plain_dates(dates) + " " + plain_clocks(clocks)
    if form and pd.isna(pd.to_datetime(plain.iloc[0], format=form, utc=True, errors="coerce")):
        written = dates.astype(str).str.strip().str.removesuffix(".0") + " " + clocks.astype(str).str.strip()
        return written.where(there)
    return plain.where(there)


def _refuse_form(text: "pd.Series[str]", file: FileCells) -> NoReturn:
    """Raise the error for times in an unknown form, with formats that fit."""
    keys, forms, wanted = file.time_keys, find_formats(text), file.mapping.time.format
    ways = " or ".join(f'format = "{form}"' for form in forms) or "format, in the letters of strptime"
    hint = f"does not fit the format {wanted!r}" if wanted else "is not an ISO timestamp"
    if "date" in keys and not forms:
        ways += f'; if {keys["date"]!r} holds no dates, leave it out: role = "ignore"'
    # minutes and seconds only: the hours may be missing
    doubtful = len(forms) > 1 or not any(map(has_day, forms))
    raise (TwoReadingsError if doubtful and forms else RecordingError)(
        f"{file.at(0)}: {text.iloc[0].strip()!r} {hint}; state how it is written in a mapping: [time] {_told(keys)} "
        f"and {ways}",
        [{"time": {**keys, "format": form}} for form in forms],
    )


def _told(keys: dict[str, str]) -> str:
    return ", ".join(f'{key} = "{title}"' for key, title in keys.items())


def _refuse_four_parts(text: "pd.Series[Any]", stated: str, file: FileCells) -> None:
    """Raise an error if times of four parts may be days to seconds, or the heading states a part that may be frames."""
    parts = text.str.strip().str.extract(f"^{_FOUR_PARTS}$")
    if parts.isna().to_numpy().any():
        return  # a fraction of 60 or more, or with three digits
    a, b, c, d = (pd.to_numeric(parts[k]).to_numpy(dtype=np.float64) for k in parts)
    fraction = pd.to_numeric("0." + parts[3]).to_numpy(dtype=np.float64)
    read = ((a * 60 + b) * 60 + c + fraction, ((a * 24 + b) * 60 + c) * 60 + d)
    steps = [np.diff(seconds) for seconds in read]
    even, passed_even = (len(step) > 1 and np.mean(np.abs(step - np.median(step)) < 1e-6) > _EVEN for step in steps)
    if even and not passed_even:
        return  # a fraction: only then are the rows equally spaced
    first = text.iloc[0].strip()
    days = f'append it to the heading ("{file.heading} [d:hh:mm:ss]") if days come first; otherwise '
    raise TwoReadingsError(
        f"{file.at(0)}: the last part of {first!r} can be seconds after days, hours and minutes, or a fraction or "
        f"frames after the seconds; state how it is written: {'' if stated else days}write fractions after a point, "
        f'or write a mapping: [time] {_told(file.time_keys)} and format = "%H:%M:%S:%f" for decimals'
    )


def _read_stated(text: "pd.Series[Any]", form: str, file: FileCells) -> tuple[FloatArray, str, tuple[str, ...]]:
    """Read elapsed times in the format that the heading states."""
    cells, first = text.str.strip(), text.iloc[0].strip()
    if form not in _PASSED or not re.fullmatch(_PASSED[form], first):
        raise RecordingError(
            f"{file.at(0)}: {first!r} cannot be read in the format that the heading or the row of units states; state "
            "mm:ss, mm:ss.fff, d:hh:mm, d:hh:mm:ss or a time of day (hh:mm:ss), in which fractions of a second follow "
            f"a point or have three digits, or write a mapping: [time] {_told(file.time_keys)} and format, in the "
            'letters of strptime, such as "%H:%M:%S", or "%M:%S:%f" for decimals after a colon'
        )
    parts = cells.str.extract(f"^{_PASSED[form]}$")
    scales = {"days": 86400, "hours": 3600, "minutes": 60, "seconds": 1}
    plain = parts.apply(lambda part: pd.to_numeric(part.str.replace(r"[,:]", ".", regex=True)))
    seconds = sum((plain[name].to_numpy(dtype=np.float64) * scales[name] for name in plain), np.zeros(len(cells)))
    _refuse_unlike(~np.isfinite(seconds), text, f"a time like {first!r}", file)
    whole = np.rint(seconds * 1e9).astype(np.int64)
    note = f"{file.heading!r} is read as {_WRITTEN[form]}, as the heading specifies"
    return (whole - whole[0]) / 1e9, "", (note,)


def _read_clock(text: "pd.Series[Any]", file: FileCells) -> tuple[FloatArray, str, tuple[str, ...]]:
    """Read times of day or elapsed times, neither of which contains a date."""
    first = text.iloc[0].strip()
    halves = HALF.fullmatch(first) is not None
    parts = text.str.strip().str.extract(CLOCK)
    short = not halves and pd.isna(parts["seconds"].iloc[0])
    form = "%H:%M" if short and find_clock_form(file.heading) == "hm" else ""
    if short and not form:
        raise TwoReadingsError(
            f"{file.at(0)}: {first!r} can be read as hours and minutes or as minutes and seconds; state how it is "
            f'written in a mapping: [time] column = "{file.heading}" and format = "%H:%M" or format = "%M:%S"',
            [{"time": {"column": file.heading, "format": form}} for form in ("%H:%M", "%M:%S")],
        )
    if halves:
        upper = text.str.strip().str.upper().str.replace(r" ?([AP])\.?M\.?$", r" \1M", regex=True)
        form = "%I:%M:%S %p" if first.count(":") == 2 else "%I:%M %p"
        stamps = parse(upper, form.replace("%S", "%S.%f") if "." in first.upper().rstrip("M.PA ") else form)
        seconds = ((stamps - stamps.dt.normalize()).dt.total_seconds()).to_numpy(dtype=np.float64)
    else:
        if short:
            odd = parts["seconds"].notna() | (pd.to_numeric(parts["minutes"]) > 59)
            _refuse_unlike(odd.to_numpy(), text, f"a time like {first!r}", file)
            parts["seconds"] = "0"
        texts = parts["seconds"].str.replace(r"[,:]", ".", regex=True)
        days, hours, minutes, rest = (
            pd.to_numeric(c, errors="coerce").to_numpy(dtype=np.float64)
            for c in (parts["days"].fillna("0"), parts["hours"], parts["minutes"], texts)
        )
        seconds = ((days * 24 + hours) * 60 + minutes) * 60 + rest
    _refuse_unlike(~np.isfinite(seconds), text, f"a time like {first!r}", file)
    # exact if the file has no finer resolution than nanoseconds
    whole = np.rint(seconds * 1e9).astype(np.int64)
    steps = np.diff(whole)
    usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    midnights = (steps < 0) & (steps + _DAY > 0) & (steps + _DAY <= 2 * usual)
    read_as = Message("{name!r} is read as {form}, as the heading specifies", name=file.heading, form=form)
    notes: tuple[str, ...] = (read_as,) if short else ()
    if not midnights.any() or whole.max() >= _DAY:
        return (whole - whole[0]) / 1e9, "", notes
    places = tell_places((np.flatnonzero(midnights) + 1).tolist(), file.table.place)
    days_on = np.concatenate([[0], np.cumsum(midnights)])
    notes += (Message("the time of day passes midnight in {places}", places=places),)
    return (whole - whole[0] + days_on * _DAY) / 1e9, "", notes


def _read_numbers(raw: FloatArray, file: FileCells) -> tuple[FloatArray, str, tuple[str, ...]]:
    """Read numeric times: elapsed seconds, seconds since 1970, or spreadsheet day numbers."""
    heading = file.heading
    if file.columns.time_unit:
        unit = find_unit(file.columns.time_unit, "time")
        time = (raw - raw[0]) * unit.scale if unit.scale >= 1 else (raw - raw[0]) / round(1 / unit.scale)
        known = unit.scale in (1, 1e-3)
        counted = known and EPOCH[0] <= raw[0] * unit.scale < EPOCH[1] and not file.mapping.time.start
        if not counted:
            return time, "", ()
        note = f"{heading!r} counts from 1970-01-01 UTC"
        return time, pd.Timestamp(raw[0] * unit.scale, unit="s", tz="UTC").isoformat(), (note,)
    for parts, word in PARTS.items():
        if EPOCH[0] * parts <= raw.min() and raw.max() < EPOCH[1] * parts:
            # whole microseconds are exact
            time = raw - raw[0] if parts == 1 else (raw - raw[0]) / parts
            start = pd.Timestamp(raw[0] / parts, unit="s", tz="UTC").isoformat()
            return time, start, (f"{heading!r} is taken as {word} since 1970-01-01 UTC",)
    if SERIAL[0] <= raw.min() and raw.max() < SERIAL[1] and any(w in heading.casefold() for w in _DATE_WORDS):
        milliseconds = np.rint(raw * 86400e3)
        start = pd.Timestamp(milliseconds[0] / 1e3 + _SERIAL_BEGIN, unit="s").isoformat()
        note = f"{heading!r} is taken as days since 1899-12-30, as Excel counts"
        return (milliseconds - milliseconds[0]) / 1e3, start, (note,)
    ways: list[dict[str, str]] = [{"unit": unit} for unit in find_likely_units(raw)]
    if compact := raw.min() > 19e12 and raw.max() < 21e12:  # digits without separators: 20240305080010
        ways = [{"format": "%Y%m%d%H%M%S"}]
    raise (RecordingError if compact else TwoReadingsError)(
        f"{file.source}: column {heading!r} holds numbers from {raw[0]:.14g} to {raw[-1]:.14g} and has no unit: "
        f'seconds, minutes, hours or milliseconds? Append it to the name, such as "{heading} [s]", or write a '
        f'mapping: [time] column = "{heading}" and unit = "s"',
        [{"time": {"column": heading, **way}} for way in ways],
    )


def find_likely_units(raw: FloatArray) -> tuple[str, ...]:
    """Return the possible units of numeric times: rows 50 ms to an hour apart, total duration at least a minute.

    Parameters
    ----------
    raw : ndarray of shape (n_rows,)
    """
    if len(raw) < 2 or not (np.diff(raw) > 0).all():
        return ()
    step, span = float(np.median(np.diff(raw))), float(raw[-1] - raw[0])
    scales = {unit: find_unit(unit, "time").scale for unit in ("s", "min", "h", "d", "ms")}
    return tuple(u for u, s in scales.items() if 0.05 <= step * s <= 3600 and (span * s >= 60 or len(raw) < 10))


def _in_zone(time: FloatArray, start: str, zone: str, where: str) -> tuple[FloatArray, str]:
    """Return times and the first timestamp of a clock with daylight saving."""
    local = pd.DatetimeIndex(pd.Timestamp(start) + pd.to_timedelta(time, unit="s"))
    try:
        zoned = local.tz_localize(zone, ambiguous="infer")
    except ValueError as e:  # an hour that does not exist in the zone, or occurs twice and is ambiguous
        raise RecordingError(
            f"{where}: these cannot be times in {zone}: {e}; correct [time] zone in the mapping"
        ) from e
    return _seconds(pd.Series(zoned - zoned[0])), zoned[0].isoformat()


def _seconds(passed: "pd.Series[pd.Timedelta]") -> FloatArray:
    return np.asarray(passed.dt.total_seconds(), dtype=np.float64)


def _refuse_missing(missing: BoolArray, file: FileCells) -> None:
    if missing.any():
        raise file.refuse_row(int(missing.argmax()), "the time is missing; fill it in or delete the row")


def _refuse_unlike(odd: BoolArray, text: "pd.Series[str]", what: str, file: FileCells) -> None:
    """Raise the error for cells in a form different from the first one."""
    if odd.any():
        row = int(odd.argmax())
        raise file.refuse_row(row, f"{text.iloc[row]!r} is not {what}; correct or delete the row")
