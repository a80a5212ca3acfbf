"""Translation of the program of a compensator to C99 functions."""

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from thermocomp.core.bounds import round_single, round_within
from thermocomp.runtime.program import tree as n
from thermocomp.runtime.program.assembly import functions, grouped_locals
from thermocomp.runtime.program.declarations import Var
from thermocomp.runtime.program.printer import Printer, compact, label_columns, label_rows
from thermocomp.runtime.program.tables import Tables
from thermocomp.runtime.program.tree import Function, Kind, Operator
from thermocomp.runtime.program.variables import RECORDS

TYPES: dict[Kind, str] = {"real": "tc_real", "time": "double", "int": "int", "bool": "int"}


def write_functions(tables: Tables, state: str) -> str:
    """Return the C functions that a compensator needs, `step` last."""
    labels = _labels(tables)
    return "\n".join(_Writer(f, tables.sizes, labels, state).text() for f in functions(tables))


def _labels(tables: Tables) -> dict[str, list[str]]:
    return {dim: [comment(name) for name in names] for dim, names in tables.labels.items()}


class _Writer(Printer):
    """Translator of one function of the program to C99."""

    operators: ClassVar[Mapping[Operator, str]] = {"and": "&&", "or": "||", "//": "/"}

    def __init__(
        self, function: Function, sizes: Mapping[str, int], labels: Mapping[str, Sequence[str]], state: str
    ) -> None:
        super().__init__(function, sizes, labels)
        self._state = state

    def text(self) -> str:
        f = self.function
        rest = [f"{TYPES[kind]} {name}" for name, kind in f.parameters.items()]
        head = f"/* {f.about[0].lower()}{f.about[1:].rstrip('.')} */\nstatic "
        if f.is_of_numbers:
            head += f"tc_real tc_{f.name}({', '.join(rest)})"
        else:
            head += f"void tc_{f.name}({', '.join([f'{self._state}_state *s', f'{self._state}_work *w', *rest])})"
        lines = compact(self.block(f.body, 1), r"(if|for|while) \(.*\{", r"\} else \{", r"\}")
        text = "\n".join(lines)
        declared = [f"    {kind} {', '.join(names)};" for kind, names in grouped_locals(f, TYPES).items()]
        passed = [] if f.is_of_numbers or "(s, w" in text else [v for v in "sw" if f"{v}->" not in text]
        passed += [p for p in f.parameters if not re.search(rf"\b{p}\b", text)]
        unused = [f"    (void){v};" for v in passed]
        return f"{head}\n{{\n" + "\n".join([*declared, *([""] if declared else []), *unused, *lines]) + "\n}\n"

    def statement(self, node: n.Statement, depth: int) -> list[str]:  # noqa: PLR0911 - one case per node type
        pad, inner = "    " * depth, depth + 1
        match node:
            case n.Assign(target, value):
                about = f" /* {said} */" if (said := self.about(target)) else ""
                return [f"{pad}{self.value(target)} = {self._as(value, target.kind)};{about}"]
            case n.ProcedureCall(name, arguments):
                given = [self._as(a, "real" if a.kind == "time" else a.kind) for a in arguments]
                return [f"{pad}tc_{name}({', '.join(['s', 'w', *given])});"]
            case n.Return(value):
                return [f"{pad}return {self._as(value, 'real')};"]
            case n.If(test, body, other):
                lines = [f"{pad}if ({self.bare(test)}) {{", *self.block(body, inner)]
                if len(other) == 1 and isinstance(other[0], n.If):
                    chained = self.statement(other[0], depth)
                    return [*lines, f"{pad}}} else {chained[0].lstrip()}", *chained[1:]]
                rest = [f"{pad}}} else {{", *self.block(other, inner)] if other else []
                return [*lines, *rest, f"{pad}}}"]
            case n.For(n.Name(_, name), begin, end, body):
                head = f"for ({name} = {self.value(begin)}; {name} < {self.value(end)}; {name}++) {{"
                return [f"{pad}{head}", *self.block(body, inner), f"{pad}}}"]
            case n.While(test, body):
                return [f"{pad}while ({self.bare(test)}) {{", *self.block(body, inner), f"{pad}}}"]

    def _as(self, node: n.Expression, kind: Kind) -> str:
        text = self.bare(node, kind)
        return f"(tc_real)({text})" if kind == "real" and node.kind == "time" else text

    def variable(self, record: str, name: str) -> str:
        return f"c_{name}" if record == "t" else f"{record}->{name}"

    def choice(self, test: str, one: str, other: str) -> str:
        return f"({test} ? {one} : {other})"

    def negated(self, text: str) -> str:
        return f"!{text}"

    def call(self, name: str, arguments: Sequence[n.Expression]) -> str:
        time = arguments[0].kind == "time" and name == "abs"
        given = ", ".join(self._as(a, "time" if time else "real") for a in arguments)
        if name == "abs":
            return f"fabs({given})" if time else f"TC_MATH(fabs)({given})"
        return f"TC_MATH({name})({given})" if hasattr(math, name) else f"tc_{name}({given})"

    def constant(self, value: float, kind: Kind) -> str:
        return _number(value, kind)


def _number(value: float, kind: Kind, *, cap: bool = False) -> str:
    """Return a number in C syntax: exact in double precision, within its bounds in single precision."""
    if kind in ("int", "bool"):
        return str(int(value))
    if kind == "time":
        return repr(float(value))
    text, size = repr(abs(float(value))), abs(value)
    single = float(round_within(size, 0.0, size) if cap else round_single(size))
    with np.errstate(over="ignore"):
        nearest = float(np.float32(size))
    sign = "-" if math.copysign(1.0, value) < 0 else ""
    return f"TC({sign}{text})" if single == nearest else f"TC_ROUNDED({sign}{text}, {sign}{single!r})"


def comment(text: str) -> str:
    """Return a text in which nothing ends a C comment."""
    for sign in ("*/", "/*", "??"):
        text = text.replace(sign, " ".join(sign))
    return " ".join(text.split())


def write_tables(tables: Tables, used: str) -> str:
    """Return the numbers used in a text, as C constants, with a comment beside each row of a table."""
    labels, text = _labels(tables), ""
    for name, var in _used("t", used, "c_").items():
        text += f"/* {var.about}{label_columns(var, labels)} */\n"
        text += f"static const {TYPES[var.kind]} c_{name}{_dims(var, tables.sizes)} = "
        found = tables.values[name]
        if var.dims and found and (var.dims[0] in labels or len(var.dims) > 1):
            text += "\n".join(["{", *_rows(found, var, var.dims, labels), "};\n"])
        else:
            text += f"{_list(found, var)};\n"
    return text


def _rows(found: list[Any], var: Var, dims: Sequence[str], labels: Mapping[str, Sequence[str]]) -> list[str]:
    if len(dims) > 2:
        tables = [_rows(value, var, dims[1:], labels) for value in found]
        names = labels.get(dims[0], range(len(found)))
        return [
            line for name, rows in zip(names, tables, strict=True) for line in (f"    {{ /* {name} */", *rows, "    },")
        ]
    lines = []
    for name, value in label_rows(found, dims, labels):
        text, about = f"    {_list(value, var)},", f"/* {name} */" if name else ""
        lines += [f"{text} {about}".rstrip()] if len(text) + len(about) < 118 else [f"    {about}".rstrip(), text]
    return lines


def _used(owner: str, used: str, before: str) -> dict[str, Var]:
    names = set(re.findall(rf"\b{before}(\w+)", used))
    return {n: v for n, v in RECORDS[owner].variables().items() if n in names}


def _dims(var: Var, sizes: Mapping[str, int]) -> str:
    return "".join(f"[{max(sizes[d], 1)}]" for d in var.dims)


def _list(value: Any, var: Var) -> str:
    if isinstance(value, list):
        return f"{{{', '.join(_list(v, var) for v in value) or '0'}}}"
    return _number(value, var.kind, cap=var.cap)


def write_variables(sizes: Mapping[str, int], owner: str, used: str) -> str:
    """Return the struct members for the variables used in a text."""
    return "".join(
        f"    {TYPES[var.kind]} {name}{_dims(var, sizes)}; /* {var.about} */\n"
        for name, var in _used(owner, used, f"{owner}->").items()
    )
