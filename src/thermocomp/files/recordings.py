"""Recordings as files: CSV, XLSX and Parquet in, CSV and Parquet out."""

import hashlib
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pydantic import ValidationError

from thermocomp.core.exceptions import InputError, RecordingError
from thermocomp.core.units import unit
from thermocomp.files.columns import Plan, plan, understand, why_left_out
from thermocomp.files.draft import draft
from thermocomp.files.mapping import ADAPTER, ColumnMap, Mapping, ReadOptions, TimeColumn
from thermocomp.files.tables import EMBEDDED, Table, open_parquet, open_xlsx
from thermocomp.files.textfile import open_csv
from thermocomp.recording.cycles import Cycle, find_cycles, given_cycles, whole
from thermocomp.recording.recording import Recording

FloatArray = NDArray[np.float64]

ENDINGS = (".csv", ".tsv", ".txt", ".xlsx", ".parquet")
_CHUNK = 100_000
# Only what cannot be read in two ways: 06/07/2021 needs a mapping. The last two tell the time of day only.
_FORMATS = (
    "ISO8601",
    "%Y/%m/%d %H:%M:%S",
    "%Y/%m/%d-%H:%M:%S",
    "%d.%m.%Y %H:%M:%S",
    "%d.%m.%Y %H:%M:%S.%f",
    "%d.%m.%Y %H:%M",
    "%H:%M:%S",
    "%H:%M:%S.%f",
)


def read(path: str | Path, mapping: Mapping | None = None) -> Recording:
    """Read one test from a file.

    Columns are understood by the unit in their heading (``time_s``, ``t1_C``, ``drift_um``, ``spindle_rpm``,
    ``T1 [degC]``) or by `mapping`. Thermal cycles come from a column ``cycle``, else from the spindle speed.

    Parameters
    ----------
    path : str or Path
        A file ending in .csv, .tsv, .txt, .xlsx or .parquet.
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
    source = Path(path)
    mapping = mapping or Mapping()
    table, sha256 = _open(source, mapping.read)
    if table.embedded:
        mapping = mapping.over(_described(table.embedded, source))
    columns = plan(table.headings, mapping, str(source))
    is_stamp = columns.time_unit == "timestamp" or not (columns.time_unit or table.is_number(columns.time))
    numbers = [c.index for c in columns.columns] + ([] if is_stamp else [columns.time])
    texts = [k for k in (columns.time if is_stamp else None, columns.date, columns.cycle) if k is not None]
    cells = table.load(list(dict.fromkeys(numbers)), texts)
    notes = [*table.notes, *columns.notes]
    time, start = _time(cells, columns, mapping, table, source, is_stamp=is_stamp)
    if not is_stamp and not columns.time_unit:
        notes.append(f"{table.headings[columns.time]!r} has no unit and is taken as seconds")
    data = {}
    for column in columns.columns:
        raw = cells[column.index].to_numpy(dtype=np.float64)
        data[column.channel.name], found = column.convert(raw, mapping.read.missing)
        notes.extend(found)
    numeric = [k for k in columns.left_out if table.is_number(k, empty=False)]
    notes.extend(f"left out: {why_left_out(table.headings[k])}" for k in numeric)
    texts_only = [table.headings[k] for k in columns.left_out if k not in numeric]
    if texts_only:
        notes.append(f"not read, holding no numbers: {', '.join(texts_only)}")
    channels = tuple(c.channel for c in columns.columns)
    recording = Recording(
        name=source.stem,
        time=time,
        table=pd.DataFrame(data, copy=False),
        channels=channels,
        cycles=whole(len(time)),
        source=str(source),
        sha256=sha256,
        start=start or mapping.time.start,
        aliases=columns.aliases,
        notes=tuple(notes),
    )
    return recording.with_cycles(_cycles(recording, cells, columns, mapping, table))


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


def _open(path: Path, options: ReadOptions) -> tuple[Table, str]:
    """Return the raw table and the SHA-256 of the file."""
    ending = path.suffix.lower()
    if ending not in ENDINGS:
        raise RecordingError(
            f"{path}: files ending in {ending or 'nothing'!r} are not read; save it as one of {', '.join(ENDINGS)}"
        )
    try:
        with path.open("rb") as f:
            sha256 = hashlib.file_digest(f, "sha256").hexdigest()
        if ending == ".xlsx":
            return open_xlsx(path), sha256
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


def _time(
    cells: pd.DataFrame, columns: Plan, mapping: Mapping, table: Table, source: Path, *, is_stamp: bool
) -> tuple[FloatArray, str]:
    """Return seconds since the first row, strictly rising, and the ISO timestamp of the first row if known."""
    shown = cells[columns.time]
    start = ""
    if is_stamp:
        if columns.date is not None:
            shown = cells[columns.date].astype(str).str[:10] + " " + shown.astype(str)
        stamps, start = _timestamps(shown, mapping.time.format, table, source, table.headings[columns.time])
        time = np.asarray((stamps - stamps.iloc[0]).dt.total_seconds(), dtype=np.float64)
    else:
        raw = shown.to_numpy(dtype=np.float64)
        time = (raw - raw[0]) * unit(columns.time_unit or "s", "time").scale
        missing = np.flatnonzero(~np.isfinite(raw))
        if missing.size:
            _refuse_missing(table, source, int(missing[0]), table.headings[columns.time])
    wrong = np.flatnonzero(~(np.diff(time) > 0)) + 1
    if wrong.size:
        row = int(wrong[0])
        what = "comes twice" if time[row] == time[row - 1] else f"is before {shown.iloc[row - 1]}"
        more = f" ({wrong.size} rows like this)" if wrong.size > 1 else ""
        steps = np.diff(time)
        # a clock that is set back falls by an hour less one interval
        falls_by_an_hour = abs(steps[row - 1] - np.median(steps) + 3600) < 300
        if is_stamp and falls_by_an_hour and pd.Timestamp(start).tzinfo is None:
            more += ", perhaps as the clock was set back (daylight saving): use UTC, or timestamps with an offset"
        raise RecordingError(
            f"{source}: {table.place(row)}, column {table.headings[columns.time]!r}: time {shown.iloc[row]} {what}, in "
            f"{table.place(row - 1)}{more}; time must rise: delete or correct the row, or split the file into tests"
        )
    return time, start


def _timestamps(
    cells: "pd.Series[Any]", wanted: str, table: Table, source: Path, heading: str
) -> tuple["pd.Series[pd.Timestamp]", str]:
    """Parse timestamps; mixed offsets (summer time) are brought to one clock."""
    if cells.isna().any():
        _refuse_missing(table, source, int(np.flatnonzero(cells.isna())[0]), heading)
    if pd.api.types.is_datetime64_any_dtype(cells.dtype):
        return cells, cells.iloc[0].isoformat()
    text = cells.astype(str)
    first = text.iloc[:1]
    formats = [wanted] if wanted else _FORMATS
    fitting = [f for f in formats if pd.to_datetime(first, format=f, utc=True, errors="coerce").notna().all()]
    if not fitting:
        hint = f"does not fit the format {wanted!r}" if wanted else "is not an ISO timestamp"
        raise RecordingError(
            f"{source}: {table.place(0)}, column {heading!r}: {first.iloc[0]!r} {hint}; say how it is written in a "
            f'mapping: [time] column = "{heading}" and format = "%d/%m/%Y %H:%M:%S"'
        )
    # in parts, and without a cache of the texts seen: pandas makes objects of them, far bigger than the times
    parts = [text.iloc[k : k + _CHUNK] for k in range(0, len(text), _CHUNK)]
    stamps = pd.concat(pd.to_datetime(p, format=fitting[0], utc=True, errors="coerce", cache=False) for p in parts)
    bad = np.flatnonzero(stamps.isna())
    if bad.size:
        row = int(bad[0])
        raise RecordingError(
            f"{source}: {table.place(row)}, column {heading!r}: {text.iloc[row]!r} is not a timestamp like "
            f"{first.iloc[0]!r}; correct or delete the row"
        )
    if fitting[0].startswith("%H"):
        return stamps, ""
    return stamps, pd.to_datetime(first, format=fitting[0]).iloc[0].isoformat()


def _refuse_missing(table: Table, source: Path, row: int, heading: str) -> None:
    raise RecordingError(
        f"{source}: {table.place(row)}, column {heading!r}: the time is missing; fill it in or delete the row"
    )


def _cycles(
    recording: Recording, cells: pd.DataFrame, columns: Plan, mapping: Mapping, table: Table
) -> Sequence[Cycle]:
    if columns.cycle is not None:
        labels = cells[columns.cycle]
        if labels.isna().any():
            row = int(np.flatnonzero(labels.isna())[0])
            raise RecordingError(
                f"{recording.source}: {table.place(row)}, column {table.headings[columns.cycle]!r}: the cycle's label "
                "is missing; every row belongs to a cycle"
            )
        try:
            return given_cycles(labels.tolist())
        except RecordingError as e:
            raise RecordingError(f"{recording.source}: {e}") from e
    speed = recording.speed
    if speed is None:
        return whole(len(recording))
    values = recording.table[speed.name].to_numpy()
    return find_cycles(recording.time, values, min_run=mapping.cycles.min_run_s, min_stop=mapping.cycles.min_stop_s)
