"""Shared basis of all figures: style, escaping of text, and output as SVG or PNG.

External text (names of channels, cycles, files, methods, places) is never interpreted as a formula; unprintable
characters are replaced, and long texts are cut. Legends and tick labels are therefore made here, and figures are saved
by `svg` and `png` only.
"""

import io
import re
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from markupsafe import escape
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import LogLocator

from thermocomp.core.shown import shorten

#: maximum length of a name next to an item, and of a separate line [characters]; maximum number of lines
_NAME, _LINE, _LINES = 48, 130, 3

#: text is never interpreted as a formula
_PLAIN: dict[Any, Any] = {"text.parse_math": False, "text.usetex": False}
_STYLE = {
    **_PLAIN,
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e6e6e6",
    "grid.linewidth": 0.6,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "lines.linewidth": 1.2,
}


#: place of a legend on the right of its panel
BESIDE: dict[str, Any] = {"loc": "center left", "bbox_to_anchor": (1.0, 0.5)}


class Drawn(str):
    """A figure as SVG text, with the figure itself as an attribute."""

    figure: Figure


@contextmanager
def drawing(salt: str) -> Iterator[None]:
    """Apply the style of the reports while drawing; text is never interpreted as a formula."""
    rc: Any = {**_STYLE, "svg.hashsalt": ascii(salt)}
    with mpl.rc_context(rc):
        yield


def add_legend(where: Axes | Figure, **how: Any) -> None:
    """Add a legend of all labelled items; matplotlib ignores labels that begin with ``_``."""
    if isinstance(where, Axes):
        named = list(_labelled(where))
    else:
        first: dict[str, Artist] = {}
        for ax in where.axes:
            for handle, label in _labelled(ax):
                first.setdefault(label, handle)
        named = [(handle, label) for label, handle in first.items()]
    labels = [shorten(label, _NAME) for _, label in named]
    # matplotlib before 3.10 accepts such a label with a leading space
    labels = [f" {label}" if label.startswith("_") else label for label in labels]
    where.legend([handle for handle, _ in named], labels, **how)


def _labelled(ax: Axes) -> Iterator[tuple[Artist, str]]:
    """Yield each item with an explicit label, and the label; matplotlib assigns default labels to the other items."""
    for k, artist in enumerate(ax.get_children()):
        label: Any = artist.get_label()
        if isinstance(label, str) and label not in ("", f"_child{k}", "_nolegend_"):
            yield artist, label


def name_ticks(axis: Axis, names: Sequence[str], longest: int = _NAME, **how: Any) -> None:
    """Set names as tick labels at 0, 1, 2 ... of an axis.

    Parameters
    ----------
    longest : int
        Maximum length of a name [characters].
    """
    axis.set_ticks(range(len(names)), [shorten(name, longest) for name in names], **how)


def log_ticks(ax: Axes, which: Literal["x", "y"], dense: float = 0.7) -> None:
    """Make an axis logarithmic, with plain numbers at ticks that do not overlap.

    Call this function after all drawing.
    """
    ax.set(**{f"{which}scale": "log"})
    axis = ax.xaxis if which == "x" else ax.yaxis
    low, high = np.log10(ax.get_xlim() if which == "x" else ax.get_ylim())
    axis.set_minor_locator(LogLocator(subs=(2, 5) if high - low > dense else range(2, 10)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter("{x:g}" if high - low <= 3 * dense else "")
    axis.set_tick_params(which="minor", labelsize=7)


def svg(figure: Figure) -> Drawn:
    """Return a figure as SVG text."""
    buffer = io.StringIO()
    _save(figure, buffer, format="svg", metadata={"Date": None})
    # hundredths of a point are enough, and take a third less than millionths
    text = re.sub(r' d="[^"]*"', lambda path: re.sub(r"(\.\d\d)\d+", r"\1", path[0]), buffer.getvalue())
    label = escape("; ".join(dict.fromkeys(filter(None, map(_name_of, figure.axes)))))
    found = Drawn(f'<svg role="img" aria-label="{label}"{text[text.index("<svg") + 4 :]}')
    found.figure = figure
    return found


def _name_of(ax: Axes) -> str:
    """Return what a panel shows, for readers who cannot see it: its title, else the quantities of its axes."""
    shown = [ax.get_title(loc=where) for where in ("left", "center")] + [ax.get_ylabel(), ax.get_xlabel()]
    return next((shorten(text, _LINE) for text in shown if text), "")


def png(figure: Figure) -> bytes:
    """Return a figure as PNG."""
    buffer = io.BytesIO()
    _save(figure, buffer, format="png", dpi=150, metadata={"Software": None})
    return buffer.getvalue()


def _save(figure: Figure, buffer: io.StringIO | io.BytesIO, **how: Any) -> None:
    beside = {id(text) for ax in figure.axes for text in ax.texts}
    for text in figure.findobj(Text):
        longest = _NAME if id(text) in beside else _LINE
        text.set_text("\n".join(shorten(line, longest) for line in text.get_text().split("\n", _LINES - 1)))
    with warnings.catch_warnings(), mpl.rc_context(_PLAIN):
        # a name may contain characters missing from the font used for measuring; the browser has them
        warnings.filterwarnings("ignore", message="Glyph .* missing")
        figure.savefig(buffer, **how)
