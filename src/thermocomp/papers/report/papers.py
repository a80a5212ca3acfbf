"""Report of the studies of the papers: claims as text, figures, and a page with everything."""

import re
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from thermocomp import __version__
from thermocomp.files.draft import write_text
from thermocomp.papers.study import Figure, PlotCurve, Study, StudyTable
from thermocomp.report.drawing import add_legend, drawing, svg
from thermocomp.report.figures import COLOURS, POINTS, thin_points
from thermocomp.report.html import environment

#: cell with a number, or a substitute for a missing one
_NUMBER = re.compile(r"[-+]?[\d.,]+(e[-+]?\d+)?( ?%)?|nan|inf|[-–]")
WIDTH = 9.6
PANEL_HEIGHT = 2.7
#: line width and indentation of plain text
COLUMNS, INDENT = 88, "    "


def count_verdicts(study: Study) -> dict[str, int]:
    """Return the number of claims by verdict, with ``some`` for those about which the runs disagree."""
    known = ("yes", "in part", "no", "some", "not testable", "-")
    words = [c.verdict if c.verdict in known else "some" for c in study.claims]
    return {word: words.count(word) for word in known}


def headline(study: Study) -> str:
    """Return a summary line of a study: the number of claims that hold."""
    n = count_verdicts(study)
    runs = max((1 + len(c.again) for c in study.claims), default=1)
    line = f"{n['yes']} of {sum(n.values()) - n['-']} claims hold on the virtual machine"
    if runs > 1:
        line += f" in each of {runs} runs"
    if n["in part"]:
        line += f", {n['in part']} in part"
    if n["some"]:
        line += f", {n['some']} in some of them"
    if n["not testable"]:
        line += f", {n['not testable']} not testable on it"
    return f"{line}; {n['-']} more number{'s' if n['-'] > 1 else ''} next to the paper's" if n["-"] else line


def text(study: Study, *ids: str) -> str:
    """Return claims as plain text, one paragraph each.

    Parameters
    ----------
    *ids : str
        Select the claims with these ids. Default: all, under the title of the study.
    """
    told = [c for c in study.claims if not ids or set(ids) & set(c.ids)]
    lines = [] if ids else [study.title, f"{headline(study)}.", ""]
    for c in told:
        lines.append(textwrap.fill(f"{', '.join(c.ids)}: {c.text}", COLUMNS, subsequent_indent=INDENT))
        judged = ("note", c.finding) if c.verdict == "-" else ("holds", f"{c.verdict}. {c.finding}".removesuffix(". "))
        said = (("paper", c.paper), ("ours", c.ours), judged)
        for name, value in said:
            if value:
                lines.append(textwrap.fill(f"{INDENT}{name}: {value}", COLUMNS, subsequent_indent=INDENT))
    return "\n".join(lines)


def format_table(table: StudyTable) -> str:
    """Return a table as plain text: its caption, then the columns, with numbers right-aligned."""
    left, lines = words(table), [list(table.header), *rows(table)]
    widths = [max(len(line[k]) for line in lines) for k in range(len(table.header))]

    def placed(k: int, cell: str) -> str:
        return cell.ljust(widths[k]) if k in left else cell.rjust(widths[k])

    said = ("  ".join(placed(k, cell) for k, cell in enumerate(line)).rstrip() for line in lines)
    return "\n".join([textwrap.fill(table.caption, COLUMNS), *said])


def words(table: StudyTable) -> list[int]:
    """Return the text columns of a table; in the other columns most cells are numbers, and right-aligned."""
    cells = [[row[k] for row in table.rows if row[k]] for k in range(len(table.header))]
    return [k for k, column in enumerate(cells) if column and 2 * sum(map(_is_number, column)) <= len(column)]


def rows(table: StudyTable) -> list[list[str]]:
    """Return the rows of a table; repeated text in the first column is shown only once."""
    above = ["", *(row[0] for row in table.rows)] if 0 in words(table) else [""] * len(table.rows)
    return [["" if row[0] == said else row[0], *row[1:]] for row, said in zip(table.rows, above, strict=False)]


def paint(figure: Figure, canvas: Canvas) -> None:
    """Draw a figure of a study on a matplotlib figure."""
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
            add_legend(ax, loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7)
        elif labelled:
            add_legend(ax, loc="best")


def size(figure: Figure) -> tuple[float, float]:
    """Return width and height of a study's figure [inch]."""
    rows = -(-len(figure.panels) // figure.columns)
    return WIDTH, 0.3 + PANEL_HEIGHT * rows


def draw(figure: Figure) -> str:
    """Return a study's figure as SVG text."""
    with drawing(figure.key):
        canvas = Canvas(figsize=size(figure), layout="constrained")
        paint(figure, canvas)
        return svg(canvas)


def render(studies: Sequence[Study], *, seed: int) -> str:
    """Return studies as a self-contained HTML page."""
    return (
        environment()
        .get_template("papers.html")
        .render(
            made_by=f"thermocomp {__version__}",
            seed=seed,
            studies=studies,
            headlines=[headline(s) for s in studies],
            figures=[[draw(f) for f in s.figures] for s in studies],
            words=words,
            rows=rows,
        )
    )


def write(studies: Sequence[Study], path: Path, *, seed: int, overwrite: bool = False) -> None:
    """Write studies as a self-contained HTML page."""
    write_text(render(studies, seed=seed), path, overwrite=overwrite)


def _is_number(cell: str) -> bool:
    return _NUMBER.fullmatch(cell) is not None


def _draw(ax: Axes, curve: PlotCurve, colour: str) -> None:
    known: dict[str, Any] = {"label": curve.label} if curve.label else {}
    if curve.style == "points":
        # many points are rasterised: separate elements would make the page slow
        ax.plot(curve.x, curve.y, ".", color=colour, ms=4, rasterized=len(curve.x) > POINTS, **known)
    else:
        ax.plot(*thin_points(curve.x, curve.y), "--" if curve.style == "dashed" else "-", color=colour, **known)
