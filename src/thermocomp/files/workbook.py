"""Workbooks (XLSX, ODS): sheets are streamed, and only as much of them as a recording may have."""

import re
import zipfile
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import ExitStack, closing
from datetime import date, datetime, time
from itertools import islice
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree

import pandas as pd

from thermocomp.core.exceptions import InputError, MissingExtraError, RecordingError
from thermocomp.files.layout import (
    MOST_REMARKS,
    Layout,
    find_end,
    find_layout,
    join_units,
    tell_end,
    tell_layout,
)
from thermocomp.files.mapping import ReadOptions
from thermocomp.files.tables import FrameTable, check_headings

#: columns and cells of a sheet, and bytes of an unzipped workbook, that are read at most
MOST_COLUMNS: Final = 10_000
MOST_CELLS: Final = 50_000_000
MOST_BYTES: Final = 4 << 30
#: rows that tell where a table begins
_SAMPLE = 100
_OFFICE, _TABLE, _TEXT = (
    f"{{urn:oasis:names:tc:opendocument:xmlns:{part}:1.0}}" for part in ("office", "table", "text")
)
_SPAN = re.compile(r"PT(\d+)H(\d+)M(\d+)(?:[.,](\d+))?S")

Row = tuple[Any, ...]
Sheets = dict[str, Callable[[], Generator[Row]]]


def open_workbook(path: Path, options: ReadOptions) -> FrameTable:
    """Open the sheet of a workbook that holds a recording.

    Parameters
    ----------
    path : Path
        Ending in .xlsx or .ods.
    options : ReadOptions

    Raises
    ------
    RecordingError
        It is not a workbook, it is too large, it holds no recording, or several sheets may be it.
    """
    try:
        _refuse_large(path)
        with ExitStack() as stack:
            sheets = _ods_sheets(path) if path.suffix.lower() == ".ods" else _xlsx_sheets(path, stack)
            name, notes = _choose(path, sheets, options)
            return _table(path, name, stack.enter_context(closing(sheets[name]())), notes, options)
    except ImportError as e:
        raise MissingExtraError("study", "openpyxl") from e
    except (InputError, OSError):
        raise
    except Exception as e:  # whatever a damaged file makes of two parsers
        raise RecordingError(
            f"{path}: is not a workbook, or a damaged one ({type(e).__name__}: {e}); save it anew"
        ) from e


def _refuse_large(path: Path) -> None:
    with zipfile.ZipFile(path) as parts:
        size = sum(part.file_size for part in parts.infolist())
    if size > MOST_BYTES:
        raise RecordingError(
            f"{path}: has {size / 2**30:.0f} GB when it is unzipped, and at most {MOST_BYTES >> 30} GB are read; save "
            "the recording as CSV or Parquet"
        )


def _choose(path: Path, sheets: Sheets, options: ReadOptions) -> tuple[str, tuple[str, ...]]:
    """Return the name of the sheet that is read, and what is told of that."""
    names = ", ".join(map(repr, sheets))
    if options.sheet:
        if options.sheet not in sheets:
            raise RecordingError(f"{path}: mapping [read]: there is no sheet {options.sheet!r}; there are {names}")
        return options.sheet, ()
    first = next(iter(sheets), None)
    if first is None:
        raise RecordingError(f"{path}: has no sheet with cells; a recording has a heading row and rows of numbers")
    if len(sheets) == 1:
        return first, ()
    likely = []
    for name, open_rows in sheets.items():
        with closing(open_rows()) as rows:
            likely += [name] if find_layout(_sample(rows)) is not None else []
    if len(likely) > 1:
        raise RecordingError(
            f"{path}: the sheets {', '.join(map(repr, likely))} all hold a table; say which in a mapping, such as "
            f'[read] sheet = "{likely[0]}"'
        )
    name = likely[0] if likely else first
    return name, (f"sheet {name!r} of {names} is read",)


def _sample(rows: Iterator[Row]) -> list[list[str]]:
    return [[_text(cell) for cell in row] for row in islice((row for row in rows if _holds_cells(row)), _SAMPLE)]


def _table(path: Path, name: str, rows: Iterator[Row], notes: tuple[str, ...], options: ReadOptions) -> FrameTable:
    """Return the table of a sheet: its heading row, and the rows below it."""
    places, content, cells = list[int](), list[Row](), 0
    for place, row in enumerate(rows, 1):
        if not _holds_cells(row) or (place < options.heading):
            continue
        cells += len(row)
        if len(row) > MOST_COLUMNS or cells > MOST_CELLS:
            wide = len(row) > MOST_COLUMNS
            what = f"row {place} has more than {MOST_COLUMNS:,} columns" if wide else f"has over {MOST_CELLS:,} cells"
            raise RecordingError(
                f"{path}: sheet {name!r} {what}, which are not read: delete what is beside the table, or save the "
                "recording as CSV or Parquet"
            )
        places.append(place)
        content.append(row)
    if not content:
        raise RecordingError(f"{path}: sheet {name!r} is empty; a recording has a heading row and rows of numbers")
    layout = find_layout(_sample(iter(content))) or Layout(0, 0, 1)
    begin = layout.begin
    headings = [_text(cell).strip() for cell in content[layout.heading]]
    if layout.units != layout.heading:
        headings = join_units(headings, [_text(cell) for cell in content[layout.units]])
    below = content[begin:]
    width = max(map(len, below), default=0)
    ends = below[:_SAMPLE], below[-MOST_REMARKS:]
    remarks = find_end(*([[*map(_text, row), *[""] * (width - len(row))] for row in part] for part in ends))
    left_out = places[len(places) - remarks :]
    below = below[: len(below) - remarks]
    width = max(map(len, below), default=0)
    headings += [""] * (width - len(headings))
    check_headings(path, headings, n_rows=len(below))
    frame = pd.DataFrame([row + (None,) * (len(headings) - len(row)) for row in below], dtype=object)
    told = (*notes, *tell_layout(places, layout, "row"), *tell_end(left_out, "row"))
    return FrameTable(str(path), tuple(headings), frame, places[begin:], notes=told, decimal=options.decimal)


def _holds_cells(row: Row) -> bool:
    """Return whether a row holds something, and is no remark (#)."""
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
    """Return a cell as the text readers of times know it; numbers as they are."""
    if isinstance(cell, datetime):
        return cell.isoformat(sep=" ")
    return cell.isoformat() if isinstance(cell, date | time) else cell


def _xlsx_sheets(path: Path, stack: ExitStack) -> Sheets:
    import openpyxl

    book = openpyxl.load_workbook(path, read_only=True, data_only=True)
    stack.callback(book.close)

    def rows(name: str) -> Generator[Row]:
        sheet = book[name]
        sheet.reset_dimensions()  # what a file says of its size may be wrong
        return (_trimmed(row) for row in sheet.iter_rows(values_only=True))

    return {sheet.title: lambda name=sheet.title: rows(name) for sheet in book.worksheets}  # type: ignore[misc]


def _ods_sheets(path: Path) -> Sheets:
    with zipfile.ZipFile(path) as parts, parts.open("content.xml") as content:
        tables = (e for _, e in ElementTree.iterparse(content, ("start",)) if e.tag == f"{_TABLE}table")
        names = [table.get(f"{_TABLE}name", "") for table in tables]
    return {name: lambda k=k: _ods_rows(path, k) for k, name in enumerate(names)}  # type: ignore[misc]


def _ods_rows(path: Path, wanted: int) -> Generator[Row]:
    """Yield the rows of a sheet; empty ones only where something comes after them."""
    with zipfile.ZipFile(path) as parts, parts.open("content.xml") as content:
        number, table, empty = -1, None, 0
        for event, element in ElementTree.iterparse(content, ("start", "end")):
            if element.tag == f"{_TABLE}table":
                if event == "end" and number == wanted:
                    return
                number, table = number + (event == "start"), element
            elif event == "end" and element.tag == f"{_TABLE}table-row" and table is not None:
                if number == wanted:
                    row, times = _ods_cells(element), int(element.get(f"{_TABLE}number-rows-repeated", "1"))
                    if row:
                        for _ in range(min(empty, MOST_CELLS)):
                            yield ()
                        for _ in range(min(times, MOST_CELLS)):
                            yield row
                    empty = 0 if row else empty + times
                table.clear()  # of rows that are read nothing stays


def _ods_cells(row: ElementTree.Element) -> Row:
    cells: list[Any] = []
    empty = 0
    for cell in row:
        value, times = _ods_value(cell), int(cell.get(f"{_TABLE}number-columns-repeated", "1"))
        if value is None:
            empty += times
            continue
        # one more than may be read is told, not filled in
        cells += [None] * min(empty, MOST_COLUMNS + 1)
        cells += [value] * min(times, MOST_COLUMNS + 1)
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
