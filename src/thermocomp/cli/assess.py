"""`thermocomp assess`: a model file, judged on recordings."""

from pathlib import Path

from thermocomp.api.results import Assessed
from thermocomp.cli.answers import free
from thermocomp.cli.face import CommandFace, command
from thermocomp.cli.terminal import console, print_items
from thermocomp.report import judged, printed


@command("thermocomp.api.verbs:assess", writes=".html", forms={"model": Path})
def assess(found: Assessed, face: CommandFace) -> int:
    """Write and show the results.

    Parameters
    ----------
    output : Path
        Output report (.html or .pdf), including failed sensors, their substitutes, and the loss of accuracy.

    Returns
    -------
    int
        0 no model refused, 1 a model was refused here or when it was fitted, or the recordings are not unseen, since it
        was trained on all their rows, 2 unusable input.
    """
    face.write(found.report)
    face.answer(
        found.to_dict,
        lambda: judged.assess(found.judged, found.recordings, face.files, _following(found, face)),
        lambda: print_items(printed.assess(found.judged, found.recordings), console),
    )
    before = {m.honest_error.word for m in found.judged.models if m.honest_error is not None}
    return 0 if {"refused", "not unseen"}.isdisjoint(before | {a.word for a in found.judged.overall()}) else 1


def _following(found: Assessed, face: CommandFace) -> tuple[str, ...]:
    """Return the command that follows: export, or the plan of the next test if no model may run."""
    if all(m.accepted for m in found.judged.models) and all(a.accepted for a in found.judged.overall()):
        return face.following("export", recordings=None, to="c99", output=free("c99"))
    return face.following("plan", output=free("next.ngc"))
