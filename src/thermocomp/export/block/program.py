"""The block's functions as syntax trees: those needed by a compensator, without unused branches."""

import ast
import inspect
from collections.abc import Iterator, Mapping
from functools import cache, lru_cache
from types import MappingProxyType, ModuleType
from typing import NamedTuple

from thermocomp.export.block import blaming, clocks, distances, formulas, numbers, steps, watching
from thermocomp.export.block.layout import STATE, TABLES, WATCH, WATCH_WORK, WORK, Kind, Var
from thermocomp.export.block.tables import Tables

#: variables by the name of their namespace
VARIABLES: dict[str, dict[str, Var]] = {"s": STATE | WATCH, "w": WORK | WATCH_WORK, "t": TABLES}


class Function(NamedTuple):
    """A function of the block."""

    name: str
    tree: ast.FunctionDef
    constants: Mapping[str, object]  #: constants of its module

    @property
    def parameters(self) -> list[str]:
        """Parameters other than the namespaces of variables."""
        return [a.arg for a in self.tree.args.args if a.arg not in VARIABLES]

    @property
    def is_of_numbers(self) -> bool:
        """Whether the function returns a number and has no side effects."""
        return not any(a.arg in VARIABLES for a in self.tree.args.args)

    @property
    def about(self) -> str:
        """Docstring of the function."""
        return ast.get_docstring(self.tree) or ""


@cache
def _all() -> dict[str, Function]:
    modules: tuple[ModuleType, ...] = (numbers, distances, clocks, blaming, watching, steps)
    return {
        node.name: Function(node.name, node, vars(module))
        for module in modules
        for node in ast.parse(inspect.getsource(module)).body
        if isinstance(node, ast.FunctionDef)
    }


def called(node: ast.Call) -> str:
    """Return the name of the called function."""
    return node.func.attr if isinstance(node.func, ast.Attribute) else node.func.id  # type: ignore[attr-defined]


def functions(tables: Tables, own: Mapping[str, str] = MappingProxyType({})) -> list[Function]:
    """Return the functions that a block needs, callees before callers; `step` is the last.

    Parameters
    ----------
    tables : Tables
        Tables of the compensator: an ``if`` that depends on one of their sizes is resolved here.
    own : mapping of str to str
        Functions of the block that replace library functions, by the names of the latter.
    """
    known = _all() | {name: _made(name, text) for name, text in tables.formulas.items()}
    known |= {name: known[of]._replace(name=name) for name, of in own.items()}
    found: dict[str, Function] = {}

    def add(name: str) -> None:
        function = known[name]
        tree = _Decided(tables.sizes).visit(ast.parse(_text_of(function.tree)).body[0])
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and called(node) in known and called(node) not in found:
                add(called(node))
        found[name] = function._replace(tree=tree)

    add("step")
    return list(found.values())


@lru_cache(maxsize=256)
def _text_of(tree: ast.FunctionDef) -> str:
    return ast.unparse(tree)


def _made(name: str, text: str) -> Function:
    tree = ast.parse(text).body[0]
    assert isinstance(tree, ast.FunctionDef)
    about = ast.Expr(ast.Constant(inspect.getdoc(getattr(formulas, name)) or ""))
    tree.body.insert(0, about)
    return Function(name, tree, {})


class _Decided(ast.NodeTransformer):
    """Transformer that removes branches and loops not used by a compensator."""

    def __init__(self, sizes: Mapping[str, int]) -> None:
        self._sizes = sizes

    def generic_visit(self, node: ast.AST) -> ast.AST:
        """Leave an expression: no statement is in one."""
        return node if isinstance(node, ast.expr) else super().generic_visit(node)

    def visit_If(self, node: ast.If) -> ast.AST | list[ast.stmt]:
        """Replace an ``if`` with a known condition by the branch it selects."""
        self.generic_visit(node)
        match node.test:
            case ast.Attribute(ast.Name("t"), name) if name in self._sizes:
                return node.body if self._sizes[name] else node.orelse
        return node

    def visit_For(self, node: ast.For) -> ast.AST | list[ast.stmt]:
        """Remove a loop without iterations."""
        self.generic_visit(node)
        match node.iter:
            case ast.Call(args=[ast.Attribute(ast.Name("t"), name)]) if self._sizes[name] == 0:
                return []
        return node


def kind_of(node: ast.expr, local: Mapping[str, Kind]) -> Kind:  # noqa: PLR0911 - one case per node type
    """Return the type of an expression: ``time`` if any part of it is a time."""
    match node:
        case ast.Compare() | ast.BoolOp() | ast.UnaryOp(ast.Not()):
            return "bool"
        case ast.Constant(value):
            return "bool" if isinstance(value, bool) else "int" if isinstance(value, int) else "real"
        case ast.Name(name):
            return local.get(name, "real")
        case ast.Attribute(ast.Name(owner), name):
            return VARIABLES[owner][name].kind if name in VARIABLES[owner] else "int"
        case ast.Subscript(of):
            return kind_of(of, local)
        case ast.IfExp(_, body, orelse):
            parts = [body, orelse]
        case ast.BinOp(left, _, right):
            parts = [left, right]
        case ast.UnaryOp(_, of):
            parts = [of]
        case ast.Call(ast.Name("abs"), [of]):
            parts = [of]
        case ast.Call():
            return "real"
    kinds = {kind_of(part, local) for part in parts}
    return "time" if "time" in kinds else "real" if "real" in kinds else kinds.pop()


def locals_of(tree: ast.FunctionDef, parameters: Mapping[str, Kind]) -> dict[str, Kind]:
    """Return the types of a function's local variables, in order of appearance."""
    found: dict[str, Kind] = dict(parameters)
    for node in ast.walk(tree):
        if isinstance(node, ast.For) and isinstance(node.target, ast.Name):
            found[node.target.id] = "int"
    for node in _in_order(tree):
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            name, kind = node.targets[0].id, kind_of(node.value, found)
            if found.get(name, kind) != kind and "time" not in (found[name], kind):
                kind = "real"
            found.setdefault(name, kind)
    return {name: kind for name, kind in found.items() if name not in parameters}


def _in_order(node: ast.AST) -> Iterator[ast.stmt]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.stmt):
            yield child
            yield from _in_order(child)


#: types of function parameters, by annotation
PARAMETER: dict[str, Kind] = {"int": "int", "float": "real", "bool": "bool"}


def parameters_of(function: Function) -> dict[str, Kind]:
    """Return the types of a function's parameters other than the namespaces."""
    return {
        a.arg: PARAMETER[ast.unparse(a.annotation)]
        for a in function.tree.args.args
        if a.arg not in VARIABLES and a.annotation
    }
