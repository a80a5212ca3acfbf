"""`thermocomp select`: the few sensors that a model needs."""

from thermocomp.api.selected import Selected
from thermocomp.cli.face import CommandFace, command
from thermocomp.report import printed


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
    face.print(found.to_dict, printed.choices(found.choices), "Page")
    return 1 if any(c.failure for c in found.choices) else 0
