"""`thermocomp select`: tables for people, JSON for programs, a page, and clear refusals."""

import json
from pathlib import Path

import pytest

from smallmachine import crowded_machine
from thermocomp.cli.app import run
from thermocomp.files import recordings


@pytest.fixture(scope="module")
def drift(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("select") / "drift.csv"
    recordings.write(crowded_machine(), path)
    return path


@pytest.mark.parametrize("method", ["grouping", "partial-f", "stepwise", "subsets", "ace", "pareto"])
def test_every_method_for_people_and_programs(
    drift: Path, method: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "sensors.html"
    line = ["select", str(drift), "--target", "x_um", "--method", method, "--max-sensors", "2", "--jobs", "1"]
    assert run([*line, "-o", str(page)]) == 0
    said = capsys.readouterr().out
    assert "x_um: t" in said
    assert str(page.name) in said
    text = page.read_text(encoding="utf-8")
    assert "Which sensors does the model need?" in text
    assert "http" not in text.replace("http://www.w3.org", "").replace("https://matplotlib.org", "").replace(
        "http://purl.org", ""
    ).replace("http://creativecommons.org", "")
    assert run([*line, "-o", str(page)]) == 2  # not overwritten without being asked
    assert "exists already" in capsys.readouterr().err
    assert run([*line, "--json"]) == 0
    (choice,) = json.loads(capsys.readouterr().out)["choices"]
    assert choice["method"] == method
    assert set(choice["sensors"]) <= {f"t{k}_C" for k in range(1, 7)}
    assert all(rows for rows in choice["tables"].values())
    assert ", ".join(choice["sensors"]) in said


def test_refusals(drift: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = ["select", str(drift), "--target", "x_um", "--jobs", "1"]
    for extra, told in (
        (["--method", "grouping", "--threshold", "2"], "threshold 2.0"),
        (["--method", "grouping", "--reference", "t9_C"], "no input is named 't9_C'"),
        (["--max-sensors", "0"], "want at least 1"),
        (["--models", "gpp"], "unknown model 'gpp'"),
        (["--method", "ace", "--level", "3"], "level 3.0"),
        (["--method", "ace", "--max-sensors", "0"], "at least"),
        (["--method", "subsets", "--max-sensors", "0"], "at least 1"),
    ):
        assert run([*line, *extra]) == 2, extra
        assert told in " ".join(capsys.readouterr().err.split()), extra
