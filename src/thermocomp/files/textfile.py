"""CSV files: how they are written is found out from the file, then pandas reads the columns asked for."""

import csv
import re
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from thermocomp.core.exceptions import RecordingError
from thermocomp.files.layout import Layout, find_layout, join_units, tell_layout
from thermocomp.files.limits import Limits
from thermocomp.files.mapping import ReadOptions
from thermocomp.files.tables import (
    EMBEDDED,
    MISSING_TEXT,
    check_headings,
    clean_heading,
    is_float,
    not_numbers,
    refuse_cell,
)

#: lines that tell how the file is written; fewer if they are long
_SAMPLE_LINES = 100
_SAMPLE_BYTES = 2 << 20
_CHUNK = 100_000  # rows that are text in memory at a time
_BOM = b"\xef\xbb\xbf"
_MISSING = [text for t in MISSING_TEXT for text in {t, t.upper(), t.capitalize()}] + ["NaN", "-NaN"]
_SEPARATOR = re.compile(rb"(?:\xef\xbb\xbf)?\"?sep=([,;\t| ])\"?\r?\n", re.IGNORECASE)
#: a spreadsheet puts quotation marks around the line
_OWN = (f"# {EMBEDDED}: ".encode(), f'"# {EMBEDDED}: '.encode())
_POINT = re.compile(r"[+-]?\d*\.\d+(?:[eE][+-]?\d+)?")
# pandas before 3.1 may read the last digit wrong unless told
_PANDAS = tuple(int(n) for n in pd.__version__.split(".")[:2])
_EXACT: dict[str, Any] = {} if _PANDAS >= (3, 1) else {"float_precision": "round_trip"}


@dataclass(frozen=True)
class CsvTable:
    """A text file with a heading line; made by `open_csv`. A `thermocomp.files.tables.FileTable`.

    Parameters
    ----------
    path : Path
    headings : tuple of str
    sample : tuple of tuple of str
        Cells of the first rows.
    delimiter : str
        One character; a space stands for any white space.
    decimals : str
        Decimal signs to try, in this order.
    encoding : str
    skipped : tuple of int
        Lines that are no rows (headings, comments, blank ones), from 0.
    n_rows : int
    embedded : str
    notes : tuple of str
    """

    path: Path
    headings: tuple[str, ...]
    sample: tuple[tuple[str, ...], ...]
    delimiter: str
    decimals: str
    encoding: str
    skipped: tuple[int, ...]
    n_rows: int
    embedded: str
    notes: tuple[str, ...] = ()

    def is_number(self, column: int, *, empty: bool = True) -> bool:
        """Return whether the first filled cell of a column is a number; `empty` if the first rows have none."""
        cells = (row[column].strip() for row in self.sample if column < len(row))
        first = next((c for c in cells if c.casefold() not in MISSING_TEXT), None)
        return empty if first is None else is_float(first.replace(",", "."))

    def load(self, numbers: Sequence[int], texts: Sequence[int]) -> pd.DataFrame:
        """Read columns; see `thermocomp.files.tables.FileTable.load`."""
        types: dict[int, Any] = {**dict.fromkeys(texts, str), **dict.fromkeys(numbers, np.float64)}
        options = self._options(types)
        failure: ValueError = ValueError("nothing tried")
        for decimal in self.decimals:
            try:
                with pd.read_csv(self.path, decimal=decimal, **options, **_EXACT) as chunks:
                    frame: pd.DataFrame = pd.concat(chunks, ignore_index=True)
                if len(frame) != self.n_rows:
                    raise RecordingError(
                        f"{self.path}: {self.n_rows} lines give {len(frame)} rows: a quotation mark opens a cell that "
                        "goes over the end of its line; close it, or delete the mark"
                    )
                return frame
            except UnicodeDecodeError as e:
                raise RecordingError(
                    f"{self.path}: is not written in {self.encoding} ({e.reason}); give the right one in a mapping, "
                    "[read] encoding"
                ) from e
            except ValueError as e:
                failure = e
        with suppress(ValueError):  # pandas' own reasons; what is wrong with a cell comes as a RecordingError
            self._refuse_text(numbers, failure)
        raise RecordingError(f"{self.path}: cannot be read as a table: {failure}") from failure

    def place(self, row: int) -> str:
        """Say in which line of the file, counted from 1, a row stands."""
        line = row
        while (shifted := row + bisect_right(self.skipped, line)) != line:
            line = shifted
        return f"line {line + 1}"

    def _options(self, types: dict[int, Any]) -> dict[str, Any]:
        return {
            "sep": r"\s+" if self.delimiter == " " else self.delimiter,
            "header": None,
            "names": range(len(self.headings)),
            "usecols": sorted(types),
            "dtype": types,
            "index_col": False,
            "skiprows": list(self.skipped),
            "skipinitialspace": True,
            "encoding": self.encoding,
            "chunksize": _CHUNK,
            "keep_default_na": False,
            "na_values": {k: [""] if types[k] is str else _MISSING for k in types},
        }

    def _refuse_text(self, numbers: Sequence[int], cause: Exception) -> None:
        """Name the first cell that is not a number; slow, but only met on the way to an error."""
        with pd.read_csv(self.path, **self._options(dict.fromkeys(numbers, str))) as chunks:
            for chunk in chunks:
                bad = np.logical_and.reduce([_not_numbers(chunk, decimal) for decimal in self.decimals])
                if bad.any():
                    row, k = (int(v) for v in np.argwhere(bad)[0])
                    column: Any = chunk.columns[k]
                    refuse_cell(self, str(self.path), int(chunk.index[row]), column, chunk.iloc[row, k], cause)


def open_csv(path: Path, options: ReadOptions, limits: Limits = Limits()) -> CsvTable:
    """Find out how a text file is written: one pass over its lines, none of which is kept.

    Parameters
    ----------
    path : Path
    options : ReadOptions
        What is known beforehand.
    limits : Limits

    Raises
    ------
    RecordingError
        Empty, binary, no heading line, no rows, one column, rows of unequal length, or over a limit.
    """
    skipped: list[int] = []
    top = options.heading - 1
    content = partial(_content, path, options, limits=limits, returns=_refuse_binary(path))
    first = _sample(content([]), top)
    if not first:
        raise RecordingError(f"{path}: the file is empty; a recording has a heading line and rows of numbers below it")
    sample = [line.decode("utf-8" if _is_utf8(line) else "latin-1") for _, line in first]
    delimiter, layout = _find_table(path, sample, options.delimiter or _separator(path), limits)
    ending = delimiter.encode()
    heading, begin = first[layout.heading][1], 1 + max(layout)
    plain = delimiter != " "
    width, is_utf8, n_rows, long = _cells(heading, delimiter), True, -begin, limits.cell_characters
    for number, line in content(skipped):
        is_utf8 = is_utf8 and (line.isascii() or _is_utf8(line))
        n_rows += number >= top
        if n_rows <= 0:  # what stands above the rows
            skipped.append(number)
            continue
        cells = line.count(ending) + 1 if plain and b'"' not in line else _cells(line, delimiter)
        if n_rows == 1 and cells == width + 1 and line.rstrip(b" \r\n").endswith(ending):
            width += 1  # a logger that ends its rows, but not the heading line, with the delimiter
        if cells != width:
            text = _ragged(path, number + 1, cells, width, line, delimiter)
            raise RecordingError(text, [{"read": {"skip": [number + 1]}}])
        if len(line) > long:
            most = max(map(len, _split(line.decode("latin-1"), delimiter)))
            limits.check("cell_characters", most, f"{path}: line {number + 1}")
    encoding = options.encoding or ("utf-8" if is_utf8 else "latin-1")
    try:
        headings = [clean_heading(h) for h in _split(heading.decode(encoding), delimiter)]
    except UnicodeDecodeError as e:
        raise RecordingError(f"{path}: the heading line is not written in {encoding}: {e.reason}") from e
    headings += [""] * (width - len(headings))
    check_headings(path, headings, n_rows, limits)
    if layout.units > layout.heading:
        headings = join_units(headings, _split(first[layout.units][1].decode(encoding), delimiter))
    rows = tuple(tuple(_split(line, delimiter)) for line in sample[begin:])
    return CsvTable(
        path=path,
        headings=tuple(headings),
        sample=rows,
        delimiter=delimiter,
        decimals=options.decimal or _sniff_decimal(rows, delimiter),
        encoding=encoding,
        skipped=tuple(skipped),
        n_rows=n_rows,
        embedded=_embedded(path, limits),
        notes=tell_layout([number + 1 for number, _ in first], layout, "line"),
    )


def _sample(content: Iterator[tuple[int, bytes]], top: int) -> list[tuple[int, bytes]]:
    """Return the first lines; a few at least, however long they are."""
    found: list[tuple[int, bytes]] = []
    size = 0
    for number, line in content:
        if number >= top:
            found.append((number, line))
            size += len(line)
            if len(found) == _SAMPLE_LINES or (size > _SAMPLE_BYTES and len(found) >= 8):
                break
    return found


def _content(
    path: Path, options: ReadOptions, skipped: list[int], *, limits: Limits, returns: bool
) -> Iterator[tuple[int, bytes]]:
    """Yield number and text of each line that is neither blank nor a comment; tell the others in `skipped`."""
    blank = b' \t\r\n",;|'  # a spreadsheet's empty rows: ;;;;
    comment, most = options.comment.encode(), limits.line_bytes
    with path.open("rb") as f:
        for number, raw in enumerate(iter(partial(f.readline, most + 1), b"")):
            if len(raw) > most:
                limits.check("line_bytes", len(raw), f"{path}: line {number + 1}")
            line = raw.removeprefix(_BOM) if number == 0 else raw
            if returns and line.count(b"\r") > line.endswith(b"\r\n"):  # pandas would count lines otherwise than we do
                raise RecordingError(
                    f"{path}: line {number + 1} holds a carriage return that does not end it, as in files of old "
                    "Macintoshes; save the file with the line ends of Unix or Windows"
                )
            if number and line[:1].isalnum() and line[:1] != comment[:1] and not options.skip:
                yield number, line
                continue
            text = line.lstrip()
            remark = (comment and text.startswith(comment)) or (
                number == 0 and (text.startswith(_OWN) or _SEPARATOR.fullmatch(raw))
            )
            if remark or not text.strip(blank) or options.skips(number + 1):
                skipped.append(number)
                limits.check("skipped_lines", len(skipped), path)
            else:
                yield number, line


def _embedded(path: Path, limits: Limits) -> str:
    """Return the description that thermocomp writes into the first line of its own files."""
    with path.open("rb") as f:
        line = f.readline(limits.line_bytes).removeprefix(_BOM)
    if not line.startswith(_OWN):
        return ""
    text = line.decode("utf-8", "replace").rstrip(" \t\r\n,;|")
    if text.startswith('"'):
        text = _split(text, ";")[0]
    return text.partition(": ")[2].strip()


def _refuse_binary(path: Path) -> bool:
    """Refuse what is no text; return whether there are carriage returns that end no line."""
    kinds = {b"PK\x03\x04": "a workbook or zip file", b"PAR1": "a Parquet file", b"\x1f\x8b": "a gzip file"}
    returns, last = 0, b""
    with path.open("rb") as f:
        while block := f.read(1 << 20):
            if not last and block.startswith((b"\xff\xfe", b"\xfe\xff")):
                raise RecordingError(f"{path}: is written in UTF-16; save it as UTF-8 (in a spreadsheet: CSV UTF-8)")
            kind = "" if last else next((k for magic, k in kinds.items() if block.startswith(magic)), "")
            if kind or b"\x00" in block:
                raise RecordingError(
                    f"{path}: is not text but {kind or 'binary'}; export the recording as CSV, or correct the file's "
                    "ending"
                )
            returns += block.count(b"\r") - block.count(b"\r\n") - (last == b"\r" and block.startswith(b"\n"))
            last = block[-1:]
    return returns > 0


def _find_table(path: Path, lines: Sequence[str], delimiter: str, limits: Limits) -> tuple[str, Layout]:
    """Choose the delimiter, unless it is given, under which most rows have as many cells as the headings."""
    best, best_layout, best_fit = delimiter or ",", Layout(0, 0), (False, 0.0, 0)
    widest = 0
    for tried in delimiter or "\t;|, ":
        if tried == " " and not delimiter:  # it stands inside headings and timestamps too: the last resort
            if best_fit > (False, 0.0, 0):
                continue
            limits.check("columns", widest, path)
        cells = max(line.count(tried) for line in lines) + 1
        if cells > limits.columns + 1:  # one more may be empty
            widest = max(widest, cells)
            continue
        rows = [_split(line, tried) for line in lines]
        found = find_layout(rows)
        layout = found or Layout(0, 0)
        width = len(rows[layout.heading])
        fits = [len(row) in (width, width + 1) for row in rows[1 + max(layout) :]]
        fit = (found is not None, sum(fits) / len(fits) if fits else 1.0, width)
        if delimiter or (width > 1 and fit > best_fit and (fit[1] > 0 or tried != " ")):
            best, best_layout, best_fit = tried, layout, fit
    if best_fit == (False, 0.0, 0):
        limits.check("columns", widest, path)
    return best, best_layout


def _separator(path: Path) -> str:
    """Return the delimiter that a spreadsheet writes into the first line of a file (``sep=;``), if it does."""
    with path.open("rb") as f:
        found = _SEPARATOR.fullmatch(f.readline(16))
    return found[1].decode() if found else ""


def _sniff_decimal(rows: Sequence[Sequence[str]], delimiter: str) -> str:
    if delimiter == ",":
        return "."
    cells = [c.strip() for row in rows for c in row]
    points = sum(_POINT.fullmatch(c) is not None for c in cells)
    commas = sum("." not in c and _POINT.fullmatch(c.replace(",", ".", 1)) is not None for c in cells)
    if points == commas == 0:
        return ".,"  # whole numbers so far: try both
    return "," if commas > points else "."


def _split(line: str, delimiter: str) -> list[str]:
    if delimiter == " ":
        return re.split("[ \t]+", line.strip(" \t\r\n"))  # str.split takes more for white space than pandas
    try:
        return next(csv.reader([line.rstrip("\r\n")], delimiter=delimiter, skipinitialspace=True))
    except csv.Error:  # a cell is larger than the reader takes: no number and no name is
        return line.rstrip("\r\n").split(delimiter)


def _cells(line: bytes, delimiter: str) -> int:
    if delimiter == " " or b'"' in line:
        return len(_split(line.decode("latin-1"), delimiter))
    return line.count(delimiter.encode()) + 1


def _ragged(path: Path, number: int, cells: int, width: int, line: bytes, delimiter: str) -> str:
    start = line[:60].decode("latin-1").strip()
    text = f"{path}: line {number} has {cells} cells where the heading has {width}: {start!r}"
    if delimiter == "," and cells > width:
        return f"{text}; if it has decimal commas, export with ';' between the columns"
    if not line.endswith(b"\n"):
        return f"{text}; it is the last line, perhaps cut off while it was written: complete or delete it"
    return f"{text}; complete or delete the line"


def _not_numbers(cells: pd.DataFrame, decimal: str) -> Any:
    if decimal == ",":
        # a point is no part of a number where the comma is the decimal sign
        cells = cells.apply(lambda c: c.str.replace(".", "?", regex=False).str.replace(",", ".", regex=False))
    return cells.apply(not_numbers).to_numpy()


def _is_utf8(line: bytes) -> bool:
    try:
        line.decode("utf-8")
    except UnicodeDecodeError:
        return False
    return True
