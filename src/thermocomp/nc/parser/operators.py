"""Operators and functions of expressions, by the rules of LinuxCNC or Fanuc custom macro B.

Operators of LinuxCNC, by increasing precedence, left-associative: AND OR XOR; EQ NE GT GE LT LE; ``+ -``;
``* / MOD``; ``**``; a sign belongs to the following value, so ``-2 ** 2`` is 4. Fanuc: comparisons; ``+ - OR XOR``;
``* / MOD AND``.
"""

import math
import operator
from collections.abc import Callable

#: relative difference below which a Fanuc may regard two numbers as equal
_ROUNDED = 1e-8

Binary = Callable[[float, float], float]


def _modulo(a: float, b: float) -> float:
    rest = math.fmod(a, b)
    return rest + abs(b) if rest < 0 else rest


def _equal(a: float, b: float) -> float:
    return float(abs(a - b) < 1e-4)


def _round(a: float) -> float:
    return math.copysign(math.floor(abs(a) + 0.5), a)


def _angle(a: float) -> float:
    if abs(a) > 1e9:  # fractional digits are lost
        raise ValueError(f"an angle of {a:g} degrees is out of range")
    return math.radians(a)


def _tangent(a: float) -> float:
    if abs(math.cos(_angle(a))) < 1e-9:
        raise ValueError(f"TAN of {a:g} degrees is undefined")
    return math.tan(_angle(a))


def _sure(what: Binary) -> Binary:
    """Wrap a comparison to refuse numbers that differ by rounding only: controls may disagree on the result."""

    def compared(a: float, b: float) -> float:
        if a != b and abs(a - b) <= _ROUNDED * max(abs(a), abs(b)):
            raise ValueError(f"{a:.12g} and {b:.12g} differ by rounding only; compare with a value half a step away")
        return float(what(a, b))

    return compared


def _sure_whole(what: Callable[[float], float]) -> Callable[[float], float]:
    def cut(a: float) -> float:
        if a != round(a) and abs(a - round(a)) <= _ROUNDED * max(abs(a), 1.0):
            raise ValueError(f"FIX or FUP of {a:.12g}, which is within rounding of a whole number")
        return what(a)

    return cut


def _sure_half(a: float) -> float:
    rest = abs(a) % 1.0
    if rest != 0.5 and abs(rest - 0.5) <= _ROUNDED * max(abs(a), 1.0):
        raise ValueError(f"ROUND of {a:.12g}, which is within rounding of a half")
    return math.copysign(math.floor(abs(a) + 0.5), a)


def _bits(what: Callable[[int, int], int]) -> Binary:
    def on_integers(a: float, b: float) -> float:
        if a != int(a) or b != int(b) or min(a, b) < 0:
            raise ValueError(f"AND, OR and XOR of {a:g} and {b:g}: they need whole numbers")
        return float(what(int(a), int(b)))

    return on_integers


_LINUXCNC: dict[str, tuple[int, Binary]] = {
    "and": (1, lambda a, b: float(a != 0 and b != 0)),
    "or": (1, lambda a, b: float(a != 0 or b != 0)),
    "xor": (1, lambda a, b: float((a != 0) != (b != 0))),
    "eq": (2, _equal),
    "ne": (2, lambda a, b: 1.0 - _equal(a, b)),
    "gt": (2, operator.gt),
    "ge": (2, operator.ge),
    "lt": (2, operator.lt),
    "le": (2, operator.le),
    "+": (3, operator.add),
    "-": (3, operator.sub),
    "*": (4, operator.mul),
    "/": (4, operator.truediv),
    "mod": (4, _modulo),
    "**": (5, math.pow),
}
_FANUC: dict[str, tuple[int, Binary]] = {
    **{name: (2, _sure(getattr(operator, name))) for name in ("gt", "ge", "lt", "le", "eq", "ne")},
    "+": (3, operator.add),
    "-": (3, operator.sub),
    "or": (3, _bits(operator.or_)),
    "xor": (3, _bits(operator.xor)),
    "*": (4, operator.mul),
    "/": (4, operator.truediv),
    "mod": (4, math.fmod),
    "and": (4, _bits(operator.and_)),
}
#: by controller and name: precedence and function
OPERATORS = {"linuxcnc": _LINUXCNC, "fanuc": _FANUC}

#: functions of one value; ATAN and EXISTS have a syntax of their own
FUNCTIONS: dict[str, Callable[[float], float]] = {
    "abs": abs,
    "acos": lambda a: math.degrees(math.acos(a)),
    "asin": lambda a: math.degrees(math.asin(a)),
    "cos": lambda a: math.cos(_angle(a)),
    "exp": math.exp,
    "fix": math.floor,
    "fup": math.ceil,
    "ln": math.log,
    "round": _round,
    "sin": lambda a: math.sin(_angle(a)),
    "sqrt": math.sqrt,
    "tan": _tangent,
}
#: differences of Fanuc: FIX truncates, FUP rounds away from zero
FANUC_FUNCTIONS: dict[str, Callable[[float], float]] = {
    "fix": _sure_whole(math.trunc),
    "fup": _sure_whole(lambda a: math.copysign(math.ceil(abs(a)), a)),
    "round": _sure_half,
}
#: functions that a Fanuc program must not use, ROUND only in words
REFUSED_BY_FANUC = {
    "round": "ROUND in a word rounds to the control's least increment, which the program does not define",
    "exists": "only LinuxCNC has EXISTS",
}
