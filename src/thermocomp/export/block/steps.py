"""Processing chain of a reading as scalars and loops: exported to controllers in any language.

Equivalent to `thermocomp.runtime.compensator` for models whose zero is the start, without probings and commands. The
functions run in Python and are translated literally (`thermocomp.export.printer`): assignments, ``if``, ``for`` and
``while`` on three groups of variables: ``s``, kept between calls; ``w``, recomputed; ``t``, constant. A procedure
leaves its result in a variable; a function depends on numbers only.
"""

import math

from thermocomp.core.bounds import GAP
from thermocomp.core.zero import STANDS
from thermocomp.export.block import watching
from thermocomp.export.block.formulas import models_absolute, models_rezeroed
from thermocomp.export.block.names import Names
from thermocomp.export.block.numbers import find_mean, larger, smaller, sort
from thermocomp.runtime.gate import CLOCK_SKEW, DAY

STARTS, ACTIVE, HOLDING, FADING, SHADOW = range(5)
UNTIMELY, IMPLAUSIBLE, NO_START = 1, 2, 3


def step(s: Names, w: Names, t: Names) -> None:
    """Process values of a given age, and move the corrections."""
    tell_time(s, w, t)
    for c in range(t.CHANNELS):
        w.given[c] = w.value[c] >= -1e30 and w.value[c] <= 1e30  # False for NaN
    w.stands = False
    if t.has_speed:
        w.stands = w.given[t.speed_channel] and abs(w.value[t.speed_channel]) <= STANDS
    if t.watched:
        if w.passes:
            watching.believe(s, w, t)
    if w.passes:
        check(s, w, t)
    if w.passes:
        s.rejected = 0
        take(s, w, t)
    else:
        for k in range(t.TARGETS):
            s.status[k] = HOLDING
    for k in range(t.TARGETS):
        if s.status[k] == HOLDING:
            idle(s, w, t, k)
        else:
            s.idle[k] = 0.0


def tell_time(s: Names, w: Names, t: Names) -> None:
    """Determine the time of measurement, and whether it is valid."""
    w.passes = w.dt >= 0.0 and w.dt <= GAP
    w.travel = 0.0
    if not s.begun:
        for r in range(t.RANGES):
            s.zero[r] = t.reference[r]
        s.begun = w.passes
    elif w.passes:
        w.travel = s.clock
        s.clock = s.clock + w.dt
        w.travel = s.clock - w.travel
        if w.travel > t.reading_age:
            w.travel = t.reading_age
    w.passes = w.passes and w.age >= -CLOCK_SKEW and w.age <= t.reading_age
    w.now = s.clock - s.origin
    w.shifted = s.origin
    if w.passes:
        w.now = w.now - w.age
        if s.seen:
            if w.now <= s.time:
                w.passes = False
            elif abs(w.now - s.time - (s.clock - s.taken)) > t.reading_age:
                w.now = s.time + (s.clock - s.taken)
                w.shifted = s.clock - w.age - w.now
    if not w.passes:
        s.rejected = UNTIMELY


def check(s: Names, w: Names, t: Names) -> None:
    """Check that all values are present, finite and plausible; while the zero is unknown, also for a start."""
    for r in range(t.RANGES):
        c = t.channel[r]
        least = t.least[r]
        most = t.most[r]
        if t.applies[r] == 2 or (t.applies[r] == 1 and (s.known or not t.rezero[r])):
            least = larger(least, s.zero[r] + t.low[r] - t.room[r])
            most = smaller(most, s.zero[r] + t.high[r] + t.room[r])
        if not (w.given[c] and w.value[c] >= least and w.value[c] <= most):
            w.passes = False
            s.rejected = IMPLAUSIBLE
    if w.passes and not s.known:
        for g in range(t.SETS):
            check_start(s, w, t, g)


def check_start(s: Names, w: Names, t: Names, g: int) -> None:
    """Check that the temperatures of a model are plausible for a starting machine.

    Parameters
    ----------
    s, w, t : Names
        State kept between calls, work variables, and constants.
    g : int
        Index of the set of ranges.
    """
    w.rows = 0
    for m in range(t.set_begin[g], t.set_begin[g + 1]):
        r = t.set_range[m]
        if t.temperature[r] and t.rezero[r]:
            w.column[w.rows] = w.value[t.channel[r]] - t.reference[r]
            w.rows = w.rows + 1
    if w.rows > 0:
        sort(s, w, t)
        w.middle = (w.column[(w.rows - 1) // 2] + w.column[w.rows // 2]) / 2.0
        for m in range(t.set_begin[g], t.set_begin[g + 1]):
            r = t.set_range[m]
            if t.temperature[r] and t.rezero[r]:
                off = w.value[t.channel[r]] - t.reference[r]
                if abs(w.middle) > DAY or abs(off - w.middle) > t.span[r]:
                    w.passes = False
                    s.rejected = NO_START


def take(s: Names, w: Names, t: Names) -> None:
    """Add a reading to the zero, or pass it to the models and move the corrections accordingly."""
    w.step = 0.0
    if s.seen:
        w.step = w.now - s.time
    for c in range(t.CHANNELS):
        w.input[c] = w.value[c]
    if t.has_absolute:
        models_absolute(s, w, t)
    if t.has_zero:
        if not s.known:
            gather(s, w, t)
        if s.known:
            models_rezeroed(s, w, t)
    s.outside = 0
    for r in range(t.RANGES):
        change = w.input[t.channel[r]] - s.zero[r]
        if (s.known or not t.rezero[r]) and (change < t.bound_low[r] or change > t.bound_high[r]):
            s.outside = s.outside + 1
    s.seen = True
    s.time = w.now
    s.origin = w.shifted
    s.taken = s.clock
    for k in range(t.TARGETS):
        s.status[k] = ACTIVE
        for m in range(t.line_begin[k], t.line_begin[k + 1]):
            if t.model_rezeroed[m] and not s.known:
                s.status[k] = STARTS
        if t.watched:
            if s.status[k] == ACTIVE:
                watching.judge(s, w, t, k)
        if s.status[k] == ACTIVE:
            drive(s, w, t, k)


def gather(s: Names, w: Names, t: Names) -> None:
    """Add a reading to the zero; once the zero is known, process the earlier readings with the models."""
    belongs = s.gathered == 0
    if not belongs and s.gathered < t.MOST and (w.stands or not s.resting):
        belongs = w.now - s.gathered_at[0] <= (t.at_rest if s.resting else t.otherwise)
    before = s.gathered
    s.known = not belongs
    if belongs:
        if s.gathered == 0:
            s.resting = w.stands
        s.gathered_at[s.gathered] = w.now
        for c in range(t.CHANNELS):
            s.gathered_value[s.gathered][c] = w.value[c]
        s.gathered = s.gathered + 1
        s.known = s.gathered >= t.MOST or w.now - s.gathered_at[0] >= (t.at_rest if s.resting else t.otherwise)
    if s.known:
        for c in range(t.CHANNELS):
            w.rows = s.gathered
            for k in range(w.rows):
                w.column[k] = s.gathered_value[k][c]
            find_mean(s, w, t)
            w.mean[c] = w.middle
        for r in range(t.RANGES):
            if t.rezero[r]:
                s.zero[r] = w.mean[t.channel[r]]
        last = w.step
        for k in range(before):
            for c in range(t.CHANNELS):
                w.input[c] = w.mean[c]
            w.step = 0.0
            if k > 0:
                w.step = s.gathered_at[k] - s.gathered_at[k - 1]
            models_rezeroed(s, w, t)
        w.step = last
        for c in range(t.CHANNELS):
            w.input[c] = w.mean[c] if belongs else w.value[c]


def drive(s: Names, w: Names, t: Names, k: int) -> None:
    """Move a correction towards the value required by its models, within the limits at both ends of the travel.

    Parameters
    ----------
    s, w, t : Names
        State kept between calls, work variables, and constants.
    k : int
        Index of the target.
    """
    w.offset = 0.0
    w.tilt = 0.0
    for m in range(t.line_begin[k], t.line_begin[k + 1]):
        w.offset = w.offset - t.to_offset[m] * s.deviation[m]
        w.tilt = w.tilt - t.to_slope[m] * s.deviation[m]
    band = t.dead_band
    if t.shadow[k]:
        s.status[k] = SHADOW
        w.offset = 0.0
        w.tilt = 0.0
        band = 0.0
    low = t.travel_low[k] - t.position[k]
    high = t.travel_high[k] - t.position[k]
    if low >= high or (w.tilt == 0.0 and s.slope[k] == 0.0):
        s.correction[k] = limit(w.offset, s.correction[k], w.travel, t.magnitude, t.rate, band)
    else:
        w.end[0] = s.correction[k] + s.slope[k] * 0.001 * low
        w.end[1] = s.correction[k] + s.slope[k] * 0.001 * high
        w.end[0] = limit(w.offset + w.tilt * 0.001 * low, w.end[0], w.travel, t.magnitude, t.rate, band)
        w.end[1] = limit(w.offset + w.tilt * 0.001 * high, w.end[1], w.travel, t.magnitude, t.rate, band)
        rise = (w.end[1] - w.end[0]) / (high - low)
        s.correction[k] = w.end[0] - rise * low
        s.slope[k] = 1000.0 * rise


def idle(s: Names, w: Names, t: Names, k: int) -> None:
    """Hold a correction that no model drives, and fade it to zero after the hold time.

    Parameters
    ----------
    s, w, t : Names
        State kept between calls, work variables, and constants.
    k : int
        Index of the target.
    """
    s.idle[k] = s.idle[k] + w.travel
    if s.idle[k] > t.hold:
        s.status[k] = FADING
        if w.travel > 0.0:
            share = math.exp(-w.travel / t.fade)
            low = abs(s.correction[k] + s.slope[k] * 0.001 * (t.travel_low[k] - t.position[k]))
            high = abs(s.correction[k] + s.slope[k] * 0.001 * (t.travel_high[k] - t.position[k]))
            largest = larger(low, high)
            if largest * (1.0 - share) > t.rate * w.travel:
                share = 1.0 - t.rate * w.travel / largest
            s.correction[k] = share * s.correction[k]
            s.slope[k] = share * s.slope[k]
    if t.shadow[k]:
        s.status[k] = SHADOW


def limit(wanted: float, current: float, travel: float, magnitude: float, rate: float, band: float) -> float:
    """Return a correction moved towards the required value, within magnitude, rate and dead band [um].

    Parameters
    ----------
    wanted, current : float
        [um]
    travel : float
        Time available for the move [s].
    magnitude, rate, band : float
        As for `thermocomp.core.correction.Limits`.
    """
    aim = larger(-magnitude, smaller(magnitude, wanted))
    moved = current
    if travel > 0.0 and abs(aim - current) > band:
        moved = aim
        reach = rate * travel
        if aim - current > reach:
            moved = current + reach
        elif aim - current < -reach:
            moved = current - reach
        moved = larger(-magnitude, smaller(magnitude, moved))
    return moved
