"""Means, medians and lags as scalars and loops, in the array ``column`` of `thermocomp.export.block.layout.WORK`."""

import math

from thermocomp.core.zero import FAR
from thermocomp.export.block.names import Names


def find_mean(s: Names, w: Names, t: Names) -> None:
    """Compute the mean of a column without its outliers in `middle`."""
    total = 0.0
    if w.rows < 3:
        for k in range(w.rows):
            total = total + w.column[k]
        w.middle = total / w.rows
    else:
        sort(s, w, t)
        centre = (w.column[(w.rows - 1) // 2] + w.column[w.rows // 2]) / 2.0
        low = 0
        high = w.rows - 1
        apart = 0.0
        nearer = 0.0
        # median of the distances from the median: from the outside inwards, the farther end first
        for k in range(w.rows - w.rows // 2):
            nearer = apart
            if centre - w.column[low] >= w.column[high] - centre:
                apart = centre - w.column[low]
                low = low + 1
            else:
                apart = w.column[high] - centre
                high = high - 1
        nearer = apart
        if w.rows % 2 == 0:
            nearer = larger(centre - w.column[low], w.column[high] - centre)
        far = FAR * ((nearer + apart) / 2.0)
        kept = 0
        for k in range(w.rows):
            if abs(w.column[k] - centre) <= far:
                total = total + w.column[k]
                kept = kept + 1
        w.middle = total / kept


def sort(s: Names, w: Names, t: Names) -> None:
    """Sort the column in ascending order."""
    gap = w.rows // 2
    while gap > 0:
        for k in range(gap, w.rows):
            value = w.column[k]
            j = k
            moving = True
            while moving:
                moving = False
                if j >= gap:
                    if w.column[j - gap] > value:
                        w.column[j] = w.column[j - gap]
                        j = j - gap
                        moving = True
            w.column[j] = value
        gap = gap // 2


def smaller(one: float, other: float) -> float:
    """Return the smaller of two numbers."""
    return one if one < other else other


def larger(one: float, other: float) -> float:
    """Return the larger of two numbers."""
    return one if one > other else other


def follow(lag: float, value: float, paces: float) -> float:
    """Return a first-order lag after a number of time constants."""
    return lag - math.expm1(-paces) * (value - lag)


def clip(value: float, low: float, high: float) -> float:
    """Return a value between two bounds."""
    return low if value < low else high if value > high else value


def find_linear(s: Names, w: Names, t: Names, at: float, first: int, end: int) -> None:
    """Interpolate linearly in a table, with constant values beyond its ends: `found`.

    Parameters
    ----------
    s, w, t : Names
        State kept between calls, work variables, and constants.
    at : float
        Argument.
    first, end : int
        Range of the table's points, `end` excluded.
    """
    find_place(s, w, t, at, first, end)
    k = w.place
    if k == first:
        w.found = t.table_y[first]
    elif k == end:
        w.found = t.table_y[end - 1]
    else:
        rise = (t.table_y[k] - t.table_y[k - 1]) / (t.table_x[k] - t.table_x[k - 1])
        w.found = t.table_y[k - 1] + rise * (at - t.table_x[k - 1])


def find_step(s: Names, w: Names, t: Names, at: float, first: int, end: int) -> None:
    """Look up a value in a table of steps: `found`.

    Parameters
    ----------
    s, w, t : Names
        State kept between calls, work variables, and constants.
    at : float
        Argument.
    first, end : int
        Range of the table's points, `end` excluded; the last is beyond every argument.
    """
    find_place(s, w, t, at, first, end)
    w.found = t.table_y[w.place]


def find_place(s: Names, w: Names, t: Names, at: float, first: int, end: int) -> None:
    """Find the first point of a table beyond a value: `place`.

    Parameters
    ----------
    s, w, t : Names
        State kept between calls, work variables, and constants.
    at : float
        The value.
    first, end : int
        Range of the table's points, `end` excluded.
    """
    w.place = first
    going = True
    while going:
        going = False
        if w.place < end:
            if t.table_x[w.place] <= at:
                w.place = w.place + 1
                going = True


def exp_less_one(x: float) -> float:
    """Return exp(x) - 1, accurate for small x, for languages without such a function."""
    small = x * (1.0 + x / 2.0 * (1.0 + x / 3.0 * (1.0 + x / 4.0 * (1.0 + x / 5.0 * (1.0 + x / 6.0)))))
    return small if abs(x) < 0.01 else math.exp(x) - 1.0


def power(base: float, exponent: float) -> float:
    """Return a power of a non-negative base and a positive exponent, for languages without a power function."""
    return 0.0 if base <= 0.0 else math.exp(exponent * math.log(base))
