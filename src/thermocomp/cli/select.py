"""`thermocomp select`: the few sensors that a model needs."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from cyclopts import Parameter

from thermocomp.api.select import Selected, SelectionSettings
from thermocomp.cli.answers import Answer
from thermocomp.cli.face import CommandFace, command
from thermocomp.cli.terminal import console, print_items
from thermocomp.judging.budget import Budget
from thermocomp.judging.choice import Choice
from thermocomp.report import printed
from thermocomp.report.layout import Column, Layout, PrintedLine


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Selector(SelectionSettings):  # noqa: D101 - docstring of SelectionSettings, from which the help is generated
    __doc__ = SelectionSettings.__doc__

    unsigned: bool = False
    models: list[str] = field(default_factory=lambda: ["ols", "averaged"])
    holm: bool = False


@command("thermocomp.api.select:select", writes=".html", forms={"settings": Selector})
def select(found: Selected, face: CommandFace) -> int:
    """Write and show the results.

    Parameters
    ----------
    output : Path
        Output page with tables and figures (.html).

    Returns
    -------
    int
        0 done, 1 no set is better than no compensation (pareto), or no sensors could be selected for one of several
        targets, 2 unusable input.
    """
    face.write(found.report)
    face.answer(
        found.to_dict, lambda: _answer(found, face), lambda: print_items(printed.choices(found.choices), console)
    )
    return 1 if any(c.failure for c in found.choices) else 0


def _answer(found: Selected, face: CommandFace) -> Answer:
    chosen = [c for c in found.choices if c.sensors and not c.failure]
    heads = dict[tuple[str, ...], list[str]]()
    for c in chosen:
        heads.setdefault(c.sensors, []).append(c.target)
    said = [f"Use {', '.join(sensors)} ({len(sensors)}) for {', '.join(of)}" for sensors, of in heads.items()]
    return Answer(
        head="; ".join(said or [f"No set of sensors for {', '.join(c.target for c in found.choices)}"]) + ".",
        table=_table(found.choices),
        lines=[PrintedLine(f"Why: {c.reason}") for c in chosen[:1]],
        warnings=[
            *(f"{c.target}: {c.reason}" for c in found.choices if c.failure),
            # the first note on a budget is its rule
            *dict.fromkeys(note for c in found.choices for note in c.notes[isinstance(c.details, Budget) :]),
        ],
        files=face.files,
        following=_following(found, face) if chosen else (),
    )


def _table(choices: Sequence[Choice]) -> Layout:
    """Return the error of each target with the selected sensors and with all, or the sensors of each target."""
    budget = choices[0].details
    if not isinstance(budget, Budget) or (best := budget.recommended()) is None:
        columns = (Column("target", lambda c: c.target), Column("sensors", lambda c: ", ".join(c.sensors)))
        return Layout(columns, choices)
    model, errors = budget.models.index(best[0]), budget.of_targets()
    found = (errors[model, best[1]], errors[model, -1], budget.none_of_targets())
    rows = [(target, *map(float, mine), best[0]) for target, *mine in zip(budget.targets, *found, strict=True)]
    headings = (f"RMS with {budget.sizes[best[1]]}", f"with all {budget.sizes[-1]}", "instead of")
    numbers = (Column(heading, k, ".2f") for k, heading in enumerate(headings, start=1))
    return Layout((Column("target", 0), *numbers, Column("model", 4)), rows)


def _following(found: Selected, face: CommandFace) -> tuple[str, ...]:
    """Return the command that compares methods on the selected sensors, and the spindle speed."""
    speeds = [r.speed.name for r in found.recordings[:1] if r.speed is not None]
    chosen = list(dict.fromkeys(name for c in found.choices for name in c.sensors))
    return face.following("compare", inputs=[*chosen, *speeds])
