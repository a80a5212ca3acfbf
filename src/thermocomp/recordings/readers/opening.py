"""Conversion of files to raw tables with uninterpreted cells, by file extension."""

import hashlib
from collections.abc import Callable
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path

from pydantic import ValidationError

from thermocomp.core.exceptions import InputError, RecordingError
from thermocomp.core.messages import Message
from thermocomp.recordings.readers.cellunits import find_units
from thermocomp.recordings.readers.described import name_channels
from thermocomp.recordings.readers.hdf5 import open_hdf5
from thermocomp.recordings.readers.labelled import open_text
from thermocomp.recordings.readers.limits import FileLimits, check_file
from thermocomp.recordings.readers.mapping import ADAPTER, Mapping, ReadOptions
from thermocomp.recordings.readers.matlab import open_matlab
from thermocomp.recordings.readers.mtconnect import open_mtconnect
from thermocomp.recordings.readers.parquet import open_parquet
from thermocomp.recordings.readers.pivoting import pivot
from thermocomp.recordings.readers.tables import FileTable
from thermocomp.recordings.readers.tdms import open_tdms
from thermocomp.recordings.readers.workbook import open_workbook

_TEXTS = (".csv", ".tsv", ".txt", ".dat", ".asc", ".lvm")
_OPEN: dict[str, Callable[[Path, ReadOptions, FileLimits], FileTable]]
_OPEN = {
    **dict.fromkeys(_TEXTS, open_text),
    ".xlsx": open_workbook,
    ".ods": open_workbook,
    ".parquet": open_parquet,
    ".xml": open_mtconnect,
    ".tdms": open_tdms,
    ".mat": open_matlab,
    **dict.fromkeys((".h5", ".hdf5", ".hdf"), open_hdf5),
}


def open_table(path: str | Path, mapping: Mapping) -> tuple[FileTable, str]:
    """Open a file as a table without interpreting its columns."""
    path = Path(path)
    ending = path.suffix.lower()
    if ending not in _OPEN:
        raise RecordingError(
            f"{path}: files with the extension {ending or 'none'!r} cannot be read; save it as one of "
            f"{', '.join(_OPEN)}"
        )
    try:
        check_file(path, mapping.limits)
        with path.open("rb") as f:
            sha256 = hashlib.file_digest(f, "sha256").hexdigest()
        table = _OPEN[ending](path, mapping.read, mapping.limits)
        return (table if table.embedded else _complete(table, mapping)), sha256
    except FileNotFoundError as e:
        others = [p.name for p in path.parent.iterdir()] if path.parent.is_dir() else []
        near = get_close_matches(path.name, others, n=1)
        raise RecordingError(f"{path}: no such file{f'; did you mean {near[0]}?' if near else ''}") from e
    except OSError as e:
        raise RecordingError(f"{path}: the file cannot be read: {e.strerror or e}") from e
    except ValueError as e:  # an invalid file name
        raise RecordingError(f"{str(path)!r} cannot be read: {e}") from e


def _complete(table: FileTable, mapping: Mapping) -> FileTable:
    """Return a table in the form of a recording, with all that the file states about its columns."""
    missing = (*mapping.read.missing, *(code for rule in mapping.columns.values() for code in rule.missing))
    words = frozenset(code.strip().casefold() for code in missing if isinstance(code, str))
    table = name_channels(pivot(table, mapping), mapping)
    headings, units = find_units(table.headings, table.head)
    return replace(table, headings=tuple(headings), units=units, words=words)


def read_embedded(text: str, source: Path) -> tuple[Mapping, list[str]]:
    """Return the column description embedded by thermocomp; only a note if another program has damaged it."""
    try:
        return ADAPTER.validate_json(text), []
    except ValidationError as e:
        reason = e.errors()[0]["msg"]
        return Mapping(), [
            Message("thermocomp's own description of the columns is damaged ({reason}) and not used", reason=reason)
        ]
    except InputError as e:
        raise type(e)(f"{source}: {e}") from e
