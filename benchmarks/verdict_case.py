"""`Case`: a generated recording for `bench_verdict.py`, and whether a model of it may be accepted."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class File:
    """A file of a recording.

    Parameters
    ----------
    time : ndarray of shape (n_rows,)
        Time since the first row of the file [s].
    temperatures : ndarray of shape (n_rows, n_sensors)
        [degC]
    speed : ndarray of shape (n_rows,) or None
        Spindle speed [1/min]; None: not recorded.
    drift : ndarray of shape (n_rows,)
        [um]
    cycles : sequence of (int, int)
        First row of each cycle, and the row after its last.
    start : str
        ISO timestamp of the first row; empty: unknown.
    continues : bool
        Whether it continues the files before it, one sampling interval later and with their zero.
    """

    time: FloatArray
    temperatures: FloatArray
    speed: FloatArray | None
    drift: FloatArray
    cycles: Sequence[tuple[int, int]]
    start: str = ""
    continues: bool = False


@dataclass(frozen=True, eq=False)
class Case:
    """A recording of one or several files.

    Parameters
    ----------
    files : sequence of File
    null : bool
        True if no model may be accepted: the drift has nothing to do with the temperatures, or every model does harm.
    duty : bool
        True if all cycles repeat one duty.
    fresh : sequence of File
        Further cold starts of the same machine, with which nothing is fitted or judged: does a good model do harm?
    """

    files: Sequence[File]
    null: bool
    duty: bool = False
    fresh: Sequence[File] = ()


def times(n: int, dt: float) -> FloatArray:
    """Return the times of n rows with an interval dt [s]."""
    return np.arange(n, dtype=np.float64) * dt


#: number of fresh cycles of a good model
FRESH = 20
Make = Callable[[np.random.Generator], Case]
