"""`thermocomp export`: a model file as program code for a controller, with a test that verifies it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from cyclopts import Parameter

from thermocomp.cli.answers import fold
from thermocomp.cli.face import CommandFace, command
from thermocomp.cli.options import CompensatorOptions
from thermocomp.cli.terminal import console, words
from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError
from thermocomp.core.model import ErrorModel
from thermocomp.export.reduction.options import ReductionOptions
from thermocomp.export.verbs import ExportedCode
from thermocomp.files.machines import read_models
from thermocomp.report.answer import noisy


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class CorrectionOptions(CompensatorOptions):
    """Limits of the correction.

    Parameters
    ----------
    hold : float
        Time for which a correction is held without valid readings [s].
    fade : float
        Time constant of the decay of the correction to zero after the hold time [s].
    reading_age : float
        Maximum age of a reading; older readings are not used [s].
    """

    hold: float = Limits.hold
    fade: float = Limits.fade
    reading_age: float = Limits.reading_age

    def value(self) -> Limits:
        """Return the limits as an object for the compensator."""
        return replace(super().value(), hold=self.hold, fade=self.fade, reading_age=self.reading_age)


Parameter(name="*")(ReductionOptions)


def no_file(output: Path, _: Mapping[str, Any]) -> list[Path]:
    """Reject a file where a folder is expected; the target determines the files written there."""
    if output.exists() and not output.is_dir():
        raise InputError(f"{output}: this is not a directory; name a directory")
    return []


@command(
    "thermocomp.export.verbs:export",
    writes=no_file,
    needs_output=True,
    forms={
        "model": Path,
        "recordings": list[Path] | None,
        "vectors_from": Path | None,
        "limits": CorrectionOptions,
        "settings": ReductionOptions,
    },
    words=("model", "recordings"),
)
def export(found: ExportedCode, face: CommandFace) -> int:
    """Save the files and print the result.

    Parameters
    ----------
    output : Path
        Output folder.

    Returns
    -------
    int
        0 done, 1 a model was refused and not exported, 2 unusable input.
    """
    face.write(found.save)
    files = [str(face.output / file) for file in found.files] if face.output is not None else []
    face.show(lambda: {**found.to_dict(), "files": files}, partial(_show, found, files, face.given["model"]))
    return 1 if found.refused else 0


def _show(found: ExportedCode, files: list[str], model: Path) -> None:
    for target, why in found.refused.items():
        console.print(f"[red]refused[/] {words(f'{target} is left out: {why}')}", soft_wrap=True)
    for target, why in found.elsewhere.items():
        console.print(words(f"{target} is left out: {why}"), soft_wrap=True)
    for text in noisy(m for m in read_models(model) if isinstance(m, ErrorModel) and files)[:1]:
        console.print(words(f"Warning: {text}"), soft_wrap=True)
    if files:
        console.print(words(found.verdict), soft_wrap=True)
        for line in fold(f"Written: {', '.join(files)}", len(files), console.width):
            console.print(words(line), soft_wrap=True)
        for line in (*found.notes, f"Verify it as described in {files[-1]}."):
            console.print(words(line), soft_wrap=True)
