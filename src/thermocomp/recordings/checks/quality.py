"""Data-quality problems: gaps, dead, stuck and spiking sensors, error codes, wrong units, steps, swaps, clocks."""

from collections.abc import Iterator, Sequence

import numpy as np

from thermocomp.core.arrays import BoolArray, FloatArray, IntArray
from thermocomp.core.machine import Channel
from thermocomp.core.messages import Message
from thermocomp.recordings.checks import suspects
from thermocomp.recordings.checks.clocks import clocks
from thermocomp.recordings.checks.findings import (
    SEVERITIES,
    Finding,
    Severity,
    Signal,
    at_row,
    column,
    cut_out,
    runs,
    speed_changes,
)
from thermocomp.recordings.checks.jumps import jumps
from thermocomp.recordings.checks.leaks import leaks
from thermocomp.recordings.checks.spikes import spikes
from thermocomp.recordings.checks.stuck import stuck
from thermocomp.recordings.checks.timeunits import time_unit
from thermocomp.recordings.compensated import UNKNOWN
from thermocomp.recordings.cycles import SPLITS
from thermocomp.recordings.recording import Recording

__all__ = ["Finding", "Severity", "check", "lasting_trouble", "troubled_rows"]

#: numbers that instruments write in place of a missing value
CODES = (-9999.0, -999.0, 9999.0, 99999.0, -99999.0, -32768.0, 32767.0, 1e30, -1e30)
#: the same for temperatures [degC]: absent thermistor, 0 K, DS18B20 unplugged and just switched on, open thermocouple
TEMPERATURE_CODES = (-180.0, -273.15, -200.0, -127.0, 85.0, 850.0)
#: plausible range on a machine tool [degC], [um], [urad]; wide for angles, which may be rotary axis positions
PLAUSIBLE = {"temperature": (-60.0, 400.0), "displacement": (-1e5, 1e5), "angle": (-1e9, 1e9)}
#: fewest intervals that resampling may leave
_FEWEST = 20
#: quantities whose sensor noise prevents constant values; a spindle speed or a position may be constant
_SENSED = ("temperature", "displacement", "angle")


def check(recording: Recording) -> tuple[Finding, ...]:
    """Check a recording for problems that make it unsuitable for a model.

    Notes
    -----
    Thresholds are set such that a sound recording of a real machine causes no trouble; the docstring of each check
    specifies its thresholds.
    """
    time = recording.time
    found = [Finding("warning", "", "left out", note) for note in recording.notes if note.startswith("left out")]
    if recording.compensation == "unknown":
        found.append(Finding("trouble", "", "compensation", UNKNOWN))
    found += [*_sampling(time), *_no_cycle(recording), *_duplicates(recording)]
    speed = None
    if recording.speed is not None:  # larger values are not speeds, and their squares would overflow
        speed = np.clip(np.nan_to_num(recording.table[recording.speed.name].to_numpy(dtype=np.float64)), -1e9, 1e9)
    moved = speed_changes(speed, len(time))
    probed = _probed(recording)
    signals = []
    for channel in recording.channels:
        values = recording.table[channel.name].to_numpy(dtype=np.float64)
        signal, mine = _channel(channel, values, time, moved, probed=channel.name in probed)
        found += mine
        signals.append(signal)
    found += suspects.zeros(recording, [s for s in signals if s.channel.quantity in ("displacement", "angle")])
    found += _together(signals, time, moved, speed)
    if not recording.start:  # times from stamps have no unit
        found += time_unit(time, [s for s in signals if s.channel.quantity == "temperature"], recording.time_unit)
    return tuple(sorted(found, key=lambda f: SEVERITIES.index(f.severity)))


def troubled_rows(recording: Recording, findings: Sequence[Finding] | None = None) -> dict[str, BoolArray]:
    """Return the rows in which a channel is faulty while its other rows are sound.

    Parameters
    ----------
    findings : sequence of Finding, optional
        Result of `check`. Default: `check` is called.

    Returns
    -------
    dict of str to ndarray of bool of shape (n_rows,)
        By channel name; only channels with such rows: spikes, error codes, implausible values, stuck values, the
        section between a step and its reversal, and a temperature from its step on. See `lasting_trouble` for other
        troubles.
    """
    rows: dict[str, BoolArray] = {}
    for f in check(recording) if findings is None else findings:
        if f.severity == "trouble" and f.rows is not None:
            rows.setdefault(f.channel, np.zeros(len(recording), dtype=np.bool_))[f.rows] = True
    return rows


def lasting_trouble(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """Return troubles of a whole channel or recording: units, swaps, clocks, dead sensors, steps of a probe."""
    return tuple(f for f in findings if f.severity == "trouble" and f.rows is None)


def _together(
    signals: Sequence[Signal], time: FloatArray, moved: BoolArray, speed: FloatArray | None
) -> Iterator[Finding]:
    """Yield joint findings of several channels, or of a channel and the clock."""
    of = {q: [s for s in signals if s.channel.quantity == q and s.good.any()] for q in _SENSED}
    yield from suspects.temperature_units(of["temperature"])
    yield from suspects.displacement_units(of["displacement"], of["temperature"])
    whole = [s for s in signals if not s.probed and s.channel.quantity in _SENSED]
    leaps = list(jumps(whole, time, moved))
    yield from leaps
    yield from leaks(of["temperature"], of["displacement"], moved)
    leaping = {f.channel for f in leaps}  # the effect of such a step on the regression is undefined
    yield from clocks([s for s in signals if s.channel.name not in leaping], time, speed)


def _duplicates(recording: Recording) -> Iterator[Finding]:
    prints: dict[int, str] = {}
    for channel in recording.channels:
        values = recording.table[channel.name].to_numpy(dtype=np.float64)
        if np.nanmax(values, initial=-np.inf) > np.nanmin(values, initial=np.inf):  # constants are reported separately
            other = prints.setdefault(hash(values.tobytes()), channel.name)
            if other != channel.name:
                text = Message("has the same value as {other} in every row; leave one of them out", other=other)
                gone = column(channel.name, role="ignore")
                yield Finding("warning", channel.name, "duplicate channel", text, remedy=gone)


def _probed(recording: Recording) -> set[str]:
    """Return the displacements measured in probing cycles: several channels have their few values in the same rows."""
    rows: dict[bytes, list[str]] = {}
    for channel in (*recording.displacements, *recording.of_quantity("residual")):
        there = np.isfinite(recording.table[channel.name].to_numpy(dtype=np.float64))
        if 1 < there.sum() < 0.5 * len(there):
            rows.setdefault(there.tobytes(), []).append(channel.name)
    return {name for names in rows.values() if len(names) > 1 for name in names}


def _channel(
    channel: Channel, values: FloatArray, time: FloatArray, moved: BoolArray, *, probed: bool
) -> tuple[Signal, list[Finding]]:
    """Return the sound values of a channel, and the findings for which no other channel is needed."""
    least, most = PLAUSIBLE.get(channel.quantity, (-np.inf, np.inf))
    plausible = (values >= least) & (values <= most)
    coded = _coded(channel, values, plausible)
    found = [_code_finding(channel, values, coded, time)] if coded.any() else []
    wild: IntArray = np.flatnonzero(np.isfinite(values) & ~plausible & ~coded)
    if wild.size:
        found.append(_wild_finding(channel, values, wild, time))
    found += _missing(channel.name, values, time, probed=probed)
    # the other checks use the remaining values: with such outliers nothing else would be detected
    signal = Signal(channel, values, np.isfinite(values) & plausible & ~coded, probed)
    x = signal.x
    if probed or len(x) < 2:
        return signal, found
    if x.min() == x.max():
        found.append(_constant_finding(channel, x))
    elif channel.quantity in _SENSED and len(x) >= 5:
        nearby = np.convolve(np.concatenate([moved, [False]]), np.ones(5), mode="same") > 0
        mine = [*spikes(signal, time, nearby), *stuck(signal, time)]
        found += mine
        gone = [f.rows for f in mine if f.rows is not None]
        signal = signal.without(np.concatenate(gone)) if gone else signal
    return signal, found


def _wild_finding(channel: Channel, values: FloatArray, wild: IntArray, time: FloatArray) -> Finding:
    least, most = PLAUSIBLE[channel.quantity]
    row = int(wild[np.argmax(np.abs(values[wild]))])
    text = Message(
        "{n} of {of} values outside {least:g} to {most:g} {unit}, the most extreme {value:g} at {row}: implausible for "
        "a machine; check unit, scale, zero and sensor",
        n=wild.size,
        of=len(values),
        least=least,
        most=most,
        unit=channel.unit,
        value=float(values[row]),
        row=at_row(row, time),
    )
    if wild.size == np.isfinite(values).sum():
        return Finding("trouble", channel.name, "implausible", text)
    return cut_out("trouble", channel, "implausible", text, wild, time)


def _constant_finding(channel: Channel, x: FloatArray) -> Finding:
    sensed = channel.quantity in _SENSED
    text = Message(
        "is {value:g} {unit} in all {n} rows; check whether the sensor is connected, or leave the channel out"
        if sensed
        else "is {value:g} {unit} in all {n} rows; a constant channel is of no use to a model",
        value=float(x[0]),
        unit=channel.unit,
        n=len(x),
    )
    gone = column(channel.name, role="ignore")
    return Finding("trouble" if sensed else "info", channel.name, "constant", text, remedy=gone)


def _sampling(time: FloatArray) -> Iterator[Finding]:
    """Yield findings on too few rows, gaps, and irregular intervals.

    Too few: under 10. Gap: over 5 times the 90 % quantile of the intervals. Irregular: intervals vary by over 20 %.
    """
    if len(time) < 10:
        text = Message("too few rows to assess ({n}); record a whole warm-up and cool-down", n=len(time))
        yield Finding("warning", "", "short", text)
    if len(time) < 3:
        return
    steps = np.diff(time)
    # the 90 % quantile, not the median: bursts of probing are irregular, but not a series of gaps
    usual = float(np.quantile(steps, 0.9, method="lower"))
    gaps = np.flatnonzero(steps > 5 * usual)
    if gaps.size:
        longest = int(gaps[np.argmax(steps[gaps])])
        text = Message(
            "{gaps} {gap:.6g} s after {row}, where rows are {usual:g} s apart; the state of a model with a memory is "
            "uncertain after it: split the test there or record it again",
            gaps=Message("{n} gaps in time, the longest", n=gaps.size) if gaps.size > 1 else Message("1 gap in time,"),
            gap=float(steps[longest]),
            row=at_row(longest, time),
            usual=usual,
        )
        yield Finding("warning", "", "gap", text, row=longest)
    kept = steps[steps <= 5 * usual]
    low, middle, high = (float(q) for q in np.quantile(kept, (0.05, 0.5, 0.95)))
    if high - low > 0.2 * middle:
        text = Message(
            "rows are {low:.4g} to {high:.4g} s apart (median {middle:.4g} s); resample for methods that require a "
            "constant interval",
            low=low,
            high=high,
            middle=middle,
        )
        # long enough for a row in every interval
        every = float(np.ceil(kept.max()))
        even = {"clean": [{"do": "resample", "every_s": every}]} if time[-1] - time[0] >= _FEWEST * every else None
        yield Finding("warning", "", "irregular sampling", text, remedy=even)


def _no_cycle(recording: Recording) -> Iterator[Finding]:
    if len(recording.cycles) > 1:
        return
    why = Message("there is no spindle speed and no column 'cycle'")
    if recording.speed is not None:
        speed = np.abs(np.nan_to_num(recording.table[recording.speed.name].to_numpy(dtype=np.float64)))
        runs = int(np.count_nonzero(np.diff(speed > 0.02 * speed.max(initial=0.0), prepend=False)) + 1) // 2
        why = Message("the spindle does not start again")
        if runs > 1:
            why = Message(
                "none of the {n} spindle starts follows a standstill of at least {time:.0f} s and precedes a run of at "
                "least {time:.0f} s (are the times in minutes or hours? Then state the unit in a mapping: [time] unit)",
                n=runs,
                time=SPLITS,
            )
    text = Message(
        "the whole test is one thermal cycle, as {reason}; judging on unseen cycles needs several cycles or several "
        "tests",
        reason=why,
    )
    yield Finding("info", "", "no cycle", text)


def _coded(channel: Channel, values: FloatArray, plausible: BoolArray) -> BoolArray:
    """Return the rows with an error code that differs from all other values by half their span and by 5 or more."""
    none = np.zeros(len(values), dtype=np.bool_)
    if channel.quantity not in _SENSED:
        return none
    codes = CODES + (TEMPERATURE_CODES if channel.quantity == "temperature" else ())
    # a unit conversion may have rounded a code
    hits = {c: np.abs(values - c) <= 1e-9 * abs(c) for c in codes}
    hits = {c: hit for c, hit in hits.items() if hit.any()}
    rest = values[plausible & ~np.logical_or.reduce([none, *hits.values()])]
    if rest.size:
        low, high = float(rest.min()), float(rest.max())
        margin = max(0.5 * (high - low), 5.0)
        hits = {c: hit for c, hit in hits.items() if not low - margin <= c <= high + margin}
    found: BoolArray = np.logical_or.reduce([none, *hits.values()])
    return found


def _code_finding(channel: Channel, values: FloatArray, coded: BoolArray, time: FloatArray) -> Finding:
    codes = ", ".join(f"{c:g}" for c in np.unique(values[coded]))
    first = int(np.flatnonzero(coded)[0])
    every = coded.sum() == np.isfinite(values).sum()
    if every:
        text = Message(
            "is {codes} in every row, a value that loggers write for a missing reading: no sensor is connected; leave "
            "the channel out, or declare the value in a mapping, missing = [{codes}]",
            codes=codes,
        )
    else:
        text = Message(
            "{n} of {of} values, the first at {row}, are {codes}, a value that loggers write for a missing reading; "
            "declare it in a mapping, missing = [{codes}]",
            n=int(coded.sum()),
            of=len(values),
            row=at_row(first, time),
            codes=codes,
        )
    rows = None if every else np.flatnonzero(coded)
    said = {"role": "ignore"} if every else {"missing": np.unique(values[coded]).tolist()}
    mark, kind = column(channel.name, **said), "missing-value code"
    return Finding(severity="trouble", channel=channel.name, kind=kind, text=text, rows=rows, remedy=mark)


def _missing(name: str, values: FloatArray, time: FloatArray, *, probed: bool) -> Iterator[Finding]:
    """Yield findings on missing values; trouble if over a fifth, except between the cycles of a touch probe."""
    gone = ~np.isfinite(values)
    n = int(gone.sum())
    if not n:
        return
    if n == len(values):
        text = Message("has no value at all; leave the channel out")
        yield Finding("trouble", name, "missing values", text, remedy=column(name, role="ignore"))
        return
    if probed:
        text = Message(
            "has values in only {n} of {of} rows, the same rows as other displacements: measured by probing cycles; "
            "models see only these rows",
            n=len(values) - n,
            of=len(values),
        )
        yield Finding("info", name, "probed", text)
        return
    starts, lengths = runs(gone)
    starts, lengths = starts[gone[starts]], lengths[gone[starts]]
    longest = int(np.argmax(lengths))
    text = Message(
        "{n} of {of} values ({share:.1%}) missing, at most {most} consecutively, from {row}; models skip these rows: "
        "repair the sensor if there are many",
        n=n,
        of=len(values),
        share=n / len(values),
        most=int(lengths[longest]),
        row=at_row(int(starts[longest]), time),
    )
    yield Finding("trouble" if n > 0.2 * len(values) else "warning", name, "missing values", text)
