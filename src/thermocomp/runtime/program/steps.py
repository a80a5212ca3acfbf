"""Processing chain of a reading with scalars and loops only: exported to controllers in any language.

Equivalent to `thermocomp.runtime.compensator` for models whose zero is the start, without probings and commands. The
functions are written in the language `thermocomp.runtime.program.language`, on three groups of variables: ``s``, kept
between calls; ``w``, recomputed; ``t``, constant. A procedure leaves its result in a variable; a function depends on
numbers only.
"""

from thermocomp.core.bounds import GAP
from thermocomp.runtime.powerup import AT_ONCE
from thermocomp.runtime.program import feeding, powering, watching
from thermocomp.runtime.program.averaging import Averaged
from thermocomp.runtime.program.constants import Constants
from thermocomp.runtime.program.formulas import models_absolute, models_rezeroed
from thermocomp.runtime.program.language import (
    choose,
    each,
    exp,
    function,
    let,
    otherwise,
    otherwise_when,
    procedure,
    when,
)
from thermocomp.runtime.program.numbers import larger, smaller
from thermocomp.runtime.program.values import Number, Whole
from thermocomp.runtime.program.variables import Kept, Work

STARTS, ACTIVE, HOLDING, FADING, SHADOW, UNKNOWN = range(6)
UNTIMELY, IMPLAUSIBLE, NO_START = 1, 2, 3


@procedure
def step(s: Kept, w: Work, t: Constants) -> None:
    """Process a reading of a given age, and move the corrections."""
    tell_time(s, w, t)
    for c in each("c", t.CHANNELS):
        with when(t.has_unsigned), when(t.unsigned[c]):
            w.value[c] = abs(w.value[c])
        w.given[c] = (w.value[c] >= -1e30) & (w.value[c] <= 1e30)  # False for NaN
    find_standstill(s, w, t)
    with when(w.passes):
        feeding.heed(s, w, t)
    with when(t.watched), when(w.passes):
        watching.believe(s, w, t)
        find_standstill(s, w, t)  # by the substitute of a missing speed
        with when(t.has_feed):
            feeding.compare_predictions(s, w, t)
    with when(w.passes):
        check(s, w, t)
    with when(w.passes):
        s.rejected = 0
        take(s, w, t)
    with otherwise():
        for k in each("k", t.TARGETS):
            s.status[k] = HOLDING
    for k in each("k", t.TARGETS):
        with when(~s.referenced[k] & ~t.shadow[k]):
            s.status[k] = UNKNOWN
        with when(s.status[k].equals(HOLDING)):
            idle(s, w, t, k)
        with otherwise():
            s.idle[k] = 0.0
        with when(~s.status[k].equals(HOLDING) | (s.idle[k] > t.reading_age)):
            s.resumed[k] = False
        powering.obey(s, w, t, k)


@procedure
def find_standstill(s: Kept, w: Work, t: Constants) -> None:
    """Find out whether the spindle is known to be stopped."""
    w.stands = False
    with when(t.has_speed):
        w.stands = w.given[t.speed_channel] & (abs(w.value[t.speed_channel]) <= t.stopped_speed)


@procedure
def tell_time(s: Kept, w: Work, t: Constants) -> None:
    """Determine the time of measurement, and whether it is valid."""
    w.passes = (w.dt >= 0.0) & (w.dt <= GAP)
    w.travel = 0.0
    with when(~s.begun):
        for r in each("r", t.RANGES):
            s.zero[r] = t.reference[r]
        s.begun = w.passes
    with otherwise_when(w.passes):
        w.travel = s.clock
        s.clock = s.clock + w.dt
        w.travel = s.clock - w.travel
        with when(w.travel > t.reading_age):
            w.travel = t.reading_age
    w.passes = w.passes & (w.age >= -t.clock_skew) & (w.age <= t.reading_age)
    w.now = s.clock - s.origin
    w.shifted = s.origin
    with when(w.passes):
        w.now = w.now - w.age
        with when(s.seen):
            with when(w.now <= s.time):
                w.passes = False
            with otherwise_when(abs(w.now - s.time - (s.clock - s.taken)) > t.reading_age):
                w.now = s.time + (s.clock - s.taken)
                w.shifted = s.clock - w.age - w.now
    with when(~w.passes):
        s.rejected = UNTIMELY


@procedure
def check(s: Kept, w: Work, t: Constants) -> None:
    """Check that all values are present, finite and plausible; while the zero is unknown, also for a start."""
    for r in each("r", t.RANGES):
        c = let("c", t.channel[r])
        least = let("least", t.least[r])
        most = let("most", t.most[r])
        with when(t.applies[r].equals(2) | (t.applies[r].equals(1) & (s.known | ~t.rezero[r]))):
            least.set(larger(least, s.zero[r] + t.low[r] - t.room[r]))
            most.set(smaller(most, s.zero[r] + t.high[r] + t.room[r]))
        with when(~(w.given[c] & (w.value[c] >= least) & (w.value[c] <= most))):
            w.passes = False
            s.rejected = IMPLAUSIBLE
    with when(w.passes & ~s.known):
        for g in each("g", t.SETS):
            check_start(s, w, t, g)


@procedure
def check_start(s: Kept, w: Work, t: Constants, g: Whole) -> None:
    """Check that the temperatures of a model are plausible for a starting machine."""
    powering.collect_offsets(s, w, t, g, lambda c: w.value[c])
    with when(w.rows > 0):
        for m in each("m", t.set_begin[g], t.set_begin[g + 1]):
            r = let("r", t.set_range[m])
            with when(t.temperature[r] & t.rezero[r]):
                off = let("off", w.value[t.channel[r]] - t.reference[r])
                with when((abs(w.middle) > t.zero_change) | (abs(off - w.middle) > t.span[r])):
                    w.passes = False
                    s.rejected = NO_START


@procedure
def take(s: Kept, w: Work, t: Constants) -> None:
    """Add a reading to the zero, or pass it to the models and move the corrections accordingly."""
    w.step = 0.0
    with when(s.seen):
        w.step = w.now - s.time
        with when(w.step > GAP):
            w.step = GAP
    for c in each("c", t.CHANNELS):
        w.input[c] = w.value[c]
    with when(t.has_absolute):
        models_absolute(s, w, t)
    with when(t.has_zero):
        with when(~s.known):
            gather(s, w, t)
            powering.suspect(s, w, t)
        with when(s.known):
            models_rezeroed(s, w, t)
    s.outside = 0
    for r in each("r", t.RANGES):
        change = let("change", w.input[t.channel[r]] - s.zero[r])
        with when((s.known | ~t.waits[r]) & ((change < t.bound_low[r]) | (change > t.bound_high[r]))):
            s.outside = s.outside + 1
    s.seen = True
    s.time = w.now
    s.origin = w.shifted
    s.taken = s.clock
    for k in each("k", t.TARGETS):
        s.status[k] = ACTIVE
        for m in each("m", t.line_begin[k], t.line_begin[k + 1]):
            with when(t.model_rezeroed[m] & ~s.known):
                s.status[k] = STARTS
        with when(t.watched), when(s.status[k].equals(ACTIVE)):
            watching.judge(s, w, t, k)
        with when(s.status[k].equals(ACTIVE) & (s.referenced[k] | t.shadow[k])):
            drive(s, w, t, k)


@procedure
def gather(s: Kept, w: Work, t: Constants) -> None:
    """Add a reading to the zero; once the zero is known, advance the models over the earlier readings."""
    averaged = Averaged.of_models(s)
    waited = let("waited", s.zero_readings > 0)
    waiting = let("waiting", s.zero_last - s.zero_first)
    belongs = averaged.belongs(w, t)
    with when(belongs):
        averaged.add(w, t.CHANNELS, lambda c: w.value[c])
    s.known = ~belongs | averaged.complete(t)
    with when(s.known):
        take_zero(s, w, t)
        last = let("last", w.step)
        with when(waited):
            w.step = 0.0
            models_rezeroed(s, w, t)
        with when(waiting > 0.0):
            w.step = waiting
            models_rezeroed(s, w, t)
        w.step = last
        with when(~belongs):
            for c in each("c", t.CHANNELS):
                w.input[c] = w.value[c]


@procedure
def take_zero(s: Kept, w: Work, t: Constants) -> None:
    """Take the mean readings as the zero of the inputs, and as the inputs."""
    for r in each("r", t.RANGES):
        with when(t.rezero[r]):
            s.zero[r] = s.zero_mean[t.channel[r]]
    for c in each("c", t.CHANNELS):
        w.input[c] = s.zero_mean[c]


@procedure
def drive(s: Kept, w: Work, t: Constants, k: Whole) -> None:
    """Move a correction towards the value required by its models, within the limits at both ends of the travel."""
    powering.demand(s, w, t, k)
    w.offset = w.offset - s.shift[k]
    w.tilt = w.tilt - s.tilt[k]
    band = let("band", t.dead_band)
    with when(t.shadow[k]):
        s.status[k] = SHADOW
        w.offset = 0.0
        w.tilt = 0.0
        band.set(0.0)
    travel = let("travel", choose(s.resumed[k], AT_ONCE, w.travel))
    low = let("low", t.travel_low[k] - t.position[k])
    high = let("high", t.travel_high[k] - t.position[k])
    with when((low >= high) | (w.tilt.equals(0.0) & s.slope[k].equals(0.0))):
        s.correction[k] = limit(w.offset, s.correction[k], travel, t.magnitude, t.rate, band)
    with otherwise():
        w.end[0] = s.correction[k] + s.slope[k] * 0.001 * low
        w.end[1] = s.correction[k] + s.slope[k] * 0.001 * high
        w.end[0] = limit(w.offset + w.tilt * 0.001 * low, w.end[0], travel, t.magnitude, t.rate, band)
        w.end[1] = limit(w.offset + w.tilt * 0.001 * high, w.end[1], travel, t.magnitude, t.rate, band)
        rise = let("rise", (w.end[1] - w.end[0]) / (high - low))
        s.correction[k] = w.end[0] - rise * low
        s.slope[k] = 1000.0 * rise


@procedure
def idle(s: Kept, w: Work, t: Constants, k: Whole) -> None:
    """Hold a correction that no model drives, and fade it to zero after the hold time."""
    s.idle[k] = s.idle[k] + w.travel
    with when(s.idle[k] > t.hold):
        s.status[k] = FADING
        with when(w.travel > 0.0):
            share = let("share", exp(-w.travel / t.fade))
            low = let("low", abs(s.correction[k] + s.slope[k] * 0.001 * (t.travel_low[k] - t.position[k])))
            high = let("high", abs(s.correction[k] + s.slope[k] * 0.001 * (t.travel_high[k] - t.position[k])))
            largest = let("largest", larger(low, high))
            with when(largest * (1.0 - share) > t.rate * w.travel):
                share.set(1.0 - t.rate * w.travel / largest)
            s.correction[k] = share * s.correction[k]
            s.slope[k] = share * s.slope[k]
    with when(t.shadow[k]):
        s.status[k] = SHADOW


@function
def limit(wanted: Number, current: Number, travel: Number, magnitude: Number, rate: Number, band: Number) -> Number:
    """Return a correction moved towards the required value, within magnitude, rate and dead band [um]."""
    aim = let("aim", larger(-magnitude, smaller(magnitude, wanted)))
    moved = let("moved", current)
    with when((travel > 0.0) & (abs(aim - current) > band)):
        moved.set(aim)
        reach = let("reach", rate * travel)
        with when(aim - current > reach):
            moved.set(current + reach)
        with otherwise_when(aim - current < -reach):
            moved.set(current - reach)
        moved.set(larger(-magnitude, smaller(magnitude, moved)))
    return moved
