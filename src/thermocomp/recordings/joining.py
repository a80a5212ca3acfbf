"""Recordings of the same hours by several loggers: their clocks brought together, one recording made of them."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from itertools import pairwise
from pathlib import PurePath

import numpy as np
import pandas as pd

from thermocomp.core.arrays import FloatArray
from thermocomp.core.exceptions import InputError
from thermocomp.core.machine import Channel
from thermocomp.recordings.clockoffset import FAR, ClockOffset, agree, find_offset
from thermocomp.recordings.clockpairs import begin
from thermocomp.recordings.cycles import Cycle
from thermocomp.recordings.headings import HOUSE_SUFFIX
from thermocomp.recordings.recording import Recording

#: quantities that change steadily; others, such as a spindle speed, keep the nearest reading
_STEADY = ("temperature", "displacement", "angle", "position", "residual", "correction")
#: readings further apart than this many sampling intervals have a gap between them, which is not interpolated
_GAP = 3.0
#: smallest share of the shorter recording that the other one covers, if they are of the same hours
_SAME_HOURS = 0.5


@dataclass(frozen=True)
class Alignment:
    """How the clock of a recording was brought to that of the first one, and what became of its channels.

    Parameters
    ----------
    name : str
        Name of the recording.
    estimate : ClockOffset or None
        Offset and drift that the recordings tell; None if they tell nothing.
    applied : float
        Time by which its clock is taken to be ahead in the middle of the common hours [s].
    applied_drift : float
        Rate at which it is taken to gain [s/s].
    given : bool
        `applied` was given.
    once : tuple of str
        Its channels that the first recording has, too: left out.
    renamed : dict of str to str
        New names of channels whose name another quantity of the first recording has.
    unstamped : bool
        A recording has no timestamps: they are taken to begin at the same moment.
    """

    name: str
    estimate: ClockOffset | None
    applied: float
    applied_drift: float
    given: bool
    once: tuple[str, ...] = ()
    renamed: tuple[tuple[str, str], ...] = ()
    unstamped: bool = False

    @property
    def notes(self) -> tuple[str, ...]:
        """Channels of the same name, and what became of them."""
        once = f"{self.name}: {', '.join(self.once)} left out: the same as in the first recording"
        names = (f"{self.name}: {a} is not {a} of the first recording: named {b}" for a, b in self.renamed)
        return (*([once] if self.once else []), *names)

    def __str__(self) -> str:
        e = self.estimate
        told = f"the recordings do not tell its offset within {FAR / 3600:.0f} h"
        if e is not None:
            low, high = e.interval
            told = f"{_ahead(e.offset)} by {e.evidence} (90 % interval {low:+.0f} to {high:+.0f} s)"
        if self.given:
            what = f"clock taken as {_ahead(self.applied)}, as given; {told}"
        elif self.applied or self.applied_drift:
            what = f"clock {told}, corrected"
            what += f", with a drift of {1e6 * self.applied_drift:+.0f} ppm" if self.applied_drift else ""
        elif e is not None and e.clear:
            what = f"clocks agree: {told}"
        else:
            doubt = "" if e is None else ", which is too uncertain to be applied"
            what = f"clocks taken as equal: {told}{doubt}. State the offset with --offset if it is known"
        if self.unstamped:
            what += "; without timestamps in both, the recordings are taken to begin together"
        return f"{self.name}: {what}"


def join_two(first: Recording, second: Recording, offset: float | None = None) -> tuple[Recording, Alignment]:
    """Join two recordings of the same hours; see `thermocomp.api.join.join`."""
    found = find_offset(first, second)
    known = found is not None and found.clear and abs(found.offset) > found.half
    applied = offset if offset is not None else found.offset if found is not None and known else 0.0
    drifts = offset is None and found is not None and found.clear and abs(found.drift) > found.drift_half
    drift = found.drift if found is not None and drifts else 0.0
    middle = found.middle if found is not None else 0.0
    stamped = begin(first, second) + second.time
    times = (first.time, stamped - applied - drift * (stamped - applied - middle))
    slower = int(second.sampling_interval > first.sampling_interval)
    grid = times[slower]
    grid = grid[(grid >= max(t[0] for t in times)) & (grid <= min(t[-1] for t in times))]
    if len(grid) < 2:
        raise InputError(_apart(first, second, stamped, applied))
    columns = {c.name: _resampled(first, c, times[0], grid) for c in first.channels}
    channels, once, renamed = [*first.channels], [], []
    for c in second.channels:
        values, name = _resampled(second, c, times[1], grid), c.name
        same = next((o for o in first.channels if o.quantity == c.quantity and _same(o, c, first, second)), None)
        if same is not None and agree(columns[same.name], values):
            once.append(name)
            continue
        if name in columns:
            name = _other_name(c, second.name, columns)
            renamed.append((c.name, name))
        columns[name] = values
        channels.append(replace(c, name=name))
    told = Alignment(
        name=second.name,
        estimate=found,
        applied=applied,
        applied_drift=drift,
        given=offset is not None,
        once=tuple(once),
        renamed=tuple(renamed),
        unstamped=not (first.start and second.start),
    )
    words = {r.compensation for r in (first, second)} - {""}
    started = first.start or second.start
    lone = [a for a in second.aliases.items() if a[1] in columns and a[1] not in once and a[1] not in dict(renamed)]
    joined = Recording(
        name=f"{first.name}+{second.name}",
        time=grid - grid[0],
        table=pd.DataFrame(columns),
        channels=tuple(channels),
        cycles=_cycles((first, second), times, grid),
        start=(datetime.fromisoformat(started) + timedelta(seconds=float(grid[0]))).isoformat() if started else "",
        aliases=dict(lone) | dict(first.aliases),
        notes=(*first.notes, *second.notes, str(told), *told.notes),
        compensation=words.pop() if len(words) == 1 else "unknown" if words else "",
        clocks="; ".join(filter(None, (first.clocks, second.clocks, str(told)))),
        declared=first.declared.over(second.declared),
    )
    return joined, told


def find_joins(recordings: Sequence[Recording]) -> list[list[str]]:
    """Return the commands that join recordings of the same hours of which each has what others lack, as words."""
    commands = []
    for k, probes in enumerate(recordings):
        if not probes.displacements or probes.temperatures:
            continue
        heats = [r for r in recordings if r.temperatures and not r.displacements and _same_hours(r, probes)]
        if heats:
            names = [r.source or r.name for r in (*heats, probes)]
            number = "" if len(recordings) == len(heats) + 1 else f"-{k + 1}"
            commands.append(["thermocomp", "join", *names, "-o", f"joined{number}.parquet"])
    return commands


def suggest_join(recordings: Sequence[Recording]) -> str:
    """Return the advice to join recordings, with the commands of `find_joins`; empty if there is none."""
    commands = list(map(shlex.join, find_joins(recordings)))
    if not commands:
        return ""
    return (
        "the temperatures and the displacements of the same hours are in different files; make one recording of them "
        f"first, which also checks the clocks of the loggers: {'; '.join(commands)}"
    )


def _same_hours(a: Recording, b: Recording) -> bool:
    lead = begin(a, b)
    common = min(a.time[-1], lead + b.time[-1]) - max(0.0, lead)
    return bool(common > _SAME_HOURS * min(a.time[-1], b.time[-1]))


def _same(a: Channel, b: Channel, first: Recording, second: Recording) -> bool:
    """Return whether two channels are named alike, or are the spindle speeds."""
    return a.name == b.name or (a == first.speed and b == second.speed)


def _resampled(recording: Recording, channel: Channel, time: FloatArray, grid: FloatArray) -> FloatArray:
    """Return a channel at other times: between its readings, NaN in gaps; the nearest if it changes in steps."""
    x = recording.table[channel.name].to_numpy(dtype=np.float64)
    there = np.isfinite(x)
    if there.sum() < 2:
        return np.full(len(grid), np.nan)
    t, x = time[there], x[there]
    k = np.clip(np.searchsorted(t, grid), 1, len(t) - 1)
    share = (grid - t[k - 1]) / (t[k] - t[k - 1])
    if channel.quantity not in _STEADY:
        share = np.round(share)
    out = np.where(share == 0, x[k - 1], np.where(share == 1, x[k], x[k - 1] * (1 - share) + x[k] * share))
    exact = np.isin(grid, t)
    gap = (t[k] - t[k - 1] > _GAP * recording.sampling_interval) & ~exact
    return np.asarray(np.where(gap | (grid < t[0]) | (grid > t[-1]), np.nan, out))


def _other_name(channel: Channel, recording: str, taken: dict[str, FloatArray]) -> str:
    suffix = f"_{HOUSE_SUFFIX.get(channel.unit, channel.unit)}"
    base = f"{channel.name.removesuffix(suffix)}_{'_'.join(recording.split())}"
    names = (f"{base}{'' if k == 1 else f'_{k}'}{suffix}" for k in range(1, len(taken) + 2))
    return next(name for name in names if name not in taken)


def _cycles(recordings: Sequence[Recording], times: Sequence[FloatArray], grid: FloatArray) -> tuple[Cycle, ...]:
    """Return the thermal cycles of the recording that has most of them, in the rows of the joined one."""
    k = max(range(len(recordings)), key=lambda i: (len(recordings[i].cycles), recordings[i].speed is not None))
    cycles = recordings[k].cycles
    bounds = [int(np.searchsorted(grid, times[k][c.start])) for c in cycles]
    bounds = [0, *bounds[1:], len(grid)]
    return tuple(Cycle(c.name, a, b) for c, (a, b) in zip(cycles, pairwise(bounds), strict=True) if b > a)


def _ahead(seconds: float) -> str:
    return f"{abs(seconds):.0f} s {'ahead' if seconds >= 0 else 'behind'}"


def _apart(first: Recording, second: Recording, stamped: FloatArray, applied: float) -> str:
    names = " and ".join(PurePath(r.source).name or r.name for r in (first, second))
    late = float(stamped[0]) - applied
    return (
        f"{names} have no hours in common: the first lasts {first.time[-1] / 3600:.2f} h, and the second begins "
        f"{late / 3600:+.2f} h after its start. If a clock is wrong, such as by its time zone, state by how many "
        "seconds the second is ahead: --offset 3600"
    )
