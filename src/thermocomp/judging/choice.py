"""A selection of sensors: what it can be told, and what it comes out as: the sensors, why, and the tables behind it."""

import math
from dataclasses import MISSING, dataclass, field, fields
from typing import Literal, Protocol

from thermocomp.core.exceptions import InputError

Cell = str | float | int | None
Criterion = Literal["mse", "adjr2", "cp", "bic", "cycles"]


#: which methods look at which of the settings
LOOKED_AT_BY = {
    "threshold": ("grouping",),
    "unsigned": ("grouping",),
    "reference": ("grouping",),
    "max_sensors": ("subsets", "ace", "pareto"),
    "seconds": ("subsets",),
    "criterion": ("subsets",),
    "models": ("pareto",),
    "level": ("ace",),
    "holm": ("ace",),
}


class Progress(Protocol):
    """Is told what has been done."""

    def __call__(self, text: str, /, steps: int = 1) -> None:
        """Take a line of text, and how many pieces of work are done with it."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What the selection methods can be told; each looks at its own.

    Parameters
    ----------
    threshold : float
        grouping: correlation above which a sensor joins a group.
    unsigned : bool
        grouping: compare magnitudes of correlations.
    reference : str
        grouping: temperature that is subtracted from the others.
    max_sensors : int
        subsets, ace, pareto: most sensors; if not given 10 for subsets, 3 for ace, 6 for pareto.
    seconds : float
        subsets: stop the search for the best sets after about so long [s]; what is not proven then, is told.
    criterion : str
        subsets: what the number of sensors is chosen by.
    models : list of str
        pareto: methods that are trained on the sensors.
    level : float
        ace: of the Wilcoxon test.
    holm : bool
        ace: correct the level for the number of tests.
    """

    threshold: float = 0.9
    unsigned: bool = False
    reference: str | None = None
    max_sensors: int | None = None
    seconds: float = 60.0
    criterion: Criterion = "cycles"
    models: list[str] = field(default_factory=lambda: ["ols", "averaged"])
    level: float = 0.05
    holm: bool = False

    def check(self, method: str) -> None:
        """Refuse what has no meaning for a method.

        Raises
        ------
        InputError
            Something was set that only other methods look at.
        """
        for f in fields(self):
            default = f.default_factory() if f.default_factory is not MISSING else f.default
            if getattr(self, f.name) != default and method not in LOOKED_AT_BY[f.name]:
                option = "--" + f.name.replace("_", "-")
                raise InputError(f"{option} is for --method {' or '.join(LOOKED_AT_BY[f.name])}, not for {method}")

    def most(self, method: str) -> int:
        """Return the most sensors a method may choose.

        Raises
        ------
        InputError
            It is below 1.
        """
        if self.max_sensors is not None and self.max_sensors < 1:
            raise InputError(f"--max-sensors {self.max_sensors}: expected at least 1")
        return self.max_sensors if self.max_sensors is not None else {"ace": 3, "pareto": 6}.get(method, 10)


@dataclass(frozen=True)
class Table:
    """A table for people, pages and programs alike.

    Parameters
    ----------
    title : str
    columns : tuple of str
        Headings; units in brackets.
    rows : tuple of tuple
    marked : int or None
        Row of what was chosen.
    caption : str
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    marked: int | None = None
    caption: str = ""

    @property
    def words(self) -> tuple[int, ...]:
        """Columns of words, which are set to the left."""
        return tuple(j for j in range(len(self.columns)) if any(isinstance(row[j], str) for row in self.rows))


def format_cell(cell: Cell) -> str:
    """Return a cell as text: four digits, nothing for what is not known."""
    if cell is None or (isinstance(cell, float) and math.isnan(cell)):
        return ""
    return f"{cell:.4g}" if isinstance(cell, float) else str(cell)


@dataclass(frozen=True, eq=False)
class Choice:
    """Sensors that a method has chosen.

    Parameters
    ----------
    method : str
    target : str
        Displacement channel, or several with commas in between if the choice is for all of them.
    sensors : tuple of str
    reason : str
        How they were chosen, in words.
    tables : tuple of Table
    notes : tuple of str
        What a user should know before he relies on it.
    details : object
        The numbers behind it, for figures.
    failure : str
        Why nothing could be chosen; empty if something was.
    """

    method: str
    target: str
    sensors: tuple[str, ...]
    reason: str
    tables: tuple[Table, ...]
    notes: tuple[str, ...] = ()
    details: object = None
    failure: str = ""
