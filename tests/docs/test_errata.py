"""Every erratum of the papers has a resolution and is cited where it is applied, or affects nothing for a reason."""

import re
import tomllib
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT / "src" / "thermocomp" / "papers" / "errata.toml"
#: errata per paper
COUNTS = {"C": 12, "W": 8, "H": 10, "P": 6, "T": 6}
GROUPS = tomllib.loads(DATA.read_text(encoding="utf-8"))
ENTRIES = {key: entry for group in GROUPS.values() for key, entry in group.items() if key != "title"}
ID = re.compile(r"\bE-[CWHPT]\d+\b")


@cache
def cited() -> dict[str, set[str]]:
    """The files of the code, the tests, and the pages that cite an id, by id."""
    found: dict[str, set[str]] = {}
    files = [f for room in ("src", "tests", "docs") for f in (ROOT / room).rglob("*") if f.suffix in (".py", ".toml")]
    for file in files:
        if file not in (DATA, Path(__file__).resolve()) and "_build" not in file.parts:
            for key in ID.findall(file.read_text(encoding="utf-8")):
                found.setdefault(key, set()).add(str(file.relative_to(ROOT)))
    return found


def test_none_is_missing() -> None:
    assert [*ENTRIES] == [f"E-{paper}{k}" for paper, n in COUNTS.items() for k in range(1, n + 1)]
    assert len(ENTRIES) == 42
    assert [*GROUPS] == [*COUNTS]
    assert all(key.startswith(f"E-{paper}") for paper, group in GROUPS.items() for key in group if key != "title")


@pytest.mark.parametrize("key", ENTRIES)
def test_it_is_cited_where_it_is_resolved(key: str) -> None:
    entry = ENTRIES[key]
    assert {"wrong", "resolution"} <= {*entry} <= {"wrong", "resolution", "cited", "affects", "reason"}
    assert all(entry.values())
    if "affects" in entry:
        assert entry["affects"] == "nothing"
        assert entry["reason"]
        assert "cited" not in entry
        assert key not in cited(), "an erratum that affects nothing is cited nowhere"
    else:
        assert "reason" not in entry
        assert len({*entry["cited"]}) == len(entry["cited"]) > 0
        assert [file for file in entry["cited"] if file not in cited().get(key, ())] == []


def test_what_is_cited_is_there() -> None:
    assert sorted({*cited()} - {*ENTRIES}) == []
