"""`thermocomp compare`: comparison of methods on unseen data."""

from thermocomp.api.results import Compared
from thermocomp.cli.answers import free
from thermocomp.cli.exits import STOPPED
from thermocomp.cli.face import CommandFace, command
from thermocomp.cli.terminal import console, print_items
from thermocomp.report import judged, printed


@command("thermocomp.api.verbs:compare", writes=".html")
def compare(found: Compared, face: CommandFace) -> int:
    """Write and show the results.

    Parameters
    ----------
    output : Path
        Output report (.html or .pdf).

    Returns
    -------
    int
        0 every target has a model that may run, 1 a target has none, 2 unusable input, 130 interrupted from the
        keyboard (the results until then are shown).
    """
    face.write(found.report)
    face.answer(
        found.to_dict,
        lambda: judged.comparison(found.comparison, face.files, _following(found, face)),
        lambda: print_items(printed.comparison(found.comparison, found.recordings), console),
    )
    if found.comparison.left:
        return STOPPED
    return 0 if all(best is not None for best in found.best.values()) else 1


def _following(found: Compared, face: CommandFace) -> tuple[str, ...]:
    """Return the command that follows: fit, or the plan of the next test if no model may run."""
    if all(best is None for best in found.best.values()):
        return face.following("plan", output=free("next.ngc"))
    methods = {"model": face.given["models"]} if "models" in face.given else {}
    return face.following("fit", **methods, output=free("model.json"))
