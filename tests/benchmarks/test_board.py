"""The leaderboard as it is committed, and models that join it."""

import importlib
import json
from pathlib import Path
from typing import Any

import pytest

from thermocomp.core.exceptions import InputError
from thermocomp.models.methods import METHODS

FOLDER = Path(__file__).resolve().parents[2] / "benchmarks" / "leaderboard"
KEPT: dict[str, Any] = json.loads((FOLDER / "board.json").read_text(encoding="utf-8"))


@pytest.fixture
def board(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(FOLDER))
    return importlib.import_module("board")


def test_every_method_is_on_the_board(board: Any) -> None:
    """T-10: also `sir` and `pcr-traversal`, the methods of the papers that stepwise2017 cites."""
    assert METHODS.keys() <= KEPT["models"].keys()
    assert {*KEPT["ranking"]} == {*KEPT["models"]}
    page = (FOLDER / "board.md").read_text(encoding="utf-8")
    rows = [line.split(" | ")[0].removeprefix("| ") for line in page.splitlines() if "%, " in line]
    assert rows == KEPT["ranking"] == board.rank({name: m["tests"] for name, m in KEPT["models"].items()})


def test_models_join_the_board_if_their_tests_are_the_same(board: Any) -> None:
    """A model of another run is ranked among the others; other data, or a part of the tests, are refused."""

    def run(name: str, none: float, left: float, tests: tuple[str, ...] = ("a", "b")) -> dict[str, Any]:
        told = {t: {"mae": left, "none_mae": none, "share_mae": left / none} for t in tests}
        return {
            "commit": name,
            "tests": {key: {} for key in tests},
            "ranking": [name],
            "models": {name: {"score": left / none, "tests": told}},
        }

    both = board.add(run("old", 4.0, 2.0), run("new", 4.0, 1.0))
    assert both["ranking"] == ["new", "old"]
    assert both["models"]["new"]["commit"] == "new"
    assert (both["commit"], "commit" in both["models"]["old"]) == ("old", False)
    again = board.add(both, run("old", 4.0, 0.5))
    assert (again["ranking"], again["models"]["old"]["score"]) == (["old", "new"], 0.125)
    with pytest.raises(InputError, match="other data for a, b"):
        board.add(run("old", 4.0, 2.0), run("new", 4.1, 1.0))
    with pytest.raises(InputError, match="other data for b"):
        board.add(run("old", 4.0, 2.0), run("new", 4.0, 1.0, ("a",)))
