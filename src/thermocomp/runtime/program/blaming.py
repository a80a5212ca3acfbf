"""Sensor failure that explains the residuals of readings, with scalars and loops: see `thermocomp.runtime.blame`."""

from thermocomp.runtime.program import heating
from thermocomp.runtime.program.constants import Constants
from thermocomp.runtime.program.language import choose, each, let, procedure, when
from thermocomp.runtime.program.numbers import follow, larger
from thermocomp.runtime.program.values import Number, Whole, flag, real
from thermocomp.runtime.program.variables import Kept, Work
from thermocomp.runtime.watchstate import GOOD, STEPPED, STUCK, SWAPPED, UNEXPLAINED


@procedure
def blame(s: Kept, w: Work, t: Constants, elapsed: Number) -> None:
    """Exclude failed sensors: a swapped pair if it explains all, and better than one sensor; else single sensors."""
    for i in each("i", t.SENSORS):
        w.able[i] = w.calm[i] | w.waiting[i]
        with when(~w.able[i]):
            w.x[i] = s.used[i]
    weigh_swaps(s, w, t, choose(~s.was_fast | (w.now - s.fast > t.fault_rest), elapsed, 0.0))
    alone = let("alone", flag(False))
    for i in each("i", t.SENSORS):
        with when(w.stepped[i] | w.stuck[i] | w.unsure[i]):
            alone.set(True)
    slow = let("slow", flag(False))
    with when(t.supervised):
        for k in each("k", t.SPEEDS):
            slow.set(slow | w.wrong[k])
        w.doubt = w.doubt & ~slow
    with when(w.lasting | alone | slow):
        find_one(s, w, t)
        pair = let(
            "pair",
            (w.both >= 0) & (w.both_worst <= 1.0) & ((w.one < 0) | (t.swap_preferred * w.both_rest < w.one_rest)),
        )
        swapped = let("swapped", pair)
        with when(t.supervised):
            heating.weigh_speeds(s, w, t)
            pair.set(pair & (t.swap_preferred * w.both_rest < w.speeds_rest))
            swapped.set(pair & ~w.doubt & (w.lasting | alone))
        with when(swapped):
            fail_both(s, w, t)
        for i in each("i", t.SENSORS):
            w.failing[i] = w.stepped[i] & ~swapped & s.fault[i].equals(GOOD)
            w.onset[i] = s.usual[i]
        w.new_fault = STEPPED
        fail(s, w, t)
        with when(~swapped):
            fail_stuck(s, w, t)
        weigh_rest(s, w, t)
        sure = let("sure", w.lasting & ~swapped & ~alone)
        with when(t.supervised):
            heating.weigh_speeds(s, w, t)
            slow.set((w.one < 0) | (w.speeds_rest < t.speed_preferred * w.one_rest))
            sure.set(sure & ~slow & ~w.doubt)
            with when(slow & ~pair & ~swapped & ~alone):
                heating.fail_speeds(s, w, t)
        # otherwise no single failure explains the difference: the machine behaves differently from its training
        with when(sure & (w.one >= 0) & (w.one_worst <= 1.0)):
            for i in each("i", t.SENSORS):
                w.failing[i] = i.equals(w.one)
                w.onset[i] = 0.0
            w.new_fault = UNEXPLAINED
            fail(s, w, t)


@procedure
def weigh_rest(s: Kept, w: Work, t: Constants) -> None:
    """Find the sensor that explains most of the differences of those without a jump, and of the heats."""
    for i in each("i", t.SENSORS):
        w.able[i] = w.able[i] & ~s.has_jumped[i]
        w.weighed[i] = choose(w.able[i], w.x[i] - s.predicted[i], 0.0)
    for c in each("c", t.CHECKS):
        trusted = s.fault[t.speed_fault[t.check_speed[c]]].equals(GOOD)
        w.weighed[t.SENSORS + c] = choose(trusted, s.heat[c] - s.estimate[c], 0.0)
    weigh_one(s, w, t, t.RESIDUALS)


@procedure
def fail_stuck(s: Kept, w: Work, t: Constants) -> None:
    """Exclude constant sensors: stuck ones, and those that may be coarse instead."""
    for i in each("i", t.SENSORS):
        w.onset[i] = choose(s.fault[i].equals(GOOD), w.x[i] - s.then_predicted[i], s.used[i] - s.predicted[i])
        w.failing[i] = w.unsure[i] & s.fault[i].equals(GOOD)
    w.new_fault = UNEXPLAINED
    fail(s, w, t)
    for i in each("i", t.SENSORS):
        w.failing[i] = w.stuck[i] & (s.fault[i].equals(GOOD) | s.fault[i].equals(UNEXPLAINED))
    w.new_fault = STUCK
    fail(s, w, t)


@procedure
def fail_both(s: Kept, w: Work, t: Constants) -> None:
    """Exclude the two sensors whose swap explains the differences: swapped for certain, or else unexplained."""
    for i in each("i", t.SENSORS):
        w.failing[i] = i.equals(t.pair_first[w.both]) | i.equals(t.pair_second[w.both])
        w.onset[i] = 0.0
    certain = let("certain", (w.one < 0) | (t.swap_certain * w.both_rest < w.one_rest))
    with when(t.supervised):
        certain.set(certain & (t.swap_certain * w.both_rest < w.speeds_rest))
    w.new_fault = UNEXPLAINED
    with when(certain):
        w.new_fault = SWAPPED
    fail(s, w, t)


@procedure
def find_one(s: Kept, w: Work, t: Constants) -> None:
    """Find the sensor whose failure explains most of the current readings."""
    differ(s, w, t)
    for i in each("i", t.SENSORS):
        with when(~w.able[i]):
            w.weighed[i] = 0.0
    weigh_one(s, w, t, t.SENSORS)


@procedure
def differ(s: Kept, w: Work, t: Constants) -> None:
    """Compute in `weighed` the differences between the current readings and the predictions from the other sensors."""
    for i in each("i", t.SENSORS):
        w.weighed[i] = w.x[i]
        for k in each("k", t.SENSORS):
            w.weighed[i] = w.weighed[i] - w.x[k] * t.direct[k, i]
        for k in each("k", t.MEMORY):
            w.weighed[i] = w.weighed[i] - s.memory[k] * t.weight[k, i]


@procedure
def weigh_one(s: Kept, w: Work, t: Constants, rows: Whole) -> None:
    """Find the sensor whose failure, immediate or lagged, leaves the smallest of the first so many residuals."""
    w.one = -1
    w.one_rest = 0.0
    w.one_worst = 0.0
    for h in each("h", t.SHAPES):
        for j in each("j", t.SENSORS):
            with when(w.able[j]):
                amount = let("amount", real(0.0))
                square = let("square", real(0.0))
                for i in each("i", rows):
                    amount.set(amount + w.weighed[i] / t.unseen[i] * t.shape[h, i, j])
                    square.set(square + t.shape[h, i, j] * t.shape[h, i, j])
                amount.set(amount / square)
                rest = let("rest", real(0.0))
                worst = let("worst", real(0.0))
                for i in each("i", rows):
                    left = let("left", w.weighed[i] / t.unseen[i] - t.shape[h, i, j] * amount)
                    rest.set(rest + left * left)
                    worst.set(larger(worst, abs(left * t.unseen[i] / t.off_limit[i])))
                with when((w.one < 0) | (rest < w.one_rest)):
                    w.one = j
                    w.one_rest = rest
                    w.one_worst = worst


@procedure
def weigh_swaps(s: Kept, w: Work, t: Constants, counts: Number) -> None:
    """Weigh the evidence for swapped sensors, and find the pair whose exchange leaves the smallest differences."""
    differ(s, w, t)
    w.both = -1
    w.both_rest = 0.0
    w.both_worst = 0.0
    whole = let("whole", real(0.0))
    for i in each("i", t.SENSORS):
        with when(w.able[i]):
            whole.set(whole + w.weighed[i] / t.unseen[i] * (w.weighed[i] / t.unseen[i]))
    for p in each("p", t.PAIRS):
        with when(~s.cleared[p]):
            a = let("a", t.pair_first[p])
            b = let("b", t.pair_second[p])
            rest = let("rest", real(0.0))
            worst = let("worst", real(0.0))
            for i in each("i", t.SENSORS):
                with when(w.able[i]):
                    own = let("own", t.direct[b, i] - t.direct[a, i])
                    with when(i.equals(a)):
                        own.set(own + 1.0)
                    with when(i.equals(b)):
                        own.set(own - 1.0)
                    left = let("left", w.weighed[i] + (w.x[b] - w.x[a]) * own)
                    for k in each("k", t.TAUS):
                        apart = let("apart", s.memory[k * t.SENSORS + b] - s.memory[k * t.SENSORS + a])
                        left.set(left - apart * (t.weight[k * t.SENSORS + a, i] - t.weight[k * t.SENSORS + b, i]))
                    rest.set(rest + left / t.unseen[i] * (left / t.unseen[i]))
                    worst.set(larger(worst, abs(left / t.off_limit[i])))
            with when(w.able[a] & w.able[b]):
                s.evidence[p] = follow(s.evidence[p], whole - rest, counts / t.difference_time)
                with when((w.both < 0) | (rest < w.both_rest)):
                    w.both = p
                    w.both_rest = rest
                    w.both_worst = worst
            s.cleared[p] = ~(s.evidence[p] > -t.swap_evidence * t.SENSORS.real)


@procedure
def fail(s: Kept, w: Work, t: Constants) -> None:
    """Exclude sensors, and remove the effect of their last readings on the predictions."""
    fails = let("fails", flag(False))
    for i in each("i", t.SENSORS):
        with when(w.failing[i]):
            fails.set(True)
            for k in each("k", t.TAUS):
                s.memory[k * t.SENSORS + i] = s.memory[k * t.SENSORS + i] - s.traces[k * t.SENSORS + i]
                s.traces[k * t.SENSORS + i] = 0.0
            s.fault[i] = w.new_fault
            s.since[i] = w.now
            s.bridge[i] = w.onset[i]
            s.used[i] = s.predicted[i] + w.onset[i]
            s.has_jumped[i] = False
    with when(fails & (w.new_fault.equals(UNEXPLAINED) | w.new_fault.equals(SWAPPED))):
        for i in each("i", t.SENSORS):
            s.is_off[i] = False
