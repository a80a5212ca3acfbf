"""`thermocomp compare`: methods, judged beside each other."""

from functools import partial

from thermocomp.api.results import Compared
from thermocomp.cli.exits import STOPPED
from thermocomp.cli.face import CommandFace, command
from thermocomp.cli.output import show_comparison
from thermocomp.cli.terminal import console


@command("thermocomp.api.verbs:compare", writes=".html")
def compare(found: Compared, face: CommandFace) -> int:
    """Show it.

    Parameters
    ----------
    output : Path
        Report to write (.html).

    Returns
    -------
    int
        0 every target has a model that may run, 1 a target has none, 2 unusable input, 130 stopped by the keyboard
        (what was judged until then is shown).
    """
    face.write(found.report)
    face.show(found.to_dict, partial(show_comparison, found.comparison, face.output, console))
    if found.comparison.left:
        return STOPPED
    return 0 if all(best is not None for best in found.best.values()) else 1
