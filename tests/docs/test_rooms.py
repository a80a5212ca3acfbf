"""Rooms know each other as little as the decision on them says."""

import ast
from collections import Counter
from pathlib import Path

import thermocomp

PACKAGE = Path(thermocomp.__file__).parent
MAIN = {"core", "files", "recordings", "runtime", "models", "judging", "report", "api", "cli"}
#: without the studies of the papers, which show all of them
SATELLITES = {"live", "nc", "export", "volumetric", "iso230", "virtual"}


def arrows() -> Counter[tuple[str, str]]:
    """Return how many imports lead from a room to another."""
    found: Counter[tuple[str, str]] = Counter()
    for path in PACKAGE.rglob("*/*.py"):
        room = path.relative_to(PACKAGE).parts[0]
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("thermocomp."):
                other = (node.module or "").split(".")[1]
                found[room, other] += other != room
    return +found


def test_each_room_is_a_main_room_or_a_satellite() -> None:
    found = {p.parent.name for p in PACKAGE.glob("*/__init__.py")}
    assert found == MAIN | SATELLITES | {"app", "papers"}


def test_arrows_are_few() -> None:
    found = arrows()
    assert not [a for a in found if a[0] in MAIN and a[1] not in MAIN]
    assert len([a for a in found if set(a) <= MAIN]) <= 22
    assert {a for a in found if set(a) <= SATELLITES} == {("live", "nc"), ("live", "virtual"), ("iso230", "volumetric")}
    known = Counter(a for a, b in found if a in SATELLITES and b in MAIN)
    assert {room for room, n in known.items() if n > 6} == {"volumetric", "export"}  # none is wanted


def test_no_class_has_its_name_in_two_rooms() -> None:
    rooms: dict[str, set[str]] = {}
    for path in PACKAGE.rglob("*.py"):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                rooms.setdefault(node.name, set()).add(path.relative_to(PACKAGE).parts[0])
    assert {name: where for name, where in rooms.items() if len(where) > 1} == {}


def test_functions_are_short() -> None:
    kernels = {"drop", "add", "train"}  # compiled: a call that passes their twenty arrays would be longer than the loop
    long: set[str] = set()
    for path in [*PACKAGE.rglob("*.py"), *(PACKAGE.parents[1] / "tools").rglob("*.py")]:
        lines = path.read_text(encoding="utf-8").splitlines()
        code = [bool(line.strip()) and not line.strip().startswith("#") for line in lines]
        for node in ast.walk(ast.parse("\n".join(lines))):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                first = (node.body[0].end_lineno or 0) if ast.get_docstring(node) else node.lineno - 1
                n = sum(code[first : node.end_lineno]) + (first >= node.lineno)  # with the signature
                long |= {node.name} if n >= 60 else set()
    assert long == kernels
