"""Sensor failure that explains the residuals of readings, as scalars and loops: see `thermocomp.runtime.blame`."""

from thermocomp.export.block.names import Names
from thermocomp.export.block.numbers import follow, larger
from thermocomp.runtime.blame import AGAINST, USUAL
from thermocomp.runtime.watch import GOOD, OFF, REST, STEPPED, STUCK, SWAPPED


def blame(s: Names, w: Names, t: Names, elapsed: float) -> None:
    """Exclude failed sensors: a swapped pair if it explains all, and better than one sensor; else single sensors.

    Parameters
    ----------
    s, w, t : Names
        State kept between calls, work variables, and constants.
    elapsed : float
        Time since the last check [s].
    """
    for i in range(t.SENSORS):
        w.able[i] = w.calm[i] or w.waiting[i]
        if not w.able[i]:
            w.x[i] = s.used[i]
    weigh_swaps(s, w, t, elapsed if not s.was_fast or w.now - s.fast > REST else 0.0)
    alone = False
    for i in range(t.SENSORS):
        if w.stepped[i] or w.stuck[i]:
            alone = True
    if w.lasting or alone:
        find_one(s, w, t)
        swapped = w.both >= 0 and w.both_worst <= 1.0 and (w.one < 0 or w.both_rest < w.one_rest)
        if swapped:
            for i in range(t.SENSORS):
                w.failing[i] = i == t.pair_first[w.both] or i == t.pair_second[w.both]
                w.onset[i] = 0.0
            w.new_fault = SWAPPED
            fail(s, w, t)
        for i in range(t.SENSORS):
            w.failing[i] = w.stepped[i] and not swapped and s.fault[i] == GOOD
            w.onset[i] = s.usual[i]
        w.new_fault = STEPPED
        fail(s, w, t)
        for i in range(t.SENSORS):
            w.failing[i] = w.stuck[i] and not swapped and s.fault[i] == GOOD
            w.onset[i] = w.x[i] - s.then_predicted[i]
        w.new_fault = STUCK
        fail(s, w, t)
        for i in range(t.SENSORS):
            w.able[i] = w.able[i] and not s.has_jumped[i]
            w.weighed[i] = w.x[i] - s.predicted[i] if w.able[i] else 0.0
        weigh_one(s, w, t)
        # otherwise no single failure explains the difference: the machine behaves differently from its training
        if w.lasting and not swapped and not alone and w.one >= 0 and w.one_worst <= 1.0:
            for i in range(t.SENSORS):
                w.failing[i] = i == w.one
                w.onset[i] = 0.0
            w.new_fault = OFF
            fail(s, w, t)


def find_one(s: Names, w: Names, t: Names) -> None:
    """Find the sensor whose failure explains most of the current readings."""
    differ(s, w, t)
    for i in range(t.SENSORS):
        if not w.able[i]:
            w.weighed[i] = 0.0
    weigh_one(s, w, t)


def differ(s: Names, w: Names, t: Names) -> None:
    """Compute in `weighed` the differences between the current readings and the predictions from the other sensors."""
    for i in range(t.SENSORS):
        w.weighed[i] = w.x[i]
        for k in range(t.SENSORS):
            w.weighed[i] = w.weighed[i] - w.x[k] * t.direct[k][i]
        for k in range(t.MEMORY):
            w.weighed[i] = w.weighed[i] - s.memory[k] * t.weight[k][i]


def weigh_one(s: Names, w: Names, t: Names) -> None:
    """Find the sensor whose failure, immediate or lagged, leaves the smallest differences."""
    w.one = -1
    w.one_rest = 0.0
    w.one_worst = 0.0
    for h in range(t.SHAPES):
        for j in range(t.SENSORS):
            if w.able[j]:
                amount = 0.0
                square = 0.0
                for i in range(t.SENSORS):
                    amount = amount + w.weighed[i] / t.unseen[i] * t.shape[h][i][j]
                    square = square + t.shape[h][i][j] * t.shape[h][i][j]
                amount = amount / square
                rest = 0.0
                worst = 0.0
                for i in range(t.SENSORS):
                    left = w.weighed[i] / t.unseen[i] - t.shape[h][i][j] * amount
                    rest = rest + left * left
                    worst = larger(worst, abs(left * t.unseen[i] / t.off_limit[i]))
                if w.one < 0 or rest < w.one_rest:
                    w.one = j
                    w.one_rest = rest
                    w.one_worst = worst


def weigh_swaps(s: Names, w: Names, t: Names, counts: float) -> None:
    """Weigh the evidence for swapped sensors, and find the pair whose exchange leaves the smallest differences.

    Parameters
    ----------
    s, w, t : Names
        State kept between calls, work variables, and constants.
    counts : float
        Time counted as evidence [s].
    """
    differ(s, w, t)
    w.both = -1
    w.both_rest = 0.0
    w.both_worst = 0.0
    whole = 0.0
    for i in range(t.SENSORS):
        if w.able[i]:
            whole = whole + w.weighed[i] / t.unseen[i] * (w.weighed[i] / t.unseen[i])
    for p in range(t.PAIRS):
        if not s.cleared[p]:
            a = t.pair_first[p]
            b = t.pair_second[p]
            rest = 0.0
            worst = 0.0
            for i in range(t.SENSORS):
                if w.able[i]:
                    own = t.direct[b][i] - t.direct[a][i]
                    if i == a:
                        own = own + 1.0
                    if i == b:
                        own = own - 1.0
                    left = w.weighed[i] + (w.x[b] - w.x[a]) * own
                    for k in range(t.TAUS):
                        apart = s.memory[k * t.SENSORS + b] - s.memory[k * t.SENSORS + a]
                        left = left - apart * (t.weight[k * t.SENSORS + a][i] - t.weight[k * t.SENSORS + b][i])
                    rest = rest + left / t.unseen[i] * (left / t.unseen[i])
                    worst = larger(worst, abs(left / t.off_limit[i]))
            if w.able[a] and w.able[b]:
                s.evidence[p] = follow(s.evidence[p], whole - rest, counts / USUAL)
                if w.both < 0 or rest < w.both_rest:
                    w.both = p
                    w.both_rest = rest
                    w.both_worst = worst
            s.cleared[p] = not (s.evidence[p] > -AGAINST * t.SENSORS)


def fail(s: Names, w: Names, t: Names) -> None:
    """Exclude sensors, and remove the effect of their last readings on the predictions."""
    fails = False
    for i in range(t.SENSORS):
        if w.failing[i]:
            fails = True
            for k in range(t.TAUS):
                s.memory[k * t.SENSORS + i] = s.memory[k * t.SENSORS + i] - s.traces[k * t.SENSORS + i]
                s.traces[k * t.SENSORS + i] = 0.0
            s.fault[i] = w.new_fault
            s.since[i] = w.now
            s.bridge[i] = w.onset[i]
            s.used[i] = s.predicted[i] + w.onset[i]
            s.has_jumped[i] = False
    if fails and (w.new_fault == OFF or w.new_fault == SWAPPED):
        for i in range(t.SENSORS):
            s.is_off[i] = False
