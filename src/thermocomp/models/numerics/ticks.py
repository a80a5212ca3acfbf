"""Recordings resampled to ticks of an autoregressive model, by the same rule as `thermocomp.core.autoregressive`."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from thermocomp.core.arrays import BoolArray, FloatArray, IntArray
from thermocomp.core.exceptions import InputError
from thermocomp.core.ticker import EARLY

#: a displacement between two rows is interpolated if their distance is at most this many usual steps
NEAR = 1.5
#: a recording with more ticks than this is rejected: the interval is probably a typing error
MOST_TICKS = 50_000_000


@dataclass(frozen=True, eq=False)
class TickedRun:
    """One test resampled to ticks, uninterrupted and from a cold start.

    Parameters
    ----------
    rows : slice
        Rows of the test in the recording.
    count : ndarray of int of shape (n_rows,)
        Number of ticks up to each row; the first row is tick 0.
    phase : ndarray of shape (n_rows,)
        Time of each row since the last tick, as a share of the interval.
    since : ndarray of shape (n_rows, n_inputs)
        Mean of the inputs since the last tick; undefined where `phase` is 0.
    drive : ndarray of shape (n_ticks + 1, n_inputs)
        Mean of the inputs over the interval that ends at each tick; at tick 0, the first row.
    """

    rows: slice
    count: IntArray
    phase: FloatArray
    since: FloatArray
    drive: FloatArray

    @property
    def row_by_row(self) -> bool:
        """True if each row is exactly one tick after the previous row."""
        return self.since is self.drive


def check_steps(dt: ArrayLike, n_rows: int) -> FloatArray:
    """Return time steps [s] as an array; raise `InputError` if one is negative or not a number."""
    found = np.asarray(dt, dtype=np.float64)
    if found.shape != (n_rows,) or not (found >= 0).all():
        raise InputError(f"dt: expected {n_rows} non-negative time steps [s], the time since the previous row")
    return found


def median_step(dt: FloatArray) -> float:
    """Return the median of the time steps within tests [s]; 1 if there are none."""
    inside = dt[np.isfinite(dt) & (dt > 0)]
    return float(np.median(inside)) if inside.size else 1.0


def put_on_clock(inputs: FloatArray, dt: FloatArray, interval: float) -> list[TickedRun]:
    """Resample a recording to ticks.

    Parameters
    ----------
    inputs : ndarray of shape (n_rows, n_inputs)
    dt : ndarray of shape (n_rows,)
        Time since the previous row [s]; inf marks the start of a test, as is always assumed for the first row.
    interval : float
        [s]
    """
    starts = np.flatnonzero(np.isinf(dt))
    if not starts.size or starts[0] != 0:
        starts = np.append(0, starts)
    return [_run(inputs, dt, slice(i, j), interval) for i, j in pairwise([*starts.tolist(), len(dt)])]


def _run(inputs: FloatArray, dt: FloatArray, rows: slice, h: float) -> TickedRun:
    u, n = inputs[rows], rows.stop - rows.start
    if (dt[rows][1:] == h).all():
        return TickedRun(rows=rows, count=np.arange(n), phase=np.zeros(n), since=u, drive=u)
    step = dt[rows].copy()
    step[0] = 0.0
    time = np.cumsum(step)
    if not time[-1] / h < MOST_TICKS:
        raise InputError(
            f"interval {h:g} s: {time[-1] / h:.3g} intervals in one test of {time[-1]:.3g} s, at most {MOST_TICKS:g} "
            "are supported; use a longer interval"
        )
    share = time / h
    count = np.floor(share + EARLY).astype(np.intp)
    phase = share - count
    phase[phase <= EARLY] = 0.0
    if not phase.any() and (np.diff(count) == 1).all():  # one row per tick
        return TickedRun(rows=rows, count=count, phase=phase, since=u, drive=u)
    total = np.cumsum(step[:, None] * u, axis=0)
    at = np.searchsorted(count, np.arange(count[-1] + 1))  # first row at or after each tick
    late = (time[at] - np.arange(count[-1] + 1) * h)[:, None]
    until = total[at] - late * u[at]
    until[0] = 0.0
    drive = np.vstack([u[:1], np.diff(until, axis=0) / h])
    since = (total - until[count]) / np.where(phase > 0, phase * h, np.inf)[:, None]
    return TickedRun(rows=rows, count=count, phase=phase, since=since, drive=drive)


def displacements(
    runs: Sequence[TickedRun], y: FloatArray, dt: FloatArray, known: BoolArray, h: float
) -> list[FloatArray]:
    """Return the displacement at each tick, interpolated between adjacent rows; nan where unknown.

    Parameters
    ----------
    y, dt : ndarray of shape (n_rows,)
    known : ndarray of bool of shape (n_rows,)
        Rows whose displacement may be used.
    h : float
        Interval [s].

    Returns
    -------
    list of ndarray of shape (n_ticks + 1,)
        One array per test.
    """
    near = NEAR * median_step(dt)
    found = []
    for run in runs:
        inside, may = y[run.rows], known[run.rows]
        if run.row_by_row:
            found.append(np.where(may, inside, np.nan))
            continue
        after = np.searchsorted(run.count, np.arange(len(run.drive)))
        before = np.maximum(after - 1, 0)
        step = dt[run.rows].copy()
        step[0] = 0.0
        late = np.cumsum(step)[after] - np.arange(len(run.drive)) * h  # of the row after each tick
        late = np.where(late <= EARLY * h, 0.0, late)
        part = late / np.maximum(step[after], np.finfo(np.float64).tiny)
        fine = may[after] & ((late == 0) | (may[before] & (step[after] <= near)))
        value = np.where(late == 0, inside[after], inside[after] + part * (inside[before] - inside[after]))
        found.append(np.where(fine, value, np.nan))
    return found


def interpolate_at_rows(
    run: TickedRun, ticked: FloatArray, ahead: Callable[[IntArray, FloatArray], FloatArray]
) -> FloatArray:
    """Return the deviation at the rows of a test from the deviation at its ticks.

    Parameters
    ----------
    ticked : ndarray of shape (n_ticks + 1,)

    Returns
    -------
    ndarray of shape (n_rows,)
    """
    if run.row_by_row:
        return ticked
    last = ticked[run.count]
    between = np.flatnonzero(run.phase)
    if between.size:
        coming = ahead(run.count[between], run.since[between])
        last[between] += run.phase[between] * (coming - last[between])
    return last


def regressors(own: FloatArray, drive: FloatArray, ticks: IntArray, k: int, m: int, now: FloatArray) -> FloatArray:
    """Return [dz(t-h) .. dz(t-kh), inputs(t), inputs(t-h) .. inputs(t-mh)], zero before the start (cold).

    Parameters
    ----------
    own : ndarray of shape (n_ticks,)
    drive : ndarray of shape (n_ticks, n_inputs)
    ticks : ndarray of int of shape (n_wanted,)
        Ticks t.
    now : ndarray of shape (n_wanted, n_inputs)
        Inputs at t.

    Returns
    -------
    ndarray of shape (n_wanted, k + (m + 1) n_inputs), Fortran order
    """
    n = drive.shape[1]
    table = np.zeros((len(ticks), k + (m + 1) * n), order="F")
    for i in range(1, k + 1):
        past = ticks >= i
        table[past, i - 1] = own[ticks[past] - i]
    table[:, k : k + n] = now
    for i in range(1, m + 1):
        past = ticks >= i
        table[past, k + i * n : k + (i + 1) * n] = drive[ticks[past] - i]
    return table
