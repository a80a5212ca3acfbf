"""Figure of a revised program: predicted drift of the tool, and remaining error."""

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from thermocomp.nc.rewrite.course import Bound, Run
from thermocomp.report.drawing import add_legend, drawing, png
from thermocomp.report.figures import COLOURS, MEASURED, RESIDUAL

FloatArray = NDArray[np.float64]

TAKEN_OFF = COLOURS[0]
#: maximum number of tool changes marked in a figure
MANY_CHANGES = 60
#: runs longer than this are shown in hours [s]
LONG = 2 * 3600.0
#: minimum range of the drift axis on each side of 0 [um]
_SMALL = 1.0


def draw(run: Run, bounds: Sequence[Bound], tool_changes: Sequence[float], title: str) -> Figure:
    """Plot the drift of each axis, the correction by the program, and the residual in the cuts; spindle speed below.

    Parameters
    ----------
    tool_changes : sequence of float
        Times of the tool changes [s].
    """
    unit, name = (3600.0, "h") if run.time[-1] > LONG else (60.0, "min")
    time = run.time / unit
    with drawing("revision"):
        n = len(bounds)
        figure = Figure(figsize=(9.6, 1.5 + 2.1 * n + 1.1), layout="constrained")
        *panels, below = figure.subplots(n + 1, 1, sharex=True, height_ratios=[2.0] * n + [1.0], squeeze=False)[:, 0]
        for bound, ax in zip(bounds, panels, strict=True):
            _drift(ax, bound, time, run)
        ends = np.concatenate([[0.0], time])
        below.plot(np.repeat(ends, 2)[1:-1], np.repeat(run.speed[:, 1], 2), color=MEASURED)
        below.set_ylabel("1/min")
        below.set_ylim(bottom=0)
        below.set_title("spindle speed")
        below.set_xlabel(f"time since the start of the program [{name}]")
        shown = tool_changes if len(tool_changes) <= MANY_CHANGES else ()
        for ax in (*panels, below):
            ax.margins(x=0)
            for moment in shown:
                ax.axvline(moment / unit, color="#999", lw=0.8, ls=":")
        if len(tool_changes):
            panels[0].plot([], [], color="#999", lw=0.8, ls=":", label=_changes(len(tool_changes)))
        add_legend(figure, loc="outside lower left", ncols=4)
        figure.suptitle(title, x=0.01, ha="left", fontsize=10)
        return figure


def render(run: Run, bounds: Sequence[Bound], tool_changes: Sequence[float], title: str) -> bytes:
    """Return the figure of a revised program as PNG."""
    return png(draw(run, bounds, tool_changes, title))


def _drift(ax: Axes, bound: Bound, time: FloatArray, run: Run) -> None:
    k = "XYZ".index(bound.axis)
    drift, carried, left = run.deviation[:, :, k], run.carried[:, :, k], run.left[:, :, k]
    ax.axhline(0, color="#aaa", lw=0.8)
    ax.plot(*_within(time, drift), color=MEASURED, lw=1.6, label="drift")
    taken = -carried[:, ::-1]
    ax.plot(*_within(time, taken), color=TAKEN_OFF, lw=1.0, label="corrected by the program (minus the correction)")
    ax.plot(*_cuts(time, left), color=RESIDUAL, lw=1.4, label="residual in the cuts")
    low, high = ax.get_ylim()
    ax.set_ylim(min(low, -_SMALL), max(high, _SMALL))
    ax.set_ylabel(f"{bound.axis} [um]")
    ax.set_title(f"{bound.axis}: {_said(bound, cut=bool(np.isfinite(left).any()))}")


def _said(bound: Bound, *, cut: bool) -> str:
    """Return the title of a panel: drift, residual, and bound, which includes the error of the model."""
    far = max(abs(bound.low), abs(bound.high))
    if not cut:
        return f"the tool drifts by up to {far:.1f} um; the program makes no cuts"
    wrong = "no bound, since the model was never judged" if math.isnan(bound.model) else f"bound {bound.most:.1f} um"
    return f"the tool drifts by up to {far:.1f} um; residual in the cuts at most {bound.left:.1f} um; {wrong}"


def _within(time: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a curve through the lowest and the highest value of each interval, both at its end."""
    return np.concatenate([[0.0], np.repeat(time, 2)]), np.concatenate([values[0, :1], values.ravel()])


def _cuts(time: FloatArray, left: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a curve from one limit to the other in each cut, with gaps where nothing is cut.

    The first limit is the one closer to the end of the previous cut, so that curves are continuous.
    """
    starts = np.concatenate([[0.0], time[:-1]])
    x = np.stack([starts, time, time], axis=1)
    y = np.full((len(time), 3), np.nan)
    last = 0.0
    for k, (low, high) in enumerate(left.tolist()):
        if not math.isnan(low):
            first, second = (low, high) if abs(low - last) <= abs(high - last) else (high, low)
            y[k, :2] = first, second
            last = second
    return x.ravel(), y.ravel()


def _changes(n: int) -> str:
    return "tool change" if n <= MANY_CHANGES else f"{n} tool changes, not shown"
