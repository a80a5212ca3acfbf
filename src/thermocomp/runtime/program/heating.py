"""Supervision of the spindle speeds with scalars and loops only: see `thermocomp.runtime.heat` for explanations."""

from thermocomp.runtime.heat import LEAD
from thermocomp.runtime.program.constants import Constants
from thermocomp.runtime.program.language import choose, each, function, let, procedure, raised, when
from thermocomp.runtime.program.numbers import follow, larger, smaller
from thermocomp.runtime.program.values import Number, flag, real
from thermocomp.runtime.program.variables import Kept, Work
from thermocomp.runtime.watchstate import GOOD, MISSING, OFF


@procedure
def begin_heats(s: Kept, w: Work, t: Constants) -> None:
    """Start the heats of the speeds at steady state."""
    for c in each("c", t.CHECKS):
        s.heat[c] = find_heat(w.speed[t.check_speed[c]] / t.top_speed, t.heat_power[c], t.heat_factor, t.least_share)
        s.stored[c] = s.heat[c]
        s.estimate[c] = s.heat[c]
    for k in each("k", t.STATES):
        s.estimated[k] = s.memory[t.LAGGED + k]


@function
def find_heat(share: Number, exponent: Number, most: Number, least: Number) -> Number:
    """Return the relative heat of a speed, given as a share of the top speed."""
    turning = let("turning", smaller(abs(share), most))
    with when(turning <= least):
        turning.set(0.0)
    return raised(turning, exponent)


@procedure
def find_speeds(s: Kept, w: Work, t: Constants) -> None:
    """Find the speeds that explain the temperatures."""
    for k in each("k", t.SPEEDS):
        c = let("c", t.deciding[k])
        w.found_speed[k] = w.speed[k]
        with when(c >= 0):
            share = let("share", real(0.0))
            caused = let("caused", s.estimate[c])
            with when(w.speed_lost[k] & s.fault[t.speed_fault[k]].differs(OFF)):
                caused.set(larger(s.heat[c] + LEAD * (s.estimate[c] - s.heat[c]), real(0.0)))
            with when(s.estimate[c] > t.unseen[t.SENSORS + c]):
                share.set(smaller(raised(caused, t.heat_root[c]), t.heat_factor))
            w.found_speed[k] = t.top_speed * share


@procedure
def trust_speeds(s: Kept, w: Work, t: Constants) -> None:
    """Replace each speed that is not trusted by its substitute."""
    find_speeds(s, w, t)
    for k in each("k", t.SPEEDS):
        c = let("c", t.watch_channel[t.speed_input[k]])
        with when(t.deciding[k] >= 0):
            w.value[c] = w.speed[k]
            with when(w.speed_lost[k] | s.fault[t.speed_fault[k]].differs(GOOD)):
                w.value[c] = w.found_speed[k]
                w.given[c] = True


@procedure
def check_speeds(s: Kept, w: Work, t: Constants, elapsed: Number) -> None:
    """Compare the heats of the speeds with their estimates, and find speeds that have been wrong for too long."""
    for k in each("k", t.SPEEDS):
        with when(t.deciding[k] >= 0), when(w.speed_lost[k] & s.fault[t.speed_fault[k]].equals(GOOD)):
            s.fault[t.speed_fault[k]] = MISSING
            s.gone_since[k] = w.now
            for c in each("c", t.CHECKS):
                with when(s.is_wrong[c] & t.check_speed[c].equals(k)):
                    s.fault[t.speed_fault[k]] = OFF
    advance_heats(s, w, t, elapsed)
    w.doubt = False
    for k in each("k", t.SPEEDS):
        w.wrong[k] = False
        w.agrees[k] = True
        w.turns[k] = True
    for c in each("c", t.CHECKS):
        p = let("p", t.check_speed[c])
        apart = let("apart", s.heat[c] - s.estimate[c])
        most = let("most", t.untrained_heat * larger(s.heat[c] - 1.0, real(0.0)) + t.less_heat * s.heat[c])
        with when(apart <= 0.0):
            cutting = let("cutting", larger(t.more_heat * s.heat[c], t.more_stored * s.stored[c]))
            most.set(cutting * smaller(t.heat_power[c], real(1.0)))
        least = let("least", t.off_limit[t.SENSORS + c])
        for i in each("i", t.SENSORS):
            with when(s.fault[i].differs(GOOD)):
                least.set(least + t.heat_reach[i, c])
        most.set(most + least)
        with when(abs(apart) > most):
            w.agrees[p] = False
        with when(s.heat[c] <= t.off_limit[t.SENSORS + c]):
            w.turns[p] = False
        trusted = let("trusted", s.fault[t.speed_fault[p]].equals(GOOD))
        is_wrong = let("is_wrong", trusted & (abs(apart) > most))
        with when(is_wrong & ~s.is_wrong[c]):
            s.wrong_since[c] = w.now
        s.is_wrong[c] = is_wrong
        lasts = let("lasts", w.now - s.wrong_since[c] >= t.fault_duration)
        with when(is_wrong & lasts & (w.last_change > s.wrong_since[c])):
            w.wrong[p] = True
        is_doubtful = let("is_doubtful", trusted & (abs(apart) > least))
        with when(is_doubtful & ~s.is_doubtful[c]):
            s.doubtful_since[c] = w.now
        s.is_doubtful[c] = is_doubtful
        with when(is_doubtful & (w.now - s.doubtful_since[c] < t.speed_doubt)):
            w.doubt = True
    trust_again(s, w, t)


@procedure
def advance_heats(s: Kept, w: Work, t: Constants, elapsed: Number) -> None:
    """Advance the heats, their estimates, and the states of the estimated speeds."""
    for c in each("c", t.CHECKS):
        s.estimate[c] = 0.0
        for i in each("i", t.SENSORS):
            s.estimate[c] = s.estimate[c] + s.used[i] * t.heat_direct[i, c]
        for k in each("k", t.LAGGED):
            s.estimate[c] = s.estimate[c] + s.memory[k] * t.heat_weight[k, c]
        s.estimate[c] = larger(s.estimate[c], real(0.0))
    find_speeds(s, w, t)
    for c in each("c", t.CHECKS):
        p = let("p", t.check_speed[c])
        speed = let("speed", choose(w.speed_lost[p], w.found_speed[p], w.speed[p]))
        heat = let("heat", find_heat(speed / t.top_speed, t.heat_power[c], t.heat_factor, t.least_share))
        s.heat[c] = follow(s.heat[c], heat, elapsed / t.heat_lag[c])
        s.stored[c] = follow(s.stored[c], s.heat[c], elapsed / t.heat_stored)
        with when(elapsed > t.return_time):
            s.heat[c] = s.estimate[c]
            s.stored[c] = s.estimate[c]
    for k in each("k", t.STATES):
        share = let("share", smaller(abs(w.found_speed[t.state_speed[k]]) / t.top_speed, t.heat_factor))
        quick = let("quick", t.resting_rate[k] + share * t.gain[k])
        s.estimated[k] = follow(s.estimated[k], raised(share, t.power[k]), elapsed * quick)


@procedure
def trust_again(s: Kept, w: Work, t: Constants) -> None:
    """Trust a speed again that has agreed with the temperatures for long enough."""
    for k in each("k", t.SPEEDS):
        with when(t.deciding[k] >= 0):
            p = let("p", t.speed_fault[k])
            missing = let("missing", s.fault[p].equals(MISSING))
            fits = let("fits", s.fault[p].differs(GOOD) & ~w.speed_lost[k] & w.agrees[k])
            with when(fits & ~s.does_agree[k]):
                s.agrees_since[k] = w.now
            s.does_agree[k] = fits
            agreed = let("agreed", w.now - s.agrees_since[k])
            soon = let("soon", (agreed >= s.agrees_since[k] - s.gone_since[k]) | (agreed >= t.return_time))
            forgotten = let("forgotten", w.turns[k] & ~w.some_over & (agreed >= t.speed_return))
            with when(fits & ((missing & soon) | (~missing & forgotten))):
                s.fault[p] = GOOD
                s.does_agree[k] = False


@procedure
def weigh_speeds(s: Kept, w: Work, t: Constants) -> None:
    """Compute the sum of squares of the residuals if the supervised speeds are wrong: `speeds_rest`."""
    w.speeds_rest = 0.0
    for i in each("i", t.SENSORS):
        with when(w.able[i]):
            left = let("left", w.x[i])
            for k in each("k", t.SENSORS):
                left.set(left - w.x[k] * t.direct[k, i])
            for k in each("k", t.LAGGED):
                left.set(left - s.memory[k] * t.weight[k, i])
            for k in each("k", t.STATES):
                left.set(left - s.estimated[k] * t.weight[t.LAGGED + k, i])
            w.speeds_rest = w.speeds_rest + left / t.unseen[i] * (left / t.unseen[i])


@procedure
def fail_speeds(s: Kept, w: Work, t: Constants) -> None:
    """Exclude wrong speeds; their states become those of the speeds that explain the temperatures."""
    fails = let("fails", flag(False))
    for k in each("k", t.SPEEDS):
        with when(w.wrong[k]):
            fails.set(True)
            s.fault[t.speed_fault[k]] = OFF
            for j in each("j", t.STATES):
                with when(t.state_speed[j].equals(k)):
                    s.memory[t.LAGGED + j] = s.estimated[j]
    with when(fails):
        for i in each("i", t.SENSORS):
            s.is_off[i] = False
