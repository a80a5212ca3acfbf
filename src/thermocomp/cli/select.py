"""`thermocomp select`: the few sensors that a model needs."""

from functools import partial

from thermocomp.api.selected import Selected
from thermocomp.cli.face import CommandFace, command
from thermocomp.cli.output import show_choices
from thermocomp.cli.terminal import console


@command("thermocomp.api.verbs:select", writes=".html")
def select(found: Selected, face: CommandFace) -> int:
    """Show it.

    Parameters
    ----------
    output : Path
        Page with tables and figures to write (.html).

    Returns
    -------
    int
        0 done, 1 no set is better than no compensation (pareto), or nothing could be chosen for one of several targets,
        2 unusable input.
    """
    face.write(found.report)
    face.show(found.to_dict, partial(show_choices, found.choices, face.output, console))
    return 1 if any(c.failure for c in found.choices) else 0
