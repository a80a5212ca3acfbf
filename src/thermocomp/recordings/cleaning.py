"""Cleaning: removal of sections, shift of clocks, re-zeroing of probes, exchange of channels, resampling.

Values are changed only by steps specified by the user, and each step reports its changes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from thermocomp.core.arrays import BoolArray, FloatArray, IntArray
from thermocomp.core.exceptions import InputError
from thermocomp.core.messages import Message, join
from thermocomp.recordings.rows import Instant, Rows

#: maximum number of locations listed
MOST_LISTED = 40
#: number of rows on each side used to determine the height of a step
_BESIDE = 3
#: times closer than this are equal [s]
_SAME = 1e-6


@dataclass(frozen=True)
class Step:
    """One step of the cleaning, a table ``[[clean]]`` of a mapping.

    Parameters
    ----------
    channels : tuple of str
        Names of the channels concerned.
    do : str
        Operation.
    reason : str
        Reason as text; it is reported with the step.
    """

    channels: tuple[str, ...] = ()
    do: str = ""
    reason: str = ""

    def apply(self, rows: Rows) -> Rows:
        """Return the rows after this cleaning step, with a note on the changes."""
        raise NotImplementedError

    @property
    def name(self) -> str:
        """Name of the cleaning step in messages."""
        return f"[[clean]] do = {self.do!r}"

    def _refuse(self, found: str) -> InputError:
        return InputError(f"{self.name}: {found}")

    def _why(self) -> str:
        return f" ({self.reason})" if self.reason else ""


@dataclass(frozen=True)
class Cut(Step):
    """Remove values, or whole rows if no channel is given.

    Parameters
    ----------
    times : tuple of float, str or pair of them
        Times of rows, and intervals that include both ends.
    """

    times: tuple[Instant | tuple[Instant, Instant], ...] = ()
    do: Literal["cut"] = "cut"

    def __post_init__(self) -> None:
        if not self.times:
            raise self._refuse(
                'specify the rows to cut, such as times = [50.0, [600.0, 660.0]] or ["2024-05-06T08:00:00"]'
            )

    def apply(self, rows: Rows) -> Rows:
        """Return the rows with the specified values set to missing, or without the specified rows."""
        hit = np.zeros(len(rows.time), dtype=np.bool_)
        for t in self.times:
            hit |= self._rows(t, rows)
        at = np.flatnonzero(hit)
        listed = _listed([rows.place(int(k)) for k in at], at)
        if not self.channels:
            if hit.all():
                raise InputError(
                    f"{rows.source}: {self.name}: this would remove all {len(hit)} rows; shorten the times"
                )
            kept = rows.kept(np.flatnonzero(~hit))
            told = Message("cut: {n} of {of} rows{why}: {rows}", n=len(at), of=len(hit), why=self._why(), rows=listed)
            return kept.noted(told)
        table = rows.table.copy()
        names = rows.columns(self.channels, self.name)
        table.loc[hit, names] = np.nan
        note = Message(
            "cut: {n} of {of} values of {names}{why}: {rows}",
            n=len(at),
            of=len(hit),
            names=", ".join(names),
            why=self._why(),
            rows=listed,
        )
        return replace(rows, table=table).noted(note)

    def _rows(self, t: Instant | tuple[Instant, Instant], rows: Rows) -> BoolArray:
        single = not isinstance(t, tuple)
        begin, end = (rows.seconds(v, self.name) for v in (t if isinstance(t, tuple) else (t, t)))
        found: BoolArray = (rows.time >= begin - _SAME) & (rows.time <= end + _SAME)
        if not found.any():
            nearest = float(rows.time[np.argmin(np.abs(rows.time - begin))])
            what = f"at {begin:.10g} s" if single else f"from {begin:.10g} to {end:.10g} s"
            raise InputError(f"{rows.source}: {self.name}: there is no row {what}; the nearest is at {nearest:.10g} s")
        return found


@dataclass(frozen=True)
class Shift(Step):
    """Shift channels in time, such as those of a logger with a wrong clock.

    Parameters
    ----------
    by_s : float
        Offset added to their time [s].
    """

    by_s: float = 0.0
    do: Literal["shift"] = "shift"

    def __post_init__(self) -> None:
        if not self.channels or self.by_s == 0:
            raise self._refuse(
                'specify the channels whose clock is wrong, and the time shift [s]: channels = ["t1_C"] and by_s = '
                "-1200.0"
            )

    def apply(self, rows: Rows) -> Rows:
        """Interpolate the channels at their new times; a spindle speed, which is stepwise, keeps its last value."""
        rows.refuse_twins(self.name)
        table = rows.table.copy()
        wanted = rows.time - self.by_s
        after = np.clip(np.searchsorted(rows.time, wanted - _SAME), 0, len(wanted) - 1)
        exact = np.abs(rows.time[after] - wanted) <= _SAME
        before = np.where(exact, after, after - 1)
        inside = (before >= 0) & (wanted <= rows.time[-1] + _SAME)
        before = np.maximum(before, 0)
        span = np.where(exact, 1.0, rows.time[after] - rows.time[before])
        share = np.where(exact, 0.0, (wanted - rows.time[before]) / np.where(span == 0, 1.0, span))
        steps = {c.name for c in rows.channels if c.quantity == "spindle_speed"}
        for name in rows.columns(self.channels, self.name):
            x = table[name].to_numpy(dtype=np.float64)
            y = x[before] if name in steps else np.where(exact, x[before], x[before] + share * (x[after] - x[before]))
            table[name] = np.where(inside, y, np.nan)
        note = Message(
            "shift: {names} {by:.10g} s {way}{why}; {lost} rows at the end of the test are left without a value",
            names=", ".join(self.channels),
            by=float(abs(self.by_s)),
            way=Message("later" if self.by_s > 0 else "earlier"),
            why=self._why(),
            lost=int(np.count_nonzero(~inside)),
        )
        return replace(rows, table=table).noted(note)


@dataclass(frozen=True)
class Rezero(Step):
    """Offset the values of a probe from a given time onwards, because it was displaced or zeroed during a test.

    Parameters
    ----------
    at : float or str
        Time of the first row that is offset.
    to : float, optional
        New value at this row [internal unit of the channel]. Default: the step is removed, so that the channel is
        continuous.
    until : float or str, optional
        Time of the first row that is no longer offset. Default: the rest of the test is offset.
    """

    at: Instant = 0.0
    to: float | None = None
    until: Instant | None = None
    do: Literal["rezero"] = "rezero"

    def __post_init__(self) -> None:
        if not self.channels:
            raise self._refuse('specify the channel of the probe and the time [s]: channels = ["z_um"] and at = 3600.0')

    def apply(self, rows: Rows) -> Rows:
        """Return the rows with the values of the probe offset."""
        begin = rows.seconds(self.at, self.name)
        end = np.inf if self.until is None else rows.seconds(self.until, self.name)
        moved = (rows.time >= begin - _SAME) & (rows.time < end - _SAME)
        if not moved.any():
            raise InputError(
                f"{rows.source}: {self.name}: there is no row at or after {begin:.10g} s; choose an earlier time"
            )
        first = int(np.argmax(moved))
        table = rows.table.copy()
        notes = []
        for name in rows.columns(self.channels, self.name):
            x = table[name].to_numpy(dtype=np.float64)
            there = np.flatnonzero(moved & np.isfinite(x))
            if not there.size:
                raise InputError(
                    f"{rows.source}: {self.name}: {name} has no value from {begin:.10g} s on; choose another time"
                )
            height = _step(x, first, name, f"{rows.source}: {self.name}") if self.to is None else x[there[0]] - self.to
            table[name] = np.where(moved, x - height, x)
            notes.append(
                Message(
                    "rezero: {name}: {n} values from {row} on by {by:+.6g}{why}",
                    name=name,
                    n=len(there),
                    row=rows.place(first),
                    by=float(-height),
                    why=self._why(),
                )
            )
        return replace(rows, table=table).noted(*notes)


@dataclass(frozen=True)
class Swap(Step):
    """Exchange two channels, for sensors whose plugs were exchanged.

    Parameters
    ----------
    at : float or str
        Time of the first row that is exchanged; all later rows are exchanged as well.
    """

    at: Instant = 0.0
    do: Literal["swap"] = "swap"

    def __post_init__(self) -> None:
        if len(set(self.channels)) != 2:
            raise self._refuse('specify the two channels and the time [s]: channels = ["t1_C", "t2_C"] and at = 3600.0')

    def apply(self, rows: Rows) -> Rows:
        """Return the rows with the values of the two channels exchanged."""
        a, b = rows.columns(self.channels, self.name)
        kinds = {c.name: c.quantity for c in rows.channels}
        if kinds[a] != kinds[b]:
            unlike = f"{a} is a {kinds[a]} and {b} a {kinds[b]}"
            raise InputError(
                f"{rows.source}: {self.name}: {unlike}: only channels of the same quantity can be exchanged"
            )
        begin = rows.seconds(self.at, self.name)
        moved = rows.time >= begin - _SAME
        x, y = rows.table[a], rows.table[b]
        table = rows.table.assign(**{a: np.where(moved, y, x), b: np.where(moved, x, y)})
        note = Message(
            "swap: {a} and {b}, {n} rows from {begin:.10g} s on{why}",
            a=a,
            b=b,
            n=int(moved.sum()),
            begin=float(begin),
            why=self._why(),
        )
        return replace(rows, table=table).noted(note)


@dataclass(frozen=True)
class Resample(Step):
    """Average the rows over equal intervals; each time is the end of its interval, so that no later value is used.

    Parameters
    ----------
    every_s : float
        Length of an interval [s].
    """

    every_s: float = 0.0
    do: Literal["resample"] = "resample"

    def __post_init__(self) -> None:
        if self.channels or not self.every_s > 0:
            raise self._refuse("give the interval of all rows, such as every_s = 60.0, and no channels")

    def apply(self, rows: Rows) -> Rows:
        """Average the rows; an interval without rows is omitted, and a channel without values in it is missing."""
        rows.refuse_twins(self.name)
        number = np.ceil((rows.time - rows.time[0]) / self.every_s - 1e-9).astype(np.int64)
        last = np.flatnonzero(np.diff(number, append=number[-1] + 1))
        mean = rows.table.groupby(number, sort=True).mean().reset_index(drop=True)
        kept = rows.kept(last)
        time = rows.time[0] + number[last] * self.every_s
        note = Message(
            "resample: {n} rows to {left}, averages over {every:.10g} s{why}",
            n=len(rows.time),
            left=len(last),
            every=float(self.every_s),
            why=self._why(),
        )
        return replace(kept, time=time, table=mean).noted(note)


def clean(rows: Rows, steps: Sequence[Step]) -> Rows:
    """Apply the steps of a cleaning in order."""
    for step in steps:
        rows = step.apply(rows)
    return rows


def _step(x: FloatArray, first: int, name: str, owner: str) -> float:
    """Return the jump of a channel at a row relative to its neighbouring changes."""
    before = np.flatnonzero(np.isfinite(x[:first]))[-_BESIDE:]
    after = first + np.flatnonzero(np.isfinite(x[first:]))[:_BESIDE]
    if not before.size or not after.size:
        raise InputError(
            f"{owner}: {name} has no value before or after the given time, so the step there is unknown; give "
            "`to`, the value after it"
        )
    y = x[np.concatenate([before, after])]
    moves = np.concatenate([np.diff(x[before]), np.diff(x[after])])
    slope = float(np.median(moves)) if moves.size else 0.0
    middle = float(np.mean(np.arange(len(before), len(y))) - np.mean(np.arange(len(before))))
    return float(np.mean(x[after]) - np.mean(x[before]) - slope * middle)


def _listed(places: Sequence[str], at: IntArray) -> str:
    """Return locations as text, with consecutive ones combined to a range."""
    if not places:
        return ""
    breaks = np.flatnonzero(np.diff(at) > 1) + 1
    parts = np.split(np.arange(len(at)), breaks)
    words = [
        places[p[0]]
        if len(p) == 1
        else Message("{first} to {last}", first=places[p[0]], last=places[p[-1]].rpartition(" ")[2])
        for p in parts
    ]
    told = join(words[:MOST_LISTED], ", ")
    return Message("{places} ...", places=told) if len(words) > MOST_LISTED else told
