"""Revision of a program as a job: its files are written all together or not at all."""

import time
from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from datetime import datetime
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple, TextIO

from thermocomp import __version__
from thermocomp.core.exceptions import InputError, ProgramError
from thermocomp.files.draft import drafts
from thermocomp.nc.expansion.corners import write_corners
from thermocomp.nc.expansion.unroll import unroll
from thermocomp.nc.linuxcnc.expansion.expand import expand
from thermocomp.nc.linuxcnc.verification.verify import Ledger, Proof, prove
from thermocomp.nc.parser.tokens import program_lines
from thermocomp.nc.revision import headers, jobstate, ncprogram
from thermocomp.nc.rewrite import diff, header
from thermocomp.nc.rewrite.course import Bound, Course, Run, Travel
from thermocomp.nc.rewrite.offset import ending
from thermocomp.nc.rewrite.revise import Revised, Revision
from thermocomp.nc.thermal.drift import Drift

#: remedy in the error for a program that cannot be verified
ALL_THE_SAME = "--unproved writes it anyway, and its header states this"
#: names of the draft program and diff, whose header is still blank, and of the original without a byte-order mark
PROGRAM, DIFF, ORIGINAL = "program", "diff", "original"
#: larger programs are checked completely before their revision, which takes long [bytes]
LONG = 2_000_000
#: number of lines between progress reports
TOLD = 500


#: progress callback: fraction of the work done, and position
Tell = Callable[[float, str], None]
#: context of a phase of the work, by name, which provides the progress callback
Phase = Callable[[str], AbstractContextManager[Tell]]


class Paths(NamedTuple):
    """Paths of the output files, by content."""

    program: Path
    diff: Path
    table: Path
    job: Path
    picture: Path | None  #: None: matplotlib is not installed
    expanded: Path | None  #: None: the program is not expanded

    @classmethod
    def of(cls, output: Path, *, expanded: bool) -> "Paths":
        """Return the names of the output files for a given revised program."""

        def beside(end: str) -> Path:
            return output.with_name(output.name + end)

        drawn = beside(".png") if find_spec("matplotlib") is not None else None
        plain = beside(".expanded") if expanded else None
        return cls(output, beside(".diff"), beside(".csv"), beside(".job.json"), drawn, plain)

    def all(self) -> list[Path]:
        """Return the paths of the files to be written."""
        return [p for p in self if p is not None]


@dataclass(frozen=True)
class Job:
    """Data of the revision of one program.

    Parameters
    ----------
    drift : Drift
        Drift of the revision.
    taken : sequence of str
        Persons who approved unproven models, with reasons.
    start, zero, method : str
        Header texts: initial thermal state, zero of the drift, and method.
    unproved : bool
        The program is written without verification by an interpreter.
    diameters : dict of int to float, optional
        Tool diameters for the expansion [mm].
    subroutines : sequence of Path
        Folders of subprograms, for the expansion.
    travel : Travel, optional
        Monitor of the travel of the axes.
    overwrite : bool
        Existing files are replaced.
    """

    program: Path
    paths: Paths
    revision: Revision
    drift: Drift
    models: Sequence[str]
    taken: Sequence[str]
    start: str
    zero: str
    method: str
    when: datetime
    unproved: bool = False
    diameters: Mapping[int, float] | None = None
    subroutines: Sequence[Path] = ()
    travel: Travel | None = None
    overwrite: bool = False

    @property
    def begun(self) -> str:
        """Return the initial thermal state of the run as text."""
        return f"{self.start}, {self.zero}"


class Done(NamedTuple):
    """Result of the revision of a program."""

    run: Run
    bounds: tuple[Bound, ...]
    written: bool  #: False: nothing was corrected, and no files were written
    proof: Proof | None  #: None: not verified by the interpreter
    seconds: float  #: duration of the revision
    proving: float  #: duration of the verification


def revise(job: Job, phase: Phase) -> Done:
    """Revise a program and write all files, or none in case of an error or if there is nothing to correct."""
    try:
        return _revise(job, phase)
    except InputError as e:
        raise InputError(f"{job.program}: {e}") from e


def _revise(job: Job, phase: Phase) -> Done:
    paths = job.paths
    # the program is published last: if it exists, all other files exist
    with drafts(paths.all()[::-1], overwrite=job.overwrite) as started:
        folder = started[paths.program].parent
        source, lines = ncprogram.copy_without_mark(job.program, folder / ORIGINAL), None
        if paths.expanded is not None:
            plain, source = source, started[paths.expanded]
            lines = _expand(job, plain, source, phase)
        ledger, course = Ledger(), Course()
        watching = () if job.travel is None else (job.travel,)
        begin = time.perf_counter()
        try:
            if source.stat().st_size > LONG:
                _rehearse(job, source, phase)
            with phase("revising") as tell:
                blank = _write(job, source, folder, started[paths.table], (ledger, course, *watching), tell)
        except ProgramError as e:
            if lines is not None and 0 < e.line <= len(lines):
                line = lines[e.line - 1] or 1
                where = f"(line {e.line} when expanded) " if line != e.line else ""
                raise ProgramError(line, where + e.reason) from e
            raise
        took = time.perf_counter() - begin
        run = course.run()
        bounds = _bounds(job, run)
        if not job.revision.corrected:
            return Done(run, bounds, written=False, proof=None, seconds=took, proving=0.0)
        begin = time.perf_counter()
        proof = None
        if not job.unproved and not job.revision.ended:
            raise ProgramError(
                job.revision.lines,
                "the program has no end, and LinuxCNC's interpreter does not run it: add M2 or M30 as its last line",
            )
        if not job.unproved:
            with phase("proving") as tell:
                proof = _proved(job, source, folder / PROGRAM, ledger, tell)
        # the proved program has a blank header: from here on only its comments change
        filled = header.fill(
            _facts(job, bounds, proof), ending(blank[0]), len(blank), upper=job.revision.setup.controller == "fanuc"
        )
        ncprogram.replace_lines(folder / PROGRAM, started[paths.program], dict(zip(blank, filled, strict=True)))
        ncprogram.replace_lines(
            folder / DIFF, started[paths.diff], {f"+{b}": f"+{f}" for b, f in zip(blank, filled, strict=True)}
        )
        started[paths.job].write_text(jobstate.dumps(job.drift.state(), job.when), encoding="utf-8")
        if paths.picture is not None:
            from thermocomp.nc.report import revision as pictures

            title = f"{job.program.name}, {job.begun}"
            started[paths.picture].write_bytes(pictures.render(run, bounds, job.revision.tool_changes, title))
        started.publish()
        return Done(run, bounds, written=True, proof=proof, seconds=took, proving=time.perf_counter() - begin)


def _expand(job: Job, program: Path, out: Path, phase: Phase) -> "array[int]":
    """Write a program as plain lines, and return for each the number of its line in the program; 0 if it has none.

    A program for LinuxCNC is expanded by its interpreter, one for a Fanuc by a built-in unroller.
    """
    setup, sources = job.revision.setup, array("I")
    beside = [] if program == job.program else [job.program.parent]  # a copy is elsewhere
    with phase("expanding") as tell:
        if setup.controller == "linuxcnc":
            return expand(
                program,
                out,
                inch=setup.inch,
                startup=setup.startup or None,
                diameters=job.diameters,
                block_delete=setup.skip_optional,
                subroutines=[*beside, *job.subroutines],
                progress=lambda lines: tell(0.0, f"{lines:,} lines"),
            ).sources
        with ncprogram.open_to_read(program) as texts, ncprogram.open_to_write(out) as file:
            for text, line in write_corners(unroll(program_lines(texts), setup), setup):
                file.write(text)
                sources.append(line)
    return sources


def _rehearse(job: Job, source: Path, phase: Phase) -> None:
    size = source.stat().st_size
    with phase("checking") as tell, ncprogram.open_to_read(source) as texts:
        read = 0
        for block in job.revision.rehearse(program_lines(texts)):
            read += len(block.line.text)
            if block.line.number % TOLD == 0:
                tell(read / size, f"line {block.line.number}")


def _write(
    job: Job, source: Path, folder: Path, table: Path, listeners: Sequence[Ledger | Course | Travel], tell: Tell
) -> tuple[str, ...]:
    """Write program, diff and table, and return the header, which is still blank."""
    size = max(source.stat().st_size, 1)
    axes = ["XYZ".index(axis) for axis in job.drift.axes]
    blank: tuple[str, ...] = ()

    def told(texts: Iterator[str], program: TextIO, rows: TextIO) -> Iterator[tuple[str, tuple[str, ...]]]:
        nonlocal blank
        read = number = 0
        mark = ncprogram.MARK.decode("latin-1") * (job.paths.expanded is None and ncprogram.has_mark(job.program))
        for revised in job.revision.revise(texts):
            program.writelines(revised.texts)
            number += len(revised.texts)
            for listener in listeners:  # all but the ledger, which counts all lines written, ignore the header
                listener.take(revised)
            if revised.number:
                rows.write(_row(revised, number, axes))
                read += len(revised.text)
                if revised.number % TOLD == 0:
                    tell(read / size, f"line {revised.number}")
            else:
                blank = revised.texts
            # the diff is one of the file as it is, with its byte-order mark
            yield mark * (revised.number == 1) + revised.text, revised.texts

    with (
        ncprogram.open_to_read(source) as texts,
        ncprogram.open_to_write(folder / PROGRAM) as program,
        ncprogram.open_to_write(folder / DIFF) as written,
        ncprogram.open_to_write(table) as rows,
    ):
        columns = (f"{what}_{'xyz'[k]}_um" for k in axes for what in ("drift", "correction"))
        rows.write(",".join(("line", "revised_line", "start_s", "end_s", *columns, "changed")) + "\n")
        pairs = told(program_lines(texts), program, rows)
        names = header.clean_comment(job.program.name), header.clean_comment(job.paths.program.name)
        written.writelines(diff.unified(pairs, *names))
    return blank


def _row(revised: Revised, number: int, axes: Sequence[int]) -> str:
    in_hole = revised.block is not None and revised.block.kind == "cycle"  # inner, not final level
    carried = revised.inner if in_hole else revised.carried
    cells = "".join(f",{revised.deviation[k] + 0.0:.3f},{carried[k] + 0.0:.4f}" for k in axes)
    changed = revised.texts != (revised.text,)
    return f"{revised.number},{number},{revised.start:.3f},{revised.end:.3f}{cells},{changed:d}\n"


def _bounds(job: Job, run: Run) -> tuple[Bound, ...]:
    wrong, left = job.drift.uncertainty(), job.revision.left
    return tuple(
        Bound(
            axis=axis,
            low=float(run.deviation[:, 0, k].min()),
            high=float(run.deviation[:, 1, k].max()),
            without=left.without[k],
            left=left.most[k],
            line=left.line[k],
            model=wrong[k],
        )
        for k, axis in enumerate("XYZ")
        if axis in job.drift.axes
    )


def _facts(job: Job, bounds: Sequence[Bound], proof: Proof | None) -> list[str]:
    """Return the texts for the header of the revised program."""
    place = headers.describe_place(job.revision, job.drift.axes) if job.drift.by_position else []
    facts = [
        f"thermocomp {__version__}, {job.when.date()}, for {job.revision.setup.controller}",
        f"program {job.program.name}",
        *headers.describe_models(job.models),
        *headers.told_taken(job.taken),
        f"start {job.start}",
        job.zero,
        job.method,
        headers.describe_bound(bounds),
        *(
            text
            for c in headers.describe_conditions(job.revision, job.drift.axes)
            for text in header.wrap_text(c.replace("%", "pct"), 1)
        ),
        *place,
    ]
    # the first header line is the note of the revision
    return [*facts, *headers.describe_proof(proof, job.revision.header_lines - len(facts) - 1)]


def _proved(job: Job, original: Path, revised: Path, ledger: Ledger, tell: Tell) -> Proof:
    """Return the result of the verification by the interpreter."""
    lines, last = max(job.revision.lines, 1), 0

    def progress(line: int) -> None:
        nonlocal last
        if line >= last + TOLD:
            last = line
            tell(line / lines, f"line {line}")

    try:
        return prove(original, revised, ledger, job.revision.setup, progress)
    except ProgramError:
        raise
    except InputError as e:  # any reason that prevents the interpreter from verifying the program
        raise InputError(f"the revised program cannot be proved: {e}; {ALL_THE_SAME}") from e
