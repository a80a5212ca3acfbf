"""`thermocomp select`: the few sensors that a model needs."""

from dataclasses import dataclass, field

from cyclopts import Parameter

from thermocomp.api.select import Selected, SelectionSettings
from thermocomp.cli.face import CommandFace, command
from thermocomp.cli.terminal import console, print_items
from thermocomp.report import judged, printed


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
        Output page with tables and figures (.html or .pdf).

    Returns
    -------
    int
        0 done, 1 no set is better than no compensation (pareto), or no sensors could be selected for one of several
        targets, 2 unusable input.
    """
    face.write(found.report)
    face.answer(
        found.to_dict,
        lambda: judged.choices(found.choices, face.files, _following(found, face)),
        lambda: print_items(printed.choices(found.choices), console),
    )
    return 1 if any(c.failure for c in found.choices) else 0


def _following(found: Selected, face: CommandFace) -> tuple[str, ...]:
    """Return the command that compares methods on the selected sensors, and the spindle speed."""
    speeds = [r.speed.name for r in found.recordings[:1] if r.speed is not None]
    chosen = list(dict.fromkeys(name for c in found.choices for name in c.sensors))
    return face.following("compare", inputs=[*chosen, *speeds])
