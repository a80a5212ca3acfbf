"""Reference temperatures (zero): the mean over the first minutes with the spindle stopped, instead of one reading.

The same code is used live, in a replay and in training, so that a model finds the conditions of its training at the
machine. The readings of this interval are themselves replaced by their mean: the machine counts as settled there, and
models with memory start from the mean instead of one noisy reading.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.bounds import GAP, check_between, check_name
from thermocomp.core.thresholds import THRESHOLDS

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True)
class Zeroing:
    """Averaging time of the zero (reference reading) of temperatures.

    Parameters
    ----------
    at_rest : float
        Averaging time from the first reading on, while the spindle is known to be stopped [s].
    otherwise : float
        Averaging time if the spindle turns from the first reading on, or its state is unknown [s]; short, because the
        warm-up must not affect the zero. In a test recorded once a minute it is the first row.
    speed : str
        Channel that shows whether the spindle is stopped [1/min]; empty if there is none.

    Raises
    ------
    InputError
        A time is negative or not finite, or the name of the channel is invalid.
    """

    at_rest: float = 300.0
    otherwise: float = 10.0
    speed: str = ""

    def __post_init__(self) -> None:
        check_between("zero", 0.0, GAP, at_rest=self.at_rest, otherwise=self.otherwise)
        if self.speed:
            check_name("zero", self.speed)

    def stands(self, speed: object, most: float = THRESHOLDS.stopped_speed) -> bool:
        """Return whether a reading of `speed`, at most `most`, shows a stopped spindle; False if it is not a number."""
        return isinstance(speed, float | int) and type(speed) is not bool and abs(speed) <= most

    def span(self, resting: bool) -> float:
        """Return the averaging time if the spindle was stopped in the first reading, or not [s]."""
        return self.at_rest if resting else self.otherwise


#: the zero is the first reading: for models not trained on recordings, and for papers that specify it
FIRST_READING = Zeroing(0.0, 0.0)


class ZeroMean(NamedTuple):
    """Mean over time of the readings of the zero so far; its size does not depend on their number.

    From the third reading on it is the mean of the medians of three successive readings: a single wrong reading has no
    effect. Each median counts for half the time between the outer two of its readings, so an irregular cycle weights no
    part of the interval more than another.
    """

    first: float = math.nan  #: time of the first reading [s]
    before: float = math.nan  #: time of the last but one [s]
    last: float = math.nan  #: time of the last one [s]
    weight: float = 0.0  #: twice the time for which the medians count [s]
    mean: FloatArray = np.empty(0)  #: (..., n_inputs)
    recent: tuple[FloatArray, ...] = ()  #: last readings, at most two, (..., n_inputs) each
    resting: bool = False  #: the spindle was stopped in the first reading

    def belongs(self, zeroing: Zeroing, time: float, resting: bool) -> bool:
        """Return whether a reading belongs to the averaging interval."""
        if not self.recent:
            return True
        return (resting or not self.resting) and time - self.first <= zeroing.span(self.resting)

    def complete(self, zeroing: Zeroing) -> bool:
        """Return whether no later reading can belong to the averaging interval."""
        return bool(self.recent) and self.last - self.first >= zeroing.span(self.resting)

    def add(self, time: float, values: FloatArray, resting: bool) -> "ZeroMean":
        """Return the mean with one more reading; one that is not later than the previous one does not count."""
        if not self.recent:
            return ZeroMean(first=time, last=time, mean=values, recent=(values,), resting=resting)
        if time <= self.last:
            return self
        one, two = self.recent[0], self.recent[-1]
        longer = self._replace(before=self.last, last=time, recent=(two, values))
        if len(self.recent) == 1:
            return longer._replace(mean=(two + values) / 2.0)
        mean, span = np.maximum(np.minimum(one, two), np.minimum(np.maximum(one, two), values)), time - self.before
        if self.weight:
            mean = self.mean + (mean - self.mean) * (span / (self.weight + span))
        return longer._replace(mean=mean, weight=self.weight + span)


def first_rows(zeroing: Zeroing, time: FloatArray, resting: BoolArray) -> tuple[int, int]:
    """Return the number of readings averaged for the zero of a test, and the index of the reading that completes it.

    The same as `ZeroMean.belongs` and `ZeroMean.complete`, for all readings at once.

    Parameters
    ----------
    time : ndarray of shape (n_readings,)
        Times of the usable readings, increasing [s].
    resting : ndarray of bool of shape (n_readings,)
        True where the spindle is known to be stopped.
    """
    if not len(time):
        return 0, 0
    passed, span = time - time[0], zeroing.span(bool(resting[0]))
    belongs = (passed <= span) & (resting | ~resting[0])
    count = len(time) if belongs.all() else int(belongs.argmin())
    return count, count - 1 if passed[count - 1] >= span else count


def mean_over_time(time: FloatArray, values: FloatArray | Sequence[FloatArray]) -> FloatArray:
    """Return the mean over time of readings as `ZeroMean` has it.

    Parameters
    ----------
    time : ndarray of shape (n_readings,)
        Increasing [s].
    values : array of shape (n_readings, ...)
        Finite values.

    Returns
    -------
    ndarray of shape (...)
    """
    averaged = ZeroMean()
    for t, own in zip(time.tolist(), values, strict=True):
        averaged = averaged.add(t, own, resting=False)
    return averaged.mean


def find_zero(
    zeroing: Zeroing, zero: FloatArray, time: FloatArray, values: FloatArray, resting: BoolArray, usable: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Find the reference values of a test.

    Parameters
    ----------
    zero : ndarray of shape (n_inputs,)
        Known part of the zero; NaN where the first readings decide.
    time : ndarray of shape (n_rows,)
        [s]
    values : ndarray of shape (n_rows, n_inputs)
    resting, usable : ndarray of bool of shape (n_rows,)
        Rows with the spindle known to be stopped; rows with a number for every input.

    Returns
    -------
    zero : ndarray of shape (n_inputs,)
        NaN where it is unknown because there is no reading.
    values : ndarray of shape (n_rows, n_inputs)
        Values with the readings of the zero replaced by their mean.
    """
    rows = np.flatnonzero(usable)
    if not rows.size or not np.isnan(zero).any():
        return zero, values
    window = rows[: first_rows(zeroing, time[rows], resting[rows])[0]]
    rested = values.copy()
    rested[window] = mean_over_time(time[window], values[window])
    return np.where(np.isnan(zero), rested[window[0]], zero), rested
