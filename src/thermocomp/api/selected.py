"""Selected sensors, as a table, a figure, a page and a dict."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import pandas as pd

from thermocomp.api.results import Paged, Result, told_trouble
from thermocomp.core.exceptions import InputError
from thermocomp.judging.choice import Choice
from thermocomp.recordings.recording import Recording

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False, repr=False)
class Selected(Result, Paged):
    """Sensors selected by a method.

    Parameters
    ----------
    choices : tuple of Choice
    trouble : tuple of str
    recordings : tuple of Recording
    """

    choices: tuple[Choice, ...]
    trouble: tuple[str, ...] = ()
    recordings: tuple[Recording, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return all results as a dict, as printed by ``--json``."""
        return {
            "trouble": self.trouble,
            "choices": [
                {
                    "method": c.method,
                    "target": c.target,
                    "sensors": c.sensors,
                    "reason": c.reason,
                    "notes": c.notes,
                    "tables": {t.title: [dict(zip(t.columns, row, strict=True)) for row in t.rows] for t in c.tables},
                }
                for c in self.choices
            ],
        }

    def page(self) -> str:
        """Return the page that ``thermocomp select -o`` writes."""
        from thermocomp.report import html

        return html.render_choices(self.choices, self.recordings)

    @property
    def sensors(self) -> dict[str, tuple[str, ...]]:
        """Names of the selected sensors, by target."""
        return {c.target: c.sensors for c in self.choices}

    def to_frame(self) -> pd.DataFrame:
        """Return a row per target; the underlying tables are in ``choices[k].tables``."""
        return pd.DataFrame(
            {
                "target": [c.target for c in self.choices],
                "method": [c.method for c in self.choices],
                "sensors": [" ".join(c.sensors) for c in self.choices],
                "reason": [c.reason for c in self.choices],
            }
        )

    def plot(self, target: str | None = None) -> "Figure":
        """Return the figure of the first choice, or of the choice for a target.

        Raises
        ------
        InputError
            Target unknown, or nothing to choose from.
        """
        from thermocomp.report import selections

        mine = [c for c in self.choices if target in (None, c.target)]
        if not mine:
            raise InputError(
                f"no sensor selection for target {target!r}; available targets: "
                f"{', '.join(c.target for c in self.choices)}"
            )
        drawn = selections.draw(mine[0])
        if drawn is None:
            raise InputError(f"{mine[0].method} has no figure: see {mine[0].reason}")
        return drawn[0].figure

    def __str__(self) -> str:
        chosen = (f"{c.target}: {', '.join(c.sensors) or 'no sensor'} ({c.reason})." for c in self.choices)
        return " ".join([*chosen, *told_trouble(self.trouble)])
