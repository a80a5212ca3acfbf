"""Reproduction of a paper's study: its claims, its numbers next to ours, and its figures as plain numbers."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Literal, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
#: how a curve is drawn
Style = Literal["line", "dashed", "points"]

#: told after each part of a study: how much of it is done (0..1), and what comes next
Progress = Callable[[float, str], None]


def tell_nobody(_: float, __: str) -> None:
    """Report no progress."""


@dataclass(frozen=True)
class Claim:
    """One statement or number of a paper, and what came out here.

    Parameters
    ----------
    ids : tuple of str
        Identifiers of the requirements it covers, such as ``C-34``.
    text : str
        Statement of the paper, as a sentence that can be true or false.
    paper : str
        The paper's number, with its unit; "" where it prints none.
    ours : str
        Ours.
    holds : bool or None
        Whether the statement is true here; None: a number to look at, nothing that could be false.
    finding : str
        Reason why it does not hold, or its limitation. Every claim that does not hold needs one.
    again : tuple of bool
        Whether it holds in further runs with other seeds, where the study was repeated.
    """

    ids: tuple[str, ...]
    text: str
    paper: str
    ours: str
    holds: bool | None
    finding: str = ""
    again: tuple[bool, ...] = ()

    @property
    def verdict(self) -> str:
        """``yes`` or ``no``; ``2 of 3`` where runs do not agree; ``-`` for a number that is only to be looked at."""
        if self.holds is None:
            return "-"
        held = (self.holds, *self.again)
        return ("yes" if self.holds else "no") if len(set(held)) == 1 else f"{sum(held)} of {len(held)}"

    def __post_init__(self) -> None:
        if self.holds is False and not self.finding:
            raise ValueError(f"{', '.join(self.ids)}: a claim that does not hold needs a finding")


#: what a study found, and its claims are judged by
_Found = TypeVar("_Found")


class Ours(NamedTuple):
    """Our side of a claim.

    Parameters
    ----------
    text : str
        Our number.
    holds : bool or None
        See `Claim`.
    otherwise : str
        Reason why it does not hold: shown only if it does not.
    note : str
        Limitation: shown in any case, before that.
    """

    text: str
    holds: bool | None = None
    otherwise: str = ""
    note: str = ""


class Claims(Generic[_Found]):
    """The claims of a study, in their order of presentation: each with the function that computes our side of it."""

    def __init__(self) -> None:
        self._judges: list[Callable[[_Found], Sequence[Claim]]] = []

    def add(
        self, ids: str, text: str, paper: str = ""
    ) -> Callable[[Callable[[_Found], Ours | str]], Callable[[_Found], Claim]]:
        """Add a claim, judged by the function that is decorated.

        Parameters
        ----------
        ids, text, paper : str
            See `Claim`; several ids with blanks between them.

        Returns
        -------
        callable
            Takes a function of what was found; it returns our side, or its text alone where nothing could be false.
        """

        def register(ours: Callable[[_Found], Ours | str]) -> Callable[[_Found], Claim]:
            def judge(found: _Found) -> Claim:
                told = ours(found)
                mine = Ours(told) if isinstance(told, str) else told
                holds = None if mine.holds is None else bool(mine.holds)
                finding = (mine.note, mine.otherwise if holds is False else "")
                return Claim(
                    ids=tuple(ids.split()),
                    text=text,
                    paper=paper,
                    ours=mine.text,
                    holds=holds,
                    finding=" ".join(filter(None, finding)),
                )

            self._judges.append(lambda found: (judge(found),))
            return judge

        return register

    def include(self, others: "Claims[Any]", part: Callable[[_Found], Any]) -> None:
        """Continue with all claims about a part of what was found."""
        self._judges.append(lambda found: others(part(found)))

    def __call__(self, found: _Found) -> tuple[Claim, ...]:
        """Return all claims, judged by what was found."""
        return tuple(claim for judge in self._judges for claim in judge(found))


@dataclass(frozen=True, eq=False)
class PlotCurve:
    """One curve of a panel.

    Parameters
    ----------
    label : str
        "" for none.
    x, y : ndarray of shape (n,)
        NaN breaks the line.
    style : {'line', 'dashed', 'points'}
    """

    label: str
    x: FloatArray
    y: FloatArray
    style: Style = "line"


@dataclass(frozen=True, eq=False)
class Panel:
    """Axes with curves.

    Parameters
    ----------
    title, xlabel, ylabel : str
        With the unit in brackets.
    curves : sequence of PlotCurve
    """

    title: str
    xlabel: str
    ylabel: str
    curves: Sequence[PlotCurve]


@dataclass(frozen=True, eq=False)
class Figure:
    """One figure like the paper's.

    Parameters
    ----------
    key : str
        For a file name, such as ``chen1996-fig14``.
    caption : str
        Description of the figure: a sentence or two; begins with the paper's figure number.
    panels : sequence of Panel
    columns : int
        Panels side by side.
    """

    key: str
    caption: str
    panels: Sequence[Panel]
    columns: int = 1


@dataclass(frozen=True, eq=False)
class StudyTable:
    """A table of a study.

    Parameters
    ----------
    caption : str
    header : sequence of str
    rows : sequence of sequence of str
    """

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
    """A paper's study, run.

    Parameters
    ----------
    name : str
        One of `thermocomp.papers.studies.STUDIES`.
    title : str
        Title of the paper, with authors and year.
    claims : tuple of Claim
    tables : tuple of StudyTable
    figures : tuple of Figure
    numbers : mapping of str to float
        Figures that the gallery page asserts, by a name that says the unit (``mae_ann_x_um``).
    ran : bool
        False: it failed, and its one claim says why.
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
        """Return the study that these parts make, one after the other."""
        return cls(
            name,
            title,
            tuple(c for p in parts for c in p.claims),
            tuple(t for p in parts for t in p.tables),
            tuple(f for p in parts for f in p.figures),
            {key: value for p in parts for key, value in p.numbers.items()},
        )
