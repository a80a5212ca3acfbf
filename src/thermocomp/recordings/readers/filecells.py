"""`FileCells`: cells read from a file, with their source and meaning."""

from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from thermocomp.core.exceptions import RecordingError
from thermocomp.recordings.readers.columns import ColumnPlan
from thermocomp.recordings.readers.mapping import Mapping
from thermocomp.recordings.readers.tables import FileTable, skip_row
from thermocomp.recordings.readers.timecolumns import TimePlan


@dataclass(frozen=True)
class FileCells:
    """Cells read from a file, before conversion to times, numbers and labels.

    Parameters
    ----------
    source : Path
        Path of the file.
    table : FileTable
        Source of the cells.
    cells : DataFrame
        Columns named by their position in the file.
    is_stamp : bool
        The times are timestamps, not numbers.
    """

    source: Path
    mapping: Mapping
    table: FileTable
    columns: ColumnPlan
    cells: pd.DataFrame
    is_stamp: bool

    @property
    def times(self) -> TimePlan:
        """Columns that contain the time, by position."""
        return self.columns.times

    @property
    def heading(self) -> str:
        """Heading of the time column."""
        return self.table.headings[self.times.time]

    @property
    def time_keys(self) -> dict[str, str]:
        """Mapping entries for the time columns: ``column``, and ``date`` if there is one."""
        date = self.times.date
        return {"column": self.heading, **({"date": self.table.headings[date]} if date is not None else {})}

    def at(self, row: int, column: int | None = None) -> str:
        """Return the location of a cell; of the time if no column is given."""
        heading = self.table.headings[self.times.time if column is None else column]
        return f"{self.source}: {self.table.place(row)}, column {heading!r}"

    def refuse_row(self, row: int, text: str, column: int | None = None, *, skip: bool = True) -> RecordingError:
        """Return the error for a cell.

        Parameters
        ----------
        column : int, optional
            Column of the cell. Default: the time column.
        """
        return RecordingError(f"{self.at(row, column)}: {text}", [skip_row(self.table, row)] if skip else ())
