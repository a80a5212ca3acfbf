"""Translation of the block's functions to another language: the part common to all languages."""

import ast
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

from thermocomp.export.block.layout import Kind
from thermocomp.export.block.program import Function, called, kind_of, locals_of, parameters_of

#: operators of equal precedence: evaluated from left to right, they need no parentheses
_RANKS = ({ast.Add, ast.Sub}, {ast.Mult, ast.Div})


class Printer(ABC):
    """Translator of one function.

    Parameters
    ----------
    sizes : mapping of str to int
        Sizes of the block's tables.
    """

    #: by type of syntax tree node
    operators: ClassVar[Mapping[type[ast.AST], str]]

    def __init__(self, function: Function, sizes: Mapping[str, int]) -> None:
        self.function, self.sizes = function, sizes
        self.parameters = parameters_of(function)
        self.own = locals_of(function.tree, self.parameters)
        constants = {n: _kind(v) for n, v in function.constants.items() if n.isupper() and isinstance(v, int | float)}
        self._known: dict[str, Kind] = constants | self.own | self.parameters

    @property
    def statements(self) -> list[ast.stmt]:
        """Statements of the function, without its docstring."""
        return [s for s in self.function.tree.body if not isinstance(s, ast.Expr) or isinstance(s.value, ast.Call)]

    def block(self, statements: list[ast.stmt], depth: int) -> list[str]:
        """Return statements as lines of text, at least one per statement."""
        return [line for s in statements for line in self.statement(s, depth)]

    @abstractmethod
    def statement(self, node: ast.stmt, depth: int) -> list[str]:
        """Return the lines of a statement."""

    @abstractmethod
    def constant(self, value: float, kind: Kind) -> str:
        """Return a numeric constant."""

    @abstractmethod
    def variable(self, owner: str, name: str) -> str:
        """Return a variable of a structure; a size of the block is printed as a number."""

    @abstractmethod
    def choice(self, test: str, one: str, other: str) -> str:
        """Return a conditional expression: one of two values."""

    @abstractmethod
    def negated(self, text: str) -> str:
        """Return the negation of a condition."""

    @abstractmethod
    def call(self, name: str, args: list[ast.expr]) -> str:
        """Return a call of a numeric function."""

    def local(self, name: str) -> str:
        """Return a local variable of the function."""
        return name

    def element(self, array: ast.expr, at: list[ast.expr]) -> str:
        """Return an element of an array."""
        return self.value(array) + "".join(f"[{self.bare(a)}]" for a in at)

    def real(self, text: str, kind: Kind) -> str:  # noqa: ARG002 - implicit in some languages
        """Return a number converted to floating point."""
        return text

    def kind(self, node: ast.expr) -> Kind:
        """Return the type of an expression."""
        return kind_of(node, self._known)

    def bare(self, node: ast.expr, kind: Kind | None = None) -> str:
        """Return an expression without outer parentheses."""
        text = self.value(node, kind)
        outer = text.startswith("(") and isinstance(node, ast.BinOp | ast.BoolOp | ast.Compare | ast.IfExp)
        return text[1:-1] if outer else text

    def value(self, node: ast.expr, kind: Kind | None = None) -> str:  # noqa: PLR0911, PLR0912 - one case per node type
        """Return an expression, converted to `kind` if given."""
        match node:
            case ast.Constant(value):
                return self._constant(value, kind)
            case ast.Name(name) if name.isupper():
                return self._constant(self.function.constants[name], kind)
            case ast.Attribute(ast.Name("t"), name) if name in self.sizes and name != "MOST":
                return self._constant(self.sizes[name], kind)
        own = self.kind(node)
        if own == "int" and kind in ("real", "time"):
            return self.real(self.value(node), kind)
        match node:
            case ast.Name(name):
                return self.local(name)
            case ast.Attribute(ast.Name(owner), name):
                return self.variable(owner, name)
            case ast.Subscript(of, at):
                index = [at]
                while isinstance(of, ast.Subscript):
                    index.insert(0, of.slice)
                    of = of.value
                return self.element(of, index)
            case ast.UnaryOp(ast.Not(), of):
                return self.negated(self.value(of))
            case ast.UnaryOp(_, of):
                return f"-{self.value(of, kind)}"
            case ast.BinOp(left, op, right):
                sign = self.operators[type(op)]
                chained = isinstance(left, ast.BinOp) and any({type(op), type(left.op)} <= rank for rank in _RANKS)
                one = self.bare(left, own) if chained else self.value(left, own)
                return f"({one} {sign} {self.value(right, own)})"
            case ast.Compare(left, [op], [right]):
                kinds = {self.kind(left), self.kind(right)}
                common: Kind = next(k for k in ("time", "real", "int", "bool") if k in kinds)
                return f"({self.value(left, common)} {self.operators[type(op)]} {self.value(right, common)})"
            case ast.BoolOp(op, parts):
                return f"({f' {self.operators[type(op)]} '.join(self.value(p, 'bool') for p in parts)})"
            case ast.IfExp(test, body, orelse):
                return self.choice(self.value(test), self.value(body, kind or own), self.value(orelse, kind or own))
            case ast.Call(args=args):
                return self.call(called(node), args)
        raise TypeError(f"{ast.unparse(node)}: is not an expression of a block")

    def _constant(self, value: object, kind: Kind | None) -> str:
        if not isinstance(value, int | float):
            raise TypeError(f"{value}: is not a constant of a block")
        return self.constant(value, _kind(value) if kind is None else kind)


def _kind(constant: float) -> Kind:
    return "bool" if isinstance(constant, bool) else "int" if isinstance(constant, int) else "real"


def written(value: Any, one: Callable[[float], str]) -> list[str]:
    """Return the numbers of a table as text, row by row."""
    return [text for v in value for text in written(v, one)] if isinstance(value, list) else [one(value)]
