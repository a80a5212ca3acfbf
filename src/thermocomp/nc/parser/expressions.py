"""Evaluation of the values of NC words and parameters by the rules of LinuxCNC or Fanuc custom macro B.

Only known values are used: parameters set by the program itself or known to the caller. All others, such as probe
results, offsets and positions, are unknown, and an expression that needs one is refused.
"""

import math
import operator
import re
from collections.abc import Iterable, Mapping
from functools import lru_cache

from thermocomp.core.exceptions import InputError
from thermocomp.nc.parser.line import Assignment, Controller
from thermocomp.nc.parser.operators import FANUC_FUNCTIONS, FUNCTIONS, OPERATORS, REFUSED_BY_FANUC, Binary
from thermocomp.nc.parser.systemparameters import explain_unset, machine_meaning

#: maximum nesting depth of brackets; that of a control is about 5 (Fanuc)
DEEPEST = 60

_BLANKS = re.compile("[ \t]+")
_NUMBER = re.compile(r"[0-9]+\.?[0-9]*|\.[0-9]+")
_NAME = re.compile(r"<([^<>]*)>")
_FUNCTION = re.compile(r"[a-z]+(?=\[)")
_OPERATOR = re.compile(r"\*\*|[-+*/]|mod|and|xor|or|eq|ne|gt|ge|lt|le")

# most expressions in loops: one value, or two values and an operator
_OPERAND = r"(?:#([1-9][0-9]*)|([0-9]+\.?[0-9]*|\.[0-9]+))"
_SIMPLE = re.compile(rf"(\[?){_OPERAND}(?:({_OPERATOR.pattern}){_OPERAND})?(\]?)")
_ALONE = re.compile(r"#([1-9][0-9]*)")

Key = int | str  # number or name of a parameter


class Parameters:
    """Known values of parameters; local and global parameters share one table.

    Parameters
    ----------
    controller : {'linuxcnc', 'fanuc'}
        Controller whose rules apply to expressions.
    values : mapping of int or str to float, optional
        Values known before the program starts; names without ``#<`` and ``>``.
    """

    def __init__(self, controller: Controller = "linuxcnc", values: Mapping[Key, float] | None = None) -> None:
        self.controller = controller
        self._values = {_key(key): float(value) for key, value in (values or {}).items()}
        self._lost: dict[Key, str] = {}

    def __contains__(self, key: Key) -> bool:
        return _key(key) in self._values

    def __getitem__(self, key: Key) -> float:
        """Return the value of a parameter; the InputError for an unknown one contains the reason."""
        key = _key(key)
        if key in self._values:
            return self._values[key]
        raise InputError(f"{_written(key)} is unknown: {self._lost.get(key) or explain_unset(key, self.controller)}")

    def assign(self, assignments: Iterable[Assignment]) -> None:
        """Execute the assignments of one line; all use the values before the line, as in LinuxCNC."""
        known: dict[Key, float] = {}
        for target, value, _, _ in assignments:
            key = self.key(target)
            if meaning := machine_meaning(key, self.controller):
                raise InputError(f"setting {target} changes the machine: {meaning}; set it at the control instead")
            known[key] = evaluate(value, self, word=False)
        self._values.update(known)

    def forget(self, target: str, reason: str) -> None:
        """Make a parameter unknown, for example after an optional line: ``#5``, ``#<depth>``, ``#[#1 + 2]``."""
        key = self.key(target)
        self._values.pop(key, None)
        self._lost[key] = reason

    def key(self, target: str) -> Key:
        """Return number or name of a parameter written as ``#5``, ``##2``, ``#<depth>`` or ``#[#1 + 2]``."""
        if simple := _ALONE.fullmatch(target):
            return int(simple[1])
        reader = _Reader(target, self)
        if not reader.takes("#"):
            raise InputError(f"expected a parameter, such as #5, found '{target}'")
        key = reader.parameter()
        reader.end()
        return key


def evaluate(text: str, parameters: Parameters, *, word: bool = True) -> float:
    """Return the value of a word or of an assignment.

    Parameters
    ----------
    text : str
        As written, such as ``[#1 + 2]``, ``-#<depth>``, ``sin[30]``, ``12.5``; for Fanuc also ``#1 + 2``.
    """
    simple = _read_simple(text, parameters.controller)
    try:
        if simple is not None:
            first, action, second = simple
            value = first if isinstance(first, float) else parameters[first]
            if action is not None:
                value = float(action(value, second if isinstance(second, float) else parameters[second]))
        else:
            reader = _Reader(text, parameters, word=word)
            value = reader.expression() if parameters.controller == "fanuc" else reader.value()
            reader.end()
    except (ArithmeticError, ValueError) as error:  # 1 / 0, sqrt[-1], exp[1000]
        raise InputError(f"'{text.strip()}' has no value: {error}") from error
    if not math.isfinite(value):
        raise InputError(f"'{text.strip()}' has no value: it is too large")
    return value


@lru_cache(maxsize=4096)
def _read_simple(text: str, controller: Controller) -> tuple[float | int, Binary | None, float | int] | None:
    """Return operands and operator of a simple expression, with parameter numbers as int; None for any other."""
    found = _SIMPLE.fullmatch(_BLANKS.sub("", text).lower())
    if found is None or bool(found[1]) != bool(found[7]) or not (found[1] or controller == "fanuc" or not found[4]):
        return None
    if found[4] and found[4] not in OPERATORS[controller]:
        return None
    operands = [int(key) if key else float(number or 0.0) for key, number in (found.group(2, 3), found.group(5, 6))]
    return operands[0], OPERATORS[controller][found[4]][1] if found[4] else None, operands[1]


class _Reader:
    """Parser of a text in lower case without blanks, from left to right."""

    def __init__(self, text: str, parameters: Parameters, *, word: bool = True) -> None:
        self.word = word
        self.written = text.strip()
        self.text = _BLANKS.sub("", text).lower()
        self.place = 0
        self.depth = 0
        self.parameters = parameters
        self.operators = OPERATORS[parameters.controller]

    def takes(self, mark: str) -> bool:
        found = self.text.startswith(mark, self.place)
        self.place += len(mark) * found
        return found

    def matches(self, pattern: re.Pattern[str]) -> re.Match[str] | None:
        if found := pattern.match(self.text, self.place):
            self.place = found.end()
        return found

    def error(self, expected: str) -> InputError:
        rest = self.text[self.place :]
        return InputError(f"in '{self.written}': {expected}, {f'found {rest[:12]!r}' if rest else 'found the end'}")

    def end(self) -> None:
        if self.place < len(self.text):
            raise self.error("expected the end of the value")

    def expression(self) -> float:
        """Read values and operators: of two adjacent operators, the one of higher precedence is applied first."""
        values = [self.value()]
        waiting: list[tuple[int, Binary]] = []
        while True:
            found = self.matches(_OPERATOR)
            if found and found.group() not in self.operators:
                raise InputError(
                    f"in '{self.written}': {found.group()} is not an operator of {self.parameters.controller}"
                )
            tightness, action = self.operators[found.group()] if found else (0, operator.add)
            while waiting and waiting[-1][0] >= tightness:
                right = values.pop()
                values.append(float(waiting.pop()[1](values.pop(), right)))
            if not found:
                return values[0]
            waiting.append((tightness, action))
            values.append(self.value())

    def bracket(self) -> float:
        if not self.takes("["):
            raise self.error("expected '['")
        self.depth += 1
        if self.depth > DEEPEST:
            raise InputError(f"in '{self.written[:40]}...': more than {DEEPEST} nested brackets")
        value = self.expression()
        self.depth -= 1
        if not self.takes("]"):
            raise self.error("expected ']' or an operator")
        return value

    def value(self) -> float:
        sign = 1.0
        while self.text.startswith(("+", "-"), self.place):
            sign = -sign if self.text[self.place] == "-" else sign
            self.place += 1
        return sign * self._unsigned()

    def _unsigned(self) -> float:
        if found := self.matches(_NUMBER):
            return float(found.group())
        if self.text.startswith("[", self.place):
            return self.bracket()
        if self.takes("#"):
            return self.parameters[self.parameter()]
        if found := self.matches(_FUNCTION):
            return self.function(found.group())
        raise self.error("expected a number, a parameter, a function or '['")

    def parameter(self) -> Key:
        """Read the number or name of a parameter after ``#``."""
        marks = 0
        while self.takes("#"):
            marks += 1
        if found := self.matches(_NAME):
            key: Key = found.group(1)
        elif found := self.matches(_NUMBER):
            key = self._index(float(found.group()))
        elif self.text.startswith("[", self.place):
            key = self._index(self.bracket())
        else:
            raise self.error("expected a number, a <name> or '[' after '#'")
        for _ in range(marks):
            key = self._index(self.parameters[key])
        return key

    def _index(self, value: float) -> int:
        if not math.isfinite(value) or abs(value - round(value)) > 1e-4 or round(value) < 1:
            raise InputError(f"in '{self.written}': {value:g} is not the number of a parameter")
        return round(value)

    def function(self, name: str) -> float:
        fanuc = self.parameters.controller == "fanuc"
        if fanuc and name in REFUSED_BY_FANUC and (self.word or name != "round"):
            raise InputError(f"in '{self.written}': {REFUSED_BY_FANUC[name]}")
        if name == "exists":
            return self._exists()
        if name != "atan" and name not in FUNCTIONS:
            raise InputError(f"in '{self.written}': the function {name.upper()} is not supported")
        value = self.bracket()
        if name == "atan":
            if not self.takes("/"):
                raise self.error("expected '/[' and the second value of ATAN")
            result = math.degrees(math.atan2(value, self.bracket()))
        else:
            own = FANUC_FUNCTIONS if fanuc else FUNCTIONS
            result = float(own.get(name, FUNCTIONS[name])(value))
        if fanuc and name in {"asin", "atan"} and result < 0:
            raise InputError(
                f"in '{self.written}': {name.upper()} is {result:g} or {result + 360:g} degrees, depending on the "
                "settings of the control; write the angle as a number"
            )
        return result

    def _exists(self) -> float:
        if not self.takes("[#"):
            raise self.error("expected '[#' after EXISTS")
        key = self.parameter()
        if not self.takes("]"):
            raise self.error("expected ']'")
        if isinstance(key, int) or key in self.parameters or machine_meaning(key):
            return 1.0
        if key.startswith("_"):
            raise InputError(
                f"whether #<{key}> exists is unknown: another program may have set it; set it in this program"
            )
        return 0.0


def _key(key: Key) -> Key:
    return key if isinstance(key, int) else _BLANKS.sub("", key).lower()


def _written(key: Key) -> str:
    return f"#{key}" if isinstance(key, int) else f"#<{key}>"
