"""Training of a temperature watch: each sensor is predicted from the others, as `averaged` predicts a displacement."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import median_filter

from thermocomp.core.arrays import BoolArray, FloatArray, IntArray
from thermocomp.core.bounds import GAP
from thermocomp.core.thresholds import THRESHOLDS
from thermocomp.core.watch import Watch, Watched
from thermocomp.models.averaged import AveragedDynamic
from thermocomp.models.heatchecks import find_checks
from thermocomp.models.numerics.folds import number_folds
from thermocomp.models.numerics.structures import fit_each, share_out
from thermocomp.models.pacedfeatures import PacedFeatures
from thermocomp.recordings.samples import Samples, usual_step

#: noise assumed for the predicting temperatures, as in `averaged` [degC]
NOISE = 0.2
#: number of regressions averaged for a prediction
STRUCTURES = 100
#: limits are this many times the largest value observed in sound data, and larger with few cycles
SAFETY = 1.5
#: the same factor for heats, beside which more heat than that of the speed is allowed
HEATED = 1.3
#: the same factor for jumps: at a speed outside the training data, temperatures may rise faster
FASTEST = 2.0
#: lower bounds of the limits: deviation, change within a minute, movement while stuck, in addition to resolution [degC]
OFF, JUMP, MOVED = 1.0, 0.8, 0.5
#: a reading constant for this time is stuck, unless one in the recording was constant for this fraction of it [s; -]
STILL, STILL_PART = 1200.0, 1 / 3
#: minimum time over which a jump is measured [s]
PACE = 60.0


def find_watch(samples: Samples, learn: BoolArray) -> Watch | None:
    """Return the watch over the temperatures of a recording.

    Parameters
    ----------
    learn : ndarray of bool of shape (n_rows,)
        Training rows.

    Returns
    -------
    Watch or None
        None with fewer than two thermal cycles or two temperatures: the error in an unseen cycle is then unknown.
    """
    rows = samples.valid & np.isin(samples.test, samples.test[learn & samples.valid])
    samples = samples.take(rows)
    learn = learn[rows] & (samples.cycle >= 0)
    heat = [k for k, c in enumerate(samples.inputs) if c.quantity == "temperature"]
    speeds = [k for k, c in enumerate(samples.inputs) if c.quantity == "spindle_speed"]
    if len(heat) < 2 or not learn.any():
        return None
    samples = samples.only([samples.inputs[k].name for k in heat + speeds])
    heat = [k for k, c in enumerate(samples.inputs) if c.quantity == "temperature"]
    speeds = [k for k, c in enumerate(samples.inputs) if c.quantity == "spindle_speed"]
    change, step = samples.change(), samples.dt()
    folds, _ = number_folds(np.where(learn, samples.cycle, -1), len(samples))
    count = int(folds.max()) + 1
    if count < 2:
        return None
    of, parts, _ = AveragedDynamic().lay_out(change, step, folds, speeds)
    weights = _weights(of, change, step, heat, parts, folds)
    predicted = np.full((len(samples), len(heat)), np.nan)
    known = _covered(np.abs(change[:, speeds]).max(axis=1, initial=0.0), folds, samples.test)
    judged = np.where(known, folds, -1)
    for own, table in of.tables(change, step):
        mine = judged[own]
        for k in range(count):
            predicted[own][mine == k] = table[mine == k] @ weights[1 + k]
    pace = max(PACE, usual_step(step)) if np.isfinite(usual_step(step)) else PACE
    inputs = samples.model_inputs(range(len(samples.inputs)), learn)
    wider = SAFETY * (1.0 + 1.0 / count)
    sensors = []
    for place, k in enumerate(heat):
        limits = _limits(samples, change[:, k], predicted[:, place], folds, k, pace, wider)
        _, moved, _ = _same(samples.values[:, heat], predicted[:, place], samples.time, folds)
        worst = float(np.nanmax(np.abs(change[:, k] - predicted[:, place]), initial=0.0))
        limits["step"] = _resolution(samples.values[:, k])
        limits["frozen"] = max(THRESHOLDS.repeat_moved * limits["step"], worst, SAFETY * moved)
        numbers = {name: float(f"{v:.4g}") for name, v in limits.items()}
        sensors.append(Watched(k, tuple(float(f"{w:.6g}") for w in weights[0, :, place]), **numbers))
    wider *= HEATED / SAFETY
    checks, faults = find_checks(of, change, step, folds, parts, known & (folds >= 0), wider)
    return Watch(
        inputs=inputs,
        zeroing=samples.zeroing,
        time_constants=of.lags,
        top_speed=of.top_speed,
        states=of.states,
        sensors=tuple(sensors),
        pace=pace,
        checks=checks,
        speed_faults=faults,
        repeats=float(f"{_same(samples.values[:, heat], np.zeros(len(samples)), samples.time, folds)[2]:.4g}"),
    )


def _weights(
    of: PacedFeatures, change: FloatArray, step: FloatArray, heat: Sequence[int], parts: IntArray, folds: IntArray
) -> FloatArray:
    """Return each temperature's predictor, with all cycles and without each, (1 + n_cycles, n_features, n_heat)."""
    moments = of.moments(change, change[:, list(heat)], step, parts, NOISE)
    every = np.unique(parts[parts >= 0])
    learned = (every, *(np.setdiff1d(every, parts[folds == k]) for k in range(int(folds.max()) + 1)))
    weights = np.zeros((len(learned), len(of), len(heat)))
    for k in range(len(heat)):
        structures = of.draw(STRUCTURES, 0, [j for j in range(len(heat)) if j != k])
        own = replace(moments, cross=moments.cross[:, :, [k]], power=moments.power[:, [k]])
        shares, _ = share_out(own, structures)
        for row, kept in enumerate(learned):
            weights[row, :, k] = (shares * fit_each(own, structures, kept)[..., 0]).sum(axis=0)
    return weights


def _limits(
    samples: Samples,
    change: FloatArray,
    predicted: FloatArray,
    folds: IntArray,
    column: int,
    pace: float,
    wider: float,
) -> dict[str, float]:
    """Return the limits of `Watched` for the temperature in a column."""
    off, values = change - predicted, samples.values[:, column]
    still, moved, _ = _same(values, predicted, samples.time, folds)
    return {
        "off": max(OFF, wider * float(np.nanmax(np.abs(off), initial=0.0))),
        "jump": max(JUMP, FASTEST * _jump(change, samples.time, folds, pace)),
        "moved": max(MOVED + _resolution(values), SAFETY * moved),
        # a sensor with coarse resolution may be constant for days on a machine at rest: the duration is no criterion
        "still": STILL if still <= STILL_PART * STILL else GAP,
        "unseen": float(np.sqrt(np.nanmean(off**2))) if np.isfinite(off).any() else 0.0,
    }


def _covered(speed: FloatArray, folds: IntArray, test: IntArray) -> BoolArray:
    """Return a mask of the rows up to which a test does not exceed the speeds of the other cycles."""
    found = np.ones(len(speed), dtype=np.bool_)
    for k in range(int(folds.max()) + 1):
        others = (folds >= 0) & (folds != k)
        faster = (folds == k) & (speed > THRESHOLDS.fast_factor * speed[others].max(initial=0.0))
        for t in np.unique(test[faster]):
            own = (folds == k) & (test == t)
            own[: np.flatnonzero(faster & own)[0]] = False
            found &= ~own
    return found


def _jump(values: FloatArray, time: FloatArray, folds: IntArray, pace: float) -> float:
    """Return the largest lasting change within `pace`, over the training rows."""
    usual = max(float(np.median(np.diff(time)[np.diff(time) > 0])), 1e-9)
    lasting = median_filter(values, size=1 + 2 * round(THRESHOLDS.fault_duration / 2 / usual), mode="nearest")
    largest = 0.0
    for shift in range(1, 1 + max(1, round(pace / usual))):
        gap = time[shift:] - time[:-shift]
        near = (gap > 0) & (gap <= 1.01 * pace) & (folds[shift:] >= 0) & (folds[:-shift] >= 0)
        largest = max(largest, float(np.abs(lasting[shift:] - lasting[:-shift])[near].max(initial=0.0)))
    return largest


def _resolution(values: FloatArray) -> float:
    """Return the typical smallest step of a sensor: its resolution, or its noise if this is larger."""
    steps = np.abs(np.diff(values))
    return float(np.quantile(steps[steps > 0], 0.1)) if steps.any() else 0.0


def _same(values: FloatArray, predicted: FloatArray, time: FloatArray, folds: IntArray) -> tuple[float, float, float]:
    """Return the longest repetition of the readings of a sensor, or of several in columns.

    Returns
    -------
    duration : float
        [s]
    moved : float
        Largest change of the prediction during a repetition [degC].
    intervals : float
        Longest repetition, in mean intervals between changes.
    """
    differ = np.diff(values.reshape(len(values), -1), axis=0).any(axis=1)
    new = np.append(True, differ | (np.diff(folds) != 0) | (np.diff(time) <= 0))
    run = np.cumsum(new) - 1
    first = np.flatnonzero(new)
    known = (folds >= 0) & np.isfinite(predicted)
    longest = float((time - time[first[run]])[known].max(initial=0.0))
    moved = float(np.abs(predicted - predicted[first[run]])[known].max(initial=0.0))
    rows = np.bincount(run[folds >= 0])
    rows = rows[rows > 0]
    return longest, moved, float(rows.max() / rows.mean())
