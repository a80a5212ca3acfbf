"""The block's functions in structured text (IEC 61131-3), in the dialects of CODESYS, TwinCAT and Siemens SCL."""

import ast
import re
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Literal

from thermocomp.export.block.layout import Kind, Var
from thermocomp.export.block.program import VARIABLES, Function, called, functions, parameters_of
from thermocomp.export.block.tables import Tables
from thermocomp.export.printer import Printer, written

Dialect = Literal["codesys", "twincat", "scl"]

TYPES: dict[Kind, str] = {"real": "LREAL", "time": "LREAL", "int": "DINT", "bool": "BOOL"}

#: reserved words of the language, or names of its library, in any of the dialects
RESERVED = frozenset(
    """
    abs acos action add and any array asin at atan begin bool by byte case concat configuration const constant
    continue date delete dint div do dt dword else elsif end eq exit exp expt false find floor for from function ge
    get goto gt if in insert int interval le left len lint limit ln log lreal lt lword max method mid min mod mul
    mux ne next not of on or override pointer private program public put read real ref reference region repeat
    replace resource result retain return right rol ror round sel shl shr sin single sint sqrt step stop string
    struct sub super swap tan task then this time to tod transition true trunc type udint uint ulint until usint var
    void while with word write xor
    """.split()  # noqa: SIM905 - a list with one word per line would be long
)

#: attributes after the name of a block: data blocks without optimized access are limited to 64 kB
SCL = ["{ S7_Optimized_Access := 'TRUE' }", "VERSION : 0.1"]

#: library functions common to all dialects
_LIBRARY = {"abs": "ABS", "exp": "EXP", "log": "LN", "sqrt": "SQRT"}


def safe(name: str) -> str:
    """Return a name that is not a reserved word; upper and lower case are not distinguished."""
    return f"tc_{name}" if name.lower() in RESERVED else name


def number(value: float, kind: Kind = "real") -> str:
    """Return a number in structured text, exact in double precision."""
    if kind == "bool":
        return "TRUE" if value else "FALSE"
    if kind == "int":
        return str(int(value))
    mantissa, _, exponent = repr(float(value)).partition("e")
    return mantissa + (("" if "." in mantissa else ".0") + f"E{exponent}" if exponent else "")


def write_functions(tables: Tables, name: str, dialect: Dialect) -> dict[str, tuple[str, str]]:
    """Return declaration and statements of the functions that a block needs, by name."""
    found = functions(tables, {"expm1": "exp_less_one", "pow": "power"})
    parameters = {f.name: parameters_of(f) for f in found}
    return {f"{name}_{f.name}": _Writer(f, tables, name, dialect, parameters).text() for f in found}


class _Writer(Printer):
    """Writer of one function."""

    operators: ClassVar = {
        ast.Add: "+",
        ast.Sub: "-",
        ast.Mult: "*",
        ast.Div: "/",
        ast.FloorDiv: "/",
        ast.Mod: "MOD",
        ast.And: "AND",
        ast.Or: "OR",
        ast.Eq: "=",
        ast.NotEq: "<>",
        ast.Lt: "<",
        ast.LtE: "<=",
        ast.Gt: ">",
        ast.GtE: ">=",
    }

    def __init__(
        self,
        function: Function,
        tables: Tables,
        name: str,
        dialect: Dialect,
        others: Mapping[str, Mapping[str, Kind]],
    ) -> None:
        super().__init__(function, tables.sizes)
        self._name, self._scl, self._others = name, dialect == "scl", others

    def text(self) -> tuple[str, str]:
        f = self.function
        given = {n: TYPES[kind] for n, kind in self.parameters.items()}
        bags = {} if f.is_of_numbers else {v: quoted(f"{self._name}_{b}", self._scl) for v, b in BAGS.items()}
        own = {n: TYPES[kind] for n, kind in self.own.items()}
        gives = "LREAL" if f.is_of_numbers else "Void" if self._scl else "BOOL"
        head = f"FUNCTION {quoted(f'{self._name}_{f.name}', self._scl)} : {gives}"
        parts = [head, *(SCL if self._scl else []), f"(* {f.about.splitlines()[0]} *)"]
        parts += [section("VAR_IN_OUT", bags), section("VAR_INPUT", given)]
        parts += [section("VAR_TEMP" if self._scl else "VAR", own)]
        return "\n".join(filter(None, parts)), "\n".join(wrapped(x) for x in self.block(self.statements, 0))

    def statement(self, node: ast.stmt, depth: int) -> list[str]:  # noqa: PLR0911 - one case per node type
        pad, inner = "    " * depth, depth + 1
        match node:
            case ast.Assign([target], ast.IfExp(test, body, orelse)):
                one, other = ast.Assign([target], body), ast.Assign([target], orelse)
                return self.statement(ast.If(test, [one], [other]), depth)
            case ast.Assign([target], value):
                return [f"{pad}{self.value(target)} := {self.bare(value, self.kind(target))};"]
            case ast.Return(ast.IfExp(test, body, orelse)):
                return self.statement(ast.If(test, [ast.Return(body)], [ast.Return(orelse)]), depth)
            case ast.Return(value) if value is not None:
                return [f"{pad}{self._local(f'{self._name}_{self.function.name}')} := {self.bare(value, 'real')};"]
            case ast.Expr(ast.Call() as call):
                return [f"{pad}{self._call(called(call), call.args[3:], list(BAGS))};"]
            case ast.If(test, body, orelse):
                lines = [f"{pad}IF {self.bare(test)} THEN", *self.block(body, inner)]
                if len(orelse) == 1 and isinstance(orelse[0], ast.If):
                    chained = self.statement(orelse[0], depth)
                    return [*lines, f"{pad}ELS{chained[0].lstrip()}", *chained[1:]]
                rest = [f"{pad}ELSE", *self.block(orelse, inner)] if orelse else []
                return [*lines, *rest, f"{pad}END_IF;"]
            case ast.For(ast.Name(name), ast.Call(args=bounds), body):
                begin, end = bounds if len(bounds) == 2 else (ast.Constant(0), bounds[0])
                last = self.value(end, "int")
                last = str(int(last) - 1) if last.isdecimal() else f"{last} - 1"
                head = f"FOR {self.local(name)} := {self.value(begin)} TO {last} DO"
                return [f"{pad}{head}", *self.block(body, inner), f"{pad}END_FOR;"]
            case ast.While(test, body):
                return [f"{pad}WHILE {self.bare(test)} DO", *self.block(body, inner), f"{pad}END_WHILE;"]
        raise TypeError(f"{ast.unparse(node)}: is not a statement of a block")

    def _call(self, name: str, args: Sequence[ast.expr], bags: Sequence[str] = ()) -> str:
        given = [f"{v} := {self._local(v)}" for v in bags]
        wanted = zip(self._others[name].items(), args, strict=True)
        given += [f"{safe(n)} := {self.bare(a, kind)}" for (n, kind), a in wanted]
        return f"{quoted(f'{self._name}_{name}', self._scl)}({', '.join(given)})"

    def local(self, name: str) -> str:
        return self._local(safe(name))

    def _local(self, name: str) -> str:
        return f"#{name}" if self._scl else name

    def variable(self, owner: str, name: str) -> str:
        return str(self.sizes[name]) if name == "MOST" else f"{self._local(owner)}.{safe(name)}"

    def element(self, array: ast.expr, at: list[ast.expr]) -> str:
        assert isinstance(array, ast.Attribute)
        assert isinstance(array.value, ast.Name)
        index = at[0]
        for dim, inner in zip(VARIABLES[array.value.id][array.attr].dims[1:], at[1:], strict=True):
            index = ast.BinOp(ast.BinOp(index, ast.Mult(), ast.Constant(max(self.sizes[dim], 1))), ast.Add(), inner)
        return f"{self.value(array)}[{self.bare(index)}]"

    def choice(self, test: str, one: str, other: str) -> str:
        return f"SEL(G := {test}, IN0 := {other}, IN1 := {one})" if self._scl else f"SEL({test}, {other}, {one})"

    def negated(self, text: str) -> str:
        return f"(NOT {text})"

    def real(self, text: str, kind: Kind) -> str:  # noqa: ARG002 - only one precision
        return f"DINT_TO_LREAL({text[1:-1] if text.startswith('(') else text})"

    def call(self, name: str, args: list[ast.expr]) -> str:
        if name == "floor":  # the argument is never negative
            return f"DINT_TO_LREAL(TRUNC({self.bare(args[0], 'real')}))"
        if name in _LIBRARY:
            return f"{_LIBRARY[name]}({self.bare(args[0], self.kind(args[0]))})"
        return self._call(name, args)

    def constant(self, value: float, kind: Kind) -> str:
        return number(value, kind) if value >= 0 else f"({number(value, kind)})"


#: structures passed to the functions, with the suffix of their type
BAGS = {"s": "state", "w": "work", "t": "tables"}


def quoted(name: str, scl: bool) -> str:
    """Return the name of a block or of a type."""
    return f'"{name}"' if scl else name


def section(word: str, variables: Mapping[str, str]) -> str:
    """Return a section of declarations; empty without variables."""
    lines = [f"    {safe(name)} : {what};" for name, what in variables.items()]
    return "\n".join([word, *lines, "END_VAR"]) if lines else ""


def array(kind: Kind, size: int) -> str:
    """Return the type of an array."""
    return f"ARRAY[0..{max(size, 1) - 1}] OF {TYPES[kind]}"


def values(found: Any, kind: Kind) -> str:
    """Return the initial value of a variable."""
    texts = written(found, lambda v: number(v, kind))
    return f"[{', '.join(texts or [number(0, kind)])}]" if isinstance(found, list) else texts[0]


def wrapped(line: str) -> str:
    """Return a long line as several lines."""
    if len(line) <= 120:
        return line
    indent = line[: len(line) - len(line.lstrip())] + "    "
    return textwrap.fill(line, 110, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)


def write_type(tables: Tables, name: str, bag: str, used: str, dialect: Dialect) -> str:
    """Return the type of a structure: the variables used in a text, with the values of constants."""
    scl = dialect == "scl"
    lines = [f"TYPE {quoted(f'{name}_{BAGS[bag]}', scl)}{'' if scl else ' :'}"]
    lines += SCL[1:] if scl else []
    lines += ["STRUCT"]
    for n, var in used_in(bag, used).items():
        size = size_of(var, tables.sizes)
        what = array(var.kind, size) if var.dims else TYPES[var.kind]
        start = f" := {values(tables.values[n], var.kind)}" if bag == "t" else ""
        lines += [wrapped(f"    {safe(n)} : {what}{start};"), f"    (* {var.about} *)"]
    return "\n".join([*lines, f"END_STRUCT{';' if scl else ''}", "END_TYPE"])


def used_in(bag: str, used: str) -> dict[str, Var]:
    """Return the variables of a structure that are used in a text."""
    return {n: v for n, v in VARIABLES[bag].items() if re.search(rf"\b{bag}\.{safe(n)}\b", used)}


def size_of(var: Var, sizes: Mapping[str, int]) -> int:
    """Return the number of elements of a variable."""
    size = 1
    for dim in var.dims:
        size *= max(sizes[dim], 1)
    return size
