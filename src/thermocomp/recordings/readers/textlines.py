"""Lines of text files: recognition of rows and other lines, and splitting of lines into cells."""

import csv
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from io import SEEK_END, BytesIO
from itertools import islice
from pathlib import Path
from typing import BinaryIO

from thermocomp.core.exceptions import RecordingError
from thermocomp.recordings.readers.limits import FileLimits
from thermocomp.recordings.readers.mapping import ReadOptions
from thermocomp.recordings.readers.tables import EMBEDDED

_BOM = b"\xef\xbb\xbf"
_TAIL = 65536  # bytes at the end of a file searched for remarks
_BLANK = b' \t\r\n",;|'  # empty rows of a spreadsheet: ;;;;
_SEPARATOR = re.compile(rb"(?:\xef\xbb\xbf)?\"?sep=([,;\t| ])\"?\r?\n", re.IGNORECASE)
#: start of the embedded column description; spreadsheets may put the line in quotation marks
_OWN = (f"# {EMBEDDED}: ".encode(), f'"# {EMBEDDED}: '.encode())
_KINDS = {b"PK\x03\x04": "a workbook or zip file", b"PAR1": "a Parquet file", b"\x1f\x8b": "a gzip file"}


@dataclass(frozen=True)
class Lines:
    """Lines of a text file.

    Parameters
    ----------
    data : bytes or None
        Content of the whole file in UTF-8, if conversion was necessary.
    returns : bool
        The file contains carriage returns that do not end a line.
    """

    path: Path
    data: bytes | None
    options: ReadOptions
    limits: FileLimits
    returns: bool

    def open(self) -> BinaryIO:
        """Open the file, or its content after conversion to UTF-8, in binary mode."""
        return self.path.open("rb") if self.data is None else BytesIO(self.data)

    def content(self, skipped: list[int]) -> Iterator[tuple[int, bytes]]:
        """Yield line number (0-based) and text of each line that is neither blank nor a comment."""
        options, limits = self.options, self.limits
        comment, most = options.comment.encode(), limits.line_bytes
        with self.open() as f:
            for number, raw in enumerate(iter(partial(f.readline, most + 1), b"")):
                if len(raw) > most:
                    limits.check("line_bytes", len(raw), f"{self.path}: line {number + 1}")
                line = raw.removeprefix(_BOM) if number == 0 else raw
                # pandas would count lines differently
                if self.returns and line.count(b"\r") > line.endswith(b"\r\n"):
                    raise RecordingError(
                        f"{self.path}: line {number + 1} contains a carriage return within the line, as in files of "
                        "old Macintoshes; save the file with the line ends of Unix or Windows"
                    )
                if number and line[:1].isalnum() and line[:1] != comment[:1] and not options.skip:
                    yield number, line
                    continue
                text = line.lstrip()
                remark = (comment and text.startswith(comment)) or (
                    number == 0 and (text.startswith(_OWN) or _SEPARATOR.fullmatch(raw))
                )
                if remark or not text.strip(_BLANK) or options.skips(number + 1):
                    skipped.append(number)
                    limits.check("skipped_lines", len(skipped), self.path)
                else:
                    yield number, line

    def remark_above(self, end: int) -> tuple[int, bytes] | None:
        """Return number and text of the last comment line above a line."""
        comment, found = self.options.comment.encode(), None
        with self.open() as f:
            for number, raw in enumerate(islice(iter(partial(f.readline, self.limits.line_bytes), b""), end)):
                line = raw.removeprefix(_BOM).lstrip()
                if comment and line.startswith(comment):
                    found = number, line.lstrip(comment + b" ")
        return found

    def embedded(self) -> str:
        """Return the description that thermocomp writes into the first line of its files."""
        with self.open() as f:
            line = f.readline(self.limits.line_bytes).removeprefix(_BOM)
        if not line.startswith(_OWN):
            return ""
        text = line.decode("utf-8", "replace").rstrip(" \t\r\n,;|")
        if text.startswith('"'):
            text = split_line(text, ";")[0]
        return text.partition(": ")[2].strip()

    def read_tail(self, n_lines: int, skipped: list[int]) -> list[tuple[int, bytes]]:
        """Return the last rows of the file with their line numbers, without another pass over the file."""
        with self.open() as f:
            size = f.seek(0, SEEK_END)
            f.seek(max(0, size - _TAIL))
            lines = f.read().splitlines(keepends=True)
        lines = lines[1:] if size > _TAIL else lines
        passed = set(skipped[-len(lines) :])
        return [(number, line) for number, line in enumerate(lines, n_lines - len(lines)) if number not in passed]

    def separator(self) -> str:
        """Return the delimiter in the first line of a file, as written by spreadsheets (``sep=;``); empty if none."""
        with self.open() as f:
            found = _SEPARATOR.fullmatch(f.readline(16))
        return found[1].decode() if found else ""


def open_lines(path: Path, data: bytes | None, options: ReadOptions, limits: FileLimits) -> Lines:
    """Check that a file contains text, and return its lines."""
    returns, last = 0, b""
    with path.open("rb") if data is None else BytesIO(data) as f:
        while block := f.read(1 << 20):
            kind = "" if last else next((k for magic, k in _KINDS.items() if block.startswith(magic)), "")
            if kind or b"\x00" in block:
                raise RecordingError(
                    f"{path}: the file is not text but {kind or 'binary'}; export the recording as CSV, or correct "
                    "the file extension"
                )
            returns += block.count(b"\r") - block.count(b"\r\n") - (last == b"\r" and block.startswith(b"\n"))
            last = block[-1:]
    return Lines(path=path, data=data, options=options, limits=limits, returns=returns > 0)


def split_line(line: str, delimiter: str) -> list[str]:
    """Split a line into cells; a space as delimiter denotes any white space."""
    if delimiter == " ":
        return re.split("[ \t]+", line.strip(" \t\r\n"))  # str.split accepts more characters as white space than pandas
    try:
        return next(csv.reader([line.rstrip("\r\n")], delimiter=delimiter, skipinitialspace=True))
    except csv.Error:  # a cell exceeds the limit of the reader, so that it is neither a number nor a name
        return line.rstrip("\r\n").split(delimiter)


def count_cells(line: bytes, delimiter: str) -> int:
    """Return the number of cells of a line."""
    if delimiter == " " or b'"' in line:
        return len(split_line(line.decode("latin-1"), delimiter))
    return line.count(delimiter.encode()) + 1


def describe_ragged(path: Path, number: int, cells: int, width: int, line: bytes, delimiter: str) -> str:
    """Return the fault of a line that is too short or too long, and the required action."""
    start = line[:60].decode("latin-1").strip()
    text = f"{path}: line {number} has {cells} cells where the heading has {width}: {start!r}"
    if delimiter == "," and cells > width:
        return f"{text}; if it has decimal commas, export with ';' between the columns"
    if not line.endswith(b"\n"):
        return f"{text}; it is the last line, perhaps cut off while it was written: complete or delete it"
    return f"{text}; complete or delete the line"


def is_utf8(line: bytes) -> bool:
    """Return whether a line is UTF-8."""
    try:
        line.decode("utf-8")
    except UnicodeDecodeError:
        return False
    return True
