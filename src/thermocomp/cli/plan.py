"""`thermocomp plan`: sufficient test length, next test, and end of a running test."""

from dataclasses import replace
from pathlib import Path

from thermocomp.api.plan import EVERY, Planned, RunningTest
from thermocomp.api.testprogram import Dialect, picture_of, sheet_of
from thermocomp.cli.answers import free
from thermocomp.cli.face import CommandFace, command
from thermocomp.cli.terminal import console, print_table
from thermocomp.core.exceptions import InputError
from thermocomp.report.answer import CommandAnswer
from thermocomp.report.layout import Column, Layout, PrintedLine

#: number of tests shown without ``--details``
SHOWN = 5


def files_of(program: Path) -> list[Path]:
    """Return the program and the files written next to it."""
    if program.suffix.lower() in ("", ".csv", ".png"):
        raise InputError(
            f"{program}: name the NC program, such as test.ngc; the sheet and the figure next to it end in .csv and "
            ".png"
        )
    return [program, sheet_of(program), picture_of(program)]


@command(
    "thermocomp.api.plan:plan",
    writes=lambda program, _: files_of(program),
    instead={"running": "thermocomp.api.plan:may_stop"},
)
def plan(
    found: Planned | RunningTest,
    face: CommandFace,
    *,
    dialect: Dialect = "linuxcnc",
    probe_every: float = EVERY,
    running: bool = False,  # noqa: ARG001 - selects the other verb
) -> int:
    """Write and show the results.

    Parameters
    ----------
    output : Path
        Output NC program (.ngc, .nc ...); a measurement sheet (.csv) and a figure (.png) are written next to it.
    dialect : str
        Dialect of the NC program: linuxcnc or fanuc.
    probe_every : float
        Time between two measurements with a touch probe, for which the program stops the spindle [min]; 0: a logger
        measures continuously.
    running : bool
        For a test in progress, of which the recording up to now is given: check whether the current spindle run or stop
        may end.

    Returns
    -------
    int
        0 done, with --running: it may end; 1 with --running: continue the test; 2 unusable input.
    """
    content = {"trouble": face.trouble, "expected_um": None, "candidates": [], "curve": None, "running": None}
    if isinstance(found, RunningTest):
        running_test = CommandAnswer(head=found.words, table=_states(found))
        face.answer(lambda: {**content, "running": found.to_dict(), "files": []}, lambda: running_test, lambda: None)
        return 0 if found.may_stop else 1
    files = [] if face.output is None else files_of(face.output)
    if face.output is not None:
        found.write(face.output, dialect=dialect, every=probe_every, overwrite=face.overwrite)
    face.answer(
        lambda: {**content, **found.to_dict(), "files": list(map(str, files))},
        lambda: _answer(found, files, face),
        lambda: _show(found),
    )
    return 0


def _states(found: RunningTest) -> Layout:
    columns = (
        Column("target", lambda s: s[0]),
        Column("now", lambda s: s[1].change, ".1f", "um"),
        Column("steady state", lambda s: s[1].final, ".1f", "um"),
        Column("+- (k=2)", lambda s: s[1].uncertainty, ".1f", "um"),
        Column("required", lambda s: s[1].limit, ".1f", "um"),
    )
    return Layout(columns, found.states)


def _answer(found: Planned, files: list[Path], face: CommandFace) -> CommandAnswer:
    columns = (
        Column("next test", lambda c: c.trial.words),
        Column("expected gain", lambda c: c.gain, ".2f", "um"),
        Column("new conditions", lambda c: c.news),
    )
    followed = () if files else face.following("plan", output=free("next.ngc"))
    shown = found.plan.candidates[:SHOWN]
    return CommandAnswer(
        head=str(replace(found, trouble=(), curve=None)),
        table=Layout(columns, shown),
        lines=[PrintedLine(found.so_far)] if found.curve is not None else [],
        files=files,
        following=followed,
    )


def _show(found: Planned) -> None:
    columns = (
        Column("next test", lambda c: c.trial.words),
        Column("expected gain", lambda c: c.gain, ".2f", "um"),
        Column("range", lambda c: f"{c.gain_range[0]:.2f} to {c.gain_range[1]:.2f}", ">", "um"),
        Column("expected error during the test", lambda c: c.doubt, ".2f", "um"),
        Column("new conditions", lambda c: c.news),
    )
    p = found.plan
    caption = (
        f"{p.hours:g} h each, speeds up to {p.top_speed:,.0f} 1/min; expected error over all of them: {p.expected:.2f} "
        "um now (calculated, not verified on data)"
    )
    print_table(Layout(columns, p.candidates, caption=caption), console)
    if found.curve is not None:
        levels = (
            Column("training cycles", lambda x: x.learned, ">"),
            Column("unseen RMS", lambda x: x.rms, ".2f", "um"),
            Column("+-", lambda x: x.error, ".2f", "um"),
        )
        none = f"over all unseen rows, mean over targets; without compensation {found.curve.none:.2f} um"
        print_table(Layout(levels, found.curve.by_cycles(), caption=none), console)
        speeds = (Column("training speeds", lambda x: x.learned, ">"), *levels[1:])
        print_table(Layout(speeds, found.curve.by_speeds()), console)
