"""The studies of the papers: their claims as text, their figures, and one page with all of it."""

import re
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from thermocomp import __version__
from thermocomp.papers.study import Claim, Curve, Figure, Study, Table
from thermocomp.report.figures import COLOURS, POINTS, drawing, svg, thinned
from thermocomp.report.html import environment

#: what a claim's `holds` is called
VERDICTS = {True: "yes", False: "no", None: "-"}
#: a cell that is a number, alone or with what stands for none
_NUMBER = re.compile(r"[-+]?[\d.,]+(e[-+]?\d+)?( ?%)?|nan|inf|[-–]?")
WIDTH = 9.6
PANEL_HEIGHT = 2.7
#: of plain text
COLUMNS, INDENT = 100, "    "


def verdict(claim: Claim) -> str:
    """Return ``yes`` or ``no``, or ``-`` for a number that is only to be looked at."""
    return VERDICTS[claim.holds]


def counted(study: Study) -> tuple[int, int, int]:
    """Return how many claims hold, do not hold, and are numbers only to be looked at."""
    held = [c.holds for c in study.claims]
    return held.count(True), held.count(False), held.count(None)


def headline(study: Study) -> str:
    """Return one line about a study: how many of its claims hold."""
    yes, no, seen = counted(study)
    line = f"{yes} of {yes + no} claims hold on the virtual machine"
    return f"{line}; {seen} more number{'s' if seen > 1 else ''} beside the paper's" if seen else line


def text(study: Study, *ids: str) -> str:
    """Return claims as plain text, a paragraph each.

    Parameters
    ----------
    study : Study
    *ids : str
        Those with one of these ids; all of them, under the study's title, without it.

    Returns
    -------
    str
    """
    told = [c for c in study.claims if not ids or set(ids) & set(c.ids)]
    lines = [] if ids else [study.title, f"{headline(study)}.", ""]
    for c in told:
        lines.append(textwrap.fill(f"{', '.join(c.ids)}: {c.text}", COLUMNS, subsequent_indent=INDENT))
        judged = ("note", c.finding) if c.holds is None else ("holds", f"{verdict(c)}. {c.finding}".removesuffix(". "))
        said = (("paper", c.paper), ("ours", c.ours), judged)
        for name, value in said:
            if value:
                lines.append(textwrap.fill(f"{INDENT}{name}: {value}", COLUMNS, subsequent_indent=INDENT))
    return "\n".join(lines)


def laid_out(table: Table) -> str:
    """Return a table as plain text: its caption, then columns side by side, numbers on the right."""
    left = words(table)
    rows = [list(table.header), *(list(r) for r in table.rows)]
    widths = [max(len(r[k]) for r in rows) for k in range(len(table.header))]
    lines = [
        "  ".join(
            cell.ljust(w) if k in left else cell.rjust(w) for k, (cell, w) in enumerate(zip(r, widths, strict=True))
        )
        for r in rows
    ]
    return "\n".join([table.caption, *(line.rstrip() for line in lines)])


def words(table: Table) -> list[int]:
    """Return which columns of a table hold words: all others are numbers, and stand on the right."""
    return [k for k in range(len(table.header)) if not all(_NUMBER.fullmatch(row[k]) for row in table.rows)]


def paint(figure: Figure, canvas: Canvas) -> None:
    """Draw a study's figure.

    Parameters
    ----------
    figure : thermocomp.papers.study.Figure
    canvas : matplotlib.figure.Figure
        Empty; `size` tells how large it should be.
    """
    columns = figure.columns
    axes = canvas.subplots(-(-len(figure.panels) // columns), columns, squeeze=False).ravel()
    for ax in axes[len(figure.panels) :]:
        ax.set_visible(False)
    for ax, panel in zip(axes, figure.panels, strict=False):
        for k, curve in enumerate(panel.curves):
            _draw(ax, curve, COLOURS[k % len(COLOURS)])
        ax.set_title(panel.title)
        ax.set_xlabel(panel.xlabel)
        ax.set_ylabel(panel.ylabel)
        labelled = sum(bool(c.label) for c in panel.curves)
        if labelled > 6:
            ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7)
        elif labelled:
            ax.legend(loc="best")


def size(figure: Figure) -> tuple[float, float]:
    """Return width and height of a study's figure [inch]."""
    rows = -(-len(figure.panels) // figure.columns)
    return WIDTH, 0.3 + PANEL_HEIGHT * rows


def draw(figure: Figure) -> str:
    """Return a study's figure as SVG text.

    Parameters
    ----------
    figure : thermocomp.papers.study.Figure

    Returns
    -------
    str
    """
    with drawing(figure.key):
        canvas = Canvas(figsize=size(figure), layout="constrained")
        paint(figure, canvas)
        return svg(canvas)


def render(studies: Sequence[Study], *, seed: int) -> str:
    """Return studies as one HTML page that needs no network.

    Parameters
    ----------
    studies : sequence of Study
    seed : int
        They were run with.

    Returns
    -------
    str
    """
    return (
        environment()
        .get_template("papers.html")
        .render(
            version=__version__,
            seed=seed,
            studies=studies,
            headlines=[headline(s) for s in studies],
            figures=[[draw(f) for f in s.figures] for s in studies],
            verdict=verdict,
            words=words,
        )
    )


def write(studies: Sequence[Study], path: Path, *, seed: int) -> None:
    """Write studies as a page; an existing file is replaced."""
    path.write_text(render(studies, seed=seed), encoding="utf-8")


def _draw(ax: Axes, curve: Curve, colour: str) -> None:
    known: dict[str, Any] = {"label": curve.label} if curve.label else {}
    if curve.style == "points":
        # as a picture inside the page where there are many: one element each would make it slow
        ax.plot(curve.x, curve.y, ".", color=colour, ms=4, rasterized=len(curve.x) > POINTS, **known)
    else:
        ax.plot(*thinned(curve.x, curve.y), "--" if curve.style == "dashed" else "-", color=colour, **known)
