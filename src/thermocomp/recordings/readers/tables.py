"""Raw tables with uninterpreted cells: common part of all file formats."""

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pandas as pd

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.exceptions import RecordingError, Remedy
from thermocomp.core.messages import Message, join
from thermocomp.recordings.readers.cellunits import strip_units
from thermocomp.recordings.readers.limits import FileLimits
from thermocomp.recordings.readers.numbers import Notation, Signs, is_filler, is_number_like, is_word

#: key of the column description embedded by thermocomp, in a comment line or a Parquet attribute
EMBEDDED = "thermocomp"
#: maximum number of cells used to determine the kind of a column
HEAD = 100
#: maximum number of cell locations listed
_MOST_TOLD = 40
_UNGROUPED = re.compile(r"[-+]?\d{4}")

#: a word or a phrase, and the most frequent occurrence of unknown ones among the numbers of a column
_WORDS = re.compile(r"[^\W\d_]{2}[^\d]*")
_RARE = 0.1
#: start of a text that a spreadsheet evaluates, optionally after apostrophes
_FORMULA = re.compile(r"'*[=+\-@\t\r\n\u240d\u240a]")
_LINE_ENDS, _LINE_SIGNS = {13: "\u240d", 10: "\u240a"}, {0x240D: "\r", 0x240A: "\n"}
#: heading that pandas gives to an index without one
_NAMELESS = re.compile(r"Unnamed: \d+")


@dataclass(frozen=True)
class FileTable(ABC):
    """The cells of a file before the meaning of its columns is determined.

    Parameters
    ----------
    path : Path
        Path of the file, for messages.
    headings : tuple of str
        Stripped headings; empty where there is none.
    embedded : str
        JSON of the mapping that thermocomp wrote into the file; empty if there is none.
    decimal : str
        Decimal sign of numbers stored as text, if it is known beforehand.
    notes : tuple of str
        Notes for the user.
    above : tuple of tuple of str
        Rows of text around the headings.
    again : tuple of int
        Line numbers (1-based) of repeated headings.
    units : dict of int to str
        Units of the columns in whose cells a unit follows the number.
    words : frozenset of str
        Further texts that denote a missing number, in lower case.
    """

    path: Path
    headings: tuple[str, ...]
    embedded: str = field(default="", kw_only=True)
    decimal: str = field(default="", kw_only=True)
    notes: tuple[str, ...] = field(default=(), kw_only=True)
    above: tuple[tuple[str, ...], ...] = field(default=(), kw_only=True)
    again: tuple[int, ...] = field(default=(), kw_only=True)
    units: dict[int, str] = field(default_factory=dict, kw_only=True)
    words: frozenset[str] = field(default=frozenset(), kw_only=True)

    @abstractmethod
    def is_number(self, column: int, *, empty: bool = True) -> bool:
        """Return whether the first non-empty cell of a column is a number; `empty` if there is none."""

    @abstractmethod
    def head(self, column: int) -> list[str]:
        """Return the first non-empty cells of a column as text; none for a column of a numeric type."""

    @abstractmethod
    def load(self, numbers: Sequence[int], texts: Sequence[int]) -> tuple[pd.DataFrame, tuple[str, ...]]:
        """Read columns as float64 and as text, and return notes on the conversions.

        The columns of the returned table are named by position.
        """

    @abstractmethod
    def place(self, row: int) -> str:
        """Return the location of a row in the file, such as ``line 7``."""

    def bare(self, column: int, cells: "pd.Series[Any]") -> "pd.Series[Any]":
        """Return cells of a column without their units."""
        return strip_units(cells, self.units[column]) if column in self.units else cells


@dataclass(frozen=True)
class FrameTable(FileTable):
    """A sheet that is read as a whole.

    Parameters
    ----------
    path, headings
        See `FileTable`.
    frame : DataFrame
        Unconverted cells; columns named by position.
    rows : sequence of int
        Row number in the file (1-based) of each row of `frame`.
    embedded, decimal, notes
        See `FileTable`.
    """

    frame: pd.DataFrame
    rows: Sequence[int]

    def is_number(self, column: int, *, empty: bool = True) -> bool:
        """Return whether the first non-empty cell of a column is a number; `empty` if there is none."""
        return column in self.units or first_is_number(self.frame[column], empty=empty)

    def head(self, column: int) -> list[str]:
        """Return the first non-empty cells of a column; see `FileTable.head`."""
        return first_texts(self.frame[column])

    def load(self, numbers: Sequence[int], texts: Sequence[int]) -> tuple[pd.DataFrame, tuple[str, ...]]:
        """Read columns; see `FileTable.load`."""
        data = {k: self.frame[k] for k in texts}
        written = {k: self.frame[k] for k in numbers if not pd.api.types.is_numeric_dtype(self.frame[k].dtype)}
        values, notes = convert_all(self, written, self.decimal)
        for k in numbers:
            data[k] = pd.Series(values[k] if k in written else as_floats(self.frame[k]))
        return pd.DataFrame(data, copy=False), notes

    def place(self, row: int) -> str:
        """Return the location of a row in the sheet or file (1-based)."""
        return Message("row {first}", first=int(self.rows[row]))


def first_is_number(cells: "pd.Series[Any]", *, empty: bool) -> bool:
    """Return whether the first non-empty cell is a number."""
    filled = (str(cell) for cell in cells.dropna())
    first = next((cell for cell in filled if not is_filler(cell)), None)
    return empty if first is None else is_number_like(first)


def first_texts(cells: "pd.Series[Any]") -> list[str]:
    """Return the first non-empty cells of a column as text; none for a numeric column."""
    if pd.api.types.is_numeric_dtype(cells.dtype):
        return []
    return [text for text in map(str, cells.iloc[:HEAD].dropna()) if not is_filler(text)]


def as_floats(cells: "pd.Series[Any]") -> FloatArray:
    """Return the cells of a numeric column as floats; NaN where a cell is empty."""
    return cells.to_numpy(dtype=np.float64, na_value=np.nan)


def clean_heading(cell: object) -> str:
    """Return a heading without the changes made by other programs.

    Removed are white space at both ends, the pandas name of an index without heading, and the apostrophe before a text
    that a spreadsheet would evaluate (`defuse`).
    """
    text = restore(str(cell).strip())
    return "" if _NAMELESS.fullmatch(text) else text


def defuse(text: str) -> str:
    """Return a single-line text that no spreadsheet evaluates as a formula when it opens a CSV file.

    An apostrophe is put before ``=``, ``+``, ``-``, ``@``, a tab or a line end; line ends are replaced by visible
    symbols. `restore` reverses this.
    """
    return f"'{text}".translate(_LINE_ENDS) if _FORMULA.match(text) else text.translate(_LINE_ENDS)


def restore(text: str) -> str:
    """Reverse the changes of `defuse`."""
    return (text[1:] if text.startswith("'") and _FORMULA.match(text) else text).translate(_LINE_SIGNS)


def check_headings(path: Path, headings: Sequence[str], n_rows: int, limits: FileLimits) -> None:
    """Reject a table that cannot be a recording, whatever the meaning of its columns."""
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


def refuse_cell(table: FileTable, row: int, column: int, cell: object, *, often: bool = False) -> NoReturn:
    """Raise the error for a cell that contains text where a number is expected; `often`: so do other rows."""
    heading = table.headings[column]
    word: list[Remedy] = [{"read": {"missing": [str(cell).strip()]}}] if _is_text(cell) else []
    raise RecordingError(
        f"{table.path}: {table.place(row)}, column {heading!r}: {str(cell)!r} is not a number; correct the cell, leave "
        'it empty for a missing value, or leave the column out by a mapping with role = "ignore"',
        [*([] if often and word else [skip_row(table, row)]), *word, {"columns": {heading: {"role": "ignore"}}}],
    )


def _is_text(cell: object) -> bool:
    """Return whether a cell is a word or a phrase, which cannot be a mistyped number."""
    return isinstance(cell, str) and _WORDS.fullmatch(cell.strip()) is not None


def skip_row(table: FileTable, row: int) -> Remedy:
    """Return the mapping entry that skips a row."""
    return {"read": {"skip": [int(table.place(row).split()[-1])]}}


def decide(signs: Signs, stated: str, delimiter: str, path: Path) -> Notation:
    """Return the number format of a file; see `thermocomp.recordings.readers.numbers.Signs.decide`."""
    try:
        return signs.decide(stated, delimiter) or Notation(".")
    except RecordingError as e:
        raise RecordingError(f"{path}: {e}", e.remedies) from e


def convert_all(
    table: FileTable, columns: Mapping[int, "pd.Series[Any]"], decimal: str
) -> tuple[dict[int, FloatArray], tuple[str, ...]]:
    """Read the numbers of text columns, all in one notation; see `convert`."""
    signs = Signs()
    columns = {k: table.bare(k, cells) for k, cells in columns.items()}
    for cells in columns.values():
        signs.add(cell for cell in cells if isinstance(cell, str))
    notation = decide(signs, decimal, "", table.path)
    values, notes = dict[int, FloatArray](), list[str]()
    for k, cells in columns.items():
        values[k], found = convert(table, k, cells, notation)
        notes += found
    return values, (*tell_notation(notation), *notes)


def tell_notation(notation: Notation) -> tuple[str, ...]:
    """Return the number format as text if it differs from that of Python."""
    notes: tuple[str, ...] = (Message("the decimal sign is a comma"),) if notation.decimal == "," else ()
    if notation.thousands:
        marks = join(list(map(repr, notation.thousands)), Message(" or "))
        notes += (Message("thousands are separated by {marks}", marks=marks),)
    return notes


def convert(
    table: FileTable, column: int, cells: "pd.Series[Any]", notation: Notation
) -> tuple[FloatArray, tuple[str, ...]]:
    """Read the numbers of a text column.

    Parameters
    ----------
    cells : Series
        Numbers, texts, and None in empty cells.

    Returns
    -------
    values : ndarray of shape (n_rows,)
        NaN where a word denotes a missing number.
    """
    values, odd = read_plain(cells, notation.decimal)
    words: dict[str, list[int]] = {}
    unknown: list[int] = []
    grouped = -1
    for row in np.flatnonzero(odd):
        cell = cells.iloc[row]
        number = notation.read(cell) if isinstance(cell, str) else None
        if number is not None:
            values[row] = number
            if grouped < 0 and any(s in cell.strip() for s in notation.thousands):
                grouped = int(row)
        elif not isinstance(cell, str) or not (is_filler(cell) or cell.strip().casefold() in table.words):
            if not _is_text(cell):
                refuse_cell(table, int(row), column, cell)
            unknown.append(int(row))
            words.setdefault(cell.strip(), []).append(int(row))
        elif is_word(cell) or cell.strip().casefold() in table.words:
            words.setdefault(cell.strip(), []).append(int(row))
    if len(unknown) > _RARE * len(cells):
        refuse_cell(table, unknown[0], column, cells.iloc[unknown[0]], often=len(unknown) > 1)
    if grouped >= 0:
        _refuse_mixed(table, column, cells, grouped)
    return values, tuple(
        Message(
            "{name}: {word!r}, taken as missing, in {n} of {of} cells: {places}",
            name=table.headings[column],
            word=word,
            n=len(rows),
            of=len(cells),
            places=tell_places(rows, table.place),
        )
        for word, rows in words.items()
    )


def read_plain(cells: "pd.Series[Any]", decimal: str) -> tuple[FloatArray, BoolArray]:
    """Return numbers without thousands separators, and a mask of the cells with any other content."""
    filled = cells.notna().to_numpy()
    texts = cells.map(lambda c: isinstance(c, str)).to_numpy(dtype=np.bool_) if cells.dtype == object else filled
    plain = cells
    if decimal == "," and texts.any():
        # a point cannot be part of a number if the decimal sign is a comma
        swapped = cells[texts].astype("str").str.replace(".", "?", regex=False).str.replace(",", ".", regex=False)
        plain = cells.astype(object).where(~texts, swapped)
    good = pd.to_numeric(plain, errors="coerce").notna().to_numpy() & filled
    if cells.dtype == object:  # True counts as a number
        good &= ~cells.map(lambda c: isinstance(c, bool | np.bool_)).to_numpy(dtype=np.bool_)
    values = np.full(len(cells), np.nan)
    # exact to the last digit, which pandas does not guarantee
    values[good] = plain[good].to_numpy(dtype=object).astype(np.float64)
    return values, filled & ~good


def tell_places(rows: Sequence[int], place: Callable[[int], str]) -> str:
    """List the locations of rows, limited in number."""
    told = join([place(int(k)) for k in rows[:_MOST_TOLD]], ", ")
    return Message("{places} ...", places=told) if len(rows) > _MOST_TOLD else told


def _refuse_mixed(table: FileTable, column: int, cells: "pd.Series[Any]", grouped: int) -> None:
    """Reject thousands with and without separator in one column, because the separator may be a decimal sign."""
    for row, cell in enumerate(cells):
        if isinstance(cell, str) and _UNGROUPED.match(cell.strip()):
            raise RecordingError(
                f"{table.path}: column {table.headings[column]!r}: {table.place(grouped)} has {cells.iloc[grouped]!r} "
                f"with a thousands separator, {table.place(row)} has {cell!r} without; write both in one way"
            )


def is_float(text: str) -> bool:
    """Return whether a text is a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True
