"""Figures of a sensor selection as SVG text. Each docstring states the purpose of the figure."""

from typing import Any, cast

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator

from thermocomp.core.messages import Message
from thermocomp.core.shown import shorten
from thermocomp.judging.budget import Budget
from thermocomp.judging.choice import Choice, Table
from thermocomp.report.drawing import BESIDE, Drawn, add_legend, drawing, log_ticks, name_ticks, svg
from thermocomp.report.figures import COLOURS, LONGEST, NONE
from thermocomp.report.language import translate

#: maximum length of the displacement names above a figure [characters]
TITLE = 80

#: value plotted for the other methods: the first of these columns in the table, and its caption
TOLD = {
    "RMS on left-out cycles [um]": "Best set of each number of sensors: residual on left-out thermal cycles.",
    "MSE_p [um^2]": "Best set of each number of sensors: residual mean square.",
    "R2": "Steps of the selection, from top to bottom: unexplained share of the variance of the error after each step.",
    "mean Psi": "Sets of sensors: difference between 1 and their maximal correlation with the error.",
}


def draw(choice: Choice) -> tuple[Drawn, str] | None:
    """Return the figure of a choice and its caption; None if there is nothing to draw."""
    found = choice.details
    if isinstance(found, Budget):
        return budget(found), Message(
            "How many sensors are needed? Lines: mean over the unseen blocks; dots: each block. Ring: sufficient "
            "number, the gain of more sensors is within the margin of the rule. Condition number: collinearity of the "
            "sensors."
        )
    if choice.method == "grouping" and found is not None:
        return grouping(found, choice.target), Message(
            "Left: correlation of each pair of temperatures; the groups follow each other and are framed, and the "
            "names of the representatives are bold. Right: the best subset of each number of representatives."
        )
    # Wessel's ranked sets follow the best set for each displacement
    for table in reversed(choice.tables):
        for word, caption in TOLD.items():
            shown = [j for j, heading in enumerate(table.columns) if heading.startswith(word)]
            if shown and table.rows and "displacement" not in table.columns:
                return rows(table, shown[0], choice.target), f"{caption} Filled: selected."
    return None


def rows(table: Table, value: int, target: str) -> Drawn:
    """Plot the residual for each row of a table: a number of sensors, a step, or a set."""
    heading = table.columns[value]
    share = not heading.endswith("]")  # 0.97 and 0.99 differ by a factor in the residual
    left = [abs(share - cast(float, row[value])) for row in table.rows]
    names = [j for j in table.words if j < value] or [0]
    words = [" ".join(str(row[j]) for j in names) for row in table.rows]
    with drawing("rows" + target):
        figure = Figure(figsize=(9.6, 1.4 + 0.22 * len(left)), layout="constrained")
        ax = figure.subplots()
        for row, x in enumerate(left):
            chosen = table.marked in (None, row)
            ax.plot(x, row, "o", color=COLOURS[0], mfc=COLOURS[0] if chosen else "none", ms=7)
        log_ticks(ax, "x")
        name_ticks(ax.yaxis, words, longest=60, fontsize=8)
        ax.set_ylim(len(left) - 0.4, -0.6)
        ax.set_xlabel(f"1 - {heading}" if share else heading)
        ax.set_ylabel("number of sensors" if names == [0] and table.columns[0] == "sensors" else "")
        title = f"{shorten(target, LONGEST)}: {table.title[0].lower()}{table.title[1:]}"
        figure.suptitle(title, x=0.01, ha="left", fontsize=10, fontweight="bold")
        return svg(figure)


def grouping(g: Any, target: str) -> Drawn:
    """Plot collinear temperatures, groups in the correlation matrix, and the useful number of sensors: MSE_p."""
    order = [i for members in g.groups_ for i in members]
    names = [str(n) for n in g.feature_names_in_[order]]
    places = [g.candidates_.index(i) for i in order]
    with drawing("grouping" + target):
        figure = Figure(figsize=(9.6, 4.6), layout="constrained")
        matrix, curve = figure.subplots(1, 2, width_ratios=[1.25, 1])
        image = matrix.imshow(g.correlation_[np.ix_(places, places)], cmap="RdBu_r", vmin=-1, vmax=1)
        figure.colorbar(image, ax=matrix, shrink=0.8)
        start = 0
        for members in g.groups_:
            frame = Rectangle((start - 0.5, start - 0.5), len(members), len(members), fill=False, ec="black", lw=1.6)
            matrix.add_patch(frame)
            start += len(members)
        name_ticks(matrix.xaxis, names, longest=LONGEST, rotation=90, fontsize=7)
        name_ticks(matrix.yaxis, names, longest=LONGEST, fontsize=7)
        for labels in (matrix.get_xticklabels(), matrix.get_yticklabels()):
            for i, label in zip(order, labels, strict=True):
                label.set_fontweight("bold" if i in g.representatives_ else "normal")
        matrix.grid(visible=False)
        matrix.set_title(f"correlation, groups above {g.threshold:g}")
        numbers = [len(s.columns) for s in g.curve_]
        curve.plot(numbers, [s.mse for s in g.curve_], "-o", color=COLOURS[0])
        curve.axhline(g.mse_, color=COLOURS[1], ls="--", label="best members of the groups")
        log_ticks(curve, "y")
        curve.set_xlabel("number of representatives")
        curve.set_ylabel("smallest MSE_p [um²]")
        curve.set_title(shorten(target, LONGEST))
        curve.xaxis.set_major_locator(MaxNLocator(integer=True))
        add_legend(curve)
        return svg(figure)


def budget(b: Budget) -> Drawn:
    """Plot the number of sensors needed: RMS on unseen cycles, selection frequency, and collinearity of sensors."""
    sizes = np.arange(1, len(b.sensors) + 1)
    names = [str(n) for n in b.sizes]
    with drawing("budget" + ", ".join(b.targets)):
        figure = Figure(figsize=(9.6, 4.2 + 0.17 * len(b.candidates)), layout="constrained")
        errors, repeats, chosen = figure.subplots(3, 1, sharex=True, height_ratios=[3, 1.1, 0.16 * len(b.candidates)])
        recommended = b.recommended()
        shown = b.models.index(recommended[0]) if recommended else 0
        mean = translate(", mean") if len(b.targets) > 1 else ""
        if mean:
            for k, (target, values) in enumerate(zip(b.targets, (b.rms.mean(axis=3) / b.scales)[shown].T, strict=True)):
                colour, label = COLOURS[(k + len(b.models)) % len(COLOURS)], shorten(target, LONGEST)
                errors.plot(sizes, values, "--", color=colour, lw=1, label=f"{b.models[shown]}, {label}")
        for k, model in enumerate(b.models):
            colour = COLOURS[k % len(COLOURS)]
            errors.plot(sizes, b.of_blocks()[k], ".", color=colour, alpha=0.35, ms=5)
            errors.plot(sizes, b.mean()[k], "-o", color=colour, label=f"{model}{mean}", lw=2, ms=4)
            enough = b.enough(model)
            if enough is not None:
                place = b.sizes.index(enough)
                errors.plot(sizes[place], b.mean()[k][place], "o", color=colour, mfc="none", ms=12, mew=1.6)
        errors.axhline(b.none_mean(), color=NONE, lw=2.5, label=translate("no compensation"))
        everything, colour = b.mean()[shown, -1], COLOURS[shown % len(COLOURS)]
        whole = Message("{model}, all {n} temperatures", model=b.models[shown], n=names[-1])
        errors.axhline(everything, color=colour, ls=":", label=translate(whole))
        errors.plot([], [], ".", color="#888", label=f"{translate('a single unseen block')}{mean}")
        sufficient = translate("sufficient: more is not clearly better")
        errors.plot([], [], "o", color="#444", mfc="none", ms=9, label=sufficient)
        log_ticks(errors, "y")
        errors.set_ylabel(translate(Message("RMS on unseen data [{unit}]", unit=b.unit)))
        title = Message("{targets}: error against the number of temperature sensors", targets=_name_targets(b))
        figure.suptitle(translate(title), x=0.01, ha="left", fontsize=9.5, fontweight="bold")
        add_legend(errors, **BESIDE)
        finite = np.isfinite(b.condition)
        repeats.plot(sizes[finite], b.condition[finite], "-s", color="#444", ms=4)
        log_ticks(repeats, "y", dense=0.35)
        repeats.set_ylabel(translate("condition number"))
        chosen.imshow(b.frequency.T, aspect="auto", cmap="Blues", vmin=0, vmax=1, extent=_extent(b))
        name_ticks(chosen.yaxis, b.candidates, fontsize=7)
        chosen.grid(visible=False)
        for size, sensors in zip(sizes, b.sensors, strict=True):
            rows = [b.candidates.index(s) for s in sensors]
            chosen.plot([size] * len(rows), rows, "o", color=COLOURS[1], ms=3)
        chosen.plot([], [], "o", color=COLOURS[1], ms=3, label=translate("selected on all rows"))
        often = translate("selected in all splits (lighter: in some)")
        chosen.plot([], [], "s", color="#08306b", ms=6, label=often)
        add_legend(chosen, **BESIDE)
        chosen.set_xlabel(translate("number of temperature sensors"))
        chosen.set_xticks(sizes, names)
        return svg(figure)


def _name_targets(b: Budget) -> str:
    names = ", ".join(b.targets)
    short = len(names) <= TITLE or len(b.targets) == 1
    return shorten(names if short else translate(Message("{n} displacements", n=len(b.targets))), TITLE)


def _extent(b: Budget) -> tuple[float, float, float, float]:
    return 0.5, len(b.sensors) + 0.5, len(b.candidates) - 0.5, -0.5
