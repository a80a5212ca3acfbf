"""Values updated at fixed intervals, with scalars and loops only: see `thermocomp.core.expression.Recurrence`."""

from thermocomp.runtime.program.constants import Constants
from thermocomp.runtime.program.formulas import tick
from thermocomp.runtime.program.language import choose, each, floor, let, procedure, repeat_while, when
from thermocomp.runtime.program.numbers import smaller
from thermocomp.runtime.program.values import Condition, Whole, flag, real
from thermocomp.runtime.program.variables import Kept, Work

MOST_TICKS = 2e9


@procedure
def run_clock(s: Kept, w: Work, t: Constants, c: Whole, begun: Condition) -> None:
    """Advance a value to the current time, with linear interpolation between two ticks."""
    dt = let("dt", w.step)
    first = let("first", t.leaf_begin[c])
    leaves = let("leaves", t.leaf_begin[c + 1] - first)
    with when(~begun):
        dt.set(0.0)
        for i in each("i", leaves):
            s.averages[t.average_begin[c] + i] = w.leaf[first + i]
    ticks = let("ticks", floor(smaller((s.phase[c] + dt) / t.interval[c] + 1e-06, real(MOST_TICKS))))
    phase = let("phase", s.phase[c] + dt - ticks * t.interval[c])
    with when(ticks >= MOST_TICKS):
        phase.set(0.0)  # limit of a 32-bit integer; by then the value has settled
    with when(ticks > 0.0):
        dt.set(phase)
    moves = let("moves", flag(True))
    with repeat_while((ticks > 0.0) & moves):  # a settled value does not change any more
        moves.set(s.phase[c].differs(0.0))  # the first mean is partly of earlier readings: another one follows
        for i in each("i", first, first + leaves):
            w.average[i] = (s.total[i] + (t.interval[c] - s.phase[c]) * w.leaf[i]) / t.interval[c]
            s.total[i] = 0.0
        tick(s, w, t, c)
        for k in each("k", t.past_begin[c + 1] - t.past_begin[c] - 1):  # oldest first
            j = let("j", t.past_begin[c + 1] - 1 - k)
            moves.set(moves | s.past[j].differs(s.past[j - 1]))
            s.past[j] = s.past[j - 1]
        moves.set(moves | s.past[t.past_begin[c]].differs(w.next))
        s.past[t.past_begin[c]] = w.next
        for k in each("k", t.average_begin[c + 1] - t.average_begin[c] - leaves):
            j.set(t.average_begin[c + 1] - 1 - k)
            moves.set(moves | s.averages[j].differs(s.averages[j - leaves]))
            s.averages[j] = s.averages[j - leaves]
        for i in each("i", leaves):
            moves.set(moves | s.averages[t.average_begin[c] + i].differs(w.average[first + i]))
            s.averages[t.average_begin[c] + i] = w.average[first + i]
        s.phase[c] = 0.0
        ticks.set(ticks - 1.0)
    s.phase[c] = phase
    for i in each("i", first, first + leaves):
        s.total[i] = s.total[i] + dt * w.leaf[i]
        w.average[i] = choose(phase > 0.0, s.total[i] / phase, w.leaf[i])
    w.found = s.past[t.past_begin[c]]
    with when(phase > 1e-06 * t.interval[c]):
        tick(s, w, t, c)
        w.found = w.found + phase / t.interval[c] * (w.next - w.found)
