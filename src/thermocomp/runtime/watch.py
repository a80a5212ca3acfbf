"""The watch over the temperatures, reading by reading: which sensors are trusted, and substitutes for the others.

State in, state out; leading array axes are a batch of independent runs with the same clock. Only past readings are
used. A missing sensor is replaced immediately by its prediction from the other sensors and the speed; a sensor that has
jumped, is stuck or deviates, as soon as this is certain. A substitute starts at the last value of the sensor and moves
to the prediction, so that there is no jump. A missing sensor is trusted again when it agrees with its prediction. So is
one with an unexplained deviation, which may be due to heat near it that the training did not contain, as of a moving
axis. Other failed sensors are not trusted until a restart, since they must be repaired.
"""

import numpy as np
from numpy.typing import NDArray

from thermocomp.core import lagbank
from thermocomp.core.watch import Watch
from thermocomp.core.zero import ZeroMean
from thermocomp.runtime import heat
from thermocomp.runtime.blame import find_limits, one_fails, speeds_fail, weigh_swaps
from thermocomp.runtime.plausible import is_plausible, replace_first
from thermocomp.runtime.watchstate import GOOD, MISSING, STEPPED, STUCK, SWAPPED, UNEXPLAINED, WatchState

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


def is_quiet(watch: Watch, state: WatchState, time: float) -> bool:
    """Return whether all sensors are good and no check is due; a plausible reading is then used unchanged."""
    due = not time - state.time < watch.thresholds.check_interval  # also if the time is unknown
    return not due and state.sound and not np.count_nonzero(state.jumped == state.jumped)


def look(
    watch: Watch, state: WatchState, time: float, values: FloatArray, *, resting: bool = False
) -> tuple[WatchState, FloatArray]:
    """Process a reading and return the values to be used for it.

    Parameters
    ----------
    time : float
        Time of the reading, later than the previous one [s].
    values : ndarray of shape (..., n_inputs)
        Values in the order of the watch's inputs; nan where a value is missing. If a speed is missing, nothing is
        predicted and the values are returned unchanged.

    Returns
    -------
    values : ndarray of shape (..., n_inputs)
        Values with substitutes for temperatures that are not trusted.
    """
    temperatures, speeds = watch.bank.temperatures, values.take(watch.speeds, axis=-1)
    believed = values.copy()
    lost = ~(np.abs(speeds) <= watch.thresholds.most_speed)  # an impossible speed must not enter the memory
    if (lost & ((watch.deciding < 0) | np.isnan(state.time))).any():
        return state, believed
    if np.isnan(state.time):
        believed[..., temperatures] = replace_first(watch, values[..., temperatures])
        return _start(watch, state, time, believed, resting), believed
    zero = state.reference.take(temperatures, axis=-1)
    read = values.take(temperatures, axis=-1)
    x = read - zero
    missing = ~is_plausible(watch, x, read)
    if (lost.any(axis=-1) & missing.all(axis=-1)).any():
        return state, believed  # there is no reading at all
    believed[..., watch.speeds] = heat.trust(watch, state.heat, speeds, lost)
    if time - state.time >= watch.thresholds.check_interval:
        known = np.where(lost, np.nan, speeds)
        state = _step(watch, state, time, np.where(missing, np.nan, x), believed, known)
        believed[..., watch.speeds] = heat.trust(watch, state.heat, speeds, lost)
    if (replaced := (state.fault != GOOD) | missing | np.isfinite(state.jumped)).any():
        believed[..., temperatures] = np.where(replaced, zero + state.used, read)
    return state, believed


def _start(watch: Watch, state: WatchState, time: float, values: FloatArray, resting: bool) -> WatchState:
    """Add a reading to the zero if unknown; then start at rest in the zero, or else in the first reading."""
    averaged = state.averaged
    unknown = bool(np.isnan(state.reference).any())
    if unknown and averaged.belongs(watch.zeroing, time, resting):
        averaged = averaged.add(time, values, resting)
        if not averaged.complete(watch.zeroing):
            return state._replace(averaged=averaged)
    zero, begun = state.reference, values
    if unknown:  # start at rest in the zero, even if the spindle turns in the reading that ends it
        begun = averaged.mean
        zero = np.where(np.isnan(zero), begun, zero)
    change = begun - zero
    memory, used = watch.bank.signals(_calmed(watch, change))[0], change[..., watch.bank.temperatures]
    direct, weights = watch.read_out
    if watch.checks:
        state = state._replace(heat=heat.start(watch, state.heat, memory, begun[..., watch.speeds]))
    return state._replace(
        reference=zero,
        averaged=ZeroMean(),
        time=time,
        memory=memory,
        used=used,
        predicted=used @ direct + memory @ weights,
        still=np.full(used.shape, time),
    )


def _stand_in(watch: Watch, state: WatchState, time: float) -> FloatArray:
    """Return the substitute value of each sensor, minus its reference."""
    gone = np.fmax(time - state.since, 0.0)  # 0 if not failed
    return state.predicted + state.bridge * np.exp(-gone / watch.thresholds.substitute_fade)


def _step(
    watch: Watch, state: WatchState, time: float, x: FloatArray, values: FloatArray, speeds: FloatArray
) -> WatchState:
    """Check all sensors and return the next state; `x` and `speeds` (as read) are nan where a value is missing."""
    dt, seen = time - state.time, np.isfinite(x)
    s = state._replace(time=time)
    s, stepped = _jumps(watch, s, x, dt, seen & (s.fault == GOOD))
    s = _missing(s, seen)
    failed = s.fault != GOOD
    some_failed, waiting = failed.any(), np.isfinite(s.jumped) & ~failed & seen
    used = np.where(waiting, s.usual + s.predicted, x)
    if some_failed:  # every missing sensor among them
        used = np.where(failed, _stand_in(watch, s, time), used)
    change = _calmed(watch, values - s.reference)
    change[..., watch.bank.temperatures] = used
    memory = watch.bank.advance(s.memory, change, dt)
    direct, weights = watch.read_out
    predicted = used @ direct + memory @ weights
    if some_failed:
        used = np.where(failed, _stand_in(watch, s._replace(predicted=predicted), time), used)
    difference = x - predicted
    calm = ~failed & seen & ~waiting
    inner = np.where(calm, difference, 0.0)
    usual = np.where(
        calm, lagbank.follow(s.usual, inner, np.full(inner.shape, dt / watch.thresholds.difference_time)), s.usual
    )
    taus = np.repeat(watch.time_constants, len(watch.sensors))
    traces = lagbank.advance(s.traces, np.tile(inner, len(watch.time_constants)), dt, taus) if taus.size else s.traces
    s = s._replace(memory=memory, predicted=predicted, used=used, usual=usual, traces=traces)
    s, stuck, unsure = _stuck(watch, s, x, calm, dt)
    over = np.abs(np.where(calm, difference, 0.0) / find_limits(watch, memory)) > 1.0
    far = np.asarray(over.any(axis=-1, keepdims=True))
    found, wrong = heat.check(watch, s.heat, speeds, used, memory, (time, dt), failed, far, _last_change(s, calm))
    s = s._replace(heat=found)
    s, lasting = _beyond(watch, s._replace(fast=_fast(watch, s, change)), over, calm)
    s = _blame(
        watch, s, np.where(calm | waiting, x, used), calm | waiting, dt, (stepped, stuck, unsure, lasting, wrong)
    )
    return _returns(watch, s, difference)


def _calmed(watch: Watch, change: FloatArray) -> FloatArray:
    """Return changes with speeds clipped, so that one reading of 65,535 1/min does not add much heat."""
    most = watch.thresholds.heat_factor * watch.top_speed
    calm = change.copy()
    calm[..., watch.speeds] = np.clip(calm[..., watch.speeds], -most, most)
    return calm


def _jumps(watch: Watch, s: WatchState, x: FloatArray, dt: float, able: BoolArray) -> tuple[WatchState, BoolArray]:
    """Find new jumps, discard spikes, and return the jumps that last."""
    limit = (watch.limits("jump") + _coarser(watch, s)) * max(1.0, dt / watch.pace)
    waiting = np.isfinite(s.jumped)
    with np.errstate(invalid="ignore"):
        before = np.where(waiting, s.predicted + s.usual, s.used)
        far = able & (np.abs(x - before) > limit)
    if not (far.any() or waiting.any()):
        return s, far
    fresh = far & ~waiting
    lasts = far & waiting & (s.time - s.jumped >= watch.thresholds.fault_duration)
    jumped = np.where(far, np.where(fresh, s.time, s.jumped), np.where(able, np.nan, s.jumped))
    return s._replace(jumped=jumped), lasts


def _missing(s: WatchState, seen: BoolArray) -> WatchState:
    lost = ~seen & (s.fault == GOOD)
    if not lost.any():
        return s
    return s._replace(
        fault=np.where(lost, MISSING, s.fault).astype(np.int8),
        since=np.where(lost, s.time, s.since),
        bridge=np.where(lost, s.usual, s.bridge),
        back=np.where(lost, np.nan, s.back),
        jumped=np.where(lost, np.nan, s.jumped),
    )


def _stuck(
    watch: Watch, s: WatchState, x: FloatArray, calm: BoolArray, dt: float
) -> tuple[WatchState, BoolArray, BoolArray]:
    """Find sensors that are constant although their prediction moves, or for too long while others change.

    Between two readings at most `fault_duration` counts: after a gap, a value may be the same by chance. A sensor with
    a resolution coarser than in the training may be constant for hours: its prediction must move by its error and more.
    One that has never changed may be as coarse as `Thresholds.unknown_step`: up to then (returned last) it is unsure.
    """
    gap = max(dt - watch.thresholds.fault_duration, 0.0)
    same = x == s.same
    s = s._replace(step=np.fmin(s.step, np.where(same, np.inf, np.abs(x - s.same))))
    if not same.any():
        nan = np.full(x.shape, np.nan)
        return s._replace(same=x, still=np.full(x.shape, s.time), then=s.predicted, moving=nan), same, same
    with np.errstate(invalid="ignore"):
        apart = np.abs(s.predicted - s.then)
    fresh = ~same
    s = s._replace(
        same=np.where(fresh, x, s.same),
        still=np.where(fresh, s.time, s.still + gap),
        then=np.where(fresh, s.predicted, s.then),
    )
    coarser, limits = _coarser(watch, s), watch.thresholds
    # a fine reading is constant for minutes, a coarse one until the error of its prediction matters
    most = np.maximum(watch.limits("moved"), watch.limits("frozen"))
    least = np.where(coarser > 0.0, most + coarser, watch.limits("moved"))
    able = calm | ((s.fault == UNEXPLAINED) & np.isfinite(x))
    moves = same & able & (apart > least)
    moving = np.where(moves, np.where(np.isfinite(s.moving), s.moving, s.time), np.nan)
    s = s._replace(moving=moving)
    lives = (calm & fresh).sum(axis=-1, keepdims=True) > 0  # not all are constant, as with a stopped logger
    long = same & calm & lives & (coarser == 0.0) & (s.time - s.still > watch.limits("still"))
    found = (moves & (s.time - moving >= limits.fault_duration) & (_last_change(s, calm) > moving)) | long
    unsure = np.isinf(s.step) & (apart <= most + limits.same_moved * limits.unknown_step)
    return s, found & ~unsure, found & unsure & calm


def _coarser(watch: Watch, s: WatchState) -> FloatArray:
    """Return by how much rounding may move readings more than in the training, (..., n_sensors) [degC].

    A sensor that has not changed yet is taken for as coarse as all others.
    """
    excess = watch.thresholds.same_moved * np.maximum(s.step - watch.limits("step"), 0.0)
    least = excess.min(axis=-1, keepdims=True)
    return np.where(np.isfinite(excess), excess, np.where(np.isfinite(least), least, 0.0))


def _last_change(s: WatchState, calm: BoolArray) -> FloatArray:
    """Return when a temperature last changed, (..., 1): if all repeat, the source has stopped, and no sensor failed."""
    return np.asarray(np.where(calm, s.still, -np.inf).max(axis=-1, keepdims=True, initial=-np.inf))


def _beyond(watch: Watch, s: WatchState, over: BoolArray, calm: BoolArray) -> tuple[WatchState, BoolArray]:
    """Find the runs, (...,), in which a difference has been over its limit for too long."""
    if not over.any():
        return s._replace(off=np.full(over.shape, np.nan)), np.zeros(over.shape[:-1], dtype=np.bool_)
    failed = np.nanmax(np.where(s.fault > MISSING, s.since, -np.inf), axis=-1, initial=-np.inf)
    recent = np.maximum(failed, s.fast)[..., None]
    beyond = over & (s.time - recent > watch.thresholds.fault_rest)
    off = np.where(beyond, np.where(np.isfinite(s.off), s.off, s.time), np.nan)
    with np.errstate(invalid="ignore"):
        lasting = (s.time - off >= watch.thresholds.fault_duration) & (_last_change(s, calm) > off)
        return s._replace(off=off), np.asarray(lasting.any(axis=-1))


def _blame(
    watch: Watch,
    s: WatchState,
    x: FloatArray,
    able: BoolArray,
    dt: float,
    found: tuple[BoolArray, ...],
) -> WatchState:
    """Exclude failed sensors: a swapped pair or a speed if it explains all residuals best; else single sensors."""
    stepped, stuck, unsure, lasting, speeds = found
    some = (stepped | stuck | unsure).any(axis=-1)
    counts = np.where(s.time - s.fast[..., None] > watch.thresholds.fault_rest, dt, 0.0)
    wrong = lasting | some | speeds.any(axis=-1)
    evidence, both = weigh_swaps(watch, s.evidence, x, s.memory, able, counts, find=bool(wrong.any()))
    s = s._replace(evidence=evidence)
    if not wrong.any():
        return s
    direct, states = watch.read_out
    one = one_fails(watch, np.where(able, x - x @ direct - s.memory @ states, 0.0), able)
    rest = np.minimum(one.rest, speeds_fail(watch, x, s.memory, able, s.heat))
    doubt = heat.in_doubt(watch, s.heat, s.time) & ~speeds.any(axis=-1)  # then no temperature is excluded
    pair = (both.worst <= 1.0) & (watch.thresholds.swap_preferred * both.rest < rest)
    swapped = (lasting | some) & ~doubt & pair
    certain = watch.thresholds.swap_certain * both.rest < rest
    for mine, fault in ((swapped & certain, SWAPPED), (swapped & ~certain, UNEXPLAINED)):
        s = _fail(watch, s, mine[..., None] & both.sensors, fault, np.zeros(x.shape))
    onset = np.where(s.fault == GOOD, x - s.then, s.used - s.predicted)
    for alone, fault, bridge in ((stepped, STEPPED, s.usual), (unsure, UNEXPLAINED, onset), (stuck, STUCK, onset)):
        may = (s.fault == GOOD) | ((s.fault == UNEXPLAINED) & (fault == STUCK))
        s = _fail(watch, s, alone & ~swapped[..., None] & may, fault, bridge)
    calm = able & np.isnan(s.jumped)
    one = one_fails(watch, np.where(calm, x - s.predicted, 0.0), calm, s.heat)
    # speeds explain the residuals better; the states of estimated speeds lag behind
    slow = speeds_fail(watch, x, s.memory, calm, s.heat) < watch.thresholds.speed_preferred * one.rest
    alone = ~swapped & ~some
    if (fails := speeds & (alone & slow & ~pair)[..., None]).any():
        supervised, memory = heat.fail(watch, s.heat, s.memory, fails)
        s = s._replace(heat=supervised, memory=memory, off=np.where(fails.any(axis=-1, keepdims=True), np.nan, s.off))
    # otherwise no single failure explains the residuals: the machine is unlike its training
    sure = lasting & alone & ~slow & ~doubt & (one.worst <= 1.0)
    return _fail(watch, s, sure[..., None] & one.sensors, UNEXPLAINED, np.zeros(x.shape))


def _fast(watch: Watch, s: WatchState, change: FloatArray) -> FloatArray:
    """Return the last time at which predictions were not validated: untrained speeds, or substitutes for speeds."""
    faster = (np.abs(change[..., watch.speeds]) > watch.thresholds.fast_factor * watch.top_speed).any(axis=-1)
    if watch.checks:
        faster |= (s.heat.fault != GOOD).any(axis=-1)
    return np.where(faster, s.time, s.fast)


def _returns(watch: Watch, s: WatchState, difference: FloatArray) -> WatchState:
    """Trust a missing or unexplained sensor again once it agrees with its prediction."""
    missing = s.fault == MISSING
    with np.errstate(invalid="ignore"):
        moved = np.abs(s.predicted) >= watch.thresholds.agree_moved * watch.limits("off")  # at rest, all agree
        may = missing | ((s.fault == UNEXPLAINED) & moved)
        fits = may & (np.abs(difference) <= watch.limits("off"))
        if not fits.any():
            return s._replace(back=np.full(fits.shape, np.nan))
        back = np.where(fits, np.where(np.isfinite(s.back), s.back, s.time), np.nan)
        wait = np.where(missing, watch.thresholds.return_time, watch.thresholds.fault_rest)
        again = fits & (s.time - back >= wait)
    return s._replace(
        fault=np.where(again, GOOD, s.fault).astype(np.int8),
        since=np.where(again, np.nan, s.since),
        usual=np.where(again, difference, s.usual),
        used=np.where(again, s.predicted + difference, s.used),
        same=np.where(again, np.nan, s.same),
        back=np.where(again, np.nan, back),
    )


def _fail(watch: Watch, s: WatchState, found: BoolArray, fault: int, bridge: FloatArray) -> WatchState:
    """Exclude sensors; the effect of their last readings on the predictions is removed."""
    if not found.any():
        return s
    n, lags = len(watch.sensors), len(watch.time_constants)
    traces = np.where(np.tile(found, lags), s.traces, 0.0) if lags else s.traces
    memory = s.memory.copy()
    memory[..., : n * lags] -= traces
    offset = np.where(np.isfinite(bridge), bridge, 0.0)
    return s._replace(
        memory=memory,
        traces=s.traces - traces,
        fault=np.where(found, fault, s.fault).astype(np.int8),
        since=np.where(found, s.time, s.since),
        bridge=np.where(found, offset, s.bridge),
        used=np.where(found, s.predicted + offset, s.used),
        jumped=np.where(found, np.nan, s.jumped),
        off=np.where(found.any(axis=-1, keepdims=True) & (fault in (UNEXPLAINED, SWAPPED)), np.nan, s.off),
    )
