"""The commands, as plain functions; their help comes from their docstrings.

What needs the training wing is imported inside the commands, so that ``thermocomp --help`` and the running wing start
without it.
"""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter
from rich.console import Console

from thermocomp.cli.beginning import Beginning
from thermocomp.cli.extras import needs
from thermocomp.cli.options import (
    Compensator,
    Flag,
    Json,
    Names,
    OptionalNames,
    OptionalOutput,
    Output,
    Recordings,
    Selector,
    Study,
    read_recordings,
    refuse_existing,
    tell_trouble,
)
from thermocomp.cli.progress import by_steps
from thermocomp.core.exceptions import InputError

Quiet = Annotated[bool, Parameter(show=False, parse=False)]
SelectionMethod = Literal["pareto", "subsets", "grouping", "partial-f", "stepwise", "ace"]
Policy = Literal["clip", "hold", "fade"]
#: exit code of work that was stopped by the keyboard, as shells have it
STOPPED = 130
DEFAULT_MODELS = ("ols", "partial-f", "mra", "dynamic")

_console = Console(highlight=False)


def demo(
    *, output: Output = Path("thermocomp-demo"), seed: int = 0, overwrite: Flag = False, json: Json = False
) -> int:
    """Do the main job on the virtual machine: record, fit, judge on unseen cycles, report.

    Parameters
    ----------
    output : Path
        Folder for recording, model and report.
    seed : int
        Of weather and noise.
    overwrite : bool
        Write over the files of an earlier run.
    json : bool
        Print results for a machine instead of a table.

    Returns
    -------
    int
        0 done, 1 a model was refused.
    """
    if output.exists() and not output.is_dir():
        raise InputError(f"{output}: is a file; name a folder")
    output.mkdir(parents=True, exist_ok=True)
    recording, model, report = output / "recording.parquet", output / "model.json", output / "report.html"
    refuse_existing([recording, model, report], overwrite)
    if not json:
        _console.print("[bold]1. The virtual machine tool runs a drift test[/]")
    simulate("demo", output=recording, seed=seed, overwrite=overwrite, quiet=json)
    study = Study(target=[c.name for c in read_recordings([recording], None)[0].displacements])
    if not json:
        _console.print("\n[bold]2. Four methods, judged on thermal cycles they have not seen[/]")
    compare([recording], study=study, output=report, overwrite=overwrite, json=json)
    if not json:
        _console.print("\n[bold]3. 'dynamic', fitted to everything and frozen[/]")
    return fit([recording], study=study, output=model, overwrite=overwrite, quiet=json)


def simulate(
    experiment: str,
    *,
    output: Output,
    seed: int = 0,
    noise: float | None = None,
    overwrite: Flag = False,
    json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Record an experiment on a virtual machine.

    Parameters
    ----------
    experiment : str
        A protocol of your own, as a path that ends in .toml, or one of: chen1996, chen1996-law, chen1996-new,
        chen1996-slope, demo, etve, hwang, iso230-axis, iso230-spindle, precompensation, precompensation-cut, probing,
        random, stepwise2017, stepwise2017-online, volumetric, volumetric-new, wessel-fem, wessel-milling, wessel-sets,
        wessel-tool.
    output : Path
        File to write (.parquet or .csv); an experiment of several tests gets one file per test.
    seed : int
        Of weather, noise, and what is drawn by lot.
    noise : float
        Standard deviation of the temperature noise [degC]; the sensor's own if not given.
    overwrite : bool
        Write over existing files.
    json : bool
        Print results for a machine instead of a table.

    Returns
    -------
    int
        0 done.
    """
    with needs("study"):
        from thermocomp.cli import output as out
        from thermocomp.datasets import virtual
        from thermocomp.files import recordings
    found = virtual.find(experiment)
    n_tests = len(found.names)
    paths = (
        [output]
        if n_tests == 1
        else [output.with_name(f"{output.stem}-{k}{output.suffix}") for k in range(1, n_tests + 1)]
    )
    refuse_existing(paths, overwrite)
    with by_steps(n_tests, hidden=json or quiet) as progress:
        tests = virtual.record(found, seed=seed, sensor_noise=noise, progress=progress)
    for test, path in zip(tests, paths, strict=True):
        recordings.write(test, path, overwrite=overwrite)
    if not quiet:
        out.show_simulated(tests, paths, _console, as_json=json)
    return 0


def check(
    recordings: Recordings,
    /,
    *,
    mapping: Path | None = None,
    output: OptionalOutput = None,
    overwrite: Flag = False,
    json: Json = False,
) -> int:
    """Tell what recordings hold and what is wrong with them; of more than three files, a line each.

    Parameters
    ----------
    recordings : list of Path
        CSV, XLSX or Parquet files; each is one test.
    mapping : Path
        TOML file that says what the columns are.
    output : Path
        Page to write (.html): every channel drawn, with what was found marked at its rows.
    overwrite : bool
        Write over an existing page.
    json : bool
        Print results for a machine instead of a table.

    Returns
    -------
    int
        0 nothing wrong, 1 trouble found, 2 unusable input.
    """
    if output is not None:
        refuse_existing([output], overwrite, recordings, ".html")
    tests = read_recordings(recordings, mapping)
    with needs("study"):
        from thermocomp.cli import checked
        from thermocomp.recording.quality import check as findings_of
    findings = [findings_of(test) for test in tests]
    if output is not None:
        with needs("study"):
            from thermocomp.report import checks
        checks.write(tests, findings, output)
    checked.show_check(tests, findings, output, _console, as_json=json)
    return 1 if any(f.severity == "trouble" for found in findings for f in found) else 0


def select(
    recordings: Recordings,
    /,
    *,
    study: Study,
    method: SelectionMethod = "pareto",
    settings: Selector = Selector(),  # noqa: B008 - frozen
    beginning: Beginning = Beginning(),  # noqa: B008 - frozen
    output: OptionalOutput = None,
    overwrite: Flag = False,
    json: Json = False,
) -> int:
    """Choose the few temperature sensors that a model needs.

    Parameters
    ----------
    recordings : list of Path
        CSV, XLSX or Parquet files; each is one test.
    study : Study
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
        0 done, 2 unusable input.
    """
    settings.check(method)
    tests = read_recordings(recordings, study.mapping)
    with needs("study"):
        from thermocomp.assessment import selecting
        from thermocomp.assessment.splits import Judging
        from thermocomp.cli import output as out
    if output is not None:
        refuse_existing([output], overwrite, recordings, ".html")
    trouble = tell_trouble(tests)
    samples = study.samples(tests, beginning.of(tests, study.mapping))
    # only a budget is judged on unseen blocks; the others can do with a single thermal cycle
    judging = study.judging(samples) if method == "pareto" else Judging("", ())
    with by_steps(selecting.n_pieces(method, samples, judging, settings), hidden=json) as progress:
        choices = selecting.select(method, samples, judging, settings, jobs=study.jobs, progress=progress)
    if output is not None:
        with needs("study"):
            from thermocomp.report import html
        html.write_choices(choices, tests, output)
    out.show_choices(choices, output, trouble, _console, as_json=json)
    return 0


def fit(
    recordings: Recordings,
    /,
    *,
    study: Study,
    model: str = "dynamic",
    tilt: OptionalNames = None,
    output: Output,
    support: Policy = "clip",
    margin: float = 0.25,
    accept_unproven: str | None = None,
    compensator: Compensator = Compensator(),  # noqa: B008 - frozen
    beginning: Beginning = Beginning(),  # noqa: B008 - frozen
    overwrite: Flag = False,
    json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Fit a model, judge it on thermal cycles it has not seen, and write it with its honest error.

    The method is first judged on unseen cycles, then fitted to everything. A refused model is written too, with the
    refusal inside: nothing will run it. An unproven one runs in shadow only.

    Parameters
    ----------
    recordings : list of Path
        CSV, XLSX or Parquet files; each is one test.
    study : Study
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
        Who takes an unproven model all the same, and why: "NAME, REASON". It is written into the model file and said
        wherever the model is shown. A refused one is never taken.
    compensator : Compensator
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
    tests = read_recordings(recordings, study.mapping)
    if tilt:
        with needs("study"):
            from thermocomp.recording.tilts import with_tilts
        tests, names = with_tilts(tests, tilt)
        study = replace(study, target=[*study.target, *names])
    with needs("study"):
        from thermocomp.assessment import study as studies
        from thermocomp.assessment.compare import n_pieces
        from thermocomp.cli import output as out
        from thermocomp.core.model import Support
        from thermocomp.files import modelfile
    refuse_existing([output], overwrite, recordings, ".json")
    trouble = tell_trouble(tests)
    samples = study.samples(tests, beginning.of(tests, study.mapping))
    judging, how = study.judging(samples), Support(support, margin)
    with by_steps(n_pieces(samples, [model], judging) + len(samples.targets), hidden=quiet or json) as progress:
        result = studies.fit(
            samples,
            model,
            judging,
            rules=study.rules(),
            support=how,
            limits=compensator.limits(),
            recordings=tests,
            jobs=study.jobs,
            progress=progress,
        )
    result = replace(result, models=tuple(m.taken(accept_unproven or "") for m in result.models))
    modelfile.write(result.models, output, overwrite=overwrite)
    if not quiet:
        out.show_fit(result, output, trouble, _console, as_json=json)
    return 1 if any(a.word == "refused" for a in result.comparison.overall()) else 0


def assess(
    model: Path,
    recordings: Recordings,
    /,
    *,
    mapping: Path | None = None,
    harm_margin: float | None = None,
    compensator: Compensator = Compensator(),  # noqa: B008 - frozen
    beginning: Beginning = Beginning(),  # noqa: B008 - frozen
    json: Json = False,
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
        Harm in a single cycle that is let pass [um]; as in ``thermocomp fit`` if not given.
    compensator : Compensator
        Its limits: what would run is judged, not the model alone.
    beginning : Beginning
        How the recordings begin.
    json : bool
        Print results for a machine instead of a table.

    Returns
    -------
    int
        0 no model refused, 1 one was refused here or when it was fitted, or has learned from all there is to judge it
        on, 2 unusable input.
    """
    tests = read_recordings(recordings, mapping)
    with needs("study"):
        from thermocomp.assessment import study as studies
        from thermocomp.assessment.results import Rules
        from thermocomp.cli import output as out
        from thermocomp.files import modelfile
    models = modelfile.read(model)
    trouble = tell_trouble(tests)
    with by_steps(len(models), hidden=json) as progress:
        judged = studies.assess(
            models,
            tests,
            rules=Rules(harm_margin),
            limits=compensator.limits(),
            starts=beginning.of(tests, mapping),
            progress=progress,
        )
    out.show_assess(judged, trouble, _console, as_json=json)
    before = {m.honest_error.word for m in judged.models if m.honest_error is not None}
    return 1 if "refused" in before | {a.word for a in judged.overall()} else 0


def compare(
    recordings: Recordings,
    /,
    *,
    study: Study,
    models: Names = list(DEFAULT_MODELS),  # noqa: B006 - cyclopts shows it as the default and never changes it
    primary: str | None = None,
    compensator: Compensator = Compensator(),  # noqa: B008 - frozen
    beginning: Beginning = Beginning(),  # noqa: B008 - frozen
    output: OptionalOutput = None,
    overwrite: Flag = False,
    json: Json = False,
) -> int:
    """Compare methods on thermal cycles they have not seen, beside no compensation.

    Parameters
    ----------
    recordings : list of Path
        CSV, XLSX or Parquet files; each is one test.
    study : Study
        What is predicted from what, and on what it is judged.
    models : list of str
        Methods to compare, or all: ols, partial-f, mra, dynamic, grouping, subsets, ace, ace-monotone, mlp,
        mlp-sklearn, arx, arx-free-run, arx-net, ridge, pcr, pls, lasso, elastic-net, ppr, gp.
    primary : str
        Method that is named beforehand: it is judged as if it were the only one, the others are corrected for the
        number tried. Without it that goes for the recommended one, which is chosen anew without each cycle.
    compensator : Compensator
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
    tests = read_recordings(recordings, study.mapping)
    with needs("study"):
        from thermocomp.assessment import compare as comparing
        from thermocomp.cli import output as out
    if output is not None:
        refuse_existing([output], overwrite, recordings, ".html")
    trouble = tell_trouble(tests)
    samples = study.samples(tests, beginning.of(tests, study.mapping))
    judging, rules, limits = study.judging(samples), study.rules(primary), compensator.limits()
    with by_steps(comparing.n_pieces(samples, models, judging, rules), hidden=json) as progress:
        comparison = comparing.compare(
            samples, models, judging, rules=rules, limits=limits, jobs=study.jobs, progress=progress
        )
    if output is not None:
        with needs("study"):
            from thermocomp.report import html
        html.write(comparison, tests, output, samples)
    out.show_comparison(comparison, output, trouble, _console, as_json=json)
    if comparison.left:
        return STOPPED
    return 0 if all(comparison.best(c.name) is not None for c in samples.targets) else 1
