"""Order of day, month and year: where dates alone are ambiguous, the continuity of the recording decides."""

from collections.abc import Mapping
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

IntArray = NDArray[np.int64]

_SECOND = 1_000_000_000
_DAY = 86_400 * _SECOND
#: rows so near to each other belong together, however often the others come; those further apart may not
_NEAR, _FAR = 1800 * _SECOND, 6 * 3600 * _SECOND
#: a step in days that only a wrong order makes: a month is 28 days at least, and a row may come early on its last one
_MONTH = 26


class DateChoice(NamedTuple):
    """An order that was chosen."""

    order: str  #: empty if several are possible
    by: Literal["rising", "going on", ""]
    why: str  #: what speaks against the others, in words


def find_order(readings: Mapping[str, IntArray]) -> DateChoice:
    """Choose the order in which rows continue.

    Parameters
    ----------
    readings : mapping of str to ndarray of shape (n_rows,)
        Instants under each order [ns], all of which are dates.

    Notes
    -----
    An order is taken if it is the only one

    1. in which time rises; else
    2. in which a row follows on the one before across a change of the date: at most half an hour or two usual steps
       later, and six hours, where every other order puts about a month or more between them.

    Rows of one a day, and tests on days with a pause between them, may be a month apart as well: nothing tells.
    """
    begun, *others = readings.values()
    if all(np.array_equal(begun, t) for t in others):
        return DateChoice(next(iter(readings)), "", "")  # the fifth of May
    rising = [order for order, t in readings.items() if rises(t)]
    if len(rising) == 1:
        return DateChoice(rising[0], "rising", "otherwise time would not rise")
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
            why = f"otherwise a gap of {days} days would lie between two rows that follow each other"
            return DateChoice(order, "going on", why)
    return DateChoice("", "", "")


def rises(t: IntArray) -> bool:
    """Return whether no instant is before the one above it."""
    return bool((np.diff(t) >= 0).all())


def find_longest_step(t: IntArray) -> float:
    """Return the longest time between neighbouring rows, in days."""
    return float(np.diff(t).max(initial=0)) / _DAY
