"""``thermocomp papers``: reproduction of the papers' studies, their numbers next to ours."""

import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from thermocomp.cli.jsonoutput import print_json
from thermocomp.cli.options import OptionalOutput
from thermocomp.cli.progress import show_share
from thermocomp.cli.reading import read_recordings, tell_trouble
from thermocomp.cli.terminal import console, make_console, marked, print_table, words
from thermocomp.core.exceptions import InputError
from thermocomp.core.outputs import refuse_existing
from thermocomp.report.layout import Column, Layout, Toned

if TYPE_CHECKING:
    from collections.abc import Callable

    from thermocomp.papers.study import Claim, Study, StudyTable
    from thermocomp.papers.study import Progress as Told

Name = Literal["chen1996", "wessel2004", "hwang", "precompensation", "stepwise2017", "cross"]
Names = Annotated[list[Name], Parameter(show_default=False)]
Measured = Annotated[list[Path], Parameter(name="--with", show_default=False)]
#: not a study of a paper, but the table of all methods on all experiments (X-03)
CROSS = "cross"

#: width of the tables of `cross` [characters]
TABLE_WIDTH = 120

#: attributes of a claim by their keys in JSON
_CLAIM = {"ids": "ids", "claim": "text"} | {
    n: n for n in ("paper", "ours", "holds", "again", "finding", "softer", "testable")
}
_TONES = {"yes": "good", "no": "grave", "-": "soft"}


def papers(
    names: Names = [],  # noqa: B006 - never modified
    /,
    *,
    measured: Measured = [],  # noqa: B006 - never modified
    mapping: Path | None = None,
    target: list[str] | None = None,
    models: list[str] | None = None,
    physics: Literal["linear", "nonlinear"] | None = None,
    seed: int = 0,
    repeats: int = 3,
    jobs: int = 1,
    scheduler: str | None = None,
    output: OptionalOutput = None,
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """Reproduce the studies of five papers on the virtual machine: their numbers, ours, and whether their claims hold.

    A claim that does not hold is a result, not an error.

    Parameters
    ----------
    names : list of str
        Papers to reproduce; cross: a table of the methods on all experiments. Default: all five papers.
    measured : list of Path
        Measured recordings on which the methods of the study `cross` are judged as well; each one is a separate
        test.
    mapping : Path
        TOML mapping file: role and unit of each column of the measured recordings.
    target : list of str
        Displacement channels of the measured recordings on which cross judges the methods. Default: all of them.
    models : list of str
        Methods of cross, or "all". Default: those that run within seconds.
    physics : {'linear', 'nonlinear'}
        Physics of the virtual machine for wessel2004: linear, or nonlinear: joints, bearings and convection depend on
        temperature and speed.
    seed : int
        Random seed of the weather, the sensor noise and all other random draws.
    repeats : int
        Number of runs of each paper's study, with seeds 100 apart: claims that hold in some runs only are marked.
        Numbers and figures are those of the first run.
    jobs : int
        Number of parallel processes for the runs or the methods of cross; -1: one per core.
    scheduler : str
        Address of a Dask scheduler whose workers replace the local processes, such as tcp://192.168.1.20:8786.
    output : Path
        Output page with claims, figures and tables (.html).
    overwrite : bool
        Overwrite an existing page.
    json : bool
        Print results as JSON instead of tables.

    Returns
    -------
    int
        0 all studies were completed, whether their claims hold or not; 1 a study failed; 2 unusable input.
    """
    _check_numbers(seed, repeats, jobs)
    from thermocomp.judging.sharing import shared_among
    from thermocomp.papers import cross, studies
    from thermocomp.papers.studies import PHYSICS

    chosen: list[str] = list(dict.fromkeys(names)) or list(studies.STUDIES)
    for name in (n for n in chosen if physics and n not in PHYSICS):
        raise InputError(
            f"--physics is for {', '.join(PHYSICS)}, not for {name}: thermocomp papers {PHYSICS[0]} --physics {physics}"
        )
    asked = {"--with": measured, "--mapping": mapping, "--target": target, "--models": models}
    for option in (o for o, value in asked.items() if value):
        if CROSS not in chosen:
            raise InputError(f"{option} is for {CROSS}: thermocomp papers {CROSS} {option} ...")
        if not measured and option in ("--mapping", "--target"):
            raise InputError(f"{option} is for measured recordings: give them with --with")
    if output is not None:
        refuse_existing([output], overwrite, measured, ".html")
    tests = read_recordings(measured, mapping) if measured else []
    tell_trouble(tests)
    done: list[tuple[Study, float]] = []
    with shared_among(scheduler):
        for number, name in enumerate(chosen, start=1):
            begin = time.perf_counter()
            with show_share(f"{number}/{len(chosen)} {name}", hidden=json) as progress:
                if name == CROSS:
                    methods = models or cross.FAST
                    run = partial(cross.run, seed, recordings=tests, methods=methods, targets=target, jobs=jobs)
                else:
                    run = partial(studies.repeat, name, seed=seed, repeats=repeats, physics=physics, jobs=jobs)
                study = _tried(name, run, progress)
            done.append((study, time.perf_counter() - begin))
            if not json:
                _show(*done[-1])
    if output is not None:
        from thermocomp.papers.report import papers as pages

        pages.write([study for study, _ in done], output, seed=seed, overwrite=overwrite)
        if not json:
            console.print(f"Page: {words(output)}", soft_wrap=True)
    if json:
        print_json({"seed": seed, "repeats": repeats, "studies": [_content(*d) for d in done]})
    return 1 if any(not study.ran for study, _ in done) else 0


def _check_numbers(seed: int, repeats: int, jobs: int) -> None:
    if seed < 0:
        raise InputError(f"--seed {seed}: must not be negative")
    if repeats < 1:
        raise InputError(f"--repeats {repeats}: must be at least 1")
    if jobs == 0:
        raise InputError("--jobs 0: give a number of processes, or -1 for all cores")


def _tried(name: str, run: "Callable[..., Study]", progress: "Told") -> "Study":
    """Return a study; if it fails, a substitute that states the reason, so that the other studies still run."""
    from thermocomp.judging.pieces import explain
    from thermocomp.papers.studies import not_redone

    try:
        return run(progress=progress)
    except InputError:  # invalid input
        raise
    except Exception as e:  # noqa: BLE001 - a failure of one study does not affect the others
        return not_redone(name, explain(e))


def _show(study: "Study", seconds: float) -> None:
    from thermocomp.papers.report.papers import headline

    console.print(f"\n[bold]{words(study.title)}[/]")
    if study.claims:
        columns = (
            Column("id", lambda c: ", ".join(c.ids)),
            Column("claim", lambda c: c.text),
            Column("paper", lambda c: c.paper or "-"),
            Column("ours", lambda c: c.ours or "-"),
            Column("holds", _holds, whole=True),
        )
        print_table(Layout(columns, study.claims), console)
        for c in study.claims:
            if c.finding:
                console.print(f"{marked(Toned(', '.join(c.ids), _holds(c).tone))} {words(c.finding)}")
    if study.name == CROSS:
        # Numbers must not be truncated: a narrow terminal wraps whole lines instead.
        wide = make_console(width=max(console.width, TABLE_WIDTH))
        for t in study.tables:
            print_table(_laid_out(t), wide)
    said = f"{headline(study)}; " if study.claims else ""
    console.print(f"{words(said)}{seconds:.0f} s")


def _holds(claim: "Claim") -> Toned:
    return Toned(claim.verdict, _TONES.get(claim.verdict, "doubtful"))


def _laid_out(t: "StudyTable") -> Layout:
    from thermocomp.papers.report.papers import rows, words

    left = words(t)
    columns = [Column(h, k, "" if k in left else ">", whole=k == 0) for k, h in enumerate(t.header)]
    return Layout(columns, rows(t), caption=t.caption)


def _content(study: "Study", seconds: float) -> dict[str, Any]:
    return {
        "name": study.name,
        "title": study.title,
        "seconds": seconds,
        "claims": [{key: getattr(claim, name) for key, name in _CLAIM.items()} for claim in study.claims],
        "tables": [{"caption": t.caption, "header": t.header, "rows": t.rows} for t in study.tables],
        "numbers": study.numbers,
    }
