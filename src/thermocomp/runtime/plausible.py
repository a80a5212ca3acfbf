"""Which temperatures a watch accepts as readings: by the same rules as the gate of the compensator."""

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.watch import Watch

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


def replace_first(watch: Watch, values: FloatArray) -> FloatArray:
    """Return the first readings; an implausible one gets the others' median offset from the zero of the training.

    Plausible readings are those that the gate of the compensator accepts at a start; for the offset of the day see
    `thermocomp.core.starting.find_day`.
    """
    zero, (low, _, width) = np.array([watch.inputs[s.input].reference for s in watch.sensors]), watch.ranges
    zero = zero + np.where([watch.inputs[s.input].rezero for s in watch.sensors], 0.0, low)  # absolute inputs: no zero
    span = np.maximum(width, watch.thresholds.start_offset)
    least, most = watch.thresholds.plausible["temperature"]
    with np.errstate(all="ignore"):
        offset = np.where((values >= least) & (values <= most), values - zero, np.nan)
        count, ordered = np.isfinite(offset).sum(axis=-1, keepdims=True), np.sort(offset, axis=-1)  # nan is sorted last
        below, above = (
            np.nan_to_num(np.take_along_axis(ordered, middle, axis=-1))
            for middle in (np.maximum(count - 1, 0) // 2, np.minimum(count // 2, np.maximum(count - 1, 0)))
        )
        day, most_day = np.where(np.abs(above) < np.abs(below), above, below), watch.thresholds.zero_change
        nearest = np.where(np.isfinite(ordered), np.abs(ordered), np.inf).argmin(axis=-1, keepdims=True)
        day = np.where(np.abs(day) > most_day, np.take_along_axis(ordered, nearest, axis=-1), day)
        fits = np.abs(offset - day) <= span
    return np.where(fits, values, zero + np.clip(day, -most_day, most_day))


def is_plausible(watch: Watch, change: FloatArray, values: FloatArray) -> BoolArray:
    """Return a mask of the plausible temperatures, by the same rules as the gate of the compensator."""
    low, high, width = watch.ranges
    span = np.maximum(width, watch.thresholds.least_margin)
    least, most = watch.thresholds.plausible["temperature"]
    within = (change >= low - span) & (change <= high + span) & (values >= least) & (values <= most)  # False for nan
    return np.asarray(within)
