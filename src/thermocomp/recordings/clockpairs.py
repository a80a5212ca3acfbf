"""What two loggers recorded of the same cause: the same channels, or responses to the spindle or to heat."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np

from thermocomp.core import lagbank
from thermocomp.core.arrays import FloatArray
from thermocomp.core.machine import Channel
from thermocomp.recordings.recording import Recording

#: width of the rows in the coarse search, and of the means of temperatures that explain [s]; largest number of means
COARSE = 60.0
_MOST = 6000
#: number of parts of a recording whose agreement gives the interval
PARTS = 12
#: smallest number of rows, also of means over `COARSE`
LEAST = 5 * PARTS
#: time constants of the responses to the spindle [s]
_LAGS = (30.0, 120.0, 400.0, 1200.0, 3600.0, 10800.0)
#: half-width of the 90 % interval of the delay of a displacement or temperature behind the spindle, and of a
#: displacement behind or before the temperatures [s]: on a measured machine (fl_thermal) the regression found its
#: displacements 99 s before the spindle
_DELAYED, _HEATED = 120.0, 600.0
#: half-width of the 90 % interval of an event between two rows, in sampling intervals
_SAMPLED = 0.45
#: smallest share of rows in which a channel must have a value
_THERE = 0.8
#: width of the means of a temperature that both loggers have, if five rows are not longer [s]
_SMOOTHED = 300.0
#: half-width of the 90 % interval of the difference in delay of two sensors in one place [s]
_SENSORS = 10.0


@dataclass(frozen=True, eq=False)
class ClockPair:
    """Features recorded by one logger that explain channels recorded by the other.

    Parameters
    ----------
    time : ndarray of shape (n,)
        Times of the features [s].
    features : ndarray of shape (n, n_features)
    clock : ndarray of shape (m,)
        Times of the responses, by the clock of the other logger [s].
    responses : ndarray of shape (m, n_responses)
    doubt : float
        Half-width of the 90 % interval of a shift that data cannot show: sampling, delay of heat [s].
    phi : float
        Correlation of a residual with the next, to begin with.
    names, cause : tuple of str, str
        Channels of the responses, and what explains them.
    shared : tuple of str
        The channel in both recordings, if it is the same quantity.
    swapped : bool
        The features come from the second recording.
    """

    time: FloatArray
    features: FloatArray
    clock: FloatArray
    responses: FloatArray
    doubt: float
    phi: float
    names: tuple[str, ...]
    cause: str
    shared: tuple[str, ...] = ()
    swapped: bool = False

    def binned(self, width: float, *only: int) -> "ClockPair":
        """Return the pair with the responses, or one of them, averaged over intervals of some width [s]."""
        clock, responses = _binned(self.clock, self.responses[:, list(only)] if only else self.responses, width)
        return replace(self, clock=clock, responses=responses)


def begin(first: Recording, second: Recording) -> float:
    """Return when the second recording begins, by the clocks of both [s]; 0 if one has no timestamps."""
    if not (first.start and second.start):
        return 0.0
    a, b = datetime.fromisoformat(first.start), datetime.fromisoformat(second.start)
    if (a.tzinfo is None) != (b.tzinfo is None):  # a clock without a zone is taken as one of the other's
        a, b = a.replace(tzinfo=None), b.replace(tzinfo=None)
    return (b - a).total_seconds()


def find_shared(first: Recording, second: Recording, lead: float) -> Iterator[ClockPair]:
    """Yield channels of the same quantity that both recordings contain."""
    there = {(c.name, c.quantity) for c in second.channels}
    names = [(c.name, c.name) for c in first.channels if (c.name, c.quantity) in there]
    if first.speed is not None and second.speed is not None and first.speed.name != second.speed.name:
        names.append((first.speed.name, second.speed.name))
    for a, b in names:
        time, x = _values(first, (a,))
        clock, y = _values(second, (b,))
        if min(len(x), len(y)) >= LEAST and np.ptp(x) > 0 and np.ptp(y) > 0:
            doubt = _SAMPLED * (
                usual_interval(time) + usual_interval(clock)
            )  # a new speed began between two rows of either
            if first.channel(a).quantity != "spindle_speed":
                width, doubt = max(_SMOOTHED, 5 * usual_interval(time), 5 * usual_interval(clock)), _SENSORS
                time, x = _smoothed(time, x, width)
                clock, y = _binned(clock, y, width)
            yield ClockPair(
                time=time,
                features=x,
                clock=lead + clock,
                responses=y,
                doubt=doubt,
                phi=0.0,
                names=(b,),
                cause="in both" if a == b else f"and {a}",
                shared=(a, b),
            )


def find_caused(first: Recording, second: Recording, lead: float, *, heat: bool) -> Iterator[ClockPair]:
    """Yield what follows in one recording from the spindle speed in the other, or from its temperatures (`heat`)."""
    for cause, effect, swapped in ((first, second, False), (second, first, True)):
        clock, responses, names = _responses(effect, effect.displacements + effect.temperatures * (not heat))
        channels = cause.temperatures if heat else cause.of_quantity("spindle_speed")[:1]
        time, features, causes = _responses(cause, channels)
        if not (names and causes) or (heat and effect.temperatures):
            continue
        doubt, why = _HEATED, "with the temperatures"
        if heat:
            time, features = _binned(time, features, COARSE)
        else:
            steps, why = (usual_interval(time), usual_interval(clock)), f"after {causes[0]}"
            doubt = float(np.hypot(_DELAYED, _SAMPLED * sum(steps)))
            features = _felt(time, features, max(steps))
        yield ClockPair(
            time=time + lead * swapped,
            features=features,
            clock=clock + lead * (not swapped),
            responses=responses,
            doubt=doubt,
            phi=1.0,
            names=names,
            cause=why,
            swapped=swapped,
        )


def _felt(time: FloatArray, speed: FloatArray, step: float) -> FloatArray:
    """Return what may follow from the spindle speed, (n_rows, n_features): speed and its square, and lags of both."""
    turning = np.abs(speed) / np.abs(speed).max()
    both = np.column_stack([turning, turning**2])
    between = np.vstack([both[:1], (both[1:] + both[:-1]) / 2])  # a new speed began between two rows
    lags = [lag for lag in _LAGS if lag >= step]  # shorter ones are not seen
    slow = lagbank.run(np.tile(between, len(lags)), np.diff(time, prepend=-np.inf), np.repeat(lags, 2))
    return np.column_stack([both, slow])


def _responses(recording: Recording, channels: Sequence[Channel]) -> tuple[FloatArray, FloatArray, tuple[str, ...]]:
    """Return times, values and names of the channels with few missing values, in the rows where all have one."""
    table = recording.table
    names = tuple(c.name for c in channels if table[c.name].notna().mean() > _THERE and table[c.name].nunique() > 1)
    time, values = _values(recording, names)
    return (time, values, names) if len(time) >= LEAST else (time, values, ())


def _values(recording: Recording, names: Sequence[str]) -> tuple[FloatArray, FloatArray]:
    """Return the times and values of channels in the rows where none is missing."""
    x = recording.table[list(names)].to_numpy(dtype=np.float64)
    there = np.isfinite(x).all(axis=1)
    return recording.time[there], x[there]


def usual_interval(time: FloatArray) -> float:
    """Return the median time from a row to the next [s]."""
    return float(np.median(np.diff(time)))


def _binned(time: FloatArray, values: FloatArray, width: float) -> tuple[FloatArray, FloatArray]:
    """Return the means of rows over intervals of some width [s], at most `_MOST` of them."""
    width = max(width, float(time[-1] - time[0]) / _MOST)
    if usual_interval(time) >= width:
        return time, values
    edges = np.flatnonzero(np.diff(np.floor((time - time[0]) / width), prepend=-1.0))
    size = np.diff(edges, append=len(time))
    return np.add.reduceat(time, edges) / size, np.add.reduceat(values, edges, axis=0) / size[:, None]


def _smoothed(time: FloatArray, values: FloatArray, width: float) -> tuple[FloatArray, FloatArray]:
    """Return moving means, 20 per width [s]: interpolated noise would be smallest midway between two rows."""
    grid = np.arange(time[0] + width / 2, time[-1] - width / 2, width / 20)  # empty if it is too short
    area = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:, 0] + values[:-1, 0]) * np.diff(time))])
    ends = [grid - width / 2, grid + width / 2]
    rows = np.searchsorted(time, ends[1]) - np.searchsorted(time, ends[0])
    there = rows > 0.6 * width / usual_interval(time)
    means = (np.interp(ends[1], time, area) - np.interp(ends[0], time, area)) / width
    return grid[there], means[there, None]
