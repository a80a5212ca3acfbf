"""Statements and expressions of a program of scalars and loops, independent of any language."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Literal, assert_never

#: ``time`` is always in double precision [s]
Kind = Literal["real", "time", "int", "bool"]
Operator = Literal["+", "-", "*", "/", "//", "==", "!=", "<", "<=", ">", ">=", "and", "or"]


@dataclass(frozen=True)
class Numeral:
    """A numeric constant of the program."""

    kind: Kind
    value: float


@dataclass(frozen=True)
class Name:
    """A variable: a parameter or local variable of the function, or a variable of a record."""

    kind: Kind
    name: str
    record: str = ""  #: ``s``, ``w`` or ``t``; empty: of the function
    dims: tuple[str, ...] = ()  #: dimensions of an array, as names of sizes


@dataclass(frozen=True)
class Element:
    """An element of an array."""

    kind: Kind
    of: Name
    at: tuple["Expression", ...]


@dataclass(frozen=True)
class Negative:
    """A number with its sign reversed."""

    kind: Kind
    of: "Expression"


@dataclass(frozen=True)
class Not:
    """Negation of a condition."""

    kind: Kind
    of: "Expression"


@dataclass(frozen=True)
class Real:
    """An integer as a real number."""

    kind: Kind
    of: "Expression"


@dataclass(frozen=True)
class Operation:
    """Two values combined by an operator; ``and`` and ``or`` evaluate the second only if the first does not decide."""

    kind: Kind
    operator: Operator
    left: "Expression"
    right: "Expression"


@dataclass(frozen=True)
class Conditional:
    """Conditional expression: one of two values, of which only the selected one needs to be defined."""

    kind: Kind
    test: "Expression"
    one: "Expression"
    other: "Expression"


@dataclass(frozen=True)
class Call:
    """Result of a function of numbers: of the program or, such as ``abs`` and ``expm1``, of a library."""

    kind: Kind
    name: str
    arguments: tuple["Expression", ...]


Expression = Numeral | Name | Element | Negative | Not | Real | Operation | Conditional | Call


@dataclass(frozen=True)
class Assign:
    """Assignment of a value to a variable or to an element of an array."""

    target: Name | Element
    value: Expression


@dataclass(frozen=True)
class ProcedureCall:
    """Call of a procedure with the records and further arguments."""

    name: str
    arguments: tuple[Expression, ...]


@dataclass(frozen=True)
class If:
    """Conditional statement, with an optional else branch."""

    test: Expression
    body: list["Statement"]
    other: list["Statement"] = field(default_factory=list)


@dataclass(frozen=True)
class For:
    """A loop over integers from `begin` to `end`, `end` excluded."""

    index: Name
    begin: Expression
    end: Expression
    body: list["Statement"]


@dataclass(frozen=True)
class While:
    """A loop with a condition."""

    test: Expression
    body: list["Statement"]


@dataclass(frozen=True)
class Return:
    """Return statement of a function of numbers."""

    value: Expression


Statement = Assign | ProcedureCall | If | For | While | Return


@dataclass(frozen=True)
class Function:
    """A procedure, which changes records, or a function of numbers, which returns a real number."""

    name: str
    about: str
    parameters: dict[str, Kind]
    body: list[Statement]
    locals: dict[str, Kind]
    is_of_numbers: bool = False


def walk(nodes: Iterable[Statement | Expression]) -> Iterator[Statement | Expression]:  # noqa: PLR0912 - one case per node type
    """Yield statements and expressions with all their parts, in order."""
    for node in nodes:
        yield node
        match node:
            case Element(_, of, at):
                yield from walk((of, *at))
            case Negative(_, of) | Not(_, of) | Real(_, of):
                yield from walk((of,))
            case Operation(_, _, left, right):
                yield from walk((left, right))
            case Conditional(_, test, one, other):
                yield from walk((test, one, other))
            case Call(_, _, arguments) | ProcedureCall(_, arguments):
                yield from walk(arguments)
            case Assign(target, value):
                yield from walk((target, value))
            case Return(value):
                yield from walk((value,))
            case If(test, body, other):
                yield from walk((test, *body, *other))
            case For(index, begin, end, body):
                yield from walk((index, begin, end, *body))
            case While(test, body):
                yield from walk((test, *body))
            case Numeral() | Name():
                pass
            case _:
                assert_never(node)
