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
from thermocomp.core.messages import Message

Severity = Literal["trouble", "warning", "info"]
SEVERITIES: tuple[Severity, ...] = ("trouble", "warning", "info")


@dataclass(frozen=True)
class Finding:
    """A result of the checks of a recording.

    Parameters
    ----------
    severity : {'trouble', 'warning', 'info'}
        ``trouble``: a model fitted to these data would be wrong; repair them first.
    channel : str
        Name of the channel; empty if the finding concerns the whole recording.
    kind : str
        Kind of finding, such as ``gap`` or ``stuck``.
    text : str
        One sentence: location, size, and action. Rows are counted from 0, as in the table of the recording. Usually a
        `Message`, whose template and values a program or another language can use.
    rows : ndarray of int, optional
        Rows concerned, if the others are valid; None if the finding concerns the whole channel or recording.
    row : int, optional
        Row where a persistent problem or a gap starts; position of a mark in a figure.
    remedy : Remedy, optional
        Mapping entry that would repair it, with the channel names and times of the recording; None if there is none.
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
    """A channel with its usable rows.

    Parameters
    ----------
    values : ndarray of shape (n_rows,)
        Values in the unit of the channel.
    good : ndarray of bool of shape (n_rows,)
        Rows with a finite, plausible number that is not an error code; later also without spikes and stuck values.
    probed : bool
        The channel is measured in probing cycles only, together with others.
    """

    channel: Channel
    values: FloatArray
    good: BoolArray
    probed: bool = False

    @cached_property
    def rows(self) -> IntArray:
        """Numbers of the rows with a usable value."""
        return np.flatnonzero(self.good)

    @cached_property
    def x(self) -> FloatArray:
        """Usable values of the channel."""
        return self.values[self.good]

    @cached_property
    def smooth(self) -> FloatArray:
        """Running median over 21 good rows, or all if fewer."""
        width = min(21, (len(self.x) - 1) // 2 * 2 + 1)
        median = pd.Series(self.x).rolling(width, center=True, min_periods=(width + 1) // 2).median()
        return median.to_numpy(dtype=np.float64)

    @cached_property
    def span(self) -> float:
        """Range of the smooth values; range of the good values if this is 0."""
        return float(np.ptp(self.smooth)) or float(np.ptp(self.x))

    @cached_property
    def noise(self) -> float:
        """Robust standard deviation of the noise from row to row, from second differences."""
        return 1.4826 * float(np.median(np.abs(np.diff(self.x, n=2)))) / 6**0.5

    def without(self, rows: IntArray) -> "Signal":
        """Return the signal with some rows marked as unusable."""
        good = self.good.copy()
        good[rows] = False
        return replace(self, good=good)


def runs(x: NDArray[np.generic]) -> tuple[IntArray, IntArray]:
    """Return start and length of each run of equal values."""
    starts = np.concatenate([[0], np.flatnonzero(x[1:] != x[:-1]) + 1])
    return starts, np.diff(starts, append=len(x))


def cut(name: str, rows: IntArray, time: FloatArray, reason: str) -> Remedy:
    """Return the cleaning step that removes values of a channel.

    Parameters
    ----------
    time : ndarray of shape (n_rows,)
        [s]
    """
    ordered = np.unique(rows)
    parts = np.split(ordered, np.flatnonzero(np.diff(ordered) > 1) + 1)
    times = [float(time[p[0]]) if len(p) == 1 else [float(time[p[0]]), float(time[p[-1]])] for p in parts if len(p)]
    return {"clean": [{"do": "cut", "channels": [name], "times": times, "reason": reason}]}


def cut_out(severity: Severity, channel: Channel, kind: str, text: str, rows: IntArray, time: FloatArray) -> Finding:
    """Return a finding whose remedy is to remove the values concerned.

    Parameters
    ----------
    time : ndarray of shape (n_rows,)
        Times of all rows [s].
    """
    remedy = cut(channel.name, rows, time, kind)
    return Finding(severity=severity, channel=channel.name, kind=kind, text=text, rows=rows, remedy=remedy)


def column(name: str, **keys: object) -> Remedy:
    """Return the mapping entry for the column of a channel."""
    return {"columns": {name: keys}}


def at_row(row: int, time: FloatArray) -> Message:
    """Return a row as text: its number and its time [s]."""
    return Message("row {row} ({time:.10g} s)", row=row, time=float(time[row]))


def speed_changes(speed: FloatArray | None, n: int) -> BoolArray:
    """Return a mask of row-to-row steps, (n - 1,), with a change of spindle speed of over 2 % of its maximum."""
    if speed is None or n < 2:
        return np.zeros(max(n - 1, 0), dtype=np.bool_)
    return np.asarray(np.abs(np.diff(speed)) > 0.02 * max(float(np.abs(speed).max()), 1e-9))
