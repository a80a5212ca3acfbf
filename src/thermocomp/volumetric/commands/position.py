"""``thermocomp position``: position-dependent errors from profiles in several thermal states."""

from dataclasses import dataclass
from functools import partial
from typing import Annotated

from cyclopts import Parameter

from thermocomp.cli.answers import free
from thermocomp.cli.face import CommandFace, command
from thermocomp.cli.terminal import console
from thermocomp.volumetric.commands.positiontables import answer_positioned, show_positioned
from thermocomp.volumetric.positionsettings import PositionSettings
from thermocomp.volumetric.verbs import Positioned

Switch = Annotated[bool | None, Parameter(negative="--no-offset")]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Fitting(PositionSettings):  # noqa: D101 - docstring of the settings, from which the help is generated
    __doc__ = PositionSettings.__doc__

    offset: Switch = None


@command(
    "thermocomp.volumetric.verbs:position",
    writes=".json",
    forms={"component": list[str], "settings": Fitting},
    words=("recordings",),
    reads={},
)
def position(found: Positioned, face: CommandFace) -> int:
    """Save and show the results.

    Parameters
    ----------
    output : Path
        Output model file (.json).

    Returns
    -------
    int
        0 done, 1 a model was refused, 2 unusable input.
    """
    face.write(found.save)
    file = None if face.output is None else str(face.output)
    face.answer(
        lambda: {**found.to_dict(), "file": file},
        lambda: answer_positioned(
            found, face.files, () if file else face.following("position", output=free("axes.json"))
        ),
        partial(show_positioned, found, console),
    )
    return 1 if any(f.assessment.verdict.word == "refused" for f in found.found) else 0
