"""Figures of the report as SVG text. Each docstring states the purpose of the figure."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from thermocomp.core.arrays import FloatArray
from thermocomp.core.messages import Message
from thermocomp.core.shown import shorten
from thermocomp.judging.results import Assessment, Comparison
from thermocomp.recordings.recording import Recording
from thermocomp.report.drawing import BESIDE, Drawn, add_legend, drawing, log_ticks, name_ticks, svg
from thermocomp.report.language import translate

#: colour-blind safe palette (Okabe, Ito 2008)
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
MEASURED, PREDICTED, RESIDUAL, NONE = "#444444", "#0072B2", "#D55E00", "#999999"
#: fill of a dot by verdict
FILLED = {"accepted": PREDICTED, "accepted for this duty": PREDICTED, "unproven": "#9ecae1", "refused": "white"}
SHADE = "#f1f1ee"
BAND = "#d6e8f5"
#: maximum length of a name along an axis [characters]
LONGEST = 28
#: number of characters in the smallest font across a page next to a legend
LETTERS = 95
POINTS = 1200  # per curve across the page: sufficient resolution at a small file size


def measured(recording: Recording, points: int = POINTS) -> Drawn:
    """Plot the measurements of one test: speed, temperatures, displacements; thermal cycles shaded."""
    hours = recording.time / 3600
    speed = recording.speed
    heights = ([1] if speed else []) + [2.2, 2.2]
    with drawing(recording.name):
        figure = Figure(figsize=(9.6, 1.0 + 1.15 * sum(heights)), layout="constrained")
        axes: list[Axes] = list(np.atleast_1d(figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)))
        for ax in axes:
            shade_cycles(ax, recording)
        rest = list(axes)
        if speed is not None:
            ax = rest.pop(0)
            values = recording.table[speed.name].to_numpy()
            ax.plot(*thin_points(hours, values, points), color=MEASURED, drawstyle="steps-post")
            ax.set_ylabel("1/min")
            ax.set_title(translate("spindle speed"), pad=14)
            room = float(hours[-1] - hours[0]) / LETTERS
            free = -np.inf
            for cycle in recording.cycles:
                start, name = float(hours[cycle.start]), f" {shorten(cycle.name, LONGEST)}"
                if start >= free:  # omit names that would overlap the preceding one
                    ax.text(start, 1.03, name, transform=ax.get_xaxis_transform(), fontsize=7, color="#666")
                    free = start + room * (len(name) + 1)
        for ax, channels, unit, title in (
            (rest[0], recording.temperatures, translate("degC"), translate("temperatures")),
            (
                rest[1],
                recording.displacements,
                translate("um"),
                translate("displacements: error of an uncompensated part"),
            ),
        ):
            for k, c in enumerate(channels):
                values = recording.table[c.name].to_numpy()
                ax.plot(*thin_points(hours, values, points), **line_style(k), label=c.name)
            ax.set_ylabel(unit)
            ax.set_title(title)
            if channels:
                short = max(len(c.name) for c in channels) < 8
                columns = 2 if short and len(channels) > 8 else 1
                add_legend(ax, **BESIDE, ncols=columns, fontsize=7, handlelength=1.4)
        rest[-1].set_xlabel(translate("time [h]"))
        rest[-1].margins(x=0)
        return svg(figure)


def overview(comparison: Comparison) -> Drawn:
    """Plot the RMS of all models on unseen blocks, compared with no compensation; hollow dots are refused models."""
    overall = comparison.overall()
    targets = list(dict.fromkeys(a.target for a in overall))
    models = list(dict.fromkeys(a.model for a in overall))
    with drawing("overview"):
        figure = Figure(figsize=(9.6, 0.8 + len(targets) * (0.25 + 0.15 * len(models))), layout="constrained")
        panels = np.atleast_1d(figure.subplots(len(targets), 1, sharex=True))
        for ax, target in zip(panels, targets, strict=True):
            mine = [a for a in overall if a.target == target]
            ax.axvline(mine[0].none_metric("rms"), color=NONE, lw=2.5, zorder=2)
            for a in mine:
                if not a.failure:
                    face = FILLED.get(a.word, "white")
                    ax.plot(a.metric("rms"), models.index(a.model), "o", color=PREDICTED, mfc=face, ms=5, zorder=3)
            name_ticks(ax.yaxis, models, fontsize=7)
            ax.set_ylim(len(models) - 0.4, -0.6)
            ax.set_ylabel(shorten(target, LONGEST), fontweight="bold", rotation=0, ha="right", va="center")
        panels[0].plot([], [], color=NONE, lw=2.5, label=translate("no compensation"))
        for word, face in FILLED.items():
            panels[0].plot([], [], "o", color=PREDICTED, mfc=face, label=translate(word))
        add_legend(figure, loc="outside upper right", ncols=4)
        for ax in panels:
            log_ticks(ax, "x")
        panels[-1].set_xlabel(translate("RMS of the residual on the judged rows [um]; smaller is better"))
        return svg(figure)


def prediction(assessment: Assessment, blocks: Sequence[Assessment], time: Sequence[FloatArray]) -> Drawn:
    """Plot a model over each unseen block: measured, predicted and residual.

    Parameters
    ----------
    time : sequence of ndarray
        Times of each recording's rows [s].
    """
    columns = min(len(blocks), 3)
    rows = -(-len(blocks) // columns)
    with drawing(assessment.target + assessment.model):
        figure = Figure(figsize=(9.6, 0.5 + 2.0 * rows), layout="constrained")
        axes = figure.subplots(rows, columns, sharey=True, squeeze=False)
        for ax in axes.flat[len(blocks) :]:
            ax.set_visible(False)
        points = max(60, min(POINTS // columns, 2 * POINTS // len(blocks)))
        for ax, block in zip(axes.flat, blocks, strict=False):
            hours = clock(block, time)
            ax.axhline(0, color="#aaa", lw=0.8)
            if block.band:
                _draw_band(ax, block, hours, points)
            ax.plot(
                *thin_points(hours, block.measured, points),
                color=MEASURED,
                lw=1.8,
                label=translate("measured = without compensation"),
            )
            ax.plot(
                *thin_points(hours, block.predicted, points), color=PREDICTED, ls="--", label=translate("predicted")
            )
            ax.plot(
                *thin_points(hours, block.measured - block.predicted, points),
                color=RESIDUAL,
                label=translate("residual = with compensation"),
            )
            harmful = bool(block.failure) or any(u.harmful for u in block.verdict.units)
            rms = instead(block.metric("rms"), block.none_metric("rms"))
            mark = f"  {translate('HARMFUL')}" if harmful else ""
            ax.set_title(
                f"{shorten(translate(block.block), 60)}\n{rms}{mark}",
                fontsize=8,
                color="#b00020" if harmful else "#222",
            )
            ax.set_xlabel(translate("time [h]"))
        for ax in axes[:, 0]:
            ax.set_ylabel(f"{shorten(assessment.target.removesuffix('_um'), LONGEST)} [{translate('um')}]")
        add_legend(figure, loc="outside upper left", ncols=3)
        return svg(figure)


def _draw_band(ax: Axes, block: Assessment, hours: FloatArray, points: int) -> None:
    """Draw the band about the prediction of the model alone; nothing where it is missing."""
    alone = block.predicted if block.alone is None else block.alone
    assert block.half_widths is not None
    rows = slice(None, None, max(1, len(hours) // points))
    low, high = ((alone + sign * block.half_widths)[rows] for sign in (-1, 1))
    ax.fill_between(hours[rows], low, high, color=BAND, lw=0, zorder=0.5, label=translate(block.band))


def instead(rms: float, none: float) -> str:
    """Return the RMS of a model and that without compensation [um], as text of the page."""
    return translate(Message("RMS {rms:.2f} instead of {none:.2f} um", rms=rms, none=none))


def robustness(found: Sequence[Assessment]) -> Drawn:
    """Plot the RMS undisturbed, with noise, with each sensor lost, and with each off without being detected."""
    with drawing("robustness"):
        figure = Figure(figsize=(9.6, 0.6 + 0.42 * len(found)), layout="constrained")
        ax = figure.subplots()
        for k, a in enumerate(found):
            r = a.robustness
            assert r is not None
            lost = list(r.lost_rms.values())
            ax.plot(lost, [k] * len(lost), "|", color=RESIDUAL, ms=11, mew=1.3)
            off = [rms for _, rms in r.deviating.values()]
            ax.plot(off, [k] * len(off), "x", color=COLOURS[3], ms=4, mew=1.0)
            for law, marker in (("uniform", "s"), ("normal", "D")):
                ax.plot(r.noise_rms[law][0], k, marker, color=COLOURS[2], mfc="white", ms=6, zorder=3)
            ax.plot(a.metric("rms"), k, "o", color=PREDICTED, ms=6, zorder=4)
            ax.plot([a.none_metric("rms")] * 2, [k - 0.4, k + 0.4], color=NONE, lw=2.5)
            name, worst = r.worst_lost
            if lost:
                ax.annotate(
                    name,
                    (worst, k),
                    xytext=(3, 5),
                    textcoords="offset points",
                    fontsize=7,
                    color=RESIDUAL,
                    bbox={"fc": "white", "ec": "none", "alpha": 0.85, "pad": 0.8},
                )
        noise = found[0].robustness.noise if found[0].robustness else 0.0
        ax.plot([], [], "o", color=PREDICTED, label=translate("undisturbed"))
        uniform = translate(Message("uniform noise +-{noise:g} degC", noise=noise))
        normal = translate(Message("normal noise {noise:g} degC", noise=noise))
        ax.plot([], [], "s", color=COLOURS[2], mfc="white", label=uniform)
        ax.plot([], [], "D", color=COLOURS[2], mfc="white", label=normal)
        ax.plot([], [], "|", color=RESIDUAL, label=translate("one sensor lost"))
        ax.plot([], [], "x", color=COLOURS[3], ms=4, label=translate("one sensor off, undetected"))
        ax.plot([], [], color=NONE, lw=2.5, label=translate("no compensation"))
        log_ticks(ax, "x")
        name_ticks(ax.yaxis, [f"{a.target}: {a.model}" for a in found])
        ax.set_ylim(len(found) - 0.5, -0.5)
        ax.set_xlabel(translate("RMS of the residual on the judged rows [um]"))
        add_legend(ax, **BESIDE)
        return svg(figure)


def clock(block: Assessment, time: Sequence[FloatArray]) -> FloatArray:
    """Return hours since the first row of a block; tests follow each other without a gap."""
    seconds = np.array([time[t][r] for t, r in zip(block.test, block.row, strict=True)])
    for k in np.flatnonzero(np.diff(block.test)) + 1:
        seconds[k:] += seconds[k - 1] - seconds[k]
    return np.asarray((seconds - seconds[0]) / 3600)


def line_style(number: int) -> dict[str, Any]:
    """Return colour and dashes of one of many curves, by its number from 0."""
    return {
        "color": COLOURS[number % len(COLOURS)],
        "linestyle": ("-", "--", ":", "-.")[number // len(COLOURS) % 4],
    }


def shade_cycles(ax: Axes, recording: Recording) -> None:
    """Shade every second thermal cycle."""
    hours = recording.time / 3600
    for k, cycle in enumerate(recording.cycles):
        if k % 2 == 0:
            ax.axvspan(float(hours[cycle.start]), float(hours[cycle.stop - 1]), color=SHADE, lw=0, zorder=0)


def thin_points(x: FloatArray, y: FloatArray, points: int = POINTS) -> tuple[FloatArray, FloatArray]:
    """Return at most about `points` points, including the extremes of each interval and the ends of gaps."""
    stretch = -(-len(x) // (points // 2))
    if stretch < 3:
        return x, y
    known = np.isfinite(y)
    ends = np.flatnonzero(np.diff(known))
    if 4 * len(ends) > points:  # values at every few rows only: no gaps
        return thin_points(x[known], y[known], points)
    rows = np.arange(-(-len(x) // stretch) * stretch).reshape(-1, stretch).clip(max=len(x) - 1)
    picked = [
        np.take_along_axis(rows, f(np.where(known, y, worst)[rows], axis=1)[:, None], axis=1).ravel()
        for f, worst in ((np.argmin, np.inf), (np.argmax, -np.inf))
    ]
    chosen = np.unique(np.concatenate([*picked, ends, ends + 1, [0, len(x) - 1]]))
    return x[chosen], y[chosen]
