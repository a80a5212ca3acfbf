"""`thermocomp demo`: the main workflow on the virtual machine."""

from pathlib import Path

from thermocomp.api import verbs
from thermocomp.cli import loudness
from thermocomp.cli.answers import print_answer, print_folded
from thermocomp.cli.compare import compare
from thermocomp.cli.face import CommandFace
from thermocomp.cli.fit import fit
from thermocomp.cli.options import Output
from thermocomp.cli.progress import show_progress
from thermocomp.cli.terminal import console
from thermocomp.core.exceptions import InputError
from thermocomp.core.outputs import refuse_existing
from thermocomp.report.answer import CommandAnswer
from thermocomp.report.layout import PrintedLine
from thermocomp.virtual.commands.simulate import simulate


def demo(
    *, output: Output = Path("thermocomp-demo"), seed: int = 0, overwrite: bool = False, json: bool = False
) -> int:
    """Run the main workflow on the virtual machine: record, fit, judge on unseen cycles, report.

    Parameters
    ----------
    output : Path
        Output folder for recording, model and report.
    seed : int
        Random seed of the weather and the noise.
    overwrite : bool
        Overwrite the files of an earlier run.
    json : bool
        Print results as JSON instead of a table.

    Returns
    -------
    int
        0 done, 1 a model was refused.
    """
    if output.exists() and not output.is_dir():
        raise InputError(f"{output}: this is a file; name a folder")
    output.mkdir(parents=True, exist_ok=True)
    recording, model, report = output / "recording.parquet", output / "model.json", output / "report.html"
    refuse_existing([recording, model, report], overwrite)
    if not json:
        intro = "Drift test of a virtual machine tool; five methods on unseen thermal cycles:"
        print_folded(PrintedLine(intro), 2, console)
    simulate("demo", output=recording, seed=seed, overwrite=overwrite, quiet=True)
    face = CommandFace(output=report, overwrite=overwrite, json=json, part=True)
    with show_progress(hidden=json, warn=face.warn) as progress:
        found = verbs.compare(recording, progress=progress)
    compare.show(found, face)  # type: ignore[attr-defined]
    face = CommandFace(output=model, overwrite=overwrite, quiet=json or not loudness.details, part=True)
    code = int(fit.show(found.fit(), face))  # type: ignore[attr-defined]
    if not json:
        told = CommandAnswer(
            files=[recording, report, model],
            following=("thermocomp", "explain", str(model)),
        )
        print_answer(told, console, hint=not loudness.details)
    return code
