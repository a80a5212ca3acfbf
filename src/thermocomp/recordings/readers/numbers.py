"""Number formats: decimal sign, thousands separators, and text in place of a number."""

import re
from collections import Counter
from collections.abc import Iterable
from typing import NamedTuple

from thermocomp.core.exceptions import RecordingError
from thermocomp.recordings.words import read_words

#: texts that denote a missing value, besides an empty cell
MISSING_TEXT = ("", "nan", "na", "n/a", "none", "null", "#n/a", "<na>", "-nan", "n.v.", "k.a.", "k. a.", "n.a.")
#: placeholders of loggers and spreadsheets for a missing number, in lower case
_FILLERS = frozenset(read_words("missing_numbers"))
_RUN = re.compile(r"([-+*?#.])\1*|err:\d+")
#: thousands separators besides point and comma
_SPACES = "'’\u00a0\u202f "
_PLAIN = re.compile(r"[-+]? *(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][-+]?\d+)?")
_GROUPED = re.compile(rf"[-+]?[1-9]\d{{0,2}}(?:([.,{_SPACES}])\d{{3}})(?:\1\d{{3}})*(?:(?!\1)[.,]\d*)?")
_OPEN = re.compile(r"[-+]?[1-9]\d{0,2}[.,]\d{3}")


class Notation(NamedTuple):
    """Number format of a file: decimal sign and thousands separators."""

    decimal: str  #: point or comma
    thousands: str = ""  #: allowed separators between groups of three digits

    def read(self, cell: str) -> float | None:
        """Return the number in a cell; None if it is not a number."""
        text = cell.strip()
        grouped = _GROUPED.fullmatch(text)
        if grouped and grouped[1] in self.thousands:
            text = text.replace(grouped[1], "")
        elif not _PLAIN.fullmatch(text):
            return None
        if {".": ",", ",": "."}[self.decimal] in text:
            return None
        return float(text.replace(self.decimal, ".").replace(" ", ""))


class Signs:
    """Evidence from the cells of a file for its decimal sign.

    A sign after a zero or more than three digits, or before a number of digits other than three, is a decimal sign; a
    sign that occurs twice is a thousands separator. ``1,234`` alone is ambiguous.
    """

    def __init__(self) -> None:
        #: cells that prove a decimal sign
        self.proven: Counter[str] = Counter()
        #: first ambiguous cell for each sign
        self.open: dict[str, str] = {}
        #: thousands separators found
        self.groups: set[str] = set()

    def add(self, cells: Iterable[str]) -> None:
        """Take further cells of the file as evidence for its decimal sign."""
        for cell in cells:
            text = cell.strip()
            grouped = _GROUPED.fullmatch(text)
            if _OPEN.fullmatch(text):
                self.open.setdefault("." if "." in text else ",", text)
            elif grouped:
                self.groups.add(grouped[1])
                rest = text[grouped.end(1) :].replace(grouped[1], "")
                other = next((s for s in ".," if s in rest), {".": ",", ",": "."}.get(grouped[1], ""))
                self.proven.update([other] if other else [])
            elif _PLAIN.fullmatch(text) and ("." in text or "," in text):
                self.proven["." if "." in text else ","] += 1

    def proven_sign(self) -> str:
        """Return the decimal sign proven by most cells; empty if there is no proof."""
        return self.proven.most_common(1)[0][0] if self.proven else ""

    def decide(self, stated: str, delimiter: str) -> Notation | None:
        """Return the number format; None if the cells do not determine it."""
        decimal = stated or self.proven_sign()
        if not decimal and self.open:
            if delimiter != "," or "," in self.open:
                cell = next(iter(self.open.values())) if delimiter != "," else self.open[","]
                sign = "." if "." in cell else ","
                whole, part = cell.replace(sign, ""), cell.replace(sign, ".")
                raise RecordingError(
                    f"{cell!r} can be read as {whole} or as {part}, and no other number shows which; state the decimal "
                    'sign in a mapping: [read] decimal = "," or decimal = "."',
                    [{"read": {"decimal": mark}} for mark in (sign, {".": ",", ",": "."}[sign])],
                )
            decimal = "."
        if not decimal:
            return None
        other = {".": ",", ",": "."}[decimal]
        thousands = "".join(sorted((self.groups | {other} & set(self.open)) - {decimal}))
        return Notation(decimal, thousands)


def is_filler(cell: str) -> bool:
    """Return whether a cell contains a placeholder for a missing number."""
    text = cell.strip().casefold()
    return text in MISSING_TEXT or is_word(text)


def is_word(cell: str) -> bool:
    """Return whether a cell contains a word of loggers or spreadsheets for a missing number."""
    text = cell.strip().casefold()
    return text in _FILLERS or _RUN.fullmatch(text) is not None


def is_number_like(cell: str) -> bool:
    """Return whether a cell contains a number in any notation."""
    text = cell.strip()
    return _PLAIN.fullmatch(text) is not None or _GROUPED.fullmatch(text) is not None
