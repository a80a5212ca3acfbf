"""Expansion of an NC program: loops, parameters, subprograms, cycles and G91 become plain lines; verified."""

import re
from array import array
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from itertools import zip_longest
from pathlib import Path
from typing import Any

from thermocomp.core.exceptions import InputError, ProgramError
from thermocomp.files.draft import draft
from thermocomp.nc.linuxcnc.expansion.origins import DEPENDS, G10, SYSTEMS, Side
from thermocomp.nc.linuxcnc.expansion.plain import Writer
from thermocomp.nc.linuxcnc.expansion.proof import compare, compare_parameters
from thermocomp.nc.linuxcnc.rs274 import Canonical, read
from thermocomp.nc.linuxcnc.rs274process import InterpreterJob, Stored, draw_controller, run_through
from thermocomp.nc.rewrite.header import clean_comment

_NO_CODE = re.compile(r"\([^)]*\)|<[^>]*>|;.*|\s")
_ORIENTS = re.compile(r"M0*19(?:\.0*)?(?![0-9.])")
#: diameter and radius mode of X, for which the interpreter makes no call; plain lines use radii
_DIAMETERS = re.compile(r"G0*[78](?:\.0*)?(?![0-9.])")
#: codes that end the main program like M2 when read here, but repeat it on the machine
_REPEATS = re.compile(r"M(?:0*99(?:\.0*)?(?![0-9.])|[-+]*[#\[])")
#: seeds of the controllers in which a program is expanded, and in which it is verified
_WRITTEN, _PROVED = (1, 2), (3, 4)
#: number of lines between progress reports
_OFTEN = 1000
#: maximum length of the program's name in a comment, for old controls
_NAME = 48
#: maximum number of lines written
MOST = 2_000_000


@dataclass(frozen=True)
class Expansion:
    """Plain program written by `expand`.

    Parameters
    ----------
    sources : array of int
        For each line of the output file: number of its line in the program; 0 if it has none.
    acts : int
        Number of moves, dwells, stops, tool changes ... compared with those of the program.
    """

    path: Path
    sources: "array[int]"
    acts: int


@dataclass(frozen=True)
class _Around:
    """Environment in which a program is run; see `expand`."""

    inch: bool | None
    startup: str | None
    diameters: Mapping[int, float]
    block_delete: bool
    subroutines: Sequence[Path]
    user_codes: bool
    systems: Mapping[int, int]  #: work coordinate system in force at the start, by seed

    @property
    def settings(self) -> dict[str, Any]:
        """Fields of `InterpreterJob` that are the same in every run."""
        return {"inch": bool(self.inch), "block_delete": self.block_delete, "subroutines": self.subroutines}

    def run(self, path: Path, stored: Stored, **more: Any) -> Generator[Canonical]:
        """Run a program in this environment, in a controller with the given stored values."""
        return read(path, stored, **self.settings, **more)

    def controller(self, seed: int) -> Stored:
        """Return the state of a simulated controller; states of different seeds share only the specified settings."""
        stored = draw_controller(seed, self.startup or "")
        return replace(stored, diameters={**stored.diameters, **self.diameters}, system=self.systems[seed])


def expand(
    path: Path,
    out: Path,
    *,
    inch: bool | None = None,
    startup: str | None = None,
    diameters: Mapping[int, float] | None = None,
    block_delete: bool = False,
    subroutines: Sequence[Path] = (),
    user_codes: bool = False,
    progress: Callable[[int], object] = lambda _: None,
) -> Expansion:
    """Write a program as plain lines with the same effect on every machine, whatever its origins and tool lengths.

    LinuxCNC's interpreter runs the program in two controllers with different origins, tool lengths, homes, parameters,
    tools in the spindle and start positions, and the result contains what both runs have in common. Then program and
    result are run in two further controllers and must make the same moves within 1e-6 mm, with the same feeds, spindle,
    coolant, stops and tools, and leave the same origins. Texts of ``(PRINT,...)`` and ``(LOG,...)`` are omitted.

    Parameters
    ----------
    startup : str, optional
        Codes in force at the start that the end of a program does not reset, such as ``G64 P0.01 G98`` [mm]. Canned
        cycles need them; the program must specify those not given (G61, G61.1 or G64; G98 or G99).
    diameters : dict of int to float, optional
        Tool diameters [mm], used to compute G41 and G42. A program that uses a different diameter, stored in the
        controller, is refused.
    """
    if not path.is_file():
        raise InputError(f"{path} is not a file")
    systems = _start_systems(path, block_delete)
    around = _Around(
        inch=inch,
        startup=startup,
        diameters=diameters or {},
        block_delete=block_delete,
        subroutines=subroutines,
        user_codes=user_codes,
        systems=systems,
    )
    acts = 0
    # endless loops are refused before the moves are used
    run_through(InterpreterJob(path, around.controller(_WRITTEN[0]), **around.settings))
    with draft(out, overwrite=False) as part:
        sources: array[int] = array("I")
        with part.open("w", encoding="ascii", newline="\n") as file:
            for text, line in _lines(path, around):
                file.write(text + "\n")
                sources.append(line)
                if not len(sources) % _OFTEN:
                    progress(len(sources))
                if len(sources) > MOST:
                    raise ProgramError(
                        line, f"more than {MOST:,} plain lines would be written: check the program for an endless loop"
                    )
        for seed in _PROVED:
            left: tuple[dict[int, float], dict[int, float]] = ({}, {})
            stored = around.controller(seed)
            try:
                with (
                    closing(around.run(path, stored, left=left[0])) as asked,
                    closing(around.run(part, stored, left=left[1])) as done,
                ):
                    acts = compare(asked, done)
                compare_parameters(*left)
            except ProgramError as error:
                raise ProgramError(
                    error.line, f"the program cannot be written as plain lines: {error.reason}"
                ) from error
    return Expansion(out, sources, acts)


def _lines(path: Path, around: _Around) -> Iterator[tuple[str, int]]:
    """Yield the lines of the plain program, each with the number of its line in the program."""
    percent = _first(path) == "%"
    if percent:
        yield "%", 0
    yield f"(expanded from {clean_comment(path.name)[:_NAME]} by thermocomp)", 0
    if around.diameters:
        yield "(cutter radius compensation is computed for given tool diameters)", 0
    yield "G17 G40 G80 G90 G94", 0
    if around.startup is not None:
        yield f"G21 {around.startup}", 0
    if around.inch is not None:
        yield "G20" if around.inch else "G21", 0
    radii = any(_lines_with(_DIAMETERS, path, around.block_delete))
    if radii:
        yield "G8", 0
    one, two = (around.controller(seed) for seed in _WRITTEN)
    writer = Writer(one, two, partial(_line_of, path), around.inch, around.user_codes)
    opened: set[Path] = set()
    with closing(around.run(path, one, opened=opened)) as run1, closing(around.run(path, two, task=True)) as run2:
        for first, second in zip_longest(_told(run1, writer.sides[0]), _told(run2, writer.sides[1])):
            if first is None or second is None:
                raise writer.refuse(f"the end position of the program {DEPENDS}; set it in the program first")
            if first.kind == "end" and not first.file and _REPEATS.search(_code(writer.source(first.line))):
                raise ProgramError(first.line, "M99 in a main program repeats it endlessly: end it with M2 or M30")
            yield from writer.write(first, second)
    for file in sorted(opened):
        _refuse_lost(file, path, around.block_delete, radii=radii)
    if not writer.ended:
        yield from writer.flush()
        if percent:
            yield "%", 0


def _start_systems(program: Path, block_delete: bool) -> dict[int, int]:
    """Return the work coordinate systems in force at the start, by seed.

    The interpreter makes no call if the selected system is already in force. So the program is expanded with a system
    that it does not name, and verified with two others, one of which is G54: all selections are seen, and a system that
    the program does not change is preserved.
    """
    named = (
        any(_lines_with(re.compile(re.escape(code) + r"(?![0-9.])"), program, block_delete))
        for code in SYSTEMS.values()
    )
    free = [system for system, is_named in zip(SYSTEMS, named, strict=True) if not is_named]
    written = free[-1] if free else len(SYSTEMS)
    other = next(system for system in reversed(SYSTEMS) if system != written)
    return dict.fromkeys(_WRITTEN, written) | dict(zip(_PROVED, (other, 1 if written != 1 else 2), strict=True))


def _refuse_lost(file: Path, program: Path, block_delete: bool, *, radii: bool) -> None:
    """Refuse codes of a run file that the interpreter silently ignores: M19 without R, G7 and G8."""
    own = file == program.resolve()
    reasons = {_ORIENTS: "it orients the spindle (M19), which plain lines would lose"}
    if not radii:
        reasons[_DIAMETERS] = "a subprogram has G7 or G8 and the program has not; write G8 at the start of the program"
    for code, reason in reasons.items():
        for number in _lines_with(code, file, block_delete):
            where = "" if own else f" (line {number} of {file.name})"
            raise ProgramError(number if own else 1, f"the program cannot be written as plain lines: {reason}{where}")


def _lines_with(code: re.Pattern[str], file: Path, block_delete: bool) -> Iterator[int]:
    """Yield the numbers of the lines that contain a code."""
    with file.open(encoding="latin-1") as lines:
        for number, text in enumerate(lines, 1):
            words = _code(text)
            if code.search(words) and not (block_delete and words.startswith("/")):
                yield number


def _code(text: str) -> str:
    """Return a line without comments and blanks, in upper case."""
    return _NO_CODE.sub("", text).upper()


def _first(path: Path) -> str:
    """Return the first line of a program that is not empty."""
    with path.open(encoding="latin-1") as file:
        return next((line.strip() for line in file if line.strip()), "")


def _told(calls: Iterator[Canonical], side: Side) -> Iterator[Canonical]:
    """Yield the calls without the interpreter's remarks; apply calls before the first line to the initial state."""
    for call in calls:
        if call.line == 0:
            side.begin(call)
        elif call.kind != "comment" or call.text == G10 or not call.text.startswith("interpreter: "):
            yield call


def _line_of(path: Path, number: int) -> str:
    """Return the text of a line by its number; the file is reread at each rare call."""
    with path.open(encoding="latin-1") as file:
        return next((text for i, text in enumerate(file, 1) if i == number), "")
