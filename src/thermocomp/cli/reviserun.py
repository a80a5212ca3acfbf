"""One run of ``thermocomp revise``: the files it reads and writes, all of them or none."""

import math
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import date, datetime
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple, TextIO

from thermocomp import __version__
from thermocomp.assessment.precompensation import Ledger, Proof, prove
from thermocomp.cli.progress import Share, by_share
from thermocomp.cli.revisetravel import Travel
from thermocomp.compensation.nc.drifting.drift import Drift
from thermocomp.compensation.nc.reading.tokens import program_lines
from thermocomp.compensation.nc.revising import diff, header
from thermocomp.compensation.nc.revising.course import Course, Run
from thermocomp.compensation.nc.revising.offset import ending
from thermocomp.compensation.nc.revising.revise import Revised, Revision
from thermocomp.core.exceptions import InputError, ProgramError
from thermocomp.files import jobstate, ncprogram
from thermocomp.files.draft import draft
from thermocomp.shopfloor.expand import expand

#: lines after which the bar moves
TOLD = 500


class Paths(NamedTuple):
    """The files that are written, by what they hold."""

    program: Path
    diff: Path
    table: Path
    job: Path
    picture: Path | None  #: None: there is no matplotlib to draw it
    expanded: Path | None  #: None: it is revised as it is

    @classmethod
    def of(cls, output: Path, *, expanded: bool) -> "Paths":
        """Return the names of the files beside a program."""

        def beside(end: str) -> Path:
            return output.with_name(output.name + end)

        drawn = beside(".png") if find_spec("matplotlib") is not None else None
        plain = beside(".expanded") if expanded else None
        return cls(output, beside(".diff"), beside(".csv"), beside(".job.json"), drawn, plain)

    def all(self) -> list[Path]:
        """Return those that will be there."""
        return [p for p in self if p is not None]


@dataclass(frozen=True)
class Job:
    """What is done to a program.

    Parameters
    ----------
    program : Path
    paths : Paths
    revision : Revision
    drift : Drift
        That of the revision.
    models : sequence of str
    start, zero, method : str
        For the header: which models, from what state, what the drift counts from, in what way.
    when : date
    interpreter : {'auto', 'off', 'required'}
    diameters : dict of int to float, optional
        Of the tools, for the expansion [mm].
    subroutines : sequence of Path
        Folders of subprograms, for the expansion.
    travel : Travel, optional
        Watches where the axes go.
    """

    program: Path
    paths: Paths
    revision: Revision
    drift: Drift
    models: Sequence[str]
    start: str
    zero: str
    method: str
    when: datetime
    interpreter: str
    diameters: Mapping[int, float] | None = None
    subroutines: Sequence[Path] = ()
    travel: Travel | None = None

    @property
    def begun(self) -> str:
        """Return how the run begins, in words."""
        return f"{self.start}, {self.zero}"


class Bound(NamedTuple):
    """How far the tool may be off in a cut, of one axis [um]."""

    axis: str
    low: float  #: of the drift, in the whole run
    high: float
    without: float  #: largest drift in a cut
    left: float  #: what the correction leaves of it, between its updates
    line: int  #: where
    model: float  #: how wrong the models may be; nan: they were never judged

    @property
    def most(self) -> float:
        """Return the bound; nan if there is none."""
        return self.left + self.model


class Done(NamedTuple):
    """What has come of it."""

    run: Run
    bounds: tuple[Bound, ...]
    proof: Proof | None
    unproved: str  #: why the interpreter has not judged it; empty if it has
    seconds: float  #: for the revision
    proving: float  #: for the proof


def revise(job: Job, *, hidden: bool) -> Done:
    """Revise a program and write all files; none if something is wrong.

    Raises
    ------
    InputError
        The program cannot be revised, or the interpreter disagrees.
    """
    paths = job.paths
    with ExitStack() as stack:
        # the program comes last: where it is, all is
        drafts = {p: stack.enter_context(draft(p)) for p in paths.all()}
        scratch = Path(stack.enter_context(TemporaryDirectory(prefix=".revise-", dir=paths.program.parent)))
        source, lines = job.program, None
        if paths.expanded is not None:
            source = drafts[paths.expanded]
            setup = job.revision.setup
            lines = expand(
                job.program,
                source,
                inch=setup.inch,
                startup=setup.startup or None,
                diameters=job.diameters,
                block_delete=setup.skip_optional,
                subroutines=job.subroutines,
            ).sources
        ledger, course = Ledger(), Course()
        watching = () if job.travel is None else (job.travel,)
        begin = time.perf_counter()
        try:
            with by_share("revising", hidden=hidden) as tell:
                blank = _write(job, source, scratch, drafts[paths.table], (ledger, course, *watching), tell)
        except ProgramError as e:
            if lines is not None and 0 < e.line <= len(lines):
                raise ProgramError(lines[e.line - 1] or 1, f"(line {e.line} when expanded) {e.reason}") from e
            raise
        took = time.perf_counter() - begin
        run = course.run()
        bounds = _bounds(job, run)
        filled = header.filled(_facts(job, bounds), ending(blank[0]))
        ncprogram.fill(scratch / "program", drafts[paths.program], dict(zip(blank, filled, strict=True)))
        ncprogram.fill(
            scratch / "diff", drafts[paths.diff], {f"+{b}": f"+{f}" for b, f in zip(blank, filled, strict=True)}
        )
        drafts[paths.job].write_text(jobstate.dumps(job.drift.state(), job.when), encoding="utf-8")
        begin = time.perf_counter()
        with by_share("proving", hidden=hidden) as tell:
            proof, unproved = _proved(job, source, drafts[paths.program], ledger, tell)
        if paths.picture is not None:
            from thermocomp.report import revision as pictures

            title = f"{job.program.name}, {job.begun}"
            pictures.write(run, job.drift.axes, job.revision.tool_changes, title, drafts[paths.picture])
        return Done(run, bounds, proof, unproved, took, time.perf_counter() - begin)


def _write(
    job: Job, source: Path, folder: Path, table: Path, listeners: Sequence[Ledger | Course | Travel], tell: Share
) -> tuple[str, ...]:
    """Write program, diff and table, and return the header that still says nothing."""
    size = max(source.stat().st_size, 1)
    axes = ["XYZ".index(axis) for axis in job.drift.axes]
    blank: tuple[str, ...] = ()

    def told(texts: Iterator[str], program: TextIO, rows: TextIO) -> Iterator[tuple[str, tuple[str, ...]]]:
        nonlocal blank
        read = number = 0
        for revised in job.revision.revise(texts):
            program.writelines(revised.texts)
            number += len(revised.texts)
            if revised.number:
                rows.write(_row(revised, number, axes))
                for listener in listeners:
                    listener.take(revised)
                read += len(revised.text)
                if revised.number % TOLD == 0:
                    tell(read / size, f"line {revised.number}")
            else:
                blank = revised.texts
                for listener in listeners:
                    if isinstance(listener, Ledger):  # it counts the lines that are written
                        listener.take(revised)
            yield revised.text, revised.texts

    with (
        ncprogram.opened(source) as texts,
        ncprogram.created(folder / "program") as program,
        ncprogram.created(folder / "diff") as written,
        table.open("w", encoding="utf-8", newline="\n") as rows,
    ):
        names = (f"{what}_{'xyz'[k]}_um" for k in axes for what in ("drift", "correction"))
        rows.write(",".join(("line", "revised_line", "start_s", "end_s", *names, "changed")) + "\n")
        pairs = told(program_lines(texts), program, rows)
        written.writelines(diff.unified(pairs, job.program.name, job.paths.program.name))
    return blank


def _row(revised: Revised, number: int, axes: Sequence[int]) -> str:
    in_hole = revised.block is not None and revised.block.kind == "cycle"  # it counts, not the level where a cycle ends
    carried = revised.inner if in_hole else revised.carried
    cells = "".join(f",{revised.deviation[k] + 0.0:.3f},{carried[k] + 0.0:.4f}" for k in axes)
    changed = revised.texts != (revised.text,)
    return f"{revised.number},{number},{revised.start:.3f},{revised.end:.3f}{cells},{changed:d}\n"


def _bounds(job: Job, run: Run) -> tuple[Bound, ...]:
    wrong, left = job.drift.uncertainty(), job.revision.left
    return tuple(
        Bound(
            axis,
            float(run.deviation[:, 0, k].min()),
            float(run.deviation[:, 1, k].max()),
            left.without[k],
            left.most[k],
            left.line[k],
            wrong[k],
        )
        for k, axis in enumerate("XYZ")
        if axis in job.drift.axes
    )


def _facts(job: Job, bounds: Sequence[Bound]) -> list[str]:
    """Return what the header says."""
    facts = [
        f"thermocomp {__version__}, {job.when.date()}, for {job.revision.setup.controller}",
        f"program {job.program.name}",
        *_together([f"model {m}" for m in job.models], 2),
        f"start {job.start}",
        job.zero,
        job.method,
        "bound "
        + ", ".join(f"{b.axis} {b.most:.1f} um" if math.isfinite(b.most) else f"{b.axis} not known" for b in bounds),
    ]
    # old controls end the program at a percent sign, even in a comment, and may have no lower case
    facts = [f.replace("%", "_") for f in facts]
    return [f.upper() for f in facts] if job.revision.setup.controller == "fanuc" else facts


def _together(facts: list[str], most: int) -> list[str]:
    """Return so many facts at most, the last ones on one line."""
    return facts if len(facts) <= most else [*facts[: most - 1], ", ".join(facts[most - 1 :])]


def _proved(job: Job, original: Path, revised: Path, ledger: Ledger, tell: Share) -> tuple[Proof | None, str]:
    """Return what the interpreter says, or why it was not asked."""
    required = job.interpreter == "required"
    if job.interpreter == "off":
        return None, "--interpreter off"
    if job.revision.setup.controller != "linuxcnc":
        return None, "a Fanuc program is not LinuxCNC's language"
    lines = max(job.revision.lines, 1)

    def progress(line: int) -> None:
        if line % TOLD == 0:
            tell(line / lines, f"line {line}")

    try:
        return prove(original, revised, ledger, job.revision.setup, progress), ""
    except ProgramError:
        raise
    except InputError as e:
        if required:
            raise
        return None, str(e)


def moment(text: str | None) -> datetime:
    """Return when it is: a date the user gives, or now.

    Raises
    ------
    InputError
        It is no date.
    """
    if text is None:
        return datetime.now().astimezone()
    try:
        given = date.fromisoformat(text)
    except ValueError as e:
        raise InputError(f"--date {text!r}: write year-month-day, such as 2026-01-31") from e
    return datetime(given.year, given.month, given.day).astimezone()
