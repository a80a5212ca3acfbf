"""AM and PM in a separate column, next to a 12-hour clock."""

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from thermocomp.core.exceptions import RecordingError, Remedy, TwoReadingsError
from thermocomp.core.messages import Message
from thermocomp.recordings.readers.numbers import is_number_like
from thermocomp.recordings.readers.tables import FileTable, skip_row
from thermocomp.recordings.words import read_word_groups

#: words for the two halves of a day, in lower case without points and blanks: first the unambiguous ones
_CERTAIN = read_word_groups("halves")
#: then those that also denote shifts; then single letters
_MAYBE = read_word_groups("shifts")
_LETTERS = (("a",), ("p",))
_BEFORE, _AFTER = ({*c, *m, *x} for c, m, x in zip(_CERTAIN, _MAYBE, _LETTERS, strict=True))
_HEADING = re.compile(
    r"\ba[ ._]?m\.?[ /_|\\-]*p[ ._]?m\b|meridi[ea]m?|tageshälfte|half[ _]?(of[ _])?day",
    re.IGNORECASE,
)
#: headings that may also denote AM and PM, if the column contains two words
_SHORT = re.compile(r"[ap]\.?m\.?|half", re.IGNORECASE)
_HOUR = re.compile(r"(?<![\d:])(\d{1,2})(?=:\d\d)")


def _plain(cell: object) -> str:
    return re.sub(r"[.\s]", "", str(cell)).casefold()


def are_halves(cells: Sequence[str], heading: str) -> bool:
    """Return whether cells contain only AM or PM, in one of the supported languages."""
    words = {_plain(cell) for cell in cells}
    known = (*_CERTAIN[0], *_CERTAIN[1], *_MAYBE[0], *_MAYBE[1])
    if words.issubset(known) or says_halves(heading):
        return bool(words)
    return _SHORT.fullmatch(heading) is not None and len(words) == 2 and not any(map(is_number_like, words))


def says_halves(heading: str) -> bool:
    """Return whether a heading denotes a column of AM and PM."""
    return _HEADING.search(heading) is not None


def join_halves(
    clocks: "pd.Series[Any]", halves: "pd.Series[Any]", form: str, table: FileTable, names: tuple[str, str]
) -> "tuple[pd.Series[Any], tuple[str, ...]]":
    """Return times of day with AM or PM from their column appended, and notes on how they were read."""
    time, half = names
    there = clocks.notna()
    words = halves.map(_plain, na_action="ignore")
    after, before = words.isin(_AFTER), words.isin(_BEFORE)
    certain = (
        says_halves(half) or _SHORT.fullmatch(half) is not None or bool(words.isin((*_CERTAIN[0], *_CERTAIN[1])).any())
    )
    ignore: Remedy = {"columns": {half: {"role": "ignore"}}}
    unknown = np.flatnonzero(there & ~(after | before))
    if unknown.size and not certain:
        return clocks, ()  # the words denote shifts
    if unknown.size:
        row = int(unknown[0])
        says = "is empty" if pd.isna(halves.iloc[row]) else f"{str(halves.iloc[row])!r} is neither AM nor PM"
        raise RecordingError(
            f"{table.path}: {table.place(row)}, column {half!r}: {says}, where the time is {clocks.iloc[row]}; fill it "
            "in, or if it has nothing to do with the time, leave it out by a mapping: "
            f'[columns."{half}"] role = "ignore"',
            [skip_row(table, row)] if 4 * unknown.size <= len(clocks) else [],
        )
    texts = clocks.astype(str).str.strip()
    hours = pd.to_numeric(texts.str.extract(_HOUR, expand=False), errors="coerce")
    whole_day = bool((hours > 12).any())  # 24-hour times with a redundant AM or PM
    if whole_day or (form and "%p" not in form):
        wrong = np.flatnonzero(there & hours.notna() & (after != (hours >= 12)) & (before | after))
        if not wrong.size or (whole_day and not certain):
            return clocks, ()
        row = int(wrong[0])
        raise TwoReadingsError(
            f"{table.path}: {table.place(row)}: {half!r} specifies {halves.iloc[row]}, and {time!r} {clocks.iloc[row]}"
            + (
                ", in 24-hour time, as other rows show: correct one of them, "
                if whole_day
                else f", which the format {form!r} reads as 24-hour time: write %I for the hours and end it with %p, "
            )
            + f'or leave {half!r} out by a mapping: [columns."{half}"] role = "ignore"',
            [] if whole_day else [{"time": {"column": time, "format": f"{form.replace('%H', '%I')} %p"}}, ignore],
        )
    twelve = texts.str.replace(r"(?<![\d:])0?0(?=:\d\d(?!\d))", "12", n=1, regex=True)  # 00:31 AM
    joined = (twelve + " " + after.map({True: "PM", False: "AM"})).where(there)
    return joined, (Message("{half!r} specifies AM and PM for {time!r}", half=half, time=time),)
