"""Pieces of code, and the places in them that may be changed: constants, indices, signs, comparisons, order."""

import ast
import hashlib
import random
import re
from collections.abc import Iterator
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

#: operators, and what takes their place
OPERATORS = {"<": ("<=", ">="), "<=": ("<", ">"), ">": (">=", "<="), ">=": (">", "<"), "==": ("!=",), "!=": ("==",)}
OPERATORS |= {"+": ("-",), "-": ("+",), "in": ("not in",), "not in": ("in",), "is": ("is not",), "is not": ("is",)}
OPERATOR = re.compile(rb"not in|is not|[<>=!]=|[<>+-]|\bin\b|\bis\b")
#: a floating-point number becomes larger by a tenth
LARGER = 1.1
#: not drawn from: types, decorators, texts, messages, and the conditions under which nothing but an error is raised
SKIPPED = {"annotation", "returns", "decorator_list", "type_params"}
#: in a value of TOML, also in a text such as "6 min"
NUMBER = re.compile(rb"(?<![\w.-])\d+(?:\.\d+)?(?![\w.:-])")
Definition = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef


class Site(NamedTuple):
    """A change: bytes of a file, and what takes their place."""

    kind: str
    start: int
    end: int
    new: str


class Mutant(NamedTuple):
    """A change of a piece of code: its first line, the changed lines, and the text of the file with it."""

    piece: str
    line: int
    before: str
    after: str
    text: str


class Piece(NamedTuple):
    """A function, class or constant, such as ``core/terms.py::TermTable``; a module; or keys of a TOML file."""

    text: bytes  #: of the whole file
    node: ast.AST | None  #: None in TOML
    lines: range


def names(node: ast.stmt) -> list[str]:
    """Return the names that a statement defines."""
    if isinstance(node, Definition):
        return [node.name]
    targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
    return [n.id for t in targets for n in ast.walk(t) if isinstance(n, ast.Name)]


@cache
def find(package: Path, piece: str) -> Piece:
    """Return a piece of the package; KeyError if there is none of this name."""
    file, _, name = piece.partition("::")
    text = (package / file).read_bytes()
    everything = range(1, text.count(b"\n") + 2)
    if not file.endswith(".py"):
        return Piece(text, None, everything)
    node: ast.Module | ast.stmt = ast.parse(text)
    for part in filter(None, name.split(".")):
        named = [n for n in getattr(node, "body", ()) if part in names(n)]
        if not named:
            raise KeyError(f"there is no {name} in {file}")
        node = named[-1]
    if isinstance(node, ast.Module):
        return Piece(text, node, everything)
    first = min([node.lineno, *(d.lineno for d in getattr(node, "decorator_list", ()))])
    return Piece(text, node, range(first, (node.end_lineno or first) + 1))


def fingerprint(package: Path, piece: str) -> str:
    """Return the hash of a piece without its docstrings, comments in lines of their own, and indentation."""
    text, node, wanted = find(package, piece)
    told: set[int] = set()
    for inner in ast.walk(node) if node else ():
        if isinstance(inner, Definition | ast.Module) and ast.get_docstring(inner) is not None:
            told.update(range(inner.body[0].lineno, (inner.body[0].end_lineno or 0) + 1))
    lines = [line.strip() for k, line in enumerate(text.splitlines(), start=1) if k in wanted and k not in told]
    return hashlib.sha256(b"\n".join(x for x in lines if x and not x.startswith(b"#"))).hexdigest()[:12]


def numbers(value: float) -> list[str]:
    """Return what takes the place of a number, or of True or False."""
    if isinstance(value, bool):
        return [str(not value)]
    if isinstance(value, int):
        return [str(value + 1), str(value - 1)] if value else ["1"]
    new = f"{value * LARGER or 1.0:.12g}"
    return [new if re.search("[.en]", new) else f"{new}.0"]


def fixed(node: ast.expr) -> bool:
    """Return whether an expression is made of literals alone."""
    try:
        ast.literal_eval(node)
    except ValueError:
        return False
    return True


class Sites:
    """The places of a text that may be changed."""

    def __init__(self, text: bytes) -> None:
        self._text = text
        self._begins = [0, *(m.end() for m in re.finditer(b"\n", text))]

    def _span(self, n: ast.expr) -> tuple[int, int]:
        end = self._begins[(n.end_lineno or 0) - 1] + (n.end_col_offset or 0)
        return self._begins[n.lineno - 1] + n.col_offset, end

    def in_toml(self, keys: str) -> Iterator[Site]:
        """Yield the numbers in the values of some keys, such as ``speed|duration``."""
        for value in re.finditer(rb'(?<!\w)(?:%s) *= *("[^"\n]*"|\[[^]]*\]|[^,}\n]*)' % keys.encode(), self._text):
            for m in NUMBER.finditer(self._text, *value.span(1)):
                for new in numbers(float(m[0]) if b"." in m[0] else int(m[0])):
                    yield Site("constant", *m.span(), new)

    def inside(self, n: ast.AST, *, index: bool = False, table: bool = True) -> Iterator[Site]:
        """Yield the places in a node; `index`: it is a subscript; `table`: it is not part of a function."""
        table = table and not isinstance(n, ast.FunctionDef)
        yield from self._at(n, index=index, table=table)
        refusal = isinstance(n, ast.If) and all(isinstance(inner, ast.Raise) for inner in n.body)
        for field, value in ast.iter_fields(n):
            below = field == "slice" or (index and isinstance(n, ast.Slice | ast.UnaryOp | ast.Tuple))
            for inner in value if isinstance(value, list) else [value]:
                strict = isinstance(inner, ast.keyword) and inner.arg == "strict"
                passed = field in SKIPPED or strict or (refusal and field == "test")
                if isinstance(inner, ast.AST) and not (
                    passed or isinstance(inner, ast.JoinedStr | ast.Raise | ast.Assert)
                ):
                    yield from self.inside(inner, index=below, table=table)

    def _at(self, n: ast.AST, *, index: bool, table: bool) -> Iterator[Site]:
        match n:
            case ast.Constant(value=bool() | int() | float() as value):
                yield from (Site("index" if index else "constant", *self._span(n), new) for new in numbers(value))
            case (
                ast.comprehension(iter=ast.Constant(value=str() as letters) as word)
                | ast.For(iter=ast.Constant(value=str() as letters) as word)
                | ast.Assign(value=ast.Constant(value=str() as letters) as word)
            ) if len(letters) > 1 and letters.isupper():  # of axes
                yield Site("constant", *self._span(word), repr(letters[:-1]))
            case ast.UnaryOp(op=ast.USub()):
                yield Site("sign", self._span(n)[0], self._span(n.operand)[0], "")
            case (
                ast.BinOp(left=left, op=ast.Add() | ast.Sub(), right=right)
                | ast.AugAssign(target=left, op=ast.Add() | ast.Sub(), value=right)
            ):
                yield from self._operator("sign", left, right)
            case ast.Compare(left=left, comparators=others):
                for pair in pairwise([left, *others]):
                    yield from self._operator("comparison", *pair)
            case ast.Tuple(elts=parts) | ast.List(elts=parts) | ast.Dict(values=parts) if table:
                for a, b in pairwise(parts):
                    (start, k), (m, end), text = self._span(a), self._span(b), self._text
                    if text[start:k] != text[m:end] and fixed(a) and fixed(b):
                        yield Site("exchange", start, end, (text[m:end] + text[k:m] + text[start:k]).decode())

    def _operator(self, kind: str, left: ast.expr, right: ast.expr) -> Iterator[Site]:
        start, end = self._span(left)[1], self._span(right)[0]
        gap = re.sub(rb"#[^\n]*", lambda m: b" " * len(m[0]), self._text[start:end])
        if m := OPERATOR.search(gap):
            for new in OPERATORS[m[0].decode()]:
                yield Site(kind, start + m.start(), start + m.end(), new)


def draw(package: Path, pieces: list[str], seed: int, key: str) -> Iterator[Mutant]:
    """Yield all changes of a requirement's code in the order of a seed: a kind is drawn first, then one of it."""
    rng = random.Random(f"{seed} {key}")
    left: dict[str, list[tuple[str, Site]]] = {}
    for piece in pieces:
        text, node, _ = find(package, piece)
        all_sites = Sites(text)
        for site in all_sites.inside(node) if node else all_sites.in_toml(piece.partition("::")[2]):
            left.setdefault(site.kind, []).append((piece, site))
    while left:
        kind = rng.choice(sorted(left))
        piece, site = left[kind].pop(rng.randrange(len(left[kind])))
        left = {k: v for k, v in left.items() if v}
        yield mutant(package, piece, site)


def mutant(package: Path, piece: str, site: Site) -> Mutant:
    """Apply a change to the text of its file."""
    text = find(package, piece).text
    new = text[: site.start] + site.new.encode() + text[site.end :]
    first, last = (text.count(b"\n", 0, k) for k in (site.start, site.end))
    before, after = (" ".join(x.strip() for x in t.decode().splitlines()[first : last + 1]) for t in (text, new))
    return Mutant(piece=piece, line=first + 1, before=before, after=after, text=new.decode())
