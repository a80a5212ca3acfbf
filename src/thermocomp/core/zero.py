"""Reference temperatures (zero): not one reading but the mean over the first minutes, while the spindle is stopped.

The same few lines decide it live, in a replay and in training: a model finds at the machine what it has learned from.
The readings of the zero are themselves taken as their mean: the machine rests in it, and what has a memory begins
there, not in the noise of one reading.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.bounds import GAP, check_between, check_name

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

#: readings that are averaged at most, however fast they come: noise is gone by then, and memory is bounded
MOST = 600
#: below this speed the spindle counts as stopped: what a tachometer reads at rest [1/min]
STANDS = 10.0
#: a value further from the median than this many median deviations is an outlier (four sigma of a normal law)
FAR = 6.0


@dataclass(frozen=True)
class Zeroing:
    """Over how long the zero of temperatures is averaged.

    Parameters
    ----------
    at_rest : float
        From the first reading on, while the spindle is known to be stopped [s].
    otherwise : float
        The same where it turns from the first reading on, or nothing is known of it [s]: short, for what warms up must
        not get into the zero. Of a test recorded once a minute it is the first row.
    speed : str
        Channel that shows whether the spindle is stopped [1/min]; empty if there is none.

    Raises
    ------
    InputError
        A time is negative or not finite, or the channel has no name.
    """

    at_rest: float = 300.0
    otherwise: float = 10.0
    speed: str = ""

    def __post_init__(self) -> None:
        check_between("zero", 0.0, GAP, at_rest=self.at_rest, otherwise=self.otherwise)
        if self.speed:
            check_name("zero", self.speed)

    def stands(self, speed: object) -> bool:
        """Return whether a reading of `speed` shows that the spindle is stopped; anything but a number does not."""
        return isinstance(speed, float | int) and type(speed) is not bool and abs(speed) <= STANDS


#: the zero is the first reading: of models that were not trained on recordings, and of papers that say so
FIRST_READING = Zeroing(0.0, 0.0)


class Gathered(NamedTuple):
    """The readings that a zero is being averaged of."""

    times: tuple[float, ...] = ()  #: [s]
    values: tuple[FloatArray, ...] = ()  #: (n_inputs,) each
    resting: bool = False  #: the spindle was stopped in the first of them

    def belongs(self, zeroing: Zeroing, time: float, resting: bool) -> bool:
        """Return whether a reading is one more of them."""
        if not self.times:
            return True
        if len(self.times) >= MOST or (self.resting and not resting):
            return False
        return time - self.times[0] <= self._span(zeroing)

    def complete(self, zeroing: Zeroing) -> bool:
        """Return whether nothing that comes later can belong to them."""
        return bool(self.times) and (len(self.times) >= MOST or self.times[-1] - self.times[0] >= self._span(zeroing))

    def add(self, time: float, values: FloatArray, resting: bool) -> "Gathered":
        """Return them with one more reading."""
        return Gathered((*self.times, time), (*self.values, values), self.resting if self.times else resting)

    def _span(self, zeroing: Zeroing) -> float:
        return zeroing.at_rest if self.resting else zeroing.otherwise


def first_rows(zeroing: Zeroing, time: FloatArray, resting: BoolArray) -> tuple[int, int]:
    """Return the number of readings from the start of a test over which its zero is averaged, and the time it is known.

    Parameters
    ----------
    zeroing : Zeroing
    time : ndarray of shape (n_readings,)
        Times of the usable readings, increasing [s].
    resting : ndarray of bool of shape (n_readings,)
        The spindle is known to be stopped.

    Returns
    -------
    count : int
    known : int
        Index of the reading at which it is known: the last of them, or the one after.
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
    """Return the mean over the first axis, without what is further than `FAR` median deviations from the median.

    Parameters
    ----------
    values : array of shape (n_readings, ...)
        Finite.

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
    """Find what a test counts from.

    Parameters
    ----------
    zeroing : Zeroing
    zero : ndarray of shape (n_inputs,)
        Known part of the zero; nan where the first readings decide.
    time : ndarray of shape (n_rows,)
        [s]
    values : ndarray of shape (n_rows, n_inputs)
    resting, usable : ndarray of bool of shape (n_rows,)
        The spindle is known to be stopped; every input is a number.

    Returns
    -------
    zero : ndarray of shape (n_inputs,)
        nan where it is not known, for there is no reading.
    values : ndarray of shape (n_rows, n_inputs)
        With the readings of the zero taken as their mean.
    """
    rows = np.flatnonzero(usable)
    if not rows.size or not np.isnan(zero).any():
        return zero, values
    window = rows[: first_rows(zeroing, time[rows], resting[rows])[0]]
    rested = values.copy()
    rested[window] = robust_mean(values[window])
    return np.where(np.isnan(zero), rested[window[0]], zero), rested
