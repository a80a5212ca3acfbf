"""Spikes: single values, or a few in a row, that deviate from the curve and return to it."""

from collections.abc import Iterator

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.messages import Message
from thermocomp.recordings.checks.findings import Finding, Signal, at_row, cut_out

#: maximum number of rows of one spike; longer deviations are reported as two steps
LONGEST = 10
#: number of rows on each side used for comparison with a spike of several rows
_BESIDE = 5


def spikes(signal: Signal, time: FloatArray, moved: BoolArray) -> Iterator[Finding]:
    """Yield findings on values far outside their neighbours (Hampel filter, insensitive to steps and kinks).

    A single value is a spike if it deviates from its four neighbours by over 8 robust standard deviations, over the
    range of these neighbours, and over 2 % of the span of the channel. For 2 to 10 consecutive rows the same applies to
    five neighbours on each side, plus over 4 times the largest change among them. It is reported as trouble if a spike
    is higher than the span. The span is the range of a running median over 21 rows, which excludes spikes of this
    length.

    Parameters
    ----------
    time : ndarray of shape (n_rows,)
        [s]
    moved : ndarray of bool of shape (n_rows,)
        Rows around a change of the spindle speed. There a short run of the spindle must not count as a spike: several
        consecutive rows must deviate by more than the span.
    """
    x, rows = signal.x, signal.rows
    span = signal.span
    off, height, limit = _singles(x, span)
    leaping: BoolArray = np.asarray(moved[rows])
    hit = height > limit
    leaps = np.count_nonzero(np.abs(np.diff(x)) > max(8 * off, 0.02 * span))
    longest = min(LONGEST, len(x) - 2 * _BESIDE) if leaps > 1 else 0  # one jump up and one back
    for m in range(2, longest + 1):
        there, above = _bursts(x, m, off, span)
        for first in np.flatnonzero(there):
            part = slice(int(first), int(first) + m)
            if leaping[part].any() and above[:, first].min() <= span:
                continue
            hit[part] = True
            height[part] = np.maximum(height[part], above[:, first])
    hits = np.flatnonzero(hit)
    if not hits.size:
        return
    top = int(hits[np.argmax(height[hits])])
    lengths = np.diff(np.flatnonzero(np.diff(hits, prepend=-5, append=len(x) + 5) != 1))
    n, longest = len(lengths), int(lengths.max())
    if n > 1:
        found = Message("{n} spikes of up to {rows} rows" if longest > 1 else "{n} spikes", n=n, rows=longest)
    else:
        found = Message("1 spike of {rows} rows" if longest > 1 else "1 spike", rows=longest)
    text = Message(
        "{spikes}, the highest by {height:.3g} {unit} at {row} (usual noise {noise:.2g}); delete the values or look "
        "for a loose contact",
        spikes=found,
        height=float(height[top]),
        unit=signal.channel.unit,
        row=at_row(int(rows[top]), time),
        noise=off,
    )
    yield cut_out("trouble" if height[top] > span else "warning", signal.channel, "spike", text, rows[hits], time)


def _singles(x: FloatArray, span: float) -> tuple[float, FloatArray, FloatArray]:
    """Return the usual noise, the deviation of each value from its four neighbours, and the spike threshold."""
    padded = np.concatenate([x[[4, 3]], x, x[[-4, -5]]])  # at the ends, all neighbours are on one side
    around = np.sort(np.stack([padded[:-4], padded[1:-3], padded[3:-1], padded[4:]]), axis=0)
    low, high = around[0], around[3]
    off = np.abs(x - 0.5 * (around[1] + around[2]))
    scale = 1.4826 * float(np.median(off))
    if scale == 0 and off.any():  # resolution coarser than the noise
        scale = float(np.median(off[off > 0]))
    return scale, np.maximum(x - high, low - x), np.maximum(high - low, max(8 * scale, 0.02 * span))


def _bursts(x: FloatArray, m: int, scale: float, span: float) -> tuple[BoolArray, FloatArray]:
    """Return the first rows of spikes of m rows, (n,), and the height of each of their rows, (m, n)."""
    sides = sliding_window_view(x, _BESIDE)
    moves = np.abs(np.diff(sides, axis=1)).max(axis=1)
    n = len(x) - m - 2 * _BESIDE + 1  # positions with neighbours on both sides
    after = slice(_BESIDE + m, _BESIDE + m + n)
    low = np.minimum(sides.min(axis=1)[:n], sides.min(axis=1)[after])
    high = np.maximum(sides.max(axis=1)[:n], sides.max(axis=1)[after])
    inside = sliding_window_view(x, m)[_BESIDE : _BESIDE + n].T
    above = np.maximum(inside - high, low - inside)
    limit = np.maximum.reduce(
        [high - low, 4 * np.maximum(moves[:n], moves[after]), np.full(n, max(8 * scale, 0.02 * span))]
    )
    there = np.zeros(len(x), dtype=np.bool_)
    there[_BESIDE : _BESIDE + n] = (above > limit).all(axis=0)
    heights = np.zeros((m, len(x)))
    heights[:, _BESIDE : _BESIDE + n] = above
    return there, heights
