"""Recordings as files: CSV, XLSX and Parquet in, CSV and Parquet out."""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pydantic import ValidationError

from thermocomp.core.exceptions import InputError, RecordingError
from thermocomp.core.headings import understand
from thermocomp.core.machine import Channel
from thermocomp.files.columns import ColumnPlan, plan
from thermocomp.files.draft import draft
from thermocomp.files.leftout import refuse_nameless, why_left_out
from thermocomp.files.mapping import ADAPTER, ColumnMap, CycleRule, Mapping, ReadOptions, TimeColumn
from thermocomp.files.tables import EMBEDDED, FileTable, open_parquet
from thermocomp.files.textfile import open_csv
from thermocomp.files.times import read_times
from thermocomp.files.workbook import open_workbook
from thermocomp.recording.cycles import Cycle, find_cycles, make_single_cycle, split_by_labels
from thermocomp.recording.recording import Recording

FloatArray = NDArray[np.float64]

ENDINGS = (".csv", ".tsv", ".txt", ".xlsx", ".ods", ".parquet")


def read(path: str | Path, mapping: Mapping | None = None) -> Recording:
    """Read one test from a file.

    Columns are understood by the unit in their heading (``time_s``, ``t1_C``, ``drift_um``, ``spindle_rpm``,
    ``T1 [degC]``) or by `mapping`. Thermal cycles come from a column ``cycle``, else from the spindle speed.

    Parameters
    ----------
    path : str or Path
        A file ending in .csv, .tsv, .txt, .xlsx, .ods or .parquet.
    mapping : Mapping, optional
        What the columns are, where their headings do not say; see `thermocomp.files.mapping.read_mapping`.

    Returns
    -------
    Recording
        In house units; `notes` tells what was left out or replaced.

    Raises
    ------
    RecordingError
        The file cannot be read, or not as a recording; the message names line and column.
    UnitError
        A unit is unknown, or the one in the heading cannot measure what the mapping states.
    """
    rows = read_rows(path, mapping)
    return make_recording(rows, rows.time, rows.table, rows.labels)


@dataclass(frozen=True, eq=False)
class Rows:
    """What a file holds, row by row, in house units.

    Parameters
    ----------
    source : str
        The file.
    sha256 : str
        Hash of it.
    time : ndarray of shape (n_rows,)
        Seconds since the first row [s].
    start : str
        ISO timestamp of the first row, if known.
    table : DataFrame of shape (n_rows, n_channels)
    channels : tuple of Channel
        One per column of `table`.
    labels : list of object or None
        Thermal cycle of each row, if the file says.
    extra : mapping of str to list of object
        Cells of further columns that were asked for and are there.
    rule : CycleRule
    aliases : mapping of str to str
        Headings and names without unit to channel names.
    notes : tuple of str
    place : callable
        Says where a row stands in the file, such as ``line 7``.
    """

    source: str
    sha256: str
    time: FloatArray
    start: str
    table: pd.DataFrame
    channels: tuple[Channel, ...]
    labels: list[Any] | None
    extra: dict[str, list[Any]]
    rule: CycleRule
    aliases: dict[str, str]
    notes: tuple[str, ...]
    place: Callable[[int], str]


def read_rows(
    path: str | Path, mapping: Mapping | None = None, *, rising: bool = True, extra: Sequence[str] = ()
) -> Rows:
    """Read the rows of a file.

    Parameters
    ----------
    path : str or Path
    mapping : Mapping, optional
    rising : bool
        False: several rows may have the same time, as in a table with a row per position.
    extra : sequence of str
        Headings of columns, whatever they hold, to be read too if they are there.

    Returns
    -------
    Rows

    Raises
    ------
    RecordingError, UnitError
        See `read`.
    """
    source = Path(path)
    mapping = mapping or Mapping()
    table, sha256 = _open(source, mapping.read)
    if table.embedded:
        mapping = mapping.over(_described(table.embedded, source))
    columns = plan(table.headings, mapping, str(source))
    is_stamp = columns.time_unit == "timestamp" or not (columns.time_unit or table.is_number(columns.time))
    numbers = [c.index for c in columns.columns]
    more = {h: table.headings.index(h) for h in extra if h in table.headings}
    if is_stamp and columns.fraction is not None:
        numbers.append(columns.fraction)
    times = [columns.time, *columns.beside]
    numbers += [] if is_stamp else times
    texts = [k for k in (*(times if is_stamp else ()), columns.date, columns.cycle, *more.values()) if k is not None]
    cells, told = table.load(list(dict.fromkeys(numbers)), list(dict.fromkeys(t for t in texts if t not in numbers)))
    notes = [*table.notes, *columns.notes, *told]
    time, start, told = read_times(cells, columns, mapping, table, source, is_stamp=is_stamp, rising=rising)
    notes.extend(told)
    data = {}
    for column in columns.columns:
        raw = cells[column.index].to_numpy(dtype=np.float64)
        column.refuse_doubtful(raw, table.headings[column.index], str(source))
        data[column.channel.name], found = column.convert(raw, mapping.read.missing, table.place)
        notes.extend(found)
    left_out = [k for k in columns.left_out if k not in more.values()]
    numeric = [k for k in left_out if table.is_number(k, empty=False)]
    refuse_nameless([table.headings[k] for k in numeric], str(source))
    notes.extend(f"left out: {why_left_out(table.headings[k])}" for k in numeric)
    texts_only = [table.headings[k] for k in left_out if k not in numeric]
    if texts_only:
        notes.append(f"not read, holding no numbers: {', '.join(texts_only)}")
    return Rows(
        source=str(source),
        sha256=sha256,
        time=time,
        start=start or mapping.time.start,
        table=pd.DataFrame(data, copy=False),
        channels=tuple(c.channel for c in columns.columns),
        labels=_labels(cells, columns, table, source),
        extra={h: cells[k].tolist() for h, k in more.items()},
        rule=mapping.cycles,
        aliases=columns.aliases,
        notes=tuple(notes),
        place=table.place,
    )


def make_recording(rows: Rows, time: FloatArray, table: pd.DataFrame, labels: Sequence[Any] | None) -> Recording:
    """Make a recording of rows, or of what was made of them.

    Parameters
    ----------
    rows : Rows
        As read.
    time : ndarray of shape (n,)
        [s]
    table : DataFrame of shape (n, n_kept)
        Some of the channels.
    labels : sequence of object, optional
        Thermal cycle of each row.

    Returns
    -------
    Recording
    """
    recording = Recording(
        name=Path(rows.source).stem,
        time=time,
        table=table,
        channels=tuple(c for c in rows.channels if c.name in table.columns),
        cycles=make_single_cycle(len(time)),
        source=rows.source,
        sha256=rows.sha256,
        start=rows.start,
        aliases=rows.aliases,
        notes=rows.notes,
    )
    return recording.with_cycles(_cycles(recording, labels, rows.rule))


def read_all(paths: Sequence[str | Path], mapping: Mapping | None = None) -> list[Recording]:
    """Read several files, each a test of its own, all by the same mapping.

    Raises
    ------
    InputError
        See `read`.
    """
    return [read(path, mapping) for path in paths]


def write(recording: Recording, path: str | Path, *, overwrite: bool = False) -> None:
    """Write a recording so that `read` gives the same numbers, channels and cycles.

    Channels whose name does not carry their unit are described in the file itself: in a comment line of a CSV file, in
    an attribute of a Parquet file.

    Parameters
    ----------
    recording : Recording
    path : str or Path
        A file ending in .csv or .parquet.
    overwrite : bool

    Raises
    ------
    InputError
        The file exists and `overwrite` is False, its ending is another one, or its folder is not there.
    """
    target = Path(path)
    if target.suffix not in (".csv", ".parquet"):
        raise InputError(f"{target}: a recording is written as .csv or .parquet")
    if target.exists() and not overwrite:
        raise InputError(f"{target}: exists already; choose another name or allow overwriting with --overwrite")
    if not target.parent.is_dir():
        raise InputError(f"{target}: there is no folder {target.parent}; make it first")
    described: dict[str, ColumnMap] = {}
    headings = {}
    for c in recording.channels:
        meaning = understand(c.name)
        known = meaning is not None and (meaning.name, meaning.unit.symbol) == (c.name, c.unit)
        headings[c.name] = c.name if known and not c.place else f"{c.name} [{c.unit}]"
        if headings[c.name] != c.name:
            described[c.name] = ColumnMap(headings[c.name], c.unit, c.quantity, place=c.place)  # type: ignore[arg-type]
    out = recording.table.rename(columns=headings)
    out.insert(0, "time_s", recording.time)
    names = [c.name for c in recording.cycles]
    if len(set(names)) < len(names):
        names = [f"{k}: {name}" for k, name in enumerate(names, start=1)]
    out["cycle"] = np.repeat(names, [len(c) for c in recording.cycles])
    embedded = Mapping(TimeColumn(column="time_s", unit="s", start=recording.start), described)
    needed = bool(described or recording.start)
    text = ADAPTER.dump_json(embedded, exclude_defaults=True).decode() if needed else ""
    with draft(target) as started:
        if target.suffix == ".csv":
            with started.open("x", encoding="utf-8", newline="") as f:
                if text:
                    f.write(f"# {EMBEDDED}: {text}\n")
                out.to_csv(f, index=False, lineterminator="\n")
        else:
            out.attrs = {EMBEDDED: text} if text else {}
            out.to_parquet(started, index=False)


def _open(path: Path, options: ReadOptions) -> tuple[FileTable, str]:
    """Return the raw table and the SHA-256 of the file."""
    ending = path.suffix.lower()
    if ending not in ENDINGS:
        raise RecordingError(
            f"{path}: files ending in {ending or 'nothing'!r} are not read; save it as one of {', '.join(ENDINGS)}"
        )
    try:
        if path.exists() and not (path.is_file() or path.is_dir()):
            raise RecordingError(f"{path}: is a pipe or a device and no file; write what comes from it into a file")
        with path.open("rb") as f:
            sha256 = hashlib.file_digest(f, "sha256").hexdigest()
        if ending in (".xlsx", ".ods"):
            return open_workbook(path, options), sha256
        if ending == ".parquet":
            return open_parquet(path), sha256
        return open_csv(path, options), sha256
    except FileNotFoundError as e:
        others = [p.name for p in path.parent.iterdir()] if path.parent.is_dir() else []
        near = get_close_matches(path.name, others, n=1)
        raise RecordingError(f"{path}: no such file{f'; did you mean {near[0]}?' if near else ''}") from e
    except OSError as e:
        raise RecordingError(f"{path}: cannot be read: {e.strerror or e}") from e


def _described(text: str, source: Path) -> Mapping:
    try:
        return ADAPTER.validate_json(text)
    except ValidationError as e:
        raise RecordingError(
            f"{source}: thermocomp's own description of the columns is damaged ({e.errors()[0]['msg']}); delete the "
            "first line, or give a mapping and write the file anew"
        ) from e
    except InputError as e:
        raise type(e)(f"{source}: {e}") from e


def _labels(cells: pd.DataFrame, columns: ColumnPlan, table: FileTable, source: Path) -> list[Any] | None:
    if columns.cycle is None:
        return None
    labels = cells[columns.cycle]
    if labels.isna().any():
        row = int(np.flatnonzero(labels.isna())[0])
        raise RecordingError(
            f"{source}: {table.place(row)}, column {table.headings[columns.cycle]!r}: the cycle's label is missing; "
            "every row belongs to a cycle"
        )
    return list(labels.tolist())


def _cycles(recording: Recording, labels: Sequence[Any] | None, rule: CycleRule) -> Sequence[Cycle]:
    if labels is not None:
        try:
            return split_by_labels(labels)
        except RecordingError as e:
            raise RecordingError(f"{recording.source}: {e}") from e
    speed = recording.speed
    if speed is None:
        return make_single_cycle(len(recording))
    values = recording.table[speed.name].to_numpy()
    return find_cycles(recording.time, values, min_run=rule.min_run_s, min_stop=rule.min_stop_s)
