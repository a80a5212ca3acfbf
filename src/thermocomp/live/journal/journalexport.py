"""Conversion of a journal to a recording: measurements, corrections in force, and uncompensated deviations."""

from array import array
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import NamedTuple, TypeVar

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from thermocomp.core.correction import Correction, uncompensated
from thermocomp.core.exceptions import InputError
from thermocomp.core.machine import Channel
from thermocomp.live.journal.journalreader import JournalReader
from thermocomp.live.journal.journalrows import (
    ConfirmationRow,
    MeasurementRow,
    ReadingRow,
    StartRow,
    TargetRow,
    measured_by,
)
from thermocomp.recordings.compensated import beside
from thermocomp.recordings.cycles import find_cycles, make_single_cycle
from thermocomp.recordings.recording import Recording

FloatArray = NDArray[np.float64]
_T = TypeVar("_T", Channel, TargetRow)
_KINDS = ("reading", "confirmation", "measurement")
#: maximum time between a probing and the reading that it is assigned to [s]
NEAR = 60.0
#: readings closer than this count as simultaneous [s]
_AT_ONCE = 1e-5


class ExportedTarget(NamedTuple):
    """Number of rows of a target with a measurement, and with a known uncompensated deviation."""

    name: str
    measured: int  #: number of rows with a measurement
    known: int  #: number of these rows with a known uncompensated deviation


class Exported(NamedTuple):
    """A journal converted to a recording."""

    recording: Recording
    targets: tuple[ExportedTarget, ...]
    notes: tuple[str, ...]


class _Confirmed:
    """Corrections of one target confirmed by the controller in one run."""

    def __init__(self) -> None:
        self.time, self.numbers = array("d"), array("d")

    def add(self, time: float, c: Correction) -> None:
        self.time.append(time)
        self.numbers.extend((c.offset, c.slope, c.reference_position))

    def at(self, time: FloatArray, position: float, within: float) -> FloatArray:
        """Return the correction in force at a position [um]; nan where the last confirmation is older than `within`."""
        stamps, numbers = np.array(self.time), np.array(self.numbers).reshape(-1, 3)
        k = np.searchsorted(stamps, time, side="right") - 1
        fresh = (k >= 0) & (time - stamps[k] <= within)
        offset, slope, reference = numbers[k].T
        return np.where(fresh, offset + slope * 1e-3 * (position - reference), np.nan)


class _Found(NamedTuple):
    """Readings, measurements and corrections in a journal, in order of time."""

    time: FloatArray  #: (n,) time of the readings [s]
    run: NDArray[np.int64]  #: (n,)
    values: FloatArray  #: (n, n_channels)
    confirmed: dict[tuple[int, str], _Confirmed]
    measured: list[tuple[int, MeasurementRow]]
    overtaken: int  #: number of rows omitted because a clock was set back after them


def export(reader: JournalReader, every: float = 0.0) -> Exported:
    """Return the recording contained in a journal.

    A target that was measured, by a displacement channel of its name or by probings, has three columns, here for
    ``z_um``: ``z_residual_um``, the measured residual; ``z_correction_um``, the correction in force confirmed by the
    controller; and ``z_um``, the uncompensated deviation for a model to learn, empty unless the other two are known.
    The deviation is unknown while the controller compensates, or may compensate, by itself.

    Parameters
    ----------
    every : float
        Minimum interval of the exported readings [s].
    """
    channels = _same([c for s in reader.starts.values() for c in s.channels])
    targets = _same([t for s in reader.starts.values() for t in s.targets])
    found = _read(reader, channels, every)
    columns = {c.name: found.values[:, k] for k, c in enumerate(channels)}
    listed = [c for c in channels if c.name not in {t.name for t in targets}]
    table = {c.name: columns[c.name] for c in listed}
    told: list[ExportedTarget] = []
    notes: list[str] = []
    in_force = False
    for target in targets:
        residual, correction, deviation = _parted(target, found, reader.starts, columns.get(target.name), notes)
        in_force |= bool(np.isfinite(correction).any())
        measured = np.isfinite(residual) | np.isfinite(deviation)
        told.append(ExportedTarget(target.name, int(measured.sum()), int(np.isfinite(deviation).sum())))
        named = zip(beside(target.name), ("residual", "correction"), (residual, correction), strict=True)
        parts = [(Channel(name, quantity, "um"), values) for name, quantity, values in named]
        if target.quantity != "displacement":
            parts = []  # for an angle only the deviation is known
        if measured.any():
            parts.insert(0, (Channel(target.name, target.quantity, target.unit), deviation))
        else:
            parts = parts[1:]
        for channel, values in parts:
            if channel.name in table:
                raise InputError(f"{reader.paths[0]}: {channel.name} would occur twice; rename a channel or target")
            listed.append(channel)
            table[channel.name] = values
        if (unknown := told[-1].measured - told[-1].known) > 0:
            notes.append(
                f"{target.name}: of {told[-1].measured:,} rows with a measurement, {unknown:,} have no deviation: the "
                "correction in force is not known"
            )
    left_out = sum(m.kind != "probing" for _, m in found.measured)
    if left_out:
        notes.append(
            f"{left_out:,} work offsets and tool lengths are not exported: workpiece and tool are new each time"
        )
    if found.overtaken:
        notes.append(
            f"{found.overtaken:,} rows are not exported: the clock was set back after them, and their times occurred "
            "again"
        )
    if lost := reader.summary().lost:
        notes.append(f"{lost:,} rows were lost while the disk could not be written")
    known = any(t.known for t in told) or (in_force and not any(t.measured for t in told))
    time = np.round(found.time - found.time[0], 6)
    speed = next((table[c.name] for c in listed if c.quantity == "spindle_speed"), None)
    recording = Recording(
        name=reader.paths[-1].name,
        time=time,
        table=pd.DataFrame(table, index=range(len(time))),
        channels=tuple(listed),
        cycles=tuple(make_single_cycle(len(time)) if speed is None else find_cycles(time, speed)),
        start=_stamp(float(found.time[0])),
        notes=tuple(notes),
        compensation="known" if known else "unknown",
    )
    return Exported(recording, tuple(told), tuple(notes))


def _stamp(time: float) -> str:
    try:
        return datetime.fromtimestamp(time, UTC).isoformat()
    except (ValueError, OverflowError, OSError):  # from a system clock that was never set
        return ""


def _same(things: Sequence[_T]) -> list[_T]:
    """Return each item once; raise an error for different items of the same name."""
    found: dict[str, _T] = {}
    for thing in things:
        other = found.setdefault(thing.name, thing)
        if (other.quantity, other.unit) != (thing.quantity, thing.unit):
            raise InputError(
                f"{thing.name} is a {thing.quantity} in {thing.unit} in one run and a {other.quantity} in {other.unit} "
                "in another: export the files one by one"
            )
    return list(found.values())


def _read(reader: JournalReader, channels: Sequence[Channel], every: float) -> _Found:
    time, run, values = array("d"), array("q"), array("d")
    confirmed: dict[tuple[int, str], _Confirmed] = {}
    measured: list[tuple[int, MeasurementRow]] = []
    overtaken, left = reader.overtaken(), 0
    for stored in reader.rows(_KINDS):
        row = stored.row
        if overtaken(stored):
            left += 1
            continue
        if isinstance(row, ReadingRow):
            if not time or row.time - time[-1] >= max(every, _AT_ONCE):
                time.append(row.time)
                run.append(stored.run)
                values.extend(row.values.get(c.name, np.nan) for c in channels)
        elif isinstance(row, ConfirmationRow):
            confirmed.setdefault((stored.run, row.target), _Confirmed()).add(row.time, row.correction)
        elif isinstance(row, MeasurementRow):
            measured.append((stored.run, row))
    if not time:
        raise InputError(f"{reader.paths[0]}: the journal contains no reading yet")
    return _Found(
        time=np.array(time),
        run=np.array(run),
        values=np.array(values).reshape(len(time), -1),
        confirmed=confirmed,
        measured=measured,
        overtaken=left,
    )


def _parted(
    target: TargetRow, found: _Found, starts: dict[int, StartRow], channel: FloatArray | None, notes: list[str]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return residual, correction in force and uncompensated deviation of a target, (n,) each."""
    n = len(found.time)
    correction = np.full(n, np.nan)
    for run, start in starts.items():
        rows = found.run == run
        own = next((t for t in start.targets if t.name == target.name), None)
        if own is not None and start.own_compensation == "off" and (run, target.name) in found.confirmed:
            confirmed = found.confirmed[run, target.name]
            correction[rows] = confirmed.at(found.time[rows], own.position, start.confirm_within)
    probings = [(run, m) for run, m in found.measured if m.target == target.name and m.kind == "probing"]
    if channel is not None and np.isfinite(channel).any():
        if probings:
            notes.append(
                f"{target.name}: {len(probings):,} probings are not exported: the displacement channel is exported "
                "instead"
            )
        return channel, correction, uncompensated(channel, correction)
    residual, deviation = np.full(n, np.nan), np.full(n, np.nan)
    far = 0
    for run, m in probings:
        away = np.where(found.run == run, np.abs(found.time - m.time), np.inf)
        k = int(np.argmin(away))
        if away[k] > NEAR:
            far += 1
            continue
        confirmed = found.confirmed.get((run, m.target), _Confirmed())
        known = _in_force(m, starts[run], confirmed)
        told = measured_by(m._replace(in_force=None if np.isnan(known) else Correction(known)), starts[run])
        deviation[k] = np.nan if told is None else told
        correction[k] = known
        residual[k] = m.value + known if m.includes_offset else m.value
    if far:
        notes.append(f"{target.name}: {far:,} probings are not exported: there is no reading within {NEAR:g} s")
    return residual, correction, deviation


def _in_force(m: MeasurementRow, start: StartRow, confirmed: _Confirmed) -> float:
    """Return the correction in force at the position and time of a measurement [um]; nan if unknown."""
    if start.own_compensation != "off":
        return float("nan")
    if m.in_force is not None:
        return m.in_force.at(m.position)
    if not confirmed.time:
        return float("nan")
    return float(confirmed.at(np.array([m.time]), m.position, start.confirm_within)[0])
