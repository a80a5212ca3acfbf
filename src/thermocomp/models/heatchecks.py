"""Training of the supervision of a spindle speed: its heat is estimated from the temperatures."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.ndimage import minimum_filter1d

from thermocomp.core import lagbank
from thermocomp.core.arrays import BoolArray, FloatArray, IntArray
from thermocomp.core.heatcheck import FaultOfSpeed, HeatCheck, HeatConstants, SpeedFault, find_limits
from thermocomp.core.thresholds import THRESHOLDS
from thermocomp.models.numerics.structures import fit_each, share_out
from thermocomp.models.pacedfeatures import PacedFeatures
from thermocomp.recordings.samples import usual_step

#: exponents of heat against speed: a small one, which shows whether the spindle turns, and others, of which one is kept
TURNS, POWERS = 0.1, (1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0)
#: time constant of the compared heats: temperatures near the spindle respond within ten minutes [s]
LAG = 600.0
#: noise assumed for the temperatures [degC], and number of regressions averaged, as for the temperatures of the watch
NOISE, STRUCTURES = 0.2, 100
#: a check with a larger limit finds nothing
BLIND = 0.9
#: number of instants at which faults begin, and maximum time for which each is followed [s]
INSTANTS, FOLLOWED = 200, 7200.0
#: a speed wrong by less than this fraction of the top speed does not count, nor one wrong for less than this time [s]
WRONG, LEAST_WRONG = 0.25, 1200.0
#: a speed stuck beyond the trained ones, as a multiple of the top speed
BEYOND = 2.0


def find_checks(
    of: PacedFeatures,
    change: FloatArray,
    step: FloatArray,
    folds: IntArray,
    parts: IntArray,
    judged: BoolArray,
    wider: float,
) -> tuple[tuple[HeatCheck, ...], tuple[SpeedFault, ...]]:
    """Return the checks of all speeds, and how soon they find a wrong speed.

    Parameters
    ----------
    of : PacedFeatures
        Features of the watch.
    change : ndarray of shape (n_rows, n_inputs)
        Inputs minus their reference.
    step : ndarray of shape (n_rows,)
        Time since the previous row [s], inf at the start of a test.
    folds : ndarray of int of shape (n_rows,)
        Thermal cycle of each row; -1: unused.
    parts : ndarray of int of shape (n_rows,)
        See `thermocomp.models.averaged.AveragedDynamic.lay_out`.
    judged : ndarray of bool of shape (n_rows,)
        Rows that count for the limits.
    wider : float
        Ratio of a limit to the largest difference.
    """
    speeds = list(dict.fromkeys(state[0] for state in of.states))
    share = np.abs(change[:, speeds]) / of.top_speed
    share = np.where(share > THRESHOLDS.least_share, share, 0.0)
    powers = np.tile((TURNS, *POWERS), len(speeds))
    heats = lagbank.run(np.repeat(share, 1 + len(POWERS), axis=1) ** powers, step, np.full(len(powers), LAG))
    weights, estimates = _estimate(replace(of, states=()), change, heats, step, folds, parts)
    error = np.where(judged[:, None], heats - estimates, np.nan)
    rms, largest = np.sqrt(np.nanmean(error**2, axis=0)), _find_lasting(error, step)
    relative = rms / np.maximum(heats[judged].std(axis=0), 1e-9)
    checks, faults = list[HeatCheck](), list[SpeedFault]()
    for k, speed in enumerate(speeds):
        if not share[judged, k].any():  # it never turned: nothing is known about its heat
            continue
        first = k * (1 + len(POWERS))
        best = first + 1 + int(np.argmin(relative[first + 1 : first + 1 + len(POWERS)]))
        kept = [c for c in (first, best) if wider * largest[c] < BLIND]
        mine = [
            HeatCheck(
                input=speed,
                power=float(powers[c]),
                lag=LAG,
                weights=tuple(float(f"{w:.6g}") for w in weights[:, c]),
                off=float(f"{max(wider * largest[c], 1e-3):.4g}"),
                unseen=float(f"{max(rms[c], 1e-3):.4g}"),
            )
            for c in kept
        ]
        checks += mine
        faults += _find_faults(mine, share[:, k], heats[:, kept], estimates[:, kept], step, np.where(judged, folds, -1))
    return tuple(checks), tuple(faults)


def _estimate(
    of: PacedFeatures, change: FloatArray, heats: FloatArray, step: FloatArray, folds: IntArray, parts: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Return the weights of the temperatures, (n_features, n_heats), and left-out estimates, (n_rows, n_heats)."""
    moments, structures = of.moments(change, heats, step, parts, NOISE), of.draw(STRUCTURES, 0)
    shares, every = share_out(moments, structures)[0], np.unique(parts[parts >= 0])

    def fit(kept: IntArray) -> FloatArray:
        return np.asarray((shares[:, None] * fit_each(moments, structures, kept)).sum(axis=0))

    others = [fit(np.setdiff1d(every, parts[folds == k])) for k in range(int(folds.max()) + 1)]
    estimates = np.full(heats.shape, np.nan)
    for own, table in of.tables(change, step):
        for k, weights in enumerate(others):
            mine = folds[own] == k
            estimates[own][mine] = table[mine] @ weights
    return fit(every), estimates


def _find_lasting(error: FloatArray, step: FloatArray) -> FloatArray:
    """Return the largest error of each heat that lasts as long as a fault must, (n_heats,); nan counts as none."""
    usual = usual_step(step)
    count = 1 + int(THRESHOLDS.fault_duration // usual) if np.isfinite(usual) else 1
    return np.asarray(minimum_filter1d(np.nan_to_num(np.abs(error)), count, axis=0).max(axis=0))


def _find_faults(
    checks: list[HeatCheck],
    share: FloatArray,
    heats: FloatArray,
    estimates: FloatArray,
    step: FloatArray,
    folds: IntArray,
) -> Iterator[SpeedFault]:
    """Yield how soon the checks of a speed find its faults; arguments as left out, (n_rows,) or (n_rows, n_checks)."""
    if not checks:
        return
    time = np.cumsum(np.where(np.isfinite(step), step, 0.0))
    stored = lagbank.run(heats, step, np.full(len(checks), THRESHOLDS.heat_stored))
    new = np.flatnonzero((np.diff(folds, prepend=-2) != 0) | ~np.isfinite(step))
    ends = np.append(new[1:], len(folds))
    rows = np.flatnonzero(folds >= 0)
    instants = rows[np.linspace(0, len(rows) - 1, INSTANTS).astype(np.intp)]
    kinds: tuple[FaultOfSpeed, ...] = ("zero", "stuck", "halved", "beyond")
    begun, wanted = np.stack([heats[instants], stored[instants]]), time[instants] + FOLLOWED
    last = np.minimum(ends[np.searchsorted(new, instants, side="right") - 1], np.searchsorted(time, wanted))
    followed = instants + np.arange(int((last - instants).max()))[:, None]  # (n_steps, n_instants)
    known = followed < last
    followed = np.where(known, followed, instants)
    passed = np.where(known, np.diff(time[followed], axis=0, prepend=time[instants][None]), 0.0)
    right, expected = share[followed], np.where(known[..., None], estimates[followed], np.nan)
    for kind in kinds:
        wrong = {"zero": 0.0 * right, "stuck": np.broadcast_to(share[instants], right.shape), "halved": right / 2}
        read = wrong.get(kind, np.full_like(right, BEYOND))
        counts = np.cumsum(np.where(np.abs(read - right) >= WRONG, passed, 0.0), axis=0)
        found = [_find_fault(c, read, passed, begun[..., k], expected[..., k]) for k, c in enumerate(checks)]
        after = np.append(counts, np.full_like(counts[:1], np.inf), axis=0)  # a row more: not found
        delays = np.min([np.take_along_axis(after, f[None], axis=0)[0] for f in found], axis=0)
        delays = delays[counts[-1] >= LEAST_WRONG].tolist()
        if delays:
            seen = [d for d in delays if np.isfinite(d)]
            late = float(np.quantile(seen, 0.95)) / 60 if seen else 0.0
            yield SpeedFault(checks[0].input, kind, round(len(seen) / len(delays), 3), round(late, 1))


def _find_fault(
    check: HeatCheck, read: FloatArray, passed: FloatArray, begun: FloatArray, estimate: FloatArray
) -> IntArray:
    """Return the row in which a check finds a wrong speed, read since the first row; n_rows if it does not.

    Parameters
    ----------
    read, passed, estimate : ndarray of shape (n_rows, n_instants)
        Wrong speed, time since the previous row [s] and estimated heat after each instant.
    begun : ndarray of shape (2, n_instants)
        Heat and stored heat before the fault.

    Returns
    -------
    ndarray of int of shape (n_instants,)
    """
    with np.errstate(divide="ignore"):  # no time passes after the last row
        paces = [tau / passed for tau in (check.lag, THRESHOLDS.heat_stored)]
    ones = np.ones(len(read))
    heat = lagbank.run(read**check.power, ones, paces[0], begun[0])
    stored = lagbank.run(heat, ones, paces[1], begun[1])
    difference, time, of = heat - estimate, np.cumsum(passed, axis=0), HeatConstants.of([check], [check.input])
    far = np.abs(difference) > find_limits(difference, heat, stored, of, THRESHOLDS)
    since = np.maximum.accumulate(np.where(far, 0.0, time), axis=0)  # last instant at which it was within the limit
    lasting = far & (time - since >= THRESHOLDS.fault_duration)
    return np.where(lasting.any(axis=0), lasting.argmax(axis=0), len(read))
