"""`thermocomp fit`: a model with its honest error, in a file."""

from functools import partial

from thermocomp.api.results import FittedModels
from thermocomp.cli.face import CommandFace, command
from thermocomp.cli.output import show_fit
from thermocomp.cli.terminal import console


@command("thermocomp.api.verbs:fit", writes=".json", needs_output=True)
def fit(found: FittedModels, face: CommandFace) -> int:
    """Show it.

    Parameters
    ----------
    output : Path
        Model file to write (.json).

    Returns
    -------
    int
        0 done, 1 a component was refused, 2 unusable input.
    """
    face.write(found.save)
    face.show(
        lambda: {"file": str(face.output), **found.to_dict()}, partial(show_fit, found.fitted, face.output, console)
    )
    return 1 if any(a.word == "refused" for a in found.fitted.comparison.overall()) else 0
