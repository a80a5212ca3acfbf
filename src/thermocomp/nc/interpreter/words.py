"""Words of a line: codes by modal group, and values, each checked on its own."""

from dataclasses import dataclass

from thermocomp.core.exceptions import InputError, ProgramError
from thermocomp.nc.interpreter.block import Setup
from thermocomp.nc.interpreter.codes import FREE, REFUSED_LETTERS, USED_BY, Code, find_code, find_owner_of_p
from thermocomp.nc.parser.expressions import Parameters, evaluate
from thermocomp.nc.parser.line import Line, Word

#: maximum number of M codes on a line in LinuxCNC
_MOST_M = 4


@dataclass(slots=True)
class BlockWords:
    """Words of a line.

    Parameters
    ----------
    codes : tuple of str
        Codes in the order of the line.
    groups : dict of str to str
        Code of each modal group, without G80 if another motion code is present.
    values : dict of str to float
        Values in program units.
    """

    line: Line
    codes: tuple[str, ...]
    groups: dict[str, str]
    words: dict[str, Word]
    values: dict[str, float]

    def error(self, reason: str) -> ProgramError:
        """Return a `ProgramError` with the number of this line."""
        return self.line.fault(reason)

    def whole(self, letter: str, least: int = 0) -> int | None:
        """Return the value of a whole-number word; None if the line has no such word."""
        value = self.values.get(letter)
        if value is None:
            return None
        number = round(value)
        if abs(value - number) > 1e-4 or number < least:
            raise self.error(f"{letter} must be a whole number, at least {least}; found {value:g}")
        return number


class Reader:
    """Converter from lines to `BlockWords`.

    Parameters
    ----------
    parameters : Parameters
        Parameters that the program sets and uses.
    """

    def __init__(self, setup: Setup, parameters: Parameters) -> None:
        self.parameters = parameters
        self._controller = setup.controller
        self._used_by = USED_BY[setup.controller]
        self._harmless = {f"M{number}" for number in setup.harmless}
        self._codes: dict[tuple[str, float], Code] = {}

    def read(self, line: Line) -> BlockWords:
        """Read a line; words are evaluated before its assignments take effect, as LinuxCNC does."""
        words: dict[str, Word] = {}
        values: dict[str, float] = {}
        codes: tuple[str, ...] = ()
        groups: dict[str, str] = {}
        for word in line.words:
            letter, number = word.letter, word.number
            if number is None:
                number = self._evaluate(line, word)
            if letter in "GM":
                code = self._codes.get((letter, number)) or self._find(line, letter, number)
                if code.group in groups:
                    self._two(line, groups, code)
                else:
                    groups[code.group] = code.name
                codes += (code.name,)
            elif letter in values:
                raise line.fault(f"{letter} appears twice on the line; remove one")
            else:
                words[letter] = word
                values[letter] = number
        found = BlockWords(line=line, codes=codes, groups=groups, words=words, values=values)
        if len(codes) > _MOST_M and self._controller == "linuxcnc" and sum(name[0] == "M" for name in codes) > _MOST_M:
            raise found.error(f"more than {_MOST_M} M codes on one line; put them on separate lines")
        if line.assignments:
            self._assign(line)
        return found

    def check_letters(self, words: BlockWords, motion: str) -> None:
        """Refuse letters that no code of the line uses; `motion` is the motion code of the line."""
        for letter in words.values.keys() - FREE:
            if letter in REFUSED_LETTERS:
                raise words.error(f"{letter}: {REFUSED_LETTERS[letter]}")
            users = self._used_by.get(letter, frozenset())
            if letter in "PQ" and not self._harmless.isdisjoint(words.codes):
                continue
            if motion not in users and users.isdisjoint(words.codes):
                raise words.error(self._unused(words, letter))

    def _unused(self, words: BlockWords, letter: str) -> str:
        """Return the message that no code of a line uses a letter, naming another control with such a code."""
        owner = ""
        if letter == "P":
            codes = iter(words.codes)
            owner = find_owner_of_p(
                (word.letter, float(next(codes)[1:]) if word.letter in "GM" else 0.0) for word in words.line.words
            )
        if self._controller == "fanuc":
            if owner == "G54":
                return f"G54 with P: write G54.1 P{words.values['P']:g} for an additional coordinate system"
            if letter in "RPQ" and "M19" in words.codes:
                word = f"{letter}{words.words[letter].value.strip()}"
                return (
                    f"M19 with {word} orients the spindle in a way that the machine builder has defined, which is not "
                    "supported; M19 alone is. Neither moves an axis: revise the program without "
                    f"{word}, and put {word} back after M19 in the revised program"
                )
            other = USED_BY["linuxcnc"].get(letter, frozenset())
            theirs = owner if owner in other else next((c for c in words.codes if c in other and c[0] == "G"), "")
            if theirs:
                return (
                    f"LinuxCNC's {theirs} has {letter}, a Fanuc's has none: remove {letter}, or give "
                    "--controller linuxcnc if the program is for LinuxCNC"
                )
            return f"the line has {letter} but no code that uses it; remove it, or add the code"
        return (
            f"the line has {letter} but no code that uses it in LinuxCNC; it may act on a Fanuc or Haas: give "
            "--controller fanuc if the program is for one, otherwise remove it, or add the code"
        )

    def _evaluate(self, line: Line, word: Word) -> float:
        try:
            return evaluate(word.value, self.parameters)
        except InputError as error:
            raise line.fault(f"the value of {word.letter}: {error}") from None

    def _find(self, line: Line, letter: str, number: float) -> Code:
        code = find_code(letter, number, self._controller)
        name = f"{letter}{number:g}"
        if code is None and name in self._harmless:
            code = Code(name, name, "moves nothing")
        if code is None:
            user = letter == "M" and 100 <= number < 200 and self._controller == "linuxcnc"
            remedy = f"if it does not affect axes and spindle: --harmless {name}; otherwise " if letter == "M" else ""
            raise line.fault(
                f"{name} is not a known code ({'user-defined' if user else self._controller}), so its effect is "
                f"unknown; {remedy}replace it with supported codes (docs/precompensation.rst)",
            )
        if code.refused:
            raise line.fault(f"{code.name} ({code.does}): {code.refused}")
        self._codes[letter, number] = code
        return code

    @staticmethod
    def _two(line: Line, groups: dict[str, str], code: Code) -> None:
        other = groups[code.group]
        if "G80" in (other, code.name) and other != code.name:
            groups[code.group] = other if code.name == "G80" else code.name
            return
        raise line.fault(f"{other} and {code.name} on one line exclude each other; put them on separate lines")

    def _assign(self, line: Line) -> None:
        try:
            self.parameters.assign(line.assignments)
            if line.optional:
                for assignment in line.assignments:
                    self.parameters.forget(assignment.target, "an optional line sets it; give --block-delete off or on")
        except InputError as error:
            raise line.fault(f"a parameter: {error}") from None
