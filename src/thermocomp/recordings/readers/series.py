"""Series of readings with their own times, joined to the columns of one table."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from thermocomp.core.arrays import FloatArray, IntArray
from thermocomp.core.exceptions import RecordingError
from thermocomp.recordings.readers.limits import FileLimits
from thermocomp.recordings.readers.tables import FrameTable, check_headings

#: readings closer than this fraction of the shortest interval of any series form one row
_TOGETHER = 0.25
#: a century [s]
_LONGEST = 3.2e9


@dataclass(frozen=True)
class TimeSeries:
    """Readings of one channel.

    Parameters
    ----------
    heading : str
        Name, with its unit in brackets if it is known.
    times : ndarray of shape (n,)
        Instants [ns], counted from 1970 or from any origin.
    values : ndarray of shape (n,)
        Cells as in the file.
    """

    heading: str
    times: IntArray
    values: NDArray[Any]


@dataclass(frozen=True)
class TimeScale:
    """Meaning of the times of series: heading of their column, and zone (``naive`` without one, empty if relative)."""

    heading: str = "time_s"
    zone: Any = ""

    def column(self, times: IntArray) -> "pd.Series[Any]":
        """Return the time column: timestamps, or seconds from the origin."""
        if self.zone == "":
            return pd.Series(times / 1e9)
        stamps = pd.Series(pd.to_datetime(times, utc=True))
        return stamps.dt.tz_localize(None) if self.zone == "naive" else stamps.dt.tz_convert(self.zone)


def join_series(
    path: Path,
    series: Sequence[TimeSeries],
    clock: TimeScale,
    limits: FileLimits,
    notes: Sequence[str] = (),
    decimal: str = "",
) -> FrameTable:
    """Return the table whose rows are the instants of all series.

    Where series have different times, each value holds until the next one of its series, as loggers that record only
    changes mean it; after the last one no longer than the longest interval of the series.
    """
    series = [_sorted(s) for s in series if len(s.times)]
    if not series:
        raise RecordingError(f"{path}: no readings found; a recording has a time and numbers")
    every = np.unique(np.concatenate([s.times for s in series]))
    limits.check_table(len(every), 1 + len(series), path)
    told = tuple(notes)
    if any(len(s.times) != len(every) for s in series):
        every = _together(every, series)
        told += ("the columns were read at different times: each value holds until the next one of its column",)
    columns = {0: clock.column(every)}
    for k, s in enumerate(series, start=1):
        columns[k] = pd.Series(_hold(s, every), dtype=object)
    headings = (clock.heading, *(s.heading for s in series))
    check_headings(path, headings, len(every), limits)
    return FrameTable(path, headings, pd.DataFrame(columns), range(1, len(every) + 1), notes=told, decimal=decimal)


def seconds_to_ns(seconds: FloatArray) -> IntArray:
    """Return times as whole nanoseconds; `ValueError` if they are too long."""
    if not (np.abs(seconds) < _LONGEST).all():
        raise ValueError("times of over a century")
    return np.round(seconds * 1e9).astype(np.int64)


def _sorted(series: TimeSeries) -> TimeSeries:
    """Return a series in the order of time; of two values at one instant the last."""
    order = np.argsort(series.times, kind="stable")
    times = series.times[order]
    last = np.append(np.diff(times) > 0, True)
    return TimeSeries(series.heading, times[last], series.values[order][last])


def _together(every: IntArray, series: Sequence[TimeSeries]) -> IntArray:
    shortest = min((int(np.diff(s.times).min()) for s in series if len(s.times) > 1), default=0)
    close = np.diff(every) < _TOGETHER * shortest
    return np.asarray(every[np.append(~close, True)])


def _hold(series: TimeSeries, every: IntArray) -> NDArray[Any]:
    at = np.searchsorted(series.times, every, side="right") - 1
    longest = int(np.diff(series.times).max()) if len(series.times) > 1 else 0
    there = (at >= 0) & (every - series.times[at] <= longest)
    cells: NDArray[Any] = series.values.astype(object)[at]
    cells[~there] = None
    return cells
