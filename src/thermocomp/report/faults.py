"""Failed sensors in recordings, their substitutes, and the loss of accuracy: figures, tables and their section."""

import math
from collections.abc import Iterator, Sequence
from datetime import datetime, timedelta

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from thermocomp.core.arrays import FloatArray
from thermocomp.core.correction import Limits
from thermocomp.core.shown import shorten
from thermocomp.core.starting import describe_offsets
from thermocomp.judging.assessing import Judged
from thermocomp.judging.faultlog import Cost, Fault, FaultLog, find_costs, find_faults
from thermocomp.recordings.recording import Recording
from thermocomp.report.drawing import Drawn, add_legend, drawing, name_ticks, svg
from thermocomp.report.figures import LETTERS, LONGEST, MEASURED, POINTS, PREDICTED, SHADE
from thermocomp.report.layout import Column, Layout
from thermocomp.report.sections import Section, Shown

#: colours by kind of failure
TINTS = {
    "missing": "#56B4E9",
    "stepped": "#D55E00",
    "stuck": "#CC79A7",
    "off": "#E69F00",
    "swapped": "#009E73",
    "unexplained": "#F0E442",
}
#: maximum number of sensors of a recording whose substitutes are drawn, and of failures in a table
MOST, ROWS = 6, 40
#: maximum number of failures of a recording shown on the terminal
TOLD = 8
#: distance from the substitute, beyond the range of the trusted values, from which readings are not drawn
AROUND = 5.0

TITLE = "Sensors"


def section(judged: Judged, recordings: Sequence[Recording]) -> Section:
    """Return the section of the page about failed sensors."""
    logs = find_faults(judged, recordings)
    begun: list[str | Layout | Shown] = [f"{name}: {describe_offsets(off)}." for name, off in judged.offsets.items()]
    if not logs:
        known = any(m.watch is not None for m in judged.models)
        why = (
            "the recordings lack channels that the watch (fault detection) needs"
            if known
            else "the model file contains no watch (fault detection); fit the model again"
        )
        return Section(TITLE, [f"Temperature sensors were not monitored for faults: {why}.", *begun])
    if not any(log.faults for log in logs):
        watched = list(dict.fromkeys(name for log in logs for name in log.watch.failing))
        return Section(TITLE, [f"None of the {len(watched)} sensors failed: {', '.join(watched)}.", *begun])
    parts: list[str | Layout | Shown] = [
        *begun,
        "The recordings were replayed as at the machine, where a fault takes effect until it is detected. Rows in "
        "which thermocomp check finds a fault are excluded from the verdict above, but not from this section.",
    ]
    for log in (log for log in logs if log.faults):
        recording = recordings[log.recording]
        parts.append(Shown(draw_timeline(log, recording), _timeline_words(log, logs)))
        parts.append(Shown(draw_stand_ins(log), _stand_in_words(log)))
        parts.append(_fault_table(log, recording))
    cautions = []
    for model, a in zip(judged.models, judged.overall(), strict=True):
        if costs := find_costs(model, a, logs):
            parts.append(_cost_table(f"{a.target}: loss of accuracy", model.unit, costs))
        cautions += [_held_words(a.target, model.unit, c) for c in costs if not c.runs_on]
    if cautions:
        limits = judged.overall()[0].limits or Limits()
        parts.append(
            "'Held, then fades': without these sensors the model was never judged, or does harm, or it remembers a "
            "speed from before it was found to be wrong. Its correction is "
            f"held for {limits.hold / 60:g} min, then decays to zero with a time constant of {limits.fade / 3600:g} h; "
            "the results here and above include this."
        )
    return Section(TITLE, parts, cautions)


def describe_faults(logs: Sequence[FaultLog], recordings: Sequence[Recording]) -> Iterator[str]:
    """Yield a line per failure found by a watch, for the first failures of each recording."""
    for log in logs:
        for f in log.faults[:TOLD]:
            recording = recordings[log.recording]
            until = f"to {_when(f.end, recording)}" if f.returned else "to the end"
            beside = f"; its reading minus its substitute value was {_beside(f)} on average" if _beside(f) else ""
            yield f"{log.name}: {f.sensor} {f.word} from {_when(f.begin, recording)} {until}{beside}"
        if len(log.faults) > TOLD:
            yield f"{log.name}: {len(log.faults) - TOLD} more failures are listed on the page that -o writes"


def _beside(fault: Fault) -> str:
    """Return the mean of the reading minus the substitute, with its unit; empty if the reading was missing."""
    decimals = 1 if fault.unit == "degC" else 0
    return f"{fault.beside:+.{decimals}f} {fault.unit}" if math.isfinite(fault.beside) else ""


def describe_held(judged: Judged, logs: Sequence[FaultLog]) -> Iterator[str]:
    """Yield the residual while a correction was held because of failures, one line per model and failure."""
    for model, a in zip(judged.models, judged.overall(), strict=True):
        yield from (_held_words(a.target, model.unit, c) for c in find_costs(model, a, logs) if not c.runs_on)


def _held_words(target: str, unit: str, cost: Cost) -> str:
    return (
        f"{target}: while {', '.join(cost.failed)} had failed, the machine would hold the correction, then fade it: "
        f"{cost.rms:.2f} {unit} RMS over {cost.hours:.1f} h."
    )


def draw_timeline(log: FaultLog, recording: Recording) -> Drawn:
    """Plot when and why each sensor was rejected, with the spindle speed above."""
    names, hours = log.watch.failing, log.time / 3600
    speed = recording.speed
    with drawing("timeline" + log.name):
        height = 0.26 * len(names)
        figure = Figure(figsize=(9.6, 1.3 + height + (0.7 if speed else 0.0)), layout="constrained")
        ratios = [0.7, height] if speed else [height]
        axes: list[Axes] = list(figure.subplots(len(ratios), 1, sharex=True, squeeze=False, height_ratios=ratios)[:, 0])
        if speed is not None:
            rows = slice(None, None, max(1, len(hours) // POINTS))
            turning = recording.table[speed.name].to_numpy()
            axes[0].plot(hours[rows], turning[rows], color=MEASURED, drawstyle="steps-post")
            axes[0].set_ylabel("1/min")
        ax = axes[-1]
        ax.grid(visible=False, axis="y")
        ax.set_axisbelow(True)
        for k in range(len(names)):
            ax.plot([hours[0], hours[-1]], [k, k], color="#c8c8c8", lw=1.0, zorder=1)
        room = float(hours[-1] - hours[0]) / LETTERS
        free: dict[str, float] = {}
        for f in log.faults:
            k, begin, end = names.index(f.sensor), f.begin / 3600, f.end / 3600
            ax.broken_barh([(begin, end - begin)], (k - 0.31, 0.62), color=TINTS[f.word], lw=0.5, label=f.word)
            words = f"{f.word} {begin:.1f} h"
            needed = room * (len(words) + 1)
            late = begin + needed > hours[-1]
            start = begin - needed if late else begin
            if start >= free.get(f.sensor, -math.inf):  # omit text that would overlap the preceding text
                ax.annotate(
                    words, (begin, k), (-3 if late else 3, 0), textcoords="offset points", fontsize=7, zorder=3,
                    ha="right" if late else "left", va="center",
                )  # fmt: skip
                free[f.sensor] = max(start + needed, begin)
        name_ticks(ax.yaxis, names, LONGEST, fontsize=7)
        ax.set_ylim(len(names) - 0.4, -0.6)
        ax.set_xlim(float(hours[0]), float(hours[-1]))
        ax.set_xlabel("time [h]")
        add_legend(figure, loc="outside upper left", ncols=len(TINTS))
        return svg(figure)


def draw_stand_ins(log: FaultLog) -> Drawn:
    """Plot the readings of failed sensors, and the substitute temperatures."""
    shown = log.failed[:MOST]
    columns = min(len(shown), 3)
    rows = -(-len(shown) // columns)
    step = slice(None, None, max(1, len(log.time) // (POINTS // columns)))
    hours = log.time[step] / 3600
    with drawing("stand-ins" + log.name):
        figure = Figure(figsize=(9.6, 0.5 + 2.3 * rows), layout="constrained")
        panels = figure.subplots(rows, columns, squeeze=False)
        for ax in panels.flat[len(shown) :]:
            ax.set_visible(False)
        for ax, name in zip(panels.flat, shown, strict=False):
            k = log.watch.failing.index(name)
            for f in (f for f in log.faults if f.sensor == name):
                ax.axvspan(f.begin / 3600, f.end / 3600, color=SHADE, lw=0, zorder=0)
            ax.plot(hours, log.read[step, k], color=MEASURED, lw=1.4, label="reading")
            ax.plot(hours, log.stood_in[step, k], color=PREDICTED, ls="--", lw=1.6, label="substitute value")
            ax.set_title(shorten(name, LONGEST), fontsize=8)
            ax.set_ylabel(log.watch.inputs[log.watch.supervised[k]].unit)
            ax.set_ylim(*_around(log.read[:, k], log.stood_in[:, k]))
            ax.set_xlim(float(log.time[0]) / 3600, float(log.time[-1]) / 3600)
            ax.set_xlabel("time [h]")
        add_legend(figure, loc="outside upper left", ncols=2)
        return svg(figure)


def _around(read: FloatArray, stood_in: FloatArray) -> tuple[float, float]:
    """Return a range that contains the substitutes and the trusted values, and readings close to them."""
    sure = np.where(np.isfinite(stood_in), stood_in, read)
    low, high = float(np.nanmin(sure)), float(np.nanmax(sure))
    far = AROUND + (high - low)
    near = read[(read >= low - far) & (read <= high + far)]  # excludes nan
    low, high = min(low, float(near.min(initial=low))), max(high, float(near.max(initial=high)))
    room = 0.05 * max(high - low, 0.5)
    return low - room, high + room


def _timeline_words(log: FaultLog, logs: Sequence[FaultLog]) -> str:
    good = len(log.watch.failing) - len(log.failed)
    others = [other.name for other in logs if not other.faults]
    more = f" No sensor failed in {', '.join(others)}." if others else ""
    return (
        f"{log.name}: {len(log.failed)} of {len(log.watch.failing)} sensors failed, {good} did not. "
        f"Coloured: from the detection of a failure until the sensor is trusted again.{more}"
    )


def _stand_in_words(log: FaultLog) -> str:
    more = f" Not drawn: {', '.join(log.failed[MOST:])}." if len(log.failed) > MOST else ""
    return (
        "The substitute value starts at the last value of the sensor, and approaches its prediction from the other "
        "sensors and the speed with a time constant of an hour; that of a speed is the one that explains the "
        f"temperatures.{more}"
    )


def _fault_table(log: FaultLog, recording: Recording) -> Layout:
    columns = (
        Column("sensor", lambda f: f.sensor),
        Column("fault", lambda f: f.word),
        Column("detected", lambda f: _when(f.begin, recording), ">"),
        Column("until", lambda f: _when(f.end, recording) if f.returned else "the end", ">"),
        Column("reading minus substitute, mean", _beside, ">"),
    )
    more = len(log.faults) - ROWS
    note = f"{more} more are not listed." if more > 0 else ""
    rows: Sequence[Fault] = log.faults[:ROWS]
    return Layout(columns, rows, note=note)


def _cost_table(title: str, unit: str, costs: Sequence[Cost]) -> Layout:
    columns = (
        Column("failed sensors", lambda c: ", ".join(c.failed) or "none"),
        Column("judged", lambda c: c.hours, ".1f", "h"),
        Column("RMS", lambda c: c.rms, "um", unit),
        Column("without compensation", lambda c: c.none_rms, "um", unit),
        Column("honest error without them", lambda c: c.honest, "um", unit),
        Column("correction at the machine", lambda c: "continues" if c.runs_on else "held, then fades"),
    )
    return Layout(columns, costs, title=title)


def _when(seconds: float, recording: Recording) -> str:
    """Return a time of a recording as text, with date and time of day if known."""
    if not recording.start:
        return f"{seconds / 3600:.2f} h"
    clock = datetime.fromisoformat(recording.start) + timedelta(seconds=seconds - float(recording.time[0]))
    return f"{seconds / 3600:.2f} h ({clock:%Y-%m-%d %H:%M})"
