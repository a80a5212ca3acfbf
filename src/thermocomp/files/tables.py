"""Raw tables, their cells not yet understood: what all kinds of files share."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn, Protocol

import numpy as np
import pandas as pd

from thermocomp.core.exceptions import RecordingError
from thermocomp.files.limits import Limits

#: before thermocomp's own description of the columns, as a comment line or a Parquet attribute
EMBEDDED = "thermocomp"

#: texts that stand for a missing value, besides an empty cell
MISSING_TEXT = ("", "nan", "na", "n/a", "none", "null", "#n/a", "<na>", "-nan")

#: what a spreadsheet calculates, perhaps behind apostrophes
_FORMULA = re.compile(r"'*[=+\-@\t\r\n\u240d\u240a]")
_LINE_ENDS, _LINE_SIGNS = {13: "\u240d", 10: "\u240a"}, {0x240D: "\r", 0x240A: "\n"}
#: heading of an index that had none
_NAMELESS = re.compile(r"Unnamed: \d+")


class FileTable(Protocol):
    """The cells of a file before anybody knows what its columns mean."""

    @property
    def headings(self) -> tuple[str, ...]:
        """Stripped headings; empty where there is none."""

    @property
    def embedded(self) -> str:
        """JSON of the mapping that thermocomp wrote into the file; empty if there is none."""

    @property
    def notes(self) -> tuple[str, ...]:
        """What a user should know."""

    def is_number(self, column: int, *, empty: bool = True) -> bool:
        """Return whether the first filled cell of a column is a number; `empty` if there is none."""

    def load(self, numbers: Sequence[int], texts: Sequence[int]) -> pd.DataFrame:
        """Read some columns, as float64 and as they are; the table's columns are named by position.

        Raises
        ------
        RecordingError
            A cell of `numbers` holds text.
        """

    def place(self, row: int) -> str:
        """Say where a row stands in the file, such as ``line 7``."""


@dataclass(frozen=True)
class FrameTable:
    """A sheet, which arrives as a whole.

    Parameters
    ----------
    source : str
        The file, for messages.
    headings : tuple of str
    frame : DataFrame
        Cells as they are; columns named by position.
    rows : sequence of int
        Row in the file of each row of `frame`, from 1.
    embedded : str
    notes : tuple of str
    """

    source: str
    headings: tuple[str, ...]
    frame: pd.DataFrame
    rows: Sequence[int]
    embedded: str = ""
    notes: tuple[str, ...] = ()

    def is_number(self, column: int, *, empty: bool = True) -> bool:
        """Return whether the first filled cell of a column is a number; `empty` if there is none."""
        return first_is_number(self.frame[column], empty=empty)

    def load(self, numbers: Sequence[int], texts: Sequence[int]) -> pd.DataFrame:
        """Read columns; see `Table.load`."""
        data = {k: self.frame[k] for k in texts}
        for k in numbers:
            data[k] = load_column(self, self.source, self.frame[k], k)
        return pd.DataFrame(data, copy=False)

    def place(self, row: int) -> str:
        """Say in which row of the sheet or file, counted from 1, a row stands."""
        return f"row {self.rows[row]}"


def first_is_number(cells: "pd.Series[Any]", *, empty: bool) -> bool:
    """Return whether the first filled cell is a number.

    Parameters
    ----------
    cells : Series
    empty : bool
        What to return if there is none.
    """
    filled = cells.dropna()
    return empty if filled.empty else is_float(str(filled.iloc[0]))


def load_column(
    table: FileTable, source: str, cells: "pd.Series[Any]", column: int, first: int = 0
) -> "pd.Series[float]":
    """Return the cells of a column as numbers.

    Parameters
    ----------
    table : FileTable
    source : str
        The file.
    cells : Series
    column : int
        Its position in `table`.
    first : int
        Row of the table that the first cell stands in.

    Raises
    ------
    RecordingError
        One of them is no number.
    """
    if cells.dtype == np.float64:
        return cells
    bad = not_numbers(cells).to_numpy()
    if bad.any():
        row = int(np.flatnonzero(bad)[0])
        refuse_cell(table, source, first + row, column, cells.iloc[row])
    return pd.to_numeric(cells, errors="coerce").astype(np.float64)


def clean_heading(cell: object) -> str:
    """Return a heading as it was before other programs had it.

    White space at its ends is gone, the name that pandas gives an index without one, and the apostrophe before what a
    spreadsheet would calculate (`defuse`).

    Parameters
    ----------
    cell : object
    """
    text = restore(str(cell).strip())
    return "" if _NAMELESS.fullmatch(text) else text


def defuse(text: str) -> str:
    """Return a text that no spreadsheet takes for a formula when it opens a CSV file, on one line.

    An apostrophe stands before ``=``, ``+``, ``-``, ``@``, a tab or a line's end; line ends become the signs for them.
    `restore` turns it back.

    Parameters
    ----------
    text : str
        A heading or a label.
    """
    return f"'{text}".translate(_LINE_ENDS) if _FORMULA.match(text) else text.translate(_LINE_ENDS)


def restore(text: str) -> str:
    """Turn back what `defuse` did.

    Parameters
    ----------
    text : str
        A heading or a label of a file.
    """
    return (text[1:] if text.startswith("'") and _FORMULA.match(text) else text).translate(_LINE_SIGNS)


def check_headings(path: Path, headings: Sequence[str], n_rows: int, limits: Limits) -> None:
    """Refuse a table that cannot be a recording, whatever its columns mean.

    Parameters
    ----------
    path : Path
    headings : sequence of str
    n_rows : int
        Without that of the headings.
    limits : Limits

    Raises
    ------
    RecordingError
        No headings, numbers instead of headings, one column, no rows, or over a limit.
    """
    limits.check_table(n_rows, len(headings), path)
    limits.check("heading_characters", max(map(len, headings), default=0), path)
    filled = [h for h in headings if h.strip()]
    if not filled:
        raise RecordingError(f"{path}: no heading line; a recording has headings such as time_s,t1_C,drift_um")
    if all(is_float(h.replace(",", ".")) for h in filled):
        raise RecordingError(
            f"{path}: the first row holds numbers ({', '.join(filled[:3])} ...); put a heading line before it, such as "
            "time_s,t1_C,drift_um"
        )
    if len(filled) < 2:
        raise RecordingError(
            f"{path}: only one column, {filled[0]!r}; a recording needs a time and at least one channel. If a CSV file "
            'has another delimiter than , ; | tab or white space: give it in a mapping, [read] delimiter = "..."'
        )
    if n_rows < 1:
        raise RecordingError(f"{path}: a heading line but no rows below it; the recording is empty")


def refuse_cell(
    table: FileTable, source: str, row: int, column: int, cell: object, cause: Exception | None = None
) -> NoReturn:
    """Tell which cell holds text where a number belongs.

    Parameters
    ----------
    table : FileTable
    source : str
        The file.
    row, column : int
        Position of the cell in `table`.
    cell : object
        What it holds.
    cause : Exception, optional
        What it was noticed by.

    Raises
    ------
    RecordingError
        Always.
    """
    raise RecordingError(
        f"{source}: {table.place(row)}, column {table.headings[column]!r}: {str(cell)!r} is not a number; correct the "
        'cell, leave it empty for a missing value, or leave the column out by a mapping with role = "ignore"'
    ) from cause


def not_numbers(cells: "pd.Series[Any]") -> "pd.Series[bool]":
    """Return where a cell is filled with something that is not a number."""
    filled = cells.notna()
    if pd.api.types.is_datetime64_any_dtype(cells.dtype):
        return filled
    bad = filled & pd.to_numeric(cells, errors="coerce").isna()
    if bad.any():
        bad &= ~cells.astype(str).str.strip().str.casefold().isin(MISSING_TEXT)
    return bad


def is_float(text: str) -> bool:
    """Return whether a text is a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True
