"""Verification of a revised program by LinuxCNC's interpreter: its moves are those of the original plus the shifts.

Both programs are run in eight controller states: given settings are the same in all of them, all others are random.
"""

from array import array
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from thermocomp.core.exceptions import ProgramError, Unprovable
from thermocomp.files.scratch import scratch
from thermocomp.nc.interpreter.block import Setup
from thermocomp.nc.linuxcnc import rs274
from thermocomp.nc.linuxcnc.rs274process import InterpreterJob, InterpreterRun, run_through
from thermocomp.nc.linuxcnc.verification import states
from thermocomp.nc.linuxcnc.verification.comparison import Found, LineOrigins, RefusedError, compare
from thermocomp.nc.linuxcnc.verification.ledger import Integers, Ledger
from thermocomp.nc.linuxcnc.verification.translation import Translator, UntranslatableError
from thermocomp.nc.parser.tokens import program_lines

__all__ = ["Ledger", "Proof", "prove"]

#: settings that a state may omit if the original does not run with them
_SPARED = ("rotation", "tool diameters")


class Proof(NamedTuple):
    """Results of the verification by the interpreter."""

    moves: int  #: number of moves compared in each state
    largest: float  #: largest deviation of a move from the required shift [um]
    states: int  #: number of controller states in which both programs were run
    slower: float  #: largest change in the duration of a move, relative to the larger of its duration and 0.25 s [%]
    held: tuple[str, ...]  #: given settings, the same in all states
    drawn: tuple[str, ...]  #: random settings

    @property
    def sentence(self) -> str:
        """Description of the states in which the program was verified."""
        return _say_states(self.states, self.held, self.drawn)


class _Proving(NamedTuple):
    """Two programs, and the known settings of the controller."""

    original: Path
    revised: Path
    ledger: Ledger
    setup: Setup
    origin: LineOrigins

    def run(
        self, wanted: Sequence[tuple[int, set[str]]], progress: Callable[[int], object] = lambda _: None
    ) -> Iterator[Found]:
        """Compare the programs in several states, one after the other."""
        first_jobs, second_jobs = (
            [states.state(self.setup, number, drawn, program) for number, drawn in wanted]
            for program in (self.original, self.revised)
        )
        with InterpreterRun(*first_jobs) as first, InterpreterRun(*second_jobs) as second:
            for number, _ in wanted:

                def told(line: int, number: int = number) -> None:
                    progress((line + number * self.ledger.lines) // states.STATES)

                yield compare(first, second, self.ledger, self.origin, told)

    def fails(self, number: int, drawn: set[str]) -> bool:
        """Return whether the comparison fails in a state."""
        try:
            list(self.run([(number, drawn)]))
        except (ProgramError, RefusedError):
            return True
        return False

    def causes(self, number: int, drawn: set[str]) -> list[str]:
        """Return the random settings that cause the failure: each that does so alone, else all that contribute to it.

        The list is empty if the comparison also fails without random settings.
        """
        if self.fails(number, set()):
            return []
        alone = [name for name in states.REMEDIES if name in drawn and self.fails(number, {name})]
        return alone or [name for name in states.REMEDIES if name in drawn and not self.fails(number, drawn - {name})]


def prove(
    original: Path,
    revised: Path,
    ledger: Ledger,
    setup: Setup,
    progress: Callable[[int], object] = lambda _: None,
) -> Proof:
    """Run the interpreter on both programs in eight controller states, and compare them call by call.

    Every move must equal that of the original, shifted by the required shift of its line, within 0.1 um, and have the
    same duration within 2 % or 5 ms; if no linear axis of the original moves, none may move. All other calls (feeds,
    speeds, tools, dwells ...) must be equal. A move may be divided, with its pieces on the original path. Fanuc
    programs are first translated for LinuxCNC.
    """
    if (reason := rs274.find_obstacle()) is not None:
        raise Unprovable(reason)
    with scratch() as folder:
        if setup.controller == "linuxcnc":
            proving = _Proving(
                original=original,
                revised=revised,
                ledger=ledger,
                setup=setup,
                origin=LineOrigins(lambda lines: lines, ledger.originals),
            )
        else:
            try:
                first = _Translated.of(original, folder / "original.ngc", setup)
                second = _Translated.of(revised, folder / "revised.ngc", setup)
            except UntranslatableError as e:
                raise Unprovable(f"line {e.line} cannot be translated for LinuxCNC: {e.reason}") from e
            origin = LineOrigins(first.lines, lambda lines: ledger.originals(second.lines(lines)), divided=False)
            proving = _Proving(
                original=first.path, revised=second.path, ledger=ledger, setup=first.setup, origin=origin
            )
        proof = _prove(proving, progress)
    return proof._replace(held=_assumed(setup, proof.held))


def _assumed(setup: Setup, held: Sequence[str]) -> tuple[str, ...]:
    """Return the settings that are the same in all states, marking the assumed ones."""
    if setup.controller == "linuxcnc":
        # otherwise all X moves and all arcs would differ
        return (*held, "G8 and G91.1 at the start (assumed)")
    # a Fanuc stores no rotation, but G68 may still be on; and with G52 or G68 a random G92 is impossible
    assumed = {"no rotation": "no G68 at the start (assumed)"}
    if not setup.no_shift:
        assumed["no G92"] = "no G92 at the start (assumed)"
    return ("as LinuxCNC runs its translation", *(assumed.get(word, word) for word in held))


def foresee_sentence(setup: Setup) -> str:
    """Return the description of the states, assuming that the original runs in all of them."""
    drawn = setup if setup.controller == "linuxcnc" else Translator(setup).setup()
    return _say_states(states.STATES, _assumed(setup, states.describe_setup(drawn)), states.list_unstated(drawn))


def _say_states(count: int, held: Sequence[str], drawn: Sequence[str]) -> str:
    named = (f"{name} (in half of them)" if name in states.HALF else name for name in drawn)
    return (
        f"in {count} controller states; equal in all: {', '.join(('what the program specifies', *held))}; "
        f"varied: {', '.join(named)}"
    )


class _Translated(NamedTuple):
    """Fanuc program translated for LinuxCNC."""

    path: Path
    setup: Setup
    sources: "array[int]"  #: line of the program, by line of the translation

    @classmethod
    def of(cls, program: Path, path: Path, setup: Setup) -> "_Translated":
        """Write the translation of a Fanuc program to a file."""
        translator, sources = Translator(setup), array("i")
        with (
            program.open(encoding="latin-1", newline="") as texts,
            path.open("w", encoding="latin-1", newline="") as written,
        ):
            for text, source in translator.translate(program_lines(texts)):
                written.write(text)
                sources.append(source)
        return cls(path, translator.setup(), sources)

    def lines(self, lines: Integers) -> Integers:
        """Return the lines of the program for lines of the translation."""
        found = np.frombuffer(self.sources, np.intc).astype(int)
        return np.where(lines > 0, found[np.clip(lines, 1, len(found)) - 1], 0)


def _prove(proving: _Proving, progress: Callable[[int], object]) -> Proof:
    """Run both programs in all states."""
    setup = proving.setup
    drawn = set(states.list_unstated(setup))
    found: list[Found] = []
    wanted = [(number, set(drawn)) for number in range(states.STATES)]
    while len(found) < len(wanted):
        state = wanted[len(found)]
        try:
            for more in proving.run(wanted[len(found) :], progress):
                found.append(more)
                state = wanted[min(len(found), len(wanted) - 1)]
        except ProgramError as e:
            raise _fault(proving, *state, e) from e
        except RefusedError as e:
            state[1].remove(_spared(proving, *state, e))
    spared = {name: sum(name not in mine for _, mine in wanted) for name in drawn}
    words = [
        f"{name} (not in {spared[name]} of them, where it does not run)" if spared[name] else name
        for name in states.REMEDIES
        if name in drawn
    ]
    return Proof(
        moves=min(f.moves for f in found),
        largest=max(f.largest for f in found),
        states=len(found),
        slower=max(f.slower for f in found),
        held=states.describe_setup(setup),
        drawn=tuple(words),
    )


def _fault(proving: _Proving, number: int, drawn: set[str], error: ProgramError) -> ProgramError:
    """Return the error for a difference: an error of thermocomp, or the random settings that cause it."""
    what = f"LinuxCNC's interpreter disagrees: {error.reason}"
    causes = proving.causes(number, drawn)
    if not causes:
        return ProgramError(error.line, f"{what}; please report this: nothing was written")
    names, remedies = " and ".join(causes), "; ".join(states.REMEDIES[cause] for cause in causes)
    if "rotation" in causes:
        remedies = f"a correction of X or Y turns with the rotation of its work coordinate system; {remedies}"
    return ProgramError(
        error.line,
        f"{what}, in a controller with other values of {names}; these were not stated, so the program cannot be "
        f"proved; {remedies}",
    )


def _spared(proving: _Proving, number: int, drawn: set[str], error: RefusedError) -> str:
    """Return the setting that a state must omit so that the original runs in it."""
    line, reason = error.args
    neutral = InterpreterJob(
        proving.original, states.build_stored(proving.setup), bool(proving.setup.inch), proving.setup.skip_optional
    )
    try:
        run_through(neutral)
    except ProgramError as e:
        raise Unprovable(f"LinuxCNC's interpreter does not run the original: {e}") from e
    causes = proving.causes(number, drawn)
    if len(causes) == 1 and causes[0] in _SPARED:
        return causes[0]
    causes = causes or ["start"]  # the only setting that is always random
    raise Unprovable(
        f"line {line}: the tool position depends on what is stored in the controller "
        f"({' and '.join(causes)}), and the original does not run in all states of it: {reason}; "
        + "; ".join(states.REMEDIES[cause] for cause in causes)
    ) from error
