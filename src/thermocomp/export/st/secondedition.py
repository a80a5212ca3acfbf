"""Structured text that compilers of the second edition of IEC 61131-3 take: MATIEC (OpenPLC, Beremiz), STruC++."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from thermocomp.export.st.structuredtext import SourceUnit
from thermocomp.export.st.ststatements import wrapped

#: assignments in one function, so that no function is too long for a compiler
_PART = 500

#: a statement, or its part up to the branches in it; a comment
STATEMENT = re.compile(r"\(\*.*?\*\)|(?=\S)(?:.|\n)*?(?:;(?: \(\*.*?\*\))?|\bTHEN|\bDO|\bELSE)(?=\n|$)", re.DOTALL)
#: a loop that runs a constant number of times
LOOP = re.compile(r"FOR (\w+) := (\d+) TO (\d+) DO")
#: an array without a name of its own
ARRAY = re.compile(r"ARRAY\[0\.\.(\d+)\] OF (\w+)")
#: a member of a structure, or a variable, with its initial value
VALUED = re.compile(r"^ +(\w+) :\s+(\w+)\s+:=\s+([^;]*);", re.MULTILINE)

#: a comment beside initial values
_COMMENT = re.compile(r"\(\*.*?\*\)")


def adapt(units: Sequence[SourceUnit], name: str) -> list[SourceUnit]:
    """Return units with the same behaviour, without what the compilers of the second edition refuse or ignore.

    Arrays have named types; members of structures get their values in functions that each function block calls once;
    results of functions are assigned; no loop runs only once. See `thermocomp.export.st.rules`.

    Parameters
    ----------
    units : sequence of SourceUnit
        In the dialect of CODESYS, each after those that it uses.
    name : str
        Of the compensator: the names of the array types begin with it.
    """
    arrays: dict[str, str] = {}

    def named(m: re.Match[str]) -> str:
        own = f"{name}_{m[2].lower()}_{int(m[1]) + 1}"
        arrays[own] = m[0]
        return own

    found, fills = list[SourceUnit](), dict[str, list[str]]()
    for unit in units:
        text = ARRAY.sub(named, unit.declaration)
        if not unit.end:
            bare, *more = _structure(unit.name, text)
            fills[unit.name] = [f.name for f in more]
            found += [bare, *more]
        else:
            found.append(_block(replace(unit, declaration=text), fills))
    types = [SourceUnit(own, f"TYPE {own} : {what}; END_TYPE") for own, what in arrays.items()]
    return [*types, *found]


def _structure(name: str, text: str) -> list[SourceUnit]:
    """Return a structure without initial values, and the functions that assign them; zeros are the default."""
    lines = list[str]()
    for member, _, start in VALUED.findall(text):
        k = 0
        for line in start.splitlines():
            lines += _COMMENT.findall(line)
            for v in filter(None, re.split(r"[,\s\[\]]+", _COMMENT.sub("", line))):
                if v not in ("0", "0.0", "FALSE"):
                    lines.append(f"t.{member}{f'[{k}]' if start.startswith('[') else ''} := {v};")
                k += 1
    bare = VALUED.sub(r"    \1 : \2;", text).replace("END_STRUCT\n", "END_STRUCT;\n")
    found = [SourceUnit(name, bare)]
    for k in range(0, len(lines), _PART):
        own = f"{name}_fill_{k // _PART + 1}"
        head = f"FUNCTION {own} : BOOL\n(* Assign initial values. *)\nVAR_IN_OUT\n    t : {name};\nEND_VAR"
        body = "\n".join([*lines[k : k + _PART], f"{own} := TRUE;"])
        found.append(SourceUnit(own, head, body, "END_FUNCTION"))
    return found


def _block(unit: SourceUnit, fills: Mapping[str, Sequence[str]]) -> SourceUnit:
    """Return a function or a function block with statements of the second edition."""
    own = dict[str, str]()
    text = "\n".join(_statements(unit.statements))
    if re.search(r"^ *called := ", text, re.MULTILINE):
        own["called"] = "BOOL"
    if unit.end == "END_FUNCTION" and not re.search(rf"^ *{unit.name} := ", text, re.MULTILINE):
        text += f"\n{unit.name} := TRUE;"
    if unit.end == "END_FUNCTION_BLOCK":
        variables = re.findall(r"^ +(\w+) : (\w+);", unit.declaration, re.MULTILINE)
        calls = [f"    called := {f}(t := {v});" for v, kind in variables for f in fills.get(kind, ())]
        if calls:
            own |= {"called": "BOOL", "filled": "BOOL"}
            text = "\n".join(["IF NOT filled THEN", *calls, "    filled := TRUE;", "END_IF;", text])
    return replace(unit, declaration=_declare(unit.declaration, own), statements=text)


def _declare(text: str, variables: Mapping[str, str]) -> str:
    """Add variables to a declaration."""
    lines = "".join(f"    {name} : {kind};\n" for name, kind in variables.items())
    if not lines:
        return text
    if re.search(r"^VAR$", text, re.MULTILINE):
        return re.sub(r"^VAR\n", f"VAR\n{lines}", text, count=1, flags=re.MULTILINE)
    return f"{text}\nVAR\n{lines}END_VAR"


def _statements(text: str) -> Iterator[str]:
    """Yield the lines of statements: results of functions assigned, loops of one pass as their body."""
    depth, loops = 0, list[bool]()
    for raw in STATEMENT.findall(text):
        statement = " ".join(raw.split())
        if loop := LOOP.fullmatch(statement):
            loops.append(loop[2] == loop[3])
            if loops[-1]:
                statement = f"{loop[1]} := {loop[2]};"
        elif statement.startswith("FOR "):
            loops.append(False)
        elif statement == "END_FOR;" and loops.pop():
            continue
        statement = re.sub(r"^(\w+_\w+)\(", r"called := \1(", statement)
        depth -= statement.startswith(("END_", "ELSE", "ELSIF"))
        yield wrapped("    " * depth + statement)
        depth += statement.endswith((" THEN", " DO")) or statement == "ELSE"
