"""Symbols of a program while it is recorded: numbers, integers, conditions and arrays, typed for a type checker."""

from abc import abstractmethod
from typing import Any, Generic, NoReturn, Self, TypeVar, cast

from thermocomp.runtime.program import tree as n
from thermocomp.runtime.program.trace import add
from thermocomp.runtime.program.tree import Expression, Kind, Operator

P = TypeVar("P", int, float)


class Symbol:
    """An expression of the program."""

    def __init__(self, node: Expression) -> None:
        self.node = node

    def _assign(self, value: Expression) -> None:
        if not isinstance(self.node, n.Name | n.Element):
            raise TypeError(f"{self.node} cannot be assigned to: only variables and array elements can")
        add(n.Assign(self.node, value))

    def __bool__(self) -> NoReturn:
        raise TypeError(
            "a symbolic value has no truth value before the program runs: use `when`, `choose`, & and | instead "
            "of if, and, or"
        )


class Condition(Symbol):
    """A condition; ``&`` and ``|`` evaluate their right side only if the left side does not decide the result."""

    def __and__(self, other: "Condition") -> "Condition":
        return Condition(n.Operation("bool", "and", self.node, other.node))

    def __or__(self, other: "Condition") -> "Condition":
        return Condition(n.Operation("bool", "or", self.node, other.node))

    def __invert__(self) -> "Condition":
        return Condition(n.Not("bool", self.node))

    def equals(self, other: "Condition") -> "Condition":
        """Return the condition that two conditions have the same truth value."""
        return Condition(n.Operation("bool", "==", self.node, other.node))

    def set(self, value: "Condition | bool") -> None:
        """Assign a value to this variable."""
        self._assign(flag(value).node)


class Ordered(Symbol, Generic[P]):
    """Common operations of numbers and integers; a plain number is converted to an expression."""

    @staticmethod
    @abstractmethod
    def _made(value: Any) -> Symbol:
        """Return a plain number, or a symbol, as a symbol."""

    def _with(self, operator: Operator, other: Self | P, *, swapped: bool = False) -> Self:
        one, two = (self._made(other), self) if swapped else (self, self._made(other))
        return type(self)(n.Operation(common_kind(one, two), operator, one.node, two.node))

    def __add__(self, other: Self | P) -> Self:
        return self._with("+", other)

    def __sub__(self, other: Self | P) -> Self:
        return self._with("-", other)

    def __mul__(self, other: Self | P) -> Self:
        return self._with("*", other)

    def _compared(self, operator: Operator, other: Self | P) -> Condition:
        return Condition(n.Operation("bool", operator, self.node, self._made(other).node))

    def __lt__(self, other: Self | P) -> Condition:
        return self._compared("<", other)

    def __le__(self, other: Self | P) -> Condition:
        return self._compared("<=", other)

    def __gt__(self, other: Self | P) -> Condition:
        return self._compared(">", other)

    def __ge__(self, other: Self | P) -> Condition:
        return self._compared(">=", other)

    def equals(self, other: Self | P) -> Condition:
        """Return the condition that two numbers are equal."""
        return self._compared("==", other)

    def differs(self, other: Self | P) -> Condition:
        """Return the condition that two numbers are not equal."""
        return self._compared("!=", other)

    def set(self, value: Self | P) -> None:
        """Assign a value to this variable."""
        self._assign(self._made(value).node)


class Whole(Ordered[int]):
    """An integer of the program."""

    @staticmethod
    def _made(value: "Whole | int") -> "Whole":
        return integer(value)

    def __floordiv__(self, other: "Whole | int") -> "Whole":
        return self._with("//", other)

    @property
    def real(self) -> "Number":
        """The integer converted to a real number."""
        return Number(n.Real("real", self.node))


class Number(Ordered[float]):
    """A real number, or a time: the result of an operation with a time is a time, in double precision."""

    @staticmethod
    def _made(value: "Number | float") -> "Number":
        return real(value)

    def __radd__(self, other: float) -> "Number":
        return self._with("+", other, swapped=True)

    def __rsub__(self, other: float) -> "Number":
        return self._with("-", other, swapped=True)

    def __rmul__(self, other: float) -> "Number":
        return self._with("*", other, swapped=True)

    def __truediv__(self, other: "Number | float") -> "Number":
        return self._with("/", other)

    def __rtruediv__(self, other: float) -> "Number":
        return self._with("/", other, swapped=True)

    def __neg__(self) -> "Number":
        return Number(n.Negative(self.node.kind, self.node))

    def __abs__(self) -> "Number":
        return Number(n.Call(self.node.kind, "abs", (self.node,)))


def flag(value: Condition | bool) -> Condition:
    """Return a condition, or a Boolean converted to a condition."""
    return value if isinstance(value, Condition) else Condition(n.Numeral("bool", value))


def integer(value: Whole | int) -> Whole:
    """Return an integer as an expression."""
    return value if isinstance(value, Whole) else Whole(n.Numeral("int", value))


def real(value: Number | float) -> Number:
    """Return a number as an expression."""
    return value if isinstance(value, Number) else Number(n.Numeral("real", float(value)))


def common_kind(*values: Symbol) -> Kind:
    """Return the kind of the result of an operation: ``time`` if an operand is a time."""
    kinds = {v.node.kind for v in values}
    return "time" if "time" in kinds else "real" if "real" in kinds else "int"


Index = Whole | int | tuple[Whole | int, ...]


class _Array(Symbol):
    def _element(self, at: Index) -> n.Element:
        array = cast("n.Name", self.node)
        places = at if isinstance(at, tuple) else (at,)
        if len(places) != len(array.dims):
            raise TypeError(f"array {array.name}: {len(places)} indices, expected {len(array.dims)}")
        return n.Element(array.kind, array, tuple(integer(k).node for k in places))


class Numbers(_Array):
    """An array of numbers."""

    def __getitem__(self, at: Index) -> Number:
        return Number(self._element(at))

    def __setitem__(self, at: Index, value: Number | float) -> None:
        self[at].set(value)


class Wholes(_Array):
    """An array of integers."""

    def __getitem__(self, at: Index) -> Whole:
        return Whole(self._element(at))

    def __setitem__(self, at: Index, value: Whole | int) -> None:
        self[at].set(value)


class Truths(_Array):
    """An array of conditions."""

    def __getitem__(self, at: Index) -> Condition:
        return Condition(self._element(at))

    def __setitem__(self, at: Index, value: Condition | bool) -> None:
        self[at].set(value)
