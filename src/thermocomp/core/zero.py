"""Reference temperatures (zero): the mean over the first minutes with the spindle stopped, instead of one reading.

The same code is used live, in a replay and in training, so that a model finds the conditions of its training at the
machine. The readings of this interval are themselves replaced by their mean: the machine counts as settled there, and
models with memory start from the mean instead of one noisy reading.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.bounds import GAP, check_between, check_name

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

#: maximum number of averaged readings at any rate; it reduces the noise sufficiently, and bounds the memory
MOST = 600
#: below this speed the spindle counts as stopped: a tachometer may show a few revolutions at rest [1/min]
STANDS = 10.0
#: distance from the median, in median absolute deviations, beyond which a value is an outlier (four sigma if normal)
FAR = 6.0


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

    def stands(self, speed: object) -> bool:
        """Return whether a reading of `speed` shows that the spindle is stopped; False if it is not a number."""
        return isinstance(speed, float | int) and type(speed) is not bool and abs(speed) <= STANDS


#: the zero is the first reading: for models not trained on recordings, and for papers that specify it
FIRST_READING = Zeroing(0.0, 0.0)


class Gathered(NamedTuple):
    """Readings collected for averaging the zero."""

    times: tuple[float, ...] = ()  #: [s]
    values: tuple[FloatArray, ...] = ()  #: (n_inputs,) each
    resting: bool = False  #: the spindle was stopped in the first reading

    def belongs(self, zeroing: Zeroing, time: float, resting: bool) -> bool:
        """Return whether a reading belongs to the averaging interval."""
        if not self.times:
            return True
        if len(self.times) >= MOST or (self.resting and not resting):
            return False
        return time - self.times[0] <= self._span(zeroing)

    def complete(self, zeroing: Zeroing) -> bool:
        """Return whether no later reading can belong to the averaging interval."""
        return bool(self.times) and (len(self.times) >= MOST or self.times[-1] - self.times[0] >= self._span(zeroing))

    def add(self, time: float, values: FloatArray, resting: bool) -> "Gathered":
        """Return the collected readings with a further reading appended."""
        return Gathered((*self.times, time), (*self.values, values), self.resting if self.times else resting)

    def _span(self, zeroing: Zeroing) -> float:
        return zeroing.at_rest if self.resting else zeroing.otherwise


def first_rows(zeroing: Zeroing, time: FloatArray, resting: BoolArray) -> tuple[int, int]:
    """Return the number of readings averaged for the zero of a test, and the index of the reading that completes it.

    Parameters
    ----------
    time : ndarray of shape (n_readings,)
        Times of the usable readings, increasing [s].
    resting : ndarray of bool of shape (n_readings,)
        True where the spindle is known to be stopped.
    """
    gathered, nothing = Gathered(), np.empty(0)
    for k, (t, r) in enumerate(zip(time.tolist(), resting.tolist(), strict=True)):
        if not gathered.belongs(zeroing, t, r):
            return k, k
        gathered = gathered.add(t, nothing, r)
        if gathered.complete(zeroing):
            return k + 1, k
    return len(time), len(time)


def robust_mean(values: FloatArray | Sequence[FloatArray]) -> FloatArray:
    """Return the mean over the first axis without values further than `FAR` median deviations from the median.

    Parameters
    ----------
    values : array of shape (n_readings, ...)
        Finite values.

    Returns
    -------
    ndarray of shape (...)
    """
    table = np.asarray(values, dtype=np.float64)
    if len(table) < 3:
        return np.asarray(table.mean(axis=0))
    off = np.abs(table - np.median(table, axis=0))
    near = off <= FAR * np.median(off, axis=0)
    return np.asarray((np.where(near, table, 0.0)).sum(axis=0) / near.sum(axis=0))


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
    rested[window] = robust_mean(values[window])
    return np.where(np.isnan(zero), rested[window[0]], zero), rested
