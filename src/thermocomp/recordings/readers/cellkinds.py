"""Contents of the cells of a column, regardless of its heading: numbers, dates, times of day, or timestamps."""

import re
from collections.abc import Callable, Sequence
from typing import Any, Literal

import pandas as pd

from thermocomp.recordings.readers.layout import is_stamp
from thermocomp.recordings.readers.numbers import is_number_like

#: a time of day, or an elapsed time: hh:mm:ss beyond 24 h, optionally with days
CLOCK = re.compile(
    r"(?:(?P<days>\d+)(?: days?,? |\.))?(?P<hours>\d+):(?P<minutes>\d\d)(?::(?P<seconds>\d\d(?:[.,:]\d+)?))?"
)
#: a time of day with AM or PM
HALF = re.compile(r"\d{1,2}:\d\d(?::\d\d(?:\.\d+)?)? ?[AaPp]\.?[Mm]\.?")
#: midnight that a spreadsheet adds to a date; the epoch day that it adds to a time of day
_MIDNIGHT = re.compile(r"[ T]00:00(?::00(?:\.0+)?)?$")
_FIRST_DAY = re.compile(r"^1(?:899-12-3[01]|904-01-01)[ T]")
#: a weekday before a date
_WEEKDAY = re.compile(r"^[^\W\d_]{2,10}\.?,? +(?=\d{1,4}[-./]|\d{1,2}\.? +[^\W\d_]{3,})")
#: a date that consists of digits only
_COMPACT = re.compile(r"(?:19|20)\d\d(?:0[1-9]|1[0-2])(?:0[1-9]|[12]\d|3[01])")

#: ``compact``: dates of digits only, which may be numbers
#: ``passed``: elapsed times of over 24 h or with days; ``other``: words; empty: no contents
Kind = Literal["number", "compact", "date", "clock", "passed", "stamp", "other", ""]
#: kind of contents of the column with a given number
Kinds = Callable[[int], Kind]


def find_kind(cells: Sequence[str]) -> Kind:
    """Return what cells of a column contain: numbers, dates, times of day, timestamps or other text."""
    if not cells:
        return ""
    texts = [cell.strip().lstrip("'") for cell in cells]
    texts = [_FIRST_DAY.sub("", text) if "-" in text else text for text in texts]  # files may have 10,000 columns

    def are(what: Callable[[str], object]) -> bool:
        return 2 * sum(bool(what(text)) for text in texts) > len(texts)

    if any(":" in t for t in texts) and are(lambda t: ":" in t and (CLOCK.fullmatch(t) or HALF.fullmatch(t))):
        clocks = [found for t in texts if (found := CLOCK.fullmatch(t))]
        return "passed" if any(c["days"] or int(c["hours"]) > 23 for c in clocks) else "clock"
    if are(is_number_like):
        return "compact" if is_compact_date(texts) else "number"
    texts = [_WEEKDAY.sub("", text) for text in texts]
    if are(lambda t: is_stamp(t) and ":" in _MIDNIGHT.sub("", t)):
        return "stamp" if len(texts) == 1 or len(set(texts)) > 1 else "other"
    return "date" if are(is_stamp) else "other"


def is_compact_date(cells: Sequence[str]) -> bool:
    """Return whether all cells are dates that consist of digits only, the year first: 20240313."""
    return bool(cells) and all(_COMPACT.fullmatch(cell.strip().removesuffix(".0")) for cell in cells)


def plain_dates(cells: "pd.Series[Any]") -> "pd.Series[str]":
    """Return dates without a weekday or a spreadsheet's midnight, and with separators between their parts."""
    plain = cells.astype(str).str.strip().str.replace(_MIDNIGHT, "", regex=True).str.replace(_WEEKDAY, "", regex=True)
    if is_compact_date([plain.iloc[0]]):
        return plain.str.replace(r"^(\d{4})(\d\d)(\d\d)(?:\.0)?$", r"\1-\2-\3", regex=True)
    return plain


def plain_clocks(cells: "pd.Series[Any]") -> "pd.Series[str]":
    """Return times of day without the epoch day that a spreadsheet may have added."""
    return cells.astype(str).str.strip().str.replace(_FIRST_DAY, "", regex=True)
