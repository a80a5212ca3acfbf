"""Spikes: single values, or a few in a row, that leave the curve and come back to it."""

from collections.abc import Iterator

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.recordings.checks.findings import Finding, Signal, at_row, count, cut_out

#: most rows of one spike; what stays away longer is told as two steps
LONGEST = 10
#: rows on each side that a spike of several rows is compared with
_BESIDE = 5


def spikes(signal: Signal, time: FloatArray, moved: BoolArray) -> Iterator[Finding]:
    """Yield values far outside their neighbours (a Hampel filter that steps and kinks do not trip).

    Far is, for a single value: over 8 robust standard deviations of a value against its four neighbours, over the
    neighbours' own range, and over 2 % of the channel's span. For 2 to 10 rows in a row it is the same against five
    neighbours on each side, and over 4 times the largest move among these. Trouble where a spike is higher than the
    span. The span is that of a running median over 21 rows, which no such spike reaches.

    Parameters
    ----------
    signal : Signal
        Signal with 5 good rows or more.
    time : ndarray of shape (n_rows,)
        [s]
    moved : ndarray of bool of shape (n_rows,)
        Rows around a change of the spindle speed. A short run is no spike: there, several rows in a row must be farther
        off than the span.
    """
    x, rows = signal.x, signal.rows
    span = signal.span
    off, height, limit = _singles(x, span)
    leaping: BoolArray = np.asarray(moved[rows])
    hit = height > limit
    leaps = np.count_nonzero(np.abs(np.diff(x)) > max(8 * off, 0.02 * span))
    longest = min(LONGEST, len(x) - 2 * _BESIDE) if leaps > 1 else 0  # there and back
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
    width = f" of {'up to ' * (len(lengths) > 1)}{lengths.max()} rows" if lengths.max() > 1 else ""
    text = (
        f"{count(len(lengths), 'spike')}{width}, the highest by {height[top]:.3g} {signal.channel.unit} at "
        f"{at_row(int(rows[top]), time)} (usual noise {off:.2g}); delete the values or look for a loose contact"
    )
    yield cut_out("trouble" if height[top] > span else "warning", signal.channel, "spike", text, rows[hits], time)


def _singles(x: FloatArray, span: float) -> tuple[float, FloatArray, FloatArray]:
    """Return the usual noise, each value's height over its four neighbours, and the height that makes a spike."""
    padded = np.concatenate([x[[4, 3]], x, x[[-4, -5]]])  # the ends have their neighbours on one side
    around = np.sort(np.stack([padded[:-4], padded[1:-3], padded[3:-1], padded[4:]]), axis=0)
    low, high = around[0], around[3]
    off = np.abs(x - 0.5 * (around[1] + around[2]))
    scale = 1.4826 * float(np.median(off))
    if scale == 0 and off.any():  # steps coarser than the noise
        scale = float(np.median(off[off > 0]))
    return scale, np.maximum(x - high, low - x), np.maximum(high - low, max(8 * scale, 0.02 * span))


def _bursts(x: FloatArray, m: int, scale: float, span: float) -> tuple[BoolArray, FloatArray]:
    """Return the first rows of spikes of m rows, (n,), and the height of each of their rows, (m, n)."""
    sides = sliding_window_view(x, _BESIDE)
    moves = np.abs(np.diff(sides, axis=1)).max(axis=1)
    n = len(x) - m - 2 * _BESIDE + 1  # places with neighbours on both sides
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
