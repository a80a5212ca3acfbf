"""The planted faults of NC programs fit the code: each changes one place, and names tests that exist."""

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
MUTANTS = tomllib.loads((ROOT / "benchmarks" / "nc_mutants.toml").read_text(encoding="utf-8"))["mutant"]


@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda mutant: mutant["name"])
def test_it_changes_one_place_and_its_tests_exist(mutant: dict[str, Any]) -> None:
    for change in (mutant, *mutant.get("also", ())):
        code = (ROOT / "src" / "thermocomp" / change["file"]).read_text(encoding="utf-8")
        assert code.count(change["old"]) == 1
    for test in mutant["tests"]:
        file, _, name = test.partition("::")
        text = (ROOT / "tests" / file).read_text(encoding="utf-8")
        assert not name or re.search(rf"^def {name.partition('[')[0]}\(", text, re.MULTILINE), test
