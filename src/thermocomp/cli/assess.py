"""`thermocomp assess`: a model file, judged on recordings."""

from functools import partial
from pathlib import Path

from thermocomp.api.results import Assessed
from thermocomp.cli.face import CommandFace, command
from thermocomp.cli.output import show_assess
from thermocomp.cli.terminal import console


@command("thermocomp.api.verbs:assess", writes=".html", forms={"model": Path})
def assess(found: Assessed, face: CommandFace) -> int:
    """Show it.

    Parameters
    ----------
    output : Path
        Report to write (.html): also which sensors failed, what stood in, and what it cost.

    Returns
    -------
    int
        0 no model refused, 1 one was refused here or when it was fitted, or has learned from all there is to judge it
        on, 2 unusable input.
    """
    face.write(found.report)
    face.show(found.to_dict, partial(show_assess, found.judged, found.recordings, face.output, console))
    before = {m.honest_error.word for m in found.judged.models if m.honest_error is not None}
    return 1 if "refused" in before | {a.word for a in found.judged.overall()} else 0
