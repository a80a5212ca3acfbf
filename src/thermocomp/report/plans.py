"""Figure of possible next tests: the gap in the data that each fills, its expected benefit, and the learning curve."""

from textwrap import wrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from thermocomp.core.messages import Message, join
from thermocomp.judging.planning.learningcurve import LearningCurve
from thermocomp.judging.planning.planning import SAME, Plan
from thermocomp.judging.planning.trial import Trial
from thermocomp.report.drawing import Drawn, add_legend, drawing, name_ticks, svg
from thermocomp.report.figures import MEASURED, NONE, PREDICTED, RESIDUAL, SHADE
from thermocomp.report.language import translate

#: marker of the next test
_STAR: dict[str, Any] = {"marker": "*", "ms": 12, "ls": "", "color": RESIDUAL, "zorder": 4}


def draw(plan: Plan, curve: LearningCurve | None) -> Drawn:
    """Draw the recorded data, and the next test in the gap that it fills; below, all tests and any learning curve."""
    with drawing("plan"):
        below = 1.4 + 0.22 * len(plan.candidates)
        figure = Figure(figsize=(9.6, 3.0 + below), layout="constrained")
        gap, brings = figure.subfigures(2, 1, squeeze=False, height_ratios=[3.0, below])[:, 0]
        runs, stops, room = gap.subplots(1, 3)
        _draw_runs(runs, plan)
        _draw_stops(stops, plan)
        _draw_room(room, plan)
        best = plan.next
        words = [best.news] if best.news and best.trial.kind != "random" else []
        title = Message("next: {test}", test=join([best.trial.words, *words], ": "))
        gap.suptitle(translate(title), x=0.01, ha="left", fontweight="bold", fontsize=9.5)
        axes = brings.subplots(1, 2 if curve else 1, squeeze=False)[0]
        _draw_tests(axes[0], plan)
        if curve is not None:
            _draw_curve(axes[1], curve)
        return svg(figure)


def _draw_runs(ax: Axes, plan: Plan) -> None:
    """Plot speed and duration of the recorded runs, and the next test."""
    recorded = [(v, length / 3600) for v, length, _ in plan.covered.runs]
    ax.plot(*np.array(recorded).T, "o", color=MEASURED, ms=4, alpha=0.7, label=translate("recorded"))
    others = {(c.trial.speed, _longest(c.trial)) for c in plan.candidates if c.trial.kind != "room"}
    ax.plot(*np.array(sorted(others)).T, "o", color=NONE, mfc="none", ms=4, lw=0, label=translate("candidate tests"))
    best = plan.next.trial
    if best.kind != "room":
        speeds = sorted(set(best.speeds))
        ax.plot(speeds, [_longest(best)] * len(speeds), label=translate("next test"), **_STAR)
    _finish(ax, plan, translate("runs"), translate("duration of the run [h]"), room=0.35)
    add_legend(ax, loc="upper left", ncols=2, fontsize=7)


def _draw_stops(ax: Axes, plan: Plan) -> None:
    """Plot the duration of stops against the speed of the preceding run."""
    recorded = [(v, stop / 3600) for v, _, stop in plan.covered.runs]
    ax.plot(*np.array(recorded).T, "o", color=MEASURED, ms=4, alpha=0.7)
    best = plan.next.trial
    if best.kind in ("repeated", "stop", "random"):
        speeds = sorted(set(best.speeds))
        ax.plot(speeds, [best.steps[2][1] / 3600] * len(speeds), **_STAR)
    _finish(ax, plan, translate("stops after a run"), translate("duration of the stop [h]"))


def _draw_room(ax: Axes, plan: Plan) -> None:
    """Plot the change of the ambient temperature within each test."""
    rooms = plan.covered.rooms
    ax.bar(range(1, 1 + len(rooms)), rooms, color=MEASURED, width=0.6)
    if not rooms:
        none = "\n".join(wrap(translate("no room temperature was recorded"), 20))
        ax.text(0.5, 0.5, none, transform=ax.transAxes, ha="center", fontsize=8)
    if plan.swing:
        assumed = translate(Message("assumed: {swing:g} degC", swing=float(plan.swing)))
        ax.axhline(plan.swing, color=NONE, ls="--", lw=0.8, label=assumed)
    if plan.next.trial.kind == "room":
        ax.plot(len(rooms) + 1, plan.swing, label=translate("next test"), **_STAR)
    ax.set_xticks(range(1, 1 + len(rooms)) if len(rooms) <= 12 else [1, len(rooms)])
    ax.set_xlim(0, max(len(rooms), 3) + 2)
    ax.set_ylim(0, 1.35 * max(*rooms, plan.swing, 1.0))
    ax.set_axisbelow(True)
    ax.set_xlabel(translate("recording"))
    ax.set_ylabel(translate("change of the room temperature [degC]"))
    ax.set_title(translate("room temperature"))
    add_legend(ax, loc="upper right", fontsize=7)


def _draw_tests(ax: Axes, plan: Plan) -> None:
    """Plot the expected benefit of each test."""
    ax.barh(range(len(plan.candidates)), [c.gain for c in plan.candidates], color=PREDICTED, height=0.7)
    name_ticks(ax.yaxis, [translate(c.trial.words) for c in plan.candidates], fontsize=7)
    ax.invert_yaxis()
    ax.set_axisbelow(True)
    ax.set_xlabel(translate("expected reduction of the error [um]"))
    title = Message("candidate tests (expected error now {expected:.2f} um)", expected=plan.expected)
    ax.set_title(translate(title))


def _draw_curve(ax: Axes, curve: LearningCurve) -> None:
    """Plot the error against the number of training cycles."""
    levels = curve.by_cycles()
    fitted = [p for p in curve.points if p.rms]
    ax.plot([p.learned for p in fitted], [np.mean(p.rms) for p in fitted], ".", color="#bbbbbb")
    label = Message("{model}: all unseen rows, and standard error", model=curve.model)
    learned, rms = [x.learned for x in levels], [x.rms for x in levels]
    ax.plot(learned, rms, "o-", color=PREDICTED, label=translate(label))
    ax.errorbar(learned, rms, [x.error for x in levels], fmt="none", ecolor=PREDICTED, capsize=2)
    ax.axhline(curve.none, color="#999999", ls="--", lw=0.8, label=translate("no compensation"))
    ax.set_ylim(bottom=0)
    ax.set_xlabel(translate("training cycles"))
    ax.set_ylabel(translate("error on unseen cycles [um RMS]"))
    ax.set_title(translate("learning curve"))
    add_legend(ax)


def _longest(trial: Trial) -> float:
    return max(duration for speed, duration in trial.steps if speed) / 3600


def _finish(ax: Axes, plan: Plan, title: str, what: str, room: float = 0.1) -> None:
    """Shade the speed range of the next test, label the axes, and leave room above the points."""
    best = plan.next.trial
    if best.kind not in ("room", "random"):
        near = SAME * plan.top_speed
        same = translate("treated as the same speed")
        ax.axvspan(best.speed - near, best.speed + near, color=SHADE, lw=0, zorder=0, label=same)
    ax.axvline(plan.top_speed, color=NONE, ls=":", lw=0.8)
    ax.set_xlim(0, (1.0 + SAME) * plan.top_speed)
    ax.set_ylim(0, (1.0 + room) * ax.get_ylim()[1])
    ax.set_xlabel(translate("spindle speed [1/min]"))
    ax.set_ylabel(what)
    ax.set_title(title)
