"""The thermal cycles that a method chooses its settings by."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thermocomp.core.exceptions import FitError, InputError

IntArray = NDArray[np.intp]


def number_folds(cycle: ArrayLike | None, n_rows: int) -> tuple[IntArray, str]:
    """Give every row its fold: the thermal cycle that is left out together with it.

    Parameters
    ----------
    cycle : array-like of int of shape (n_rows,), or None
        Cycle of each row; -1 for rows that are not learned from.
    n_rows : int

    Returns
    -------
    folds : ndarray of int of shape (n_rows,)
        0, 1, ... in the order of the cycles; one too short to judge a model on joins the one before. -1 stays.
    description : str
        What is left out, in words.
    """
    if cycle is None:
        return np.arange(n_rows) * min(5, n_rows) // n_rows, "five stretches of equal length, left out in turn"
    given = np.asarray(cycle)
    if given.shape != (n_rows,):
        raise InputError(f"cycle: want {n_rows} numbers, found {given.shape}")
    learned = np.flatnonzero(given >= 0)
    if learned.size == 0:
        raise FitError("no row to learn from: every row has cycle -1")
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
