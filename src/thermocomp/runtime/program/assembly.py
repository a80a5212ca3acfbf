"""The functions that a compensator needs, without branches that it does not use."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from thermocomp.runtime.program import powering, steps
from thermocomp.runtime.program.language import find_function, is_known
from thermocomp.runtime.program.tables import Tables
from thermocomp.runtime.program.tree import Call, For, Function, If, Kind, Name, ProcedureCall, Statement, While, walk


def functions(tables: Tables, own: Mapping[str, str] = MappingProxyType({})) -> list[Function]:
    """Return the functions that a compensator needs, callees before callers; `step` is the last.

    Called from outside are ``power_up``, ``rezero`` and ``step``.

    Parameters
    ----------
    own : mapping of str to str
        Functions of the program that replace library functions, by the names of the latter.
    """
    found: dict[str, Function] = {}

    def add(name: str) -> None:
        function = tables.formulas.get(name) or find_function(own.get(name, name))
        body = _decided(function.body, tables.sizes)
        for node in walk(body):
            if (
                isinstance(node, Call | ProcedureCall)
                and node.name not in found
                and (is_known(node.name) or node.name in own)
            ):
                add(node.name)
        found[name] = replace(function, name=name, body=body)

    for called in (powering.power_up, powering.rezero, steps.step):
        add(called.__name__)
    return list(found.values())


def grouped_locals(function: Function, types: Mapping[Kind, str]) -> dict[str, list[str]]:
    """Return the names of the local variables that the statements of a function use, by their type."""
    names = dict.fromkeys(node.name for node in walk(function.body) if isinstance(node, Name) and not node.record)
    found: dict[str, list[str]] = {}
    for name in names:
        if name in function.locals:
            found.setdefault(types[function.locals[name]], []).append(name)
    return found


def _decided(body: list[Statement], sizes: Mapping[str, int]) -> list[Statement]:
    """Return statements without branches and loops that a compensator does not use."""
    found: list[Statement] = []
    for node in body:
        match node:
            case If(Name(record="t", name=name), chosen, other) if name in sizes:
                found += _decided(chosen if sizes[name] else other, sizes)
            case If(test, chosen, other):
                found.append(If(test, _decided(chosen, sizes), _decided(other, sizes)))
            case For(_, _, Name(record="t", name=name)) if sizes.get(name) == 0:
                pass
            case For(index, begin, end, inner):
                found.append(For(index, begin, end, _decided(inner, sizes)))
            case While(test, inner):
                found.append(While(test, _decided(inner, sizes)))
            case _:
                found.append(node)
    return found
