"""A typed language within Python for programs of scalars and loops, which are recorded as a tree.

A function of a program runs once, with symbols instead of numbers: assignments to variables, ``with when(...)``,
``for k in each(...)`` and calls of other functions of the program are recorded (`thermocomp.runtime.program.tree`). A
type checker sees numbers, integers, conditions and arrays; errors that it cannot detect are rejected while recording.
"""

import inspect
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import ParamSpec, TypeVar

from thermocomp.runtime.program import tree as n
from thermocomp.runtime.program.declarations import Record
from thermocomp.runtime.program.trace import TRACE, Trace, add
from thermocomp.runtime.program.tree import Kind
from thermocomp.runtime.program.values import Condition, Number, Symbol, Whole, common_kind, integer, real

P = ParamSpec("P")
V = TypeVar("V", Number, Whole, Condition)


# -- statements -------------------------------------------------------------------------------------------------------


def let(name: str, value: V) -> V:
    """Declare a local variable with its first value."""
    recording = TRACE.get()
    kind = value.node.kind
    if recording.locals.setdefault(name, kind) != kind:
        raise TypeError(f"local variable {name} is declared with two types, {recording.locals[name]} and {kind}")
    variable = type(value)(n.Name(kind, name))
    variable._assign(value.node)
    return variable


@contextmanager
def _block(body: list[n.Statement]) -> Iterator[None]:
    blocks = TRACE.get().blocks
    blocks.append(body)
    yield
    blocks.pop()


@contextmanager
def when(test: Condition) -> Iterator[None]:
    """Record the statements of the ``with`` block for the case that a condition holds."""
    branch = n.If(test.node, [])
    add(branch)
    with _block(branch.body):
        yield


def _last_branch() -> n.If:
    """Return the last branch of the ``if`` chain that ends the current block of statements."""
    last = TRACE.get().blocks[-1][-1]
    while isinstance(last, n.If) and last.other:
        last = last.other[0]
    if not isinstance(last, n.If):
        raise TypeError("`otherwise` must directly follow a `when` block")
    return last


@contextmanager
def otherwise() -> Iterator[None]:
    """Record the statements of the ``with`` block for all other cases."""
    with _block(_last_branch().other):
        yield


@contextmanager
def otherwise_when(test: Condition) -> Iterator[None]:
    """Record the statements of the ``with`` block for the other cases in which a condition holds."""
    branch = n.If(test.node, [])
    _last_branch().other.append(branch)
    with _block(branch.body):
        yield


def each(name: str, begin: Whole | int, end: Whole | int | None = None) -> Iterator[Whole]:
    """Record the body of a ``for`` statement as a loop over integers from `begin` (or 0), `end` excluded."""
    first, last = (integer(0), integer(begin)) if end is None else (integer(begin), integer(end))
    TRACE.get().locals.setdefault(name, "int")
    loop = n.For(n.Name("int", name), first.node, last.node, [])
    add(loop)
    with _block(loop.body):
        yield Whole(loop.index)


@contextmanager
def repeat_while(test: Condition) -> Iterator[None]:
    """Record the statements of the ``with`` block as a loop with a condition."""
    loop = n.While(test.node, [])
    add(loop)
    with _block(loop.body):
        yield


# -- expressions ------------------------------------------------------------------------------------------------------


def choose(test: Condition, one: Number | float, other: Number | float) -> Number:
    """Return a conditional expression: one number if a condition holds, else another."""
    pair = real(one), real(other)
    return Number(n.Conditional(common_kind(*pair), test.node, pair[0].node, pair[1].node))


def call(name: str, *arguments: Number) -> Number:
    """Return the result of a library function, in the precision of real numbers."""
    return Number(n.Call("real", name, tuple(a.node for a in arguments)))


def exp(x: Number) -> Number:
    """Return e to the power of a number."""
    return call("exp", x)


def expm1(x: Number) -> Number:
    """Return exp(x) - 1, accurate for small x."""
    return call("expm1", x)


def floor(x: Number) -> Number:
    """Return the largest integer up to a number that is not negative, as a real number."""
    return call("floor", x)


def log(x: Number) -> Number:
    """Return the natural logarithm."""
    return call("log", x)


def sqrt(x: Number) -> Number:
    """Return the square root."""
    return call("sqrt", x)


def raised(base: Number, exponent: Number) -> Number:
    """Return a power of a number that is not negative."""
    return call("pow", base, exponent)


# -- functions --------------------------------------------------------------------------------------------------------

#: functions of the program by name
_KNOWN: dict[str, Callable[..., object]] = {}


def _nodes(args: Iterable[object]) -> tuple[n.Expression, ...]:
    """Return the expressions of a call's arguments, without the records of variables."""
    return tuple(a.node for a in args if isinstance(a, Symbol))


def procedure(function: Callable[P, None]) -> Callable[P, None]:
    """Make a function a procedure of the program: a call of it is recorded."""
    name = function.__name__
    _KNOWN[name] = function

    def record(*args: P.args, **_: P.kwargs) -> None:
        add(n.ProcedureCall(name, _nodes(args)))

    record.__name__ = name
    return record


def function(function: Callable[P, Number]) -> Callable[P, Number]:
    """Make a function a function of numbers of the program: a call of it is an expression."""
    name = function.__name__
    _KNOWN[name] = function

    def record(*args: P.args, **_: P.kwargs) -> Number:
        return Number(n.Call("real", name, _nodes(args)))

    record.__name__ = name
    return record


@contextmanager
def record(name: str) -> Iterator[n.Function]:
    """Record the statements of the ``with`` block as a function that takes the place of a procedure of the program."""
    instead = find_function(name)
    recording = Trace()
    token = TRACE.set(recording)
    try:
        yield n.Function(
            name=name,
            about=instead.about,
            parameters=instead.parameters,
            body=recording.blocks[0],
            locals=recording.locals,
        )
    finally:
        TRACE.reset(token)


@cache
def find_function(name: str) -> n.Function:
    """Return the recorded tree of a function of the program."""
    written = _KNOWN[name]
    given: list[object] = []
    parameters: dict[str, Kind] = {}
    for p in inspect.signature(written).parameters.values():
        if issubclass(p.annotation, Record):
            given.append(p.annotation())
            continue
        kind: Kind = "real" if p.annotation is Number else "int" if p.annotation is Whole else "bool"
        parameters[p.name] = kind
        given.append(p.annotation(n.Name(kind, p.name)))
    recording = Trace()
    token = TRACE.set(recording)
    try:
        said = written(*given)
    finally:
        TRACE.reset(token)
    body = recording.blocks[0]
    if isinstance(said, Number):
        body.append(n.Return(said.node))
    return n.Function(
        name=name,
        about=(inspect.getdoc(written) or "").splitlines()[0],
        parameters=parameters,
        body=body,
        locals=recording.locals,
        is_of_numbers=isinstance(said, Number),
    )


def is_known(name: str) -> bool:
    """Return whether the program has a function of this name."""
    return name in _KNOWN
