"""`thermocomp assess`: a model file, judged on recordings."""

from pathlib import Path

from thermocomp.cli import loudness
from thermocomp.cli.beginning import Beginning
from thermocomp.cli.options import CompensatorOptions, OptionalOutput
from thermocomp.cli.progress import show_steps
from thermocomp.cli.reading import read_recordings, tell_trouble
from thermocomp.cli.terminal import console
from thermocomp.files.draft import refuse_existing


def assess(
    model: Path,
    recordings: list[Path],
    /,
    *,
    mapping: Path | None = None,
    harm_margin: float | None = None,
    probing: str | None = None,
    compensator: CompensatorOptions = CompensatorOptions(),  # noqa: B008 - frozen
    beginning: Beginning = Beginning(),  # noqa: B008 - frozen
    output: OptionalOutput = None,
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """Judge a model file on recordings: per cycle, with noise, with each sensor lost, outside its range.

    Rows that a model has learned from are known again by their fingerprints, whatever file they stand in: they are left
    out and counted.

    Parameters
    ----------
    model : Path
        Model file from ``thermocomp fit``.
    recordings : list of Path
        CSV, XLSX or Parquet files; each is one test.
    mapping : Path
        TOML file that says what the columns are.
    harm_margin : float
        Tolerated degradation in a single cycle [um]; as in ``thermocomp fit`` if not given.
    probing : str
        The tool point is probed while it runs, such as ``every 2 h``, or ``every 30 min, 0.3 um`` with the probe's
        repeatability (standard deviation; 0.5 um if not given): what it says corrects the model from then on.
    compensator : CompensatorOptions
        Its limits: what would run is judged, not the model alone.
    beginning : Beginning
        How the recordings begin.
    output : Path
        Report to write (.html): also which sensors failed, what stood in, and what it cost.
    overwrite : bool
        Write over an existing report.
    json : bool
        Print results for a machine instead of a table.

    Returns
    -------
    int
        0 no model refused, 1 one was refused here or when it was fitted, or has learned from all there is to judge it
        on, 2 unusable input.
    """
    if output is not None:
        refuse_existing([output], overwrite, [model, *recordings], ".html")
    tests = read_recordings(recordings, mapping)
    from thermocomp.cli import output as out
    from thermocomp.files import modelfile
    from thermocomp.judging import study as studies
    from thermocomp.judging.probing import Probings
    from thermocomp.judging.results import Rules

    probings = None if probing is None else Probings.parse(probing)
    models = modelfile.read(model)
    loudness.tell(f"read {model}: models of {', '.join(m.target for m in models)}")
    trouble = tell_trouble(tests)
    with show_steps(len(models), hidden=json) as progress:
        judged = studies.assess(
            models,
            tests,
            rules=Rules(harm_margin),
            limits=compensator.limits(),
            starts=beginning.of(tests, mapping),
            probings=probings,
            progress=progress,
        )
    if output is not None:
        from thermocomp.report import assessed

        assessed.write(judged, tests, output, overwrite=overwrite)
    out.show_assess(judged, tests, trouble, console, as_json=json, report=output)
    before = {m.honest_error.word for m in judged.models if m.honest_error is not None}
    return 1 if "refused" in before | {a.word for a in judged.overall()} else 0
