"""Variables of Fanuc custom macro B with known values, by call level."""

import re
from collections.abc import Mapping
from typing import Final, Literal

from thermocomp.core.exceptions import InputError, ProgramError
from thermocomp.nc.parser.expressions import Key, Parameters, evaluate
from thermocomp.nc.parser.line import Assignment, Line, Word

#: G65: local variable set by each letter (argument specification I)
ARGUMENTS: Final = {
    **{"A": 1, "B": 2, "C": 3, "I": 4, "J": 5, "K": 6, "D": 7, "E": 8, "F": 9, "H": 11, "M": 13, "Q": 17},
    **{"R": 18, "S": 19, "T": 20, "U": 21, "V": 22, "W": 23, "X": 24, "Y": 25, "Z": 26},
}
#: letters whose arguments without a decimal point are whole numbers
_WHOLE: Final = frozenset("DEFHMST")
_LOCAL: Final = range(1, 34)
_COMMON: Final = range(100, 200)
_EMPTY = re.compile(r"\[#([0-9]+)(EQ|NE)#0\]")
_ALONE = re.compile(r"[-+]?#([0-9]+)")


class Variables:
    """Variables as seen at one call level.

    Parameters
    ----------
    values : mapping of int to float, optional
        Known values.
    macro : bool
        The level was called by G65: local variables not set by it are empty.
    """

    def __init__(self, values: Mapping[Key, float] | None = None, *, macro: bool = False) -> None:
        self._parameters = Parameters("fanuc", values)
        self.macro = macro
        self.changes = 0  #: number of changes of a variable's value

    def called(self, arguments: Mapping[Key, float]) -> "Variables":
        """Return the variables of a macro called from this level."""
        return Variables({**self._common(), **arguments}, macro=True)

    def returned(self, inner: "Variables") -> None:
        """Take over the common variables (#100 and up) from a macro that has returned."""
        own: dict[Key, float] = {key: self._parameters[key] for key in _LOCAL if key in self._parameters}
        common = inner._common()
        self.changes += common != self._common()
        self._parameters = Parameters("fanuc", {**own, **common})

    def _common(self) -> dict[Key, float]:
        return {key: self._parameters[key] for key in _COMMON if key in self._parameters}

    def assign(self, line: int, assignment: Assignment) -> None:
        """Execute one assignment to a variable."""
        try:
            key = self._parameters.key(assignment.target)
            if key not in _LOCAL and key not in _COMMON:
                raise InputError(
                    f"{assignment.target} is set, but only #1 to #33 and #100 to #199 may be assigned: the others "
                    "keep their values in the control, and the expanded program contains no assignments; use one of "
                    "these, or omit --expand if no loop or subprogram needs it"
                )
            if "".join(assignment.value.split()) == "#0":
                raise InputError(f"{assignment.target} is set to empty (#0), which is not supported; give it a value")
            same = key in self._parameters and self._parameters[key]
            self._parameters.assign([assignment])
            self.changes += same is False or self._parameters[key] != same
        except InputError as error:
            raise ProgramError(line, f"a variable: {error}") from None

    def value(self, line: int, text: str, what: str, *, word: bool = True) -> float:
        """Return the value of an expression with variables."""
        try:
            return evaluate(text, self._parameters, word=word)
        except InputError as error:
            raise ProgramError(line, f"{what}: {error}") from None

    def holds(self, line: int, condition: str) -> bool:
        """Return whether a condition is true, such as ``[#1LT10]`` or ``[#1EQ#0]``."""
        found = _EMPTY.fullmatch(condition)
        if found:
            return self._empty(int(found.group(1)), line) == (found.group(2) == "EQ")
        return self.value(line, condition, "the condition", word=False) != 0.0

    def leaves_out(self, line: int, word: Word) -> bool:
        """Return whether a word is ignored because its variable is empty, such as ``X#24``."""
        found = _ALONE.fullmatch("".join(word.value.split()))
        return bool(found) and self.macro and self._empty(int(found.group(1)), line)  # type: ignore[union-attr]

    def _empty(self, key: int, line: int) -> bool:
        if key in self._parameters:
            return False
        if key in _LOCAL and self.macro:
            return True
        raise ProgramError(
            line,
            f"whether #{key} is empty is uncertain: the program has not set it, but another program may have; set it "
            "in this program",
        )


def arguments(
    line: Line, variables: Variables, integers: Literal["whole", "least", "refuse"], least: float
) -> dict[Key, float]:
    """Return the local variables set by the words of a G65 line.

    Parameters
    ----------
    integers : {'whole', 'least', 'refuse'}
        Meaning of a length without a decimal point.
    """
    found: dict[Key, float] = {}
    order = [word.letter for word in line.words if word.letter in "IJK"]
    if order != sorted(order):
        raise line.fault("I J K of G65 must be in this order: otherwise they set other variables")
    for word in line.words:
        letter = word.letter
        if letter in "PL" or (letter == "G" and word.number == 65.0):
            continue
        if letter not in ARGUMENTS:
            raise line.fault(f"{letter} on the line of G65 is not an argument; put it on a separate line")
        if variables.leaves_out(line.number, word):
            continue
        value = word.number
        if value is None:
            value = variables.value(line.number, word.value, letter)
        elif "." not in word.value and value and letter not in _WHOLE:
            if integers == "refuse":
                raise line.fault(
                    f"{letter}{word.value} has no decimal point: whether it is in units or least increments depends "
                    "on the control; state which with --integers",
                )
            value *= least if integers == "least" else 1.0
        found[ARGUMENTS[letter]] = value
    return found
