"""Limits of the readers, defined in one place, so that no file needs more time or memory than allowed."""

import stat
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Final

from thermocomp.core.exceptions import InputError, RecordingError

#: unpacked size that is always allowed [byte]: a few seconds of work
_UNPACKED_FREE: Final = 64 << 20


def _limit(most: int, counts: str) -> int:
    """Return the field of a limit, with the name of the counted items for messages."""
    return field(default=most, metadata={"counts": counts})


@dataclass(frozen=True)
class FileLimits:
    """Table ``[limits]``: maximum sizes of files that are read.

    The limits are far above the needs of recordings. Time and memory of reading grow with them.

    Parameters
    ----------
    file_bytes : int
        Size of any file; larger ones exceed the memory of a workshop computer.
    recoded_bytes : int
        Size of a text file that has to be converted to UTF-8, or to standard line ends, in memory.
    line_bytes : int
        Size of a line of text, or of a text in a workbook: 10,000 columns of 400 characters.
    cell_characters : int
        Capacity of a spreadsheet cell; no number and no name is longer.
    heading_characters : int
        Length of a heading; headings become names in tables, figures and messages.
    columns : int
        Number of columns; each becomes a separate object. A machine has at most some hundred sensors.
    rows : int
        Number of rows: three years at one row per second.
    cells : int
        Rows times columns: 8 bytes each in memory, so 4 GB.
    skipped_lines : int
        Number of comments and blank lines; their positions are stored for messages.
    sheets : int
        Number of sheets of a workbook; each is opened to check whether it contains a table.
    sheet_rows : int
        Capacity of a spreadsheet; a workbook can declare any number in a few bytes.
    row_elements : int
        Number of XML elements of a row, a list of styles or similar; they are in memory at the same time.
    growth : int
        Maximum ratio of the unpacked size of a workbook or a Parquet file to its size, after the first 64 MiB.
        Recordings become 3 to 30 times larger, a zip bomb 1,000 times.
    cycles : int
        Number of thermal cycles; they take hours, so that a column with more labels contains something else.
    """

    file_bytes: int = _limit(8 << 30, "bytes")
    recoded_bytes: int = _limit(1 << 30, "bytes of a text in another encoding")
    line_bytes: int = _limit(4_000_000, "bytes in a line or a text")
    cell_characters: int = _limit(32_767, "characters in a cell")
    heading_characters: int = _limit(1_000, "characters in a heading")
    columns: int = _limit(10_000, "columns")
    rows: int = _limit(100_000_000, "rows")
    cells: int = _limit(500_000_000, "cells")
    skipped_lines: int = _limit(1_000_000, "lines without data (comments, blank lines)")
    sheets: int = _limit(100, "sheets")
    sheet_rows: int = _limit(1_048_576, "rows of a sheet")
    row_elements: int = _limit(200_000, "XML elements in one row or one other part of the workbook")
    growth: int = _limit(100, "times its size when it is unpacked")
    cycles: int = _limit(10_000, "thermal cycles")

    def __post_init__(self) -> None:
        for f in fields(self):
            if not getattr(self, f.name) >= 1:
                raise InputError(f"[limits]: {f.name} = {getattr(self, f.name)}: must be at least 1")

    def check(self, name: str, found: int, where: object) -> None:
        """Reject a size or count that exceeds one of the limits."""
        most = getattr(self, name)
        if found > most:
            counts = next(f.metadata["counts"] for f in fields(self) if f.name == name)
            raise RecordingError(
                f"{where}: over {most:,} {counts}, which is the limit; found at least {found:,}: delete what is not "
                f"part of the recording, or raise the limit in the mapping file: [limits] {name} = {2 * found}"
            )

    def check_table(self, rows: int, columns: int, where: object) -> None:
        """Reject a table with too many rows, columns or cells."""
        self.check("columns", columns, where)
        self.check("rows", rows, where)
        self.check("cells", rows * columns, where)

    def check_unpacked(self, unpacked: int, path: Path) -> None:
        """Reject a small file that becomes a large one when unpacked.

        Parameters
        ----------
        unpacked : int
            Unpacked size so far [byte].
        """
        size = max(path.stat().st_size, 1)
        if unpacked > _UNPACKED_FREE:
            self.check("growth", -(-(unpacked - _UNPACKED_FREE) // size), path)


def check_file(path: Path, limits: FileLimits) -> None:
    """Reject a path that is not a regular file, such as a pipe or a device (also through a link), or a large file."""
    found = path.stat()
    if not (stat.S_ISREG(found.st_mode) or stat.S_ISDIR(found.st_mode)):  # opening a folder raises a clear error
        raise RecordingError(f"{path}: this is a pipe or a device, not a file; save its output to a file")
    limits.check("file_bytes", found.st_size, path)
