"""Inconsistent clocks: temperatures or displacements that lead or lag the spindle in a way that heat cannot cause."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from thermocomp.core import lagbank
from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.messages import Message
from thermocomp.recordings.checks.findings import Finding, Signal

#: time constants of the thermal response to the spindle [s]
_LAGS = (120.0, 400.0, 1200.0, 3600.0, 10800.0)
#: largest clock shift tested, and smallest one reported [s]
_FAR, _NEAR = 2400.0, 480.0
#: minimum gain in log-likelihood for a shift of a group of channels to be reported; valid recordings reach 2
_GAIN = 60.0
#: the same for single channels that lag; valid recordings reach 40
_LATE = 100.0
_LONGEST = 20_000


@dataclass(frozen=True, eq=False)
class _Fits:
    """Fit of each channel to the spindle speed for each clock shift.

    Parameters
    ----------
    shifts : ndarray of shape (n_shifts,)
        [s]; positive: the channel lags the spindle.
    gain : ndarray of shape (n_shifts, n_channels)
        Gain in log-likelihood relative to no shift.
    """

    shifts: FloatArray
    gain: FloatArray

    @property
    def least(self) -> float:
        """Smallest shift that is reported [s]: 8 min, and at least two steps."""
        return max(_NEAR, 2 * float(self.shifts[1] - self.shifts[0]))


def clocks(signals: Sequence[Signal], time: FloatArray, speed: FloatArray | None) -> Iterator[Finding]:
    """Yield findings on groups of channels whose clock differs from the clock of the spindle speed.

    Heat follows the spindle through first-order lags: each channel's changes from minute to minute (or row to row) are
    regressed on the changes of speed and squared speed with lags of 2 min to 3 h, with the channel shifted by -40 to 40
    min. Sums of such lags can represent any slow response, but neither one that precedes its cause nor a sharp one that
    comes late. All temperatures, or all displacements, are tested jointly; trouble is reported if a shift of at least 8
    min and two rows improves the log-likelihood by over 60. Channels of an otherwise sound group are reported if they
    lead by as much; if they lag, only two or more together, each with a gain in log-likelihood of over 100, because a
    remote sensor may respond late. At the end of the tested range, the gain must grow ever faster.

    No result is given for a test without a spindle speed channel or with fewer than two speed changes, for one shorter
    than 2 h 20 min, or for channels that do not respond to the spindle. In a test with a periodic speed the reported
    shift may be wrong by the period.

    Parameters
    ----------
    time : ndarray of shape (n_rows,)
        [s]
    speed : ndarray of shape (n_rows,) or None
        [1/min]
    """
    if speed is None or len(time) < 60:
        return
    told: dict[str, tuple[float, list[str]]] = {}
    groups = {q: _usable(signals, q) for q in ("temperature", "displacement")}
    everyone = [s for group in groups.values() for s in group]
    fits = _fit(everyone, time, speed) if everyone else None
    if fits is None:
        return
    for quantity, group in groups.items():
        mine = [s.channel.quantity == quantity for s in everyone]
        if group and (found := _disagree(group, _Fits(fits.shifts, fits.gain[:, mine]))):
            told[quantity] = found
    shifts = [shift for shift, _ in told.values()]
    if len(told) == 2 and abs(shifts[0] - shifts[1]) <= _NEAR / 2:  # then the clock of the speed is the different one
        told = {"channel": (sum(shifts) / 2, [n for _, names in told.values() for n in names])}
        groups = {"channel": everyone}
    for quantity, (shift, names) in told.items():
        others = len(groups[quantity]) - len(names)
        moved: dict[str, object] = {"do": "shift", "channels": names, "by_s": -shift}
        if others:  # only the user knows which logger recorded these channels
            moved["reason"] = "clock; add the other channels of this logger"
        channel = names[0] if len(names) == 1 else ""
        yield Finding("trouble", channel, "clock", _text(names, shift, others), remedy={"clean": [moved]})


def _usable(signals: Sequence[Signal], quantity: str) -> list[Signal]:
    """Return the channels of a quantity that vary and have values in most rows."""
    mine = (s for s in signals if s.channel.quantity == quantity and not s.probed)
    return [s for s in mine if 2 * s.good.sum() > len(s.good) and np.ptp(s.x) > 0]


def _fit(group: Sequence[Signal], time: FloatArray, speed: FloatArray) -> _Fits | None:
    """Regress the channels on the spindle at each shift; None if the test has too little information."""
    step = max(60.0, float(np.median(np.diff(time))), float(time[-1] - time[0]) / _LONGEST)
    edges = np.arange(time[0], time[-1], step)
    every = max(1, round(120.0 / step))
    reach = int(_FAR // step) // every * every
    if not reach or len(edges) < 2 * reach + 60:
        return None
    everywhere = np.ones(len(time), dtype=np.bool_)
    turning = np.abs(_means(time, speed, everywhere, edges))
    turning /= max(turning.max(), 1e-9)
    if np.count_nonzero(np.abs(np.diff(turning)) > 0.05) < 2:
        return None
    lags = np.array([lag for lag in _LAGS if lag >= 0.5 * step])
    felt = np.column_stack([turning] * len(lags) + [turning**2] * len(lags))
    causes = np.diff(lagbank.run(felt, np.full(len(felt), step), np.tile(lags, 2)), axis=0)
    answers = np.diff(np.column_stack([_means(time, s.values, s.good, edges) for s in group]), axis=0)
    n = len(answers) - 2 * reach
    answers = answers[reach : reach + n] - answers[reach : reach + n].mean(axis=0)
    moved = (answers**2).sum(axis=0)
    shifts = np.arange(-reach, reach + 1, every)
    left = np.empty((len(shifts), len(group)))
    for k, shift in enumerate(shifts):
        part = causes[reach - shift : reach - shift + n]
        part = part - part.mean(axis=0)
        part /= np.maximum(np.linalg.norm(part, axis=0), 1e-300)
        # with ten columns the normal equations are accurate enough, and far faster
        size, turn = np.linalg.eigh(part.T @ part)
        kept = size > 1e-10 * size[-1]
        left[k] = moved - ((turn[:, kept].T @ (part.T @ answers)) ** 2 / size[kept, None]).sum(axis=0)
    left = np.maximum(left, 1e-9 * np.maximum(moved, 1e-300))
    gain = n * np.log(left[len(shifts) // 2] / left)
    return _Fits(np.asarray(shifts * step, dtype=np.float64), np.asarray(gain, dtype=np.float64))


def _means(time: FloatArray, values: FloatArray, good: BoolArray, edges: FloatArray) -> FloatArray:
    """Return the means of a signal between consecutive times."""
    x = np.interp(time, time[good], values[good])
    area = np.concatenate([[0.0], np.cumsum(0.5 * (x[1:] + x[:-1]) * np.diff(time))])
    return np.asarray(np.diff(np.interp(edges, time, area)) / np.diff(edges))


def _disagree(group: Sequence[Signal], fits: _Fits) -> tuple[float, list[str]] | None:
    """Return the clock shift [s] of a group of channels, and the channels that show it."""
    names = [s.channel.name for s in group]
    together = fits.gain.sum(axis=1)
    best = int(together.argmax())
    if abs(fits.shifts[best]) >= fits.least and together[best] > _GAIN:
        clear = fits.gain[best] > min(_GAIN / 3, float(fits.gain[best].max()) / 2)
        return float(fits.shifts[best]), [n for n, yes in zip(names, clear, strict=True) if yes]
    mine = fits.shifts[fits.gain.argmax(axis=0)]
    most = fits.gain.max(axis=0)
    # at the end of the tested range: a wrong clock gains ever more, a slow course of the day beside work at the same
    # hours ever less
    half = fits.gain[(len(fits.shifts) // 2 + fits.gain.argmax(axis=0)) // 2, np.arange(len(names))]
    sharp = (np.abs(mine) < fits.shifts[-1]) | (most > 2.0 * half)
    early = sharp & (mine <= -fits.least) & (most > _GAIN)
    late = sharp & (mine >= fits.least) & (most > _LATE)
    for who in (early, late & (np.abs(mine - np.median(mine[late])) <= _NEAR / 2) if late.sum() > 1 else early):
        if who.any():
            return float(np.median(mine[who])), [n for n, yes in zip(names, who, strict=True) if yes]
    return None


def _text(names: Sequence[str], shift: float, others: int) -> Message:
    who = ", ".join(names[:6])
    if len(names) > 6:
        who = Message("{names} and {n} more", names=who, n=len(names) - 6)
    rest = (
        Message(
            "; the other {n} channels of this kind show no clear response: shift those of the same logger by the same "
            "time",
            n=others,
        )
        if others
        else ""
    )
    given = {"who": who, "minutes": abs(shift) / 60, "rest": rest}
    if shift < 0:
        return Message(
            "the clocks of two loggers differ: the responses of {who} come about {minutes:.0f} min before the changes "
            "of the spindle speed, but heat cannot act before its cause; shift these columns {minutes:.0f} min later, "
            "or shift the spindle speed by as much in the other direction{rest}",
            **given,
        )
    return Message(
        "the clocks of two loggers differ: the responses of {who} come about {minutes:.0f} min after the changes of "
        "the spindle speed, but heat cannot act so late and yet so sharply; shift these columns {minutes:.0f} min "
        "earlier, or shift the spindle speed by as much in the other direction{rest}",
        **given,
    )
