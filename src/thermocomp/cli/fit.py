"""`thermocomp fit`: a model with its honest error, in a file."""

from dataclasses import replace
from pathlib import Path
from typing import Literal

from thermocomp.cli.beginning import Beginning
from thermocomp.cli.options import CompensatorOptions, Output, Quiet, StudyOptions
from thermocomp.cli.progress import show_steps
from thermocomp.cli.terminal import console

Policy = Literal["clip", "hold", "fade"]


def fit(
    recordings: list[Path],
    /,
    *,
    study: StudyOptions = StudyOptions(),  # noqa: B008 - frozen
    model: str = "averaged",
    tilt: list[str] | None = None,
    output: Output,
    support: Policy = "clip",
    margin: float = 0.25,
    accept_unproven: str | None = None,
    compensator: CompensatorOptions = CompensatorOptions(),  # noqa: B008 - frozen
    beginning: Beginning = Beginning(),  # noqa: B008 - frozen
    overwrite: bool = False,
    json: bool = False,
    quiet: Quiet = False,
) -> int:
    """Fit a model, judge it on thermal cycles it has not seen, and write it with its honest error.

    The method is first judged on unseen cycles, then fitted to everything. A refused model is written too, with the
    refusal inside: nothing will run it. An unproven one runs in shadow only.

    Parameters
    ----------
    recordings : list of Path
        CSV, XLSX or Parquet files; each is one test.
    study : StudyOptions
        What is predicted from what, and on what it is judged.
    model : str
        A method as in ``thermocomp compare``, all but gp.
    tilt : list of str
        Tilts to predict too, each of two probes and their distance, such as A0C=y1_um:y2_um:100mm (turn about X, the
        probe at the tip first) or B0C=x1_um:x2_um:100mm (about Y).
    output : Path
        Model file to write (.json).
    support : str
        What the model does outside its trained range: clip its inputs, hold its last value, or fade to zero.
    margin : float
        Share of each input's trained span by which its range is widened.
    accept_unproven : str
        Person who approves the use of an unproven model, and the reason: "NAME, REASON". Kept in the model file, shown
        wherever the model is. A refused one is never taken.
    compensator : CompensatorOptions
        Its limits: what would run is judged, not the model alone.
    beginning : Beginning
        How the recordings begin.
    overwrite : bool
        Write over an existing model file.
    json : bool
        Print results for a machine instead of a table.

    Returns
    -------
    int
        0 done, 1 a component was refused, 2 unusable input.
    """
    ready = study.prepare(recordings, beginning, [output], overwrite, ".json", tilt=tilt)
    from thermocomp.cli import output as out
    from thermocomp.core.inputs import Support
    from thermocomp.files import modelfile
    from thermocomp.judging import study as studies
    from thermocomp.judging.compare import n_pieces
    from thermocomp.judging.sharing import shared_among

    samples, judging = ready.samples, ready.judging
    with (
        shared_among(study.scheduler),
        show_steps(n_pieces(samples, [model], judging) + len(samples.targets), hidden=quiet or json) as progress,
    ):
        result = studies.fit(
            samples,
            model,
            judging,
            rules=study.rules(),
            support=Support(support, margin),
            limits=compensator.limits(),
            recordings=ready.tests,
            jobs=study.jobs,
            progress=progress,
        )
    result = replace(result, models=tuple(m.taken(accept_unproven) for m in result.models))
    modelfile.write(result.models, output, overwrite=overwrite)
    if not quiet:
        out.show_fit(result, output, ready.trouble, console, as_json=json)
    return 1 if any(a.word == "refused" for a in result.comparison.overall()) else 0
