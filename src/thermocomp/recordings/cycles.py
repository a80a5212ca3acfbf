"""Thermal cycles: a run of the spindle and the stop that follows it."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.exceptions import RecordingError

#: shorter runs and stops of the spindle do not split a test [s]
SPLITS = 300.0


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
    known = np.isfinite(speed)
    if not known.any():
        return make_single_cycle(len(time))
    last_known = np.maximum.accumulate(np.where(known, np.arange(len(speed)), 0))
    filled = np.abs(np.nan_to_num(speed[last_known]))
    top = filled.max()
    if top == 0:
        return make_single_cycle(len(time))
    turning = filled > 0.02 * top
    turning = _drop_short(time, turning, state=False, shorter_than=min_stop)
    turning = _drop_short(time, turning, state=True, shorter_than=min_run)
    starts = [int(k) + 1 for k in np.flatnonzero(~turning[:-1] & turning[1:])]
    if turning[0] or not starts:
        starts.insert(0, 0)
    starts[0] = 0
    stops = [*starts[1:], len(time)]
    cycles = []
    for number, (a, b) in enumerate(zip(starts, stops, strict=True), start=1):
        running = filled[a:b][turning[a:b]]
        speeds = np.unique(np.round(running)) if running.size else np.array([0.0])
        # a measured speed fluctuates: more than a few values are reported as a range
        steady = running.size and np.ptp(running) <= 0.05 * top
        text = f"{np.median(running):.0f}" if steady else f"{speeds.min():.0f}-{speeds.max():.0f}"
        cycles.append(Cycle(f"{number} ({text} 1/min)", a, b))
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
