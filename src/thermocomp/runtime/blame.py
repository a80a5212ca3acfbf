"""Isolation of sensor faults: the failure of one sensor, or the swap of two, that best explains the residuals."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thermocomp.core import lagbank
from thermocomp.core.watch import Watch
from thermocomp.runtime.heat import HeatState, residuals

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


class Blamed(NamedTuple):
    """The most likely failure of one kind, per run."""

    sensors: BoolArray  #: (..., n_sensors), sensors that would have failed
    rest: FloatArray  #: (...,), sum of squared residuals, each relative to its error on unseen cycles; inf: no failure
    worst: FloatArray  #: (...,), largest residual, relative to its limit


def find_limits(watch: Watch, memory: FloatArray) -> FloatArray:
    """Return the largest permitted differences, (..., n_sensors): cutting may heat the spindle more than its speed.

    Parameters
    ----------
    memory : ndarray of shape (..., n_memory)
        See `thermocomp.runtime.watchstate.WatchState`.
    """
    lags = memory.shape[-1] - len(watch.states)
    caused = np.abs(memory[..., lags:] @ watch.read_out[1][lags:])  # by the speed
    return np.asarray(watch.limits("off") + watch.thresholds.more_heat * caused)


def one_fails(watch: Watch, difference: FloatArray, able: BoolArray, heat: HeatState | None = None) -> Blamed:
    """Return the sensor whose failure, immediate or after the lags, leaves the smallest residuals.

    Parameters
    ----------
    difference : ndarray of shape (..., n_sensors)
        Difference of reading and prediction; 0 if there is none [degC].
    able : ndarray of bool of shape (..., n_sensors)
        Sensors that may have failed.
    heat : HeatState, optional
        Its residuals must be explained, too.
    """
    weights, most = watch.limits("unseen"), watch.limits("off")
    if heat is not None and watch.checks:
        weights = np.append(weights, watch.heat_constants.unseen)
        most = np.append(most, watch.heat_constants.off)
        difference = np.concatenate([difference, residuals(watch, heat)], axis=-1)
    scaled = difference / weights
    found = _nobody(able)
    for shape in watch.signatures[:, : len(weights)] / weights[:, None]:  # (n, n_faulty)
        amount = np.einsum("...i,ij->...j", scaled, shape) / (shape**2).sum(axis=0)
        left = np.swapaxes(scaled[..., :, None] - shape * amount[..., None, :], -1, -2) * weights
        rest = np.where(able, ((left / weights) ** 2).sum(axis=-1), np.inf)
        one = _least(rest, np.abs(left / most).max(axis=-1), np.eye(able.shape[-1], dtype=np.bool_))
        better = one.rest < found.rest
        found = Blamed(
            np.where(better[..., None], one.sensors, found.sensors),
            np.where(better, one.rest, found.rest),
            np.where(better, one.worst, found.worst),
        )
    return found


def speeds_fail(watch: Watch, x: FloatArray, memory: FloatArray, able: BoolArray, heat: HeatState) -> FloatArray:
    """Return the sum of squared residuals if the supervised speeds are wrong, (...,): they have no free parameter.

    Parameters are those of `weigh_swaps`.
    """
    if not watch.checks:
        return np.full(able.shape[:-1], np.inf)
    direct, weights = watch.read_out
    lags = memory.shape[-1] - len(watch.states)
    predicted = x @ direct + memory[..., :lags] @ weights[:lags] + heat.states @ weights[lags:]
    return np.asarray((np.where(able, (x - predicted) / watch.limits("unseen"), 0.0) ** 2).sum(axis=-1))


def weigh_swaps(
    watch: Watch,
    evidence: FloatArray,
    x: FloatArray,
    memory: FloatArray,
    able: BoolArray,
    dt: FloatArray,
    *,
    find: bool = True,
) -> tuple[FloatArray, Blamed]:
    """Assess whether two sensors have been swapped since the start.

    The zero of each sensor was read at its own terminals, so the changes and their lags are exchanged. For two sensors
    with different responses, sound data soon exclude a swap; a later failure can then only be that of a single sensor.

    Parameters
    ----------
    evidence : ndarray of shape (..., n_pairs)
        Low-passed evidence for each pair; -inf once excluded.
    x : ndarray of shape (..., n_sensors)
        Readings or their substitutes, minus the reference [degC].
    memory : ndarray of shape (..., n_memory)
        See `thermocomp.runtime.watchstate.WatchState`.
    able : ndarray of bool of shape (..., n_sensors)
        Sensors whose readings and predictions are reliable.
    dt : ndarray of shape (..., 1)
        Time since `evidence` was computed; 0 where predictions are not reliable [s].

    Returns
    -------
    evidence : ndarray of shape (..., n_pairs)
    """
    n, (direct, states) = len(watch.sensors), watch.read_out
    first, second = watch.pairs
    mine = np.isfinite(evidence)
    if not (mine.any() and (mine := mine & able[..., first] & able[..., second]).any()):
        return evidence, _nobody(able)
    # most pairs are soon excluded: compute only the remaining ones, with one row for each pair of each run
    *run, pair = np.nonzero(mine)
    one, other, of = first[pair], second[pair], tuple(run)
    own = np.eye(n) - direct
    difference = x @ own - memory @ states
    left = difference[of] + (x[*of, other] - x[*of, one])[:, None] * (own[one] - own[other])
    for k in range(0, n * len(watch.time_constants), n):
        weights = states[k : k + n]
        left -= (memory[*of, k + other] - memory[*of, k + one])[:, None] * (weights[one] - weights[other])
    left = np.where(able[of], left, 0.0)
    unseen = watch.limits("unseen")
    rest = ((left / unseen) ** 2).sum(axis=-1)
    better = (np.where(able, difference / unseen, 0.0) ** 2).sum(axis=-1)[of] - rest
    step = np.broadcast_to(dt / watch.thresholds.difference_time, mine.shape)[mine]
    after = lagbank.follow(evidence[mine], better, step)
    evidence = evidence.copy()
    evidence[mine] = np.where(after > -watch.thresholds.swap_evidence * n, after, -np.inf)
    if not find:
        return evidence, _nobody(able)
    rests, worst = np.full(mine.shape, np.inf), np.full(mine.shape, np.inf)
    rests[mine], worst[mine] = rest, np.abs(left / watch.limits("off")).max(axis=-1)
    each = np.eye(n, dtype=np.bool_)
    return evidence, _least(rests, worst, each[first] | each[second])


def _nobody(able: BoolArray) -> Blamed:
    nothing = np.full(able.shape[:-1], np.inf)
    return Blamed(np.zeros(able.shape, dtype=np.bool_), nothing, nothing)


def _least(rest: FloatArray, worst: FloatArray, sensors: BoolArray) -> Blamed:
    """Return the failure with the least residual; shapes: `sensors` (n_failures, n_sensors), rest (..., n_failures)."""
    place = rest.argmin(axis=-1)[..., None]
    return Blamed(
        sensors[place[..., 0]],
        np.take_along_axis(rest, place, axis=-1)[..., 0],
        np.take_along_axis(worst, place, axis=-1)[..., 0],
    )
