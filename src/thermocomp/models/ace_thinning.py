"""Thinning of the tables of `ace`: one step per row and input would take 8 MB for 9,000 rows.

The transformations of the inputs become piecewise linear and stay close to the value of each row. The inverse of theta,
which jumps from row to row by more than the tolerance, becomes a step function of the new sum of each row instead of
the old one: for every fitted row the prediction is unchanged within `TOLERANCE`, except for a few rows with rounded
inputs whose sums coincide. Between the rows, old and new tables both follow the noise of the neighbours and are equally
accurate.
"""

from collections.abc import Sequence

import numpy as np

from thermocomp.core.curves import Curve
from thermocomp.models.base import FloatArray

#: permissible change of the prediction for a fitted row [unit of the target], and the same as a share of the span
TOLERANCE, SHARE = 0.01, 1e-3
#: tables are left unchanged if they have no more steps than this in total
SMALL = 5000
#: maximum number of points of all input transformations together
POINTS = 4000
#: permissible change of a transformation (their sum has norm 1), and the factor that widens it to reach `POINTS`
_NEAR, _FACTOR = 0.002, 1.4
#: significant digits of the points, relative to their span
_DIGITS = 6


def thin(curves: Sequence[Curve], response: Curve, columns: Sequence[FloatArray]) -> tuple[tuple[Curve, ...], Curve]:
    """Return smaller tables with the same predictions for the rows to which they were fitted.

    Parameters
    ----------
    columns : sequence of ndarray of shape (n_rows,)
        Fitted rows of each input.
    """
    if sum(len(c.x) for c in (*curves, response)) <= SMALL:
        return tuple(curves), response
    near = _NEAR
    while True:
        thinned = tuple(_joined(c, np.unique(x), near) for c, x in zip(curves, columns, strict=True))
        if sum(len(c.x) for c in thinned) <= POINTS:
            break
        near *= _FACTOR
    wanted = response(sum_curves(curves, columns))
    allowed = min(TOLERANCE, SHARE * float(np.ptp(wanted)))
    return thinned, _steps(sum_curves(thinned, columns), wanted, allowed)


def sum_curves(curves: Sequence[Curve], columns: Sequence[FloatArray]) -> FloatArray:
    """Return the sum of curves, bit-identical to that in the frozen model."""
    total = np.zeros(len(columns[0]))
    for curve, x in zip(curves, columns, strict=True):
        total = total + curve(x)
    return total


def _joined(curve: Curve, x: FloatArray, near: float) -> Curve:
    """Return a piecewise linear curve with few segments that deviates from no point by more than `near`."""
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
    """Return a step curve within `allowed` of each y at its x; neighbours share a step where possible."""
    order = np.argsort(x, kind="stable")
    xs, ys = x[order].tolist(), y[order].tolist()
    digits = max(0, 1 - int(np.floor(np.log10(allowed)))) if allowed > 0 else 15
    room = 2 * allowed - 10.0**-digits  # rounding uses part of the tolerance
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
    """Return a number with few digits that is greater than a and at most b."""
    for digits in range(2, 16):
        if a < (found := round((a + b) / 2, digits)) <= b:
            return found
    return b


def _rounded(values: FloatArray) -> FloatArray:
    span = float(np.ptp(values))
    return np.round(values, _DIGITS - int(np.floor(np.log10(span)))) if span > 0 else values
