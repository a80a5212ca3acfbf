"""A record of more than four fields is built by names: a field that is inserted shifts no meaning."""

import ast
from collections.abc import Iterator
from pathlib import Path

import thermocomp

PACKAGE = Path(thermocomp.__file__).parent
TREES = {
    "thermocomp." + ".".join(path.relative_to(PACKAGE).with_suffix("").parts): ast.parse(path.read_text("utf-8"))
    for path in PACKAGE.rglob("*.py")
}
CLASSES = {
    f"{module}.{node.name}": (module, node)
    for module, tree in TREES.items()
    for node in tree.body
    if isinstance(node, ast.ClassDef)
}


def names(module: str) -> dict[str, str]:
    """Return what names of a module stand for, by their full name."""
    found: dict[str, str] = {}
    for node in ast.walk(TREES[module]):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("thermocomp"):
            found |= {alias.asname or alias.name: f"{node.module}.{alias.name}" for alias in node.names}
    return found | {q.rpartition(".")[2]: q for q, (home, _) in CLASSES.items() if home == module}


def resolve(known: dict[str, str], node: ast.expr) -> str:
    """Return the full name of a class that is called."""
    if isinstance(node, ast.Name):
        return known.get(node.id, "")
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
        return f"{known.get(node.value.id, '')}.{node.attr}"
    return ""


def fields(name: str) -> int:
    """Return how many fields a record has; 0 if it is none."""
    module, node = CLASSES[name]
    bases = [ast.unparse(base) for base in node.bases]
    record = "NamedTuple" in bases or any("dataclass" in ast.unparse(d) for d in node.decorator_list)
    own = [x for x in node.body if isinstance(x, ast.AnnAssign) and "ClassVar" not in ast.unparse(x.annotation)]
    above = [q for base in node.bases if (q := resolve(names(module), base)) in CLASSES]
    return len(own) + sum(map(fields, above)) if record else 0


def built_by_position(module: str, tree: ast.Module) -> Iterator[str]:
    known = names(module)
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call) or (name := resolve(known, node.func)) not in CLASSES or fields(name) <= 4:
            continue
        if len(node.args) > 4 or any(isinstance(a, ast.Starred) for a in node.args):
            yield f"{module}:{node.lineno} {name.rpartition('.')[2]}"


def test_no_record_of_more_than_four_fields_is_built_by_position() -> None:
    assert [found for module, tree in TREES.items() for found in built_by_position(module, tree)] == []


def test_the_check_finds_one() -> None:
    module = "thermocomp.runtime.state"
    tree = ast.parse(
        "def f(x):\n    return CompensatorState(*x), Status('active', ''), Compensated({}, '', (), {}, {})\n"
    )
    assert len(list(built_by_position(module, tree))) == 2
