"""Every numbered equation, table and figure of the papers has a place here, or a reason why not."""

import ast
import json
import tomllib
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CODE = ROOT / "src" / "thermocomp"
#: numbered equations, tables and figures of each paper
COUNTS = {"C": (10, 2, 17), "W": (6, 0, 9), "H": (9, 3, 6), "P": (1, 0, 0), "T": (8, 0, 6)}
#: equations of an appendix; figures of a scan that has lost all numbers but one
FURTHER = {"W": ["Eq. A1", "Eq. A2", "Eq. A3", "Eq. A4", "Eq. A5"], "P": ["Network", "Fig. 4", "Principle", "Effect"]}
GROUPS = tomllib.loads((ROOT / "docs" / "exhibits.toml").read_text(encoding="utf-8"))
ENTRIES = {f"{p} {k}": entry for p, group in GROUPS.items() for k, entry in group.items() if k != "title"}


@cache
def shown(study: str) -> set[str]:
    """The texts on the page of a study: ids of claims, keys of figures, beginnings of captions of tables."""
    tree = ast.parse((ROOT / "docs" / "papers" / f"plot_{study}.py").read_text(encoding="utf-8"))
    return {n.value for n in ast.walk(tree) if isinstance(n, ast.Constant) and isinstance(n.value, str) and n.value}


@pytest.mark.parametrize("paper", COUNTS)
def test_none_is_missing(paper: str) -> None:
    kinds = zip(("Eq.", "Table", "Fig."), COUNTS[paper], strict=True)
    wanted = [f"{kind} {k}" for kind, n in kinds for k in range(1, n + 1)]
    assert sorted(GROUPS[paper]) == sorted([*wanted, *FURTHER.get(paper, ()), "title"])


@pytest.mark.parametrize("key", ENTRIES)
def test_its_place_is_there(key: str) -> None:
    entry = ENTRIES[key]
    assert {"what"} < {*entry} <= {"what", "code", "study", "reason"}
    assert all(entry.values())
    for file in entry.get("code", ()):
        assert (CODE / file).is_file(), file
    for place in entry.get("study", ()):
        study, kind, name = place.split(".")
        exhibits = tomllib.loads((CODE / "papers" / study / "exhibits.toml").read_text(encoding="utf-8"))
        caption = " ".join(exhibits[kind][name]["caption"].split())
        begins = caption.startswith if kind == "tables" else name.removeprefix(f"{study}-").__eq__
        assert any(begins(text) for text in shown(study)), f"{place} is not on the page of the study"


def test_every_claim_is_on_the_page_of_its_study() -> None:
    kept = json.loads((ROOT / "docs" / "verdicts.json").read_text(encoding="utf-8"))["studies"]
    claims = [(study, claim["ids"], claim["claim"]) for study, told in kept.items() for claim in told["claims"]]
    assert [claim for claim in claims if shown(claim[0]).isdisjoint(claim[1])] == []
