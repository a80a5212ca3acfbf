"""First readings of a machine: which temperatures are off the others, compared with the start of the training."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.inputs import Input
from thermocomp.core.model import ErrorModel
from thermocomp.core.state import State
from thermocomp.core.thresholds import THRESHOLDS, Thresholds


def find_middle(offsets: Sequence[float]) -> float:
    """Return the median of offsets; of two middle ones that nearer to 0, so that half of them may be off together."""
    if not offsets:
        return 0.0
    ordered = sorted(offsets)
    return min(ordered[(len(ordered) - 1) // 2], ordered[len(ordered) // 2], key=abs)


def find_day(offsets: Sequence[float], most: float) -> float:
    """Return the median of offsets, or the one nearest to 0 if the median is more than `most` [degC].

    A day that warm is less likely than a majority of shifted sensors.
    """
    middle = find_middle(offsets)
    return min(sorted(offsets), key=abs) if abs(middle) > most else middle


def find_usual(rows: FloatArray) -> FloatArray:
    """Return the value of each column that is nearest to its median: of two levels that of the first row, no mean."""
    nearest = np.abs(rows - np.median(rows, axis=0)).argmin(axis=0)
    return np.asarray(np.take_along_axis(rows, nearest[None], axis=0)[0])


def find_start_span(channel: Input, thresholds: Thresholds) -> float:
    """Return how far a temperature may be off the others at the start [degC]."""
    return max(channel.high - channel.low, thresholds.start_offset)


def find_offsets(inputs: Sequence[Input], zero: Sequence[float], thresholds: Thresholds) -> dict[str, float]:
    """Return the temperatures that start off the others, by more than `Thresholds.start_reported`.

    Parameters
    ----------
    zero : sequence of float of shape (n_inputs,)
        Zero of the inputs; nan while unknown.

    Returns
    -------
    dict of str to float
        Offset from the others, relative to the zero of the training [degC]. Only the rises from the zero are used, so
        an offset does no harm. All temperatures, if those that are off may be right, and the others off.
    """
    own = {i.name: z - i.reference for i, z in zip(inputs, zero, strict=True) if i.rezero and math.isfinite(z)}
    day = find_day(list(own.values()), thresholds.zero_change)
    off = [offset for offset in own.values() if abs(offset - day) > thresholds.start_reported]
    open_ = may_be_right(off, len(own), thresholds.zero_change)
    return {name: o - day for name, o in own.items() if open_ or abs(o - day) > thresholds.start_reported}


#: of a machine that seems warm: offsets above this [degC], of more than one temperature and more than this share
WARM, WARM_SHARE = 1.0, 8


def seems_warm(inputs: Sequence[Input], zero: Sequence[float], averaged: Sequence[float]) -> bool:
    """Return whether a machine at its start seems warm, by its temperatures compared with the training: a hint only.

    Several of them have to be off the others: air and enclosure are on cold machines, too.

    Parameters
    ----------
    zero, averaged : sequence of float of shape (n_inputs,)
        Zero of the inputs, nan while unknown; then its readings so far, empty before the first one.
    """
    known = [z if math.isfinite(z) else averaged[k] if averaged else z for k, z in enumerate(zero)]
    own = [z - i.reference for i, z in zip(inputs, known, strict=True) if i.rezero and i.quantity == "temperature"]
    if not own or not all(map(math.isfinite, own)):
        return False
    day = find_day(own, THRESHOLDS.zero_change)
    return sum(abs(offset - day) > WARM for offset in own) > max(1, len(own) // WARM_SHARE)


def may_be_right(off: Sequence[float], count: int, most: float) -> bool:
    """Return whether those of `count` temperatures that are off the others may be right, and the others off.

    Parameters
    ----------
    off : sequence of float
        Their offsets from the training [degC].
    most : float
        Largest offset of a day [degC].
    """
    return 2 * (len(off) + 1) >= count and any(abs(offset) <= most for offset in off)


def describe_start(models: Sequence[ErrorModel], states: Sequence[State]) -> str:
    """Return which temperatures of running models start off the others, as text; empty if none do."""
    found = dict[str, float]()
    for model, state in zip(models, states, strict=True):
        found |= find_offsets(model.inputs, state.reference.tolist(), model.thresholds)
    return describe_offsets(found)


def describe_offsets(offsets: Mapping[str, float]) -> str:
    """Return which temperatures start off the others, as text; empty if there are none."""
    told = ", ".join(f"{name} {offset:+.1f} degC" for name, offset in sorted(offsets.items(), key=lambda o: -abs(o[1])))
    if any(abs(offset) <= THRESHOLDS.start_reported for offset in offsets.values()):
        return (
            f"compared with the training, sensors disagree at the start: {told}: which of them are right cannot be "
            "told; only their rises from here on are used"
        )
    return (
        f"compared with the training, these start off the other temperatures: {told}: shifted sensors, or "
        "a machine that had not settled; only their rises from here on are used"
        if told
        else ""
    )
