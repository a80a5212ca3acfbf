"""`thermocomp assess`: a model file, judged on recordings."""

from pathlib import Path

from thermocomp.api.results import Assessed
from thermocomp.cli.face import CommandFace, command
from thermocomp.report import printed


@command("thermocomp.api.verbs:assess", writes=".html", forms={"model": Path})
def assess(found: Assessed, face: CommandFace) -> int:
    """Write and show the results.

    Parameters
    ----------
    output : Path
        Output report (.html), including failed sensors, their substitutes, and the loss of accuracy.

    Returns
    -------
    int
        0 no model refused, 1 a model was refused here or when it was fitted, or was trained on all rows given to judge
        it, 2 unusable input.
    """
    face.write(found.report)
    face.show_items(found.to_dict, printed.assess(found.judged, found.recordings), "Report")
    before = {m.honest_error.word for m in found.judged.models if m.honest_error is not None}
    return 1 if "refused" in before | {a.word for a in found.judged.overall()} else 0
