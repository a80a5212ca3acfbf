"""`thermocomp demo`: the main workflow on the virtual machine."""

from pathlib import Path

from thermocomp.api import verbs
from thermocomp.cli.compare import compare
from thermocomp.cli.face import CommandFace
from thermocomp.cli.fit import fit
from thermocomp.cli.options import Output
from thermocomp.cli.progress import show_progress
from thermocomp.cli.terminal import console
from thermocomp.core.exceptions import InputError
from thermocomp.core.outputs import refuse_existing
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
        console.print("[bold]1. The virtual machine tool runs a drift test[/]")
    simulate("demo", output=recording, seed=seed, overwrite=overwrite, quiet=json)
    if not json:
        console.print("\n[bold]2. Five methods, judged on unseen thermal cycles[/]")
    face = CommandFace(output=report, overwrite=overwrite, json=json)
    with show_progress(hidden=json, warn=face.warn) as progress:
        found = verbs.compare(recording, progress=progress)
    compare.show(found, face)  # type: ignore[attr-defined]
    if not json:
        console.print("\n[bold]3. The recommended methods, fitted to all cycles and frozen[/]")
    face = CommandFace(output=model, overwrite=overwrite, quiet=json)
    return int(fit.show(found.fit(), face))  # type: ignore[attr-defined]
