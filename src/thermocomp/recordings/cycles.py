"""Thermal cycles: a run of the spindle and the stop that follows it."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.exceptions import RecordingError

#: shorter runs and stops of the spindle do not split a test [s]
SPLITS = 300.0
#: the spindle runs above this fraction of its top speed
_TURNING = 0.02
#: times closer than this are equal [s]
SAME = 1e-6


@dataclass(frozen=True)
class Cycle:
    """Rows ``start`` to ``stop - 1`` of a recording.

    Parameters
    ----------
    name : str
        Name, such as ``2 (2500 1/min)``.
    start, stop : int
        First row, and the row after the last.
    """

    name: str
    start: int
    stop: int

    def __len__(self) -> int:
        return self.stop - self.start


def find_cycles(
    time: FloatArray, speed: FloatArray, *, min_run: float = SPLITS, min_stop: float = SPLITS
) -> tuple[Cycle, ...]:
    """Split a test into thermal cycles by its spindle speed.

    A cycle starts with a start of the spindle after a stop, and ends with the next one. Rows before the first run
    belong to the first cycle.

    Parameters
    ----------
    time : ndarray of shape (n_rows,)
        [s]
    speed : ndarray of shape (n_rows,)
        [1/min]; NaN counts as the last known speed.
    min_run, min_stop : float
        Shorter runs and stops (a tool change, a lost reading) do not split the test [s].
    """
    filled = _fill(speed)
    top = filled.max(initial=0.0)
    if top == 0:
        return make_single_cycle(len(time))
    turning = filled > _TURNING * top
    turning = _drop_short(time, turning, state=False, shorter_than=min_stop)
    turning = _drop_short(time, turning, state=True, shorter_than=min_run)
    starts = [int(k) + 1 for k in np.flatnonzero(~turning[:-1] & turning[1:])]
    if turning[0] or not starts:
        starts.insert(0, 0)
    starts[0] = 0
    return _name(starts, filled, turning)


def split_at(time: FloatArray, starts: Sequence[float], speed: FloatArray | None = None) -> tuple[Cycle, ...]:
    """Split a test at times stated by the user.

    Parameters
    ----------
    time : ndarray of shape (n_rows,)
        [s]
    starts : sequence of float
        Start of every thermal cycle but the first, in increasing order [s].
    speed : ndarray of shape (n_rows,), optional
        Spindle speed, for the names of the cycles [1/min].

    Raises
    ------
    RecordingError
        A cycle would have no rows.
    """
    rows = [0, *np.searchsorted(time, np.asarray(starts) - SAME).tolist(), len(time)]
    for k, (a, b) in enumerate(pairwise(rows)):
        if b <= a:
            raise RecordingError(f"thermal cycle {k + 1} would have no rows: its start or the next one must be moved")
    filled = _fill(np.zeros(len(time)) if speed is None else speed)
    return _name(rows[:-1], filled, filled > _TURNING * filled.max())


def _fill(speed: FloatArray) -> FloatArray:
    """Return the magnitude of the last known speed; 0 before the first one."""
    known = np.isfinite(speed)
    last_known = np.maximum.accumulate(np.where(known, np.arange(len(speed)), 0))
    return np.abs(np.nan_to_num(speed[last_known]))


def _name(starts: Sequence[int], speed: FloatArray, turning: BoolArray) -> tuple[Cycle, ...]:
    """Return the cycles that begin at these rows, named by their number and the speeds of the running spindle."""
    cycles, top = [], speed.max()
    for number, (a, b) in enumerate(pairwise([*starts, len(speed)]), start=1):
        running = speed[a:b][turning[a:b]]
        speeds = np.unique(np.round(running)) if running.size else np.array([0.0])
        # a measured speed fluctuates: more than a few values are reported as a range
        steady = running.size and np.ptp(running) <= 0.05 * top
        text = f"{np.median(running):.0f}" if steady else f"{speeds.min():.0f}-{speeds.max():.0f}"
        cycles.append(Cycle(f"{number} ({text} 1/min)" if top else f"{number}", a, b))
    return tuple(cycles)


def make_single_cycle(n_rows: int) -> tuple[Cycle, ...]:
    """Return a single cycle over the whole test."""
    return (Cycle("whole test", 0, n_rows),)


def split_by_labels(labels: Sequence[object]) -> tuple[Cycle, ...]:
    """Split by a column of labels: each run of equal labels is a cycle."""
    text = [f"{v:g}" if isinstance(v, float) else str(v) for v in labels]
    starts = [0, *(k for k in range(1, len(text)) if text[k] != text[k - 1])]
    names = [text[k] for k in starts]
    seen: set[str] = set()
    for k, name in zip(starts, names, strict=True):
        if name in seen:
            raise RecordingError(f"cycle {name!r} appears again at row {k} after another cycle: rename one of them")
        seen.add(name)
    return tuple(Cycle(n, a, b) for n, a, b in zip(names, starts, [*starts[1:], len(text)], strict=True))


def _drop_short(time: FloatArray, turning: BoolArray, *, state: bool, shorter_than: float) -> BoolArray:
    """Return `turning` with short runs of `state` inverted; the first and the last run are kept."""
    edges = np.flatnonzero(np.diff(turning)) + 1
    bounds = [0, *edges.tolist(), len(turning)]
    out = turning.copy()
    for a, b in pairwise(bounds[1:-1]):
        if turning[a] == state and time[b] - time[a] < shorter_than:
            out[a:b] = not state
    return out
