"""Reproduction of a paper's study: claims, its numbers next to ours, and figures as plain numbers."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
#: drawing style of a curve
Style = Literal["line", "dashed", "points"]

#: called after each part of a study with the completed fraction (0..1) and the next step
Progress = Callable[[float, str], None]


def tell_nobody(_: float, __: str) -> None:
    """Ignore the reported progress of a study."""


@dataclass(frozen=True)
class Claim:
    """A claim or a number of a paper, and the result here.

    Parameters
    ----------
    ids : tuple of str
        Identifiers of the requirements covered, such as ``C-34``.
    text : str
        Claim of the paper, as a sentence that can be true or false.
    paper : str
        Number printed in the paper, with its unit; "" if there is none.
    ours : str
        Result here.
    holds : bool or None
        Whether the claim is true here; None: a number for information, which cannot be false.
    finding : str
        Reason why it does not hold or holds in part only, or its limitation. Required for these claims.
    again : tuple of bool
        Whether it holds in further runs with other seeds, if the study was repeated.
    softer : bool
        The criterion by which it holds is softer than the paper's sentence or number, as `finding` states.
    testable : bool
        Whether the virtual machine has what the claim presupposes; if not, `holds` is None and `finding` states why.
    """

    ids: tuple[str, ...]
    text: str
    paper: str
    ours: str
    holds: bool | None
    finding: str = ""
    again: tuple[bool, ...] = ()
    softer: bool = False
    testable: bool = True

    @property
    def verdict(self) -> str:
        """``yes``, ``in part``, ``no`` or ``not testable``; ``2 of 3`` if runs disagree; ``-``: for information."""
        if not self.testable:
            return "not testable"
        if self.holds is None:
            return "-"
        held = (self.holds, *self.again)
        if len(set(held)) > 1:
            return f"{sum(held)} of {len(held)}"
        return ("in part" if self.softer else "yes") if self.holds else "no"

    def __post_init__(self) -> None:
        if (self.holds is False or self.softer or not self.testable) and not self.finding:
            raise ValueError(
                f"{', '.join(self.ids)}: a claim that does not simply hold needs a finding that explains it"
            )


@dataclass(frozen=True, eq=False)
class PlotCurve:
    """One curve of a panel.

    Parameters
    ----------
    label : str
        Label; "" for none.
    x, y : ndarray of shape (n,)
        Values; nan breaks the line.
    """

    label: str
    x: FloatArray
    y: FloatArray
    style: Style = "line"


@dataclass(frozen=True, eq=False)
class Panel:
    """Panel of a figure: axes with curves.

    Parameters
    ----------
    title, xlabel, ylabel : str
        Texts, with the unit in brackets.
    """

    title: str
    xlabel: str
    ylabel: str
    curves: Sequence[PlotCurve]


@dataclass(frozen=True, eq=False)
class Figure:
    """A figure corresponding to one of the paper.

    Parameters
    ----------
    key : str
        Stem of a file name, such as ``chen1996-fig14``.
    caption : str
        Description of the figure in one or two sentences; begins with the figure number of the paper.
    columns : int
        Number of panels next to each other.
    """

    key: str
    caption: str
    panels: Sequence[Panel]
    columns: int = 1


@dataclass(frozen=True, eq=False)
class StudyTable:
    """A table of a study: caption, headings and rows."""

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True, eq=False)
class Part:
    """Report of one part of a study.

    Parameters
    ----------
    claims, tables, figures, numbers
        See `Study`.
    """

    claims: Sequence[Claim]
    tables: Sequence[StudyTable]
    figures: Sequence[Figure]
    numbers: dict[str, float]


@dataclass(frozen=True, eq=False)
class Study:
    """The executed study of a paper.

    Parameters
    ----------
    name : str
        One of `thermocomp.papers.studies.STUDIES`.
    title : str
        Title of the paper, with authors and year.
    numbers : mapping of str to float
        Key numbers, checked on the gallery page, by a name that includes the unit (``mae_ann_x_um``).
    ran : bool
        False: the study failed; its only claim gives the reason.
    """

    name: str
    title: str
    claims: tuple[Claim, ...]
    tables: tuple[StudyTable, ...]
    figures: tuple[Figure, ...]
    numbers: dict[str, float]
    ran: bool = True

    @classmethod
    def of(cls, name: str, title: str, *parts: Part) -> "Study":
        """Return the study composed of the given parts, in order."""
        return cls(
            name,
            title,
            tuple(c for p in parts for c in p.claims),
            tuple(t for p in parts for t in p.tables),
            tuple(f for p in parts for f in p.figures),
            {key: value for p in parts for key, value in p.numbers.items()},
        )
