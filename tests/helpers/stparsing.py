"""Structured text, read by blark: types with their values, blocks with their statements.

blark takes half a millisecond for a character. So a block is parsed in pieces, which are its head and its statements
one by one, and statements that differ in names and numbers alone are parsed once.
"""

import re
from collections.abc import Callable, Set
from functools import cache
from typing import Any, NamedTuple

from blark.parse import parse_source_code

from thermocomp.export.st.structuredtext import SourceUnit

#: by the name of a type
PYTHON = {"LREAL": float, "DINT": int, "BOOL": bool}
#: what may differ in statements that are parsed once: names and numbers
_DIFFERS = re.compile(r"\b[A-Za-z]\w*\b|(?<![\w.])\d+(\.\d+(E[-+]?\d+)?)?")
_WORDS = frozenset("IF THEN ELSIF ELSE END_IF FOR TO DO END_FOR WHILE END_WHILE AND OR NOT MOD TRUE FALSE".split())  # noqa: SIM905


Type = Any  #: 'LREAL', 'DINT', 'BOOL', the name of a structure, or ('ARRAY', Type, size)


class Array(list[Any]):
    """An array that knows its ends."""

    def __getitem__(self, at: Any) -> Any:
        assert 0 <= at < len(self), f"index {at} of {len(self)}"
        return super().__getitem__(at)

    def __setitem__(self, at: Any, value: Any) -> None:
        assert 0 <= at < len(self), f"index {at} of {len(self)}"
        super().__setitem__(at, value)


@cache
def parsed(text: str) -> Any:
    """Parse one block or type."""
    return _parse(text, "iec_source")


@cache
def _parse(text: str, what: str) -> Any:
    found = parse_source_code(text, starting_rule=what)
    assert found.exception is None, found.exception
    return found.transform().items[0]


class Piece(NamedTuple):
    """A statement."""

    tree: Any
    #: what stands there, by what was parsed instead
    written: dict[str, str]
    #: the statements within it, branch by branch
    bodies: list[list["Piece"]]


def pieces(statements: str) -> list[Piece]:
    """Parse the statements of a block one by one, those within another one too."""
    statements = re.sub(r" *\(\*.*?\*\)", "", statements)
    lines = re.findall(r"(?=\S)(?:.|\n)*?(?:;|\bTHEN|\bDO|\bELSE)(?=\n|$)", statements)
    found = _statements(lines)
    assert not lines, lines[-1]
    return found


def _statements(lines: list[str]) -> list[Piece]:
    """Take statements away from the front of lines, up to the end of a branch."""
    found = []
    while lines and not lines[0].startswith(("ELSE", "ELSIF", "END_")):
        text, bodies = lines.pop(0), list[list[Piece]]()
        if word := re.match(r"(IF|FOR|WHILE)\b", text):
            end = f"END_{word[0]};"
            while text[-len(end) :] != end:
                bodies.append(_statements(lines))
                text += f"\n;\n{lines.pop(0)}"
        shape, written = _shape(text)
        found.append(Piece(_parse(shape, "statement_list").statements[0], written, bodies))
    return found


def _shape(text: str) -> tuple[str, dict[str, str]]:
    """Return statements with counted names and numbers in place of their own, and what they stand for."""
    written: dict[str, str] = {}

    def stand_in(m: re.Match[str]) -> str:
        if m[0] in _WORDS:
            return m[0]
        k, exponent = len(written) + 1, re.sub(r"\d+", "1", m[2] or "")
        other = f"{k}{'.5' if m[1] else ''}{exponent}" if m[0][0].isdigit() else f"x{k}"
        written[other] = m[0]
        return other

    return _DIFFERS.sub(stand_in, " ".join(text.split())), written


class Block(NamedTuple):
    """A function or a function block."""

    name: str
    #: of a function; empty: a function block
    gives: str
    #: section, name and type of each variable
    variables: list[tuple[str, str, Type]]
    body: list[Piece]


def block_of(unit: SourceUnit) -> Block:
    """Parse a block: each kind of variable in each section, and its statements."""
    text = re.sub(r"\(\*.*?\*\)", "", unit.declaration, flags=re.DOTALL).strip()
    head, sections = r"(FUNCTION|FUNCTION_BLOCK) (\w+)(?: : (\w+))?", r"((?:VAR\w*\n.*?END_VAR\s*)*)"
    whole = re.fullmatch(rf"{head}\s+{sections}", text, re.DOTALL)
    assert whole, text
    word, name, gives, sections = whole.groups(default="")
    found, head = [], f"{word} x{' : ' + gives if gives else ''}"
    for section, body in re.findall(r"(VAR\w*)\n(.*?)END_VAR", sections, re.DOTALL):
        for line in filter(None, " ".join(body.split()).split(";")):
            one = re.fullmatch(r" ?([\w, ]+) : (.*?)( := .*)?", line.rstrip())
            assert one, line
            names, what, start = one.groups(default="")
            few = re.sub(r"\[(\w+)(, \w+)*\]", r"[\1, \1]", start)
            small = re.sub(r"0\.\.\d+", "0..1", what)
            parsed(f"{head}\n{section}\n    x1{', x2' * (',' in names)} : {small}{few};\nEND_VAR\n{unit.end}\n")
            found += [(section, variable, kind_of(what)) for variable in names.split(", ")]
    _check_names({variable for _, variable, _ in found} | {name})
    return Block(name, gives, found, pieces(unit.statements))


def kind_of(text: str) -> Type:
    """Return a type that is declared."""
    sized = re.fullmatch(r"ARRAY\[0\.\.(\d+)\] OF (\w+)", text.strip())
    return ("ARRAY", sized.group(2), int(sized.group(1)) + 1) if sized else text.strip()


def _check_names(names: Set[str]) -> None:
    """Parse those names of variables that have not been parsed."""
    if new := names - _NAMES:
        _NAMES.update(new)
        parsed(f"FUNCTION x : BOOL\nVAR\n    {', '.join(sorted(new))} : BOOL;\nEND_VAR\nEND_FUNCTION\n")


#: names of variables that have been parsed
_NAMES = set[str]()


@cache
def declared(text: str) -> dict[str, tuple[Type, Any]]:
    """Return types and initial values of a structure; of a long list every kind of number is parsed."""
    text = re.sub(r"\(\*.*?\*\)", "", text, flags=re.DOTALL)
    members: dict[str, tuple[Type, Any]] = {}
    body = re.search(r"STRUCT\n(.*)END_STRUCT", text, re.DOTALL)
    assert body
    for name, what, start in re.findall(r"(\w+) : (.*?)(?: := (.*?))?;", " ".join(body.group(1).split())):
        kind = kind_of(what)
        sized = kind[1] if isinstance(kind, tuple) else ""
        texts = start.strip("[] ").split(", ") if start else []
        kinds = list(dict.fromkeys(re.sub(r"\d+", "1", t) for t in texts))
        shown = f"[{', '.join([*kinds, *kinds[-1:]])}]" if sized else "".join(kinds)
        member = f"x : {f'ARRAY[0..1] OF {sized}' if sized else what}{f' := {shown}' if texts else ''}"
        parsed(f"TYPE x :\nSTRUCT\n    {member};\nEND_STRUCT\nEND_TYPE\n")
        scalar = PYTHON[sized or what]
        numbers = [t == "TRUE" if scalar is bool else _number(t, scalar) for t in texts]
        if sized:
            assert len(texts) in (0, kind[2]), name
            members[name] = (kind, Array(numbers or [scalar()] * kind[2]))
        else:
            members[name] = (kind, numbers[0] if numbers else scalar())
    _check_names(members.keys())
    return members


def _number(text: str, scalar: Callable[[str], Any]) -> Any:
    assert re.fullmatch(r"-?\d+" if scalar is int else r"-?\d+\.\d+(E[-+]?\d+)?", text), text
    return scalar(text)
