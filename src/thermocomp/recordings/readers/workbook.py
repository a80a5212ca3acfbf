"""Workbooks (XLSX, ODS): sheets are streamed, after a check of their unzipped size."""

import math
import re
import warnings
import zipfile
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import ExitStack, closing
from datetime import date, datetime, time
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from thermocomp.core.exceptions import InputError, MissingExtraError, RecordingError
from thermocomp.core.messages import Message
from thermocomp.recordings.headings import is_time_name
from thermocomp.recordings.readers.layout import (
    MOST_REMARKS,
    FileLayout,
    find_columns,
    find_end,
    find_layout,
    find_rest,
    find_timed,
    is_row,
    join_units,
    tell_end,
    tell_layout,
)
from thermocomp.recordings.readers.limits import FileLimits
from thermocomp.recordings.readers.mapping import ReadOptions
from thermocomp.recordings.readers.tables import FrameTable, check_headings, clean_heading
from thermocomp.recordings.readers.unzipped import check_unzipped

#: maximum number of rows used to find the start of a table; fewer if they are wide or empty
_SAMPLE = 100
_SAMPLE_CELLS = 10_000
_SAMPLE_PLACES = 10_000
#: number of rows of a table with times that may be a recording, however long the tables of other sheets are
_SHORT = 10
#: maximum number of cells stored as objects; further ones are converted to numbers
_CHUNK = 200_000
#: number of bits of an integer that is too large for a float
_LARGE = 1024
_OFFICE, _TABLE, _TEXT = (
    f"{{urn:oasis:names:tc:opendocument:xmlns:{part}:1.0}}" for part in ("office", "table", "text")
)
_SPAN = re.compile(r"PT(\d+)H(\d+)M(\d+)(?:[.,](\d+))?S")

Row = tuple[Any, ...]
Column = NDArray[Any]
Sheets = dict[str, Callable[[], Generator[Row]]]


def open_workbook(path: Path, options: ReadOptions, limits: FileLimits) -> FrameTable:
    """Open the sheet of a workbook that contains a recording."""
    try:
        check_unzipped(path, limits)
        with ExitStack() as stack:
            stack.enter_context(warnings.catch_warnings(action="ignore"))  # about styles and similar
            sheets = _sheets(path, stack, limits)
            limits.check("sheets", len(sheets), path)
            name, notes = _choose(path, sheets, options)
            return _table(path, name, stack.enter_context(closing(sheets[name]())), notes, options, limits)
    except ImportError as e:
        raise MissingExtraError("study", "openpyxl") from e
    except (InputError, OSError):
        raise
    except Exception as e:  # any error that a damaged file causes in two parsers
        raise RecordingError(
            f"{path}: this is not a workbook, or a damaged one ({type(e).__name__}: {e}); save it again"
        ) from e


def list_sheets(path: Path, limits: FileLimits) -> list[str]:
    """Return the names of the sheets of a workbook."""
    check_unzipped(path, limits)
    with ExitStack() as stack:
        stack.enter_context(warnings.catch_warnings(action="ignore"))
        return [*_sheets(path, stack, limits)]


def _sheets(path: Path, stack: ExitStack, limits: FileLimits) -> Sheets:
    return _ods_sheets(path, limits) if path.suffix.lower() == ".ods" else _xlsx_sheets(path, stack, limits)


def _choose(path: Path, sheets: Sheets, options: ReadOptions) -> tuple[str, tuple[str, ...]]:
    """Return the name of the sheet to read, and a note on it."""
    names = ", ".join(map(repr, sheets))
    if options.sheet:
        if options.sheet not in sheets:
            raise RecordingError(f"{path}: mapping [read]: there is no sheet {options.sheet!r}; there are {names}")
        return options.sheet, ()
    first = next(iter(sheets), None)
    if first is None:
        raise RecordingError(
            f"{path}: all sheets of the workbook are empty; a recording has a heading row and rows of numbers"
        )
    if len(sheets) == 1:
        return first, ()
    sizes = {}
    for name, open_rows in sheets.items():
        with closing(open_rows()) as rows:
            sizes[name] = _count_rows(_sample(rows))
    most = max(rows for rows, _ in sizes.values())
    likely = [
        name for name, (rows, timed) in sizes.items() if rows and (2 * rows >= most or (timed and rows >= _SHORT))
    ]
    if len(likely) > 1:
        raise RecordingError(
            f"{path}: the sheets {', '.join(map(repr, likely))} all hold a table; state which in a mapping, such as "
            f'[read] sheet = "{likely[0]}"',
            [{"read": {"sheet": name}} for name in likely],
        )
    name = likely[0] if likely else first
    return name, (Message("sheet {name!r} of {names} is read", name=name, names=names),)


def _count_rows(rows: Sequence[Sequence[str]]) -> tuple[int, bool]:
    """Count the rows of a table of two or more columns of values, and return whether it has times.

    Names with one value each are no table, but a cover sheet.
    """
    layout = find_layout(rows)
    if layout is None:
        return 0, False
    body = rows[layout.begin :]
    columns, timed = find_columns(body)[1], find_timed(body)
    count = sum(is_row(row, columns, timed) for row in body) if len(columns) > 1 else 0
    return count, bool(timed) or any(map(is_time_name, rows[layout.heading]))


def _sample(rows: Iterable[Row]) -> list[list[str]]:
    """Return the first rows as text, all of them as wide as the widest, as in a text file."""
    found: list[list[str]] = []
    cells = 0
    for place, row in enumerate(rows):
        if _holds_cells(row):
            found.append([_text(cell) for cell in row])
            cells += len(row)
        if len(found) == _SAMPLE or (cells > _SAMPLE_CELLS and len(found) >= 4) or place > _SAMPLE_PLACES:
            break
    width = max(map(len, found), default=0)
    return [row + [""] * (width - len(row)) for row in found]


def _table(
    path: Path, name: str, rows: Iterator[Row], notes: tuple[str, ...], options: ReadOptions, limits: FileLimits
) -> FrameTable:
    """Return the table of a sheet: its heading row, and the rows below it."""
    where = f"{path}: sheet {name!r}"
    places, first, body, cells = list[int](), list[Row](), _Body(), 0
    tail = deque[Row](maxlen=MOST_REMARKS)
    for place, row in enumerate(rows, 1):
        limits.check("sheet_rows", place, where)
        if not _holds_cells(row) or place < options.heading or options.skips(place):
            continue
        cells += len(row)
        if len(row) > limits.columns:
            limits.check("columns", len(row), f"{where}, row {place}")
        limits.check("cells", cells, where)
        places.append(place)
        tail.append(row)
        if len(first) < _SAMPLE:
            first.append(row)
        else:
            body.add(row)
            if not len(places) % 1000:
                limits.check_unpacked(8 * cells, path)
    if not first:
        raise RecordingError(f"{where} is empty; a recording has a heading row and rows of numbers")
    layout = find_layout(_sample(first)) or FileLayout(0, 0, 1)
    begin = layout.begin
    headings = [_text(cell).strip() for cell in first[layout.heading]]
    above = find_rest([[*map(_text, row)] for row in first[:begin]], layout)
    if layout.units != layout.heading:
        units, *below = ([_text(cell) for cell in row] for row in (first[layout.units], *first[begin:]))
        headings = join_units(headings, units, below, where, places[layout.units])
    remarks = _count_remarks(first[begin:], list(tail)[-max(len(places) - begin, 1) :])
    columns = body.close(first[begin:])
    n_rows = len(places) - begin - remarks
    headings += [""] * (len(columns) - len(headings))
    headings = [clean_heading(h) for h in headings]
    check_headings(path, headings, n_rows, limits)
    empty = np.full(n_rows, np.nan)
    frame = pd.DataFrame(
        {k: columns[k][:n_rows] if k < len(columns) else empty for k in range(len(headings))}, copy=False
    )
    told = (*notes, *tell_layout(places, layout, "row"), *tell_end(places[begin + n_rows :], "row"))
    return FrameTable(
        path,
        tuple(headings),
        frame,
        places[begin : begin + n_rows],
        notes=told,
        decimal=options.decimal,
        above=above,
    )


def _count_remarks(head: Sequence[Row], tail: Sequence[Row]) -> int:
    """Count the rows at the end of a sheet that are not part of its table."""
    width = max(map(len, (*head, *tail)), default=0)
    return find_end(*([[*map(_text, row), *[""] * (width - len(row))] for row in part] for part in (head, tail)))


class _Body:
    """Rows of a sheet, stored by column; numbers are stored as numbers, not as objects."""

    def __init__(self) -> None:
        self.rows: list[Row] = []
        self.cells = 0
        self.parts: list[list[Column]] = []

    def add(self, row: Row) -> None:
        self.rows.append(row)
        self.cells += len(row)
        if self.cells > _CHUNK:
            self._pack()

    def close(self, before: list[Row]) -> list[Column]:
        """Return the columns of the sheet, starting with the rows `before`."""
        self._pack()
        self.rows = before
        self._pack()
        parts = [*self.parts[-1:], *self.parts[:-1]]
        columns: list[Column] = []
        for k in range(max(map(len, parts), default=0)):
            pieces = [p[k] if k < len(p) else np.full(len(p[0]) if p else 0, np.nan) for p in parts]
            columns.append(np.concatenate(pieces) if len(pieces) > 1 else pieces[0])
        return columns

    def _pack(self) -> None:
        width = max(map(len, self.rows), default=0)
        full = [row + (None,) * (width - len(row)) for row in self.rows]
        self.parts.append([_column(cells) for cells in zip(*full, strict=True)])
        self.rows, self.cells = [], 0


def _column(cells: Row) -> Column:
    kinds = set(map(type, cells))
    if kinds == {int} and all(abs(cell) < 1 << 63 for cell in cells):
        return np.array(cells, dtype=np.int64)
    if kinds <= {int, float, type(None)}:
        return np.array(cells, dtype=np.float64)
    column = np.empty(len(cells), dtype=object)
    column[:] = cells
    return column


def _holds_cells(row: Row) -> bool:
    """Return whether a row has contents and is not a remark (#)."""
    first = next((cell for cell in row if cell is not None), None)
    return first is not None and not (isinstance(row[0], str) and row[0].lstrip().startswith("#"))


def _text(cell: object) -> str:
    return "" if cell is None else str(cell)


def _trimmed(row: Sequence[Any]) -> Row:
    end = len(row)
    while end and (row[end - 1] is None or row[end - 1] == ""):
        end -= 1
    return tuple(None if cell == "" else _plain(cell) for cell in row[:end])


def _plain(cell: object) -> object:
    """Return a cell as text in the form expected by the time readers; numbers unchanged, infinite if too large."""
    if isinstance(cell, int):
        return cell if cell.bit_length() < _LARGE else (math.inf if cell > 0 else -math.inf)
    if isinstance(cell, datetime):
        return cell.isoformat(sep=" ")
    return cell.isoformat() if isinstance(cell, date | time) else cell


def _xlsx_sheets(path: Path, stack: ExitStack, limits: FileLimits) -> Sheets:
    import openpyxl

    book = openpyxl.load_workbook(path, read_only=True, data_only=True, keep_links=False)
    stack.callback(book.close)

    def rows(name: str) -> Generator[Row]:
        sheet = book[name]
        sheet.reset_dimensions()  # the size stated in the file may be wrong
        cells = due = 0
        for row in sheet.iter_rows(values_only=True):
            cells += len(row)  # including empty ones
            if cells > due:
                limits.check_unpacked(8 * cells, path)
                due = cells + _CHUNK
            yield _trimmed(row)

    return {sheet.title: lambda name=sheet.title: rows(name) for sheet in book.worksheets}  # type: ignore[misc]


def _ods_sheets(path: Path, limits: FileLimits) -> Sheets:
    with zipfile.ZipFile(path) as parts, parts.open("content.xml") as content:
        tables = (e for _, e in ElementTree.iterparse(content, ("start",)) if e.tag == f"{_TABLE}table")
        names = [table.get(f"{_TABLE}name", "") for table in tables]
    return {name: lambda k=k: _ods_rows(path, k, limits) for k, name in enumerate(names)}  # type: ignore[misc]


def _ods_rows(path: Path, wanted: int, limits: FileLimits) -> Generator[Row]:
    """Yield the rows of a sheet; empty rows only if other rows follow."""
    with zipfile.ZipFile(path) as parts, parts.open("content.xml") as content:
        number, table, empty = -1, None, 0
        for event, element in ElementTree.iterparse(content, ("start", "end")):
            if element.tag == f"{_TABLE}table":
                if event == "end" and number == wanted:
                    return
                number, table = number + (event == "start"), element
            elif event == "end" and element.tag == f"{_TABLE}table-row" and table is not None:
                if number == wanted:
                    row = _ods_cells(element, limits.columns)
                    times = int(element.get(f"{_TABLE}number-rows-repeated", "1"))
                    if row:
                        for _ in range(empty):
                            yield ()
                        for _ in range(times):
                            yield row
                    empty = 0 if row else empty + times
                table.clear()  # frees the memory of rows already read


def _ods_cells(row: ElementTree.Element, most: int) -> Row:
    cells: list[Any] = []
    empty = 0
    for cell in row:
        value, times = _ods_value(cell), int(cell.get(f"{_TABLE}number-columns-repeated", "1"))
        if value is None:
            empty += times
            continue
        # one cell above the limit is enough to report an error; the others are not created
        cells += [None] * min(empty, most + 1)
        cells += [value] * min(times, most + 1)
        if len(cells) > most:
            break
        empty = 0
    return tuple(cells)


def _ods_value(cell: ElementTree.Element) -> Any:
    kind = cell.get(f"{_OFFICE}value-type")
    if kind in ("float", "percentage", "currency"):
        return float(cell.get(f"{_OFFICE}value", "nan"))
    if kind == "date":
        return cell.get(f"{_OFFICE}date-value", "").replace("T", " ")
    if kind == "time" and (found := _SPAN.fullmatch(cell.get(f"{_OFFICE}time-value", ""))):
        return f"{found[1]}:{found[2]}:{found[3]}" + (f".{found[4]}" if found[4] else "")
    texts = ["".join(part.itertext()) for part in cell.iter(f"{_TEXT}p")]
    return "\n".join(texts) or None
