"""Supervision of spindle speeds: the heat that a speed should cause is compared with an estimate from temperatures.

State in, state out, as in `thermocomp.runtime.watch`, of which it is a part: a speed that is missing or wrong is
replaced by the one that explains the temperatures. A missing speed is trusted again once it has agreed with them for as
long as it was missing, at most ten minutes; a wrong one after eight hours, as soon as the spindle turns.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thermocomp.core import lagbank
from thermocomp.core.heatcheck import find_limits
from thermocomp.core.watch import Watch

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int8]

#: faults of a speed, as in `thermocomp.runtime.watchstate.WORDS`
GOOD, MISSING, OFF = 0, 1, 4

#: heat of a missing speed beyond its lagged heat, per difference of the estimate from that: the lagged heat follows the
#: estimate with a third of its lag. Used at once, the estimate lagged behind the speed by ten minutes, which cost up to
#: 6 um after each start; a greater factor adds noise.
LEAD = 3.0

_EMPTY: FloatArray = np.empty(0)


class HeatState(NamedTuple):
    """State of the supervision between two readings; empty without checks."""

    heat: FloatArray = _EMPTY  #: (..., n_checks), of the speeds as read
    stored: FloatArray = _EMPTY  #: (..., n_checks), the same after a further lag
    estimate: FloatArray = _EMPTY  #: (..., n_checks), from the temperatures
    reach: FloatArray = _EMPTY  #: (..., n_checks), error of the estimate that substitutes of temperatures may cause
    states: FloatArray = _EMPTY  #: (..., n_states), speed states of the watch with the estimated speeds
    since: FloatArray = _EMPTY  #: (..., n_checks), start of a difference beyond its limit; nan: none [s]
    doubt: FloatArray = _EMPTY  #: (..., n_checks), start of one that cutting may explain; nan: none [s]
    gone: FloatArray = _EMPTY  #: (..., n_speeds), time at which a speed was first missing [s]
    back: FloatArray = _EMPTY  #: (..., n_speeds), time since which a failed speed agrees; nan: it does not [s]
    fault: IntArray = np.empty(0, dtype=np.int8)  #: (..., n_speeds), see `thermocomp.runtime.watchstate.WORDS`


def begin(watch: Watch, runs: tuple[int, ...] = ()) -> HeatState:
    """Return the state before the first reading."""
    n, speeds = (*runs, len(watch.checks)), (*runs, len(watch.speeds))
    return HeatState(
        heat=np.zeros(n),
        stored=np.zeros(n),
        estimate=np.zeros(n),
        reach=np.zeros(n),
        states=np.zeros((*runs, len(watch.states))),
        since=np.full(n, np.nan),
        doubt=np.full(n, np.nan),
        gone=np.full(speeds, np.nan),
        back=np.full(speeds, np.nan),
        fault=np.zeros(speeds, dtype=np.int8),
    )


def start(watch: Watch, state: HeatState, memory: FloatArray, speeds: FloatArray) -> HeatState:
    """Return the state at the start, at steady state: speeds (..., n_speeds) [1/min], memory of the watch."""
    heat = find_heat(watch, speeds)
    states = memory[..., memory.shape[-1] - len(watch.states) :]
    return state._replace(heat=heat, stored=heat, estimate=heat, states=states)


def find_heat(watch: Watch, speeds: FloatArray) -> FloatArray:
    """Return the relative heat of speeds (..., n_speeds) for each check, (..., n_checks)."""
    share, of = np.minimum(np.abs(speeds) / watch.top_speed, watch.thresholds.heat_factor), watch.heat_constants
    share = np.where(share > watch.thresholds.least_share, share, 0.0)
    return np.asarray(share[..., of.speeds] ** of.powers)


def find_speeds(watch: Watch, state: HeatState, read: FloatArray, lost: BoolArray) -> FloatArray:
    """Return the speeds that explain the temperatures, (..., n_speeds) [1/min]; as read, if not supervised.

    The estimate is that of a lagged heat. For a speed that is missing, the heat is that which lets its lagged heat
    follow the estimate; the lagged heat of a speed that is wrong is not that of the spindle.
    """
    found = read.copy()
    for k, check in enumerate(watch.deciding.tolist()):
        if check >= 0:
            c, heat = watch.checks[check], state.estimate[..., check]
            lagged = state.heat[..., check]
            leads = lost[..., k] & (state.fault[..., k] != OFF)
            caused = np.where(leads, np.maximum(lagged + LEAD * (heat - lagged), 0.0), heat)
            share = np.where(heat > c.unseen, caused, 0.0) ** (1.0 / c.power)
            found[..., k] = watch.top_speed * np.minimum(share, watch.thresholds.heat_factor)
    return found


def trust(watch: Watch, state: HeatState, read: FloatArray, lost: BoolArray) -> FloatArray:
    """Return speeds as read, (..., n_speeds), with substitutes for those that are missing or not trusted."""
    if not watch.checks or not (replaced := lost | (state.fault != GOOD)).any():
        return read
    return np.where(replaced, find_speeds(watch, state, read, lost), read)


def check(
    watch: Watch,
    state: HeatState,
    read: FloatArray,
    used: FloatArray,
    memory: FloatArray,
    times: tuple[float, float],
    failed: BoolArray,
    over: BoolArray,
    last_change: FloatArray,
) -> tuple[HeatState, BoolArray]:
    """Return the next state, and the speeds, (..., n_speeds), that have been wrong for too long.

    Parameters
    ----------
    read : ndarray of shape (..., n_speeds)
        Speeds as read; nan if missing [1/min].
    used : ndarray of shape (..., n_sensors)
        Temperatures minus their reference, with substitutes [degC].
    memory : ndarray of shape (..., n_memory)
        See `thermocomp.runtime.watchstate.WatchState`.
    times : tuple of float
        Time, and time since the last check [s].
    failed : ndarray of bool of shape (..., n_sensors)
        Temperatures with substitutes.
    over : ndarray of bool of shape (..., 1)
        Whether the difference of a temperature from its prediction is over its limit.
    last_change : ndarray of shape (..., 1)
        Time at which a temperature last changed: if all repeat, the source has stopped [s].
    """
    if not watch.checks:
        return state, np.zeros(read.shape, dtype=np.bool_)
    (time, dt), lost, lags = times, np.isnan(read), memory.shape[-1] - len(watch.states)
    new, of = lost & (state.fault == GOOD), watch.heat_constants.speeds
    far = np.isfinite(state.since)  # a speed that was wrong just before has spoilt the states of the models
    spoilt = np.stack([far[..., of == k].any(axis=-1) for k in range(len(watch.speeds))], axis=-1)
    fault = np.where(new, np.where(spoilt, OFF, MISSING), state.fault).astype(np.int8)
    state = state._replace(
        fault=fault, gone=np.where(new, time, state.gone), reach=failed.astype(np.float64) @ watch.heat_reach
    )
    state = advance(watch, state, read, used, memory[..., :lags], dt)
    state, wrong = find_lasting(watch, state, time, last_change)
    return trust_again(watch, state, time, lost, over), wrong


def fail(watch: Watch, state: HeatState, memory: FloatArray, wrong: BoolArray) -> tuple[HeatState, FloatArray]:
    """Exclude wrong speeds, (..., n_speeds); their states become those of the speeds that explain the temperatures."""
    changed, lags = memory.copy(), memory.shape[-1] - len(watch.states)
    changed[..., lags:] = np.where(wrong.take(watch.state_speeds, axis=-1), state.states, memory[..., lags:])
    return state._replace(fault=np.where(wrong, OFF, state.fault).astype(np.int8)), changed


def advance(
    watch: Watch, state: HeatState, read: FloatArray, used: FloatArray, lags: FloatArray, dt: float
) -> HeatState:
    """Advance heats, their estimates and the speed states; see `check`."""
    direct, lagged = watch.heat_read_out
    estimate = np.maximum(used @ direct + lags @ lagged, 0.0)  # a spindle does not cool
    lost = np.isnan(read)
    found = find_speeds(watch, state._replace(estimate=estimate), read, lost)
    caused = find_heat(watch, np.where(lost, found, read))
    heat = lagbank.advance(state.heat, caused, dt, watch.heat_constants.lags)
    stored = lagbank.follow(state.stored, heat, np.full(heat.shape, dt / watch.thresholds.heat_stored))
    if dt > watch.thresholds.return_time:  # an outage: what the spindle did is known from the temperatures alone
        heat = stored = estimate
    bank, lag = watch.bank, len(watch.bank.rates) - len(watch.bank.gain)
    share = np.minimum(np.abs(found.take(watch.state_speeds, axis=-1)) / bank.top, watch.thresholds.heat_factor)
    rates = bank.rates[lag:] + share * bank.gain
    states = lagbank.follow(state.states, share**bank.powers, dt * rates)
    return state._replace(heat=heat, stored=stored, estimate=estimate, states=states)


def limits(watch: Watch, state: HeatState) -> FloatArray:
    """Return the largest permitted difference of each heat from its estimate, (..., n_checks)."""
    difference = state.heat - state.estimate
    return find_limits(difference, state.heat, state.stored, watch.heat_constants, watch.thresholds) + state.reach


def residuals(watch: Watch, state: HeatState) -> FloatArray:
    """Return the difference of each heat from its estimate, (..., n_checks); 0 for a speed that is not trusted."""
    trusted = state.fault.take(watch.heat_constants.speeds, axis=-1) == GOOD
    return np.where(trusted, state.heat - state.estimate, 0.0)


def find_lasting(watch: Watch, state: HeatState, time: float, last_change: FloatArray) -> tuple[HeatState, BoolArray]:
    """Return the speeds, (..., n_speeds), whose heat has differed from its estimate for too long; see `check`."""
    apart = np.abs(residuals(watch, state))
    since = _begin(state.since, apart > limits(watch, state), time)
    doubt = _begin(state.doubt, apart > watch.heat_constants.off + state.reach, time)
    with np.errstate(invalid="ignore"):
        lasting = (time - since >= watch.thresholds.fault_duration) & (last_change > since)
    of = watch.heat_constants.speeds
    speeds = [lasting[..., of == k].any(axis=-1) for k in range(len(watch.speeds))]
    return state._replace(since=since, doubt=doubt), np.stack(speeds, axis=-1)


def _begin(since: FloatArray, holds: BoolArray, time: float) -> FloatArray:
    """Return the time since which a condition holds; nan where it does not."""
    return np.where(holds, np.where(np.isfinite(since), since, time), np.nan)


def in_doubt(watch: Watch, state: HeatState, time: float) -> BoolArray:
    """Return whether a speed has lately become doubtful, (...,): soon it will be clear whether it is wrong."""
    with np.errstate(invalid="ignore"):
        return np.asarray((time - state.doubt < watch.thresholds.speed_doubt).any(axis=-1))


def trust_again(watch: Watch, state: HeatState, time: float, lost: BoolArray, over: BoolArray) -> HeatState:
    """Trust a speed again that has agreed with the temperatures for long enough.

    A missing one for as long as it was missing; a wrong one until the models have forgotten it, with the spindle
    turning, since a speed that always reads 0 agrees all night, and no temperature too far from its prediction, since
    temperatures are not judged before.
    """
    off, of = watch.heat_constants.off, watch.heat_constants.speeds
    apart = np.abs(state.heat - state.estimate) > limits(watch, state)
    speeds = range(len(watch.speeds))
    agrees = np.stack([~apart[..., of == k].any(axis=-1) for k in speeds], axis=-1)
    turns = np.stack([(state.heat > off)[..., of == k].all(axis=-1) for k in speeds], axis=-1)
    missing, fits = state.fault == MISSING, (state.fault != GOOD) & ~lost & agrees
    back = _begin(state.back, fits, time)
    with np.errstate(invalid="ignore"):
        absent = np.minimum(back - state.gone, watch.thresholds.return_time)
        again = (
            fits
            & (missing | (turns & ~over))
            & (time - back >= np.where(missing, absent, watch.thresholds.speed_return))
        )
    return state._replace(fault=np.where(again, GOOD, state.fault).astype(np.int8), back=np.where(again, np.nan, back))
