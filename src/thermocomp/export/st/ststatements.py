"""Functions of the block in structured text (IEC 61131-3), in the dialects of CODESYS, TwinCAT and Siemens SCL."""

import re
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Literal

from thermocomp.runtime.program import tree as n
from thermocomp.runtime.program.assembly import functions, grouped_locals
from thermocomp.runtime.program.declarations import Var
from thermocomp.runtime.program.printer import Printer, label_columns, label_rows, written
from thermocomp.runtime.program.tables import Tables
from thermocomp.runtime.program.tree import Function, Kind, Operator
from thermocomp.runtime.program.variables import RECORDS

Dialect = Literal["codesys", "twincat", "scl", "iec"]

TYPES: dict[Kind, str] = {"real": "LREAL", "time": "LREAL", "int": "DINT", "bool": "BOOL"}

#: reserved words of the language, or names of its library, in any of the dialects
RESERVED = frozenset(
    """
    abs abstract acos action add and any array asin at atan begin bool by byte case char class concat configuration
    const constant continue cos ctd ctu ctud date delete dint div do dt dword else elsif en end eno eq exit exp expt
    extends f_edge f_trig false final find floor for from function ge get goto gt if implements in initial_step insert
    int interface internal interval le left len limit lint ln log lreal lt lword max method mid min mod move mul mux
    namespace ne next non_retain not null of on or overlap override pointer private program protected public put
    r_edge r_trig read read_only read_write real ref reference region repeat replace resource result retain return
    right rol ror round rs rtc sel shl shr sin single sint sqrt sr step stop string struct sub super swap tan task
    then this time to tod tof ton tp transition true trunc type udint uint ulint until usint using var void wchar
    while with word write wstring xor
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
    parameters = {f.name: f.parameters for f in found}
    return {f"{name}_{f.name}": _Writer(f, tables, name, dialect, parameters).text() for f in found}


class _Writer(Printer):
    """Translator of one function of the program to structured text."""

    operators: ClassVar[Mapping[Operator, str]] = {
        "//": "/",
        "and": "AND",
        "or": "OR",
        "==": "=",
        "!=": "<>",
    }

    def __init__(
        self,
        function: Function,
        tables: Tables,
        name: str,
        dialect: Dialect,
        others: Mapping[str, Mapping[str, Kind]],
    ) -> None:
        super().__init__(function, tables.sizes, _labels(tables))
        self._name, self._scl, self._others = name, dialect == "scl", others

    def text(self) -> tuple[str, str]:
        f = self.function
        given = {p: TYPES[kind] for p, kind in f.parameters.items()}
        bags = {} if f.is_of_numbers else {v: quoted(f"{self._name}_{b}", self._scl) for v, b in BAGS.items()}
        own = {", ".join(map(safe, names)): kind for kind, names in grouped_locals(f, TYPES).items()}
        gives = "LREAL" if f.is_of_numbers else "Void" if self._scl else "BOOL"
        head = f"FUNCTION {quoted(f'{self._name}_{f.name}', self._scl)} : {gives}"
        parts = [head, *(SCL if self._scl else []), f"(* {f.about} *)"]
        parts += [section("VAR_IN_OUT", bags), section("VAR_INPUT", given)]
        parts += [section("VAR_TEMP" if self._scl else "VAR", own)]
        return "\n".join(filter(None, parts)), "\n".join(wrapped(x) for x in self.block(f.body, 0))

    def statement(self, node: n.Statement, depth: int) -> list[str]:  # noqa: PLR0911 - one case per node type
        pad, inner = "    " * depth, depth + 1
        match node:
            case n.Assign(target, n.Conditional(_, test, one, other)):
                return self.statement(n.If(test, [n.Assign(target, one)], [n.Assign(target, other)]), depth)
            case n.Assign(target, value):
                about = f" (* {said} *)" if (said := self.about(target)) else ""
                return [f"{pad}{self.value(target)} := {self.bare(value)};{about}"]
            case n.Return(n.Conditional(_, test, one, other)):
                return self.statement(n.If(test, [n.Return(one)], [n.Return(other)]), depth)
            case n.Return(value):
                return [f"{pad}{self._local(f'{self._name}_{self.function.name}')} := {self.bare(value)};"]
            case n.ProcedureCall(name, arguments):
                return [f"{pad}{self._call(name, arguments, list(BAGS))};"]
            case n.If(test, body, other):
                lines = [f"{pad}IF {self.bare(test)} THEN", *self.block(body, inner)]
                if len(other) == 1 and isinstance(other[0], n.If):
                    chained = self.statement(other[0], depth)
                    return [*lines, f"{pad}ELS{chained[0].lstrip()}", *chained[1:]]
                rest = [f"{pad}ELSE", *self.block(other, inner)] if other else []
                return [*lines, *rest, f"{pad}END_IF;"]
            case n.For(n.Name(_, name), begin, end, body):
                last = self.value(end)
                last = str(int(last) - 1) if last.isdecimal() else f"{last} - 1"
                head = f"FOR {self.local(name)} := {self.value(begin)} TO {last} DO"
                return [f"{pad}{head}", *self.block(body, inner), f"{pad}END_FOR;"]
            case n.While(test, body):
                return [f"{pad}WHILE {self.bare(test)} DO", *self.block(body, inner), f"{pad}END_WHILE;"]

    def _call(self, name: str, arguments: Sequence[n.Expression], bags: Sequence[str] = ()) -> str:
        given = [f"{v} := {self._local(v)}" for v in bags]
        given += [f"{safe(p)} := {self.bare(a)}" for p, a in zip(self._others[name], arguments, strict=True)]
        return f"{quoted(f'{self._name}_{name}', self._scl)}({', '.join(given)})"

    def local(self, name: str) -> str:
        return self._local(safe(name))

    def _local(self, name: str) -> str:
        return f"#{name}" if self._scl else name

    def variable(self, record: str, name: str) -> str:
        return f"{self._local(record)}.{safe(name)}"

    def element(self, array: n.Name, at: Sequence[n.Expression]) -> str:
        index = at[0]
        for dim, inner in zip(array.dims[1:], at[1:], strict=True):
            width = n.Numeral("int", max(self.sizes[dim], 1))
            index = n.Operation("int", "+", n.Operation("int", "*", index, width), inner)
        return f"{self.value(array)}[{self.bare(index)}]"

    def choice(self, test: str, one: str, other: str) -> str:
        return f"SEL(G := {test}, IN0 := {other}, IN1 := {one})" if self._scl else f"SEL({test}, {other}, {one})"

    def negated(self, text: str) -> str:
        return f"(NOT {text})"

    def real(self, text: str) -> str:
        return f"DINT_TO_LREAL({text[1:-1] if text.startswith('(') else text})"

    def call(self, name: str, arguments: Sequence[n.Expression]) -> str:
        if name == "floor":  # the argument is never negative
            return f"DINT_TO_LREAL(TRUNC({self.bare(arguments[0])}))"
        if name in _LIBRARY:
            return f"{_LIBRARY[name]}({self.bare(arguments[0])})"
        return self._call(name, arguments)

    def constant(self, value: float, kind: Kind) -> str:
        return number(value, kind) if value >= 0 else f"({number(value, kind)})"


#: structures passed to the functions, with the suffix of their type
BAGS = {"s": "state", "w": "work", "t": "tables"}


def quoted(name: str, scl: bool) -> str:
    """Return the name of a block or type, in quotation marks if the dialect requires them."""
    return f'"{name}"' if scl else name


def section(word: str, variables: Mapping[str, str]) -> str:
    """Return a section of declarations; empty without variables."""
    lines = [wrapped(f"    {safe(name)} : {what};") for name, what in variables.items()]
    return "\n".join([word, *lines, "END_VAR"]) if lines else ""


def array(kind: Kind, size: int) -> str:
    """Return the declaration of an array type."""
    return f"ARRAY[0..{max(size, 1) - 1}] OF {TYPES[kind]}"


def values(found: Any, kind: Kind) -> str:
    """Return the initial values of a variable as text."""
    texts = written(found, lambda v: number(v, kind))
    return f"[{', '.join(texts or [number(0, kind)])}]" if isinstance(found, list) else texts[0]


def wrapped(line: str) -> str:
    """Return a line, wrapped if it is too long."""
    if len(line) <= 120:
        return line
    indent = line[: len(line) - len(line.lstrip())] + "    "
    return textwrap.fill(line, 110, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)


def comment(text: str) -> str:
    """Return a text in which nothing ends a comment of structured text."""
    for sign in ("*)", "(*", "]]>"):
        text = text.replace(sign, " ".join(sign))
    return " ".join(text.split())


def _labels(tables: Tables) -> dict[str, list[str]]:
    return {dim: [comment(name).replace(";", ",") for name in names] for dim, names in tables.labels.items()}


def write_type(tables: Tables, name: str, bag: str, used: str, dialect: Dialect) -> str:
    """Return the type of a structure: the variables used in a text, with the values of constants."""
    scl = dialect == "scl"
    lines = [f"TYPE {quoted(f'{name}_{BAGS[bag]}', scl)}{'' if scl else ' :'}"]
    lines += SCL[1:] if scl else []
    lines += ["STRUCT"]
    labels = _labels(tables)
    for name_, var in used_in(bag, used).items():
        size = size_of(var, tables.sizes)
        text = f"    {safe(name_)} : {array(var.kind, size) if var.dims else TYPES[var.kind]}"
        if bag == "t":
            found = tables.values[name_]
            rows = _rows(found, var, labels) if var.dims and var.dims[0] in labels and found else []
            about = [f"    (* {var.about}{label_columns(var, labels)} *)"]
            lines += [wrapped(line) for line in about]
            lines += [f"{text} := [", *rows] if rows else [wrapped(f"{text} := {values(found, var.kind)};")]
        else:
            lines.append(wrapped(f"{text}; (* {var.about} *)"))
    return "\n".join([*lines, f"END_STRUCT{';' if scl else ''}", "END_TYPE"])


def _rows(found: list[Any], var: Var, labels: Mapping[str, Sequence[str]]) -> list[str]:
    """Return the initial values of an array, with a comment at each row of the table."""
    rows, lines = label_rows(found, var.dims, labels), list[str]()
    for k, (name, value) in enumerate(rows):
        text = f"        {', '.join(written(value, lambda v: number(v, var.kind)))}{',' if k < len(rows) - 1 else '];'}"
        one = f"{text} (* {name} *)"
        lines += [one] if len(one) < 120 and text.endswith(",") else [f"        (* {name} *)", wrapped(text)]
    return lines


def used_in(bag: str, used: str) -> dict[str, Var]:
    """Return the variables of a structure that are used in a text."""
    return {k: v for k, v in RECORDS[bag].variables().items() if re.search(rf"\b{bag}\.{safe(k)}\b", used)}


def size_of(var: Var, sizes: Mapping[str, int]) -> int:
    """Return the number of elements of a variable."""
    size = 1
    for dim in var.dims:
        size *= max(sizes[dim], 1)
    return size
