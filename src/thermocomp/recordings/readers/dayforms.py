"""Dates in forms other than timestamps: digits only, counts of days or seconds, weeks, dates without a year."""

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from thermocomp.core.arrays import FloatArray
from thermocomp.recordings.headings import plain_name
from thermocomp.recordings.readers.cellkinds import Kind, find_kind, plain_dates
from thermocomp.recordings.readers.dateorder import IntArray
from thermocomp.recordings.readers.numbers import is_filler
from thermocomp.recordings.readers.stamps import parse, read_days
from thermocomp.recordings.readers.tables import FileTable
from thermocomp.recordings.words import read_word_groups

#: maximum number of numeric columns examined
_MOST = 100
_DAY = 86_400
#: factors for digits after yyyymmdd: none, hh, hhmm, hhmmss, milliseconds
_BEHIND = (1, 10**2, 10**4, 10**6, 10**9)
#: seconds since 1970 in the years 2000 to 2100, in whole or fractional seconds
EPOCH = (946_684_800, 2_240_611_200)
PARTS = {1: "seconds", 10**3: "milliseconds", 10**6: "microseconds", 10**9: "nanoseconds"}
#: spreadsheet day numbers (days since 1899-12-30) of the same years
SERIAL = (36_526, 73_050)
#: Julian days of the same years
_JULIAN = (2_451_544, 2_488_070)
#: headings of a date or a day, under which numbers in other forms may also be dates
_NAMED = re.compile(
    r"(?:^|[\W_])(?:\w*(?:date|datum|tag|day|stamp|stempel)|dat|doy|dow|m?jd|julian|fecha|jour|giorno|d[ií]a|dag|data)(?:$|[\W_])"
)
_ORDINAL, _WEEK = r"(\d{4})-?(\d{3})", r"(\d{4})-?W(\d\d)-?([1-7])"
_NO_YEAR = re.compile(r"\d{1,2}[./-]\d{1,2}[./]?")
_MONTH = re.compile(r"\d{1,2}[-. ]{1,2}[^\W\d_]{3,9}\.?|[^\W\d_]{3,9}\.?[- ]\d{1,2}")
_COUNTED = re.compile(r"(?:day|tag|jour|giorno|d[ií]a|dag|dia|nap|den|dzień|gün)\W{0,3}\d{1,4}\.?", re.IGNORECASE)
_DAY_WORD = re.compile(r"(?:day|tag|jour|giorno|d[ií]a|dia)\W+\w+", re.IGNORECASE)
_WEEK_DAY = re.compile(r"^(?:KW|CW|W|wk|week) ?(\d\d?)[-/. ]?([1-7])$", re.IGNORECASE)
#: complete dates among other words
_WITHIN = (
    r"(?<!\d)(\d{4}([-./])\d{1,2}\2\d{1,2})(?!\d)",
    r"(?<!\d)(\d{1,2}([-./])\d{1,2}\2(?:\d{4}|\d\d))(?!\d)",
    r"(?<!\d)((?:19|20)\d{6})(?!\d)",
    r"(?<!\d)(\d{6})(?!\d)",
)
#: headings that name a day in one language and have another meaning in others
_NO_DAY = ("tag", "data", "stamp", "stempel", "dag", "dat")
_DAYS = read_word_groups("weekdays")


#: a number that is not a date, unless the heading names one
_SMALL = re.compile(r"[-+]?\d{1,7}(?:[.,]\d+)?")
_WEEKDAYS = frozenset(day for names in _DAYS for day in names)


def find_day_columns(table: FileTable, columns: Sequence[int], *, beside_clock: bool = False) -> list[int]:
    """Find the columns whose first cells are dates in a form other than timestamps."""
    found, typed = [], []
    for k in columns:
        head = table.head(k)
        if not head:
            typed += [k] if table.is_number(k, empty=False) else []
        elif find_kind(head) not in ("date", "stamp", "clock", "passed") and _read_filled(
            head, table.headings[k], beside_clock
        ):
            found.append(k)
    if typed := typed[:_MOST]:
        cells = table.load([], typed)[0]
        found += [k for k in typed if _read_filled(cells[k].dropna().tolist(), table.headings[k], beside_clock)]
    return sorted(found)


def find_column_kind(table: FileTable, column: int) -> Kind:
    """Return the kind of a column's contents, including columns of a numeric type."""
    head = table.head(column)
    if not head and names_day(table.headings[column]) and table.is_number(column, empty=False):
        head = [str(cell).removesuffix(".0") for cell in table.load([], [column])[0][column].dropna().iloc[:100]]
        return "compact" if find_kind(head) == "compact" else ""
    return find_kind(head)


def names_day(heading: str) -> bool:
    """Return whether a heading names a date or a day."""
    return _NAMED.search(plain_name(heading)) is not None


def _read_filled(cells: Sequence[Any], heading: str, beside_clock: bool) -> list[IntArray]:
    texts = [str(cell) for cell in cells if not is_filler(str(cell))]
    if not texts or not _may_be_day(texts[0].strip().lstrip("'")):
        return []
    if not names_day(heading) and all(_SMALL.fullmatch(text) for text in texts):
        return []
    return read_other_days(pd.Series(texts, dtype=object), heading, beside_clock=beside_clock)


def _may_be_day(first: str) -> bool:
    """Return whether the first cell of a column may be a day: a fast check, as a file may have thousands of columns."""
    weekday = first.casefold().rstrip(".") in _WEEKDAYS
    return weekday or re.search(r"\d", first) is not None or _DAY_WORD.fullmatch(first) is not None


def read_other_days(cells: "pd.Series[Any]", heading: str, *, beside_clock: bool = False) -> list[IntArray]:
    """Return the possible days of cells, relative to any origin, in each form that applies to all of them."""
    texts = cells.str.strip().str.lstrip("'")
    named = names_day(heading)
    numbers = pd.to_numeric(texts.str.replace(",", ".", regex=False), errors="coerce").to_numpy(dtype=np.float64)
    if np.isfinite(numbers).all() and not texts.str.fullmatch(r"\d{1,2}\.\d{1,2}\.").all():
        return _read_numbers(numbers, named=named)
    if texts.str.fullmatch(_COUNTED).all():  # day 1
        return [texts.str.extract(r"(\d+)", expand=False).to_numpy(dtype=np.int64)]
    found = _read_texts(texts, named=named, beside_clock=beside_clock)
    if not found and beside_clock:
        found = _read_dates_within(texts)
    words = texts.str.fullmatch(_DAY_WORD).all() or (
        named and plain_name(heading) not in _NO_DAY and texts.str.contains(r"\d").all()
    )
    if not found and beside_clock and words:
        # in an unknown form each change of the text starts another day
        return [np.asarray((texts != texts.shift()).cumsum(), dtype=np.int64)]
    return found


def _read_numbers(numbers: FloatArray, *, named: bool) -> list[IntArray]:
    found: list[IntArray] = []
    rises = bool((np.diff(numbers) >= 0).all())
    low, high = numbers.min(), numbers.max()
    if (numbers % 1 == 0).all() and low >= 1 and high < 1e18:
        whole = numbers.astype(np.int64)
        for behind in _BEHIND:
            if low >= 19_900_101 * behind and high < 21_000_000 * behind:
                found += _read_forms(pd.Series(whole // behind).astype(str), "%Y%m%d")
        if named and high < 10**8:
            width, forms = (8, ("%d%m%Y", "%m%d%Y")) if high >= 10**6 else (6, ("%y%m%d", "%d%m%y", "%m%d%y"))
            found += _read_forms(pd.Series(whole).astype(str).str.zfill(width), *forms) if high >= 10**4 else []
        if named and rises and high <= 366:
            found.append(whole)
    if rises and not found:
        for parts in PARTS:
            if EPOCH[0] * parts <= low and high < EPOCH[1] * parts:
                found.append((numbers // (parts * _DAY)).astype(np.int64))
    for begin, end in (SERIAL, _JULIAN):
        if named and rises and begin <= low and high < end:
            found.append(np.floor(numbers).astype(np.int64))
    return found


def _read_texts(texts: "pd.Series[str]", *, named: bool, beside_clock: bool) -> list[IntArray]:
    plain = texts.str.replace(r"(?<=\d)\s*[년月월年_]\s*(?=\d)", "-", regex=True).str.replace(
        r"\s*[日일]", "", regex=True
    )
    plain = plain_dates(plain.str.replace(r"'(\d\d)(?!\d)", r"\1", regex=True))
    first = plain.iloc[0]
    if re.fullmatch(f"{_ORDINAL}|{_WEEK}", first):
        return _read_forms(plain.str.replace("-", "", regex=False), "%GW%V%u" if "W" in first else "%Y%j")
    # a file may have thousands of columns: their first cells are checked before all cells
    if _WEEK_DAY.match(texts.iloc[0]) and (week := texts.str.extract(_WEEK_DAY)).notna().to_numpy().all():
        return [_unwrap(d, 364) for d in _read_forms("2020W" + week[0].str.zfill(2) + week[1], "%GW%V%u")]
    if _NO_YEAR.fullmatch(first) and (named or first.endswith(".") or (beside_clock and not _are_parts(plain))):
        bare = plain.str.rstrip("./").str.replace(r"[./]", "-", regex=True) + "-2000"
        return [_unwrap(d, 366) for d in _read_forms(bare, "%d-%m-%Y", "%m-%d-%Y")]
    if _MONTH.fullmatch(first):
        return [_unwrap(d, 366) for d in read_days(plain.str.replace(r"[-. ]+", " ", regex=True).str.strip() + " 2000")]
    return _read_weekdays(texts) or read_days(plain)


def _read_dates_within(texts: "pd.Series[str]") -> list[IntArray]:
    """Return the days of dates among other words: ``2024-03-05 (Tue)``, ``log_20240305_1``, ``P050324``."""
    for form in _WITHIN:
        if not re.search(form, texts.iloc[0]):
            continue
        parts = texts.str.extract(form, expand=True)[0]
        if parts.notna().all():
            return read_days(parts) if re.search(r"\D", parts.iloc[0]) else _read_digits(parts)
    return []


def _read_digits(parts: "pd.Series[str]") -> list[IntArray]:
    """Return the days of dates that consist of digits only; six-digit dates must increase within about a year."""
    if len(parts.iloc[0]) == 8:
        return _read_forms(parts, "%Y%m%d")
    read = _read_forms(parts, "%y%m%d", "%d%m%y", "%m%d%y")
    return [days for days in read if (np.diff(days) >= 0).all() and days[-1] - days[0] <= 366]


def _are_parts(texts: "pd.Series[str]") -> bool:
    """Return whether texts are part numbers, not dates: 1/3, 2/3, 3/3."""
    parts = texts.str.extract(r"^([1-9]\d?)/([1-9]\d?)$")
    return bool(parts[0].iloc[0] == "1" and parts[0].notna().all() and parts[1].nunique() == 1)


def _read_weekdays(texts: "pd.Series[str]") -> list[IntArray]:
    words = texts.str.casefold().str.rstrip(".")
    fitting = (names for names in _DAYS if words.isin(names).all())
    return [_unwrap(words.map(names.index).to_numpy(dtype=np.int64), 7) for names in fitting]


def _read_forms(texts: "pd.Series[str]", *forms: str) -> list[IntArray]:
    read = (parse(texts, form) for form in forms)
    return [s.to_numpy(dtype="M8[D]").view(np.int64) for s in read if s.notna().all()]


def _unwrap(days: IntArray, period: int) -> IntArray:
    """Return days that continue to increase where a week or a year starts again."""
    return np.concatenate([days[:1], days[0] + np.cumsum(np.diff(days) % period)])
