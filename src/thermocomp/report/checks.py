"""Findings of `check` in recordings, as a single offline page: plots of the channels with the findings marked."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from thermocomp.core.arrays import FloatArray
from thermocomp.core.machine import Channel
from thermocomp.core.messages import Message, join
from thermocomp.recordings.checks.findings import Finding
from thermocomp.recordings.recording import Recording
from thermocomp.report import curves, records
from thermocomp.report.drawing import BESIDE, add_legend, drawing, svg
from thermocomp.report.figures import POINTS, line_style, shade_cycles, thin_points
from thermocomp.report.html import page
from thermocomp.report.language import translate
from thermocomp.report.layout import Column, Layout

#: panels by quantity from top to bottom, with their relative heights
_PANELS = {"spindle_speed": 1.0, "temperature": 2.4, "displacement": 2.4, "angle": 2.0, "position": 1.2, "feed": 1.0}
_MARK = {"trouble": "#b00020", "warning": "#E69F00", "info": "#5b636e"}
_TONE = {"trouble": "--bad", "warning": "--c4", "info": "--soft"}
#: maximum number of names next to a panel
_NAMED = 14
#: findings of each channel, with their position in the list
_Numbers = Mapping[str, Sequence[tuple[int, Finding]]]


def render(recordings: Sequence[Recording], findings: Sequence[Sequence[Finding]]) -> str:
    """Return the page about the findings as self-contained HTML."""
    points = curves.share_points(recordings)
    return page(
        "check.html",
        recordings=[_recording(r, found, points) for r, found in zip(recordings, findings, strict=True)],
        remedy=records.remedy,
    )


def draw(recording: Recording, findings: Sequence[Finding], points: int = POINTS) -> str:
    """Return the figure of a recording as SVG; empty if there is nothing to draw."""
    drawn = figure(recording, findings, points)
    if not drawn.axes:
        return ""
    with drawing(recording.name):
        return svg(drawn)


def figure(recording: Recording, findings: Sequence[Finding], points: int = POINTS) -> Figure:
    """Plot each channel with its findings marked; the number of a finding is its position in the list."""
    shown = {q: recording.of_quantity(q) for q in _PANELS if recording.of_quantity(q)}
    numbers = _numbers(findings)
    heights = [_PANELS[q] for q in shown]
    with drawing(recording.name):
        made = Figure(figsize=(9.6, 0.8 + 1.15 * sum(heights)), layout="constrained")
        if not shown:
            return made
        panels = made.subplots(len(shown), 1, sharex=True, height_ratios=heights, squeeze=False)[:, 0]
        for ax, (quantity, channels) in zip(panels, shown.items(), strict=True):
            _panel(ax, recording, quantity, channels, numbers, points)
        panels[-1].set_xlabel(translate("time [h]"))
        panels[-1].margins(x=0)
        return made


def _numbers(findings: Sequence[Finding]) -> _Numbers:
    found: dict[str, list[tuple[int, Finding]]] = {}
    for number, f in enumerate(findings, start=1):
        found.setdefault(f.channel, []).append((number, f))
    return found


def panels(recording: Recording, findings: Sequence[Finding], points: int) -> list[dict[str, Any]]:
    """Return the same as `figure` with hover and zoom: all channels, and the rows of each finding as dots."""
    hours, numbers, made = recording.time / 3600, _numbers(findings), []
    for shown in filter(None, map(recording.of_quantity, _PANELS)):
        limits, dots = _limits(recording, shown, numbers), []
        for name in ("", *(c.name for c in shown)):
            values = recording.table[name].to_numpy(dtype=np.float64) if name else np.full(len(hours), limits[0])
            for number, f in numbers.get(name, ()):
                if (first := _first(f)) is None:
                    continue
                rows = np.array([first]) if f.rows is None or not f.rows.size else f.rows[:: 1 + len(f.rows) // points]
                at = np.nan_to_num(np.clip(values[rows], *limits), nan=limits[0])
                dot = curves.PageCurve(
                    name=f"{number} {translate(f.kind)}",
                    hours=hours[rows],
                    values=at,
                    tone=_TONE[f.severity],
                    shape="dots",
                )
                dots.append(dot)
        made.append(curves.channels(recording, shown, points, dots, limits))
    return made


def _panel(
    ax: Axes,
    recording: Recording,
    quantity: str,
    channels: Sequence[Channel],
    numbers: _Numbers,
    points: int,
) -> None:
    """Draw the channels of one quantity with their findings."""
    hours = recording.time / 3600
    shade_cycles(ax, recording)
    low, high = _limits(recording, channels, numbers)
    ax.set_ylim(low, high)
    # channels with a finding are named first
    ordered = sorted(channels, key=lambda c: c.name not in numbers)
    names: list[str | None] = [c.name for c in ordered]
    if len(names) > _NAMED:
        more = translate(Message("and {n} more", n=len(names) - _NAMED + 1))
        names[_NAMED - 1 :] = [more, *[None] * (len(names) - _NAMED)]
    labels: dict[float, list[tuple[int, Finding]]] = {}
    for k, c in enumerate(ordered):
        values = np.clip(recording.table[c.name].to_numpy(dtype=np.float64), -1e30, 1e30)
        ax.plot(*thin_points(hours, values, points), **line_style(k), lw=1.0, zorder=3, label=names[k])
        for number, f in numbers.get(c.name, ()):
            _mark(ax, hours, np.clip(values, low, high), f, "--")
            if (row := _first(f)) is not None:
                labels.setdefault(float(hours[row]), []).append((number, f))
    for number, f in numbers.get("", ()):
        _mark(ax, hours, hours, f, ":")
        if (row := _first(f)) is not None:
            labels.setdefault(float(hours[row]), []).append((number, f))
    for hour, mine in labels.items():
        _label(ax, hour, mine)
    ax.set_ylabel(translate(channels[0].unit))
    ax.set_title(translate(quantity.replace("_", " ")))
    add_legend(ax, **BESIDE, fontsize=7, handlelength=1.4)


def _limits(recording: Recording, channels: Sequence[Channel], numbers: _Numbers) -> tuple[float, float]:
    """Return the range of plausible values with a margin: one large spike would hide all other values."""
    low, high = np.inf, -np.inf
    for c in channels:
        values = np.clip(recording.table[c.name].to_numpy(dtype=np.float64), -1e30, 1e30)
        for _, f in numbers.get(c.name, ()):
            if f.rows is not None:
                values[f.rows] = np.nan
        low, high = float(np.nanmin(values, initial=low)), float(np.nanmax(values, initial=high))
    if low > high:
        return 0.0, 1.0
    margin = 0.08 * (high - low) or max(1.0, 0.01 * abs(high))
    return low - margin, high + margin


def _first(f: Finding) -> int | None:
    """Return the row of the recording at which the number of a finding is drawn."""
    return int(f.rows[0]) if f.rows is not None and f.rows.size else f.row


def _mark(ax: Axes, hours: FloatArray, values: FloatArray, f: Finding, style: str) -> None:
    """Mark the rows of a finding on its channel, or the row where it starts."""
    if f.rows is not None and f.rows.size:
        drawn = f.rows[:: max(1, len(f.rows) // POINTS)]
        ax.plot(hours[drawn], values[drawn], "x", color=_MARK[f.severity], ms=5, mew=1.4, zorder=5, clip_on=False)
    elif f.row is not None:
        ax.axvline(float(hours[f.row]), color=_MARK[f.severity], lw=1.1, ls=style, zorder=4)


def _label(ax: Axes, hour: float, found: Sequence[tuple[int, Finding]]) -> None:
    """Write the numbers of findings that start at the same time, in the colour of the most serious one."""
    first = min(found, key=lambda one: one[0])[1]
    ax.annotate(
        ", ".join(str(number) for number, _ in found[:4]) + (" ..." if len(found) > 4 else ""),
        (hour, 1.0),
        xycoords=ax.get_xaxis_transform(),
        xytext=(0, -1),
        textcoords="offset points",
        ha="center",
        va="top",
        fontsize=7.5,
        color="white",
        zorder=6,
        bbox={"boxstyle": "round,pad=0.2", "fc": _MARK[first.severity], "ec": "none"},
    )


def _recording(r: Recording, found: Sequence[Finding], points: int) -> dict[str, Any]:
    kinds: dict[str, list[str]] = {}
    for number, f in enumerate(found, start=1):
        kinds.setdefault(f.channel, []).append(Message("{number} {kind}", number=number, kind=Message(f.kind)))
    told = records.recording(r, found)
    columns = (
        Column("channel", "name"),
        Column("quantity", lambda c: Message(c["quantity"].replace("_", " "))),
        Column("unit", "unit"),
        Column("place", "place"),
        *records.RANGE,
        Column("found", lambda c: join(kinds.get(c["name"], [""]), ", ")),
    )
    return {
        **told,
        "file": r.source.replace("\\", "/").rsplit("/", 1)[-1] or r.name,
        "start": r.start,
        "channels": Layout(columns, told["channels"]),
        "cycle_table": Layout(
            (Column("cycle", "name"), Column("rows", lambda c: f"{c['start']}-{c['stop'] - 1}", ">")), told["cycles"]
        ),
        "counts": {s: sum(f.severity == s for f in found) for s in ("trouble", "warning", "info")},
        "notes": [n for n in r.notes if n not in {f.text for f in found}],
        "figure": draw(r, found, points),
        "curves": panels(r, found, points),
    }
