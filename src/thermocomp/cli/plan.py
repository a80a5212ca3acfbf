"""`thermocomp plan`: how much test is enough, which test next, and whether a running one may stop."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cyclopts import Parameter

from thermocomp.api.testprogram import Dialect, picture_of, sheet_of
from thermocomp.cli.beginning import Beginning
from thermocomp.cli.jsonoutput import print_json
from thermocomp.cli.options import OptionalOutput, StudyOptions
from thermocomp.cli.progress import show_steps
from thermocomp.cli.reading import read_recordings, tell_trouble
from thermocomp.cli.terminal import console, print_table, words
from thermocomp.core.exceptions import InputError

if TYPE_CHECKING:
    from thermocomp.api.plan import Planned
    from thermocomp.judging.planning.planning import Candidate
    from thermocomp.judging.settling.stopping import Running


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class NextTest:
    """What the next test may be.

    Parameters
    ----------
    top_speed : float
        The machine's highest spindle speed [1/min]; the highest recorded one if not given.
    hours : float
        Its length [h].
    swing : float
        How far the room's temperature may change within that time, where the machine stands [degC]; 0: it never does.
    dialect : str
        Of the NC program: linuxcnc or fanuc.
    probe_every : float
        Time between two measurements with a touch probe, for which the program stops the spindle [min]; 0: a logger
        measures all the time.
    """

    top_speed: float | None = None
    hours: float = 12.0
    swing: float = 5.0
    dialect: Dialect = "linuxcnc"
    probe_every: float = 30.0


def plan(
    recordings: list[Path],
    /,
    *,
    study: StudyOptions = StudyOptions(),  # noqa: B008 - frozen
    test: NextTest = NextTest(),
    beginning: Beginning = Beginning(),  # noqa: B008 - frozen
    no_curve: bool = False,
    running: bool = False,
    output: OptionalOutput = None,
    overwrite: bool = False,
    json: bool = False,
) -> int:
    """Say how much test is enough, and write the test that would teach most next as an NC program.

    Parameters
    ----------
    recordings : list of Path
        CSV, XLSX or Parquet files; each is one test.
    study : StudyOptions
        What is predicted from what, and what is left out in turn for the learning curve.
    test : NextTest
        What the next test may be.
    beginning : Beginning
        How the recordings begin.
    no_curve : bool
        Leave the learning curve out, which takes most of the time.
    running : bool
        The recording is that of a test that is still running: judge whether its run or stop may end.
    output : Path
        NC program to write (.ngc, .nc ...); beside it a sheet (.csv) for what is measured, and a figure (.png).
    overwrite : bool
        Write over existing files.
    json : bool
        Print results for a machine instead of tables.

    Returns
    -------
    int
        0 done, with --running: it may end; 1 with --running: go on; 2 unusable input.
    """
    if running:
        return _judge_running(recordings, study, output, as_json=json)
    files = [] if output is None else [output, sheet_of(output), picture_of(output)]
    if output is not None and output.suffix.lower() in ("", ".csv", ".png"):
        raise InputError(
            f"{output}: name the NC program, such as test.ngc; sheet and figure beside it end in .csv and .png"
        )
    ready = study.prepare(recordings, beginning, files, overwrite, "", judged=False)
    from thermocomp.api import plan as api
    from thermocomp.judging.planning import learningcurve

    steps = 1 + (0 if no_curve else learningcurve.n_pieces(api.units_of(ready)))
    with show_steps(steps, hidden=json) as progress:
        found = api.plan_from(
            ready,
            top_speed=test.top_speed,
            hours=test.hours,
            swing=test.swing,
            curve=not no_curve,
            jobs=study.jobs,
            progress=progress,
        )
    if output is not None:
        found.write(output, dialect=test.dialect, every=test.probe_every, overwrite=overwrite)
    _show(found, files, as_json=json)
    return 0


def _judge_running(recordings: list[Path], study: StudyOptions, output: Path | None, *, as_json: bool) -> int:
    if output is not None:
        raise InputError(f"{output}: --running judges a test, and writes none; leave -o out")
    tests = read_recordings(recordings, study.mapping)
    trouble = tell_trouble(tests)
    from thermocomp.api.plan import may_stop

    found = may_stop(tests, study.target)
    if as_json:
        print_json(_content(trouble, running=found))
    else:
        from thermocomp.report.layout import Column, Layout

        columns = (
            Column("target", lambda s: s[0]),
            Column("now", lambda s: s[1].change, ".1f", "um"),
            Column("steady state", lambda s: s[1].final, ".1f", "um"),
            Column("+- (k=2)", lambda s: s[1].uncertainty, ".1f", "um"),
            Column("enough", lambda s: s[1].limit, ".1f", "um"),
        )
        print_table(Layout(columns, found.states, caption="counted from the start of the run or stop"), console)
        console.print(f"[{'green' if found.may_stop else 'yellow'}]{words(found.words)}[/]", soft_wrap=True)
    return 0 if found.may_stop else 1


def _show(found: "Planned", files: Sequence[Path], *, as_json: bool) -> None:
    if as_json:
        print_json(_content(found.trouble, planned=found, files=files))
        return
    from thermocomp.report.layout import Column, Layout

    columns = (
        Column("next test", lambda c: c.trial.words),
        Column("would take off", lambda c: c.gain, ".2f", "um"),
        Column("expected error in it", lambda c: c.doubt, ".2f", "um"),
        Column("what is new in it", lambda c: c.news),
    )
    p = found.plan
    caption = (
        f"{p.hours:g} h each, speeds up to {p.top_speed:,.0f} 1/min; expected error over all of them {p.expected:.2f} "
        "um now: of a calculation, not judged"
    )
    print_table(Layout(columns, p.candidates, caption=caption), console)
    if found.curve is not None:
        levels = (
            Column("cycles learned from", lambda x: x.learned, ">"),
            Column("unseen RMS", lambda x: x.rms, ".2f", "um"),
            Column("+-", lambda x: x.error, ".2f", "um"),
        )
        none = f"mean over targets and unseen cycles; without compensation {found.curve.none:.2f} um"
        print_table(Layout(levels, found.curve.by_cycles(), caption=none), console)
        speeds = (Column("speeds learned from", lambda x: x.learned, ">"), *levels[1:])
        print_table(Layout(speeds, found.curve.by_speeds()), console)
    console.print(words(str(found)), soft_wrap=True)
    if files:
        console.print(f"Written: {words(', '.join(map(str, files)))}", soft_wrap=True)


def _content(
    trouble: Sequence[str],
    *,
    planned: "Planned | None" = None,
    running: "Running | None" = None,
    files: Sequence[Path] = (),
) -> dict[str, Any]:
    curve = planned.curve if planned else None
    return {
        "trouble": list(trouble),
        "expected_um": planned.plan.expected if planned else None,
        "candidates": [_told(c) for c in planned.plan.candidates] if planned else [],
        "curve": curve
        and {
            "model": curve.model,
            "none_rms_um": curve.none,
            "last_gain_um": curve.last_gain,
            "worth_um": curve.worth,
            "enough": curve.enough,
            "cycles": [x._asdict() for x in curve.by_cycles()],
            "speeds": [x._asdict() for x in curve.by_speeds()],
        },
        "running": running
        and {
            "phase": running.phase.kind,
            "hours": running.seconds / 3600,
            "may_stop": running.may_stop,
            "states": [{"target": n, **asdict(s), "limit": s.limit, "known": s.known} for n, s in running.states],
        },
        "files": [str(path) for path in files],
    }


def _told(c: "Candidate") -> dict[str, Any]:
    return {
        "kind": c.trial.kind,
        "words": c.trial.words,
        "speed_1_min": c.trial.speed,
        "steps": [{"speed_1_min": speed, "duration_s": duration} for speed, duration in c.trial.steps],
        "gain_um": c.gain,
        "expected_um": c.doubt,
        "news": c.news,
    }
