"""Thermal tests according to ISO 230-3: environment, rotating spindle, moving linear axis; with and without a model.

The text of ISO 230-3:2020 was not available. Taken from the standard, as quoted in the literature: the three tests (its
fourth, for rotary motion, is not implemented), the name ETVE, the probes X1, Y1, Z at the tip of the test bar and X2,
Y2 nearer to the spindle, the tilts A and B from their differences, the statement of the probe distance, and ranges over
the first 60 min and over the whole period. All other names and symbols (``range_60``, ``at_60``, ``t90`` ...) and the
exact limits of each period are specific to this package and defined for each quantity.
"""

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError
from thermocomp.core.machine import Channel
from thermocomp.core.model import ErrorModel
from thermocomp.iso230.compensated import replay_models
from thermocomp.iso230.thermaltest import HOUR, Kind, Pair, Targets, ThermalCurve, ThermalTest, evaluate_averaged_curve
from thermocomp.judging.settling.averaging import WINDOW, average_test
from thermocomp.judging.settling.settling import Phase, find_driven_rows, find_phases, settle
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.starts import Start

_PAIR = re.compile(r"([xy])([12])", re.IGNORECASE)
# EXX_0, EYX_z600_100: error of an axis at a station (ISO 230-1 code)
_STATION = re.compile(r"(E[XYZABC][XYZ])(?:_\w+)?_-?\d+(?:\.\d+)?")
#: largest change in the last 60 min, relative to the first, for a spindle test to end before 4 h (from memory)
CALM = 0.15
_TARGET = re.compile(r"(([xyz])(?:_[a-z]+)*)_(-?\d+(?:\.\d+)?)", re.IGNORECASE)


def detect(recording: Recording) -> Kind:
    """Return the type of test of a recording: spindle if the spindle turns, else axis if an axis moves, else ETVE."""
    turns = any(np.nan_to_num(recording.table[c.name]).any() for c in recording.of_quantity("spindle_speed"))
    feeds = any(np.nan_to_num(recording.table[c.name]).any() for c in recording.of_quantity("feed"))
    return "spindle" if turns else "axis" if feeds else "etve"


def find_pairs(recording: Recording, distance: float) -> tuple[Pair, ...]:
    """Return the probes named x1 and x2, y1 and y2 as pairs, `distance` [mm] apart."""
    named = paired_names(recording)
    return tuple(Pair(named[a, 1], named[a, 2], distance) for a in "yx" if (a, 1) in named and (a, 2) in named)


def paired_names(recording: Recording) -> dict[tuple[str, int], str]:
    """Return the displacement channels named x1, x2, y1 or y2, by letter and number."""
    found = {}
    for c in recording.displacements:
        named = _PAIR.fullmatch(_base(c))
        if named:
            found[named[1].lower(), int(named[2])] = c.name
    return found


def find_probe(recording: Recording, name: str) -> str:
    """Return the full channel name of a displacement; ``y1`` is accepted for ``y1_um``."""
    short = [c for c in recording.displacements if _base(c) == name]
    channel = short[0] if short else recording.channel(name)
    if channel.quantity != "displacement":
        raise InputError(f"{recording.name}: {channel.name} is a {channel.quantity}; probes measure displacements")
    return channel.name


def find_stations(recording: Recording) -> dict[str, str]:
    """Return the error code by channel name of the stations of error profiles, such as ``EXX_300``."""
    measured = (c for c in recording.channels if c.quantity in ("displacement", "angle"))
    return {c.name: named[1] for c in measured if (named := _STATION.fullmatch(_base(c)))}


def assess(
    recording: Recording,
    kind: Kind | None = None,
    *,
    pairs: Sequence[Pair] = (),
    ambient: str | None = None,
    models: Sequence[ErrorModel] = (),
    start: Start | None = None,
    limits: Limits = Limits(),
) -> tuple[ThermalTest, ...]:
    """Evaluate the thermal tests in a recording.

    A test begins when the drives start (one row earlier, in its initial state) and continues until they start again; an
    ETVE test is the whole recording. Stops shorter than 20 min, as in a speed spectrum, do not end it.

    Parameters
    ----------
    kind : {'etve', 'spindle', 'axis'}, optional
        Type of test. Default: determined by `detect`.
    ambient : str, optional
        Channel of the ambient temperature. Default: `Recording.ambient`.
    start : Start, optional
        Initial state of the recording. Default: determined from the recording.
    """
    kind = detect(recording) if kind is None else kind
    if not _probes(recording):
        stations = find_stations(recording)
        raise InputError(
            f"{recording.name}: there is no displacement; a thermal test needs at least one probe"
            + (f" ({_stations_words(stations)})" if stations else "")
        )
    if len(recording) < 2:
        raise InputError(f"{recording.name}: the recording has only one row; a thermal test needs at least two")
    air = recording.channel(ambient) if ambient is not None else recording.ambient
    if air is not None and air.quantity != "temperature":
        raise InputError(f"{recording.name}: {air.name} is a {air.quantity}; the ambient channel is a temperature")
    pairs = tuple(replace(p, tip=find_probe(recording, p.tip), spindle=find_probe(recording, p.spindle)) for p in pairs)
    residuals, notes = replay_models(recording, models, start, limits)
    notes += _about(recording, kind, pairs, air)
    phases = find_phases(recording) if kind != "etve" else ()
    starts = [k for k, p in enumerate(phases) if p.kind == "warm-up"]
    if not starts:
        whole = Phase("warm-up", 1, 0, len(recording) - 1)
        if kind != "etve":
            notes.append(
                "no row in which the drives start is recorded: the whole recording counts as warm-up; record the "
                f"{'spindle speed' if kind == 'spindle' else 'feed rate'}"
            )
        phases, starts = (whole,), [0]
    tests = []
    for number, k in enumerate(starts, start=1):
        warm = phases[k]
        cool = phases[k + 1] if k + 1 < len(phases) else None
        rows = (warm.start, warm.end, cool.end if cool is not None else warm.end)
        name = f"{recording.name}, {number}" if len(starts) > 1 else recording.name
        lead = _lead(recording, phases[k - 1].start if k else 0, warm.start)
        more = [*notes, *_about_rows(recording, kind, rows, number, lead)]
        part = _Stretch(recording=recording, kind=kind, rows=rows, lead=lead, rests=k == 0, warm=warm)
        tests.append(_evaluate(part, name, pairs, air, residuals, more))
    return tuple(tests)


class _Stretch(NamedTuple):
    """Rows of one test, and the rest period before it."""

    recording: Recording
    kind: Kind
    rows: tuple[int, int, int]  #: first row, row of the stop of the drives, last row
    lead: int  #: number of preceding rows that define the initial state
    rests: bool  #: whether no drive ran before
    warm: Phase

    @property
    def part(self) -> slice:
        """Rows of the test, including the preceding rows that define its initial state."""
        return slice(self.rows[0] - self.lead, self.rows[2] + 1)

    def curve(self, label: str, unit: str, place: str, measured: FloatArray, left: FloatArray | None) -> ThermalCurve:
        """Return the characteristic values of one channel, and of its residual with a model."""
        start, stop, _ = self.rows
        lead, rests, calm = self.lead, self.rests, self.kind == "etve"
        clock = self.recording.time[self.part] - self.recording.time[start]
        time = clock[lead:]
        told, remains = (
            None if v is None else average_test(clock, v, lead, lead + stop - start, rests=rests, smooth=calm)
            for v in (measured, left)
        )
        assert told is not None
        values = measured[lead:] - told.zero.value
        after = None if left is None or remains is None else left[lead:] - remains.zero.value
        run = slice(0, lead + stop - start + 1)
        settled = None if calm else settle(clock[run], measured[run], label, unit, self.warm, lead=lead, rests=rests)
        return ThermalCurve(
            name=label,
            unit=unit,
            place=place,
            values=values,
            course=told,
            figures=evaluate_averaged_curve(time, told, values, stop - start),
            settling=settled,
            after=after,
            after_course=remains,
            after_figures=None
            if remains is None or after is None
            else evaluate_averaged_curve(time, remains, after, stop - start),
        )


def _evaluate(
    part: _Stretch,
    name: str,
    pairs: Sequence[Pair],
    air: Channel | None,
    residuals: dict[str, FloatArray],
    notes: list[str],
) -> ThermalTest:
    recording, kind, (start, stop, end) = part.recording, part.kind, part.rows
    channels = _probes(recording)
    measured = {c.name: recording.table[c.name].to_numpy(dtype=np.float64)[part.part] for c in channels}
    after = {n: v[part.part] for n, v in residuals.items()}
    drawn = {c.name: part.curve(c.name, c.unit, c.place, measured[c.name], after.get(c.name)) for c in channels}
    tilts = []
    for p in pairs:
        left = p.angle(after[p.tip], after[p.spindle]) if p.tip in after and p.spindle in after else None
        place = f"from {p.tip} and {p.spindle}, {p.distance:g} mm apart"
        tilts.append(part.curve(p.tilt, "urad", place, p.angle(measured[p.tip], measured[p.spindle]), left))
    targets = _lengths(part, measured, after, drawn) if kind == "axis" else []
    curves = (*drawn.values(), *tilts, *(t.length for t in targets))
    air_values = recording.table[air.name].to_numpy()[start : end + 1] if air is not None else np.full(1, np.nan)
    known = air_values[np.isfinite(air_values)]
    return ThermalTest(
        kind=kind,
        name=name,
        recording=recording,
        start=start,
        stop=stop,
        end=end,
        load=_load(recording, kind, start, stop),
        curves=tuple(drawn.values()),
        tilts=tuple(tilts),
        pairs=tuple(pairs),
        targets=tuple(targets),
        ambient=air,
        ambient_range=(float(known.min()), float(known.max())) if known.size else (float("nan"), float("nan")),
        notes=(*notes, *_about_curves(kind, curves, targets)),
    )


def _lengths(
    part: _Stretch, measured: dict[str, FloatArray], after: dict[str, FloatArray], drawn: dict[str, ThermalCurve]
) -> list[Targets]:
    """Return the targets of each axis with the length between the first and the last; they are removed from `drawn`."""
    targets = []
    for group, members in _target_groups(part.recording).items():
        ordered = sorted(members, key=lambda m: m[0])
        low, high = ordered[0], ordered[-1]
        ends = (low[1].name, high[1].name)
        left = after[ends[1]] - after[ends[0]] if all(n in after for n in ends) else None
        label = f"length {group.split('_')[0].upper()} {low[0]:g}-{high[0]:g} mm"
        length = part.curve(label, "um", f"{ends[1]} minus {ends[0]}", measured[ends[1]] - measured[ends[0]], left)
        positions = np.array([p for p, _ in ordered])
        curves = tuple(drawn.pop(c.name) for _, c in ordered)
        targets.append(Targets(name=group, axis=group[0].upper(), positions=positions, curves=curves, length=length))
    return targets


def _about_curves(kind: Kind, curves: Sequence[ThermalCurve], targets: Sequence[Targets]) -> list[str]:
    """Return notes on constant curves, on settling in a spindle test, and on ranges that increase with a model."""
    notes = []
    still = [c.name for c in curves if np.isfinite(c.values).any() and not c.course.noise.moves]
    if still:
        notes.append(
            f"{', '.join(still)}: the averages do not change by more than their noise; the range stated is that of the "
            "noise"
        )
    if kind == "spindle":
        notes += _about_the_end([c for c in curves if c.name not in still])
    for c in (*curves, *(c for t in targets for c in t.curves)):
        if c.after_figures is not None and c.after_figures.range_all > c.figures.range_all:
            grown = f"{c.figures.range_all:.3g} to {c.after_figures.range_all:.3g} {c.unit}"
            notes.append(f"{c.name}: with the model its range increases, from {grown}")
    return notes


def _about(recording: Recording, kind: Kind, pairs: Sequence[Pair], air: Channel | None) -> list[str]:
    """Return notes on missing data that the standard requires, and on data that do not match the type of test."""
    notes = []
    runs = detect(recording)
    if kind == "etve" and not (recording.speed or recording.of_quantity("feed")):
        notes.append("neither a spindle speed nor a feed was recorded: whether the machine was at rest is not known")
    elif runs == "spindle" and kind != "spindle":
        notes.append("the spindle turned in this test: its effect is included in the values")
    elif kind == "spindle" and runs != "spindle":
        notes.append("the recording shows no turning spindle: the values are not those of a spindle test")
    elif kind == "etve" and runs == "axis":
        notes.append("an axis moved in this test: the values are not those of the environment alone")
    named, used = paired_names(recording), {n for p in pairs for n in (p.tip, p.spindle)}
    untold = [f"{named[a, 1]} and {named[a, 2]}" for a in "xy" if {(a, 1), (a, 2)} <= named.keys()]
    if untold and not used:
        notes.append(f"no tilt is reported: the distance between the probes {', '.join(untold)} was not given")
    if stations := find_stations(recording):
        notes.append(_stations_words(stations))
    if air is None:
        notes.append("no ambient temperature was identified: name its channel (ambient)")
    if kind == "axis" and not _target_groups(recording):
        notes.append(
            "no channel contains the error at a target position of an axis: name the channels by axis and position, "
            "such as x_laser_0, x_laser_500"
        )
    return notes


def _probes(recording: Recording) -> list[Channel]:
    """Return the channels evaluated in a thermal test: displacements and angles, without stations of error profiles."""
    stations = find_stations(recording)
    return [c for c in recording.channels if c.quantity in ("displacement", "angle") and c.name not in stations]


def _stations_words(stations: dict[str, str]) -> str:
    codes = list(dict.fromkeys(stations.values()))
    shown = ", ".join(codes[:3]) + (" ..." if len(codes) > 3 else "")
    return (
        f"{len(stations)} channels are stations of error profiles ({shown}): they are not reported here; use "
        "thermocomp position and thermocomp volumetric for them"
    )


def _about_the_end(curves: Sequence[ThermalCurve]) -> list[str]:
    """Return the settling at the end of a spindle test, compared with the criterion of the standard."""
    shares = {c.name: c.figures.range_last / c.figures.range_60 for c in curves if c.figures.range_60 > 0}
    told = [f"{name} {100 * share:.0f} %" for name, share in shares.items() if np.isfinite(share)]
    if not told:
        return []
    calm = all(share <= CALM for share in shares.values() if np.isfinite(share))
    return [
        f"range of the last 60 min to that of the first: {', '.join(told)}; "
        + ("all are" if calm else "not all are")
        + f" within the {100 * CALM:.0f} % at which ISO 230-3 permits a spindle test to end before 4 h (not "
        "checked against the text of the standard)"
    ]


def _lead(recording: Recording, earliest: int, start: int) -> int:
    """Return the number of rows before the start of a test that define its initial state."""
    time = recording.time
    return start - earliest - int(np.searchsorted(time[earliest:start], time[start] - WINDOW))


def _about_rows(recording: Recording, kind: Kind, rows: tuple[int, int, int], number: int, lead: int) -> list[str]:
    """Return notes on the course of a test: too short, without cool-down, or without rest before it."""
    start, stop, end = rows
    notes = []
    running = recording.time[stop] - recording.time[start]
    if running < HOUR:
        notes.append(f"the test ran for only {running / 60:.0f} min: no values for the first 60 min are given")
    if kind == "etve":
        if (on := find_driven_rows(recording)) is not None and on.any():
            notes.append("the spindle or an axis moves: this is not a test of the environment alone")
        if running < 24 * HOUR * 0.99:
            notes.append(f"the test is {running / HOUR:.1f} h long; the environment varies with a period of one day")
    elif stop == end:
        notes.append("the cool-down was not recorded")
    if kind != "etve" and lead < 2:
        readings = "a single reading" if lead == 0 else "the first two readings"
        notes.append(
            f"almost no rest is recorded before the drives start: all values are relative to {readings} and contain "
            f"the noise of this reference; record {WINDOW / 60:.0f} min of rest"
        )
    if number > 1:
        notes.append("the machine had run before: it does not start from rest")
    return notes


def _load(recording: Recording, kind: Kind, start: int, stop: int) -> str:
    """Return the load of the spindle or the axis while it runs, as text."""
    if kind == "etve":
        return "machine at rest" if recording.of_quantity("spindle_speed") else "regarded as at rest"
    quantity, word = ("spindle_speed", "spindle at") if kind == "spindle" else ("feed", "feed of")
    channels = recording.of_quantity(quantity)
    values = np.abs(recording.values(channels)[start + 1 : stop + 1]) if channels else np.empty((0, 0))
    values = values[np.isfinite(values)]
    driven = values[values > 0.02 * values.max()] if values.size else values
    if not driven.size:
        return f"{'spindle speed' if kind == 'spindle' else 'feed rate'} not recorded"
    low, high = float(driven.min()), float(driven.max())
    if high - low <= 0.05 * high:
        return f"{word} {np.median(driven):.0f} {channels[0].unit}"
    return f"{word} {low:.0f} to {high:.0f} {channels[0].unit}, {driven.mean():.0f} on average while it moves"


def _target_groups(recording: Recording) -> dict[str, list[tuple[float, Channel]]]:
    """Return displacements named after positions, by the prefix of their names; at least two per prefix."""
    groups: dict[str, list[tuple[float, Channel]]] = {}
    for c in recording.displacements:
        named = _TARGET.fullmatch(_base(c))
        if named:
            groups.setdefault(named[1], []).append((float(named[3]), c))
    return {name: members for name, members in groups.items() if len(members) > 1}


def _base(channel: Channel) -> str:
    """Return a channel's name without its unit."""
    return re.sub(r"_(um|C|urad)$", "", channel.name)
