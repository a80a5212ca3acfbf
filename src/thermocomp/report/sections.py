"""A section of a page: paragraphs, tables and figures below a heading, in any order."""

from collections.abc import Sequence
from typing import NamedTuple

from thermocomp.report.drawing import Drawn
from thermocomp.report.layout import Layout


class Shown(NamedTuple):
    """A figure and its caption."""

    figure: Drawn
    caption: str


class Section(NamedTuple):
    """A section of a page: heading, and parts in order, of which a text is a paragraph."""

    title: str
    parts: Sequence[str | Layout | Shown]
    cautions: Sequence[str] = ()  #: reservations about the verdict at the top of the page
