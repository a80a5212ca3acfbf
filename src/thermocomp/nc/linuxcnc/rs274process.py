"""LinuxCNC's interpreter in a child process: canonical calls of a program, in blocks of numbers.

The child runs isolated (``-I``) in a separate folder and reads a copy of the program there: no other file next to the
program is imported or run, only subprograms (``.ngc``) are found. The copy is ASCII: the interpreter's module cannot
report comments with other characters.
"""

import json
import os
import random
import re
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import IO, Any, NamedTuple, NoReturn

import numpy as np

from thermocomp.core.exceptions import InputError, ProgramError
from thermocomp.files.scratch import scratch

#: Python of the Debian system, for which the module `gcode` is installed.
PYTHON = Path("/usr/bin/python3")
#: isolated from the user's environment and folders
ISOLATED = "-I"
CHILD = Path(__file__).with_name("_rs274_child.py")
AXES = "XYZABCUVW"
MOST_FOLDERS = 8
HIGHEST_TOOL = 1000
#: work coordinate systems, G54 to G59.3
SYSTEMS = range(1, 10)
MM = 25.4
#: a canonical call: code of its kind, count of numbers, line, numbers
RECORD = np.dtype([("kind", "<u2"), ("count", "<u2"), ("line", "<i4"), ("values", "<f8", (10,))])
#: unit conversion factors of the axes of a move
_UNITS = np.array((MM, MM, MM, 1.0, 1.0, 1.0, MM, MM, MM, 1.0))
_ASCII = bytes(range(128)) + b"?" * 128
_PIPE = 1 << 20
#: message of the interpreter about a subprogram that is not found
_NOT_THERE = re.compile(r"(?:EOF in file|Unable to open file).*?(o<[^>]*>)(?: from line: \d+)?.*")
_TOO_DEEP = "Too many subroutine levels"
_RECURSION = "more than 10 nested calls: a subprogram that calls itself does not end; write a loop instead"
_MISSING = r"\1 was not found: for a subprogram, name its folder (--subroutines); for a loop or a branch, write its end"


@dataclass(frozen=True)
class Stored:
    """State stored in the controller and not in the program.

    Parameters
    ----------
    origins : dict of int to sequence of float
        Origins of the work coordinate systems, 1 (G54) to 9 (G59.3), X to W [mm, deg]; the others are 0.
    rotations : dict of int to float
        Rotations of the work coordinate systems about Z [deg].
    shift : sequence of float
        G92 offset in force, X to W [mm, deg].
    lengths, diameters : dict of int to float
        Dimensions of the tools [mm]; all tools up to 1000 are included, those not listed with 0.
    active_length : float
        Tool length offset in force at the start [mm].
    spindle : int
        Number of the tool in the spindle at the start; 0: none.
    home28, home30 : sequence of float
        Positions approached by G28 and G30, X to W [mm, deg].
    startup : str
        Codes in force at the start that the end of a program does not reset, such as ``G64 P0.01 G98`` (mm).
    start : sequence of float or None
        Machine coordinates at the start, X to W [mm, deg]; None: the origin of the first work coordinate system.
    parameters : dict of int to float
        Other parameters, such as ``#100``.
    system : int
        Work coordinate system in force at the start: 1, G54, after the end of a program; any after an MDI command.
    """

    origins: Mapping[int, Sequence[float]] = field(default_factory=dict)
    rotations: Mapping[int, float] = field(default_factory=dict)
    shift: Sequence[float] = ()
    lengths: Mapping[int, float] = field(default_factory=dict)
    diameters: Mapping[int, float] = field(default_factory=dict)
    active_length: float = 0.0
    spindle: int = 0
    home28: Sequence[float] = ()
    home30: Sequence[float] = ()
    startup: str = "G64 G98"
    start: Sequence[float] | None = None
    parameters: Mapping[int, float] = field(default_factory=dict)
    system: int = 1

    def numbers(self) -> dict[int, float]:
        """Return the state as numbered parameters (#5161 and so on), as the controller stores it."""
        result = dict(self.parameters)
        result |= {5161 + i: value for i, value in enumerate(self.home28)}
        result |= {5181 + i: value for i, value in enumerate(self.home30)}
        result |= {5211 + i: value for i, value in enumerate(self.shift)}
        result[5210] = float(any(self.shift))
        result[5220] = float(self.system)
        for system, origin in self.origins.items():
            result |= {5201 + 20 * system + i: value for i, value in enumerate(origin)}
        result |= {5210 + 20 * system: angle for system, angle in self.rotations.items()}
        return result


@lru_cache(64)
def draw_controller(seed: int, startup: str = "") -> Stored:
    """Return a random controller state; states of different seeds share only the codes in `startup`.

    Returns
    -------
    Stored
        Origins and homes within 300 mm, rotations within 20 degrees, a G92 shift within 10 mm, tools of 20 to 200 mm.
    """
    chance = random.Random(seed)

    def some(count: int, most: float = 300.0) -> tuple[float, ...]:
        return tuple(round(chance.uniform(-most, most), 6) for _ in range(count))

    codes = [startup]
    codes += [f"G64 P0.{seed}"] * ("G6" not in startup) + [f"G9{8 + seed % 2}"] * ("G9" not in startup)
    tools = range(1, HIGHEST_TOOL)
    return Stored(
        origins={system: some(9) for system in SYSTEMS},
        rotations={system: some(1, 20.0)[0] for system in SYSTEMS},
        shift=some(9, 10.0),
        lengths={tool: round(chance.uniform(20.0, 200.0), 6) for tool in tools},
        diameters={tool: round(chance.uniform(0.001, 0.1), 6) for tool in tools},
        active_length=round(chance.uniform(20.0, 200.0), 6),
        spindle=HIGHEST_TOOL - seed,
        home28=some(9),
        home30=some(9),
        startup=" ".join(codes),
        start=some(9),
        parameters=dict(zip(range(31, 5001), some(4970, 1000.0), strict=True)),
    )


class CallBlock(NamedTuple):
    """Canonical calls of one output block."""

    records: np.ndarray[tuple[int], np.dtype[Any]]  #: layout `RECORD`; moves in program coordinates [mm, deg]
    more: list[Any]  #: texts and curves; the first number of their record is the index in this list


@dataclass(frozen=True)
class InterpreterJob:
    """Program, and the controller in which it runs.

    Parameters
    ----------
    inch : bool
        G20 is in force when the program starts.
    block_delete : bool
        Lines that begin with ``/`` are not run.
    subroutines : sequence of Path
        Folders of subprograms, at most 8; the folder of the program is always searched first.
    task : bool
        Value of ``#<_task>``: the program is run, not previewed.
    seconds : int
        Maximum processor time of the interpreter [s].
    """

    path: Path
    stored: Stored = Stored()
    inch: bool = False
    block_delete: bool = False
    subroutines: Sequence[Path] = ()
    task: bool = False
    seconds: int = 600


class InterpreterRun:
    """Consecutive runs of the interpreter, which is started on creation and stopped at the end of the `with` block.

    Parameters
    ----------
    *jobs : InterpreterJob
        Jobs, all of the same program.

    Attributes
    ----------
    codes : dict of str to int
        Numeric codes of the kinds of calls.
    """

    def __init__(self, *jobs: InterpreterJob) -> None:
        path, subroutines = jobs[0].path.absolute(), jobs[0].subroutines
        if not path.is_file():
            raise InputError(f"{path} is not a file")
        if len(subroutines) > MOST_FOLDERS:
            raise InputError(
                f"found {len(subroutines)} folders of subprograms; the interpreter reads up to {MOST_FOLDERS}"
            )
        self.jobs, self.path, self._number = jobs, path, -1
        self._home = ExitStack()
        self.folder = self._home.enter_context(scratch())
        copy = self.folder / "program.ngc"
        lines = 1
        with path.open("rb") as program, copy.open("wb") as written:
            while part := program.read(_PIPE):
                lines += part.count(b"\n")
                written.write(part.translate(_ASCII))
        folders = [self.folder / str(number) for number in range(len(jobs))]
        for folder, job in zip(folders, jobs, strict=True):
            _lay_out(folder, copy, [path.parent, *subroutines], job, lines)
        with (self.folder / "errors").open("wb") as errors:
            self.process = subprocess.Popen(
                [PYTHON, ISOLATED, CHILD, *folders],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=errors,
                cwd=self.folder,
                pipesize=_PIPE,
            )
        self.codes: dict[str, int] = {}

    def __enter__(self) -> "InterpreterRun":
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()  # no effect on an ended process
        self.process.communicate()
        self._home.close()

    def blocks(self) -> Iterator[CallBlock]:
        """Yield the records of the interpreter for the next job; the last record is ``done``."""
        pipe = self.process.stdout
        assert pipe is not None
        self._number += 1
        if not self.codes:
            if not (first := pipe.readline()):
                self._ended(0, self.process.wait())
            self.codes = {kind: code for code, kind in enumerate(json.loads(first))}
        moves = [self.codes[kind] for kind in ("rapid", "feed", "probe", "arc")]
        line, file, refusal, done = 0, "", "", False
        while len(head := pipe.read(8)) == 8:
            count, size = np.frombuffer(head, "<u4").tolist()
            records = np.frombuffer(_all(pipe, count * RECORD.itemsize), RECORD).copy()
            block = CallBlock(records, json.loads(_all(pipe, size)))
            if not count:
                if refusal:
                    where = f" (in {Path(file).name})" if file else ""
                    raise ProgramError(max(line, 1), f"the interpreter refuses the program{where}: {refusal}")
                if not done:
                    self._ended(line, block.more[0])
                return
            is_move = np.isin(records["kind"], moves)
            if is_move.any():
                records["values"][is_move] *= _UNITS
            for told in records[records["kind"] == self.codes["file"]]:
                file = block.more[int(told["values"][0])]
            line, kind = int(records["line"][-1]), int(records["kind"][-1])
            done = kind == self.codes["done"]
            if kind == self.codes["error"]:
                refusal = _NOT_THERE.sub(_MISSING, block.more[-1].replace(_TOO_DEEP, _RECURSION))
                block = CallBlock(records[:-1], block.more)
            if len(block.records):
                yield block
        self._ended(line, self.process.wait())

    def _ended(self, line: int, code: int) -> NoReturn:
        """Raise the error for a child process that ended too early."""
        words = (self.folder / "errors").read_text(encoding="utf-8", errors="replace").strip().splitlines()
        if code == -24:
            seconds = self.jobs[self._number].seconds
            raise ProgramError(
                max(line, 1), f"the program takes more than {seconds} s to interpret: check it for an endless loop"
            )
        said = words[-1] if words else "no message"
        if code < 0:
            raise ProgramError(max(line, 1), f"the interpreter was ended by signal {-code}: {said}")
        raise InputError(f"LinuxCNC's interpreter ended with code {code}: {said}")

    def opened(self) -> set[Path]:
        """Return the files opened by the last job: the program and its subprograms."""
        names = map(os.fsdecode, (self.folder / str(self._number) / "opened").read_bytes().split(b"\0"))
        folder = self.folder.resolve()
        return {self.path.resolve(), *(file for file in map(Path, names) if not file.is_relative_to(folder))}

    def left(self) -> dict[int, float]:
        """Return the parameters that the controller would store after the last job."""
        text = (self.folder / str(self._number) / "parameters").read_text(encoding="ascii")
        rows = (row.split() for row in text.splitlines())
        return {int(row[0]): float(row[1]) for row in rows if len(row) == 2}


def run_through(job: InterpreterJob) -> None:
    """Run a program and discard its calls; raises the errors of `InterpreterRun.blocks`."""
    with InterpreterRun(job) as run:
        for _ in run.blocks():
            pass


def _all(pipe: IO[bytes], size: int) -> bytes:
    found = pipe.read(size)
    if len(found) < size:
        raise InputError("LinuxCNC's interpreter ended before its output was complete")
    return found


def _lay_out(folder: Path, program: Path, folders: Sequence[Path], job: InterpreterJob, lines: int) -> None:
    """Write the files of a run; links keep lines of the settings within the limit of 255 characters."""
    stored = job.stored
    folder.mkdir()
    names = [f"s{i}" for i in range(len(folders))]
    for name, target in zip(names, folders, strict=True):
        (folder / name).symlink_to(target.absolute())
    paths = ":".join(f"{folder.name}/{name}" for name in names)
    (folder / "ini").write_text(f"[RS274NGC]\nSUBROUTINE_PATH = {paths}\n", encoding="ascii")
    numbers = sorted(stored.numbers().items())
    (folder / "parameters").write_text("".join(f"{n}\t{v:.9f}\n" for n, v in numbers), encoding="ascii")
    tools = [(n, stored.lengths.get(n, 0.0), stored.diameters.get(n, 0.0)) for n in range(1, HIGHEST_TOOL)]
    table = "".join(f"T{n} P{n} Z{length:.9f} D{diameter:.9f}\n" for n, length, diameter in tools)
    (folder / "table").write_text(table, encoding="ascii")
    start = ""
    if stored.start is not None:
        start = " G53 G0 " + " ".join(f"{a}{v:.9f}" for a, v in zip(AXES, stored.start, strict=False))
    given = {
        "program": str(program),
        "folders": [str(target.absolute()) for target in folders],
        "lines": lines,
        "home": str(folder),
        "ini": str(folder / "ini"),
        "parameters": str(folder / "parameters"),
        "table": str(folder / "table"),
        "opened": str(folder / "opened"),
        "tools": tools,
        "spindle": stored.spindle,
        "units": f"G21 G90 G17 G40 G49 G80 G94 {stored.startup}{start}",
        # the child waits for this comment and the following tool length: then the program begins
        "start": f"(begin) G2{int(not job.inch)} G43.1 Z{stored.active_length / (25.4 if job.inch else 1.0):.9f}",
        "block_delete": job.block_delete,
        "task": int(job.task),
        "seconds": job.seconds,
    }
    (folder / "job").write_text(json.dumps(given), encoding="utf-8")
