"""Time constants: settling of each channel after the drives start or stop.

Three results that check each other: the times to 63 % and 90 % are read from the curve itself, without a model; then
one and two exponentials are fitted. None of this is prescribed by ISO 230-3: all symbols are specific to thermocomp.
The curve is first averaged over minutes (`thermocomp.judging.settling.averaging`): no single row is decisive.
"""

import math
from collections.abc import Collection
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.judging.settling.averaging import WINDOW, AveragedCurve, K, Noise, average_test
from thermocomp.judging.settling.exponentials import ExponentialFit, fit
from thermocomp.recordings.recording import Recording

Kind = Literal["warm-up", "cool-down"]
#: shorter stops (a spindle test with a speed spectrum has some) do not end a warm-up, shorter runs do not start one [s]
INTERRUPTION = 1200.0
#: tolerance about the last value over the last quarter of a settled curve, as a fraction of its whole change
SETTLED = 0.05
#: minimum change of a channel, as a multiple of its standard uncertainty, for times to be reported
CLEAR = 10.0
#: an overshooting curve exceeds its last value by more than this fraction of its whole change: the band of t90
OVERSHOOT = 0.1
_ROWS = 8  # minimum number of rows for a fit


@dataclass(frozen=True)
class Phase:
    """A warm-up or a cool-down.

    Parameters
    ----------
    number : int
        Number among the phases of its kind (1-based).
    start, end : int
        Row of the initial state, and last row.
    """

    kind: Kind
    number: int
    start: int
    end: int


@dataclass(frozen=True)
class Settling:
    """Transition of a channel between two states in a phase; with too few rows, the values below keep their defaults.

    Parameters
    ----------
    change : float
        Value at the end minus value at the start, both averaged [unit].
    uncertainty : float
        Uncertainty of `change`, expanded (k = 2) [unit].
    noise : float
        Standard deviation from row to row [unit].
    moves : bool
        The averages differ by more than their noise; see `thermocomp.judging.settling.averaging.Noise`.
    clear : bool
        `change` is at least `CLEAR` times its standard uncertainty; otherwise no times are read and nothing is fitted.
    returns : bool
        The channel ends closer to its initial value than to its extreme: no single time describes it.
    overshoots : bool
        The channel exceeds its last value by more than a tenth of its change, and then settles back: the time at which
        90 % are first reached is then not a settling time, so no times are reported.
    settled : bool
        Over the last quarter of the phase the channel stays within `SETTLED` of its change about its last value, and a
        straight line through it rises by no more; noise is allowed for. By this rule an exponential is settled after
        3.3 time constants, 4 % before its final value.
    t63, t90 : float
        Times since the start at which 63.2 % and 90 % of the change up to the end were first reached [s]; if the
        channel has not settled, the true times are longer. nan if it is not clear, returns or overshoots.
    one, two : ExponentialFit or None
        None if it could not be fitted; `two` also if a second exponential is not justified.
    """

    channel: str
    unit: str
    phase: Phase
    change: float = math.nan
    uncertainty: float = math.nan
    noise: float = math.nan
    moves: bool = False
    clear: bool = False
    returns: bool = False
    overshoots: bool = False
    settled: bool = False
    t63: float = math.nan
    t90: float = math.nan
    one: ExponentialFit | None = None
    two: ExponentialFit | None = None

    @property
    def words(self) -> str:
        """Return cautions about the reported times, as text; empty if there are none."""
        if not self.moves:
            return "does not change"
        if not self.clear:
            return "changes too little to determine a time"
        if self.returns:
            return "returns"
        if self.overshoots:
            return "overshoots" if self.settled else "overshoots, not settled"
        return "" if self.settled else "not settled"


def find_driven_rows(recording: Recording) -> BoolArray | None:
    """Return the rows in which the spindle turns or an axis moves, (n_rows,); None if neither was recorded.

    The threshold is 2 % of the highest speed or feed. A row without a value is treated as the previous row.
    """
    channels = (*recording.of_quantity("spindle_speed"), *recording.of_quantity("feed"))
    if not channels:
        return None
    on = np.zeros(len(recording), dtype=np.bool_)
    for values in np.abs(recording.values(channels)).T:
        known = np.isfinite(values)
        if known.any():
            last = np.maximum.accumulate(np.where(known, np.arange(len(values)), 0))
            filled = np.nan_to_num(values[last])
            on |= filled > 0.02 * filled.max()
    return on


def find_phases(recording: Recording, interruption: float = INTERRUPTION) -> tuple[Phase, ...]:
    """Split a recording into warm-ups and cool-downs.

    A row describes the interval before it: a phase begins in the row before the drives start or stop. Rows before the
    first start belong to no phase. Stops shorter than `interruption` do not end a warm-up, shorter runs do not start
    one.

    Parameters
    ----------
    interruption : float
        Shortest stop or run that counts [s].
    """
    on = find_driven_rows(recording)
    if on is None or not on.any():
        return ()
    time = recording.time
    for state in (False, True):  # short stops first: a spectrum of speeds is one warm-up
        edges = [0, *(np.flatnonzero(np.diff(on)) + 1).tolist(), len(on)]
        for k in range(1 if state is False else 0, len(edges) - 1):
            a, b = edges[k], edges[k + 1]
            inside = state or b < len(on)  # the stop at the end is a cool-down, however short
            if on[a] == state and inside and time[b - 1] - time[max(a - 1, 0)] < interruption:
                on[a:b] = not state
    edges = [0, *(np.flatnonzero(np.diff(on)) + 1).tolist(), len(on)]
    found: list[Phase] = []
    for a, b in pairwise(edges):
        kind: Kind = "warm-up" if on[a] else "cool-down"
        if kind == "warm-up" or found:
            number = 1 + sum(p.kind == kind for p in found)
            found.append(Phase(kind, number, max(a - 1, 0), b - 1))
    return tuple(found)


def time_constants(
    recording: Recording, phases: tuple[Phase, ...] | None = None, leave_out: Collection[str] = ()
) -> tuple[Settling, ...]:
    """Determine the time constants of every temperature, displacement and angle in every phase.

    Parameters
    ----------
    phases : tuple of Phase, optional
        Default: the result of `find_phases`.
    """
    phases = find_phases(recording) if phases is None else phases
    channels = [
        c
        for c in recording.channels
        if c.quantity in ("temperature", "displacement", "angle") and c.name not in leave_out
    ]
    values = recording.values(channels)
    found = []
    for number, p in enumerate(phases):
        # the machine may still move after the previous phase; before the first one it has rested
        earliest = phases[number - 1].start if number else 0
        begin = earliest + int(np.searchsorted(recording.time[earliest : p.start], recording.time[p.start] - WINDOW))
        rows, lead = slice(begin, p.end + 1), p.start - begin
        for k, c in enumerate(channels):
            found.append(settle(recording.time[rows], values[rows, k], c.name, c.unit, p, lead=lead, rests=number == 0))
    return tuple(found)


def settle(
    time: FloatArray,
    values: FloatArray,
    channel: str,
    unit: str,
    phase: Phase,
    *,
    lead: int = 0,
    rests: bool = True,
) -> Settling:
    """Determine the time constants of one channel in one phase.

    Parameters
    ----------
    time : ndarray of shape (n_rows,)
        [s]
    values : ndarray of shape (n_rows,)
        nan where missing; such rows are ignored.
    """
    there = np.isfinite(values)
    lead, (t, y) = int(there[:lead].sum()), (time[there], values[there])
    if len(y) - lead < _ROWS:
        return Settling(channel=channel, unit=unit, phase=phase)
    c = average_test(t, y, lead, len(y) - 1, rests=rests)
    t, y, curve = t[lead:] - time[min(np.flatnonzero(there)[lead], len(time) - 1)], y[lead:] - c.zero.value, c.values
    change, span = float(curve[-1]), float(np.ptp(curve))
    u = float(np.hypot(c.u[-1], c.zero.u))
    moves = c.noise.moves
    clear = bool(moves and span >= CLEAR * u)
    returns = clear and abs(change) < 0.5 * span
    beyond = float((np.sign(change) * (curve - change)).max())
    overshoots = clear and not returns and beyond > max(OVERSHOOT * abs(change), 3.0 * u)
    last = t >= 0.75 * t[-1]
    settled = clear and _rests(t[last], y[last], curve[last], SETTLED * abs(change), c.noise)
    reads = clear and not returns and not overshoots
    one, two = fit(t, y + c.zero.value) if clear else (None, None)
    return Settling(
        channel=channel,
        unit=unit,
        phase=phase,
        change=change,
        uncertainty=K * u,
        noise=c.noise.sigma,
        moves=moves,
        clear=clear,
        returns=returns,
        overshoots=overshoots,
        settled=settled,
        t63=_reached(t, y, c, 1.0 - np.exp(-1.0)) if reads else math.nan,
        t90=_reached(t, y, c, 0.9) if reads else math.nan,
        one=one,
        two=two,
    )


def _rests(t: FloatArray, y: FloatArray, curve: FloatArray, limit: float, noise: Noise) -> bool:
    """Return whether a curve stays within a limit of its last value and its trend does not exceed the limit."""
    if len(t) < 2:
        return False
    rise = float(np.polyfit(t - t.mean(), y, 1)[0] * (t[-1] - t[0]))
    creeps = abs(rise) > max(limit, np.sqrt(12.0) * K * float(noise.of_mean(len(t))))
    # a line has twice the uncertainty of a mean at its end
    width = limit + 3.0 * np.sqrt(5.0) * float(noise.of_mean(np.mean(np.abs(t - t[-1]) <= noise.window) * len(t)))
    return bool(not creeps and np.abs(curve - curve[-1]).max() <= width)


def _reached(t: FloatArray, y: FloatArray, c: AveragedCurve, share: float) -> float:
    """Return the time at which the average first reached a fraction of its change [s], by a local parabola."""
    level = share * c.values[-1]
    done = c.values / c.values[-1]
    k = int(np.argmax(done >= share))
    if k == 0:
        return 0.0
    crossed = float(t[k - 1] + (share - done[k - 1]) / (done[k] - done[k - 1]) * (t[k] - t[k - 1]))
    half = min(0.5 * c.noise.window, crossed, float(t[-1]) - crossed)
    near = np.abs(t - crossed) <= half
    if near.sum() < 5:
        return crossed
    a, b, constant = np.polyfit((t[near] - crossed) / half, y[near], 2)
    roots = np.roots([a, b, constant - level])
    real = roots[np.isreal(roots)].real
    real = real[np.abs(real) <= 1.0]
    return crossed + half * float(real[np.argmin(np.abs(real))]) if real.size else crossed
