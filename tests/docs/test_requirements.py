"""Every requirement of the papers has a test, a study that prints it, or a reason why not."""

import ast
import re
import tomllib
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
#: requirements per paper
COUNTS = {"C": 36, "W": 13, "H": 18, "P": 7, "T": 10, "X": 3}
GROUPS = tomllib.loads((ROOT / "docs" / "requirements.toml").read_text(encoding="utf-8"))
ENTRIES = {key: entry for group in GROUPS.values() for key, entry in group.items() if key != "title"}


@cache
def functions(file: str) -> frozenset[str]:
    tree = ast.parse((ROOT / "tests" / file).read_text(encoding="utf-8"))
    return frozenset(n.name for n in tree.body if isinstance(n, ast.FunctionDef))


@cache
def cited(study: str) -> str:
    """The sources of a study, in one."""
    found = sorted((ROOT / "src" / "thermocomp" / "papers").glob(f"{study}*.py"))
    found += sorted((ROOT / "src" / "thermocomp" / "papers" / study).glob("*.py"))
    assert found, f"no study {study}"
    return "\n".join(p.read_text(encoding="utf-8") for p in found)


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
        # a claim's ids stand in one text: "C-04 C-05"
        told = re.search(rf'"[^"\n]*\b{key}\b[^"\n]*",', cited(entry["study"]))
        assert told, f"{key}: the study {entry['study']} has no claim of it"
