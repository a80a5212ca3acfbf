"""`thermocomp revise`: correct an NC program for the thermal drift it will cause, before it is run."""

import math
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from cyclopts import Group, Parameter

from thermocomp.cli import loudness
from thermocomp.cli.answers import print_answer
from thermocomp.cli.jsonoutput import print_json
from thermocomp.cli.options import Output
from thermocomp.cli.progress import show_share
from thermocomp.cli.terminal import console, print_table, words
from thermocomp.nc.revision import headers, outcome
from thermocomp.nc.revision.job import Done, Job
from thermocomp.nc.revision.job import revise as revise_program
from thermocomp.nc.revision.options import Controller, Timing, Way
from thermocomp.nc.revision.prepare import prepare_job
from thermocomp.nc.revision.thermaloptions import Drifting, Starting
from thermocomp.nc.rewrite.course import Bound
from thermocomp.report.answer import CommandAnswer
from thermocomp.report.layout import Column, Layout, PrintedLine

#: minimum number of lines for which a time per line is reported
MANY = 1000


_GROUPS = {
    "Drift: models and inputs": Drifting,
    "Initial thermal state: exactly one of --cold, --carried, --measured": Starting,
    "Revision": Way,
    "Controller: settings that are not in the program": Controller,
    "Machining time": Timing,
}
for order, (title, group) in enumerate(_GROUPS.items(), start=1):
    Parameter(name="*", group=Group(title, sort_key=order))(group)


def revise(
    program: Path,
    /,
    *,
    drifting: Drifting,
    output: Output,
    starting: Starting = Starting(),
    way: Way = Way(),
    controller: Controller = Controller(),
    timing: Timing = Timing(),
    date: str | None = None,
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """Correct an NC program for the thermal drift it will cause, before it is run.

    The program is interpreted and timed as by the controller, and its spindle speed drives the models; the predicted
    drift is subtracted from its coordinates. A program that cannot be corrected safely is refused with line and reason.
    The original program is not changed. These files are written next to the new program: the differences (.diff), a
    table of all lines (.csv), a figure (.png), and the thermal state of the machine at the end (.job.json), from which
    the next job can start.

    Parameters
    ----------
    program : Path
        NC program (ISO 6983, as LinuxCNC and Fanuc controls read it).
    drifting : Drifting
        Models and inputs of the thermal drift.
    output : Path
        Output program.
    starting : Starting
        Thermal state of the machine at the start of the program.
    way : Way
        Method of correction.
    controller : Controller
        Settings of the controller that are not in the program.
    timing : Timing
        Dynamics and waiting times of the machine.
    date : str
        Date for the header of the program, such as 2026-01-31. Default: today.
    overwrite : bool
        Overwrite existing files, but never the original program.
    json : bool
        Print results as JSON instead of tables.

    Returns
    -------
    int
        0 done, 1 no correction was needed and nothing was written, 2 the program or another input is invalid.
    """
    groups = drifting, starting, way, controller, timing
    job, notes = prepare_job(program, output, *groups, when=date, overwrite=overwrite)
    loudness.tell(f"read {job.program}")
    # piped output: progress goes to stderr, whatever stdout is used for
    done = revise_program(job, partial(show_share, hidden=json and sys.stderr.isatty()))
    if json:
        print_json(outcome.content(job, done, notes))
    else:
        print_answer(_answer(job, done, notes), console, hint=not loudness.details)
        if loudness.details:
            _show(job, done, notes)
    return 0 if done.written else 1


def _answer(job: Job, done: Done, notes: Sequence[str]) -> CommandAnswer:
    revision, proof = job.revision, done.proof
    changed = f"{_many(revision.changed, 'line')} of {revision.lines:,} changed"
    said = (
        [] if proof is None else [f"LinuxCNC's interpreter ran both programs: {_many(proof.moves, 'move')} as meant."]
    )
    return CommandAnswer(
        head=f"{job.program}: {changed if done.written else outcome.explain_nothing(job, done)}; runs "
        f"{outcome.duration(revision.seconds)}; {_spindle(job)}.",
        table=_bounds(done.bounds),
        lines=[PrintedLine(f"Start: {job.begun}; {job.method}."), *_conditions(job), *map(PrintedLine, said)],
        warnings=[*outcome.warnings(job, done), *notes, *outcome.describe_place(job, done)],
        files=job.paths.all() if done.written else (),
    )


def _show(job: Job, done: Done, notes: Sequence[str]) -> None:
    """Print the changes to a program, and the residual error of the tool."""
    revision = job.revision

    def say(mark: str, text: str) -> None:
        console.print(f"{mark} {words(text)}".lstrip(), soft_wrap=True)

    console.print(
        f"[bold]{words(job.program)}[/]: {_many(revision.lines, 'line')}, "
        f"{revision.changed if done.written else 'none'} of them changed; "
        f"runs {outcome.duration(revision.seconds)}; {_spindle(job)}; "
        f"{_many(len(revision.tool_changes), 'tool change')}",
        soft_wrap=True,
    )
    say("", f"Start: {job.begun}; {job.method}")
    print_table(_bounds(done.bounds), console)
    for line in _conditions(job):
        say("", line.text)
    if (proof := done.proof) is not None:
        say(
            "[green]proved[/]",
            f"LinuxCNC's interpreter ran both programs: {_many(proof.moves, 'move')}, each equal to the original plus "
            f"its correction within {max(proof.largest, 0.001):.3f} um",
        )
        say(
            "[green]proved[/]",
            f"{proof.sentence}; the duration of each move is equal within {max(proof.slower, 0.1):.1f} %",
        )
    for warning in outcome.warnings(job, done):
        say("[yellow]but[/]", warning)
    for note in (*notes, *outcome.describe_place(job, done)):
        say("[yellow]note[/]", note)
    took = f"revised in {done.seconds:.1f} s"
    if revision.lines >= MANY:
        took += f", {1e6 * done.seconds / revision.lines:.0f} us per line"
    console.print(f"[dim]{took}; verification and figure {done.proving:.1f} s[/]")
    if done.written:
        say("", f"Written: {', '.join(map(str, job.paths.all()))}")
    else:
        say("[bold yellow]nothing written:[/]", outcome.explain_nothing(job, done))


def _bounds(bounds: Sequence[Bound]) -> Layout:
    columns = (
        Column("axis", lambda b: b.axis),
        Column("drift from", lambda b: b.low, "um"),
        Column("to", lambda b: b.high, "um"),
        Column("in the cuts", lambda b: b.without, "um"),
        Column("residual in the cuts", lambda b: b.left, "um"),
        Column("at line", lambda b: b.line or "", ">"),
        Column("model", lambda b: _known(b, b.model), "um"),
        Column("bound", lambda b: _known(b, b.most), "um"),
    )
    caption = (
        "um; model: largest error of the model on unseen cycles; bound of a cut = residual between updates + model"
    )
    return Layout(columns, bounds, caption=caption)


def _conditions(job: Job) -> list[PrintedLine]:
    """Return lines about what the bound assumes, and what other runs would add to it."""
    said = headers.describe_conditions(job.revision, job.drift.axes)
    return [PrintedLine(f"Bound: {text}.") for text in said if not text.endswith(": none")]


def _known(bound: Bound, value: float) -> str | float:
    return "not known" if math.isnan(bound.model) else value


def _many(n: int, what: str) -> str:
    return f"{n:,} {what}{'s' * (n != 1)}"


def _spindle(job: Job) -> str:
    slowest, fastest = job.revision.slowest, job.revision.fastest
    if not fastest:
        return "the spindle is stopped"
    return f"spindle {slowest:g} 1/min" if slowest == fastest else f"spindle {slowest:g} to {fastest:g} 1/min"
