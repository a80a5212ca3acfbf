"""Sorting, medians, lags and tables as scalars and loops."""

from thermocomp.runtime.program.constants import Constants
from thermocomp.runtime.program.language import (
    choose,
    each,
    exp,
    expm1,
    function,
    let,
    log,
    otherwise,
    otherwise_when,
    procedure,
    repeat_while,
    when,
)
from thermocomp.runtime.program.values import Number, Whole, flag
from thermocomp.runtime.program.variables import Kept, Work


@procedure
def sort(s: Kept, w: Work, t: Constants) -> None:
    """Sort the array `column` in ascending order."""
    gap = let("gap", w.rows // 2)
    with repeat_while(gap > 0):
        for k in each("k", gap, w.rows):
            value = let("value", w.column[k])
            j = let("j", k)
            moving = let("moving", flag(True))
            with repeat_while(moving):
                moving.set(False)
                with when(j >= gap), when(w.column[j - gap] > value):
                    w.column[j] = w.column[j - gap]
                    j.set(j - gap)
                    moving.set(True)
            w.column[j] = value
        gap.set(gap // 2)


@procedure
def find_day(s: Kept, w: Work, t: Constants) -> None:
    """Sort a column of offsets at a start, and leave that of the day in `middle`.

    As `core.starting.find_day`.
    """
    w.middle = 0.0
    with when(w.rows > 0):
        sort(s, w, t)
        w.middle = w.column[(w.rows - 1) // 2]
        with when(abs(w.column[w.rows // 2]) < abs(w.middle)):
            w.middle = w.column[w.rows // 2]
        with when(abs(w.middle) > t.zero_change):
            for k in each("k", w.rows):
                with when(abs(w.column[k]) < abs(w.middle)):
                    w.middle = w.column[k]


@function
def smaller(one: Number, other: Number) -> Number:
    """Return the smaller of two numbers."""
    return choose(one < other, one, other)


@function
def larger(one: Number, other: Number) -> Number:
    """Return the larger of two numbers."""
    return choose(one > other, one, other)


@function
def median(one: Number, two: Number, three: Number) -> Number:
    """Return the median of three numbers."""
    return larger(smaller(one, two), smaller(larger(one, two), three))


@function
def follow(lag: Number, value: Number, paces: Number) -> Number:
    """Return the output of a first-order lag after a time given in time constants."""
    return lag - expm1(-paces) * (value - lag)


@function
def clip(value: Number, low: Number, high: Number) -> Number:
    """Return a value clipped to a lower and an upper bound."""
    return choose(value < low, low, choose(value > high, high, value))


@procedure
def find_linear(s: Kept, w: Work, t: Constants, at: Number, first: Whole, end: Whole) -> None:
    """Interpolate linearly in a table, with constant values beyond its ends: `found`."""
    find_place(s, w, t, at, first, end)
    k = let("k", w.place)
    with when(k.equals(first)):
        w.found = t.table_y[first]
    with otherwise_when(k.equals(end)):
        w.found = t.table_y[end - 1]
    with otherwise():
        rise = let("rise", (t.table_y[k] - t.table_y[k - 1]) / (t.table_x[k] - t.table_x[k - 1]))
        w.found = t.table_y[k - 1] + rise * (at - t.table_x[k - 1])


@procedure
def find_step(s: Kept, w: Work, t: Constants, at: Number, first: Whole, end: Whole) -> None:
    """Look up a value in a table of steps: `found`."""
    find_place(s, w, t, at, first, end)
    w.found = t.table_y[w.place]


@procedure
def find_place(s: Kept, w: Work, t: Constants, at: Number, first: Whole, end: Whole) -> None:
    """Find the first point of a table beyond a value: `place`."""
    w.place = first
    going = let("going", flag(True))
    with repeat_while(going):
        going.set(False)
        with when(w.place < end), when(t.table_x[w.place] <= at):
            w.place = w.place + 1
            going.set(True)


@function
def exp_less_one(x: Number) -> Number:
    """Return exp(x) - 1, accurate for small x, for languages without such a function."""
    small = let("small", x * (1.0 + x / 2.0 * (1.0 + x / 3.0 * (1.0 + x / 4.0 * (1.0 + x / 5.0 * (1.0 + x / 6.0))))))
    return choose(abs(x) < 0.01, small, exp(x) - 1.0)


@function
def power(base: Number, exponent: Number) -> Number:
    """Return a power of a non-negative base and a positive exponent, for languages without a power function."""
    return choose(base <= 0.0, 0.0, exp(exponent * log(base)))
