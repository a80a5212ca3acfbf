"""Contributions of the inputs to the output of a `PacedDynamic` model: a figure and a table for the page."""

from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from thermocomp.core.arrays import FloatArray
from thermocomp.core.contributions import contributions, gains
from thermocomp.core.messages import Message, join
from thermocomp.core.paceddynamic import PacedDynamic
from thermocomp.core.shown import shorten
from thermocomp.recordings.samples import Samples, usual_step
from thermocomp.report.drawing import BESIDE, Drawn, add_legend, drawing, svg
from thermocomp.report.figures import COLOURS, LONGEST, MEASURED, NONE, thin_points
from thermocomp.report.language import translate
from thermocomp.report.layout import Column, Layout

#: maximum number of inputs drawn separately; the others are summed
MOST = 6


class Answer(NamedTuple):
    """Figure and table of the contributions of the inputs to the output of a model."""

    figure: Drawn
    table: Layout
    lags: str  #: time constants, as text


def explain(model: PacedDynamic, samples: Samples) -> Answer:
    """Return the contributions of the inputs to the output of a model over recordings."""
    return Answer(_draw(model, samples), _table(model, usual_step(samples.dt())), _lags(model))


def _draw(model: PacedDynamic, samples: Samples) -> Drawn:
    """Plot the contribution of each input over time; recordings are drawn one after another."""
    names = [c.name for c in samples.inputs]
    columns = [names.index(i.name) for i in model.inputs]
    each: list[dict[str, FloatArray]] = []
    for test in np.unique(samples.test).tolist():
        mine = samples.test == test
        table = dict(zip(names, samples.values[mine].T, strict=True))
        each.append(contributions(model, table, samples.time[mine], reference=samples.reference()[test, columns]))
    parts = {i.name: np.concatenate([one[i.name] for one in each]) for i in model.inputs}
    ranked = sorted(parts, key=lambda name: -float(np.sqrt((parts[name] ** 2).mean())))
    steps = samples.dt()
    hours = np.cumsum(np.where(np.isfinite(steps), steps, 0.0)) / 3600
    with drawing("answer" + model.target):
        figure = Figure(figsize=(9.6, 3.4), layout="constrained")
        ax = figure.subplots()
        ax.axhline(0, color="#aaa", lw=0.8)
        whole = sum(parts.values(), np.full(len(samples), model.intercept))
        ax.plot(*thin_points(hours, whole), color=MEASURED, lw=2.0, label=translate("prediction: sum of all"))
        for name, colour in zip(ranked[:MOST], COLOURS, strict=False):
            ax.plot(*thin_points(hours, parts[name]), color=colour, label=name)
        if rest := ranked[MOST:]:
            others = sum((parts[name] for name in rest), np.zeros(len(samples)))
            ax.plot(
                *thin_points(hours, others),
                color=NONE,
                ls="--",
                label=translate(Message("sum of {n} more", n=len(rest))),
            )
        ax.set_ylabel(f"{shorten(model.target.removesuffix('_um'), LONGEST)} [{translate(model.unit)}]")
        ax.set_xlabel(translate("time [h]"))
        ax.margins(x=0)
        add_legend(ax, **BESIDE, fontsize=7, handlelength=1.4)
        return svg(figure)


def _table(model: PacedDynamic, step: float) -> Layout:
    per = {"temperature": Message("{unit}/degC", unit=model.unit)}
    top = Message("{unit} at {speed:.0f} 1/min", unit=model.unit, speed=model.top_speed)
    rows: list[dict[str, Any]] = [g._asdict() | {"per": per.get(g.quantity, top)} for g in gains(model, step)]
    columns = (
        Column("input", "name"),
        Column(Message("within {step:g} s", step=step), "instantaneous", "um", named=True),
        Column("steady state", "settled", "um"),
        Column("unit", "per"),
        Column("largest contribution", "bound", "um", model.unit),
    )
    return Layout(columns, rows)


def _lags(model: PacedDynamic) -> str:
    lags = [Message("{tau:g}", tau=tau / 60) for tau in model.time_constants]
    found = [Message("Time constants of the temperature lags: {lags} min.", lags=join(lags, ", "))] if lags else []
    if model.states:
        ends = [sorted({getattr(s, key) / 60 for s in model.states}) for key in ("stopped", "running")]
        rest, run = (Message("{low:g} to {high:g}", low=e[0], high=e[-1]) for e in ends)
        found.append(
            Message(
                "Time constants of the spindle speed states: {rest} min at rest, {run} min at {speed:.0f} 1/min.",
                rest=rest,
                run=run,
                speed=model.top_speed,
            )
        )
    return join(found or [""], " ")
