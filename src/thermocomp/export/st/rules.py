"""Rules of IEC 61131-3, second edition, and of its free compilers, that structured text is checked for."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence

from thermocomp.export.st.secondedition import ARRAY, LOOP, STATEMENT, VALUED
from thermocomp.export.st.structuredtext import SourceUnit
from thermocomp.export.st.ststatements import RESERVED

_COMMENT = re.compile(r"\(\*.*?\*\)", re.DOTALL)

Found = Iterator[str]


def find_violations(units: Sequence[SourceUnit]) -> list[str]:
    """Return a line per violation of a rule: unit, rule with its clause or compiler, and the text found."""
    functions = {u.name for u in units if u.end == "END_FUNCTION"}
    return [
        f"{unit.name}: {rule}: {text}"
        for unit in units
        for rule, find in _RULES.items()
        for text in find(unit, _statements(unit), functions)
    ]


def _statements(unit: SourceUnit) -> list[str]:
    return [" ".join(s.split()) for s in STATEMENT.findall(unit.statements) if not s.startswith("(*")]


def _structures(unit: SourceUnit, _: Sequence[str], __: set[str]) -> Found:
    yield from re.findall(r"END_STRUCT(?!;)", unit.declaration)


def _initial(unit: SourceUnit, _: Sequence[str], __: set[str]) -> Found:
    yield from (f"{name} := {start[:20]}" for name, _, start in VALUED.findall(unit.declaration) if not unit.end)
    if not unit.end:
        yield from (name for name in re.findall(r"(\w+) : ARRAY\[[^;]*:=", unit.declaration))


def _calls(_: SourceUnit, statements: Sequence[str], functions: set[str]) -> Found:
    yield from (s[:40] for s in statements if s.partition("(")[0] in functions)


def _results(unit: SourceUnit, statements: Sequence[str], _: set[str]) -> Found:
    if unit.end == "END_FUNCTION" and not any(s.startswith(f"{unit.name} := ") for s in statements):
        yield unit.name


def _arrays(unit: SourceUnit, _: Sequence[str], __: set[str]) -> Found:
    yield from (m[0] for m in ARRAY.finditer(unit.declaration) if unit.end or "STRUCT" in unit.declaration)


def _loops(_: SourceUnit, statements: Sequence[str], __: set[str]) -> Found:
    yield from (s for s in statements if (loop := LOOP.fullmatch(s)) and loop[2] == loop[3])


def _names(unit: SourceUnit) -> list[str]:
    found = re.findall(r"^ +([\w, ]+) :", _COMMENT.sub("", unit.declaration), re.MULTILINE)
    return [name for names in found for name in names.split(", ")]


def _reserved(unit: SourceUnit, _: Sequence[str], __: set[str]) -> Found:
    yield from (name for name in _names(unit) if name.lower() in RESERVED)


def _underscores(unit: SourceUnit, _: Sequence[str], __: set[str]) -> Found:
    yield from (name for name in [unit.name, *_names(unit)] if "__" in name or name.endswith("_"))


def _comments(unit: SourceUnit, _: Sequence[str], __: set[str]) -> Found:
    yield from (c for c in _COMMENT.findall(unit.declaration + unit.statements) if "(*" in c[2:])


_RULES: Mapping[str, Callable[[SourceUnit, Sequence[str], set[str]], Found]] = {
    "a structure ends in a semicolon (B.1.3.3, MATIEC)": _structures,
    "members of structures have no initial value (STruC++ ignores it)": _initial,
    "a call of a function is no statement (3.3.2, MATIEC)": _calls,
    "the result of a function is assigned (2.5.1)": _results,
    "an array passed between blocks has a named type (2.3.3, MATIEC)": _arrays,
    "no loop of one pass (MATIEC)": _loops,
    "a name is no reserved word (Annex C)": _reserved,
    "a name has single underscores, none at its end (2.1.2)": _underscores,
    "comments are not nested (2.1.5)": _comments,
}
