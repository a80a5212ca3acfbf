"""CSV files: the format is detected from the file, then pandas reads the selected columns."""

from bisect import bisect_right
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from thermocomp.core.exceptions import RecordingError
from thermocomp.core.messages import Message
from thermocomp.recordings.headings import is_understood
from thermocomp.recordings.readers.encodings import bring_to_utf8, find_encoding
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
    name_stamps,
    tell_again,
    tell_end,
    tell_layout,
)
from thermocomp.recordings.readers.limits import FileLimits
from thermocomp.recordings.readers.mapping import ReadOptions
from thermocomp.recordings.readers.numbers import MISSING_TEXT, Notation, Signs, is_filler, is_number_like
from thermocomp.recordings.readers.tables import (
    HEAD,
    FileTable,
    check_headings,
    clean_heading,
    convert,
    decide,
    tell_notation,
)
from thermocomp.recordings.readers.textlines import Lines, count_cells, describe_ragged, is_utf8, open_lines, split_line

#: maximum number of lines used to detect the format; fewer if they are long
_SAMPLE_LINES = 300
_SAMPLE_BYTES = 2 << 20
_MOST_RAGGED = 1_000
_CHUNK = 100_000  # rows in memory as text at a time
_MISSING = [text for t in MISSING_TEXT for text in {t, t.upper(), t.capitalize()}] + ["NaN", "-NaN"]
# by default, pandas before 3.1 may read the last digit incorrectly
_PANDAS = tuple(int(n) for n in pd.__version__.split(".")[:2])
_EXACT: dict[str, Any] = {} if _PANDAS >= (3, 1) else {"float_precision": "round_trip"}


@dataclass(frozen=True)
class CsvTable(FileTable):
    """A text file with a heading line; made by `open_csv`.

    Parameters
    ----------
    path, headings
        See `thermocomp.recordings.readers.tables.FileTable`.
    sample : tuple of tuple of str
        Cells of the first rows.
    delimiter : str
        One character; a space denotes any white space.
    errors : {'strict', 'replace'}
        Handling of bytes that are invalid in the encoding.
    skipped : tuple of int
        Line numbers (0-based) of lines that are not rows: headings, comments, blank lines.
    data : bytes or None
        Content of the whole file in UTF-8, if conversion was necessary.
    short : bool
        Rows may end before their last cells.
    embedded, decimal, notes
        See `thermocomp.recordings.readers.tables.FileTable`.
    """

    sample: tuple[tuple[str, ...], ...]
    delimiter: str
    encoding: str
    errors: str
    skipped: tuple[int, ...]
    n_rows: int
    data: bytes | None = None
    short: bool = False

    def is_number(self, column: int, *, empty: bool = True) -> bool:
        """Return whether the first non-empty cell of a column is a number; `empty` if the first rows have none."""
        if column in self.units:
            return True
        cells = (row[column] for row in self.sample if column < len(row))
        first = next((c for c in cells if not is_filler(c)), None)
        return empty if first is None else is_number_like(first)

    def head(self, column: int) -> list[str]:
        """Return the first non-empty cells of a column; see `thermocomp.recordings.readers.tables.FileTable.head`."""
        return [row[column] for row in self.sample if column < len(row) and not is_filler(row[column])]

    def load(self, numbers: Sequence[int], texts: Sequence[int]) -> tuple[pd.DataFrame, tuple[str, ...]]:
        """Read columns; see `thermocomp.recordings.readers.tables.FileTable.load`."""
        signs = Signs()
        for row in self.sample:
            signs.add(row[k] for k in numbers if k < len(row))
        text: dict[int, Any] = dict.fromkeys(texts, str)
        decimal = self.decimal or signs.proven_sign() or ("." if self.delimiter == "," and not signs.open else "")
        if decimal:
            with suppress(ValueError):
                frame = self._read_frame({**text, **dict.fromkeys(numbers, np.float64)}, decimal=decimal)
                return frame, tell_notation(Notation(decimal))
        try:
            # cells that pandas does not recognise as numbers stay text
            types = text if decimal else {**text, **dict.fromkeys(numbers, str)}
            frame = self._read_frame({**dict.fromkeys(numbers), **types}, decimal=decimal or ".")
        except ValueError as e:
            raise RecordingError(f"{self.path}: the file cannot be read as a table: {e}") from e
        written = [k for k in numbers if frame[k].dtype == bool or not pd.api.types.is_numeric_dtype(frame[k].dtype)]
        for k in written:
            # pandas reads True as a number
            frame[k] = self.bare(k, frame[k].map(lambda cell: str(cell) if isinstance(cell, bool | np.bool_) else cell))
            signs.add(cell for cell in frame[k] if isinstance(cell, str))
        notation = decide(signs, decimal if self.decimal or signs.proven else "", self.delimiter, self.path)
        notes = tell_notation(notation)
        for k in numbers:
            if k in written:
                frame[k], found = convert(self, k, frame[k], notation)
                notes += found
        return frame, notes

    def _read_frame(self, types: dict[int, Any], **more: Any) -> pd.DataFrame:
        """Read columns with given types, or with types detected by pandas (None); ValueError if a cell does not fit."""
        try:
            with pd.read_csv(
                BytesIO(self.data) if self.data else self.path, **self._options(types), **more, **_EXACT
            ) as chunks:
                frame: pd.DataFrame = pd.concat(chunks, ignore_index=True)
        except IndexError as e:  # the file ends within a cell
            raise ValueError("the file contains no rows") from e
        except UnicodeDecodeError as e:
            raise RecordingError(
                f"{self.path}: the file is not written in {self.encoding} ({e.reason}); specify the correct encoding "
                "in a mapping, [read] encoding"
            ) from e
        if len(frame) != self.n_rows:
            raise RecordingError(
                f"{self.path}: {self.n_rows} lines give {len(frame)} rows: a quotation mark opens a cell that "
                "extends beyond the end of its line; close it, or delete the mark"
            )
        return frame

    def place(self, row: int) -> str:
        """Return the location of a row in the file as a line number (1-based)."""
        line = row
        while (shifted := row + bisect_right(self.skipped, line)) != line:
            line = shifted
        return Message("line {first}", first=line + 1)

    def _options(self, types: dict[int, Any]) -> dict[str, Any]:
        return {
            "sep": r"\s+" if self.delimiter == " " else self.delimiter,
            "header": None,
            "names": range(len(self.headings)),
            "usecols": sorted(types),
            "dtype": {k: kind for k, kind in types.items() if kind is not None},
            "low_memory": False,
            "index_col": False,
            "skiprows": list(self.skipped),
            "skipinitialspace": True,
            "encoding": self.encoding,
            "encoding_errors": self.errors,
            "chunksize": max(self.n_rows, 1) if self.short else _CHUNK,  # pandas counts the cells of the first chunk
            "keep_default_na": False,
            "na_values": {k: [""] if types[k] is str else _MISSING for k in types},
        }


def open_csv(path: Path, options: ReadOptions, limits: FileLimits) -> CsvTable:
    """Detect the format of a text file in a single pass over its lines, without storing them."""
    data, told = bring_to_utf8(path, limits)
    lines = open_lines(path, data, options, limits)
    head = _read_head(lines)
    delimiter, layout, first = head.delimiter, head.layout, head.lines
    body = _scan(lines, head)
    encoding = options.encoding or (find_encoding(body.odd) if body.odd else "utf-8")

    def split(line: bytes, errors: str = "replace") -> list[str]:
        return split_line(line.decode(encoding, errors), delimiter)

    rows = [split(line) for _, line in first[layout.begin :]]
    n_remarks = find_end(rows, [split(line) for _, line in body.tail])
    remarks = [number for number, _ in body.tail][len(body.tail) - n_remarks :]
    if body.ragged and not (remarks and body.ragged[0] >= remarks[0]):
        number, cells, line = body.ragged
        told_ragged = describe_ragged(path, number + 1, cells, body.width, line, delimiter)
        raise RecordingError(told_ragged, [{"read": {"skip": [number + 1]}}])
    try:
        headings = [
            clean_heading(h) for h in split(first[layout.heading][1], "strict" if options.encoding else "replace")
        ]
    except UnicodeDecodeError as e:
        raise RecordingError(f"{path}: the heading line is not written in {encoding}: {e.reason}") from e
    headings = [*headings, *[""] * (body.width - len(headings))][: body.width]
    check_headings(path, headings, body.n_rows, limits)
    if layout.units != layout.heading:
        number, text = first[layout.units]
        headings = join_units(headings, split(text), rows, str(path), number + 1)
    headings, named = name_stamps(headings, rows)
    if body.odd and not options.encoding:
        told += (f"written in {encoding}, not in UTF-8",)
    if head.in_remark:
        told += (f"line {first[0][0] + 1} holds the headings, behind {options.comment!r}",)
    return CsvTable(
        path=path,
        data=data,
        headings=tuple(headings),
        sample=tuple(map(tuple, rows[:HEAD])),
        delimiter=delimiter,
        decimal=options.decimal,
        encoding=encoding,
        errors="strict" if options.encoding else "replace",
        short=body.short,
        skipped=tuple(sorted((*body.skipped, *remarks))),
        n_rows=body.n_rows - len(remarks),
        embedded=lines.embedded(),
        again=tuple(body.again),
        above=find_rest([split(line) for _, line in first[: layout.begin]], layout),
        notes=(
            *told,
            *tell_layout([number + 1 for number, _ in first], layout, "line"),
            *named,
            *tell_again(body.again),
            *tell_end([number + 1 for number in remarks], "line"),
        ),
    )


class _Head(NamedTuple):
    """Content of the first lines of a file."""

    lines: list[tuple[int, bytes]]  #: with line numbers (0-based)
    delimiter: str
    layout: FileLayout
    in_remark: bool  #: the headings are in a comment, as written by numpy


class _Body(NamedTuple):
    """Results of reading all lines of a file once."""

    skipped: list[int]  #: line numbers of lines that are not rows (0-based)
    width: int
    short: bool  #: rows may end before their last cells
    n_rows: int
    odd: list[bytes]  #: lines that are not UTF-8
    again: list[int]  #: line numbers of repeated headings (1-based)
    tail: list[tuple[int, bytes]]  #: the last rows
    ragged: tuple[int, int, bytes] | None  #: number, count of cells and text of the first row with another count


def _read_head(lines: Lines) -> _Head:
    options, limits, path = lines.options, lines.limits, lines.path
    first = _sample(lines.content([]), options.heading - 1)
    if not first:
        raise RecordingError(f"{path}: the file is empty; a recording has a heading line and rows of numbers below it")
    delimiter, layout = _find_table(path, first, options.delimiter or lines.separator(), limits)
    remark = lines.remark_above(first[0][0]) if layout is None else None
    if remark is not None:
        first = [remark, *first]
        delimiter, layout = _find_table(path, first, options.delimiter, limits)
    return _Head(first, delimiter, layout or FileLayout(0, 0, 1), remark is not None)


def _sample(content: Iterator[tuple[int, bytes]], top: int) -> list[tuple[int, bytes]]:
    """Return the first lines of a file: at least a few, whatever their length."""
    found: list[tuple[int, bytes]] = []
    size = 0
    for number, line in content:
        if number >= top:
            found.append((number, line))
            size += len(line)
            if len(found) == _SAMPLE_LINES or (size > _SAMPLE_BYTES and len(found) >= 8):
                break
    return found


def _scan(lines: Lines, head: _Head) -> _Body:
    heading, delimiter, ending = head.lines[head.layout.heading][1], head.delimiter, head.delimiter.encode()
    headers = {line for _, line in head.lines[head.layout.heading : head.layout.begin]}
    skipped, odd, again = list[int](), list[bytes](), list[int]()
    number, ragged, least = 0, list[tuple[int, int, bytes]](), _count_usual(head)
    most = least
    width, n_rows = count_cells(heading, delimiter), int(head.in_remark) - head.layout.begin
    top, plain, long = lines.options.heading - 1, delimiter != " ", lines.limits.cell_characters
    for number, line in lines.content(skipped):
        if not line.isascii() and len(odd) < _SAMPLE_LINES and not is_utf8(line):
            odd.append(line)
        n_rows += number >= top
        if n_rows <= 0 or line in headers:  # lines above the rows; headings repeated after a restart of the logger
            again += [number + 1] if n_rows > 0 and line == heading else []
            n_rows -= n_rows > 0
            skipped.append(number)
            continue
        cells = line.count(ending) + 1 if plain and b'"' not in line else count_cells(line, delimiter)
        if n_rows == 1 and cells == width + 1 and line.rstrip(b" \r\n").endswith(ending):
            width += 1  # a logger that ends its rows, but not the heading line, with the delimiter
        most = cells if most < cells <= width else most
        if not least <= cells <= width and len(ragged) <= _MOST_RAGGED:
            ragged.append((number, cells, line))
        if len(line) > long:
            most = max(map(len, split_line(line.decode("latin-1"), delimiter)))
            lines.limits.check("cell_characters", most, f"{lines.path}: line {number + 1}")
    if again and (above := _find_preambles(lines, head, again)):
        n_rows -= len(above)
        skipped = sorted({*skipped, *above})
        ragged = [row for row in ragged if row[0] not in above]
    tail = lines.read_tail(1 + max(number, *skipped[-1:]), skipped)[-MOST_REMARKS:]
    return _Body(
        skipped=skipped,
        width=most if least < width else width,
        short=least < width,
        n_rows=n_rows,
        odd=odd,
        again=again,
        tail=tail[-n_rows:] if n_rows > 0 else [],
        ragged=ragged[0] if ragged else None,
    )


def _count_usual(head: _Head) -> int:
    """Return the least number of cells of a row: rows may end before empty cells of columns without a unit."""
    names = split_line(head.lines[head.layout.heading][1].decode("utf-8", "replace"), head.delimiter)
    counts = [count_cells(line, head.delimiter) for _, line in head.lines[head.layout.begin :]]
    usual = max(counts, key=counts.count, default=len(names))
    short = 2 < usual < len(names) and 2 * counts.count(usual) > len(counts) > 2
    return usual if short and not any(map(is_understood, names[usual:])) else len(names)


def _find_preambles(lines: Lines, head: _Head, again: Sequence[int]) -> set[int]:
    """Return the lines (0-based) of preambles above repeated headings, as loggers write them at every start."""

    def split(line: bytes) -> list[str]:
        return split_line(line.decode("utf-8", "replace"), head.delimiter)

    rows = [split(line) for _, line in head.lines[head.layout.begin :]]
    columns, timed = find_columns(rows)[1], find_timed(rows)
    found, repeated = set[int](), {*again}
    before = deque[tuple[int, bytes]](maxlen=_SAMPLE_LINES)
    for number, line in lines.content([]):
        if number + 1 in repeated:
            while before and not is_row(split(before[-1][1]), columns, timed):
                found.add(before.pop()[0])
            before.clear()
        else:
            before.append((number, line))
    return found - {number for number, _ in head.lines[: head.layout.begin]}


def _find_table(
    path: Path, first: Sequence[tuple[int, bytes]], delimiter: str, limits: FileLimits
) -> tuple[str, FileLayout | None]:
    """Select the delimiter under which most rows have as many cells as the headings, unless it is given."""
    lines = [line.decode("utf-8" if is_utf8(line) else "latin-1") for _, line in first]
    best, best_layout, best_fit = delimiter or ",", None, (False, 0.0, 0)
    widest = 0
    for tried in delimiter or "\t;|, ":
        if tried == " " and not delimiter:  # headings and timestamps contain spaces too: last resort
            if best_fit > (False, 0.0, 0):
                continue
            limits.check("columns", widest, path)
        cells = max(line.count(tried) for line in lines) + 1
        if cells > limits.columns + 1:  # the last cell may be empty
            widest = max(widest, cells)
            continue
        rows = [split_line(line, tried) for line in lines]
        found = find_layout(rows)
        width = len(rows[found.heading if found else 0])
        fits = [len(row) in (width, width + 1) for row in rows[found.begin if found else 1 :]]
        fit = (found is not None, sum(fits) / len(fits) if fits else 1.0, width)
        if delimiter or (width > 1 and fit > best_fit and (fit[1] > 0 or tried != " ")):
            best, best_layout, best_fit = tried, found, fit
    if best_fit == (False, 0.0, 0):
        limits.check("columns", widest, path)
    return best, best_layout
