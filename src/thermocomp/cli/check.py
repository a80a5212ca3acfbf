"""`thermocomp check`: summary and data-quality problems of recordings."""

from functools import partial

from thermocomp.api.check import CheckedRecordings
from thermocomp.cli.checked import show_check
from thermocomp.cli.face import CommandFace, command
from thermocomp.cli.terminal import console


@command("thermocomp.api.check:check", writes=".html", tell_changes=False)
def check(found: CheckedRecordings, face: CommandFace) -> int:
    """Write and show the results.

    Parameters
    ----------
    output : Path
        Output page (.html): a plot of every channel, with the findings marked at their rows.

    Returns
    -------
    int
        0 no problems, 1 trouble found, 2 unusable input.
    """
    page = None if face.output is None else str(face.output)
    face.write(found.report)
    face.show(lambda: {**found.to_dict(), "page": page}, partial(show_check, found, face.output, console))
    return 1 if found.trouble else 0
