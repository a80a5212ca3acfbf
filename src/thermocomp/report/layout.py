"""A table as it is laid out, whatever shows it: a terminal draws it by rich, a page by a template."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from thermocomp.judging.choice import Cell, Table, format_cell


class Toned(str):
    """Text that is highlighted.

    Parameters
    ----------
    text : str
    tone : str
        good, doubtful, bad, grave, soft or strong.
    """

    tone: str

    def __new__(cls, text: str, tone: str) -> "Toned":
        """Return the text with its tone."""
        toned = super().__new__(cls, text)
        toned.tone = tone
        return toned


def verdict(word: str) -> Toned:
    """Return a verdict in its tone."""
    return Toned(word, {"accepted": "good", "unproven": "doubtful"}.get(word.partition(" ")[0], "bad"))


@dataclass(frozen=True)
class Column:
    """A column: what it shows of a row, and how.

    Parameters
    ----------
    heading : str
    value : str, int or callable
        Name or place of the value in the row, or what makes it of the row.
    form : str
        Format of numbers, as in Python, or ``um``: hundredths, and nothing finer on a page than makes sense. Without
        one the column holds words, on the left; ``>`` sets what is not a number to the right.
    unit : str
    whole : bool
        Its cells are never broken over two lines.
    """

    heading: str
    value: str | int | Callable[[Any], object]
    form: str = ""
    unit: str = ""
    whole: bool = False

    def text(self, row: Any, *, page: bool = False) -> str:
        """Return the cell of a row as text; what is not known is empty, or a dash among the numbers of a page."""
        found: Any = self.value(row) if callable(self.value) else row[self.value]
        if page and self.form == "um":
            return in_um(found)
        if found is None or (isinstance(found, float) and not math.isfinite(found)):
            return ""
        if isinstance(found, str):
            return found
        if isinstance(found, float) and self.form == "um":
            return f"{round(found, 2) + 0.0:.2f}"  # no minus zero
        return format(found, self.form) if isinstance(found, float) else str(found)


@dataclass(frozen=True)
class Layout:
    """A table: columns, and the rows that they look at.

    Parameters
    ----------
    columns : sequence of Column
    rows : sequence
        Source of the column values: records, tuples or results.
    title : str
    caption : str
        Meaning of the numbers; a page explains it in its text around the table.
    note : str
        A paragraph below it.
    tones : dict of int to str
        Highlighted rows, by index: best (the chosen one) or none (no compensation).
    sections : frozenset of int
        Rows above which there is a line.
    """

    columns: Sequence[Column]
    rows: Sequence[Any]
    title: str = ""
    caption: str = ""
    note: str = ""
    tones: dict[int, str] | None = None
    sections: frozenset[int] = frozenset()

    def tone(self, row: int) -> str:
        """Return the highlighting of a row; empty if none."""
        return (self.tones or {}).get(row, "")


def laid_out(t: Table) -> Layout:
    """Return the layout of a table of results, with its title above it."""
    columns = [Column(heading, partial(_cell, j), "" if j in t.words else ">") for j, heading in enumerate(t.columns)]
    return Layout(columns, t.rows, note=t.caption, tones={} if t.marked is None else {t.marked: "best"})


def _cell(place: int, row: Sequence[Cell]) -> str:
    return format_cell(row[place])


def in_um(value: float | None) -> str:
    """Return a number as the pages show it."""
    if value is None or not math.isfinite(value):
        return "–"
    return f"{round(value, 2) + 0.0:.2f}" if abs(value) < 100 else f"{value:.0f}"  # no minus zero


@dataclass(frozen=True)
class PrintedLine:
    """A line of text.

    Parameters
    ----------
    text : str
    mark : Toned or None
        Highlighted text before it.
    whole : bool
        It is not broken where the terminal ends.
    """

    text: str
    mark: Toned | None = None
    whole: bool = False


Item = PrintedLine | Layout
