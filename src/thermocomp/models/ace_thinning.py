"""Tables of `ace`, made small for a file: as many steps as rows, times the inputs, take 8 MB of 9,000 rows.

The transformations of the inputs become straight lines, joined, near each row's value. The inverse of theta, which
jumps from row to row by more than is to be lost, is then a step for the new sum of each row instead of the old one: at
every row that was fitted the prediction stays what it was, within `TOLERANCE`, but for a few of rounded inputs whose
sums become the same. Between the rows both are the noise of their neighbours, and as good as each other.
"""

from collections.abc import Sequence

import numpy as np

from thermocomp.core.additive import Curve
from thermocomp.models.base import FloatArray

#: how far a prediction for a fitted row may move [unit of the target], or by which share of what they span
TOLERANCE, SHARE = 0.01, 1e-3
#: tables of no more steps in all are left as they are
SMALL = 5000
#: points of all transformations of inputs together, at most
POINTS = 4000
#: a transformation may move by this, their sum having norm 1; by which factor more until `POINTS` are enough
_NEAR, _FACTOR = 0.002, 1.4
#: digits of points: shares of their span
_DIGITS = 6


def thin(curves: Sequence[Curve], response: Curve, columns: Sequence[FloatArray]) -> tuple[tuple[Curve, ...], Curve]:
    """Return smaller tables that predict the same for the rows that they were fitted to.

    Parameters
    ----------
    curves : sequence of Curve
        One per input.
    response : Curve
        Curve applied to their sum.
    columns : sequence of ndarray of shape (n_rows,)
        The fitted rows of each input.

    Returns
    -------
    curves : tuple of Curve
    response : Curve
        Both as given if they are small.
    """
    if sum(len(c.x) for c in (*curves, response)) <= SMALL:
        return tuple(curves), response
    near = _NEAR
    while True:
        thinned = tuple(_joined(c, np.unique(x), near) for c, x in zip(curves, columns, strict=True))
        if sum(len(c.x) for c in thinned) <= POINTS:
            break
        near *= _FACTOR
    wanted = response(_sum(curves, columns))
    allowed = min(TOLERANCE, SHARE * float(np.ptp(wanted)))
    return thinned, _steps(_sum(thinned, columns), wanted, allowed)


def _sum(curves: Sequence[Curve], columns: Sequence[FloatArray]) -> FloatArray:
    """Add up as the frozen model does, to the last bit."""
    total = np.zeros(len(columns[0]))
    for curve, x in zip(curves, columns, strict=True):
        total = total + curve(x)
    return total


def _joined(curve: Curve, x: FloatArray, near: float) -> Curve:
    """Return straight lines from point to point of a curve, each as long as no point is further off than `near`."""
    y = curve(x)
    kept, at = [0], 0
    xs, ys = x.tolist(), y.tolist()
    while at < len(xs) - 1:
        low, high, last = -np.inf, np.inf, at + 1
        for k in range(at + 1, len(xs)):
            run, rise = xs[k] - xs[at], ys[k] - ys[at]
            if low <= rise / run <= high:
                last = k
            low, high = max(low, (rise - near) / run), min(high, (rise + near) / run)
            if low > high:
                break
        kept.append(last)
        at = last
    places, first = np.unique(_rounded(x[kept]), return_index=True)
    return Curve(tuple(places.tolist()), tuple(_rounded(y[kept])[first].tolist()))


def _steps(x: FloatArray, y: FloatArray, allowed: float) -> Curve:
    """Return steps that are no further than `allowed` from each y at its x; neighbours share one where they can."""
    order = np.argsort(x, kind="stable")
    xs, ys = x[order].tolist(), y[order].tolist()
    digits = max(0, 1 - int(np.floor(np.log10(allowed)))) if allowed > 0 else 15
    room = 2 * allowed - 10.0**-digits  # rounding takes its part
    breaks, levels = list[float](), list[float]()
    low = high = ys[0]
    for k in range(1, len(xs)):
        if max(high, ys[k]) - min(low, ys[k]) > room and xs[k] > xs[k - 1]:
            levels.append(round((low + high) / 2, digits))
            breaks.append(_between(xs[k - 1], xs[k]))
            low = high = ys[k]
        low, high = min(low, ys[k]), max(high, ys[k])
    return Curve(tuple(breaks), (*levels, round((low + high) / 2, digits)), "step")


def _between(a: float, b: float) -> float:
    """Return a number of few digits that is above a and not above b."""
    for digits in range(2, 16):
        if a < (found := round((a + b) / 2, digits)) <= b:
            return found
    return b


def _rounded(values: FloatArray) -> FloatArray:
    span = float(np.ptp(values))
    return np.round(values, _DIGITS - int(np.floor(np.log10(span)))) if span > 0 else values
