"""Selection of sensors in Python, and its result as a table, a figure, a page and a dict."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

import pandas as pd

from thermocomp.api.base import Paged, Result, told_trouble
from thermocomp.api.inputs import Given, LeaveOne, Starts, prepare, recordings_of
from thermocomp.api.keywords import Listener, settings_of, silent
from thermocomp.core.exceptions import InputError
from thermocomp.core.messages import Message, join
from thermocomp.core.zero import Zeroing
from thermocomp.judging import selecting
from thermocomp.judging.choice import Choice, Settings
from thermocomp.judging.sharing import shared_among
from thermocomp.recordings.readers.mapping import Mapping
from thermocomp.recordings.recording import Recording

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SelectionMethod = Literal["pareto", "subsets", "correlation", "grouping", "partial-f", "stepwise", "ace"]
#: settings of `select`, in addition to the recordings
SelectionSettings = Settings


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
            raise InputError(f"method {mine[0].method} has no figure; its result: {mine[0].reason}")
        return drawn[0].figure

    def __str__(self) -> str:
        chosen = [
            Message(
                "{target}: {sensors} ({reason}).",
                target=c.target,
                sensors=", ".join(c.sensors) or Message("no sensor"),
                reason=c.reason,
            )
            for c in self.choices
        ]
        return join([*chosen, *told_trouble(self.trouble)], " ")


def select(
    recordings: Given,
    targets: str | Sequence[str] | None = None,
    method: SelectionMethod = "pareto",
    *,
    inputs: str | Sequence[str] | None = None,
    split: str | None = None,
    leave_one: LeaveOne | None = None,
    absolute: bool = False,
    starts: Starts = None,
    zero_over: float = Zeroing.at_rest,
    mapping: str | Path | Mapping | None = None,
    jobs: int = -1,
    scheduler: str | None = None,
    progress: Callable[..., None] = silent,
    **settings: Any,
) -> Selected:
    """Select the few temperature sensors that a model needs.

    Parameters
    ----------
    recordings, targets
        As for `compare`.
    method : {'pareto', 'subsets', 'correlation', 'grouping', 'partial-f', 'stepwise', 'ace'}
        Selection method; see the page :doc:`/methods` of the manual. pareto: trade-off between the error on unseen
        cycles and the number of sensors; subsets: exact best subset of every size; correlation: first screening of many
        sensors by their correlation with the targets and with each other (Chen); grouping: correlation grouping
        (Hwang); partial-f and stepwise: partial F tests (of the stepwise 2017 paper, and of Chen); ace: maximal
        correlation (Wessel).
    inputs, split, leave_one, absolute, starts, zero_over, mapping, jobs, scheduler, progress
        As for `compare`.
    **settings
        Settings of the method, see `thermocomp.judging.choice.Settings`: ``max_sensors=5``, ``threshold=0.95``.

    Returns
    -------
    Selected

    Raises
    ------
    InputError
        A recording, channel, method or setting is invalid.

    Examples
    --------
    >>> import thermocomp as tc
    >>> chosen = tc.select(tc.simulate("hwang"), "z_um", "grouping")
    >>> chosen.sensors
    {'z_um': ('t_y_bearing_C', 't_rear_seat_C', 't_column_front_left_C')}
    >>> chosen
    <Selected: z_um: t_y_bearing_C, t_rear_seat_C, t_column_front_left_C (smallest residual mean square, 3.869 um^2,
    among the members of 3 of 4 groups).>
    """
    if method not in (known := get_args(SelectionMethod)):
        raise InputError(f"method {method!r}: expected {', '.join(known[:-1])} or {known[-1]}")
    chosen = settings_of(Settings, settings, "select")
    chosen.check(method)
    listener = Listener(progress)
    ready = prepare(
        recordings_of(recordings, mapping),
        targets,
        inputs,
        absolute=absolute,
        starts=starts,
        zero_over=zero_over,
        split=split,
        leave_one=leave_one,
        jobs=jobs,
        judged=method == "pareto",
        listener=listener,
    )
    with shared_among(scheduler):
        listener.begin(lambda: selecting.n_pieces(method, ready.samples, ready.judging, chosen))
        found = selecting.select(method, ready.samples, ready.judging, chosen, jobs=jobs, progress=progress)
    return Selected(found, tuple(ready.trouble), ready.tests)
