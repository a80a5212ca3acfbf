"""Suggested formats for times in an unknown form."""

import re
from itertools import product

import pandas as pd

from thermocomp.recordings.readers.stamps import parse

_DATES = (
    *("%d.%m.", "%d.%m", "%d/%m", "%m/%d", "%d-%m", "%m-%d", "%d-%b", "%d %b", "%d. %b", "%b %d", "%b-%d", "%d %B"),
    *("%d. %B", "%B %d", "%Y%m%d", "%d%m%Y", "%m%d%Y", "%y%m%d", "%d%m%y", "%m%d%y", "%Y-%j", "%Y_%m_%d", "%d_%m_%Y"),
    *("%Y-%m-%d", "%Y/%m/%d", "%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%d-%m-%Y", "%m-%d-%Y", "%d-%b-%Y", "%d %b %Y"),
)
_CLOCKS = (
    *("%H:%M:%S", "%H:%M", "%H:%M:%S.%f", "%H.%M.%S", "%H.%M", "%H-%M-%S", "%H%M%S", "%H%M", "%Hh%M", "%Hh%Mm%Ss"),
    *("%I:%M:%S %p", "%I:%M %p"),
)
_ALONE = ("%M:%S.%f", "%H.%M.%S", "%H-%M-%S", "%Hh%M", "%Hh%Mm%Ss")
#: patterns of format letters other than one or two digits
_LETTERS = {
    **{"Y": r"\d{4}", "j": r"\d{3}", "f": r"\d+", "p": "[AaPp][Mm]"},
    **dict.fromkeys("bB", r"[^\W\d_]{3,9}"),
}
#: maximum number of formats suggested
_MOST = 3


def find_formats(cells: "pd.Series[str]") -> list[str]:
    """Return formats that fit all cells as times, in the letters of `datetime.strptime`."""
    first = cells.iloc[0].strip()
    joined = (f"{date}{join}{clock}" for date, join, clock in product(_DATES, (" ", "T", "-", "_", ""), _CLOCKS))
    fitting = [form for form in (*_ALONE, *joined) if _fits(first, form)]
    return [form for form in fitting[: 2 * _MOST] if parse(cells.str.strip(), form).notna().all()][:_MOST]


def _fits(cell: str, form: str) -> bool:
    """Return whether a cell matches a format completely, without digits lost in conversion."""
    if not re.fullmatch(
        re.sub(r"%(.)", lambda m: _LETTERS.get(m[1], r"\d\d?"), re.sub(r"[.-]", r"\\\g<0>", form)), cell
    ):
        return False
    read = pd.to_datetime(cell, format=form, errors="coerce")
    return not pd.isna(read) and _bare(read.strftime(form)) == _bare(cell)


def _bare(text: str) -> str:
    return re.sub(r"(?<![\d.])0+(?=\d)|(?<=\.\d)0+$", "", text.casefold())
