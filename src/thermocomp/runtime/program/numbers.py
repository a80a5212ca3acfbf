"""Means, medians and lags with scalars and loops only, in the array ``column`` of the working memory."""

from thermocomp.core.zero import FAR
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
from thermocomp.runtime.program.values import Number, Whole, flag, integer, real
from thermocomp.runtime.program.variables import Constants, Kept, Work


@procedure
def find_mean(s: Kept, w: Work, t: Constants) -> None:
    """Compute the mean of a column without its outliers in `middle`."""
    total = let("total", real(0.0))
    with when(w.rows < 3):
        for k in each("k", w.rows):
            total.set(total + w.column[k])
        w.middle = total / w.rows.real
    with otherwise():
        sort(s, w, t)
        centre = let("centre", (w.column[(w.rows - 1) // 2] + w.column[w.rows // 2]) / 2.0)
        low = let("low", integer(0))
        high = let("high", w.rows - 1)
        apart = let("apart", real(0.0))
        nearer = let("nearer", real(0.0))
        # median of the distances from the median: from the outside inwards, the farther end first
        for _ in each("k", w.rows - w.rows // 2):
            nearer.set(apart)
            with when(centre - w.column[low] >= w.column[high] - centre):
                apart.set(centre - w.column[low])
                low.set(low + 1)
            with otherwise():
                apart.set(w.column[high] - centre)
                high.set(high - 1)
        nearer.set(apart)
        with when((w.rows % 2).equals(0)):
            nearer.set(larger(centre - w.column[low], w.column[high] - centre))
        far = let("far", FAR * ((nearer + apart) / 2.0))
        kept = let("kept", integer(0))
        for k in each("k", w.rows):
            with when(abs(w.column[k] - centre) <= far):
                total.set(total + w.column[k])
                kept.set(kept + 1)
        w.middle = total / kept.real


@procedure
def sort(s: Kept, w: Work, t: Constants) -> None:
    """Sort the array ``column`` in ascending order."""
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


@function
def smaller(one: Number, other: Number) -> Number:
    """Return the smaller of two numbers."""
    return choose(one < other, one, other)


@function
def larger(one: Number, other: Number) -> Number:
    """Return the larger of two numbers."""
    return choose(one > other, one, other)


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
