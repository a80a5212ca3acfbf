"""`thermocomp compare`: comparison of methods on unseen data."""

from thermocomp.api.results import Compared
from thermocomp.cli.exits import STOPPED
from thermocomp.cli.face import CommandFace, command
from thermocomp.report import printed


@command("thermocomp.api.verbs:compare", writes=".html")
def compare(found: Compared, face: CommandFace) -> int:
    """Write and show the results.

    Parameters
    ----------
    output : Path
        Output report (.html).

    Returns
    -------
    int
        0 every target has a model that may run, 1 a target has none, 2 unusable input, 130 interrupted from the
        keyboard (the results until then are shown).
    """
    face.write(found.report)
    face.show_items(found.to_dict, printed.comparison(found.comparison), "Report")
    if found.comparison.left:
        return STOPPED
    return 0 if all(best is not None for best in found.best.values()) else 1
