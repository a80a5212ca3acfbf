"""Values with a separate clock, as scalars and loops: see `thermocomp.core.expression.Recurrence`."""

import math

from thermocomp.export.block.formulas import tick
from thermocomp.export.block.names import Names
from thermocomp.export.block.numbers import smaller

MOST_TICKS = 2e9


def run_clock(s: Names, w: Names, t: Names, c: int, begun: bool) -> None:
    """Advance a value to the current time, with linear interpolation between two ticks.

    Parameters
    ----------
    s, w, t : Names
        State kept between calls, work variables, and constants.
    c : int
        Index of the clock.
    begun : bool
        The block was called before.
    """
    dt = w.step
    first = t.leaf_begin[c]
    leaves = t.leaf_begin[c + 1] - first
    if not begun:
        dt = 0.0
        for i in range(leaves):
            s.averages[t.average_begin[c] + i] = w.leaf[first + i]
    ticks = 0.0 + math.floor(smaller((s.phase[c] + dt) / t.interval[c] + 0.000001, MOST_TICKS))
    phase = s.phase[c] + dt - ticks * t.interval[c]
    if ticks >= MOST_TICKS:  # limit of a 32-bit integer; by then the value has settled
        phase = 0.0
    if ticks > 0.0:
        dt = phase
    moves = True
    while ticks > 0.0 and moves:  # a settled value does not change any more
        moves = False
        for i in range(first, first + leaves):
            w.average[i] = (s.total[i] + (t.interval[c] - s.phase[c]) * w.leaf[i]) / t.interval[c]
            s.total[i] = 0.0
        tick(s, w, t, c)
        for k in range(t.past_begin[c + 1] - t.past_begin[c] - 1):  # oldest first
            j = t.past_begin[c + 1] - 1 - k
            moves = moves or s.past[j] != s.past[j - 1]
            s.past[j] = s.past[j - 1]
        moves = moves or s.past[t.past_begin[c]] != w.next
        s.past[t.past_begin[c]] = w.next
        for k in range(t.average_begin[c + 1] - t.average_begin[c] - leaves):
            j = t.average_begin[c + 1] - 1 - k
            moves = moves or s.averages[j] != s.averages[j - leaves]
            s.averages[j] = s.averages[j - leaves]
        for i in range(leaves):
            moves = moves or s.averages[t.average_begin[c] + i] != w.average[first + i]
            s.averages[t.average_begin[c] + i] = w.average[first + i]
        s.phase[c] = 0.0
        ticks = ticks - 1.0
    s.phase[c] = phase
    for i in range(first, first + leaves):
        s.total[i] = s.total[i] + dt * w.leaf[i]
        w.average[i] = s.total[i] / phase if phase > 0.0 else w.leaf[i]
    w.found = s.past[t.past_begin[c]]
    if phase > 0.000001 * t.interval[c]:
        tick(s, w, t, c)
        w.found = w.found + phase / t.interval[c] * (w.next - w.found)
