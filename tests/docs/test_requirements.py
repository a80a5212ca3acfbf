"""Every requirement of the papers has a test, a study that prints it, or a reason why not."""

import ast
import importlib
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from mutants.draw import draw

ROOT = Path(__file__).resolve().parents[2]
paper_tables: Any = importlib.import_module("paper_tables")
#: requirements per paper
COUNTS = {"C": 38, "W": 15, "H": 19, "P": 7, "T": 10, "X": 3}
GROUPS = tomllib.loads((ROOT / "docs" / "requirements.toml").read_text(encoding="utf-8"))
CODE = tomllib.loads((ROOT / "docs" / "requirements_code.toml").read_text(encoding="utf-8"))
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
    assert {*entry} <= {"what", "decides", "tests", "study", "reason"}
    assert entry["what"]
    assert ("reason" in entry) != ("tests" in entry or "study" in entry)
    for test in entry.get("tests", ()):
        file, name = test.split("::")
        assert name.startswith("test_")
        assert name in functions(file), f"{key}: there is no {test}"
    if "study" in entry:
        assert key in claimed(entry["study"]), f"{key}: the study {entry['study']} has no claim of it"


@pytest.mark.parametrize("key", ENTRIES)
def test_what_would_decide_it_is_told(key: str) -> None:
    """If a claim does not hold in full in every run, the table of the documentation tells what would decide it."""
    verdicts = paper_tables.verdicts().get(key, {})
    assert ("decides" in ENTRIES[key]) == bool({*verdicts} - {"yes"})


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ("H-17", "yes (1)"),
        ("C-11", "no (1); would be decided by the rule by which Chen screened, or all his temperatures"),
        ("T-02", "no claim: built, and decided by its tests"),
    ],
)
def test_the_table_has_code_tests_mutants_and_verdict(key: str, said: str) -> None:
    what, code, covered, verdict = paper_tables.requirement(key, ENTRIES[key])
    assert what == ENTRIES[key]["what"]
    assert code.split(", ")[0] == f"``{CODE['code'][key][0].partition('::')[0]}``"
    assert all(f"``{test}``" in covered for test in ENTRIES[key]["tests"])
    assert covered.endswith("; 2 mutants killed")
    assert verdict == said


def test_its_code_is_named() -> None:
    assert [*CODE["code"]] == [key for key, entry in ENTRIES.items() if "tests" in entry]


@pytest.mark.parametrize("key", CODE["code"])
def test_its_code_is_there_and_can_be_changed(key: str) -> None:
    assert len({*CODE["code"][key]}) == len(CODE["code"][key])
    assert len([*draw(ROOT / "src" / "thermocomp", CODE["code"][key], 0, key)]) > 2


def test_changes_without_effect_are_those_of_the_code() -> None:
    drawn = {
        (m.piece, m.before, m.after)
        for key in CODE["code"]
        for m in draw(ROOT / "src" / "thermocomp", CODE["code"][key], 0, key)
    }
    for entry in CODE.get("equivalent", ()):
        assert (entry["piece"], entry["before"], entry["after"]) in drawn, entry
        assert len(entry["reason"]) > 20
