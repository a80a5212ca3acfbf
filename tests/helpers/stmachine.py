"""A machine that runs structured text: blark parses it, types are checked strictly, Python runs it.

No value is converted unless the text says so, both sides of AND and OR are worked out, an index beyond an array, a
number of 32 bits that overflows and a variable that is read before it is set are errors.
"""

import copy
import math
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
from blark import transform as b
from stparsing import PYTHON, Array, Block, Piece, Type, block_of, declared

from thermocomp.export.st.structuredtext import NOTHING, SourceUnit, translate
from thermocomp.export.vectors import DAMAGED, RETAINED, REZERO, TOLD_COLD, Answers, Readings, replay
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.program.tables import gather

_COMPARE = {"=": "==", "<>": "!=", "<": "<", "<=": "<=", ">": ">", ">=": ">="}
_NUMBERS = {"EXP": math.exp, "LN": math.log, "SQRT": math.sqrt}


class Machine:
    """A function block, and what it calls.

    Parameters
    ----------
    units : sequence of SourceUnit
        The function block is the last.
    """

    def __init__(self, units: Sequence[SourceUnit]) -> None:
        self._structs = {u.name: declared(u.declaration) for u in units if not u.end}
        blocks = [block_of(u) for u in units if u.end]
        self._heads = {block.name: _head(block) for block in blocks}
        self._space: dict[str, Any] = {
            "Array": Array,
            "SEL": lambda g, one, other: other if g else one,
            "TRUNC": _trunc,
            "COPY": _copy,
            **_NUMBERS,
        }
        for block in blocks:
            exec(_Function(self, block).source(), self._space)
        self._name = blocks[-1].name
        self.start()

    def start(self) -> None:
        """Begin with a new memory."""
        self.memory = self._memory(self._name)

    def _memory(self, block: str) -> SimpleNamespace:
        """Return an instance of a function block."""
        head = self._heads[block]
        return SimpleNamespace(
            **{n: self._new(k) for part in ("in", "inout", "out", "own") for n, k in head[part].items()}
        )

    def _new(self, kind: Type) -> Any:
        if isinstance(kind, tuple):
            return Array([PYTHON[kind[1]]()] * kind[2])
        if kind in self._heads:
            return self._memory(kind)
        if kind in self._structs:
            return SimpleNamespace(
                **{n: v if not isinstance(v, Array) else Array(v) for n, (_, v) in self._structs[kind].items()}
            )
        return PYTHON[kind]()

    def call(self, **inputs: Any) -> SimpleNamespace:
        """Call the function block; returns all that is in it."""
        for name, value in inputs.items():
            setattr(self.memory, name, Array(value) if isinstance(value, list) else value)
        self._space[self._name](self.memory)
        return self.memory

    def kind_of(self, struct: str, member: str) -> Type:
        """Return the type of a member of a structure, or of what a function block shows."""
        if struct in self._heads:
            return {**self._heads[struct]["in"], **self._heads[struct]["out"]}[member]
        return self._structs[struct][member][0]

    def is_struct(self, kind: Type) -> bool:
        """Return whether a type is a structure."""
        return kind in self._structs

    def head(self, name: str) -> dict[str, Any]:
        """Return what a function takes and gives."""
        return self._heads[name]


def _copy(to: SimpleNamespace, of: SimpleNamespace) -> None:
    for name, value in vars(copy.deepcopy(of)).items():
        setattr(to, name, value)


def _trunc(value: float) -> int:
    assert abs(value) < 2**31
    return int(value)


_SECTIONS = {"VAR_INPUT": "in", "VAR_IN_OUT": "inout", "VAR_OUTPUT": "out", "VAR": "own"}


def _head(block: Block) -> dict[str, Any]:
    """Return names and types of a block's variables, by section, and what a function gives."""
    found: dict[str, Any] = {"in": {}, "inout": {}, "out": {}, "own": {}, "gives": block.gives or None}
    for section, name, kind in block.variables:
        found[_SECTIONS[section]][name] = kind
    return found


class _Function:
    """Writes a block as Python."""

    def __init__(self, machine: Machine, block: Block) -> None:
        self._machine, self._body, self._name = machine, block.body, block.name
        self._written: dict[str, str] = {}
        head = machine.head(self._name)
        self._is_block = not block.gives
        self._types: dict[str, Type] = {**head["in"], **head["inout"], **head["out"], **head["own"]}
        self._given = [*head["inout"], *head["in"]]
        if not self._is_block:
            self._types[self._name] = head["gives"]

    def source(self) -> str:
        given = "self" if self._is_block else ", ".join(self._given)
        lines = [f"def {self._name}({given}):"]
        lines += self._block_of(self._body, 1)
        if not self._is_block:
            lines += [f"    return {self._name}_"] if self._types[self._name] == "LREAL" else ["    return False"]
        return "\n".join(lines)

    def _block_of(self, body: Sequence[Piece], depth: int) -> list[str]:
        lines, outer = list[str](), self._written
        for piece in body:
            self._written = piece.written
            lines += self._statement(piece.tree, piece.bodies, depth)
        self._written = outer
        return lines or ["    " * depth + "pass"]

    def _named(self, name: Any) -> str:
        """Return the name that stands where another was parsed."""
        return self._written.get(str(name), str(name))

    def _instance(self, s: Any, pad: str) -> list[str]:
        """Return a call of an instance of a function block."""
        name, kind = self._value(s.name)
        head = self._machine.head(kind)
        given = {**head["in"], **head["inout"]}
        assert [self._named(p.name) for p in s.parameters] == list(given), s
        lines = []
        for p, (parameter, wanted) in zip(s.parameters, given.items(), strict=True):
            value = self._as(p.value, wanted)
            lines.append(f"{pad}{name}.{parameter} = {f'Array({value})' if isinstance(wanted, tuple) else value}")
        return [*lines, f"{pad}{kind}({name})"]

    def _statement(  # noqa: PLR0911 - a case for every kind of statement
        self, s: Any, bodies: Sequence[Sequence[Piece]], depth: int
    ) -> list[str]:
        pad = "    " * depth
        match s:
            case b.AssignmentStatement():
                target, kind = self._value(s.variables[0])
                value, given = self._value(s.expression)
                assert kind == given, f"{s}: {given} for {kind}"
                if self._machine.is_struct(kind):
                    return [f"{pad}COPY({target}, {value})"]
                return [f"{pad}{target} = {value}"]
            case b.IfStatement():
                tests = [s.if_expression, *(other.if_expression for other in s.else_ifs)]
                heads = [f"{pad}{'el' * (k > 0)}if {self._as(t, 'BOOL')}:" for k, t in enumerate(tests)]
                heads += [f"{pad}else:"] if s.else_clause else []
                inner = [self._block_of(body, depth + 1) for body in bodies]
                return [line for head, lines in zip(heads, inner, strict=True) for line in (head, *lines)]
            case b.ForStatement():
                begin, end = self._as(s.from_, "DINT"), self._as(s.to, "DINT")
                target = self._value(s.control)[0]
                return [f"{pad}for {target} in range({begin}, {end} + 1):", *self._block_of(bodies[0], depth + 1)]
            case b.WhileStatement():
                return [f"{pad}while {self._as(s.expression, 'BOOL')}:", *self._block_of(bodies[0], depth + 1)]
            case b.FunctionCallStatement() | b.FunctionCall():
                if self._named(s.name.name) in self._types:
                    return self._instance(s, pad)
                return [f"{pad}{self._value(s)[0]}"]
        raise TypeError(f"{type(s)}: {s}")

    def _number(self, value: Any) -> str:
        """Return the number that stands where another was parsed."""
        return self._written[str(value)]

    def _as(self, node: Any, kind: Type) -> str:
        text, given = self._value(node)
        assert given == kind, f"{node}: {given}, want {kind}"
        return text

    def _value(self, node: Any) -> tuple[str, Type]:  # noqa: PLR0911, PLR0912 - a case for every kind of node
        match node:
            case b.ParenthesizedExpression():
                return self._value(node.expr)
            case b.Boolean():
                return str(str(node.value).upper() == "TRUE"), "BOOL"
            case b.Integer():
                return str(int(self._number(node.value))), "DINT"
            case b.Real():
                return repr(float(self._number(node.value))), "LREAL"
            case b.SimpleVariable():
                name = self._named(node.name)
                if name == self._name:
                    return f"{name}_", self._types[name]
                return (f"self.{name}" if self._is_block else name), self._types[name]
            case b.MultiElementVariable():
                text, kind = self._value(node.name)
                for element in node.elements:
                    if isinstance(element, b.FieldSelector):
                        member = self._named(element.field.name)
                        text, kind = f"{text}.{member}", self._machine.kind_of(kind, member)
                    else:
                        assert kind[0] == "ARRAY", node
                        text, kind = f"{text}[{self._as(element.subscripts[0], 'DINT')}]", kind[1]
                return text, kind
            case b.UnaryOperation():
                text, kind = self._value(node.expr)
                if str(node.op).upper() == "NOT":
                    assert kind == "BOOL", node
                    return f"(not {text})", "BOOL"
                assert kind in ("DINT", "LREAL"), node
                return f"(-{text})", kind
            case b.BinaryOperation():
                return self._operation(str(node.op).upper(), node)
            case b.FunctionCallStatement() | b.FunctionCall():
                return self._call(node)
        raise TypeError(f"{type(node)}: {node}")

    def _operation(self, op: str, node: Any) -> tuple[str, Type]:
        (one, kind), (other, second) = self._value(node.left), self._value(node.right)
        assert kind == second, f"{node}: {kind} {op} {second}"
        if op in ("AND", "OR"):
            assert kind == "BOOL", node
            return f"({one} {'&' if op == 'AND' else '|'} {other})", "BOOL"
        if op in _COMPARE:
            assert kind != "BOOL" or op in ("=", "<>"), node
            return f"({one} {_COMPARE[op]} {other})", "BOOL"
        assert kind in ("DINT", "LREAL"), node
        if kind == "DINT":
            op = {"/": "//", "MOD": "%"}.get(op, op)
        return f"({one} {op} {other})", kind

    def _call(self, node: Any) -> tuple[str, Type]:
        name, given = self._named(node.name.name), node.parameters
        values = [p.value for p in given]
        if name in _NUMBERS:
            return f"{name}({self._as(values[0], 'LREAL')})", "LREAL"
        if name == "ABS":
            text, kind = self._value(values[0])
            assert kind in ("DINT", "LREAL"), node
            return f"abs({text})", kind
        if name == "TRUNC":
            return f"TRUNC({self._as(values[0], 'LREAL')})", "DINT"
        if name == "DINT_TO_LREAL":
            return f"float({self._as(values[0], 'DINT')})", "LREAL"
        if name == "SEL":
            (one, kind), (other, second) = self._value(values[1]), self._value(values[2])
            assert kind == second, node
            return f"SEL({self._as(values[0], 'BOOL')}, {one}, {other})", kind
        head = self._machine.head(name)
        wanted = {**head["inout"], **head["in"]}
        assert [self._named(p.name) for p in given] == list(wanted), f"{node}: wants {list(wanted)}"
        texts = [self._as(v, kind) for v, kind in zip(values, wanted.values(), strict=True)]
        return f"{name}({', '.join(texts)})", head["gives"]


def finite(value: float) -> float:
    return float(value) if np.isfinite(value) else NOTHING


def happening(event: float, amount: float) -> dict[str, Any]:
    """Return the inputs of a block for what happens before a call; see `thermocomp.export.vectors`."""
    return {
        "off_time": float(amount),
        "cold": False,
        "restart": event == TOLD_COLD,
        "rezero": event >= REZERO,
        "target": int(event) - REZERO,
        "remaining": float(amount),
        "first": event in (RETAINED, DAMAGED),
    }


def run(machine: Machine, readings: Readings, targets: int, sensors: int) -> Answers:
    """Call a block with readings; what is not a number is not good."""
    said, told, found, passed, warm = [], [], [], [], []
    for *values, age, dt, counter, event, amount in readings.columns.tolist():
        good = [bool(np.isfinite(v)) for v in values]
        machine.memory.kept.correction[0] += float(event == DAMAGED)
        seen = machine.call(
            value=[float(v) if g else 0.0 for v, g in zip(values, good, strict=True)],
            good=good,
            age=finite(age),
            elapsed=finite(dt),
            reading=counter,
            **happening(event, amount),
        )
        said.append([*seen.correction, *seen.slope])
        told.append(list(seen.status))
        found.append(list(seen.fault) if sensors else [])
        passed.append(seen.rejected == 0)
        warm.append(seen.warm)
    table = np.array(said)
    return Answers(
        table[:, :targets],
        table[:, targets:],
        np.array(told),
        np.empty((len(told), 0)),
        np.array(found, dtype=int).reshape(len(found), -1),
        np.array(passed),
        np.array(warm),
    )


def check_same(expected: Answers, said: Answers) -> None:
    """Compare decisions exactly, numbers to 1e-9 of their size."""
    assert (expected.passed == said.passed).all()
    assert (expected.status == said.status).all()
    assert (expected.warm == said.warm).all()
    assert (expected.fault == said.fault).all()
    for one, other in ((expected.correction, said.correction), (expected.slope, said.slope)):
        assert (np.abs(one - other) <= 1e-9 * np.maximum(1.0, np.abs(one))).all()


def check_block(compensator: Compensator, readings: Readings) -> Answers:
    """Run a compensator and its structured text over the same readings; return what they said."""
    tables = gather(compensator)
    machine = Machine(translate(tables, "tc_x", "codesys"))
    expected = replay(compensator, tables, readings)
    check_same(expected, run(machine, readings, len(tables.targets), len(tables.sensors)))
    return expected
