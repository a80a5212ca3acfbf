"""Parquet files: columns are read in batches, after the size stated in the file has been checked."""

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from thermocomp.core.exceptions import InputError, MissingExtraError, RecordingError
from thermocomp.core.messages import Message
from thermocomp.recordings.readers.limits import FileLimits
from thermocomp.recordings.readers.mapping import ReadOptions
from thermocomp.recordings.readers.tables import (
    EMBEDDED,
    FileTable,
    as_floats,
    check_headings,
    clean_heading,
    convert_all,
    first_is_number,
    first_texts,
)

if TYPE_CHECKING:
    from pyarrow import Array, DataType, RecordBatch
    from pyarrow.parquet import ParquetFile

_TEXTS = ("string", "large_string", "binary", "large_binary")
_FIRST = 100  # cells used to determine whether a column contains numbers
_BATCH = 65_536  # rows unpacked at a time
_BUFFER = 1 << 18  # bytes of a column read at a time; otherwise a whole row group is read
#: keys of the metadata that pandas stores with a table
_PANDAS, _ATTRIBUTES = b"pandas", b"PANDAS_ATTRS"
#: pandas name of an index without a name
_INDEX = "__index_level_0__"


@dataclass(frozen=True)
class ParquetTable(FileTable):
    """A Parquet file; made by `open_parquet`.

    Parameters
    ----------
    path, headings
        See `thermocomp.recordings.readers.tables.FileTable`.
    names : tuple of str
        Names of the columns, as in the file.
    texts : tuple of str
        Names of the text columns.
    others : tuple of int
        Positions of the columns without a numeric type.
    embedded, decimal, notes
        See `thermocomp.recordings.readers.tables.FileTable`.
    """

    names: tuple[str, ...]
    texts: tuple[str, ...]
    others: tuple[int, ...]
    n_rows: int
    limits: FileLimits

    def is_number(self, column: int, *, empty: bool = True) -> bool:
        """Return whether the first non-empty cell of a column is a number; `empty` if there is none."""
        found = self._first_cells.get(column)
        number = column not in self.others if found is None else first_is_number(found, empty=empty)
        return number or column in self.units

    def head(self, column: int) -> list[str]:
        """Return the first non-empty cells of a column; see `thermocomp.recordings.readers.tables.FileTable.head`."""
        found = self._first_cells.get(column)
        return [] if found is None else first_texts(found)

    @cached_property
    def _first_cells(self) -> dict[int, "pd.Series[Any]"]:
        """First non-empty cell of each of the `others` that has one among the first rows."""
        filled = {}
        with _translated(self.path):
            batch = next(self._batches(self.others), None) if self.others else None
            for k, column in zip(self.others, batch.columns if batch is not None else (), strict=batch is not None):
                filled[k] = column.drop_null().slice(0, _FIRST).to_pandas()
        return filled

    def load(self, numbers: Sequence[int], texts: Sequence[int]) -> tuple[pd.DataFrame, tuple[str, ...]]:
        """Read columns; see `thermocomp.recordings.readers.tables.FileTable.load`."""
        wanted = [*numbers, *texts]
        written = [k for k in numbers if self.names[k] in self.texts]
        values = {k: np.empty(self.n_rows) for k in numbers if k not in written}
        parts: dict[int, list[pd.Series[Any]]] = {k: [] for k in (*texts, *written)}
        row = size = 0
        with _translated(self.path):
            for batch in self._batches(wanted):
                stop = row + len(batch)
                size += sum(map(_unpacked, batch.columns))
                self.limits.check_unpacked(size, self.path)
                for k, column in zip(wanted, batch.columns, strict=True):
                    cells = column.to_pandas()
                    if isinstance(cells.dtype, pd.CategoricalDtype):
                        cells = cells.astype(object)
                    if k in values:
                        values[k][row:stop] = as_floats(cells)
                    else:
                        parts[k].append(cells)
                row = stop
        if row != self.n_rows:
            raise RecordingError(
                f"{self.path}: the file declares {self.n_rows} rows but contains {row}; write it again"
            )
        columns = {k: pd.concat(p, ignore_index=True) for k, p in parts.items()}
        numbered, notes = convert_all(self, {k: columns[k] for k in written}, self.decimal)
        data = {**columns, **values, **numbered}
        return pd.DataFrame({k: data[k] for k in wanted}, copy=False), notes

    def place(self, row: int) -> str:
        """Return the location of a row in the file (1-based)."""
        return Message("row {first}", first=row + 1)

    def _batches(self, columns: Sequence[int]) -> Iterator["RecordBatch"]:
        from pyarrow.parquet import ParquetFile

        names = [self.names[k] for k in columns]
        with (
            _translated(self.path),
            ParquetFile(self.path, read_dictionary=list(self.texts), buffer_size=_BUFFER, pre_buffer=False) as file,
        ):
            for batch in file.iter_batches(_BATCH, columns=names, use_threads=False):
                yield batch.select(names)


@contextmanager
def _translated(path: Path) -> Iterator[None]:
    """Convert any error that a damaged file causes in the Parquet library to a `RecordingError`."""
    try:
        yield
    except InputError:
        raise
    except Exception as e:
        raise RecordingError(
            f"{path}: this is not a Parquet file, or a damaged one ({type(e).__name__}: {e}); write it again"
        ) from e


def open_parquet(path: Path, options: ReadOptions, limits: FileLimits) -> FileTable:
    """Open a Parquet file as a table, after a check of its size."""
    try:
        from pyarrow.parquet import ParquetFile
    except ImportError as e:
        raise MissingExtraError("study", "pyarrow") from e
    with _translated(path), ParquetFile(path) as file:
        about, schema = file.metadata, file.schema_arrow
        limits.check_table(about.num_rows, about.num_columns, path)
        packed = sum(about.row_group(k).total_byte_size for k in range(about.num_row_groups))
        limits.check_unpacked(max(packed, 8 * about.num_rows * about.num_columns), path)
        if len(set(schema.names)) < len(schema.names):
            raise RecordingError(f"{path}: two columns have the same name; rename one of them")
        names = _names(file)
        others = [k for k, name in enumerate(names) if not _is_number(schema.field(name).type)]
        texts = [f.name for f in schema if str(f.type) in _TEXTS]
        embedded = str(json.loads((schema.metadata or {}).get(_ATTRIBUTES, b"{}")).get(EMBEDDED, ""))
        kind = str(schema.field(_INDEX).type) if _INDEX in names else ""
    timed = kind.startswith(("timestamp", "duration"))
    # numbers of sorted or selected rows have no meaning
    index = "timestamp" if timed else "" if kind.startswith(("int", "uint")) else "index"
    headings = [clean_heading(index if name == _INDEX else name) for name in names]
    check_headings(path, headings, about.num_rows, limits)
    return ParquetTable(
        path=path,
        names=tuple(names),
        headings=tuple(headings),
        texts=tuple(texts),
        others=tuple(others),
        n_rows=about.num_rows,
        embedded=embedded,
        limits=limits,
        decimal=options.decimal,
        notes=(Message("the index has no name and holds times: taken as the time"),) if timed else (),
    )


def _names(file: "ParquetFile") -> list[str]:
    """Return the names of the columns as shown by pandas, index columns first."""
    names = list(file.schema_arrow.names)
    about = json.loads((file.schema_arrow.metadata or {}).get(_PANDAS, b"{}"))
    index = [name for name in about.get("index_columns", ()) if isinstance(name, str) and name in names]
    return index + [name for name in names if name not in set(index)]


def _is_number(kind: "DataType") -> bool:
    from pyarrow.types import is_floating, is_integer

    return bool(is_floating(kind) or is_integer(kind))


def _unpacked(column: "Array") -> int:
    """Return the size of an unpacked column in bytes if each cell had a separate text."""
    import pyarrow.compute as pc
    from pyarrow import DictionaryArray

    if isinstance(column, DictionaryArray) and str(column.type.value_type) in _TEXTS:
        lengths = pc.binary_length(column.dictionary)
        return int(pc.sum(lengths.take(column.indices)).as_py() or 0)
    return int(column.nbytes)
