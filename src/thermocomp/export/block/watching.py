"""Monitoring of the temperatures as scalars and loops: see `thermocomp.runtime.watch` for explanations."""

import math

from thermocomp.core.watch import FASTER, LASTING
from thermocomp.export.block import blaming
from thermocomp.export.block.names import Names
from thermocomp.export.block.numbers import find_mean, follow, larger, smaller, sort
from thermocomp.runtime.blame import USUAL
from thermocomp.runtime.gate import DAY, PLAUSIBLE
from thermocomp.runtime.watch import FADE, GOOD, HEATS, MISSING, REST, RETURN, TICK

COLDEST, HOTTEST = PLAUSIBLE["temperature"]
FASTEST = PLAUSIBLE["spindle_speed"][1]
HOLDING = 2


def believe(s: Names, w: Names, t: Names) -> None:
    """Replace each temperature that is not trusted."""
    w.made = True
    for k in range(t.SPEEDS):
        c = t.watch_channel[t.speed_input[k]]
        if not (w.given[c] and abs(w.value[c]) <= FASTEST):
            w.made = False
    if w.made and not s.looked:
        make_up(s, w, t)
        begin(s, w, t)
    elif w.made:
        for i in range(t.SENSORS):
            c = t.sensor_channel[i]
            w.there[i] = False
            w.x[i] = 0.0
            if w.given[c] and w.value[c] >= COLDEST and w.value[c] <= HOTTEST:
                w.x[i] = w.value[c] - s.watch_zero[t.sensor_input[i]]
                w.there[i] = (
                    w.x[i] >= t.sensor_low[i] - t.sensor_span[i] and w.x[i] <= t.sensor_high[i] + t.sensor_span[i]
                )
        if w.now - s.look >= TICK:
            look(s, w, t)
        for i in range(t.SENSORS):
            if s.fault[i] != GOOD or not w.there[i] or s.has_jumped[i]:
                w.value[t.sensor_channel[i]] = s.watch_zero[t.sensor_input[i]] + s.used[i]
                w.given[t.sensor_channel[i]] = True


def make_up(s: Names, w: Names, t: Names) -> None:
    """Replace first readings whose distance from their training zero is not plausible given the other sensors."""
    w.rows = 0
    for i in range(t.SENSORS):
        c = t.sensor_channel[i]
        if w.given[c] and w.value[c] >= COLDEST and w.value[c] <= HOTTEST:
            w.column[w.rows] = w.value[c] - t.start_zero[i]
            w.rows = w.rows + 1
    w.middle = 0.0
    if w.rows > 0:
        sort(s, w, t)
        w.middle = w.column[(w.rows - 1) // 2]
    for i in range(t.SENSORS):
        c = t.sensor_channel[i]
        fits = w.given[c] and w.value[c] >= COLDEST and w.value[c] <= HOTTEST
        fits = fits and abs(w.value[c] - t.start_zero[i] - w.middle) <= t.start_span[i]
        if not fits:
            w.value[c] = t.start_zero[i] + larger(-DAY, smaller(DAY, w.middle))
            w.given[c] = True


def begin(s: Names, w: Names, t: Names) -> None:
    """Add a reading to the zero if it is unknown; start from rest at the zero, or at the first reading."""
    belongs = t.watch_waits and s.watch_gathered == 0
    if t.watch_waits and not belongs and s.watch_gathered < t.MOST and (w.stands or not s.watch_resting):
        belongs = w.now - s.watch_gathered_at[0] <= (t.at_rest if s.watch_resting else t.otherwise)
    ready = not belongs
    if belongs:
        if s.watch_gathered == 0:
            s.watch_resting = w.stands
        s.watch_gathered_at[s.watch_gathered] = w.now
        for k in range(t.WATCHED):
            s.watch_gathered_value[s.watch_gathered][k] = w.value[t.watch_channel[k]]
        s.watch_gathered = s.watch_gathered + 1
        ready = s.watch_gathered >= t.MOST or w.now - s.watch_gathered_at[0] >= (
            t.at_rest if s.watch_resting else t.otherwise
        )
    if ready:
        for k in range(t.WATCHED):
            w.middle = w.value[t.watch_channel[k]]
            if t.watch_waits:
                w.rows = s.watch_gathered
                for m in range(w.rows):
                    w.column[m] = s.watch_gathered_value[m][k]
                find_mean(s, w, t)
            s.watch_zero[k] = w.middle if t.watch_rezero[k] else t.watch_reference[k]
            w.change[k] = w.middle - s.watch_zero[k]
        for i in range(t.SENSORS):
            s.used[i] = w.change[t.sensor_input[i]]
            s.still[i] = w.now
        calm_down(s, w, t)
        for k in range(t.TAUS):
            for i in range(t.SENSORS):
                s.memory[k * t.SENSORS + i] = s.used[i]
        for k in range(t.STATES):
            s.memory[t.LAGGED + k] = math.pow(abs(w.change[t.state_input[k]]) / t.top_speed, t.power[k])
        predict(s, w, t)
        s.looked = True
        s.look = w.now


def calm_down(s: Names, w: Names, t: Names) -> None:
    """Limit speeds to a multiple of the top speed."""
    for k in range(t.SPEEDS):
        most = HEATS * t.top_speed
        w.change[t.speed_input[k]] = larger(-most, smaller(most, w.change[t.speed_input[k]]))


def predict(s: Names, w: Names, t: Names) -> None:
    """Predict each temperature from the others, their lags and the states of the speed."""
    for i in range(t.SENSORS):
        s.predicted[i] = 0.0
        for k in range(t.SENSORS):
            s.predicted[i] = s.predicted[i] + s.used[k] * t.direct[k][i]
        for k in range(t.MEMORY):
            s.predicted[i] = s.predicted[i] + s.memory[k] * t.weight[k][i]


def look(s: Names, w: Names, t: Names) -> None:
    """Check all sensors and advance the predictions."""
    elapsed = w.now - s.look
    s.look = w.now
    find_jumps(s, w, t, elapsed)
    for i in range(t.SENSORS):
        if not w.there[i] and s.fault[i] == GOOD:
            s.fault[i] = MISSING
            s.since[i] = w.now
            s.bridge[i] = s.usual[i]
            s.is_back[i] = False
            s.has_jumped[i] = False
        w.waiting[i] = s.has_jumped[i] and s.fault[i] == GOOD and w.there[i]
    for i in range(t.SENSORS):
        s.used[i] = w.x[i]
        if s.fault[i] != GOOD:
            s.used[i] = s.predicted[i] + s.bridge[i] * math.exp(-(w.now - s.since[i]) / FADE)
        elif w.waiting[i]:
            s.used[i] = s.usual[i] + s.predicted[i]
    advance(s, w, t, elapsed)
    predict(s, w, t)
    for i in range(t.SENSORS):
        if s.fault[i] != GOOD:
            s.used[i] = s.predicted[i] + s.bridge[i] * math.exp(-(w.now - s.since[i]) / FADE)
        w.difference[i] = w.x[i] - s.predicted[i]
        w.calm[i] = s.fault[i] == GOOD and w.there[i] and not w.waiting[i]
        if w.calm[i]:
            s.usual[i] = follow(s.usual[i], w.difference[i], elapsed / USUAL)
    for k in range(t.TAUS):
        for i in range(t.SENSORS):
            inner = w.difference[i] if w.calm[i] else 0.0
            s.traces[k * t.SENSORS + i] = follow(s.traces[k * t.SENSORS + i], inner, elapsed / t.tau[k])
    find_stuck(s, w, t)
    find_off(s, w, t)
    blaming.blame(s, w, t, elapsed)
    believe_again(s, w, t)


def find_jumps(s: Names, w: Names, t: Names, elapsed: float) -> None:
    """Find jumps, discard spikes, and confirm lasting jumps.

    Parameters
    ----------
    s, w, t : Names
        State kept between calls, work variables, and constants.
    elapsed : float
        Time since the last check [s].
    """
    for i in range(t.SENSORS):
        slack = t.jump_limit[i]
        if elapsed > t.pace:
            slack = slack * (elapsed / t.pace)
        w.before[i] = s.predicted[i] + s.usual[i] if s.has_jumped[i] else s.used[i]
        w.stepped[i] = False
        if w.there[i] and s.fault[i] == GOOD:
            w.far[i] = abs(w.x[i] - w.before[i]) > slack
            if not w.far[i]:
                s.has_jumped[i] = False
            elif s.has_jumped[i]:
                w.stepped[i] = w.now - s.jumped[i] >= LASTING
            else:
                s.has_jumped[i] = True
                s.jumped[i] = w.now


def advance(s: Names, w: Names, t: Names, elapsed: float) -> None:
    """Advance the lags of the temperatures and the states of the speed.

    Parameters
    ----------
    s, w, t : Names
        State kept between calls, work variables, and constants.
    elapsed : float
        Time since the last check [s].
    """
    for k in range(t.SPEEDS):
        w.change[t.speed_input[k]] = w.value[t.watch_channel[t.speed_input[k]]] - s.watch_zero[t.speed_input[k]]
    calm_down(s, w, t)
    for k in range(t.TAUS):
        for i in range(t.SENSORS):
            s.memory[k * t.SENSORS + i] = follow(s.memory[k * t.SENSORS + i], s.used[i], elapsed / t.tau[k])
    for k in range(t.STATES):
        share = abs(w.change[t.state_input[k]]) / t.top_speed
        quick = t.resting_rate[k] + share * t.gain[k]
        s.memory[t.LAGGED + k] = follow(s.memory[t.LAGGED + k], math.pow(share, t.power[k]), elapsed * quick)
    for k in range(t.SPEEDS):
        if abs(w.change[t.speed_input[k]]) > FASTER * t.top_speed:
            s.was_fast = True
            s.fast = w.now


def find_stuck(s: Names, w: Names, t: Names) -> None:
    """Find sensors with constant readings although the prediction, or for too long another sensor, has changed."""
    lives = False
    for i in range(t.SENSORS):
        same = w.there[i] and s.read_once[i] and w.x[i] == s.same[i]
        w.changed[i] = not same
        if w.calm[i] and w.changed[i]:
            lives = True
    for i in range(t.SENSORS):
        moves = not w.changed[i] and w.calm[i] and abs(s.predicted[i] - s.then_predicted[i]) > t.moved_limit[i]
        if w.changed[i]:
            s.read_once[i] = w.there[i]
            s.same[i] = w.x[i]
            s.still[i] = w.now
            s.then_predicted[i] = s.predicted[i]
        if moves and not s.is_moving[i]:
            s.moving[i] = w.now
        s.is_moving[i] = moves
        w.stuck[i] = moves and w.now - s.moving[i] >= LASTING
        if not w.changed[i] and w.calm[i] and lives and w.now - s.still[i] > t.still_limit[i]:
            w.stuck[i] = True


def find_off(s: Names, w: Names, t: Names) -> None:
    """Find differences that have been too large for too long."""
    rested = not s.was_fast or w.now - s.fast > REST
    for i in range(t.SENSORS):
        if s.fault[i] > MISSING and w.now - s.since[i] <= REST:
            rested = False
    w.lasting = False
    for i in range(t.SENSORS):
        beyond = rested and w.calm[i] and abs(w.difference[i] / t.off_limit[i]) > 1.0
        if beyond and not s.is_off[i]:
            s.off_since[i] = w.now
        s.is_off[i] = beyond
        if beyond and w.now - s.off_since[i] >= LASTING:
            w.lasting = True


def believe_again(s: Names, w: Names, t: Names) -> None:
    """Trust a missing sensor again once its readings agree with the prediction."""
    for i in range(t.SENSORS):
        fits = s.fault[i] == MISSING and w.there[i] and abs(w.difference[i]) <= t.off_limit[i]
        if fits and not s.is_back[i]:
            s.back[i] = w.now
        s.is_back[i] = fits
        if fits and w.now - s.back[i] >= RETURN:
            s.fault[i] = GOOD
            s.usual[i] = w.difference[i]
            s.used[i] = s.predicted[i] + w.difference[i]
            s.read_once[i] = False
            s.is_back[i] = False


def judge(s: Names, w: Names, t: Names, k: int) -> None:
    """Hold a correction if its models were judged harmful, or not judged at all, without the failed sensors.

    Parameters
    ----------
    s, w, t : Names
        State kept between calls, work variables, and constants.
    k : int
        Index of the target.
    """
    for m in range(t.line_begin[k], t.line_begin[k + 1]):
        lost = 0
        allowed = True
        for i in range(t.SENSORS):
            if s.fault[i] != GOOD and t.leans_on[m][i]:
                lost = lost + 1
                allowed = allowed and t.may_lose[m][i]
        if lost > 1:
            found = False
            for j in range(t.JUDGED):
                fits = t.judged_model[j] == m
                for i in range(t.SENSORS):
                    gone = s.fault[i] != GOOD and t.leans_on[m][i]
                    fits = fits and t.judged_without[j][i] == gone
                found = found or fits
            allowed = allowed and found
        if not allowed:
            s.status[k] = HOLDING
