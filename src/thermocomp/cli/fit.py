"""`thermocomp fit`: a model with its honest error, in a file."""

from thermocomp.api.results import FittedModels
from thermocomp.cli.face import CommandFace, command
from thermocomp.report import printed


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
    face.show_items(lambda: {"file": str(face.output), **found.to_dict()}, printed.fit(found.fitted), "Model file")
    return 1 if any(a.word == "refused" for a in found.fitted.comparison.overall()) else 0
