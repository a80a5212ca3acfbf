"""Pieces of code, and the places in them that may be changed: constants, indices, signs, comparisons, order."""

import ast
import hashlib
import random
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

#: a float that is a tenth larger is another number; tolerances that do not matter have to be argued
LARGER = 1.1
COMPARED: dict[type[ast.cmpop], tuple[str, tuple[str, ...]]] = {
    ast.Lt: ("<", ("<=", ">=")),
    ast.LtE: ("<=", ("<", ">")),
    ast.Gt: (">", (">=", "<=")),
    ast.GtE: (">=", (">", "<")),
    ast.Eq: ("==", ("!=",)),
    ast.NotEq: ("!=", ("==",)),
    ast.In: ("in", ("not in",)),
    ast.NotIn: ("not in", ("in",)),
    ast.Is: ("is", ("is not",)),
    ast.IsNot: ("is not", ("is",)),
}
#: not drawn from: types and decorators; nor texts, messages, and conditions under which nothing but an error is raised
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
    """A change of a piece of code."""

    piece: str
    line: int
    before: str  #: the changed lines
    after: str
    text: str  #: the whole file


def find(tree: ast.AST, name: str) -> ast.AST | None:
    """Return the function, class or constant of a qualified name; None if there is none."""
    node: ast.AST | None = tree
    for part in filter(None, name.split(".")):
        named = [n for n in getattr(node, "body", ()) if part in names(n)]
        node = named[-1] if named else None
    return node


def names(node: ast.stmt) -> list[str]:
    """Return the names that a statement defines."""
    if isinstance(node, Definition):
        return [node.name]
    targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
    return [n.id for t in targets for n in ast.walk(t) if isinstance(n, ast.Name)]


@cache
def parsed(path: Path) -> tuple[bytes, ast.Module | None]:
    """Return a file, and its syntax tree if it is Python."""
    text = path.read_bytes()
    return text, ast.parse(text) if path.suffix == ".py" else None


def span(package: Path, piece: str) -> tuple[Path, bytes, ast.AST | None, int, int]:
    """Return the file of a piece, its text, its node (None in TOML), and the first and the last line of the piece."""
    file, _, name = piece.partition("::")
    text, tree = parsed(package / file)
    node = tree and find(tree, name)
    if tree and node is None:
        raise KeyError(f"there is no {name} in {file}")
    if not isinstance(node, ast.stmt):
        return package / file, text, node, 1, text.count(b"\n") + 1
    first = min([node.lineno, *(d.lineno for d in getattr(node, "decorator_list", ()))])
    return package / file, text, node, first, node.end_lineno or first


def fingerprint(package: Path, piece: str) -> str:
    """Return the hash of a piece without its docstrings, comments in lines of their own, and indentation."""
    _, text, node, first, last = span(package, piece)
    told: set[int] = set()
    for inner in ast.walk(node) if node else ():
        if isinstance(inner, Definition | ast.Module) and ast.get_docstring(inner) is not None:
            told.update(range(inner.body[0].lineno, (inner.body[0].end_lineno or 0) + 1))
    lines = [line.strip() for k, line in enumerate(text.splitlines(), start=1) if first <= k <= last and k not in told]
    return hashlib.sha256(b"\n".join(x for x in lines if x and not x.startswith(b"#"))).hexdigest()[:12]


def sites(text: bytes, node: ast.AST | None, keys: str = "") -> Iterator[Site]:
    """Yield the changes of a piece; of TOML, those of the numbers of some keys, such as ``speed|duration``."""
    begins = [0, *(m.end() for m in re.finditer(b"\n", text))]

    def at(n: ast.AST, *, end: bool = False) -> int:
        line, column = (n.end_lineno, n.end_col_offset) if end else (n.lineno, n.col_offset)  # type: ignore[attr-defined]
        return int(begins[line - 1] + column)

    def between(kind: str, left: ast.AST, right: ast.AST, old: str, new: str) -> Iterator[Site]:
        start, end = at(left, end=True), at(right)
        gap = re.sub(rb"#[^\n]*", lambda m: b" " * len(m[0]), text[start:end])
        if (k := gap.find(old.encode())) >= 0:
            yield Site(kind, start + k, start + k + len(old), new)

    def exchanged(parts: list[ast.expr]) -> Iterator[Site]:
        for a, b in zip(parts, parts[1:], strict=False):
            one, gap, other = text[at(a) : at(a, end=True)], text[at(a, end=True) : at(b)], text[at(b) : at(b, end=True)]
            if one != other and fixed(a) and fixed(b):
                yield Site("exchange", at(a), at(b, end=True), (other + gap + one).decode())

    def changes(n: ast.AST, *, index: bool, table: bool) -> Iterator[Site]:
        match n:
            case ast.Constant(value=bool() | int() | float() as value):
                for new in numbers(value):
                    yield Site("index" if index else "constant", at(n), at(n, end=True), new)
            case (
                ast.comprehension(iter=ast.Constant(value=str() as value) as word)
                | ast.For(iter=ast.Constant(value=str() as value) as word)
                | ast.Assign(value=ast.Constant(value=str() as value) as word)
            ) if len(value) > 1 and value.isupper():  # the letters of axes
                yield Site("constant", at(word), at(word, end=True), repr(value[:-1]))
            case ast.UnaryOp(op=ast.USub()):
                yield Site("sign", at(n), at(n.operand), "")
            case ast.BinOp(left=left, op=ast.Add() | ast.Sub() as op, right=right):
                yield from between("sign", left, right, *("+-" if isinstance(op, ast.Add) else "-+"))
            case ast.AugAssign(target=left, op=ast.Add() | ast.Sub() as op, value=right):
                yield from between("sign", left, right, *("+-" if isinstance(op, ast.Add) else "-+"))
            case ast.Compare(left=left, ops=ops, comparators=others):
                for a, op, b in zip([left, *others], ops, others, strict=False):
                    old, news = COMPARED[type(op)]
                    for new in news:
                        yield from between("comparison", a, b, old, new)
            case (ast.Tuple(elts=parts) | ast.List(elts=parts) | ast.Dict(values=parts)) if table:
                yield from exchanged(parts)

    def walk(n: ast.AST, *, index: bool, table: bool) -> Iterator[Site]:
        yield from changes(n, index=index, table=table)
        refusal = isinstance(n, ast.If) and all(isinstance(inner, ast.Raise) for inner in n.body)
        for field, value in ast.iter_fields(n):
            if field not in SKIPPED and not (refusal and field == "test"):
                for inner in value if isinstance(value, list) else [value]:
                    strict = isinstance(inner, ast.keyword) and inner.arg == "strict"
                    if isinstance(inner, ast.AST) and not (strict or isinstance(inner, ast.JoinedStr | ast.Raise)):
                        deeper = table and not isinstance(inner, ast.FunctionDef)
                        inside = field == "slice" or (index and isinstance(n, ast.Slice | ast.UnaryOp | ast.Tuple))
                        yield from walk(inner, index=inside, table=deeper)

    if node is None:
        for value in re.finditer(rb'(?<!\w)(?:%s) *= *("[^"\n]*"|\[[^]]*\]|[^,}\n]*)' % keys.encode(), text):
            for m in NUMBER.finditer(text, *value.span(1)):
                for new in numbers(float(m[0]) if b"." in m[0] else int(m[0])):
                    yield Site("constant", *m.span(), new)
    else:
        yield from walk(node, index=False, table=not isinstance(node, ast.FunctionDef))


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


def draw(package: Path, pieces: list[str], seed: int, key: str) -> Iterator[Mutant]:
    """Yield all changes of a requirement's code in an order that the seed draws: a kind first, then one of that kind."""
    rng = random.Random(f"{seed} {key}")
    left: dict[str, list[tuple[str, Site]]] = {}
    for piece in pieces:
        _, text, node, *_ = span(package, piece)
        for site in sites(text, node, piece.partition("::")[2]):
            left.setdefault(site.kind, []).append((piece, site))
    while left:
        kind = rng.choice(sorted(left))
        piece, site = left[kind].pop(rng.randrange(len(left[kind])))
        left = {k: v for k, v in left.items() if v}
        yield mutant(package, piece, site)


def mutant(package: Path, piece: str, site: Site) -> Mutant:
    """Apply a change to the text of its file."""
    text = span(package, piece)[1]
    new = text[: site.start] + site.new.encode() + text[site.end :]
    first, last = (text.count(b"\n", 0, k) for k in (site.start, site.end))
    before, after = (
        " ".join(x.strip() for x in t.decode().splitlines()[first : last + 1]) for t in (text, new)
    )
    return Mutant(piece=piece, line=first + 1, before=before, after=after, text=new.decode())
