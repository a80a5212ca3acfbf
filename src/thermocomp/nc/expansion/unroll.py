"""Expansion of subprograms, macros, loops and branches of a Fanuc program into plain lines.

Programs that depend on values stored in the control, and not in the file, are refused with line and reason.
"""

import math
import re
from collections.abc import Generator, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Final

from thermocomp.core.exceptions import ProgramError
from thermocomp.nc.expansion.programs import File, Program, squeeze
from thermocomp.nc.expansion.variables import Variables, arguments
from thermocomp.nc.interpreter.block import Setup
from thermocomp.nc.parser.expressions import Key
from thermocomp.nc.parser.line import Assignment, Line, Word
from thermocomp.nc.parser.tokens import read_line

#: limits, in lines beyond those of the file: lines written, lines run, and lines run without axis motion;
#: running a line takes about 10 us, so each limit is reached within seconds
MOST: Final = 220_000
MOST_STEPS: Final = 1_000_000
MOST_IDLE: Final = 200_000
#: number of most recent lines in which an endless loop is searched for
_RECENT: Final = 20_000
#: maximum nesting depth of calls
DEEPEST: Final = 4

# a line without any of these is plain
_MAY_ACT = re.compile(r"[#\[O:%]|M[ \t]*[0-9 \t]*[02789]|G[ \t0]*(65|2[ \t]*[01])|GO|IF|WH|DO|END", re.IGNORECASE)
_IF = re.compile(r"IF(?P<condition>\[.*\])(?:GOTO(?P<goto>[0-9]+|[#\[].*)|THEN(?P<then>#.*))")
_LOOP = re.compile(r"(?:WH(?:ILE)?(?P<condition>\[.*\]))?DO(?P<loop>[123])")
_END = re.compile(r"END(?P<loop>[123])")
_GOTO = re.compile(r"GO(?:TO)?(?P<goto>[0-9]+|[#\[].*)")
#: a written line moves no axis if it has no axis word, or if a dwell, offset or rotation code uses the axis words
_AXIS = re.compile(r"[XYZABC]", re.IGNORECASE)
_STILL = re.compile(r"G[ \t]*0*(?:4|10|52|68|92)(?![0-9.])", re.IGNORECASE)
_COMMENT = re.compile(r"\([^()]*\)?")
_SET = re.compile(r"(#.*?)=(.*)")
#: letters whose values are whole numbers without a decimal point
_COUNTS: Final = frozenset("GMTHDSLNOP")
_ENDED: Final = -1
_BACK: Final = 0

Lines = Generator[tuple[str, int], None, int]


def unroll(lines: Iterable[str], setup: Setup) -> Iterator[tuple[str, int]]:
    """Expand a program into plain lines.

    M98 and M97 with the called programs of the same file, M99, G65 with arguments, variables, ``IF``, ``GOTO`` and
    ``WHILE`` are expanded. Lines and programs without these remain unchanged.
    """
    return _Unroller(list(lines), setup).lines()


@dataclass(slots=True)
class _Frame:
    """State of a program or macro that is being executed."""

    program: Program
    variables: Variables
    depth: int
    place: int  #: index of the next line
    called: bool
    loops: list[tuple[int, int, int]] = field(default_factory=list)  #: number of the loop, indices of DO and END
    #: by target line of a backward jump: number of variable changes so far, and the active loops
    seen: dict[int, tuple[int, list[tuple[int, int, int]]]] = field(default_factory=dict)


class _Unroller:
    def __init__(self, texts: list[str], setup: Setup) -> None:
        self._texts = texts
        self._file = File(texts)
        self._setup = setup
        self._inch = bool(setup.inch)
        self._written = self._steps = self._moved = 0
        self._passes: dict[int, tuple[int, int]] = {}  # by target line of a backward jump: passes, last step
        self._acted = False
        self._read_lines: dict[int, Line | None] = {}

    def lines(self) -> Iterator[tuple[str, int]]:
        main = _Frame(self._file.main, Variables(), 0, 0, called=False)
        yield from self._run(main)
        # after the end: the called programs are no longer needed
        for i in range(main.place, len(self._texts)):
            text = self._texts[i]
            if not self._acted or text.strip() == "%":
                yield text, i + 1

    def _run(self, frame: _Frame) -> Lines:
        """Run a program from its current line; return the N number to continue at, 0 for none, -1 if all have ended."""
        began = False
        program, texts = frame.program, self._texts
        while frame.place < program.stop:
            i = frame.place
            frame.place += 1
            text = texts[i]
            self._step(i + 1)
            line = self._read(i)
            if line is None:
                began = began or bool(text.strip())
                yield self._out(text, i + 1)
                continue
            if line.demarcation and began and not frame.called:
                frame.place = i  # end of the file
                return _ENDED
            acts = bool(line.words or line.assignments or line.flow or line.label)
            began = began or acts or line.demarcation
            if line.error or not acts or (line.optional and self._setup.skip_optional):
                yield self._out(text, i + 1)
                continue
            done = yield from self._line(frame, line)
            if done is not None:
                return done
        if frame.called:
            raise ProgramError(program.stop, "a subprogram without M99 at its end; add it")
        if program.stop < len(texts):
            raise ProgramError(program.stop, "the program has no M30 or M2 before the next O number; add it")
        return _ENDED

    def _read(self, index: int) -> Line | None:
        """Return a parsed line that may call, jump or set a variable; None if it is plain."""
        if index not in self._read_lines:
            text = self._texts[index]
            self._read_lines[index] = read_line(text, index + 1, "fanuc") if _MAY_ACT.search(text) else None
        return self._read_lines[index]

    def _line(self, frame: _Frame, line: Line) -> Generator[tuple[str, int], None, int | None]:
        """Execute one line; return None if the program continues after it."""
        if line.flow or line.assignments:
            self._act(line)
            if line.flow:
                self._steer(frame, line, squeeze(line.flow))
            for assignment in line.assignments:
                frame.variables.assign(line.number, assignment)
            if line.words:
                raise line.fault("words on a line that sets a variable; put them on a separate line")
            return None
        codes = {(w.letter, w.number) for w in line.words if w.letter in "GM"}
        if ("G", 65.0) in codes:
            return (yield from self._macro(frame, line))
        call = next((int(n) for n in (98.0, 97.0) if ("M", n) in codes), 0)
        back = ("M", 99.0) in codes
        if call or back:
            self._act(line)
        if back and not frame.called:
            raise line.fault("M99 in the main program repeats it endlessly; write M30")
        head = line.label[:1] in ("O", ":")
        if not (head and frame.called and not line.words):
            text = self._plain(frame, line, "MPLK" if call else "MP" if back else "")
            if text is not None:
                yield self._out(text, line.number)
        if call:
            return (yield from self._call(frame, line, call))
        if back:
            return self._count(frame, line, "P", 0) or _BACK
        return _ENDED if codes & {("M", 2.0), ("M", 30.0)} else None

    # -- calls -------------------------------------------------------------------------------------------------------

    def _call(self, frame: _Frame, line: Line, code: int) -> Generator[tuple[str, int], None, int | None]:
        """Execute M98 or M97."""
        number = self._count(frame, line, "P", 0)
        told = [letter for letter in "LK" if any(w.letter == letter for w in line.words)]
        if not number or len(told) > 1:
            raise line.fault(
                f"M{code} needs P, the target of the call, and at most one of L and K, the number of calls",
            )
        times = self._count(frame, line, told[0], 1) if told else 1
        if code == 97:
            program, place = frame.program, frame.program.label(number, line.number, f"M97 P{number}")
        else:
            program, repeats = self._file.called(number, line.number, told=bool(told))
            place, times = program.start, times * repeats
        return (yield from self._repeat(frame, line, program, place, times, None))

    def _macro(self, frame: _Frame, line: Line) -> Generator[tuple[str, int], None, int | None]:
        """Execute G65."""
        self._act(line)
        number, times = self._count(frame, line, "P", 0), self._count(frame, line, "L", 1)
        if not number:
            raise line.fault("G65 needs P, the number of the macro")
        program = self._file.find(number, line.number, f"G65 P{number}")
        least = self._setup.least / (10.0 if self._inch else 1.0)
        given = arguments(line, frame.variables, self._setup.integers, least)
        return (yield from self._repeat(frame, line, program, program.start, times, given))

    def _repeat(
        self, frame: _Frame, line: Line, program: Program, place: int, times: int, given: dict[Key, float] | None
    ) -> Generator[tuple[str, int], None, int | None]:
        if frame.depth >= DEEPEST:
            raise line.fault(f"more than {DEEPEST} nested calls, the most that controls accept; reduce the nesting")
        if times < 1:
            raise line.fault("a call with 0 repeats; remove it")
        for _ in range(times):
            own = frame.variables if given is None else frame.variables.called(given)
            done = yield from self._run(_Frame(program, own, frame.depth + 1, place, called=True))
            if given is not None:
                frame.variables.returned(own)
            if done == _ENDED:
                return _ENDED
            if done != _BACK:
                self._jump(frame, done, line.number, f"M99 P{done}")
                break
        return None

    # -- loops and branches ------------------------------------------------------------------------------------------

    def _steer(self, frame: _Frame, line: Line, flow: str) -> None:
        if found := _IF.fullmatch(flow):
            if not frame.variables.holds(line.number, found.group("condition")):
                return
            if found.group("goto"):
                self._go(frame, line, found.group("goto"))
            elif (setting := _SET.fullmatch(found.group("then"))) is None:
                raise line.fault("IF [..] THEN needs an assignment, such as #1=2")
            else:
                frame.variables.assign(line.number, Assignment(setting.group(1).lower(), setting.group(2), 0, 0))
        elif found := _GOTO.fullmatch(flow):
            self._go(frame, line, found.group("goto"))
        elif found := _LOOP.fullmatch(flow):
            self._begin(frame, line, found.group("condition"), int(found.group("loop")))
        elif found := _END.fullmatch(flow):
            number, index = int(found.group("loop")), line.number - 1
            if not frame.loops or (frame.loops[-1][0], frame.loops[-1][2]) != (number, index):
                raise line.fault(f"END{number} without its DO{number}, or overlapping loops")
            frame.place = frame.loops.pop()[1]
            self._go_back(frame)
        else:
            raise line.fault(
                f"{line.flow}: not supported; IF [..] GOTO, IF [..] THEN #i=.., GOTO, WHILE [..] DO, END are",
            )

    def _begin(self, frame: _Frame, line: Line, condition: str | None, number: int) -> None:
        index = line.number - 1
        if any(loop == number for loop, _, _ in frame.loops):
            raise line.fault(f"DO{number} inside DO{number}; give the inner loop another number")
        end = frame.program.closing(index, number)
        if condition is None or frame.variables.holds(line.number, condition):
            frame.loops.append((number, index, end))
        else:
            frame.place = end + 1

    def _go(self, frame: _Frame, line: Line, goal: str) -> None:
        value = frame.variables.value(line.number, goal, "GOTO")
        if value != int(value):
            raise line.fault(f"GOTO {value:g}: a line number must be a whole number")
        self._jump(frame, int(value), line.number, f"GOTO {value:g}")

    def _jump(self, frame: _Frame, number: int, line: int, who: str) -> None:
        place = frame.program.label(number, line, who)
        frame.loops = [loop for loop in frame.loops if loop[1] < place <= loop[2]]
        inside = {loop[1] for loop in frame.loops}
        for i in range(frame.program.start, place):
            text = self._texts[i]
            if i in inside or "DO" not in text.upper():
                continue
            found = _LOOP.fullmatch(squeeze(read_line(text, i + 1, "fanuc").flow))
            if found and frame.program.closing(i, int(found.group("loop"))) >= place:
                raise ProgramError(
                    line,
                    f"{who} jumps into a loop (line {i + 1}), which controls do not accept; jump to a line outside it",
                )
        frame.place = place
        if place < line:
            self._go_back(frame)

    def _go_back(self, frame: _Frame) -> None:
        """Record a jump to an earlier line; refuse a pass that equals the previous one."""
        place, state = frame.place, (frame.variables.changes, list(frame.loops))
        self._passes[place] = self._passes.get(place, (0, 0))[0] + 1, self._steps
        if frame.seen.get(place) == state:
            raise ProgramError(
                place + 1,
                "the loop that begins here has no end: no variable changes from one pass to the next; write a "
                "condition that becomes false, or M30 at its end",
            )
        frame.seen[place] = state

    # -- words -------------------------------------------------------------------------------------------------------

    def _plain(self, frame: _Frame, line: Line, taken: str) -> str | None:
        """Return a line with variables replaced by numbers and call words removed; None if nothing is left."""
        text, kept = line.text, 0
        arc = any(w.letter in "IJ" or (w.letter == "G" and w.number in (2.0, 3.0)) for w in line.words)
        for word in line.words:
            if word.letter == "G" and word.number in (20.0, 21.0):
                self._inch = word.number == 20.0
        for word in reversed(line.words):
            if word.letter in taken and (word.letter != "M" or word.number in (97.0, 98.0, 99.0)):
                text = text[: word.start] + text[word.end :]
            elif word.number is not None:
                kept += 1
            else:
                self._acted = True
                new = self._number(frame, line, word, counts=word.letter in _COUNTS or (word.letter == "K" and not arc))
                kept += bool(new)
                text = text[: word.start] + new + text[word.end :]
        if kept or not line.words:
            return text
        return None

    def _number(self, frame: _Frame, line: Line, word: Word, *, counts: bool) -> str:
        if frame.variables.leaves_out(line.number, word):
            return ""
        value = frame.variables.value(line.number, word.value, f"the value of {word.letter}")
        if counts:
            if word.letter == "G" and abs(value * 10 - round(value * 10)) < 1e-6:  # G54.1
                return f"{word.letter}{round(value, 1):g}"
            if abs(value - round(value)) > 1e-6:
                raise line.fault(f"{word.letter} must be a whole number; found {value:g}")
            return f"{word.letter}{round(value)}"
        # the control rounds the value of a variable in a word to the least increment
        decimals = max(0, round(-math.log10(self._setup.least))) + self._inch
        rounded = math.copysign(math.floor(abs(value) * 10**decimals + 0.5 + 1e-6) / 10**decimals, value)
        digits = f"{rounded + 0.0:.{decimals}f}".rstrip("0")
        return f"{word.letter}{digits.removeprefix('-') if not digits.strip('-0.') else digits}"

    def _count(self, frame: _Frame, line: Line, letter: str, default: int) -> int:
        for word in line.words:
            if word.letter == letter:
                value = word.number
                if value is None:
                    value = frame.variables.value(line.number, word.value, letter)
                if value != int(value) or value < 0:
                    raise line.fault(f"{letter} must be a whole number; found {value:g}")
                return int(value)
        return default

    def _act(self, line: Line) -> None:
        """Record that a line calls, jumps or sets a variable."""
        self._acted = True
        if line.optional:
            raise line.fault(
                "an optional line (/) calls, jumps or sets a variable; give --block-delete on if such lines are skipped"
            )

    def _step(self, line: int) -> None:
        self._steps += 1
        if self._steps - self._moved > MOST_IDLE + len(self._texts):
            raise self._endless(line, f"{MOST_IDLE:,} lines and moved no axis")
        if self._steps > MOST_STEPS + len(self._texts):
            raise self._endless(line, f"more than {MOST_STEPS:,} lines")

    def _out(self, text: str, line: int) -> tuple[str, int]:
        self._written += 1
        code = _COMMENT.sub("", text) if "(" in text else text
        if _AXIS.search(code) and not _STILL.search(code):
            self._moved = self._steps
        if self._acted and self._written > MOST + len(self._texts):
            raise self._endless(line, f"more than {MOST:,} lines that would be written")
        return text, line

    def _endless(self, line: int, what: str) -> ProgramError:
        """Return the error for an endless loop: the outermost active loop, which has the fewest passes."""
        running = [
            (n, place + 1) for place, (n, last) in self._passes.items() if n > 1 and self._steps - last < _RECENT
        ]
        return ProgramError(
            min(running, default=(0, line))[1],
            f"the loop that begins here has run {what}: it seems to have no end; write a condition that becomes false, "
            "or let one program run fewer passes",
        )
