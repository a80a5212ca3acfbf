"""Means, medians and lags as scalars and loops, on the column of `thermocomp.exporters.block.layout.WORK`."""

import math

from thermocomp.core.zero import FAR
from thermocomp.exporters.block.names import Names


def find_mean(s: Names, w: Names, t: Names) -> None:
    """Leave the mean of a column without its outliers in `middle`."""
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
        # the median of the distances from the median: from the outside inwards, the farther end first
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
    """Sort the column."""
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
    """Return a first-order lag so many time constants later."""
    return lag - math.expm1(-paces) * (value - lag)
