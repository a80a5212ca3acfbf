"""Repetition of all temperatures with scalars and loops only: see `thermocomp.runtime.feed` for explanations."""

from thermocomp.runtime.feed import LARGEST, MOST_REPEATED, NONE
from thermocomp.runtime.program.constants import Constants
from thermocomp.runtime.program.language import choose, each, let, otherwise_when, procedure, when
from thermocomp.runtime.program.values import Whole, flag, integer
from thermocomp.runtime.program.variables import Kept, Work
from thermocomp.runtime.watchstate import GOOD

STOPPED = 4


@procedure
def heed(s: Kept, w: Work, t: Constants) -> None:
    """Find out whether the source of the readings has stopped: its counter, and repeated temperatures."""
    renewed = let("renewed", flag(True))
    with when((w.counter > 0.0) & (w.counter <= LARGEST)):
        renewed.set(s.counter.differs(w.counter))
        s.waited = s.waited + w.travel
        with when(renewed):
            s.waited = choose(s.counter > 0.0, 0.0, NONE)
        s.counter = w.counter
        w.passes = s.waited <= t.reading_age
    with when(t.has_feed), when(w.passes & renewed):
        compare_temperatures(s, w, t)
    most = let("most", t.repeat_factor * s.feed_usual)
    counts = let("counts", t.may_count & (s.feed_changes >= t.repeat_changes))
    counts.set(counts & (t.repeat_margin * s.feed_longest <= most))
    with when(s.feed_moved | (counts & (s.repeated > most))):
        w.passes = False
    with when(~w.passes):
        s.rejected = STOPPED


@procedure
def compare_temperatures(s: Kept, w: Work, t: Constants) -> None:
    """Compare the temperatures with those of the previous reading."""
    changed = let("changed", integer(0))
    there = let("there", flag(False))
    for k in each("k", t.FED):
        c = let("c", t.feed_channel[k])
        reading = let("reading", choose((w.value[c] >= -LARGEST) & (w.value[c] <= LARGEST), w.value[c], NONE))
        with when(reading.differs(s.fed[k])):
            changed.set(changed + 1)
            change = let("change", abs(reading - s.fed[k]))
            with when(change < s.feed_step[k]):
                s.feed_step[k] = change
        with when(~s.feed_begun):
            s.feed_step[k] = NONE
        there.set(there | (reading <= LARGEST))
        s.fed[k] = reading
    with when(~s.feed_begun):
        s.feed_begun = True
    with otherwise_when(changed > 0):
        learn(s, w, t, changed)
        s.repeated = 0.0
        s.feed_known = False
        s.feed_moved = False
    with otherwise_when(there & (s.repeated < MOST_REPEATED)):
        s.repeated = s.repeated + 1.0


@procedure
def learn(s: Kept, w: Work, t: Constants, changed: Whole) -> None:
    """Average the interval that a change of some temperatures ends."""
    interval = let("interval", s.repeated + 1.0)
    with when(((changed + changed <= t.FED) | changed.equals(1)) & (interval > s.feed_longest)):
        s.feed_longest = interval
    with when((s.feed_changes >= t.repeat_changes) & (interval > t.repeat_factor * s.feed_usual)):
        interval.set(t.repeat_factor * s.feed_usual)
    s.feed_changes = s.feed_changes + 1.0
    with when(s.feed_changes > t.repeat_memory):
        s.feed_changes = t.repeat_memory
    s.feed_usual = s.feed_usual + (interval - s.feed_usual) / s.feed_changes


@procedure
def compare_predictions(s: Kept, w: Work, t: Constants) -> None:
    """Find out whether a temperature should have changed since the first repeated reading."""
    with when(s.repeated >= 1.0):
        with when(~s.feed_known):
            for i in each("i", t.SENSORS):
                s.feed_predicted[i] = s.predicted[i]
            s.feed_known = s.looked
        with otherwise_when(s.repeated > t.repeat_wait * s.feed_usual):
            for i in each("i", t.SENSORS):
                moved = let("moved", abs(s.predicted[i] - s.feed_predicted[i]))
                step = let("step", choose(s.feed_changes > 0.0, s.feed_step[t.feed_place[i]], 0.0))
                least = let("least", t.repeat_moved * step)
                with when(s.fault[i].equals(GOOD) & (moved > t.frozen_limit[i]) & (moved > least)):
                    s.feed_moved = True
            with when(s.feed_moved):
                w.passes = False
                s.rejected = STOPPED
