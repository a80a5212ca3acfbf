"""Time of a reading, with clocks that may be set.

A reading carries a stamp of its source's clock, which may be set while the machine runs; the process also has a
monotonic clock. Stamps define the time between two readings if the monotonic clock agrees. Corrections move by the
monotonic clock only.
"""

import math
from typing import NamedTuple

from thermocomp.core.correction import Limits
from thermocomp.core.reading import Reading
from thermocomp.core.thresholds import Thresholds
from thermocomp.runtime.gate import explain_untimely
from thermocomp.runtime.state import CompensatorState, silence


class Instant(NamedTuple):
    """Time of a reading on the continuous time scale of the state."""

    time: float  #: on the time scale of the state [s]
    origin: float  #: new origin of the state [s]


def place(
    state: CompensatorState, reading: Reading, now: float, tick: float, limits: Limits, thresholds: Thresholds
) -> tuple[Instant, str]:
    """Return the time of a reading, and the reason if it is invalid (empty if valid).

    Parameters
    ----------
    now : float
        Present time of the clock of the reading's source [s].
    tick : float
        Present time of the monotonic clock of the process [s].
    """
    if why := explain_untimely(reading, now, limits, thresholds):
        return Instant(math.nan, state.origin), why
    if state.time is None:
        return Instant(reading.time, 0.0), ""
    passed = silence(state, tick)
    if math.isnan(state.origin):  # after a restart
        return _set(state, reading, passed), ""
    time, last = reading.time - state.origin, state.time + state.origin
    back = time <= state.time
    if back and (last <= now + thresholds.clock_skew or passed <= 0.0):
        why = f"reading at {reading.time:g} s is not later than the previous reading at {last:g} s"
        return Instant(math.nan, state.origin), why
    if back or abs(time - state.time - passed) > limits.reading_age:  # the clock was set
        return _set(state, reading, passed), ""
    return Instant(time, state.origin), ""


def _set(state: CompensatorState, reading: Reading, passed: float) -> Instant:
    """Return the time of a reading at a given interval after the last one, regardless of its stamp."""
    time = (state.time or 0.0) + passed
    return Instant(time, reading.time - time)
