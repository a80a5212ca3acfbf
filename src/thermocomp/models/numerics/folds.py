"""Cross-validation folds of thermal cycles, by which a method chooses its settings."""

import numpy as np
from numpy.typing import ArrayLike

from thermocomp.core.arrays import BoolArray, FloatArray, IntArray
from thermocomp.core.exceptions import FitError, InputError


def number_folds(cycle: ArrayLike | None, n_rows: int) -> tuple[IntArray, str]:
    """Assign each row to a fold: the thermal cycle with which it is left out.

    Parameters
    ----------
    cycle : array-like of int of shape (n_rows,), or None
        Cycle of each row; -1 for rows that are not used for training.

    Returns
    -------
    folds : ndarray of int of shape (n_rows,)
        0, 1, ... in the order of the cycles; a cycle too short for a separate fold joins the previous one. -1 remains.
    """
    if cycle is None:
        return np.arange(n_rows) * min(5, n_rows) // n_rows, "five stretches of equal length, left out in turn"
    given = np.asarray(cycle)
    if given.shape != (n_rows,):
        raise InputError(f"cycle: expected {n_rows} numbers, found an array of shape {given.shape}")
    learned = np.flatnonzero(given >= 0)
    if learned.size == 0:
        raise FitError("no training rows: every row has cycle -1; number the cycles of the rows to be used from 0")
    folds = np.full(n_rows, -1, dtype=np.intp)
    number = -1
    for label in dict.fromkeys(given[learned].tolist()):
        rows = np.flatnonzero(given == label)
        if number < 0 or rows.size >= 0.05 * learned.size:
            number += 1
        folds[rows] = number
    if number == 0:  # a single cycle cannot be left out
        folds[learned] = np.arange(learned.size) * min(5, learned.size) // learned.size
        return folds, "five stretches of one thermal cycle, left out in turn"
    return folds, f"{number + 1} thermal cycles, left out in turn"


#: fewest cycles of which neighbours can be left out together
APART = 5
#: most neighbours on each side that are left out together with a thermal cycle
_MOST_NEIGHBOURS = 2


def find_neighbours(folds: IntArray, step: FloatArray) -> BoolArray:
    """Return which folds are left out together to estimate the error in later use.

    Successive cycles of a recording share the state of a warm-up, the weather and the zero; one that is predicted by
    its neighbours is known better than a later one will be. With `APART` folds or more, the neighbours in the same
    recording are left out too: up to a quarter of the other folds on each side.

    Parameters
    ----------
    folds : ndarray of int of shape (n_rows,)
        As returned by `number_folds`.
    step : ndarray of shape (n_rows,)
        Time since the previous row [s], inf at the start of a recording.

    Returns
    -------
    ndarray of bool of shape (n_folds, n_folds)
        Row k: folds left out to predict fold k.
    """
    order = np.arange(int(folds.max()) + 1)
    reach = min(_MOST_NEIGHBOURS, (len(order) - 1) // (APART - 1))
    recording = np.cumsum(np.isinf(step))[[int(np.argmax(folds == k)) for k in order]]
    apart = np.abs(order[:, None] - order)
    return np.asarray((apart == 0) | ((apart <= reach) & (recording[:, None] == recording)))


#: smallest share of a thermal cycle that is left out separately
_LEAST_PART = 0.1
#: maximum number of parts that are left out in turn: more add little information
_MOST_PARTS = 16


def halve(folds: IntArray, turning: BoolArray) -> tuple[IntArray, str]:
    """Split each fold in two at the last stop of the spindle.

    A drift model must predict both warm-up and cool-down: knowledge of one half of a cycle need not cover the other.

    Parameters
    ----------
    folds : ndarray of int of shape (n_rows,)
        As returned by `number_folds`.
    turning : ndarray of bool of shape (n_rows,)
        Whether the spindle turns.

    Returns
    -------
    parts : ndarray of int of shape (n_rows,)
        0, 1, ...; -1 remains. A fold that does not end in a stop is split in the middle of its rows. With many folds
        none is split, and with very many several folds form one part.
    """
    n_folds = int(folds.max()) + 1
    if 2 * n_folds > _MOST_PARTS:
        parts = np.where(folds < 0, -1, folds % _MOST_PARTS)
        return parts, f"{n_folds} thermal cycles, left out in {int(parts.max()) + 1} groups in turn"
    parts = np.full(len(folds), -1, dtype=np.intp)
    for k in range(n_folds):
        rows = np.flatnonzero(folds == k)
        turned = np.flatnonzero(turning[rows])
        stop = turned[-1] + 1 if turned.size else 0
        if not _LEAST_PART * rows.size <= stop <= (1 - _LEAST_PART) * rows.size:
            stop = rows.size // 2
        parts[rows[:stop]], parts[rows[stop:]] = 2 * k, 2 * k + 1
    parts[folds >= 0] = np.unique(parts[folds >= 0], return_inverse=True)[1]  # half of a one-row fold is empty
    return parts, f"halves of {n_folds} thermal cycles (run, stop), left out in turn"
