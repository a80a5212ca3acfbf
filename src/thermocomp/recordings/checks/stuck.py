"""Constant values of a sensor that should vary, and the resolution of a channel."""

import math
from collections.abc import Iterator

import numpy as np

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.messages import Message
from thermocomp.recordings.checks.findings import Finding, Severity, Signal, at_row, cut_out, runs

#: minimum number of constant rows
SHORTEST = 30
#: accepted probability per recording that noise and resolution alone keep a value constant for this long
_CHANCE = 1e-3


def stuck(signal: Signal, time: FloatArray) -> Iterator[Finding]:
    """Yield findings on 30 or more rows with a constant value although the sensor should vary.

    It should vary if there is noise right before and after, or if a fast change stops abruptly. A sensor that
    approaches steady state slowly, or with noise below its resolution, may be constant: noise of a single resolution
    step gives only a warning, and only for over a tenth of the test. The same applies to noise of a few steps, if it
    keeps a value in the middle of a step constant for this long by chance (once in a thousand recordings). A coarse
    resolution is reported as an info.

    Parameters
    ----------
    time : ndarray of shape (n_rows,)
        [s]
    """
    x, rows, channel = signal.x, signal.rows, signal.channel
    step, span = _resolution(x), signal.span
    moves = np.diff(x) / step
    coarse = step > 0.02 * span and np.count_nonzero(moves) >= 10 and np.abs(moves - np.round(moves)).max() < 1e-3
    starts, lengths = runs(x)
    longest = [int(k) for k in np.argsort(lengths, kind="stable")[::-1][:20] if lengths[k] >= SHORTEST]
    possible = _by_chance(x, step, np.repeat(lengths < SHORTEST, lengths)) if longest else 0.0
    reasons = {k: _why(x, int(starts[k]), int(lengths[k]), step, possible) for k in longest}
    for severity in ("trouble", "warning"):
        hits = [k for k in longest if reasons[k] == severity]
        if not hits or (severity == "warning" and coarse):
            continue
        k = hits[0]
        first, last = int(rows[starts[k]]), int(rows[starts[k] + lengths[k] - 1])
        text = Message(
            "is constant at {value:.6g} {unit} for {n} rows, from {first} to {last}{more}, although it varies from row "
            "to row before or after; check the sensor, then delete the values or leave the channel out",
            value=float(x[starts[k]]),
            unit=channel.unit,
            n=int(lengths[k]),
            first=at_row(first, time),
            last=at_row(last, time),
            more=Message(", one of {n} such periods", n=len(hits)) if len(hits) > 1 else "",
        )
        # the first value of each section may be a real measurement
        concerned = np.concatenate([rows[starts[j] + 1 : starts[j] + lengths[j]] for j in sorted(hits)])
        yield cut_out(severity, channel, "stuck", text, concerned, time)
    if coarse:
        text = Message(
            "moves in steps of {step:g} {unit} over a span of {span:.3g}; a finer resolution would help",
            step=step,
            unit=channel.unit,
            span=span,
        )
        yield Finding("info", channel.name, "quantised", text)


def _by_chance(x: FloatArray, step: float, lively: BoolArray) -> float:
    """Return the number of rows for which noise may keep a value within a step by chance, anywhere in `x`."""
    moves = np.diff(x)[lively[1:]]
    moving = moves[np.abs(moves) <= max(8 * float(np.median(np.abs(moves))), 2 * step)] if moves.size else moves
    if moving.size < 8:
        return 0.0
    # a difference has twice the variance of the noise and twice that of rounding
    variance = float(np.var(moving)) / 2 - step**2 / 12
    stay = math.erf(step / math.sqrt(8 * variance)) if variance > 0 else 1.0
    return len(x) if stay == 1 else math.log(_CHANCE / len(x)) / math.log(stay) if stay > 0 else 0.0


def _why(x: FloatArray, start: int, length: int, step: float, possible: float) -> Severity | None:
    """Return the severity of a constant section of `length` rows, by the 50 rows on each side; None if harmless."""
    before, after = x[max(start - 50, 0) : start + 1], x[start + length - 1 : start + length + 50]
    sides = [np.diff(side) for side in (before, after) if len(side) > 30]
    if not sides:
        return "trouble" if length > 0.9 * len(x) else None
    noisy, fine = True, length > possible
    for moves in sides:
        real = moves[moves != 0]
        drifting = real - np.median(real) if real.size else real
        # noise on a slope does not reverse the signal, but its changes vary by more than rounding explains
        turns = max(_turns(real), _turns(drifting[np.abs(drifting) > 1.01 * step]))
        noisy = noisy and real.size >= 8 and turns >= real.size / 5 and length * (real.size + 1) >= 20 * moves.size
        fine = fine and bool(np.abs(real).max(initial=0) > 1.5 * step)
    if noisy:
        return "trouble" if fine else "warning" if length >= len(x) // 10 else None
    last = np.abs(np.diff(before[-6:]))
    return "trouble" if last.size == 5 and last.min() >= 10 * step else None


def _turns(moves: FloatArray) -> int:
    return int(np.count_nonzero(np.diff(np.sign(moves))))


def _resolution(x: FloatArray) -> float:
    """Return the smallest step of a channel that is not constant, ignoring rounding errors."""
    moves = np.diff(x)
    steps = np.abs(np.concatenate([moves, np.diff(moves)]))
    return float(steps[steps > 1e-9 * np.abs(x).max()].min(initial=np.ptp(x)))
