"""Monitoring of the temperatures with scalars and loops only: see `thermocomp.runtime.watch` for explanations."""

from thermocomp.runtime.feed import NONE
from thermocomp.runtime.program import blaming, heating
from thermocomp.runtime.program.averaging import Averaged
from thermocomp.runtime.program.constants import Constants
from thermocomp.runtime.program.language import (
    choose,
    each,
    exp,
    let,
    otherwise,
    otherwise_when,
    procedure,
    raised,
    when,
)
from thermocomp.runtime.program.numbers import find_day, follow, larger, smaller
from thermocomp.runtime.program.values import Number, Whole, flag, integer, real
from thermocomp.runtime.program.variables import Kept, Work
from thermocomp.runtime.watchstate import GOOD, MISSING, OFF, UNEXPLAINED

HOLDING = 2


@procedure
def believe(s: Kept, w: Work, t: Constants) -> None:
    """Replace each temperature or speed that is not trusted by its substitute."""
    w.made = True
    for k in each("k", t.SPEEDS):
        c = let("c", t.watch_channel[t.speed_input[k]])
        w.speed_lost[k] = ~(w.given[c] & (abs(w.value[c]) <= t.most_speed))
        w.speed[k] = choose(w.speed_lost[k], 0.0, w.value[c])
        with when(w.speed_lost[k] & ((t.deciding[k] < 0) | ~s.looked)):
            w.made = False
    with when(w.made & ~s.looked):
        make_up(s, w, t)
        begin(s, w, t)
    with otherwise_when(w.made):
        read_sensors(s, w, t)
        with when(w.made):
            pass_on(s, w, t)


@procedure
def read_sensors(s: Kept, w: Work, t: Constants) -> None:
    """Read the temperatures; without any of them, and with a speed missing, there is no reading."""
    some = let("some", flag(False))
    for i in each("i", t.SENSORS):
        c = let("c", t.sensor_channel[i])
        w.there[i] = False
        w.x[i] = 0.0
        with when(w.given[c] & (w.value[c] >= t.least_temperature) & (w.value[c] <= t.most_temperature)):
            w.x[i] = w.value[c] - s.watch_zero[t.sensor_input[i]]
            w.there[i] = (w.x[i] >= t.sensor_low[i] - t.sensor_span[i]) & (
                w.x[i] <= t.sensor_high[i] + t.sensor_span[i]
            )
        some.set(some | w.there[i])
    for k in each("k", t.SPEEDS):
        w.made = w.made & (some | ~w.speed_lost[k])


@procedure
def pass_on(s: Kept, w: Work, t: Constants) -> None:
    """Check the sensors, and replace those that are not trusted."""
    with when(t.supervised):
        heating.trust_speeds(s, w, t)
    with when(w.now - s.look >= t.check_interval):
        look(s, w, t)
        with when(t.supervised):
            heating.trust_speeds(s, w, t)
    for i in each("i", t.SENSORS):
        with when(s.fault[i].differs(GOOD) | ~w.there[i] | s.has_jumped[i]):
            w.value[t.sensor_channel[i]] = s.watch_zero[t.sensor_input[i]] + s.used[i]
            w.given[t.sensor_channel[i]] = True


@procedure
def make_up(s: Kept, w: Work, t: Constants) -> None:
    """Replace first readings whose distance from their training zero is not plausible given the other sensors."""
    w.rows = 0
    for i in each("i", t.SENSORS):
        c = let("c", t.sensor_channel[i])
        with when(w.given[c] & (w.value[c] >= t.least_temperature) & (w.value[c] <= t.most_temperature)):
            w.column[w.rows] = w.value[c] - t.start_zero[i]
            w.rows = w.rows + 1
    find_day(s, w, t)
    for i in each("i", t.SENSORS):
        c.set(t.sensor_channel[i])
        fits = let("fits", w.given[c] & (w.value[c] >= t.least_temperature) & (w.value[c] <= t.most_temperature))
        fits.set(fits & (abs(w.value[c] - t.start_zero[i] - w.middle) <= t.start_span[i]))
        with when(~fits):
            w.value[c] = t.start_zero[i] + larger(-t.zero_change, smaller(t.zero_change, w.middle))
            w.given[c] = True


@procedure
def begin(s: Kept, w: Work, t: Constants) -> None:
    """Add a reading to the zero of the watch if it is unknown; start at the zero, or at the first reading."""
    averaged = Averaged.of_watch(s)
    ready = let("ready", ~t.watch_waits)
    with when(t.watch_waits):
        belongs = averaged.belongs(w, t)
        with when(belongs):
            averaged.add(w, t.WATCHED, lambda k: w.value[t.watch_channel[k]])
        ready.set(~belongs | averaged.complete(t))
    with when(ready):
        start_watch(s, w, t)


@procedure
def start_watch(s: Kept, w: Work, t: Constants) -> None:
    """Start the watch from rest at its zero."""
    for k in each("k", t.WATCHED):
        w.middle = w.value[t.watch_channel[k]]
        with when(t.watch_waits):
            w.middle = s.watch_mean[k]
        s.watch_zero[k] = choose(t.watch_rezero[k], w.middle, t.watch_reference[k])
        w.change[k] = w.middle - s.watch_zero[k]
    for i in each("i", t.SENSORS):
        s.used[i] = w.change[t.sensor_input[i]]
        s.still[i] = w.now
        s.step[i] = NONE
    for k in each("k", t.SPEEDS):
        w.speed[k] = w.change[t.speed_input[k]] + s.watch_zero[t.speed_input[k]]
    calm_down(s, w, t)
    for k in each("k", t.TAUS):
        for i in each("i", t.SENSORS):
            s.memory[k * t.SENSORS + i] = s.used[i]
    for k in each("k", t.STATES):
        s.memory[t.LAGGED + k] = raised(abs(w.change[t.state_input[k]]) / t.top_speed, t.power[k])
    predict(s, w, t)
    with when(t.supervised):
        heating.begin_heats(s, w, t)
    s.looked = True
    s.look = w.now


@procedure
def calm_down(s: Kept, w: Work, t: Constants) -> None:
    """Limit speeds to a multiple of the top speed."""
    for k in each("k", t.SPEEDS):
        most = let("most", t.heat_factor * t.top_speed)
        w.change[t.speed_input[k]] = larger(-most, smaller(most, w.change[t.speed_input[k]]))


@procedure
def predict(s: Kept, w: Work, t: Constants) -> None:
    """Predict each temperature from the others, their lags and the states of the speed."""
    for i in each("i", t.SENSORS):
        s.predicted[i] = 0.0
        for k in each("k", t.SENSORS):
            s.predicted[i] = s.predicted[i] + s.used[k] * t.direct[k, i]
        for k in each("k", t.MEMORY):
            s.predicted[i] = s.predicted[i] + s.memory[k] * t.weight[k, i]


@procedure
def look(s: Kept, w: Work, t: Constants) -> None:
    """Check all temperature sensors and advance their predictions."""
    elapsed = let("elapsed", w.now - s.look)
    s.look = w.now
    find_jumps(s, w, t, elapsed)
    for i in each("i", t.SENSORS):
        with when(~w.there[i] & s.fault[i].equals(GOOD)):
            s.fault[i] = MISSING
            s.since[i] = w.now
            s.bridge[i] = s.usual[i]
            s.is_back[i] = False
            s.has_jumped[i] = False
        w.waiting[i] = s.has_jumped[i] & s.fault[i].equals(GOOD) & w.there[i]
    for i in each("i", t.SENSORS):
        s.used[i] = w.x[i]
        with when(s.fault[i].differs(GOOD)):
            s.used[i] = s.predicted[i] + s.bridge[i] * exp(-(w.now - s.since[i]) / t.substitute_fade)
        with otherwise_when(w.waiting[i]):
            s.used[i] = s.usual[i] + s.predicted[i]
    advance(s, w, t, elapsed)
    predict(s, w, t)
    for i in each("i", t.SENSORS):
        with when(s.fault[i].differs(GOOD)):
            s.used[i] = s.predicted[i] + s.bridge[i] * exp(-(w.now - s.since[i]) / t.substitute_fade)
        w.difference[i] = w.x[i] - s.predicted[i]
        w.calm[i] = s.fault[i].equals(GOOD) & w.there[i] & ~w.waiting[i]
        with when(w.calm[i]):
            s.usual[i] = follow(s.usual[i], w.difference[i], elapsed / t.difference_time)
    for k in each("k", t.TAUS):
        for i in each("i", t.SENSORS):
            inner = let("inner", choose(w.calm[i], w.difference[i], 0.0))
            s.traces[k * t.SENSORS + i] = follow(s.traces[k * t.SENSORS + i], inner, elapsed / t.tau[k])
    find_stuck(s, w, t, elapsed)
    find_over(s, w, t)
    with when(t.supervised):
        heating.check_speeds(s, w, t, elapsed)
    find_fast(s, w, t)
    find_off(s, w, t)
    blaming.blame(s, w, t, elapsed)
    believe_again(s, w, t)


@procedure
def find_jumps(s: Kept, w: Work, t: Constants, elapsed: Number) -> None:
    """Find jumps, discard spikes, and confirm lasting jumps."""
    find_coarser(s, w, t)
    for i in each("i", t.SENSORS):
        slack = let("slack", t.jump_limit[i] + w.coarser[i])
        with when(elapsed > t.pace):
            slack.set(slack * (elapsed / t.pace))
        w.before[i] = choose(s.has_jumped[i], s.predicted[i] + s.usual[i], s.used[i])
        w.stepped[i] = False
        with when(w.there[i] & s.fault[i].equals(GOOD)):
            w.far[i] = abs(w.x[i] - w.before[i]) > slack
            with when(~w.far[i]):
                s.has_jumped[i] = False
            with otherwise_when(s.has_jumped[i]):
                w.stepped[i] = w.now - s.jumped[i] >= t.fault_duration
            with otherwise():
                s.has_jumped[i] = True
                s.jumped[i] = w.now


@procedure
def advance(s: Kept, w: Work, t: Constants, elapsed: Number) -> None:
    """Advance the lags of the temperatures and the states of the speed."""
    for k in each("k", t.SPEEDS):
        w.change[t.speed_input[k]] = w.value[t.watch_channel[t.speed_input[k]]] - s.watch_zero[t.speed_input[k]]
    calm_down(s, w, t)
    for k in each("k", t.TAUS):
        for i in each("i", t.SENSORS):
            s.memory[k * t.SENSORS + i] = follow(s.memory[k * t.SENSORS + i], s.used[i], elapsed / t.tau[k])
    for k in each("k", t.STATES):
        share = let("share", abs(w.change[t.state_input[k]]) / t.top_speed)
        quick = let("quick", t.resting_rate[k] + share * t.gain[k])
        s.memory[t.LAGGED + k] = follow(s.memory[t.LAGGED + k], raised(share, t.power[k]), elapsed * quick)


@procedure
def find_stuck(s: Kept, w: Work, t: Constants, elapsed: Number) -> None:
    """Find sensors with constant readings although the prediction, or for too long another sensor, has changed."""
    lives = let("lives", flag(False))
    gap = let("gap", choose(elapsed > t.fault_duration, elapsed - t.fault_duration, 0.0))
    for i in each("i", t.SENSORS):
        both = let("both", w.there[i] & s.read_once[i])
        w.changed[i] = ~(both & w.x[i].equals(s.same[i]))
        step = let("step", abs(w.x[i] - s.same[i]))
        with when(both & w.changed[i] & (step < s.step[i])):
            s.step[i] = step
        with when(w.calm[i] & w.changed[i]):
            lives.set(True)
    w.last_change = -1e30
    for i in each("i", t.SENSORS):
        s.still[i] = choose(w.changed[i], w.now, s.still[i] + gap)
        with when(w.calm[i] & (s.still[i] > w.last_change)):
            w.last_change = s.still[i]
    find_coarser(s, w, t)
    for i in each("i", t.SENSORS):
        apart = let("apart", abs(s.predicted[i] - s.then_predicted[i]))
        able = let("able", w.calm[i] | (w.there[i] & s.fault[i].equals(UNEXPLAINED)))
        most = let("most", larger(t.moved_limit[i], t.frozen_limit[i]))
        coarse = let("coarse", w.coarser[i] > 0.0)
        least = let("least", choose(coarse, most + w.coarser[i], t.moved_limit[i]))
        moves = let("moves", ~w.changed[i] & able & (apart > least))
        with when(w.changed[i]):
            s.read_once[i] = w.there[i]
            s.same[i] = w.x[i]
            s.then_predicted[i] = s.predicted[i]
        with when(moves & ~s.is_moving[i]):
            s.moving[i] = w.now
        s.is_moving[i] = moves
        w.stuck[i] = moves & (w.now - s.moving[i] >= t.fault_duration) & (w.last_change > s.moving[i])
        lasts = let("lasts", lives & ~coarse & (w.now - s.still[i] > t.still_limit[i]))
        with when(~w.changed[i] & w.calm[i] & lasts):
            w.stuck[i] = True
        unsure = let("unsure", (s.step[i] >= NONE) & (apart <= most + t.same_moved * t.unknown_step))
        w.unsure[i] = w.stuck[i] & unsure & w.calm[i]
        w.stuck[i] = w.stuck[i] & ~unsure


@procedure
def find_coarser(s: Kept, w: Work, t: Constants) -> None:
    """Find by how much rounding may move readings more than in the training."""
    least = let("least", real(NONE))
    for i in each("i", t.SENSORS):
        w.coarser[i] = t.same_moved * larger(s.step[i] - t.step_limit[i], real(0.0))
        with when(w.coarser[i] < least):
            least.set(w.coarser[i])
    for i in each("i", t.SENSORS):
        with when(s.step[i] >= NONE):
            w.coarser[i] = choose(least < NONE, least, 0.0)


@procedure
def find_fast(s: Kept, w: Work, t: Constants) -> None:
    """Find untrained speeds and substitutes for speeds: predictions are not validated with them."""
    for k in each("k", t.SPEEDS):
        fast = let("fast", abs(w.change[t.speed_input[k]]) > t.fast_factor * t.top_speed)
        with when(t.deciding[k] >= 0), when(s.fault[t.speed_fault[k]].differs(GOOD)):
            fast.set(True)
        with when(fast):
            s.was_fast = True
            s.fast = w.now


@procedure
def find_over(s: Kept, w: Work, t: Constants) -> None:
    """Find sensors whose difference from the prediction is over its limit."""
    w.some_over = False
    for i in each("i", t.SENSORS):
        caused = let("caused", real(0.0))
        for k in each("k", t.STATES):
            caused.set(caused + s.memory[t.LAGGED + k] * t.weight[t.LAGGED + k, i])
        most = let("most", t.off_limit[i] + t.more_heat * abs(caused))
        w.over[i] = w.calm[i] & (abs(w.difference[i] / most) > 1.0)
        with when(w.over[i]):
            w.some_over = True


@procedure
def find_off(s: Kept, w: Work, t: Constants) -> None:
    """Find sensors whose difference from the prediction has been too large for too long."""
    rested = let("rested", ~s.was_fast | (w.now - s.fast > t.fault_rest))
    for i in each("i", t.SENSORS):
        with when((s.fault[i] > MISSING) & (w.now - s.since[i] <= t.fault_rest)):
            rested.set(False)
    w.lasting = False
    for i in each("i", t.SENSORS):
        beyond = let("beyond", rested & w.over[i])
        with when(beyond & ~s.is_off[i]):
            s.off_since[i] = w.now
        s.is_off[i] = beyond
        with when(beyond & (w.now - s.off_since[i] >= t.fault_duration) & (w.last_change > s.off_since[i])):
            w.lasting = True


@procedure
def believe_again(s: Kept, w: Work, t: Constants) -> None:
    """Trust a missing or unexplained sensor again once its readings agree with the prediction."""
    for i in each("i", t.SENSORS):
        missing = let("missing", s.fault[i].equals(MISSING))
        moved = let("moved", abs(s.predicted[i]) >= t.agree_moved * t.off_limit[i])
        may = let("may", missing | (s.fault[i].equals(UNEXPLAINED) & moved))
        fits = let("fits", may & w.there[i] & (abs(w.difference[i]) <= t.off_limit[i]))
        with when(fits & ~s.is_back[i]):
            s.back[i] = w.now
        s.is_back[i] = fits
        with when(fits & (w.now - s.back[i] >= choose(missing, t.return_time, t.fault_rest))):
            s.fault[i] = GOOD
            s.usual[i] = w.difference[i]
            s.used[i] = s.predicted[i] + w.difference[i]
            s.read_once[i] = False
            s.is_back[i] = False


@procedure
def judge(s: Kept, w: Work, t: Constants, k: Whole) -> None:
    """Hold a correction if its models were judged harmful, or not judged at all, without the failed sensors."""
    for m in each("m", t.line_begin[k], t.line_begin[k + 1]):
        lost = let("lost", integer(0))
        allowed = let("allowed", flag(True))
        effects = let("effects", real(0.0))
        for i in each("i", t.FAILING):
            with when(s.fault[i].differs(GOOD) & t.leans_on[m, i]):
                lost.set(lost + 1)
                effects.set(effects + t.effect[m, i])
                allowed.set(allowed & t.may_lose[m, i] & ((i < t.SENSORS) | s.fault[i].differs(OFF)))
        with when(lost > 1):
            found = let("found", (lost <= t.most_lost[m]) & (effects <= t.most_effect[m]))
            for j in each("j", t.JUDGED):
                fits = let("fits", t.judged_model[j].equals(m))
                for i in each("i", t.FAILING):
                    gone = let("gone", s.fault[i].differs(GOOD) & t.leans_on[m, i])
                    fits.set(fits & t.judged_without[j, i].equals(gone))
                found.set(found | fits)
            allowed.set(allowed & found)
        with when(~allowed):
            s.status[k] = HOLDING
