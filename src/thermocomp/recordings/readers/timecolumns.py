"""Columns of a file that contain the time: found by headings, and by the contents of the cells."""

import re
from collections.abc import Sequence
from typing import NamedTuple

from thermocomp.core.exceptions import RecordingError, tell_nearest
from thermocomp.core.messages import Message
from thermocomp.recordings.headings import (
    BRACKETS,
    Meaning,
    find_clock_form,
    is_time_name,
    plain_name,
    strip_format,
)
from thermocomp.recordings.readers.cellkinds import Kinds
from thermocomp.recordings.readers.dayforms import EPOCH, PARTS, names_day
from thermocomp.recordings.readers.dayhalves import are_halves, says_halves
from thermocomp.recordings.readers.mapping import Mapping, Place
from thermocomp.recordings.readers.tables import FileTable
from thermocomp.recordings.words import read_word_groups, read_words

#: headings of a time without unit, the more specific ones first
_BARE = read_words("stamps")
#: headings that denote a time only with a unit or next to another time column
_NEEDS_UNIT = ("t", "data", "tag", "day")
#: headings of a date, and of a time of day next to it
_DATES = read_words("dates")
_CLOCKS = read_words("clocks")
#: headings of separate columns for year, month, day, hour, minute and second
_PARTS = read_word_groups("time_parts")
#: headings of milliseconds in addition to a time in whole seconds
_FRACTIONS = read_words("milliseconds")
#: names of a time since the start of a test, even if it is written as a time of day
_PASSED = re.compile(
    r"elapsed|relativ|\brel\b|dauer|laufzeit|duration|dur[ée]e|durata|duraci|run[ _]?time|test[ _]?time|\bsince\b"
    r"|passed|verstrichen|vergangen|écoul|trascors"
)
#: a count of seconds or parts of a second since 1970
_COUNT = re.compile(r"\s*\d{9,19}(?:\.\d*)?\s*")


class TimePlan(NamedTuple):
    """Columns that contain the time, by position."""

    time: int
    date: int | None  #: column of the dates, if `time` contains a time of day
    half: int | None  #: column of AM and PM, if `time` contains times of day
    fraction: int | None  #: column of milliseconds in addition to whole seconds
    unused: tuple[int, ...]  #: further columns that contain dates
    notes: tuple[str, ...]


def find_time(table: FileTable, meanings: Sequence[Meaning | None], mapping: Mapping, kinds: Kinds) -> TimePlan:
    """Find the time column, and the column of dates if the time column contains only a time of day."""
    notes: list[str] = []
    headings, source = table.headings, str(table.path)
    if mapping.time.column:
        time = find_position(mapping.time.column, headings, "[time]", source)
        date = find_position(mapping.time.date, headings, "[time]", source) if mapping.time.date else None
    else:
        time, date, notes = _by_name(table, meanings, kinds)
    if date is None and mapping.time.unit in ("", "timestamp") and not mapping.time.format:
        time, date = _paired(time, headings, mapping, kinds)
        if date is not None:
            notes.append(_tell_pair(headings, time, date))
    fraction = None if mapping.time.column else _find_fraction(headings, time)
    half = None
    if kinds(time) in ("clock", "stamp"):
        found = (k for k, h in enumerate(headings) if k not in (time, date) and not is_ignored(h, k, mapping))
        named = (k for k in found if meanings[k] is None and headings[k] not in mapping.columns)
        half = next((k for k in named if says_halves(headings[k]) or are_halves(table.head(k), headings[k])), None)
    used = (time, date, half, fraction)
    twins = {k for k, heading in enumerate(headings) if heading and heading == headings[time]}
    unused = [k for k in range(len(headings)) if k not in used and k not in twins and kinds(k) in ("date", "stamp")]
    return TimePlan(time=time, date=date, half=half, fraction=fraction, unused=tuple(unused), notes=tuple(notes))


def find_position(place: Place, headings: Sequence[str], table: str, source: str) -> int:
    """Return the position of a column named in a mapping."""
    if isinstance(place, int):
        if 1 <= place <= len(headings):
            return place - 1
        raise RecordingError(
            f"{source}: mapping {table}: the file has {len(headings)} columns, but no column number {place}"
        )
    if place in headings:
        return list(headings).index(place)
    # a row of units may have added the format of a date or time
    bare = [k for k, heading in enumerate(headings) if strip_format(heading) == place]
    if len(bare) == 1:
        return bare[0]
    hint = tell_nearest(place, filter(None, headings), cutoff=0.5)
    raise RecordingError(f"{source}: mapping {table}: the file has no column {place!r}; {hint}")


def is_ignored(heading: str, index: int, mapping: Mapping) -> bool:
    """Return whether a mapping marks a column as ignored."""
    rules = mapping.columns.items()
    places = (heading, strip_format(heading), index + 1)
    return any(rule.role == "ignore" and (rule.column or name) in places for name, rule in rules)


def find_parts(headings: Sequence[str]) -> list[str]:
    """Return the headings of separate columns for year, month, day, hour, minute and second; empty if none exist."""
    found = {next((k for k, words in enumerate(_PARTS) if _bare_name(h) in words), -1): h for h in reversed(headings)}
    parts = [found[k] for k in range(len(_PARTS)) if k in found]
    return parts if len(parts) > 2 or {3, 4} <= found.keys() else []


def has_passed(heading: str) -> bool:
    """Return whether a heading denotes an elapsed time, not a time of day, by its name or a format without hours."""
    return _PASSED.search(heading.casefold()) is not None or find_clock_form(heading).startswith(("d", "m", "s"))


def _by_name(table: FileTable, meanings: Sequence[Meaning | None], kinds: Kinds) -> tuple[int, int | None, list[str]]:
    headings, source = table.headings, str(table.path)
    timed = {k: m for k, m in enumerate(meanings) if m is not None and m.unit.quantity == "time"}
    # of two columns with one name the first is used
    plain = {plain_name(h): k for k, h in reversed(list(enumerate(headings)))}
    fractions = {k for k, h in enumerate(headings) if {plain_name(h), _bare_name(h)} & {*_FRACTIONS}}
    named = [k for k, m in timed.items() if is_time_name(m.base) and k not in fractions]
    clear = [k for k in named if timed[k].base != "T"]  # T_s may be a surface temperature
    if clear:
        return clear[0], None, []
    date = next((plain[name] for name in _DATES if name in plain), None)
    clock = next((plain[name] for name in _CLOCKS if name in plain), None)
    if date is not None and clock is not None:
        whole = next((k for k in (clock, date) if kinds(k) == "stamp"), None)
        alone = clock if kinds(clock) == "passed" or has_passed(headings[clock]) else whole
        return (clock, date, []) if alone is None else (alone, None, [])
    names = (*(n for n in _BARE if n in plain), *(n for n in plain if is_time_name(n)))
    bare = [plain[name] for name in names if name not in _NEEDS_UNIT or kinds(plain[name]) in ("date", "stamp")]
    best = next(iter((*bare, *named)), None)
    # a number without a unit, such as that of the scan, only if no other column holds dates
    head = table.head(best) if best is not None and best in bare else []
    constant = len(head) > 1 and len(set(head)) == 1  # a duration; dates have a time of day beside them
    counts = bool(head) and kinds(bare[0]) == "number" and not _is_epoch(head)
    uncertain = best is None or counts or (constant and kinds(bare[0]) != "date")
    held = _by_cells(table, kinds) if uncertain else None
    if best is not None:
        return held or (best, None, [])
    if len(timed) == 1:
        index = next(iter(timed))
        return index, None, [f"{headings[index]!r} is taken as the time"]
    if held and held[1] is None:
        return held
    if len(parts := find_parts(headings)) > 1:
        raise RecordingError(
            f"{source}: the time is split over {len(parts)} columns, {', '.join(parts)}: combine them into one, such "
            "as 2024-03-13 08:00:00 below the heading timestamp"
        )
    if held:
        return held
    raise RecordingError(
        f"{source}: no time column found among {', '.join(h for h in headings if h)}; name it time_s (or time_min, "
        'time_h, timestamp) in the heading line, or give a mapping with [time] column = "..." and unit = "s"'
    )


def _by_cells(table: FileTable, kinds: Kinds) -> tuple[int, int | None, list[str]] | None:
    """Find a time by the cells: dates with a time of day, dates beside times of day, or seconds since 1970.

    Of several such columns the one whose cells differ most from row to row is the time; the names and then the order
    of the columns break ties.
    """
    headings, held = table.headings, [kinds(k) for k in range(len(table.headings))]

    def rank(k: int) -> tuple[int, bool, int]:
        return -len(set(table.head(k))), not is_time_name(headings[k]), k

    stamps = sorted((k for k, kind in enumerate(held) if kind == "stamp"), key=rank)
    if not stamps and held.count("date") == 1 and held.count("clock") == 1:
        time, date = held.index("clock"), held.index("date")
        return (time, date, [_tell_pair(headings, time, date)]) if not has_passed(headings[time]) else None
    epochs = [k for k, kind in enumerate(held) if kind == "number" and _is_epoch(table.head(k))]
    if not (found := stamps or epochs):
        return None
    return found[0], None, [f"{headings[found[0]]!r} holds dates: taken as the time"]


def _is_epoch(cells: Sequence[str]) -> bool:
    """Return whether all cells are rising counts of seconds, milliseconds and so on since 1970."""
    if not all(map(_COUNT.fullmatch, cells)):
        return False
    counts = [float(cell) for cell in cells]
    return any(EPOCH[0] * n <= counts[0] <= counts[-1] < EPOCH[1] * n for n in PARTS) and counts == sorted(counts)


def _tell_pair(headings: Sequence[str], time: int, date: int) -> str:
    return Message("{date!r} holds the dates, {time!r} the time of day", date=headings[date], time=headings[time])


def _paired(time: int, headings: Sequence[str], mapping: Mapping, kinds: Kinds) -> tuple[int, int | None]:
    """Return the columns of the times of day and of their dates, if one of them was found and both exist."""

    def others(kind: str, names: Sequence[str]) -> list[int]:
        found = [
            k
            for k, heading in enumerate(headings)
            if k != time and kinds(k) == kind and not is_ignored(heading, k, mapping) and not has_passed(heading)
        ]
        # the nearest column, but matching names first
        return sorted(found, key=lambda k: (plain_name(headings[k]) not in names, abs(k - time)))

    kind = kinds(time)
    if kind == "clock" and not has_passed(headings[time]):
        compact = [k for k in others("compact", _DATES) if names_day(headings[k])]
        return time, next(iter((*others("date", _DATES), *compact)), None)
    if kind == "date" and not mapping.time.column and (clocks := others("clock", _CLOCKS)):
        return clocks[0], time
    return time, None


def _find_fraction(headings: Sequence[str], time: int) -> int | None:
    """Find a column of milliseconds next to the time."""
    after = time + 1
    return after if after < len(headings) and _bare_name(headings[after]) in _FRACTIONS else None


def _bare_name(heading: str) -> str:
    """Return a heading in lower case without text in brackets."""
    found = BRACKETS.fullmatch(heading.strip())
    return plain_name(found["base"] if found else heading)
