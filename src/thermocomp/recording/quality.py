"""What is wrong with a recording: gaps, dead, stuck and spiking sensors, missing-value codes."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.machine import Channel
from thermocomp.recording.recording import Recording

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

Severity = Literal["trouble", "warning", "info"]
_ORDER: tuple[Severity, ...] = ("trouble", "warning", "info")

#: numbers that instruments write instead of a value
CODES = (-9999.0, -999.0, 9999.0, 99999.0, -99999.0, -32768.0, 32767.0, 1e30, -1e30)
#: the same for temperatures [degC]: absent thermistor, 0 K, DS18B20 unplugged and just switched on, open thermocouple
TEMPERATURE_CODES = (-180.0, -273.15, -200.0, -127.0, 85.0, 850.0)
#: what a machine tool can show [degC], [um], [urad]; wide for angles, which may be turns of a rotary axis
PLAUSIBLE = {"temperature": (-60.0, 400.0), "displacement": (-1e5, 1e5), "angle": (-1e9, 1e9)}
#: what a sensor's noise never lets stand still; a spindle speed or a position may well
_SENSED = ("temperature", "displacement", "angle")


@dataclass(frozen=True)
class Finding:
    """One thing a user should know about a recording.

    Parameters
    ----------
    severity : {'trouble', 'warning', 'info'}
        ``trouble``: a model fitted to this would be wrong; mend it first.
    channel : str
        Empty if it concerns the whole recording.
    kind : str
        Such as ``gap`` or ``stuck``.
    text : str
        One sentence: where, how much, what to do. Rows are counted from 0, as in the recording's table.
    """

    severity: Severity
    channel: str
    kind: str
    text: str


def check(recording: Recording) -> tuple[Finding, ...]:
    """Look for what makes a recording unfit for a model.

    Parameters
    ----------
    recording : Recording

    Returns
    -------
    tuple of Finding
        The gravest first; empty if nothing was found.

    Notes
    -----
    Thresholds are set so that a sound recording of a real machine raises no trouble; each check's docstring names its
    own.
    """
    found = [Finding("warning", "", "left out", note) for note in recording.notes if note.startswith("left out")]
    found += [*_sampling(recording.time), *_no_cycle(recording)]
    prints: dict[int, str] = {}
    probed = _probed(recording)
    for channel in recording.channels:
        values = recording.table[channel.name].to_numpy(dtype=np.float64)
        found.extend(_channel(channel, values, recording.time, probed=channel.name in probed))
        if np.nanmax(values, initial=-np.inf) > np.nanmin(values, initial=np.inf):  # constant ones are told as such
            other = prints.setdefault(hash(values.tobytes()), channel.name)
            if other != channel.name:
                text = f"has the same value as {other} in every row; leave one of them out"
                found.append(Finding("warning", channel.name, "duplicate channel", text))
    return tuple(sorted(found, key=lambda f: _ORDER.index(f.severity)))


def _probed(recording: Recording) -> set[str]:
    """Return the displacements that are measured in probing cycles: several have their few values in the same rows."""
    rows: dict[bytes, list[str]] = {}
    for channel in recording.displacements:
        there = np.isfinite(recording.table[channel.name].to_numpy(dtype=np.float64))
        if 1 < there.sum() < 0.5 * len(there):
            rows.setdefault(there.tobytes(), []).append(channel.name)
    return {name for names in rows.values() if len(names) > 1 for name in names}


def _channel(channel: Channel, values: FloatArray, time: FloatArray, *, probed: bool) -> Iterator[Finding]:
    """Yield all findings of one channel."""
    name = channel.name
    least, most = PLAUSIBLE.get(channel.quantity, (-np.inf, np.inf))
    plausible = (values >= least) & (values <= most)
    coded = _coded(channel, values, plausible)
    if coded.any():
        yield _code_finding(channel, values, coded, time)
    wild: IntArray = np.flatnonzero(np.isfinite(values) & ~plausible & ~coded)
    if wild.size:
        row = int(wild[np.argmax(np.abs(values[wild]))])
        text = (
            f"{_count(wild.size, 'value')} of {len(values)} beyond {least:g} to {most:g} {channel.unit}, the farthest "
            f"{values[row]:g} at {_at(row, time)}: no {channel.quantity} of a machine; check unit, scale, zero and "
            "sensor"
        )
        yield Finding("trouble", name, "implausible", text)
    yield from _missing(name, values, time, probed=probed)
    if probed:
        return
    # the other checks look at the rest: beside such values nothing else would stand out
    rows: IntArray = np.flatnonzero(np.isfinite(values) & plausible & ~coded)
    if rows.size < 2:
        return
    x = values[rows]
    low, high = float(x.min()), float(x.max())
    if low == high:
        sensed = channel.quantity in _SENSED
        advice = (
            "check whether the sensor is connected, or leave the channel out" if sensed else "it tells models nothing"
        )
        text = f"is {low:g} {channel.unit} in all {rows.size} rows; {advice}"
        yield Finding("trouble" if sensed else "info", name, "constant", text)
    elif channel.quantity in _SENSED and rows.size >= 5:
        lowest, highest = np.quantile(x, (0.01, 0.99))
        span = float(highest - lowest) or high - low
        step = _resolution(x)
        moves = np.diff(x) / step
        coarse = step > 0.02 * span and np.count_nonzero(moves) >= 10 and np.abs(moves - np.round(moves)).max() < 1e-3
        yield from _spikes(channel, x, rows, time, span)
        yield from (f for f in _stuck(channel, x, rows, time, step) if f.severity == "trouble" or not coarse)
        if coarse:
            text = f"moves in steps of {step:g} {channel.unit} over a span of {span:.3g}; a finer resolution would help"
            yield Finding("info", name, "quantised", text)


def _sampling(time: FloatArray) -> Iterator[Finding]:
    """Yield too few rows, gaps, and irregular intervals.

    Few is: under 10. A gap: over 5 times the interval that 90 % of the rows keep. Irregular: varying by over 20 %.
    """
    if len(time) < 10:
        text = f"has only {_count(len(time), 'row')}, too few to say anything; record a whole warm-up and cool-down"
        yield Finding("warning", "", "short", text)
    if len(time) < 3:
        return
    steps = np.diff(time)
    # the 90 % quantile, not the median: probings that come in bursts are irregular, they have no gap every minute
    usual = float(np.quantile(steps, 0.9, method="lower"))
    gaps = np.flatnonzero(steps > 5 * usual)
    if gaps.size:
        longest = int(gaps[np.argmax(steps[gaps])])
        text = (
            f"{_count(gaps.size, 'gap')} in time, the longest {steps[longest]:.6g} s after {_at(longest, time)}, where "
            f"rows are {usual:g} s apart; a model's memory is unsure behind it: split the test there or record it again"
        )
        yield Finding("warning", "", "gap", text)
    kept = steps[steps <= 5 * usual]
    low, middle, high = (float(q) for q in np.quantile(kept, (0.05, 0.5, 0.95)))
    if high - low > 0.2 * middle:
        text = (
            f"rows are {low:.4g} to {high:.4g} s apart (median {middle:.4g} s); "
            "resample for methods that need one interval"
        )
        yield Finding("warning", "", "irregular sampling", text)


def _no_cycle(recording: Recording) -> Iterator[Finding]:
    if len(recording.cycles) > 1:
        return
    why = "the spindle never starts anew" if recording.speed else "there is no spindle speed and no column 'cycle'"
    text = (
        f"the whole test is one thermal cycle, as {why}; judging on unseen cycles needs several cycles or several tests"
    )
    yield Finding("info", "", "no cycle", text)


def _coded(channel: Channel, values: FloatArray, plausible: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return where a known code stands, if it stands apart from the other values by half their span and by 5 units."""
    none = np.zeros(len(values), dtype=np.bool_)
    if channel.quantity not in _SENSED:
        return none
    codes = CODES + (TEMPERATURE_CODES if channel.quantity == "temperature" else ())
    # a change of unit may have rounded a code
    hits = {c: np.abs(values - c) <= 1e-9 * abs(c) for c in codes}
    hits = {c: hit for c, hit in hits.items() if hit.any()}
    rest = values[plausible & ~np.logical_or.reduce([none, *hits.values()])]
    if rest.size:
        low, high = float(rest.min()), float(rest.max())
        margin = max(0.5 * (high - low), 5.0)
        hits = {c: hit for c, hit in hits.items() if not low - margin <= c <= high + margin}
    found: NDArray[np.bool_] = np.logical_or.reduce([none, *hits.values()])
    return found


def _code_finding(channel: Channel, values: FloatArray, coded: NDArray[np.bool_], time: FloatArray) -> Finding:
    codes = ", ".join(f"{c:g}" for c in np.unique(values[coded]))
    first = int(np.flatnonzero(coded)[0])
    if coded.sum() == np.isfinite(values).sum():
        text = (
            f"is {codes} in every row, a code for a missing value: the sensor is absent; leave the channel out, or "
            f"mark the code by a mapping, missing = [{codes}]"
        )
    else:
        text = (
            f"{_count(int(coded.sum()), 'value')} of {len(values)}, the first at {_at(first, time)}, hold {codes}, a "
            f"code for a missing value; mark it by a mapping, missing = [{codes}]"
        )
    return Finding("trouble", channel.name, "missing-value code", text)


def _missing(name: str, values: FloatArray, time: FloatArray, *, probed: bool) -> Iterator[Finding]:
    """Yield missing values; trouble where they are more than a fifth, but between the cycles of a touch probe."""
    gone = ~np.isfinite(values)
    count = int(gone.sum())
    if not count:
        return
    if count == len(values):
        yield Finding("trouble", name, "missing values", "has no value at all; leave the channel out")
        return
    if probed:
        text = f"has {len(values) - count} values in {len(values)} rows, as others have: probing cycles"
        yield Finding("info", name, "probed", f"{text}; models see only these rows")
        return
    starts, lengths = _runs(gone)
    starts, lengths = starts[gone[starts]], lengths[gone[starts]]
    longest = int(np.argmax(lengths))
    text = (
        f"{_count(count, 'value')} of {len(values)} ({count / len(values):.1%}) missing, at most {lengths[longest]} "
        f"in a row from {_at(int(starts[longest]), time)}; models skip these rows: mend the sensor if they are many"
    )
    yield Finding("trouble" if count > 0.2 * len(values) else "warning", name, "missing values", text)


def _spikes(channel: Channel, x: FloatArray, rows: IntArray, time: FloatArray, span: float) -> Iterator[Finding]:
    """Yield single values far outside their four neighbours (a Hampel filter that steps and kinks do not trip).

    Far is: over 8 robust standard deviations of a value against its neighbours, over the neighbours' own range, and
    over 2 % of the channel's span. Trouble where a spike is higher than that span.
    """
    padded = np.concatenate([x[[4, 3]], x, x[[-4, -5]]])  # the ends have their neighbours on one side
    around = np.sort(np.stack([padded[:-4], padded[1:-3], padded[3:-1], padded[4:]]), axis=0)
    low, high = around[0], around[3]
    off = np.abs(x - 0.5 * (around[1] + around[2]))
    scale = 1.4826 * float(np.median(off))
    if scale == 0 and off.any():  # steps coarser than the noise
        scale = float(np.median(off[off > 0]))
    height = np.maximum(x - high, low - x)
    hits = np.flatnonzero(height > np.maximum(high - low, max(8 * scale, 0.02 * span)))
    if not hits.size:
        return
    top = int(hits[np.argmax(height[hits])])
    text = (
        f"{_count(hits.size, 'spike')}, the highest by {height[top]:.3g} {channel.unit} at {_at(int(rows[top]), time)} "
        f"(usual noise {scale:.2g}); delete the values or look for a loose contact"
    )
    yield Finding("trouble" if height[top] > span else "warning", channel.name, "spike", text)


def _stuck(channel: Channel, x: FloatArray, rows: IntArray, time: FloatArray, step: float) -> Iterator[Finding]:
    """Yield stretches of 30 or more rows in which a value stands still though the sensor says it should move.

    It should if its noise shakes it right before and after, or if it was moving fast and stops dead. A sensor that
    creeps to rest, or whose noise is finer than its resolution, may well stand still: noise of a single step makes it a
    warning, and only over a tenth of the test.
    """
    starts, lengths = _runs(x)
    longest = [int(k) for k in np.argsort(lengths, kind="stable")[::-1][:20] if lengths[k] >= 30]
    reasons = {k: _why_stuck(x, int(starts[k]), int(lengths[k]), step) for k in longest}
    for severity in ("trouble", "warning"):
        hits = [k for k in longest if reasons[k] == severity]
        if not hits:
            continue
        k = hits[0]
        first, last = int(rows[starts[k]]), int(rows[starts[k] + lengths[k] - 1])
        more = f", one of {len(hits)} such stretches" if len(hits) > 1 else ""
        text = (
            f"stands still at {x[starts[k]]:.6g} {channel.unit} for {lengths[k]} rows, from {_at(first, time)} to "
            f"{_at(last, time)}{more}, while it moves from row to row right beside; check the sensor, then delete the "
            "values or leave the channel out"
        )
        yield Finding(severity, channel.name, "stuck", text)


def _why_stuck(x: FloatArray, start: int, length: int, step: float) -> Severity | None:
    """Judge one standing stretch of `length` rows by the 50 rows on each side of it."""
    before, after = x[max(start - 50, 0) : start + 1], x[start + length - 1 : start + length + 50]
    sides = [np.diff(side) for side in (before, after) if len(side) > 30]
    if not sides:
        return "trouble" if length > 0.9 * len(x) else None
    noisy, fine = True, True
    for moves in sides:
        real = moves[moves != 0]
        drifting = real - np.median(real) if real.size else real
        # noise on a slope does not turn the signal, but the moves go up and down by more than rounding explains
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
    """Return the smallest step of a channel that is not constant, rounding errors apart."""
    moves = np.diff(x)
    steps = np.abs(np.concatenate([moves, np.diff(moves)]))
    return float(steps[steps > 1e-9 * np.abs(x).max()].min(initial=np.ptp(x)))


def _runs(x: NDArray[np.generic]) -> tuple[IntArray, IntArray]:
    """Return start and length of each stretch of equal values."""
    starts = np.concatenate([[0], np.flatnonzero(x[1:] != x[:-1]) + 1])
    return starts, np.diff(starts, append=len(x))


def _at(row: int, time: FloatArray) -> str:
    return f"row {row} ({time[row]:.10g} s)"


def _count(n: int, what: str) -> str:
    return f"{n} {what}{'' if n == 1 else 's'}"
