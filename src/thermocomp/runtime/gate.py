"""The gate: rejects readings that indicate a broken sensor, clock or wire instead of a warm machine.

It is the first check, because nan values are dangerous in later steps: in Python ``max(-m, min(m, nan))`` is ``m``, so
a dead sensor would command the full correction.
"""

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from numbers import Real
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.correction import Limits
from thermocomp.core.inputs import Input
from thermocomp.core.model import ErrorModel
from thermocomp.core.reading import Reading
from thermocomp.core.starting import find_day, find_start_span
from thermocomp.core.thresholds import Thresholds

#: any finite number
ANY = (-sys.float_info.max, sys.float_info.max)


def explain_implausible(model: ErrorModel, values: Sequence[object], reference: Sequence[float]) -> str:
    """Return which value of a reading must not be used, and why; empty if all may be used.

    Parameters
    ----------
    values : sequence of shape (n_inputs,)
        As delivered by the source; None if a value is missing.
    reference : sequence of float of shape (n_inputs,)
        Zero of the inputs; nan while unknown.
    """
    undecided = []
    for channel, value, zero in zip(model.inputs, values, reference, strict=True):
        if value is None:
            return f"{channel.name} is missing"
        low, high = find_plausible_range(channel, zero, model.thresholds)
        # a plain float needs no further check: comparisons with nan fail, as do those of infinity with finite bounds
        if not ((type(value) is float or is_number(value)) and low <= value <= high):  # type: ignore[operator]
            return f"{channel.name} = {value} {channel.unit} is not plausible"
        if math.isnan(zero) and channel.quantity == "temperature":
            undecided.append((channel, float(value) - channel.reference))  # type: ignore[arg-type]
    return _no_start(undecided, model.thresholds) if undecided else ""


def explain_unjudged(models: Sequence[ErrorModel], failed: Mapping[str, str]) -> str:
    """Return the reason why models must not drive a correction without the failed sensors; empty if they may do so."""
    for model in models:
        if wrong := model.wrong_speeds(failed):
            return f"{wrong[0]} was wrong before that was found, and the model of {model.target} remembers it"
        lost = [n for n in failed if n in model.sensors]
        if lost and not model.may_lose(lost):
            return (
                f"without {' and '.join(lost)}, the model of {model.target} is not known to be better than no "
                "compensation"
            )
    return ""


def _no_start(offsets: Sequence[tuple[Input, float]], thresholds: Thresholds) -> str:
    """Return why temperatures, relative to the zero of the training, cannot be those of a starting machine."""
    day = find_day([offset for _, offset in offsets], thresholds.zero_change)
    for channel, offset in offsets:
        start = f"{channel.name} = {channel.reference + offset:g} {channel.unit} is not plausible as a start"
        if abs(day) > thresholds.zero_change:
            return f"{start}: the machine differs by {day:+.1f} degC from the zero of the training data"
        if abs(offset - day) > find_start_span(channel, thresholds):
            apart = f"{offset - day:+.1f} degC from the others"
            return f"{start}: relative to the zero of the training data, it differs by {apart}"
    return ""


def explain_untimely(reading: Reading, now: float, limits: Limits, thresholds: Thresholds) -> str:
    """Return the reason why the time stamp of a reading is invalid; empty if it is valid.

    Parameters
    ----------
    now : float
        Present time of the clock of the reading's source [s].
    """
    values: object = reading.values
    if not isinstance(values, Mapping):
        return f"reading contains {type(values).__name__} instead of a mapping of values by channel"
    if not (is_number(reading.time) and is_number(now)):
        return f"time {reading.time} or clock {now} is not a number"
    if reading.time > now + thresholds.clock_skew:
        return f"reading is {reading.time - now:.1f} s ahead of the clock"
    if now - reading.time > limits.reading_age:
        return f"reading is {now - reading.time:.1f} s old; at most {limits.reading_age:g} s are allowed"
    return ""


def find_plausible_range(channel: Input, zero: float, thresholds: Thresholds) -> tuple[float, float]:
    """Return the range outside which a value indicates a broken sensor instead of a warm machine.

    `zero` is the present zero of the channel; nan while unknown.
    """
    low, high = thresholds.plausible.get(channel.quantity, ANY)
    if channel.quantity == "temperature" and not math.isnan(zero):
        span = max(channel.high - channel.low, thresholds.least_margin)
        low, high = max(low, zero + channel.low - span), min(high, zero + channel.high + span)
    elif channel.quantity not in thresholds.plausible:
        around = channel.reference if math.isnan(zero) else zero
        room = thresholds.margin * max(channel.high - channel.low, abs(channel.low), abs(channel.high), 1.0)
        low, high = max(low, around + channel.low - room), min(high, around + channel.high + room)
    return low, high


class Ranges:
    """Plausible ranges of several inputs, computed once per zero: fast path of `explain_implausible`."""

    def __init__(self, inputs: Sequence[Input], thresholds: Thresholds) -> None:
        self._inputs, self._thresholds = tuple(inputs), thresholds
        self.names = tuple(i.name for i in inputs)
        several = len(self.names) > 1  # with one name, `itemgetter` returns no tuple
        self._all: Callable[[Mapping[str, object]], Sequence[object]] = (
            itemgetter(*self.names) if several else lambda values: [values[name] for name in self.names]
        )
        self._of: tuple[NDArray[np.float64] | None, list[tuple[float, float]]] = (None, [])

    def pick(self, values: Mapping[str, object]) -> Sequence[object]:
        """Return the values of the inputs as delivered by the source; None for a missing value."""
        try:
            return self._all(values)
        except KeyError:
            return [values.get(name) for name in self.names]

    def hold(self, values: Sequence[object], reference: NDArray[np.float64]) -> bool:
        """Return whether all values are certainly plausible: plain numbers, each in its range about a known zero.

        Parameters
        ----------
        values : sequence of shape (n_inputs,)
            As delivered by the source.
        reference : ndarray of shape (n_inputs,)
            Zero of the inputs; nan while unknown.
        """
        known, ranges = self._of
        if known is not reference:
            of = zip(self._inputs, reference.tolist(), strict=True)
            ranges = [find_plausible_range(i, z, self._thresholds) for i, z in of]
            ranges = [] if np.isnan(reference).any() else ranges
            self._of = (reference, ranges)
        if not ranges:
            return False
        for value, (low, high) in zip(values, ranges, strict=True):
            if type(value) is not float or not low <= value <= high:
                return False
        return True


def is_number(value: object) -> bool:
    """Return whether a value is a finite number and not a Boolean."""
    if type(value) is float:
        return math.isfinite(value)
    if type(value) is bool or not isinstance(value, Real):
        return False
    try:
        return math.isfinite(float(value))
    except OverflowError:  # such as an integer with 400 digits
        return False
