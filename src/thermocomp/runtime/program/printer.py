"""Translation of a compensator's program to another language: the part common to all languages."""

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar

from thermocomp.runtime.program import tree as n
from thermocomp.runtime.program.declarations import Var
from thermocomp.runtime.program.tree import Expression, Function, Kind, Operator, Statement

#: longest line of a branch or loop of one statement [characters]
_SHORT = 110
#: operators of equal precedence: evaluated from left to right, they need no parentheses
_RANKS: tuple[set[Operator], ...] = ({"+", "-"}, {"*", "/"}, {"and"}, {"or"})


class Printer(ABC):
    """Translator of one function.

    Parameters
    ----------
    sizes : mapping of str to int
        Sizes of the program's tables.
    labels : mapping of str to sequence of str
        Names of their rows and columns, by the sizes.
    """

    #: operators of the language that differ from those of the tree
    operators: ClassVar[Mapping[Operator, str]]

    def __init__(self, function: Function, sizes: Mapping[str, int], labels: Mapping[str, Sequence[str]]) -> None:
        self.function, self.sizes, self.labels = function, sizes, labels

    def block(self, statements: Sequence[Statement], depth: int) -> list[str]:
        """Return statements as lines of text, at least one per statement."""
        return [line for s in statements for line in self.statement(s, depth)]

    @abstractmethod
    def statement(self, node: Statement, depth: int) -> list[str]:
        """Return a statement of the program as lines of text."""

    @abstractmethod
    def constant(self, value: float, kind: Kind) -> str:
        """Return a numeric constant as text."""

    @abstractmethod
    def variable(self, record: str, name: str) -> str:
        """Return a variable of a record as text; a size is printed as a number."""

    @abstractmethod
    def choice(self, test: str, one: str, other: str) -> str:
        """Return a conditional expression, which selects one of two values, as text."""

    @abstractmethod
    def negated(self, text: str) -> str:
        """Return the negation of a condition as text."""

    @abstractmethod
    def call(self, name: str, arguments: Sequence[Expression]) -> str:
        """Return a call of a numeric function as text."""

    def about(self, target: n.Name | n.Element) -> str:
        """Return what a certain element of an array is; empty if it has no name."""
        match target:
            case n.Element(_, of, (n.Numeral(_, value),)) if names := self.labels.get(of.dims[0]):
                return names[int(value)]
        return ""

    def local(self, name: str) -> str:
        """Return a local variable of the function as text."""
        return name

    def element(self, array: n.Name, at: Sequence[Expression]) -> str:
        """Return an element of an array as text."""
        return self.value(array) + "".join(f"[{self.bare(a)}]" for a in at)

    def real(self, text: str) -> str:
        """Return the conversion of an integer to a real number as text."""
        return text

    def bare(self, node: Expression, kind: Kind | None = None) -> str:
        """Return an expression as text, without outer parentheses."""
        text = self.value(node, kind)
        outer = text.startswith("(") and isinstance(node, n.Operation | n.Conditional)
        return text[1:-1] if outer else text

    def value(self, node: Expression, kind: Kind | None = None) -> str:  # noqa: PLR0911 - one case per node type
        """Return an expression as text; a real constant is written as a time if `kind` is ``time``."""
        match node:
            case n.Numeral(own, value):
                return self.constant(value, "time" if own == "real" and kind == "time" else own)
            case n.Name(own, name, "t") if name in self.sizes:
                return self.constant(self.sizes[name], own)
            case n.Name(_, name, ""):
                return self.local(name)
            case n.Name(_, name, record):
                return self.variable(record, name)
            case n.Element(_, of, at):
                return self.element(of, at)
            case n.Not(_, of):
                return self.negated(self.value(of))
            case n.Negative(_, of):
                return f"-{self.value(of, kind)}"
            case n.Real(_, of):
                return self.real(self.value(of))
            case n.Operation(_, operator, left, right):
                timed: Kind | None = "time" if "time" in (left.kind, right.kind) else None
                chained = isinstance(left, n.Operation) and any({operator, left.operator} <= rank for rank in _RANKS)
                one = self.bare(left, timed) if chained else self.value(left, timed)
                return f"({one} {self.operators.get(operator, operator)} {self.value(right, timed)})"
            case n.Conditional(own, test, one, other):
                return self.choice(self.value(test), self.value(one, own), self.value(other, own))
            case n.Call(_, name, arguments):
                return self.call(name, arguments)


def written(value: Any, one: Callable[[float], str]) -> list[str]:
    """Return the numbers of a table as text, row by row."""
    return [text for v in value for text in written(v, one)] if isinstance(value, list) else [one(value)]


def compact(lines: Sequence[str], begin: str, other: str, end: str) -> list[str]:
    """Return lines with branches and loops of one short statement on one line: only spaces differ.

    Parameters
    ----------
    begin, other, end : str
        Regular expressions of the first line of a branch or loop, of its ``else`` and of its last line.
    """
    found = list[str]()
    for line in lines:
        found.append(line)
        for count, inner in ((5, (begin, "", other, "", end)), (3, (begin, "", end))):
            last = found[-count:]
            pad = last[0][: len(last[0]) - len(last[0].lstrip())]
            text = pad + " ".join(x.strip() for x in last)
            if (
                len(last) == count
                and len(text) <= _SHORT
                and all(
                    re.fullmatch(pad + (pattern or rf"    (?!{begin})[^{{}}]*;"), x)
                    for pattern, x in zip(inner, last, strict=True)
                )
            ):
                found[-count:] = [text]
                break
    return found


def label_columns(var: Var, labels: Mapping[str, Sequence[str]]) -> str:
    """Return a comment on the columns of a table of rows; empty if it has none, or only one."""
    names = labels.get(var.dims[-1], ()) if len(var.dims) > 1 else ()
    return f"; columns: {', '.join(names)}" if len(names) > 1 else ""


def label_rows(found: list[Any], dims: Sequence[str], labels: Mapping[str, Sequence[str]]) -> list[tuple[str, Any]]:
    """Return the rows of a table, or its values if it has a single dimension, with their labels."""
    rows = list(zip(labels.get(dims[0], [""] * len(found)), found, strict=True))
    if len(dims) < 3:
        return rows
    return [(f"{name}, {own}", row) for name, table in rows for own, row in label_rows(table, dims[1:], labels)]
