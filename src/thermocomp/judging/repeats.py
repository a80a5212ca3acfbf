"""Cycles or files whose drift is the same but for a shift in time and a constant: they are one observation.

Two warm-ups of different sizes are also the same but for a shift: exponentials. So the drifts must be alike in what is
left when a warm-up of any time constant is removed, and there must be something left.
"""

from collections.abc import Sequence

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.judging.baselines import WARM_UPS, Series

#: drifts are the same if their difference is less than this share of them, and of them without a warm-up
SAME, SAME_DETAILS = 0.15, 0.3
#: least size of what is left, relative to the drift
LEAST_DETAILS = 0.02
#: largest shift, as a fraction of the longer of two cycles or files
MOST_SHIFT = 1 / 3
#: largest number of rows compared
MOST_ROWS = 200


def group_repeats(units: Sequence[Series]) -> list[list[int]]:
    """Group cycles or files that are one observation.

    Returns
    -------
    list of list of int
        Indices of the members of each group; each belongs to the group of every one that it repeats.
    """
    if min(len(u.time) for u in units) < 2 * len(WARM_UPS):
        return [[k] for k in range(len(units))]
    step = max(
        max(float(np.ptp(u.time)) for u in units) / MOST_ROWS,
        min(float(np.median(np.diff(u.time))) for u in units),
    )
    curves = [np.interp(np.arange(0, np.ptp(u.time) + step / 2, step), u.time - u.time[0], u.measured) for u in units]
    groups = list[list[int]]()
    for k, curve in enumerate(curves):
        mine = [g for g in groups if any(same(curve, curves[j]) for j in g)]
        groups = [g for g in groups if g not in mine] + [sorted([k, *(j for g in mine for j in g)])]
    return sorted(groups)


def same(one: FloatArray, other: FloatArray) -> bool:
    """Return whether two curves at equal intervals are the same but for a shift and a constant."""
    most, least = int(MOST_SHIFT * max(len(one), len(other))), min(len(one), len(other)) // 2
    parts = [_overlap(one, other, shift) for shift in range(-most, most + 1)]
    a, b = min((p for p in parts if len(p[0]) > least), key=lambda p: _difference(*p))
    one, other = _without_warm_up(a), _without_warm_up(b)
    known = min(np.std(one), np.std(other)) > LEAST_DETAILS * np.std(a)
    return bool(known) and _difference(a, b) < SAME and _difference(one, other) < SAME_DETAILS


def _overlap(one: FloatArray, other: FloatArray, shift: int) -> tuple[FloatArray, FloatArray]:
    """Return what two curves have in common if the first begins `shift` rows earlier."""
    a, b = one[max(shift, 0) :], other[max(-shift, 0) :]
    n = min(len(a), len(b))
    return a[:n], b[:n]


def _difference(a: FloatArray, b: FloatArray) -> float:
    """Return the difference of two curves relative to their size (standard deviations)."""
    size = float(np.var(a) + np.var(b)) / 2
    return float(np.sqrt(float(np.var(a - b)) / size)) if size > 0 else np.inf


def _without_warm_up(x: FloatArray) -> FloatArray:
    """Return a curve without its trend and warm-up."""
    u = np.linspace(0.0, 1.0, len(x))
    terms = np.stack([np.ones_like(u), u, *(np.exp(-u / tau) for tau in WARM_UPS)], axis=1)
    return np.asarray(x - terms @ np.linalg.lstsq(terms, x, rcond=None)[0])
