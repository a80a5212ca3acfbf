"""Figures of ISO 230 tests as SVG text. Each docstring states the purpose of the figure."""

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

from thermocomp.iso230.part2 import PositioningResult
from thermocomp.iso230.thermaltest import HOUR, ThermalCurve, ThermalTest
from thermocomp.judging.settling.settling import Settling
from thermocomp.report.drawing import BESIDE, add_legend, drawing, name_ticks, svg
from thermocomp.report.figures import COLOURS, MEASURED, NONE, PREDICTED, RESIDUAL, SHADE, line_style, thin_points

_BESIDE = {**BESIDE, "fontsize": 7, "handlelength": 1.6}
#: maximum number of temperatures drawn with names
_NAMED = 24


def thermal(test: ThermalTest) -> str:
    """Plot displacements, tilts and temperatures over time; shaded: drives running; with the 60-min mark."""
    panels = _panels(test)
    heights = [2.6, *[1.6 if len(curves) < 3 else 2.2 for _, _, curves in panels[1:]], 2.4]
    with drawing(test.name + test.kind):
        figure = Figure(figsize=(9.6, 0.7 + 1.05 * sum(heights)), layout="constrained")
        axes: list[Axes] = list(figure.subplots(len(heights), 1, sharex=True, height_ratios=heights))
        for ax, (title, unit, curves) in zip(axes, panels, strict=False):
            _draw(ax, test, curves)
            ax.set_title(title, pad=15 if ax is axes[0] else None)
            ax.set_ylabel(unit)
        _temperatures(axes[-1], test)
        for ax in axes:
            _mark(ax, test)
        # above the first panel, where there are no curves
        axes[0].annotate(
            "60 min", (1.0, 1.0), (2, 2), ("data", "axes fraction"), "offset points", fontsize=7, color="#555"
        )
        axes[-1].set_xlabel("time since the start of the test [h]")
        axes[-1].margins(x=0)
        return svg(figure)


def _panels(test: ThermalTest) -> list[tuple[str, str, Sequence[ThermalCurve]]]:
    panels: list[tuple[str, str, Sequence[ThermalCurve]]] = []
    lengths = [c for c in test.curves if c.unit == "um"]
    if lengths:
        panels.append(("displacements", "um", lengths))
    for t in test.targets:
        panels.append((f"axis {t.axis}: error at the targets", "um", t.curves))
        panels.append((f"axis {t.axis}: change of the length over {t.distance:g} mm", "um", (t.length,)))
    angles = [c for c in test.curves if c.unit == "urad"]
    if angles:
        panels.append(("angles", "urad", angles))
    if test.tilts:
        panels.append(("tilts A (about X) and B (about Y)", "urad = um/m", test.tilts))
    return panels


def _draw(ax: Axes, test: ThermalTest, curves: Sequence[ThermalCurve]) -> None:
    """Draw curves as solid lines, and their residuals with a model as dashed lines."""
    hours = test.time / HOUR
    ax.axhline(0, color="#aaa", lw=0.8)
    if len(curves) > len(COLOURS):
        ramp = mpl.colormaps["viridis"](np.linspace(0.0, 0.9, len(curves)))
        colours = [mpl.colors.to_hex(c) for c in ramp]
    else:
        colours = list(COLOURS[: len(curves)])
    for c, colour in zip(curves, colours, strict=True):
        there = np.isfinite(c.values)
        thin = c.after is not None
        ax.plot(*thin_points(hours[there], c.values[there]), color=colour, label=c.name, lw=0.9 if thin else 1.2)
        if c.after is not None:
            left = np.isfinite(c.after)
            ax.plot(*thin_points(hours[left], c.after[left]), "--", color=colour, lw=1.5)
        _mark_t90(ax, c, colour)
    if any(c.after is not None for c in curves):
        ax.plot([], [], "--", color=MEASURED, label="with model")
    add_legend(ax, **_BESIDE)


def _mark_t90(ax: Axes, curve: ThermalCurve, colour: str) -> None:
    s = curve.settling
    if s is not None and s.settled and np.isfinite(s.t90):
        ax.plot(s.t90 / HOUR, 0.9 * s.change, "o", color=colour, mfc="white", ms=4.5, zorder=4)


def _temperatures(ax: Axes, test: ThermalTest) -> None:
    rows = slice(test.start, test.end + 1)
    hours = test.time / HOUR
    table = test.recording.table
    channels = test.recording.temperatures
    others = [c for c in channels if c != test.ambient]
    for k, c in enumerate(others):
        ax.plot(*thin_points(hours, table[c.name].to_numpy()[rows]), **line_style(k), lw=0.9, label=c.name)
    if test.ambient is not None:
        values = table[test.ambient.name].to_numpy()[rows]
        ax.plot(*thin_points(hours, values), color="black", lw=2.2, label=f"{test.ambient.name}: surroundings")
    ax.set_title("temperatures")
    ax.set_ylabel("degC")
    if 0 < len(channels) <= _NAMED:
        add_legend(ax, **{**_BESIDE, "fontsize": 6 if len(channels) > 12 else 7, "labelspacing": 0.25})


def _mark(ax: Axes, test: ThermalTest) -> None:
    if test.kind != "etve":
        ax.axvspan(0.0, test.running / HOUR, color=SHADE, lw=0, zorder=0)
    if test.time[-1] >= HOUR:
        ax.axvline(1.0, color="#555", lw=1.0, ls=(0, (4, 2)), zorder=1)


def profiles(test: ThermalTest, number: int) -> str:
    """Plot the error of an axis over its travel: at the start, after 60 min, at the stop of the drives, at the end."""
    targets = test.targets[number]
    time, running = test.time, test.running
    moments = [(0.0, "start"), (HOUR, "60 min"), (running, f"{running / HOUR:.3g} h: drives stop")]
    moments += [(float(time[-1]), f"{time[-1] / HOUR:.3g} h: end")] if time[-1] > running else []
    models = all(c.after is not None for c in targets.curves)
    with drawing(test.name + targets.name):
        figure = Figure(figsize=(9.6, 3.0), layout="constrained")
        panels = figure.subplots(1, 2 if models else 1, sharey=True, squeeze=False)[0]
        for ax, what in zip(panels, ("course", "after_course"), strict=False):
            curves = [getattr(c, what).values for c in targets.curves]
            ax.axhline(0, color="#aaa", lw=0.8)
            for (moment, label), colour in zip(moments, ("#999999", COLOURS[4], COLOURS[1], COLOURS[0]), strict=False):
                row = int(np.argmin(np.abs(time - moment)))
                ax.plot(targets.positions, [v[row] for v in curves], "-o", ms=3.5, color=colour, label=label)
            ax.set_xlabel(f"{targets.axis} [mm]")
            ax.set_title("measured, since the start of the test" if what == "course" else "residual with the model")
        panels[0].set_ylabel(f"error of {targets.axis} [um]")
        add_legend(panels[-1], **_BESIDE)
        return svg(figure)


def time_constants(settlings: Sequence[Settling]) -> str:
    """Plot the response of each channel on one scale: times to 63 and 90 %, and fitted time constants."""
    phases = list(dict.fromkeys(s.phase for s in settlings))[:2]
    names = list(dict.fromkeys(s.channel for s in settlings if s.moves))
    with drawing("time constants" + "".join(names)):
        figure = Figure(figsize=(9.6, 1.1 + 0.19 * max(len(names), 3)), layout="constrained")
        panels = figure.subplots(1, len(phases), sharey=True, sharex=True, squeeze=False)[0]
        for ax, phase in zip(panels, phases, strict=True):
            for s in (s for s in settlings if s.phase == phase and s.channel in names):
                _draw_times(ax, s, names.index(s.channel))
            ax.set_title(phase.kind)
            ax.set_xscale("log")
            ax.xaxis.set_major_formatter("{x:g}")
            ax.xaxis.set_minor_locator(LogLocator(subs=(2.0, 5.0)))
            ax.xaxis.set_minor_formatter("{x:g}")
            ax.tick_params(axis="x", which="minor", labelsize=7)
            ax.set_xlabel("min")
        name_ticks(panels[0].yaxis, names, fontsize=7)
        panels[0].set_ylim(len(names) - 0.4, -0.6)
        for label, style in (
            ("t63 read from the curve", {"marker": "|", "ms": 9, "color": MEASURED}),
            ("t90", {"marker": "|", "ms": 9, "color": NONE}),
            ("not settled: t63 or t90 is later", {"marker": ">", "color": NONE, "mfc": "white"}),
            ("tau of a single exponential, ± standard error", {"marker": "o", "color": PREDICTED}),
            ("taus of two exponentials", {"marker": "D", "color": RESIDUAL, "mfc": "white"}),
        ):
            panels[0].plot([], [], ls="", label=label, **{"ms": 5, **style})
        add_legend(figure, loc="outside upper right", ncols=5, fontsize=7.5, handletextpad=0.2, columnspacing=1.2)
        return svg(figure)


def _draw_times(ax: Axes, s: Settling, row: int) -> None:
    for seconds, colour in ((s.t63, MEASURED), (s.t90, NONE)):
        if np.isfinite(seconds) and seconds > 0:
            ax.plot(seconds / 60, row, "|" if s.settled else ">", color=colour, mfc="white", ms=9 if s.settled else 4)
    for fit, marker, colour in ((s.one, "o", PREDICTED), (s.two, "D", RESIDUAL)):
        for e in fit.terms if fit is not None and fit.reliable else ():
            error = min(e.tau_error, 0.9 * e.tau) / 60
            face = colour if marker == "o" else "white"
            ax.errorbar(e.tau / 60, row, xerr=error, fmt=marker, ms=4, lw=0.9, color=colour, mfc=face, zorder=3)


def positioning(result: PositioningResult) -> str:
    """Plot the positioning of an axis: all deviations, mean lines of both directions with 2 s, and A, E and M."""
    positions, unit = result.test.positions, result.test.unit
    with drawing(result.test.axis + result.test.state + "positioning"):
        figure = Figure(figsize=(9.6, 3.6), layout="constrained")
        ax = figure.subplots()
        ax.axhline(0, color="#aaa", lw=0.8)
        for name, arrow, colour in (("+", "↑", COLOURS[0]), ("-", "↓", COLOURS[1])):
            if name in result.directions:
                d = result.directions[name]
                runs = result.test.directions[name]
                ax.fill_between(positions, d.mean - 2 * d.s, d.mean + 2 * d.s, color=colour, alpha=0.15, lw=0)
                ax.plot(np.tile(positions, len(runs)), runs.ravel(), ".", color=colour, ms=3, alpha=0.6)
                band = f", band ± 2 s {arrow}" if len(runs) > 1 else " of a single run"
                ax.plot(positions, d.mean, "-o", color=colour, ms=3.5, label=f"mean {arrow}{band}")
        if result.mean is not None:
            ax.plot(positions, result.mean, ":", color="black", lw=1.4, label="mean of both")
        _spans(ax, result)
        ax.set_xlabel(f"target position{f' {result.test.axis}' if result.test.axis else ''} [mm]")
        ax.set_ylabel(f"deviation [{unit}]")
        ax.set_title(result.test.state)
        add_legend(ax, loc="best", ncols=3)
        return svg(figure)


def _spans(ax: Axes, result: PositioningResult) -> None:
    """Draw A, E and M as arrows to the right of the travel, from lowest to highest value."""
    directions = list(result.directions.values())
    means = np.concatenate([d.mean for d in directions])
    twice = 2.0 * np.concatenate([d.s for d in directions])
    one = len(directions) == 1
    arrow = {"+": "↑", "-": "↓"}[next(iter(result.directions))] if one else ""
    spans = [
        (f"A{arrow}", float((means - twice).min()), float((means + twice).max())),
        (f"E{arrow}", float(means.min()), float(means.max())),
    ]
    if result.mean is not None:
        spans.append(("M", float(result.mean.min()), float(result.mean.max())))
    low, high = float(result.test.positions[0]), float(result.test.positions[-1])
    # no A from a single run
    for k, (symbol, bottom, top) in enumerate(s for s in spans if np.isfinite(s[1:]).all()):
        x = high + (0.045 + 0.075 * k) * (high - low)
        ax.annotate("", (x, top), (x, bottom), arrowprops={"arrowstyle": "<->", "lw": 1.1, "shrinkA": 0, "shrinkB": 0})
        ax.text(x, top, f"{symbol} {top - bottom:.3g}", ha="center", va="bottom", fontsize=8)
        for y in (bottom, top):
            ax.plot([high, x], [y, y], color="#bbb", lw=0.5, zorder=0)
    if len(result.test.positions) <= 12:
        ax.set_xticks(result.test.positions)
    ax.set_xlim(low - 0.03 * (high - low), high + 0.27 * (high - low))
