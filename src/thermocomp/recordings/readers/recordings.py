"""Recordings as files: reading of text, XLSX, ODS, Parquet and MTConnect, writing of CSV and Parquet."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from thermocomp.core.arrays import FloatArray
from thermocomp.core.exceptions import InputError, RecordingError, TwoReadingsError
from thermocomp.core.messages import Message
from thermocomp.files.draft import draft
from thermocomp.recordings.cleaning import clean
from thermocomp.recordings.cycles import Cycle, find_cycles, make_single_cycle, split_at, split_by_labels
from thermocomp.recordings.headings import understand
from thermocomp.recordings.readers.columns import ColumnPlan, plan
from thermocomp.recordings.readers.datecheck import check_dates
from thermocomp.recordings.readers.dayforms import find_day_columns
from thermocomp.recordings.readers.dayhalves import join_halves
from thermocomp.recordings.readers.filecells import FileCells
from thermocomp.recordings.readers.guesses import guess
from thermocomp.recordings.readers.leftout import refuse_nameless, why_left_out
from thermocomp.recordings.readers.limits import FileLimits
from thermocomp.recordings.readers.mapping import ADAPTER, ColumnMap, Mapping, TimeColumn
from thermocomp.recordings.readers.opening import open_table, read_embedded
from thermocomp.recordings.readers.tables import EMBEDDED, FileTable, defuse, restore
from thermocomp.recordings.readers.times import read_times
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.rows import Rows

#: maximum number of notes of one recording, and of characters of a note or an error
_MOST_NOTES = 100
_MOST_SAID = 2_000


def read(path: str | Path, mapping: Mapping | None = None) -> Recording:
    """Read one test from a file.

    Columns are interpreted by the unit in their heading (``time_s``, ``t1_C``, ``drift_um``, ``spindle_rpm``,
    ``T1 [degC]``) or by `mapping`. Thermal cycles come from a column ``cycle``, else from the spindle speed.
    """
    rows = read_rows(path, mapping)
    return make_recording(rows, rows.time, rows.table, rows.labels)


def read_rows(
    path: str | Path, mapping: Mapping | None = None, *, rising: bool = True, extra: Sequence[str] = ()
) -> Rows:
    """Read the rows of a file, converted to house units but not yet cleaned."""
    source = Path(path)
    try:
        return _read_rows(source, mapping or Mapping(), rising=rising, extra=extra)
    except InputError as e:
        text = str(e)
        if len(text) <= _MOST_SAID:
            raise
        half = _MOST_SAID // 2
        raise type(e)(f"{text[:half]} ... {text[-half:]}", e.remedies) from e


def _read_rows(source: Path, mapping: Mapping, *, rising: bool, extra: Sequence[str]) -> Rows:
    table, sha256 = open_table(source, mapping)
    notes = [*table.notes]
    if mapping.read.skip:
        skipped = ", ".join(str(s) if isinstance(s, int) else f"{s[0]}-{s[1]}" for s in mapping.read.skip)
        notes.append(Message("rows skipped by the mapping: {rows}", rows=skipped))
    confirmed = bool(mapping.time.unit)
    if table.embedded:
        described, damage = read_embedded(table.embedded, source)
        mapping = mapping.over(described)
        notes.extend(damage)
    with _guessing(table, mapping):
        columns = plan(table, mapping)
    notes.extend(columns.notes)
    more = {h: table.headings.index(h) for h in extra if h in table.headings}
    file, others, told = _load(source, mapping, table, columns, [*more.values()])
    notes.extend(told)
    time, start, told = _times(file, rising=rising)
    notes.extend(told)
    if not start or columns.times.date is not None:
        notes.extend(check_dates(time, file, others))
    data, changed = {}, list[str]()
    for column in columns.columns:
        raw = file.cells[column.index].to_numpy(dtype=np.float64)
        column.refuse_doubtful(raw, table.headings[column.index], str(source))
        data[column.channel.name], found = column.convert(raw, mapping.read.missing, table.place)
        changed.extend(found)
    left_out = [k for k in columns.left_out if k not in more.values()]
    numeric = [k for k in left_out if table.is_number(k, empty=False)]
    with _guessing(table, mapping):
        refuse_nameless([table.headings[k] for k in numeric], str(source))
    notes.extend(Message("left out: {why}", why=why_left_out(table.headings[k])) for k in numeric[:_MOST_NOTES])
    texts_only = [table.headings[k] for k in sorted({*left_out} - {*numeric})]
    if texts_only:
        notes.append(Message("not read, holding no numbers: {names}", names=", ".join(texts_only)))
    rows = Rows(
        source=str(source),
        sha256=sha256,
        time=time,
        start=start or mapping.time.start,
        table=pd.DataFrame(data, copy=False),
        channels=tuple(c.channel for c in columns.columns),
        labels=_labels(file),
        extra={h: file.cells[k].tolist() for h, k in more.items()},
        min_run=mapping.cycles.min_run_s,
        min_stop=mapping.cycles.min_stop_s,
        starts=mapping.cycles.starts,
        most_cycles=mapping.limits.cycles,
        aliases=columns.aliases,
        notes=_shorten(notes, len(numeric)),
        changed=_shorten(changed, 0),
        place=table.place,
        compensation=mapping.compensation,
        time_unit="timestamp" if file.is_stamp else "" if confirmed else columns.time_unit or "s",
        clocks=mapping.clocks,
        declared=mapping.declared,
    )
    return _zeroed(clean(rows, mapping.clean), columns) if mapping.clean else rows


def _load(
    source: Path, mapping: Mapping, table: FileTable, columns: ColumnPlan, extra: Sequence[int]
) -> tuple[FileCells, list[int], tuple[str, ...]]:
    """Read the planned columns and possible date columns; return the cells, the positions of the latter, and notes."""
    times = columns.times
    is_stamp = columns.time_unit == "timestamp" or not (columns.time_unit or table.is_number(times.time))
    clocks = [times.time, *columns.beside]
    numbers = [c.index for c in columns.columns]
    numbers += [times.fraction] if is_stamp and times.fraction is not None else []
    known = {*numbers, *clocks, columns.cycle, times.date, times.half, times.fraction, *times.unused}
    unknown = [k for k, h in enumerate(table.headings) if h and k not in known]
    others = find_day_columns(table, unknown, beside_clock=is_stamp)
    maybe = [times.date, times.half, *times.unused, *others, columns.cycle, *extra]
    if is_stamp:
        maybe = [*clocks, *maybe]
    else:
        numbers += clocks
    texts = [k for k in maybe if k is not None and k not in numbers]
    cells, notes = table.load(list(dict.fromkeys(numbers)), list(dict.fromkeys(texts)))
    if is_stamp and times.half is not None:
        names = table.headings[times.time], table.headings[times.half]
        both = cells[times.time], cells[times.half]
        cells[times.time], told = join_halves(*both, mapping.time.format, table, names)
        notes += told
    file = FileCells(source=source, mapping=mapping, table=table, columns=columns, cells=cells, is_stamp=is_stamp)
    return file, others, notes


def make_recording(rows: Rows, time: FloatArray, table: pd.DataFrame, labels: Sequence[Any] | None) -> Recording:
    """Return a recording made from rows or their cleaned values.

    Parameters
    ----------
    time : ndarray of shape (n,)
        [s]
    table : DataFrame of shape (n, n_kept)
        Selected channels.
    """
    origin = float(time[0])
    recording = Recording(
        name=Path(rows.source).stem,
        time=time - origin if origin else time,
        table=table,
        channels=tuple(c for c in rows.channels if c.name in table.columns),
        cycles=make_single_cycle(len(time)),
        source=rows.source,
        sha256=rows.sha256,
        start=_later(rows.start, origin),
        origin=origin,
        aliases=rows.aliases,
        notes=(*rows.notes, *rows.changed, *filter(None, [rows.clocks])),
        changed=rows.changed,
        compensation=rows.compensation,
        time_unit=rows.time_unit,
        clocks=rows.clocks,
        declared=rows.declared,
    )
    return recording.with_cycles(_cycles(recording, labels, rows))


def write(recording: Recording, path: str | Path, *, overwrite: bool = False) -> None:
    """Write a recording so that `read` gives the same numbers, channels and cycles.

    Channels whose name does not contain their unit are described in the file itself: in a comment line of a CSV file,
    in an attribute of a Parquet file.
    """
    target = Path(path)
    if target.suffix not in (".csv", ".parquet"):
        raise InputError(f"{target}: a recording can only be written as .csv or .parquet; change the file extension")
    as_text = target.suffix == ".csv"
    described: dict[str, ColumnMap] = {}
    headings = {}
    for c in recording.channels:
        meaning = understand(c.name)
        said = meaning and (meaning.name, meaning.unit.symbol, meaning.unit.quantity)
        known = said == (c.name, c.unit, c.quantity)
        heading = c.name if known else f"{c.name} [{c.unit}]".strip()
        if not known or c.place:
            column = "" if known else heading
            described[c.name] = ColumnMap(column, c.unit, c.quantity, place=c.place)  # type: ignore[arg-type]
        headings[c.name] = _as_written(heading, as_text=as_text)
    out = recording.table.rename(columns=headings)
    out.insert(0, "time_s", recording.time)
    names = [c.name for c in recording.cycles]
    if len(set(names)) < len(names):
        names = [f"{k}: {name}" for k, name in enumerate(names, start=1)]
    names = [_as_written(name, as_text=as_text) for name in names]
    out["cycle"] = np.repeat(names, [len(c) for c in recording.cycles])
    time = TimeColumn(column="time_s", unit="s", start=recording.start)
    embedded = Mapping(
        time,
        described,
        compensation=recording.compensation,  # type: ignore[arg-type]
        clocks=recording.clocks,
        **vars(recording.declared),
    )
    needed = embedded != Mapping(time) or bool(recording.start)
    text = ADAPTER.dump_json(embedded, exclude_defaults=True).decode() if needed else ""
    with draft(target, overwrite=overwrite) as started:
        if as_text:
            with started.open("x", encoding="utf-8", newline="") as f:
                if text:
                    f.write(f"# {EMBEDDED}: {text}\n")
                out.to_csv(f, index=False, lineterminator="\n")
        else:
            out.attrs = {EMBEDDED: text} if text else {}  # pandas keeps these when it reads and rewrites the file
            out.to_parquet(started, index=False)


def _as_written(name: str, *, as_text: bool) -> str:
    """Return a heading or label to write: reading restores it, and in a text file no spreadsheet evaluates it."""
    return defuse(name) if as_text or restore(name) != name else name


def _zeroed(rows: Rows, columns: ColumnPlan) -> Rows:
    """Re-zero columns that are relative to their first value if the first rows were removed."""
    table = rows.table
    for name in (c.channel.name for c in columns.columns if c.rule.zero == "first"):
        x = table[name].to_numpy(dtype=np.float64)
        there = np.flatnonzero(np.isfinite(x))
        if there.size and x[there[0]]:
            table = table.assign(**{name: x - x[there[0]]})
    return replace(rows, table=table)


def _later(start: str, seconds: float) -> str:
    """Return a timestamp offset by a number of seconds."""
    return (datetime.fromisoformat(start) + timedelta(seconds=seconds)).isoformat() if start and seconds else start


@contextmanager
def _guessing(table: FileTable, mapping: Mapping) -> Iterator[None]:
    """Add suggested mapping entries, guessed from names and values, to an error about columns."""
    try:
        yield
    except RecordingError as e:
        e.remedies = e.remedies or guess(table, mapping)
        # a unit of time determines the duration of the recording and must not be guessed
        if any(r.get("time", {}).get("unit") in ("ms", "s", "min", "h") for r in e.remedies):
            raise TwoReadingsError(str(e), e.remedies) from e
        raise


def _times(file: FileCells, *, rising: bool) -> tuple[FloatArray, str, tuple[str, ...]]:
    where = f"{file.source}: column {file.heading!r}"
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            time, start, notes = read_times(file, rising=rising)
    except (ValueError, OverflowError, TypeError) as e:  # an invalid format, or a year out of range
        raise RecordingError(
            f"{where}: the times cannot be read ({e}); correct [time] format in the mapping or in the file's first line"
        ) from e
    if not np.isfinite(time).all():
        raise RecordingError(f"{where}: the times are too far apart to be represented; correct them")
    return time, start, notes


def _shorten(notes: Sequence[str], left_out: int) -> tuple[str, ...]:
    """Return notes limited in number and length, and the number of the omitted ones."""
    found = [n if len(n) <= _MOST_SAID else f"{n[:_MOST_SAID]} ..." for n in notes]
    more = max(len(found) - _MOST_NOTES, 0) + max(left_out - _MOST_NOTES, 0)
    return (*found[:_MOST_NOTES], *([Message("left out or replaced: {n:,} more columns", n=more)] if more else []))


def _labels(file: FileCells) -> list[Any] | None:
    cycle = file.columns.cycle
    if cycle is None:
        return None
    labels = file.cells[cycle]
    for row in np.flatnonzero(labels.isna())[:1]:
        raise file.refuse_row(
            int(row), "the label of the thermal cycle is missing; fill it in, since every row belongs to a cycle", cycle
        )
    return [restore(label) if isinstance(label, str) else label for label in labels.tolist()]


def _cycles(recording: Recording, labels: Sequence[Any] | None, rows: Rows) -> tuple[Cycle, ...]:
    values = None if recording.speed is None else recording.table[recording.speed.name].to_numpy()
    try:
        if rows.starts:
            starts = [rows.seconds(at, "[cycles] starts") - recording.origin for at in rows.starts]
            found = split_at(recording.time, starts, values)
        elif labels is not None:
            found = split_by_labels(labels)
        elif values is None:
            found = make_single_cycle(len(recording))
        else:
            found = find_cycles(recording.time, values, min_run=rows.min_run, min_stop=rows.min_stop)
    except RecordingError as e:
        raise RecordingError(f"{recording.source}: {e}") from e
    FileLimits(cycles=rows.most_cycles).check("cycles", len(found), recording.source)
    return found
