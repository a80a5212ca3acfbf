"""Order of day, month and year: where the dates are ambiguous, the continuity of the recording decides."""

from collections.abc import Mapping
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.messages import Message

IntArray = NDArray[np.int64]

_SECOND = 1_000_000_000
_DAY = 86_400 * _SECOND
#: rows within the first limit are consecutive at any sampling rate; rows beyond the second may not be
_NEAR, _FAR = 1800 * _SECOND, 6 * 3600 * _SECOND
#: step in days caused only by a wrong order: a month has at least 28 days, minus a margin for its first and last day
_MONTH = 26


class DateChoice(NamedTuple):
    """The selected order of day, month and year."""

    order: str  #: empty if several are possible
    by: Literal["rising", "going on", ""]
    why: str  #: reason against the other orders, as text


def find_order(readings: Mapping[str, IntArray]) -> DateChoice:
    """Select the order of day, month and year in which rows are consecutive.

    Parameters
    ----------
    readings : mapping of str to ndarray of shape (n_rows,)
        Times under each order [ns], all of which are valid dates.

    Notes
    -----
    An order is selected if it is the only one

    1. in which time increases; else
    2. in which two rows are consecutive across a change of the date: at most half an hour or two usual steps apart, and
       at most six hours, where every other order puts about a month or more between them.

    Single rows per day, and tests on days with a pause between them, may also be a month apart: then no order is
    selected.
    """
    begun, *others = readings.values()
    if all(np.array_equal(begun, t) for t in others):
        return DateChoice(next(iter(readings)), "", "")  # day and month are equal, as on the fifth of May
    rising = [order for order, t in readings.items() if rises(t)]
    if len(rising) == 1:
        return DateChoice(rising[0], "rising", Message("otherwise time would not increase"))
    tried = {order: readings[order] for order in rising or readings}
    steps = {order: np.diff(t) for order, t in tried.items()}
    first, *more = steps.values()
    alike = np.logical_and.reduce([first == other for other in more])
    usual = first[alike & (first > 0)]
    near = min(max(_NEAR, 2 * int(np.median(usual)) if usual.size else 0), _FAR)
    going_on = {order: ~alike & (s >= 0) & (s <= near) for order, s in steps.items()}
    for order, follows in going_on.items():
        rest = [o for o in steps if o != order]
        apart = [follows & (np.abs(steps[o]) >= _MONTH * _DAY) for o in rest]
        if all(a.any() for a in apart) and not any((going_on[o] & ~follows).any() for o in rest):
            days = min(int(np.abs(steps[o])[a].max()) for o, a in zip(rest, apart, strict=True)) // _DAY
            why = Message("otherwise a gap of {days} days would lie between two rows that follow each other", days=days)
            return DateChoice(order, "going on", why)
    return DateChoice("", "", "")


def rises(t: IntArray) -> bool:
    """Return whether no time is earlier than the one before."""
    return bool((np.diff(t) >= 0).all())


def find_longest_step(t: IntArray) -> float:
    """Return the longest step between consecutive rows, in days."""
    return float(np.diff(t).max(initial=0)) / _DAY
