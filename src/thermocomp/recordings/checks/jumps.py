"""Steps of a single channel without a common cause in the machine, and two channels that are exchanged."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from thermocomp.core.arrays import BoolArray, FloatArray, IntArray
from thermocomp.core.messages import Message
from thermocomp.recordings.checks.findings import Finding, Signal, at_row, cut_out

#: smallest step that is reported, by quantity [degC, um, urad]
LEAST = {"temperature": 1.5, "displacement": 5.0, "angle": 20.0}
#: minimum ratio of a jump to the largest change in the neighbouring rows
RATIO = 4.0
#: number of neighbouring rows on each side used for comparison
_BESIDE = 5
#: minimum ratio of a jump to the usual change over two rows
_NOISE = 8.0
#: more jumps than this are regular behaviour of a channel: a thermostat, a pump
_OFTEN = 4


@dataclass(frozen=True, eq=False)
class Edges:
    """The jumps of one signal.

    Parameters
    ----------
    before, after : ndarray of int of shape (n_jumps,)
        Last row of the old level and first row of the new one in the recording; one row may lie between them.
    height : ndarray of shape (n_jumps,)
        Height in the unit of the channel.
    clear : ndarray of bool of shape (n_jumps,)
        Certain without further evidence; other jumps require a second channel with the opposite jump.
    """

    signal: Signal
    before: IntArray
    after: IntArray
    height: FloatArray
    clear: BoolArray

    def near(self, row: int, *, clearly: bool = True) -> bool:
        """Return whether the signal has a jump at `row` or an adjacent row."""
        return bool(((self.clear | (not clearly)) & (self.before <= row + 1) & (self.after >= row)).any())


def find_edges(signal: Signal) -> Edges:
    """Find jumps: changes over two rows that are much larger than the neighbouring ones.

    A jump is clear if it exceeds 4 times the largest row-to-row change among the five rows on each side, which excludes
    the exponential of a warm-up at any sampling rate; and 8 times the usual change over two rows (robust standard
    deviation; 3 times the resolution where it is 0). The other jumps exceed half of these limits.
    """
    x, rows = signal.x, signal.rows
    moves = np.abs(np.diff(x))
    if len(x) < 2 * _BESIDE + 3 or not moves.any():
        none = np.empty(0, dtype=np.intp)
        return Edges(signal=signal, before=none, after=none, height=np.empty(0), clear=np.empty(0, dtype=np.bool_))
    jump = x[2:] - x[:-2]
    noise = 1.4826 * float(np.median(np.abs(jump - np.median(jump))))
    if noise == 0:
        noise = 3 / _NOISE * float(np.median(moves[moves > 0]))
    padded = np.concatenate([np.zeros(_BESIDE), moves, np.zeros(_BESIDE)])
    most = sliding_window_view(padded, _BESIDE).max(axis=1)
    beside = np.maximum(most[: len(jump)], most[2 + _BESIDE :][: len(jump)])
    size = np.abs(jump)
    limit = np.maximum(RATIO * beside, _NOISE * noise)
    found = 2 * size > limit
    found[:2] = found[-2:] = False  # no level for comparison
    # of neighbours that detect the same jump the largest is kept
    largest = sliding_window_view(np.pad(size * found, 1), 3).max(axis=1)
    first = np.flatnonzero(found & (size == largest))
    first = first[np.diff(first, prepend=-9) > 1]
    # if the first or the last of the two changes is the whole jump, the row between belongs to one of the levels
    early = np.abs(x[first + 1] - x[first]) > 0.8 * size[first]
    late = np.abs(x[first + 2] - x[first + 1]) > 0.8 * size[first]
    return Edges(
        signal=signal,
        before=rows[first + late],
        after=rows[first + 2 - (early & ~late)],
        height=jump[first],
        clear=size[first] > limit[first],
    )


def jumps(signals: Sequence[Signal], time: FloatArray, moved: BoolArray) -> Iterator[Finding]:
    """Yield findings on steps of a single channel, and on two channels that are exchanged.

    A step is a jump (`find_edges`) of 1.5 degC, 5 um or 20 urad or more without a jump of any other channel within one
    row, whatever its quantity. At a change of spindle speed, it is reported only if it exceeds 3 times the response of
    the channel at all other such changes. A step that is later reversed is reported with both its ends, and its rows. A
    channel with over four jumps is regarded as a thermostat. Steps across a gap in time are ignored.

    Exchanged channels: two channels of one quantity jump at the same row, each continues at the level of the other to
    within a quarter of the jump, and no third channel jumps there. Two sensors with equal values at that time cannot be
    distinguished.

    Parameters
    ----------
    time : ndarray of shape (n_rows,)
        [s]
    moved : ndarray of bool of shape (n_rows - 1,)
        Row-to-row steps with a change of spindle speed.
    """
    edges = [find_edges(s) for s in signals]
    usual = float(np.quantile(np.diff(time), 0.9)) if len(time) > 1 else 0.0
    swapped: set[tuple[int, int]] = set()
    for a, mine in enumerate(edges):
        for row, height in zip(mine.after, mine.height, strict=True):
            for b, other in enumerate(edges[a + 1 :], start=a + 1):
                if (a, b) not in swapped and _exchanged(mine, other, int(row), float(height), moved):
                    if any(e.near(int(row), clearly=False) for e in edges if e is not mine and e is not other):
                        continue
                    swapped.add((a, b))
                    yield _swap(mine.signal, other.signal, int(row), time)
                    yield _swap(other.signal, mine.signal, int(row), time)
    for a, mine in enumerate(edges):
        least = LEAST.get(mine.signal.channel.quantity)
        if least is None or any(a in pair for pair in swapped) or mine.clear.sum() > _OFTEN:
            continue
        lone = [
            k
            for k in range(len(mine.after))
            if mine.clear[k]
            and abs(mine.height[k]) >= least
            and time[mine.after[k]] - time[mine.before[k]] <= 4 * usual
            and not any(e.near(int(mine.after[k])) for e in edges if e is not mine)
            and not _explained(mine, k, moved)
        ]
        if lone:
            yield _step(mine, lone, time)


def _explained(mine: Edges, k: int, moved: BoolArray) -> bool:
    """Return whether jump `k` is due to a speed change: other such changes move the channel by a third as much."""
    near = np.convolve(moved, np.ones(7), mode="same") > 0
    if not near[mine.before[k] : mine.after[k]].any():
        return False
    signal = mine.signal
    rows, x = signal.rows, signal.x
    here = (rows[2:] > mine.before[k] - 8) & (rows[:-2] < mine.after[k] + 8)
    elsewhere = near[np.minimum(rows[:-2], len(near) - 1)] & ~here
    most = np.abs(x[2:] - x[:-2])[elsewhere].max(initial=0.0)
    return not most or abs(mine.height[k]) < 3 * most


def _step(mine: Edges, lone: list[int], time: FloatArray) -> Finding:
    """Return the finding of the largest step; two that cancel each other are reported as a section to be deleted."""
    channel = mine.signal.channel
    k = max(lone, key=lambda j: abs(mine.height[j]))
    height, row = float(mine.height[k]), int(mine.after[k])
    back = [j for j in lone if abs(mine.height[j] + height) < 0.25 * abs(height)]
    if len(lone) == 2 and back:
        first, last = (int(r) for r in sorted([row, int(mine.after[back[0]])]))
        up = float(mine.height[min(lone)])
        text = Message(
            "is off by {step:+.3g} {unit} from {first} to {last}, by a step that is reversed later and that no other "
            "channel shows: delete these values",
            step=up,
            unit=channel.unit,
            first=at_row(first, time),
            last=at_row(last - 1, time),
        )
        return cut_out("trouble", channel, "step", text, np.arange(first - 1, last), time)
    text = Message(
        "steps by {step:+.3g} {unit} at {row}{more}, which no other channel shows: a sensor or probe that was touched "
        "or came loose. Split the test there into two files, each with its own zero (reference reading), subtract the "
        "step from the values after it, or leave the channel out",
        step=height,
        unit=channel.unit,
        row=at_row(row, time),
        more=Message(", the largest of {n} such steps", n=len(lone)) if len(lone) > 1 else "",
    )
    begin, times = min(int(mine.after[j]) for j in lone), sorted(float(time[mine.after[j]]) for j in lone)
    # of a temperature the values after it are left out; what a displacement was relative to before is not known either
    rows = np.arange(begin, len(time)) if channel.quantity == "temperature" else None
    zeroed = [{"do": "rezero", "channels": [channel.name], "at": t, "reason": "step"} for t in times]
    return Finding("trouble", channel.name, "step", text, rows=rows, row=row, remedy={"clean": zeroed})


def _exchanged(a: Edges, b: Edges, row: int, height: float, moved: BoolArray) -> bool:
    """Return whether `a`, which jumps by `height` to a new level at `row`, is exchanged with `b` there."""
    if a.signal.channel.quantity != b.signal.channel.quantity:
        return False
    for j in np.flatnonzero(b.after == row):
        k = int(np.flatnonzero(a.after == row)[0])
        # a spindle start moves many channels at once: then both jumps must be clear
        if moved[max(row - 4, 0) : row + 3].any() and not (a.clear[k] and b.clear[j]):
            return False
        before, first, second = int(b.before[j]), a.signal.values, b.signal.values
        misses = [b.height[j] + height, first[row] - second[before], second[row] - first[before]]
        return bool(np.abs(misses).max() <= 0.25 * abs(height))
    return False


def _swap(a: Signal, b: Signal, row: int, time: FloatArray) -> Finding:
    text = Message(
        "is exchanged with {other} at {row}: each continues at the level of the other. Swap these columns back from "
        "there on, or leave both out",
        other=b.channel.name,
        row=at_row(row, time),
    )
    names = sorted([a.channel.name, b.channel.name])  # both report the same step
    back = {"do": "swap", "channels": names, "at": float(time[row])}
    return Finding("trouble", a.channel.name, "swapped", text, row=row, remedy={"clean": [back]})
