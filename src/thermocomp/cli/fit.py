"""`thermocomp fit`: a model with its honest error, in a file."""

from thermocomp.api.results import FittedModels
from thermocomp.cli.face import CommandFace, command
from thermocomp.cli.terminal import console, print_items
from thermocomp.report import judged, printed


@command("thermocomp.api.verbs:fit", writes=".json", needs_output=True, forms={"model": list[str]})
def fit(found: FittedModels, face: CommandFace) -> int:
    """Write and show the results.

    Parameters
    ----------
    output : Path
        Output model file (.json).

    Returns
    -------
    int
        0 done, 1 a component was refused, 2 unusable input.
    """
    face.write(found.save)
    face.answer(
        lambda: {"file": str(face.output), **found.to_dict()},
        lambda: judged.fit(found.fitted, face.files, face.following("explain", model=face.output)),
        lambda: print_items(printed.fit(found.fitted), console),
    )
    return 1 if any(a.word == "refused" for a in found.fitted.comparison.overall()) else 0
