"""The program in LLVM's intermediate representation, for any compensator: its variables are in flat arrays."""

import struct
from collections.abc import Callable, Collection, Iterable, Sequence
from typing import assert_never

from thermocomp.runtime.program import tree as n
from thermocomp.runtime.program.language import find_function, is_known
from thermocomp.runtime.program.memory import ARRAYS, SIZES, find_places
from thermocomp.runtime.program.tree import Expression, Function, Kind, Statement

_TYPES: dict[Kind, str] = {"real": "double", "time": "double", "int": "i64", "bool": "i1"}
_FLOATS = {"+": "fadd", "-": "fsub", "*": "fmul", "/": "fdiv"}
_INTEGERS = {"+": "add", "-": "sub", "*": "mul", "//": "sdiv"}
_COMPARED = {
    "==": ("oeq", "eq"),
    "!=": ("une", "ne"),
    "<": ("olt", "slt"),
    "<=": ("ole", "sle"),
    ">": ("ogt", "sgt"),
    ">=": ("oge", "sge"),
}
#: functions of the C library and of LLVM, with the number of their arguments
_LIBRARY = {"exp": 1, "expm1": 1, "log": 1, "pow": 2, "abs": 1, "floor": 1, "sqrt": 1}
_INTRINSIC = {"abs": "llvm.fabs.f64", "floor": "llvm.floor.f64", "sqrt": "llvm.sqrt.f64"}
_POINTERS = ", ".join(f"ptr noalias {'' if a[0] in 'swr' else 'readonly '}%{a}" for a in ARRAYS)


def write_module(procedures: Sequence[Callable[..., None]]) -> str:
    """Return procedures of the program, and all that they call, as the text of a module."""
    found: dict[str, Function] = {}

    def add(name: str) -> None:
        function = find_function(name)
        for node in n.walk(function.body):
            if isinstance(node, n.Call | n.ProcedureCall) and node.name not in found and is_known(node.name):
                add(node.name)
        found[name] = function

    names = [p.__name__ for p in procedures]
    for name in names:
        if name not in found:
            add(name)
    return write_functions(found.values(), names)


def write_functions(functions: Iterable[Function], public: Collection[str]) -> str:
    """Return functions of the program as the text of a module.

    Each procedure takes pointers to the arrays of `FlatMemory`, in the order of `ARRAYS`.

    Parameters
    ----------
    public : collection of str
        Names of the procedures that are called from Python.
    """
    declared = [
        f"declare double @{_INTRINSIC.get(name, name)}({', '.join(['double'] * count)})"
        for name, count in _LIBRARY.items()
    ]
    return "\n".join([*declared, *(_Writer(f).text(is_public=f.name in public) for f in functions)])


class _Writer:
    """Translator of one function of the program to LLVM's intermediate representation."""

    def __init__(self, function: Function) -> None:
        self._function = function
        self._entry: dict[str, str] = {}  #: values computed at the entry, by their text
        self._lines: list[str] = []
        self._count = 0
        self._label = "begin"

    def text(self, *, is_public: bool) -> str:
        f = self._function
        given = [] if f.is_of_numbers else [_POINTERS]
        given += [f"{_TYPES[kind]} %{name}.in" for name, kind in f.parameters.items()]
        own = [f"  %{name}.own = alloca {_TYPES[kind]}" for name, kind in {**f.parameters, **f.locals}.items()]
        own += [f"  store {_TYPES[kind]} %{name}.in, ptr %{name}.own" for name, kind in f.parameters.items()]
        self._block(f.body)
        if not f.is_of_numbers:
            self._lines.append("  ret void")
        result, linkage = "double" if f.is_of_numbers else "void", "" if is_public else "internal "
        entry = [f"  {name} = {text}" for text, name in self._entry.items()]
        head = f"define {linkage}{result} @{f.name}({', '.join(given)}) {{"
        return "\n".join([head, "entry:", *own, *entry, "  br label %begin", "begin:", *self._lines, "}", ""])

    # -- parts --------------------------------------------------------------------------------------------------------

    def _new(self, text: str) -> str:
        """Add an instruction with a result; return its name."""
        self._count += 1
        self._lines.append(f"  %v{self._count} = {text}")
        return f"%v{self._count}"

    def _once(self, text: str) -> str:
        """Return the result of an instruction that is executed once, at the entry."""
        return self._entry.setdefault(text, f"%e{len(self._entry)}")

    def _begin(self, label: str) -> None:
        self._lines.append(f"{label}:")
        self._label = label

    def _labels(self, *names: str) -> list[str]:
        self._count += 1
        return [f"{name}{self._count}" for name in names]

    def _jump(self, label: str) -> None:
        self._lines.append(f"  br label %{label}")

    def _branch(self, test: Expression, one: str, other: str) -> None:
        self._lines.append(f"  br i1 {self._value(test)}, label %{one}, label %{other}")

    # -- statements ---------------------------------------------------------------------------------------------------

    def _block(self, statements: Sequence[Statement]) -> None:
        for node in statements:
            self._statement(node)

    def _statement(self, node: Statement) -> None:
        match node:
            case n.Assign(target, value):
                self._store(target, self._value(value))
            case n.ProcedureCall(name, arguments):
                given = [f"ptr %{a}" for a in ARRAYS] + [f"{_TYPES[a.kind]} {self._value(a)}" for a in arguments]
                self._lines.append(f"  call void @{name}({', '.join(given)})")
            case n.Return(value):
                self._lines.append(f"  ret double {self._value(value)}")
            case n.If(test, body, other):
                then, otherwise, end = self._labels("then", "else", "end")
                self._branch(test, then, otherwise)
                for label, inner in ((then, body), (otherwise, other)):
                    self._begin(label)
                    self._block(inner)
                    self._jump(end)
                self._begin(end)
            case n.For(index, begin, end, body):
                self._store(index, self._value(begin))
                last = self._value(end)
                again, inside, after = self._labels("for", "body", "end")
                self._jump(again)
                self._begin(again)
                going = self._new(f"icmp slt i64 {self._value(index)}, {last}")
                self._lines.append(f"  br i1 {going}, label %{inside}, label %{after}")
                self._begin(inside)
                self._block(body)
                self._store(index, self._new(f"add i64 {self._value(index)}, 1"))
                self._jump(again)
                self._begin(after)
            case n.While(test, body):
                again, inside, after = self._labels("while", "body", "end")
                self._jump(again)
                self._begin(again)
                self._branch(test, inside, after)
                self._begin(inside)
                self._block(body)
                self._jump(again)
                self._begin(after)
            case _:
                assert_never(node)

    def _store(self, target: n.Name | n.Element, value: str) -> None:
        if isinstance(target, n.Name) and not target.record:
            self._lines.append(f"  store {_TYPES[target.kind]} {value}, ptr %{target.name}.own")
            return
        if target.kind == "bool":
            value = self._new(f"zext i1 {value} to i64")
        kind = "i64" if target.kind == "bool" else _TYPES[target.kind]
        self._lines.append(f"  store {kind} {value}, ptr {self._pointer(target)}")

    def _pointer(self, target: n.Name | n.Element) -> str:
        """Return a pointer to a variable of a record."""
        array = target.of if isinstance(target, n.Element) else target
        held, place = find_places()[array.record, array.name]
        kind = "double" if held[1] == "r" else "i64"
        if isinstance(target, n.Name):
            return self._once(f"getelementptr {kind}, ptr %{held}, i64 {place}")
        index = self._value(target.at[0])
        for dim, k in zip(array.dims[1:], target.at[1:], strict=True):
            index = self._new(f"mul i64 {index}, {self._size(dim)}")
            index = self._new(f"add i64 {index}, {self._value(k)}")
        first = self._once(f"getelementptr i64, ptr %at, i64 {place}")
        base = self._once(f"getelementptr {kind}, ptr %{held}, i64 {self._once(f'load i64, ptr {first}')}")
        return self._new(f"getelementptr {kind}, ptr {base}, i64 {index}")

    def _size(self, name: str) -> str:
        place = self._once(f"getelementptr i64, ptr %sizes, i64 {SIZES[name]}")
        return self._once(f"load i64, ptr {place}")

    # -- expressions --------------------------------------------------------------------------------------------------

    def _value(self, node: Expression) -> str:  # noqa: PLR0911 - one case per node type
        match node:
            case n.Numeral(kind, value):
                return _constant(kind, value)
            case n.Name(kind, name, "t") if name in SIZES:
                size = self._size(name)
                return self._once(f"icmp ne i64 {size}, 0") if kind == "bool" else size
            case n.Name(kind, name, ""):
                return self._new(f"load {_TYPES[kind]}, ptr %{name}.own")
            case n.Name(kind) | n.Element(kind):
                found = self._new(f"load {'i64' if kind == 'bool' else _TYPES[kind]}, ptr {self._pointer(node)}")
                return self._new(f"icmp ne i64 {found}, 0") if kind == "bool" else found
            case n.Not(_, of):
                return self._new(f"xor i1 {self._value(of)}, true")
            case n.Negative(_, of):
                return self._new(f"fneg double {self._value(of)}")
            case n.Real(_, of):
                return self._new(f"sitofp i64 {self._value(of)} to double")
            case n.Operation(_, "and", left, right):
                return self._chosen("i1", left, right, n.Numeral("bool", 0))
            case n.Operation(_, "or", left, right):
                return self._chosen("i1", left, n.Numeral("bool", 1), right)
            case n.Operation():
                return self._operation(node)
            case n.Conditional(kind, test, one, other):
                return self._chosen(_TYPES[kind], test, one, other)
            case n.Call(_, name, arguments):
                given = ", ".join(f"double {self._value(a)}" for a in arguments)
                return self._new(f"call double @{_INTRINSIC.get(name, name)}({given})")

    def _operation(self, node: n.Operation) -> str:
        left, right, kind = self._value(node.left), self._value(node.right), _TYPES[node.left.kind]
        if node.operator in _COMPARED:
            real, whole = _COMPARED[node.operator]
            return self._new(f"{f'fcmp {real}' if kind == 'double' else f'icmp {whole}'} {kind} {left}, {right}")
        return self._new(f"{(_FLOATS if kind == 'double' else _INTEGERS)[node.operator]} {kind} {left}, {right}")

    def _chosen(self, kind: str, test: Expression, one: Expression, other: Expression) -> str:
        """Return a conditional expression: only the selected one of two values is computed."""
        then, otherwise, end = self._labels("one", "other", "chosen")
        self._branch(test, then, otherwise)
        found = []
        for label, node in ((then, one), (otherwise, other)):
            self._begin(label)
            value = self._value(node)
            found.append(f"[ {value}, %{self._label} ]")
            self._jump(end)
        self._begin(end)
        return self._new(f"phi {kind} {', '.join(found)}")


def _constant(kind: Kind, value: float) -> str:
    if kind in ("int", "bool"):
        return str(int(value))
    return f"0x{struct.pack('>d', float(value)).hex().upper()}"
