"""Power-up with scalars and loops only: what is known of the reference; see `thermocomp.runtime.powerup`."""

from collections.abc import Callable

from thermocomp.core.starting import WARM, WARM_SHARE
from thermocomp.runtime.program.constants import Constants
from thermocomp.runtime.program.language import each, let, otherwise_when, procedure, when
from thermocomp.runtime.program.numbers import find_day
from thermocomp.runtime.program.values import Number, Whole, flag, integer
from thermocomp.runtime.program.variables import Kept, Work

CONTINUES, COLD, UNKNOWN = range(3)


@procedure
def power_up(s: Kept, w: Work, t: Constants, off: Number) -> None:
    """Continue from a retained state after a time without power, if that is possible; see `begins`."""
    w.begins = UNKNOWN
    known = let("known", flag(False))
    for k in each("k", t.TARGETS):
        known.set(known | (s.referenced[k] & ~t.shadow[k]))
    with when(known & (off > 0.0) & (off <= t.resumable)):
        w.begins = CONTINUES
        s.clock = s.clock + off
        for k in each("k", t.TARGETS):
            s.resumed[k] = s.resumed[k] | (off > t.hold)
        with when(t.watched), when(off > t.fault_duration):  # a value that is the same by chance was not constant
            for i in each("i", t.SENSORS):
                s.read_once[i] = False
    with otherwise_when((off > t.cold_after) & (off <= 1e30)):
        w.begins = COLD


@procedure
def rezero(s: Kept, w: Work, t: Constants, k: Whole, remaining: Number) -> None:
    """Order that a target continues from its correction minus a measured deviation."""
    with when((k >= 0) & (k < t.TARGETS) & (remaining >= -1e30) & (remaining <= 1e30)):
        s.ordered[k] = True
        s.remaining[k] = remaining


@procedure
def demand(s: Kept, w: Work, t: Constants, k: Whole) -> None:
    """Compute the correction that the models of a target demand, regardless of its last re-zero."""
    w.offset = 0.0
    w.tilt = 0.0
    for m in each("m", t.line_begin[k], t.line_begin[k + 1]):
        w.offset = w.offset - t.to_offset[m] * s.deviation[m]
        w.tilt = w.tilt - t.to_slope[m] * s.deviation[m]


@procedure
def obey(s: Kept, w: Work, t: Constants, k: Whole) -> None:
    """Re-zero a target, once its models have a zero."""
    with when(s.ordered[k]):
        able = let("able", flag(True) & s.seen)
        for m in each("m", t.line_begin[k], t.line_begin[k + 1]):
            able.set(able & (~t.model_rezeroed[m] | s.known))
        with when(able):
            demand(s, w, t, k)
            s.shift[k] = w.offset - (s.correction[k] - s.remaining[k])
            s.tilt[k] = w.tilt - s.slope[k]
            s.ordered[k] = False
            s.referenced[k] = True


def collect_offsets(s: Kept, w: Work, t: Constants, g: Whole, value: Callable[[Whole], Number]) -> None:
    """Record the statements that find the offset of the day: the median of the inputs of a model, less the training.

    Parameters
    ----------
    value : callable
        Returns the value of an input by its channel.
    """
    w.rows = 0
    for m in each("m", t.set_begin[g], t.set_begin[g + 1]):
        r = let("r", t.set_range[m])
        with when(t.temperature[r] & t.rezero[r]):
            w.column[w.rows] = value(t.channel[r]) - t.reference[r]
            w.rows = w.rows + 1
    find_day(s, w, t)


@procedure
def suspect(s: Kept, w: Work, t: Constants) -> None:
    """Find out whether the temperatures at the start are those of a warm machine.

    As `core.starting.seems_warm`.
    """
    s.warm = False
    for g in each("g", t.SETS):
        collect_offsets(s, w, t, g, lambda c: s.zero_mean[c])
        apart = let("apart", integer(0))
        for i in each("i", w.rows):
            with when(abs(w.column[i] - w.middle) > WARM):
                apart.set(apart + 1)
        with when((apart > 1) & (apart > w.rows // WARM_SHARE)):
            s.warm = True
