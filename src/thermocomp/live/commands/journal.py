"""``thermocomp journal``: records of the live compensator."""

from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from thermocomp.cli.extras import needs
from thermocomp.cli.jsonoutput import print_json
from thermocomp.cli.options import OptionalOutput
from thermocomp.cli.terminal import console, words
from thermocomp.core.exceptions import InputError
from thermocomp.core.outputs import refuse_existing

if TYPE_CHECKING:
    from thermocomp.live.journal.journalreader import JournalReader, StoredRun


def journal(
    what: Literal["show", "export"],
    path: Path,
    /,
    *,
    output: OptionalOutput = None,
    every: float = 0.0,
    last: int = 20,
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """Summarise a journal of the live compensator, or export it as a recording.

    Parameters
    ----------
    what : {'show', 'export'}
        Action. show: print the number of records and the latest events. export: write a recording for thermocomp fit,
        with the temperatures, the measurements, the correction confirmed by the controller, and the uncompensated
        deviation.
    path : Path
        Path of the journal as in the configuration of the service, to read all files of the journal; or one of these
        files.
    output : Path
        Output recording (.csv or .parquet).
    every : float
        Minimum interval between exported readings [s]; 0: all readings.
    last : int
        Number of most recent events to show.
    overwrite : bool
        Overwrite an existing recording.
    json : bool
        Print results as JSON instead of text.

    Returns
    -------
    int
        0 done.
    """
    from thermocomp.live.journal.journalreader import JournalReader

    if what == "show":
        if output is not None:
            raise InputError("journal show writes no file: omit -o, or use thermocomp journal export")
        _show(JournalReader(path), last, as_json=json)
    else:
        if output is None:
            raise InputError(f"name the recording to write: thermocomp journal export {path} -o recording.csv")
        _export(path, output, every, overwrite, as_json=json)
    return 0


def _export(path: Path, output: Path, every: float, overwrite: bool, *, as_json: bool) -> None:
    from thermocomp.live.journal.journalreader import JournalReader

    with needs("study"):
        from thermocomp.live.journal import journalexport
        from thermocomp.recordings.readers import recordings
    if not every >= 0:
        raise InputError(f"--every {every:g}: must not be negative")
    refuse_existing([output], overwrite, [path])
    found = journalexport.export(JournalReader(path), every)
    recordings.write(found.recording, output, overwrite=overwrite)
    if as_json:
        targets = [{"target": t.name, "measured": t.measured, "known": t.known} for t in found.targets]
        rows, state = len(found.recording), found.recording.compensation
        content = {"file": str(output), "rows": rows, "compensation": state, "targets": targets}
        print_json({**content, "notes": list(found.notes)})
        return
    lines = [f"{output}: {len(found.recording):,} rows, compensation: {found.recording.compensation}"]
    lines += [f"{t.name}: measured in {t.measured:,} rows, deviation known in {t.known:,}" for t in found.targets]
    for line in lines:
        console.print(words(line), soft_wrap=True)
    for note in found.notes:
        console.print(f"[yellow]note[/] {words(note)}", soft_wrap=True)


def _show(reader: "JournalReader", last: int, *, as_json: bool) -> None:
    if not last >= 0:
        raise InputError(f"--last {last}: must not be negative")
    summary = reader.summary()
    events = [(s.row.time, *told(s, reader)) for s in reader.latest(last)]
    if as_json:
        content: dict[str, Any] = {
            "files": [str(p) for p in summary.files],
            "size_bytes": summary.size_bytes,
            "first": _stamp(summary.first),
            "last": _stamp(summary.last),
            "counts": summary.counts,
            "lost": summary.lost,
            "events": [{"time": _stamp(time), "kind": kind, "text": text} for time, kind, text in events],
        }
        print_json(content)
        return
    lines = [f"{len(summary.files)} file(s), {summary.size_bytes / 2**20:.1f} MiB, the newest {summary.files[-1]}"]
    if summary.first is not None:
        lines.append(f"from {_stamp(summary.first)} to {_stamp(summary.last)}")
    lines.append(", ".join(f"{n:,} {kind}" for kind, n in summary.counts.items() if n) or "nothing yet")
    if summary.lost:
        lines.append(f"{summary.lost:,} rows were lost because the disk could not be written")
    for line in (*lines, *(f"{_stamp(time)}  {kind}  {text}" for time, kind, text in events)):
        console.print(words(line), soft_wrap=True)


def told(stored: "StoredRun", reader: "JournalReader") -> tuple[str, str]:
    """Return kind and text of a row of the journal, formatted for display."""
    from thermocomp.live.journal.journalrows import (
        MeasurementRow,
        ReferenceRow,
        StateRow,
        UpdateRow,
        kind_of,
        measured_by,
    )

    row, kind = stored.row, kind_of(stored.row)
    if isinstance(row, MeasurementRow):
        known = measured_by(row, reader.starts[stored.run])
        under = {None: "an unknown correction", False: "no correction"}.get(row.compensated, "a correction")
        if row.in_force is not None and row.compensated:
            under = f"a correction of {row.in_force.at(row.position):+.2f} um"
        text = f"{row.target} {row.kind} {row.value:+.2f} um, measured with {under}, "
        text += "included in the value" if row.includes_offset else "not included in the value"
        text += "; the deviation is not known" if known is None else f"; deviation {known:+.2f} um"
        if row.kind != "probing" and row.includes_offset and row.compensated is not False:
            text += "; the correction is applied twice while it remains in force"
        return kind, text
    if isinstance(row, StateRow):
        return kind, f"{row.target} {row.word}" + (f": {row.reason}" if row.reason else "")
    if isinstance(row, ReferenceRow):
        return kind, f"{row.target} is re-zeroed: {row.why}"
    if isinstance(row, UpdateRow):
        change = f"refused: {row.refused}" if row.refused else f"{row.before:+.2f} to {row.after:+.2f} um"
        return kind, f"{row.target} measured {row.measured:+.2f} um, {change}"
    return kind, ": ".join(str(v) for v in row[1:])


def _stamp(time: float | None) -> str | None:
    if time is None:
        return None
    try:
        return datetime.fromtimestamp(time, UTC).isoformat(timespec="seconds")
    except (ValueError, OverflowError, OSError):  # from a system clock that was never set
        return f"{time:.0f} s"
