"""Sensor selection: settings, and the result with the sensors, the reason and the underlying tables."""

import math
from dataclasses import MISSING, dataclass, field, fields
from typing import Literal, Protocol

from thermocomp.core.exceptions import InputError

Cell = str | float | int | None
Criterion = Literal["mse", "adjr2", "cp", "bic", "cycles"]


#: methods that use each setting
LOOKED_AT_BY = {
    "threshold": ("grouping",),
    "unsigned": ("grouping",),
    "reference": ("grouping",),
    "max_sensors": ("subsets", "ace", "pareto", "correlation"),
    "seconds": ("subsets",),
    "criterion": ("subsets",),
    "models": ("pareto",),
    "level": ("ace",),
    "holm": ("ace",),
}


class Progress(Protocol):
    """Callback that receives the progress."""

    def __call__(self, text: str, /, steps: int = 1) -> None:
        """Receive a line of text, and the number of tasks completed since the last call."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of the selection methods; each method uses some of them.

    Parameters
    ----------
    threshold : float
        grouping: correlation above which a sensor joins a group.
    unsigned : bool
        grouping: compare the magnitudes of the correlations, regardless of sign.
    reference : str
        grouping: temperature that is subtracted from the others.
    max_sensors : int
        subsets, ace, pareto, correlation: maximum number of sensors. Default: 10 for subsets, 3 for ace, 6 for pareto,
        9 for correlation.
    seconds : float
        subsets: approximate time limit of the search for the best sets [s]; the result names the sets that are not
        proven best by then.
    criterion : str
        subsets: criterion by which the number of sensors is chosen.
    models : list of str
        pareto: methods fitted to each set of sensors.
    level : float
        ace: significance level of the Wilcoxon test.
    holm : bool
        ace: correct the significance level for the number of tests (Holm).
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
        """Reject settings that a method does not use."""
        for f in fields(self):
            default = f.default_factory() if f.default_factory is not MISSING else f.default
            if getattr(self, f.name) != default and method not in LOOKED_AT_BY[f.name]:
                option = "--" + f.name.replace("_", "-")
                raise InputError(f"{option} is for --method {' or '.join(LOOKED_AT_BY[f.name])}, not for {method}")

    def most(self, method: str) -> int:
        """Return the maximum number of sensors that a method may select."""
        if self.max_sensors is not None and self.max_sensors < 1:
            raise InputError(f"--max-sensors {self.max_sensors}: expected at least 1")
        return self.max_sensors or {"ace": 3, "pareto": 6, "correlation": 9}.get(method, 10)


@dataclass(frozen=True)
class Table:
    """A table for the terminal, pages and JSON.

    Parameters
    ----------
    columns : tuple of str
        Headings; units in brackets.
    marked : int or None
        Index of the chosen row.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    marked: int | None = None
    caption: str = ""

    @property
    def words(self) -> tuple[int, ...]:
        """Text columns, which are left-aligned."""
        return tuple(j for j in range(len(self.columns)) if any(isinstance(row[j], str) for row in self.rows))


def format_cell(cell: Cell) -> str:
    """Return a cell as text: four digits, empty for unknown values."""
    if cell is None or (isinstance(cell, float) and math.isnan(cell)):
        return ""
    return f"{cell:.4g}" if isinstance(cell, float) else cell if isinstance(cell, str) else str(cell)


@dataclass(frozen=True, eq=False)
class Choice:
    """Sensors selected by a method.

    Parameters
    ----------
    target : str
        Displacement channel, or several separated by commas if sensors are selected for all of them.
    reason : str
        Reason for the selection, as text.
    notes : tuple of str
        Cautions for the user.
    details : object
        Underlying numbers, for figures.
    failure : str
        Reason why no sensors could be selected; empty if some were.
    """

    method: str
    target: str
    sensors: tuple[str, ...]
    reason: str
    tables: tuple[Table, ...]
    notes: tuple[str, ...] = ()
    details: object = None
    failure: str = ""
