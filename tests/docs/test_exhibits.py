"""Every numbered equation, table and figure of the papers has a place here, or a reason why not."""

import ast
import importlib
import json
import re
import tomllib
from collections.abc import Iterable
from functools import cache
from pathlib import Path

import pytest

from thermocomp.papers.chen1996 import drift, setup

ROOT = Path(__file__).resolve().parents[2]
CODE = ROOT / "src" / "thermocomp"
#: numbered equations, tables and figures of each paper
COUNTS = {"C": (10, 2, 17), "W": (6, 0, 9), "H": (9, 3, 6), "P": (1, 0, 0), "T": (8, 0, 6)}
#: equations of an appendix; figures of a scan that has lost all numbers but one
FURTHER = {"W": ["Eq. A1", "Eq. A2", "Eq. A3", "Eq. A4", "Eq. A5"], "P": ["Network", "Fig. 4", "Principle", "Effect"]}
GROUPS = tomllib.loads((ROOT / "docs" / "exhibits.toml").read_text(encoding="utf-8"))
REFERENCE = (ROOT / "docs" / "reference.rst").read_text(encoding="utf-8")
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
    assert {"what"} < {*entry} <= {"what", "form", "code", "study", "reason"}
    assert ("form" in entry) == (" Eq. " in key)
    assert all(entry.values())
    for file in entry.get("code", ()):
        assert (CODE / file).is_file(), file
        assert f"   thermocomp.{file.removesuffix('.py').replace('/', '.')}\n" in REFERENCE, f"no page has {file}"
    for place in entry.get("study", ()):
        study, kind, name = place.split(".")
        exhibits = tomllib.loads((CODE / "papers" / study / "exhibits.toml").read_text(encoding="utf-8"))
        caption = " ".join(exhibits[kind][name]["caption"].split())
        begins = caption.startswith if kind == "tables" else name.removeprefix(f"{study}-").__eq__
        assert any(begins(text) for text in shown(study)), f"{place} is not on the page of the study"


@pytest.mark.parametrize(
    ("key", "coefficients"),
    [
        ("C Eq. 5", drift.EQ5.values()),
        ("C Eq. 6", [1e-3 * float(c) for c in setup.EQ6.coef]),
        ("C Eq. 7", setup.EQ8.values()),
    ],
)
def test_a_printed_equation_is_that_of_the_code(key: str, coefficients: Iterable[float]) -> None:
    """Of each term, with its sign: ``- 36.966 (T6-T7)``."""
    found = re.findall(r"([=+-]) (-?[\d.]+(?:e-\d+)?) ?(?=[(Ty+])", ENTRIES[key]["form"])
    assert [float(f"{sign.strip('=')}{number}") for sign, number in found] == pytest.approx([*coefficients], rel=1e-9)


@pytest.mark.parametrize(
    ("key", "said", "place"),
    [
        ("H Table 3", "eigenvalues with and without grouping", "table 'Eigenvalues of X'X'"),
        ("H Fig. 4", "residual mean square by number of variables", "figure 'Fig. 4'"),
        ("C Eq. 10", "the sigmoid of a neuron: ``OUT = 1 / (1 + exp(-NET))``", ":mod:`thermocomp.core.network`"),
    ],
)
def test_the_table_has_the_equation_and_the_place(key: str, said: str, place: str) -> None:
    what, here = importlib.import_module("paper_tables").exhibit(key, ENTRIES[key])
    assert what == said
    assert here.endswith(place)


def test_every_claim_is_on_the_page_of_its_study() -> None:
    kept = json.loads((ROOT / "docs" / "verdicts.json").read_text(encoding="utf-8"))["studies"]
    claims = [(study, claim["ids"], claim["claim"]) for study, told in kept.items() for claim in told["claims"]]
    assert [claim for claim in claims if shown(claim[0]).isdisjoint(claim[1])] == []
