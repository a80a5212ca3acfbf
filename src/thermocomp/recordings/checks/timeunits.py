"""Times in an implausible unit: a test that is too slow or too fast for the heat of a machine."""

from collections.abc import Iterator, Sequence

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.exceptions import Remedy
from thermocomp.core.messages import Message, join
from thermocomp.core.units import find_unit
from thermocomp.recordings.checks.findings import Finding, Severity, Signal

#: units that a file may mean, by their length [s]
_SCALES = {unit: find_unit(unit, "time").scale for unit in ("ms", "s", "min", "h", "d")}
#: usual interval of a thermal test [s]: of several plausible units, the one whose interval is nearest is likely
_USUAL = 30.0
#: no warm-up is recorded at longer intervals, and few sensors take longer for half of their range [s]
_SPARSE, _SLOW = 3600.0, 86400.0
#: shorter intervals suit only fast recordings [s]; these take minutes
_DENSE, _BRIEF = 0.5, 60.0
#: no part of a machine moves by half of its range within this time [s], and no test is shorter than the last [s]
_QUICK, _NONE = 5.0, 1.0


def time_unit(time: FloatArray, temperatures: Sequence[Signal], unit: str = "s") -> Iterator[Finding]:
    """Yield a finding on times whose unit must be another one than the file states.

    Too slow: intervals of over an hour (median) do not resolve a warm-up and are not used in practice. If intervals of
    one or two seconds are read as 17 or 33 min, the sensors reveal it: the shortest time in which a temperature moves
    by half its span is minutes to hours on a machine. Over a day for three quarters of the sensors is trouble.

    Too fast: intervals under 0.5 s and either a total of under a minute or three quarters of the sensors that move by
    half their span in under 5 s. It is a warning where no temperature moves and the total is at least a second.
    A recording at 10 Hz or 1 kHz over minutes is not reported.

    Sensors that change by less than 1 degC, or less than 10 times their noise, are ignored; if none is left, ms are
    detected only at intervals of over 3.6 s. Minutes called seconds give plausible times and are not detected.

    Parameters
    ----------
    time : ndarray of shape (n_rows,)
        [s]
    unit : str
        Unit stated in the file, or ``timestamp``; empty: a mapping states it, and the finding is a warning.
    """
    if len(time) < 10:
        return
    interval, total = float(np.median(np.diff(time))), float(time[-1] - time[0])
    dense, long = interval < _DENSE, total > _SLOW and interval <= _SPARSE
    moves = (
        [t for s in temperatures if (t := _half_span_time(s, time, smooth=dense)) is not None] if dense or long else []
    )
    severity: Severity = "trouble"
    if interval > _SPARSE:
        told = Message(
            "rows are {interval:.6g} s ({hours:.3g} h) apart: no warm-up is as slow",
            interval=interval,
            hours=interval / 3600,
        )
    elif long and moves and (fastest := float(np.quantile(moves, 0.25))) > _SLOW:
        told = Message(
            "most temperatures take over {days:.3g} days for half of their range: no warm-up is as slow",
            days=fastest / 86400,
        )
    elif dense and moves and (slowest := float(np.quantile(moves, 0.75))) < _QUICK:
        told = Message(
            "rows are {interval:.2g} s apart, and most temperatures pass half of their range in {time:.2g} s: no "
            "machine is as fast",
            interval=interval,
            time=slowest,
        )
    elif dense and total < _BRIEF:
        told = Message("rows are {interval:.2g} s apart: no thermal test is as short", interval=interval)
        severity = "trouble" if moves or total < _NONE else "warning"
    else:
        return
    ways = _likely_units(interval, total, unit)
    yield Finding(
        severity=severity if unit else "warning",
        channel="",
        kind="time unit",
        text=Message(
            "the test would last {duration}, and {reason}. {advice}",
            duration=_duration(total),
            reason=told,
            advice=_advice(ways, total, unit),
        ),
        remedy={"time": {"unit": (*ways, unit)[0]}} if unit in _SCALES else None,
    )


def confirm(unit: str) -> Remedy:
    """Return the mapping entry that confirms the unit stated in the file."""
    return {"time": {"unit": unit}}


def _likely_units(interval: float, total: float, unit: str) -> list[str]:
    """Return the other units in which the times of a file are plausible, most likely first."""
    if unit not in _SCALES:
        return []
    factors = {u: scale / _SCALES[unit] for u, scale in _SCALES.items() if u != unit}
    fitting = [u for u, f in factors.items() if 0.05 <= interval * f <= _SPARSE and total * f >= _BRIEF]
    slow = interval >= _DENSE
    fitting = [u for u in fitting if (factors[u] < 1) == slow]
    return sorted(fitting, key=lambda u: abs(float(np.log(interval * factors[u] / _USUAL))))


def _advice(ways: Sequence[str], total: float, unit: str) -> Message:
    if not unit:
        return Message("Check how the mapping states the times")
    if unit not in _SCALES:
        return Message("Check how the file states the times")
    if not ways:
        return Message('If {unit} is the right unit, confirm it in a mapping: [time] unit = "{unit}"', unit=unit)
    lasted = [_duration(total * _SCALES[u] / _SCALES[unit]) for u in ways]
    each = [
        Message("{unit} (then it lasted {duration})", unit=u, duration=d) for u, d in zip(ways, lasted, strict=True)
    ]
    return Message(
        'Are the times {others}? Then state it in a mapping: [time] unit = "{other}"; if {unit} is right, confirm it '
        'there: unit = "{unit}"',
        others=join(each, Message(" or ")),
        other=ways[0],
        unit=unit,
    )


def _duration(seconds: float) -> Message:
    """Return a duration as text, in a readable unit."""
    if seconds < 1000:
        return Message("{seconds:.3g} s", seconds=seconds)
    if seconds < 100 * 3600:
        return Message("{hours:.2f} h", hours=seconds / 3600)
    return Message("{hours:.2f} h ({days:.4g} days)", hours=seconds / 3600, days=seconds / 86400)


def _half_span_time(signal: Signal, time: FloatArray, *, smooth: bool) -> float | None:
    """Return the shortest time in which a signal moves by half its span [s]; None if it does not move enough.

    Smooth: of many rows some differ by half the span by their noise alone.
    """
    x, t = signal.smooth if smooth else signal.x, time[signal.good]
    if len(x) < 10:
        return None
    span = signal.span
    if span < max(1.0, 10 * signal.noise):
        return None
    for rows in np.unique(np.geomspace(1, len(x) - 1, 60).astype(int)):
        moved = np.abs(x[rows:] - x[:-rows]) >= 0.5 * span
        if moved.any():
            return float((t[rows:] - t[:-rows])[moved].min())
    return None
