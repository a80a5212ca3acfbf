"""`thermocomp check`: what recordings hold, and what is wrong with them."""

from functools import partial

from thermocomp.api.check import CheckedRecordings
from thermocomp.cli.checked import show_check
from thermocomp.cli.face import CommandFace, command
from thermocomp.cli.terminal import console


@command("thermocomp.api.check:check", writes=".html", tell_changes=False)
def check(found: CheckedRecordings, face: CommandFace) -> int:
    """Show it.

    Parameters
    ----------
    output : Path
        Page to write (.html): every channel drawn, with what was found marked at its rows.

    Returns
    -------
    int
        0 nothing wrong, 1 trouble found, 2 unusable input.
    """
    page = None if face.output is None else str(face.output)
    face.write(found.report)
    face.show(lambda: {**found.to_dict(), "page": page}, partial(show_check, found, face.output, console))
    return 1 if found.trouble else 0
