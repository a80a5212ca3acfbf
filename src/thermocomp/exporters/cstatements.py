"""The block's functions in C99."""

import ast
import re
from collections.abc import Mapping

from thermocomp.exporters.block.layout import Kind
from thermocomp.exporters.block.program import (
    VARIABLES,
    Function,
    called,
    functions,
    kind_of,
    locals_of,
    parameters_of,
)
from thermocomp.exporters.cexpression import number

TYPES: dict[Kind, str] = {"real": "tc_real", "time": "double", "int": "int", "bool": "int"}

_OPERATORS: dict[type[ast.AST], str] = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.FloorDiv: "/",
    ast.Mod: "%",
    ast.And: "&&",
    ast.Or: "||",
    ast.Eq: "==",
    ast.NotEq: "!=",
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
}


def write_functions(sizes: Mapping[str, int], state: str, formulas: Mapping[str, str]) -> str:
    """Return the functions that a block needs, `step` the last.

    Parameters
    ----------
    sizes : mapping of str to int
        Of the block's tables.
    state : str
        Name of the type that keeps its variables.
    formulas : mapping of str to str
        Bodies of the functions that work the models out.
    """
    return "\n".join(_Writer(f, sizes, state).text(formulas.get(f.name)) for f in functions(sizes))


def _kind(constant: float) -> Kind:
    return "int" if isinstance(constant, int) else "real"


class _Writer:
    """Writes one function."""

    def __init__(self, function: Function, sizes: Mapping[str, int], state: str) -> None:
        self._function, self._sizes, self._state = function, sizes, state
        self._parameters = parameters_of(function)
        self._own = locals_of(function.tree, self._parameters)
        constants = {n: _kind(v) for n, v in function.constants.items() if n.isupper() and isinstance(v, int | float)}
        self._known: dict[str, Kind] = constants | self._own | self._parameters

    def text(self, body: str | None) -> str:
        f = self._function
        rest = [f"{TYPES[kind]} {name}" for name, kind in self._parameters.items()]
        head = f"/* {f.about[0].lower()}{f.about[1:].splitlines()[0].rstrip('.')} */\nstatic "
        if f.is_of_numbers:
            head += f"tc_real tc_{f.name}({', '.join(rest)})"
        else:
            head += f"void tc_{f.name}({', '.join([f'{self._state}_state *s', f'{self._state}_work *w', *rest])})"
        if body is None:
            statements = [s for s in f.tree.body if not isinstance(s, ast.Expr) or isinstance(s.value, ast.Call)]
            lines = self._block(statements, 1)
            declared = [f"    {TYPES[kind]} {name};" for name, kind in self._own.items()]
            unused = (
                [] if f.is_of_numbers else [f"    (void){v};" for v in "sw" if not any(f"{v}->" in x for x in lines)]
            )
            passed = [] if f.is_of_numbers else [x for x in unused if not any("(s, w" in y for y in lines)]
            body = "\n".join([*declared, *([""] if declared else []), *passed, *lines])
        return f"{head}\n{{\n{body}\n}}\n"

    def _block(self, statements: list[ast.stmt], depth: int) -> list[str]:
        return [line for s in statements for line in self._statement(s, depth)]

    def _statement(self, node: ast.stmt, depth: int) -> list[str]:  # noqa: PLR0911 - a case for every kind of node
        pad, inner = "    " * depth, depth + 1
        match node:
            case ast.Assign([target], value):
                return [f"{pad}{self._value(target)} = {self._as(value, kind_of(target, self._known))};"]
            case ast.Expr(ast.Call() as call):
                parameters = [self._as(a, "int" if kind_of(a, self._known) == "int" else "real") for a in call.args[3:]]
                return [f"{pad}tc_{called(call)}({', '.join(['s', 'w', *parameters])});"]
            case ast.Return(value) if value is not None:
                return [f"{pad}return {self._as(value, 'real')};"]
            case ast.If(test, body, orelse):
                lines = [f"{pad}if ({self._bare(test)}) {{", *self._block(body, inner)]
                if len(orelse) == 1 and isinstance(orelse[0], ast.If):
                    chained = self._statement(orelse[0], depth)
                    return [*lines, f"{pad}}} else {chained[0].lstrip()}", *chained[1:]]
                other = [f"{pad}}} else {{", *self._block(orelse, inner)] if orelse else []
                return [*lines, *other, f"{pad}}}"]
            case ast.For(ast.Name(name), ast.Call(args=bounds), body):
                begin, end = bounds if len(bounds) == 2 else (ast.Constant(0), bounds[0])
                head = f"for ({name} = {self._value(begin)}; {name} < {self._value(end)}; {name}++) {{"
                return [f"{pad}{head}", *self._block(body, inner), f"{pad}}}"]
            case ast.While(test, body):
                return [f"{pad}while ({self._bare(test)}) {{", *self._block(body, inner), f"{pad}}}"]
        raise TypeError(f"{ast.unparse(node)}: no statement of a block")

    def _as(self, node: ast.expr, kind: Kind) -> str:
        text = self._bare(node, kind)
        return f"(tc_real)({text})" if kind == "real" and kind_of(node, self._known) == "time" else text

    def _bare(self, node: ast.expr, kind: Kind | None = None) -> str:
        text = self._value(node, kind)
        outer = text.startswith("(") and isinstance(node, ast.BinOp | ast.BoolOp | ast.Compare | ast.IfExp)
        return text[1:-1] if outer else text

    def _value(self, node: ast.expr, kind: Kind | None = None) -> str:  # noqa: PLR0911 - a case for every kind of node
        known = self._known
        match node:
            case ast.Constant(value):
                return self._constant(value, kind)
            case ast.Name(name):
                return self._constant(self._function.constants[name], kind) if name.isupper() else name
            case ast.Attribute(ast.Name("t"), name):
                if name not in self._sizes:
                    return f"c_{name}"
                return "TC_ZERO_READINGS" if name == "MOST" else str(self._sizes[name])
            case ast.Attribute(ast.Name(owner), name):
                return f"{owner}->{name}"
            case ast.Subscript(of, at):
                return f"{self._value(of)}[{self._bare(at)}]"
            case ast.UnaryOp(op, of):
                return f"{'!' if isinstance(op, ast.Not) else '-'}{self._value(of, kind)}"
            case ast.BinOp(left, op, right):
                kind = kind_of(node, known)
                return f"({self._value(left, kind)} {_OPERATORS[type(op)]} {self._value(right, kind)})"
            case ast.Compare(left, [op], [right]):
                kinds = {kind_of(left, known), kind_of(right, known)}
                kind = "time" if "time" in kinds else "real" if "real" in kinds else "int"
                return f"({self._value(left, kind)} {_OPERATORS[type(op)]} {self._value(right, kind)})"
            case ast.BoolOp(op, parts):
                return f"({f' {_OPERATORS[type(op)]} '.join(map(self._value, parts))})"
            case ast.IfExp(test, body, orelse):
                return f"({self._value(test)} ? {self._value(body, kind)} : {self._value(orelse, kind)})"
            case ast.Call(args=args):
                return self._call(called(node), args)
        raise TypeError(f"{ast.unparse(node)}: no expression of a block")

    def _call(self, name: str, args: list[ast.expr]) -> str:
        time = kind_of(args[0], self._known) == "time" and name == "abs"
        kind: Kind = "time" if time else "real"
        given = ", ".join(self._as(a, kind) for a in args)
        if name == "abs":
            return f"fabs({given})" if time else f"TC_MATH(fabs)({given})"
        return f"TC_MATH({name})({given})" if name in ("exp", "expm1", "pow") else f"tc_{name}({given})"

    @staticmethod
    def _constant(value: object, kind: Kind | None) -> str:
        if isinstance(value, int):
            return str(int(value)) if kind not in ("real", "time") else _Writer._constant(float(value), kind)
        if not isinstance(value, float):
            raise TypeError(f"{value}: no constant of a block")
        return repr(value) if kind == "time" else number(value)


def write_tables(sizes: Mapping[str, int], values: Mapping[str, object], used: str) -> str:
    """Return the numbers that a text uses, as constants."""
    lines = []
    for name, var in VARIABLES["t"].items():
        if not re.search(rf"\bc_{name}\b", used):
            continue
        dims = "".join(f"[{max(sizes[d], 1)}]" for d in var.dims)
        lines.append(
            f"/* {var.about} */\nstatic const {TYPES[var.kind]} c_{name}{dims} = {_list(values[name], var.kind)};\n"
        )
    return "".join(lines)


def _list(value: object, kind: Kind) -> str:
    if isinstance(value, list):
        return f"{{{', '.join(_list(v, kind) for v in value) or '0'}}}"
    assert isinstance(value, float | int)
    if kind in ("int", "bool"):
        return str(int(value))
    return repr(float(value)) if kind == "time" else number(float(value))


def write_variables(sizes: Mapping[str, int], owner: str, used: str) -> str:
    """Return the members of the type that keeps variables, those that a text uses."""
    lines = []
    for name, var in VARIABLES[owner].items():
        if re.search(rf"\b{owner}->{name}\b", used):
            dims = "".join(f"[{'TC_ZERO_READINGS' if d == 'MOST' else max(sizes[d], 1)}]" for d in var.dims)
            lines.append(f"    {TYPES[var.kind]} {name}{dims}; /* {var.about} */\n")
    return "".join(lines)
