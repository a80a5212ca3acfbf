"""Layout of a table, independent of its output: rich draws it on a terminal, a template on a page."""

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
    """Return a verdict as text, highlighted as good, doubtful or bad."""
    return Toned(
        word, {"accepted": "good", "unproven": "doubtful", "not": "doubtful"}.get(word.partition(" ")[0], "bad")
    )


@dataclass(frozen=True)
class Column:
    """A column: the value taken from each row, and its format.

    Parameters
    ----------
    value : str, int or callable
        Name or index of the value in the row, or a function of the row.
    form : str
        Python format of numbers, or ``um``: hundredths, or fewer digits on a page where appropriate. Default: text,
        left-aligned; with ``>`` right-aligned.
    whole : bool
        Whether its cells are never wrapped.
    named : bool
        Whether the heading is a name, which no page translates.
    """

    heading: str
    value: str | int | Callable[[Any], object]
    form: str = ""
    unit: str = ""
    whole: bool = False
    named: bool = False

    def text(self, row: Any, *, page: bool = False) -> str:
        """Return the cell of a row as text; an unknown value is empty, or a dash among the numbers of a page."""
        found: Any = self.value(row) if callable(self.value) else row[self.value]
        if page and self.form == "um":
            return in_um(found)
        if found is None or (isinstance(found, float) and not math.isfinite(found)):
            return ""
        if isinstance(found, str):
            return found
        if isinstance(found, float) and self.form == "um":
            return f"{round(found, 2) + 0.0:.2f}"  # avoids -0.00
        return format(found, self.form) if isinstance(found, float) else str(found)


@dataclass(frozen=True)
class Layout:
    """A table: columns, and the rows from which they take their values.

    Parameters
    ----------
    rows : sequence
        Source of the column values: records, tuples or results.
    caption : str
        Meaning of the numbers; a page explains it in its text around the table.
    note : str
        Paragraph below the table.
    tones : dict of int to str
        Highlighted rows, by index: best (the chosen one) or none (no compensation).
    sections : frozenset of int
        Indices of rows with a line above them.
    """

    columns: Sequence[Column]
    rows: Sequence[Any]
    title: str = ""
    caption: str = ""
    note: str = ""
    tones: dict[int, str] | None = None
    sections: frozenset[int] = frozenset()

    def tone(self, row: int) -> str:
        """Return the name of the highlighting of a row; empty if it has none."""
        return (self.tones or {}).get(row, "")


def laid_out(t: Table) -> Layout:
    """Return the layout of a table of results, with its title above it."""
    columns = [
        Column(heading, partial(_cell, j), "" if j in t.words else ">", named=True)
        for j, heading in enumerate(t.columns)
    ]
    return Layout(columns, t.rows, note=t.caption, tones={} if t.marked is None else {t.marked: "best"})


def _cell(place: int, row: Sequence[Cell]) -> str:
    return format_cell(row[place])


def in_um(value: float | None) -> str:
    """Return a number of um as shown on pages: with hundredths below 100 um."""
    if value is None or not math.isfinite(value):
        return "–"
    return f"{round(value, 2) + 0.0:.2f}" if abs(value) < 100 else f"{value:.0f}"  # avoids -0.00


@dataclass(frozen=True)
class PrintedLine:
    """A line of text.

    Parameters
    ----------
    mark : Toned or None
        Highlighted text before the line.
    whole : bool
        Whether the line is not wrapped at the width of the terminal.
    """

    text: str
    mark: Toned | None = None
    whole: bool = False


Item = PrintedLine | Layout
