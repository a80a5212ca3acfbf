"""Every requirement of the papers has a test, a study that prints it, or a reason why not."""

import ast
import tomllib
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
#: requirements per paper
COUNTS = {"C": 38, "W": 15, "H": 19, "P": 7, "T": 10, "X": 3}
GROUPS = tomllib.loads((ROOT / "docs" / "requirements.toml").read_text(encoding="utf-8"))
ENTRIES = {key: entry for group in GROUPS.values() for key, entry in group.items() if key != "title"}


@cache
def functions(file: str) -> frozenset[str]:
    tree = ast.parse((ROOT / "tests" / file).read_text(encoding="utf-8"))
    return frozenset(n.name for n in tree.body if isinstance(n, ast.FunctionDef))


@cache
def claimed(study: str) -> frozenset[str]:
    """The ids of the claims of a study."""
    papers = ROOT / "src" / "thermocomp" / "papers"
    file = papers / "claims.toml" if study == "cross" else papers / study / "claims.toml"
    sections = tomllib.loads(file.read_text(encoding="utf-8"))
    entries = [entry for name, section in sections.items() if name != "parts" for entry in section.values()]
    return frozenset(key for entry in entries for key in entry["ids"].split())


def test_none_is_missing() -> None:
    assert [*ENTRIES] == [f"{paper}-{k:02d}" for paper, n in COUNTS.items() for k in range(1, n + 1)]


@pytest.mark.parametrize("key", ENTRIES)
def test_what_covers_it_is_there(key: str) -> None:
    entry = ENTRIES[key]
    assert {*entry} <= {"what", "tests", "study", "reason"}
    assert entry["what"]
    assert ("reason" in entry) != ("tests" in entry or "study" in entry)
    for test in entry.get("tests", ()):
        file, name = test.split("::")
        assert name.startswith("test_")
        assert name in functions(file), f"{key}: there is no {test}"
    if "study" in entry:
        assert key in claimed(entry["study"]), f"{key}: the study {entry['study']} has no claim of it"
