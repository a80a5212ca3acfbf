"""`Finding` and `Signal`: results and input of the checks of a recording."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from thermocomp.core.arrays import BoolArray, FloatArray, IntArray
from thermocomp.core.exceptions import Remedy
from thermocomp.core.machine import Channel

Severity = Literal["trouble", "warning", "info"]
SEVERITIES: tuple[Severity, ...] = ("trouble", "warning", "info")


@dataclass(frozen=True)
class Finding:
    """One thing a user should know about a recording.

    Parameters
    ----------
    severity : {'trouble', 'warning', 'info'}
        ``trouble``: a model fitted to this would be wrong; mend it first.
    channel : str
        Empty if it concerns the whole recording.
    kind : str
        Such as ``gap`` or ``stuck``.
    text : str
        One sentence: where, how much, what to do. Rows are counted from 0, as in the recording's table.
    rows : ndarray of int, optional
        The rows it concerns, where the others are sound; None if it concerns the whole channel or recording.
    row : int, optional
        Row where a lasting trouble begins, or a gap: a position for a mark in a figure.
    remedy : Remedy, optional
        Mapping entry that would repair it, with the recording's names of channels and its times; None: there is none.
    """

    severity: Severity
    channel: str
    kind: str
    text: str
    rows: IntArray | None = field(default=None, compare=False, repr=False)
    row: int | None = field(default=None, compare=False, repr=False)
    remedy: Remedy | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, eq=False)
class Signal:
    """A channel with the rows that can be looked at.

    Parameters
    ----------
    channel : Channel
    values : ndarray of shape (n_rows,)
        In the channel's unit.
    good : ndarray of bool of shape (n_rows,)
        Rows with a finite, plausible number that is no code; later without spikes and what sticks too.
    probed : bool
        Measured in probing cycles only, together with others.
    """

    channel: Channel
    values: FloatArray
    good: BoolArray
    probed: bool = False

    @cached_property
    def rows(self) -> IntArray:
        """The good rows."""
        return np.flatnonzero(self.good)

    @cached_property
    def x(self) -> FloatArray:
        """Values in the good rows."""
        return self.values[self.good]

    @cached_property
    def span(self) -> float:
        """Range of a running median over 21 good rows, or as many as there are; that of all of them if it is 0."""
        width = min(21, (len(self.x) - 1) // 2 * 2 + 1)
        smooth = pd.Series(self.x).rolling(width, center=True, min_periods=(width + 1) // 2).median().to_numpy()
        return float(np.ptp(smooth)) or float(np.ptp(self.x))

    @cached_property
    def noise(self) -> float:
        """Robust standard deviation of the noise from row to row, by second differences."""
        return 1.4826 * float(np.median(np.abs(np.diff(self.x, n=2)))) / 6**0.5

    def without(self, rows: IntArray) -> "Signal":
        """Return the same with fewer good rows."""
        good = self.good.copy()
        good[rows] = False
        return replace(self, good=good)


def runs(x: NDArray[np.generic]) -> tuple[IntArray, IntArray]:
    """Return start and length of each stretch of equal values."""
    starts = np.concatenate([[0], np.flatnonzero(x[1:] != x[:-1]) + 1])
    return starts, np.diff(starts, append=len(x))


def cut(name: str, rows: IntArray, time: FloatArray, reason: str) -> Remedy:
    """Return the cleaning step that takes values of a channel out.

    Parameters
    ----------
    name : str
        The channel.
    rows : ndarray of int
    time : ndarray of shape (n_rows,)
        [s]
    reason : str
    """
    ordered = np.unique(rows)
    parts = np.split(ordered, np.flatnonzero(np.diff(ordered) > 1) + 1)
    times = [float(time[p[0]]) if len(p) == 1 else [float(time[p[0]]), float(time[p[-1]])] for p in parts if len(p)]
    return {"clean": [{"do": "cut", "channels": [name], "times": times, "reason": reason}]}


def cut_out(severity: Severity, channel: Channel, kind: str, text: str, rows: IntArray, time: FloatArray) -> Finding:
    """Return a finding whose remedy is to take out the values that it concerns.

    Parameters
    ----------
    severity, channel, kind, text, rows
        See `Finding`.
    time : ndarray of shape (n_rows,)
        Times of all rows [s].
    """
    remedy = cut(channel.name, rows, time, kind)
    return Finding(severity=severity, channel=channel.name, kind=kind, text=text, rows=rows, remedy=remedy)


def column(name: str, **keys: object) -> Remedy:
    """Return the mapping entry for the column of a channel."""
    return {"columns": {name: keys}}


def at_row(row: int, time: FloatArray) -> str:
    """Return a row in words: its number and its time [s]."""
    return f"row {row} ({time[row]:.10g} s)"


def count(n: int, what: str) -> str:
    """Return a number of things in words."""
    return f"{n} {what}{'' if n == 1 else 's'}"


def speed_changes(speed: FloatArray | None, n: int) -> BoolArray:
    """Return the steps from row to row, (n - 1,), in which the spindle speed changes by over 2 % of its largest."""
    if speed is None or n < 2:
        return np.zeros(max(n - 1, 0), dtype=np.bool_)
    return np.asarray(np.abs(np.diff(speed)) > 0.02 * max(float(np.abs(speed).max()), 1e-9))
