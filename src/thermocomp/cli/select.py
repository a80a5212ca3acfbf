"""`thermocomp select`: the few sensors that a model needs."""

from pathlib import Path
from typing import Literal

from thermocomp.cli.beginning import Beginning
from thermocomp.cli.options import OptionalOutput, Selector, StudyOptions
from thermocomp.cli.progress import show_steps
from thermocomp.cli.terminal import console

SelectionMethod = Literal["pareto", "subsets", "grouping", "partial-f", "stepwise", "ace"]


def select(
    recordings: list[Path],
    /,
    *,
    study: StudyOptions = StudyOptions(),  # noqa: B008 - frozen
    method: SelectionMethod = "pareto",
    settings: Selector = Selector(),  # noqa: B008 - frozen
    beginning: Beginning = Beginning(),  # noqa: B008 - frozen
    output: OptionalOutput = None,
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """Choose the few temperature sensors that a model needs.

    Parameters
    ----------
    recordings : list of Path
        CSV, XLSX or Parquet files; each is one test.
    study : StudyOptions
        What is predicted from what, and on what it is judged.
    method : str
        How to choose. pareto: error on unseen cycles against the number of sensors; subsets: exact best subset of
        every size; grouping: correlation grouping (Hwang); partial-f and stepwise: by partial F (stepwise 2017, Chen);
        ace: by maximal correlation (Wessel).
    settings : Settings
        What the methods can be told.
    beginning : Beginning
        How the recordings begin.
    output : Path
        Page with tables and figures to write (.html).
    overwrite : bool
        Write over an existing page.
    json : bool
        Print results for a machine instead of tables.

    Returns
    -------
    int
        0 done, 1 no set is better than no compensation (pareto), or nothing could be chosen for one of several targets,
        2 unusable input.
    """
    settings.check(method)
    ready = study.prepare(recordings, beginning, [output], overwrite, ".html", judged=method == "pareto")
    from thermocomp.cli import output as out
    from thermocomp.judging import selecting
    from thermocomp.judging.sharing import shared_among

    samples, judging = ready.samples, ready.judging
    with (
        shared_among(study.scheduler),
        show_steps(selecting.n_pieces(method, samples, judging, settings), hidden=json) as progress,
    ):
        choices = selecting.select(method, samples, judging, settings, jobs=study.jobs, progress=progress)
    if output is not None:
        from thermocomp.report import html

        html.write_choices(choices, ready.tests, output, overwrite=overwrite)
    out.show_choices(choices, output, ready.trouble, console, as_json=json)
    return 1 if any(c.failure for c in choices) else 0
