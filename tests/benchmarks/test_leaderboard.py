"""The leaderboard, run as its command in a copy of its folder: its figures, and models that fail."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import thermocomp
from thermocomp.judging.replay import replay
from thermocomp.judging.robustness import stress
from thermocomp.models.training import train
from thermocomp.recordings.stacking import stack
from thermocomp.virtual.datasets import record

pytestmark = pytest.mark.long  # processes that import everything
FOLDER = Path(__file__).resolve().parents[2] / "benchmarks" / "leaderboard"
MODELS = {
    "mean-of-all": "from sklearn.dummy import DummyRegressor as estimator\n\nSUMMARY = 'a constant'\n",
    "broken": "raise RuntimeError('no licence')\n",
    "nameless": "SUMMARY = 'without an estimator'\n",
    "deadly": "import os\n\nSUMMARY = 'dies'\n\n\ndef estimator():\n    os._exit(7)\n",
    "endless": "SUMMARY = 'never ends'\n\n\ndef estimator():\n    while True:\n        pass\n",
    "ols": "raise RuntimeError('has the name of a method')\n",
}


def run(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(Path(thermocomp.__file__).parents[1]), "THERMOCOMP_DATA": "nowhere"}
    return subprocess.run(
        [sys.executable, str(folder), *arguments], env=environment, capture_output=True, text=True, check=False
    )


def judged(folder: Path, *arguments: str) -> tuple[dict[str, Any], str]:
    done = run(folder, *arguments, "-o", str(folder / "out"))
    assert done.returncode in (0, 1), done.stderr
    return json.loads((folder / "out" / "board.json").read_text()), (folder / "out" / "board.md").read_text()


@pytest.fixture(scope="module")
def copied(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("benchmarks") / "leaderboard"
    shutil.copytree(FOLDER, folder)
    for path in (folder / "models").glob("*.py"):
        path.unlink()
    for name, text in MODELS.items():
        (folder / "models" / f"{name}.py").write_text(text)
    return folder


@pytest.fixture(scope="module")
def board(copied: Path) -> tuple[dict[str, Any], str]:
    models = "ols,dynamic,mean-of-all,broken,nameless,deadly,endless,ols (file)"
    return judged(copied, "--models", models, "--tests", "stepwise2017,voron", "--seconds", "3")


@pytest.mark.parametrize("name", ["ols", "dynamic"])
def test_figures_are_those_of_an_own_replay(board: tuple[dict[str, Any], str], name: str) -> None:
    found = board[0]["models"][name]["tests"]["stepwise2017"]
    samples = stack([*record("stepwise2017"), *record("stepwise2017-online")], ["x1_um"])
    learn, unseen = samples.test == 0, samples.test == 1
    model = train(name, samples, 0, learn).model
    measured = samples.deviations[unseen, 0]
    left = np.abs(measured - replay(model, samples, unseen)[0])
    assert found["mae"] == pytest.approx(left.mean(), rel=1e-9)
    assert found["rms"] == pytest.approx(np.sqrt((left**2).mean()), rel=1e-9)
    assert found["share_mae"] == pytest.approx(left.mean() / np.abs(measured).mean(), rel=1e-9)
    assert found["sensors"] == [len(model.sensors)] * 2
    assert found["worst"] == {"channel": "x1_um", "share_mae": found["share_mae"]}
    stressed = stress(model, samples, measured, unseen).robustness
    assert found["noise_share_rms"] == pytest.approx(stressed.noise_rms["normal"][0] / stressed.none_rms, rel=1e-9)
    assert found["lost_share_rms"] == pytest.approx(max(stressed.lost_rms.values()) / stressed.none_rms, rel=1e-9)
    assert board[0]["models"][name]["score"] == found["share_mae"]
    assert f"{left.mean():.2f} ({found['share_mae']:.0%}" in board[1]


def test_the_rest_is_judged_and_what_failed_is_named(board: tuple[dict[str, Any], str]) -> None:
    results, page = board[0]["models"], board[1]
    why = {name: m["tests"]["stepwise2017"].get("error", "") for name, m in results.items()}
    assert why["broken"] == "RuntimeError: no licence"
    assert "nameless.py has no estimator" in why["nameless"]
    assert "process ended" in why["deadly"]
    assert why["endless"] == "> 3 s"
    assert "name of a method" in why["ols (file)"]
    assert all(results[n]["score"] is None for n in ("broken", "nameless", "deadly", "endless", "ols (file)"))
    assert board[0]["ranking"] == sorted(("ols", "dynamic", "mean-of-all"), key=lambda n: results[n]["score"])
    assert results["mean-of-all"]["summary"] == "a constant"
    assert "- broken: stepwise2017: RuntimeError: no licence" in page
    assert "- endless: stepwise2017: > 3 s" in page


def test_a_test_without_its_data_is_skipped_and_says_so(copied: Path, board: tuple[dict[str, Any], str]) -> None:
    assert "is missing; set THERMOCOMP_DATA" in board[0]["tests"]["voron"]["skipped"]
    assert "skipped: " in board[1]
    done = run(copied, "--tests", "voron,fl-thermal")
    assert done.returncode == 2
    assert "no test can be run" in done.stderr


def test_twice_the_same(copied: Path, board: tuple[dict[str, Any], str]) -> None:
    again, _ = judged(copied, "--models", "ols,dynamic", "--tests", "stepwise2017")
    for name in ("ols", "dynamic"):
        one, two = (b["models"][name]["tests"]["stepwise2017"] for b in (board[0], again))
        assert {k: v for k, v in one.items() if not k.endswith("_s")} == {
            k: v for k, v in two.items() if not k.endswith("_s")
        }


def test_the_published_block_is_looked_at_three_times_at_most(copied: Path) -> None:
    log = copied / "published_block.md"
    before = log.read_text(encoding="utf-8") + "".join(
        f"2026-11-2{k} | abcdef{k} | mean-of-all, all 16 | 1 1 1 1 1 | 1\n" for k in range(3)
    )
    log.write_text(before, encoding="utf-8")
    done = run(copied, "--published", "mean-of-all")
    assert done.returncode == 2
    assert "3 times" in done.stderr
    assert log.read_text(encoding="utf-8") == before


def test_a_part_of_the_board_takes_no_place_and_names_are_checked(copied: Path) -> None:
    before = (copied / "board.md").read_text() if (copied / "board.md").is_file() else None
    assert run(copied, "--models", "ols", "--tests", "hwang").returncode == 0
    assert ((copied / "board.md").read_text() if (copied / "board.md").is_file() else None) == before
    for wrong, why in {"olz": "no model 'olz'; the nearest are ols", ",": "no model ''"}.items():
        done = run(copied, "--models", wrong)
        assert done.returncode == 2
        assert why in done.stderr
