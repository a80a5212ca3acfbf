"""Implausible units, and displacements that do not start at their zero."""

from collections.abc import Iterator, Sequence

import numpy as np

from thermocomp.core.messages import Message
from thermocomp.recordings.checks.findings import Finding, Severity, Signal, column
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.starts import NEAR, find_zeroing, is_far, level, turns

_ABSOLUTE = 273.15


#: a larger displacement in a whole test cannot be drift [um]
FAR = 5000.0


def temperature_units(signals: Sequence[Signal]) -> Iterator[Finding]:
    """Yield findings on temperatures in Kelvin or degrees Fahrenheit although the heading specifies degC.

    Kelvin: 98 % of the values lie between 240 and 400; as degC, the sensor would never cool below 240 degC, which is
    hotter than any part of a machine remains. Fahrenheit: no value in the whole test is below 50 (1 % quantile of every
    sensor that is not Kelvin), but no hall is at 50 degC; 50 degF are 10 degC, so that the error is not detected in a
    colder hall. A single sensor is reported if it is always warmer than all others ever are, if as degF it lies between
    the lowest value of the others less 3 degC and their highest plus 5 degC, and if it moves with one of them (rank
    correlation over 0.7), unlike a part that is kept hot.
    """
    ranges = {s.channel.name: np.quantile(s.x, (0.01, 0.99)) for s in signals if len(s.x) >= 5}
    known = [s for s in signals if s.channel.name in ranges]
    kelvin = [s for s in known if ranges[s.channel.name][0] >= 240 and ranges[s.channel.name][1] <= 400]
    for s in kelvin:
        low, high = (float(v) for v in ranges[s.channel.name])
        yield _wrong_unit(s, low, high, "K", low - _ABSOLUTE)
    rest = [s for s in known if s not in kelvin]
    warm = [s for s in rest if ranges[s.channel.name][0] >= 50]
    others = [s for s in rest if s not in warm]
    for s in warm:
        low, high = (float(v) for v in ranges[s.channel.name])
        if not others or _follows(s, others):
            yield _wrong_unit(s, low, high, "degF", (low - 32) / 1.8)


def _follows(signal: Signal, others: Sequence[Signal]) -> bool:
    """Return whether a warm sensor, read as degF, behaves like the others."""
    converted = (signal.x - 32) / 1.8
    low = min(float(s.x.min()) for s in others)
    high = max(float(s.x.max()) for s in others)
    if signal.x.min() <= high or converted.min() < low - 3 or converted.max() > high + 5:
        return False
    return any(_rank_correlation(signal, s) > 0.7 for s in others)


def _rank_correlation(a: Signal, b: Signal) -> float:
    both = a.good & b.good
    if both.sum() < 10:
        return 0.0
    x, y = (s.values[both].argsort().argsort().astype(np.float64) for s in (a, b))
    return float(np.corrcoef(x, y)[0, 1])


def _wrong_unit(signal: Signal, low: float, high: float, unit: str, coldest: float) -> Finding:
    text = Message(
        "lies between {low:.4g} and {high:.4g} degC all the time, which is implausible for a machine; read in {unit}, "
        "its lowest value would be {coldest:.1f} degC. If the values are in {unit}, state it in a mapping: "
        'unit = "{unit}"',
        low=low,
        high=high,
        unit=unit,
        coldest=coldest,
    )
    return Finding("trouble", signal.channel.name, "unit", text, remedy=column(signal.channel.name, unit=unit))


def displacement_units(signals: Sequence[Signal], temperatures: Sequence[Signal]) -> Iterator[Finding]:
    """Yield findings on displacements in mm although the heading specifies um, or in um although it specifies mm.

    No machine drifts by `FAR`.

    A probe with values within 0.3 um in the whole test, including noise, is implausibly quiet, and 0.3 mm exceeds the
    drift of any machine. If the probe with the largest range moves by less than 0.05 um per degC of the sensor with the
    largest range, all probes are reported: 100 mm of steel grow by 1.1 um per degC. This is only a warning where no
    temperature changes by 1 degC, because a machine at rest may move as little.
    """
    spans = {s.channel.name: s.span for s in signals if len(s.x) >= 5}
    moving = {s.channel.name: width for s in signals if s.channel.name in spans and (width := float(np.ptp(s.x))) > 0}
    if not moving:
        return
    warming = max((t.span for t in temperatures if len(t.x) >= 5), default=np.inf)
    largest = max(spans.values(), default=0.0)
    all_of_them = np.isfinite(warming) and warming >= 1 and largest < 0.05 * warming
    for name, width in moving.items():
        if width > FAR:
            text = Message(
                "changes by {change:.3g} mm in the whole test, more than any machine drifts. Are the values in um or "
                'nm? Then state it in a mapping: unit = "um"',
                change=width / 1000,
            )
            yield Finding("trouble", name, "unit", text, remedy=column(name, unit="um"))
        if width >= 0.3 and not all_of_them:
            continue
        against = (
            Message(" while a temperature changes by {warming:.3g} degC", warming=warming)
            if np.isfinite(warming)
            else ""
        )
        text = Message(
            "changes by {change:.2g} um in the whole test{against}, less than any probe at a machine. Are the values "
            'in mm? Then state it in a mapping: unit = "mm"; otherwise the probe is not in contact',
            change=width,
            against=against,
        )
        severity: Severity = "trouble" if warming >= 1 else "warning"
        yield Finding(severity, name, "unit", text, remedy=column(name, unit="mm"))


def zeros(recording: Recording, signals: Sequence[Signal]) -> Iterator[Finding]:
    """Yield findings on displacements and tilts with an offset at the start: continued recording, or probe not zeroed.

    `thermocomp.recordings.starts.is_far` judges it, as for a model. This is a warning: the numbers are valid, but
    models are relative to zero. So is a spindle that turns in the first row if a displacement has moved by then;
    otherwise it is only reported.
    """
    zeroing = find_zeroing(recording)
    moved = [s.channel.name for s in signals if abs(level(recording, s.channel.name, zeroing)) > NEAR]
    if signals and turns(recording, zeroing):
        already = (
            Message(
                ", where {names} has already moved" if len(moved) == 1 else ", where {names} have already moved",
                names=", ".join(moved),
            )
            if moved
            else ""
        )
        text = Message(
            "turns in the first row{moved}: unless it was started at that moment, the zero was not taken at rest; "
            "record from the standstill on, or state what went before with --start",
            moved=already,
        )
        severity: Severity = "warning" if moved else "info"
        yield Finding(severity, zeroing.speed, "turning start", text, row=0)
    for s in signals:
        if len(s.x) >= 3 and np.ptp(s.x) and is_far(recording, s.channel.name, zeroing):
            unit, start = s.channel.unit, level(recording, s.channel.name, zeroing)
            text = Message(
                "starts at {start:.3g} {unit}, not near zero; models assume a probe zeroed at the start. If the test "
                "continues another one, join the two files; otherwise take its first value as zero, in a mapping: "
                'zero = "first"',
                start=start,
                unit=unit,
            )
            row = int(s.rows[0])
            zeroed = {"do": "rezero", "channels": [s.channel.name], "at": float(recording.time[row]), "to": 0.0}
            yield Finding("warning", s.channel.name, "not zeroed", text, row=row, remedy={"clean": [zeroed]})
