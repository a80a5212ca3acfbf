"""`thermocomp compare`: methods, judged beside each other."""

from pathlib import Path

from thermocomp.cli.beginning import Beginning
from thermocomp.cli.exits import STOPPED
from thermocomp.cli.options import CompensatorOptions, OptionalOutput, StudyOptions
from thermocomp.cli.progress import show_steps
from thermocomp.cli.terminal import console

DEFAULT_MODELS = ("ols", "partial-f", "mra", "dynamic", "averaged")


def compare(
    recordings: list[Path],
    /,
    *,
    study: StudyOptions = StudyOptions(),  # noqa: B008 - frozen
    models: list[str] = list(DEFAULT_MODELS),  # noqa: B006 - cyclopts shows it as the default and never changes it
    primary: str | None = None,
    compensator: CompensatorOptions = CompensatorOptions(),  # noqa: B008 - frozen
    beginning: Beginning = Beginning(),  # noqa: B008 - frozen
    output: OptionalOutput = None,
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """Compare methods on thermal cycles they have not seen, beside no compensation.

    Parameters
    ----------
    recordings : list of Path
        CSV, XLSX or Parquet files; each is one test.
    study : StudyOptions
        What is predicted from what, and on what it is judged.
    models : list of str
        Methods to compare, or all: ols, partial-f, mra, averaged, dynamic, grouping, subsets, ace, ace-monotone,
        mlp, mlp-sklearn, arx, arx-free-run, arx-net, ridge, pcr, pls, lasso, elastic-net, ppr, gp.
    primary : str
        Method that is named beforehand: it is judged as if it were the only one, the others are corrected for the
        number tried. Without it that goes for the recommended one, which is chosen anew without each cycle.
    compensator : CompensatorOptions
        Its limits: what would run is judged, not the models alone.
    beginning : Beginning
        How the recordings begin.
    output : Path
        Report to write (.html).
    overwrite : bool
        Write over an existing report.
    json : bool
        Print results for a machine instead of a table.

    Returns
    -------
    int
        0 every target has a model that may run, 1 a target has none, 2 unusable input, 130 stopped by the keyboard
        (what was judged until then is shown).
    """
    ready = study.prepare(recordings, beginning, [output], overwrite, ".html")
    from thermocomp.cli import output as out
    from thermocomp.judging import compare as comparing
    from thermocomp.judging.sharing import shared_among

    samples, judging, rules, limits = ready.samples, ready.judging, study.rules(primary), compensator.limits()
    with (
        shared_among(study.scheduler),
        show_steps(comparing.n_pieces(samples, models, judging, rules), hidden=json) as progress,
    ):
        comparison = comparing.compare(
            samples, models, judging, rules=rules, limits=limits, jobs=study.jobs, progress=progress
        )
    if output is not None:
        from thermocomp.report import html

        html.write(comparison, ready.tests, output, samples, overwrite=overwrite)
    out.show_comparison(comparison, output, ready.trouble, console, as_json=json)
    if comparison.left:
        return STOPPED
    return 0 if all(comparison.best(c.name) is not None for c in samples.targets) else 1
