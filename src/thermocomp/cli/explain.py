"""`thermocomp explain`: a model file in plain words."""

from pathlib import Path

from thermocomp.cli.face import CommandFace, command
from thermocomp.cli.terminal import console, words
from thermocomp.core.explained import Explanations


@command("thermocomp.api.explain:explain", forms={"model": Path})
def explain(found: Explanations, face: CommandFace) -> int:
    """Show the explanation.

    Returns
    -------
    int
        0 done, 2 unusable input.
    """

    def show() -> None:
        for line in str(found).split("\n"):
            console.print(words(line), soft_wrap=True)

    face.show(found.to_dict, show)
    return 0
