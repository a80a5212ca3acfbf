"""`thermocomp papers`: claims for people and programs, a page, and clear refusals."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from smallmachine import small_machine

from thermocomp.cli.app import run
from thermocomp.papers import cross, studies
from thermocomp.papers.commands import papers
from thermocomp.papers.study import Claim, Figure, Panel, PlotCurve, Progress, Study, StudyTable
from thermocomp.recordings.readers import recordings
from thermocomp.recordings.recording import Recording

CLAIMS = (
    Claim(("H-16",), "Grouping raises [it]", "3.3", "2.5", True),
    Claim(("H-18",), "It scatters less", "", "0.4", False, "It does not: [noise]."),
)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, int]]:
    """Studies that take no time; what was asked of them."""
    found: list[tuple[str, int]] = []

    def made(name: str, *, seed: int, progress: Progress, physics: str | None = None) -> Study:
        found.append((name, seed) if physics is None else (f"{name}, {physics}", seed))
        progress(0.5, "half of it")
        panel = Panel("", "time [h]", "z [um]", [PlotCurve("z", np.arange(3.0), np.arange(3.0))])
        table = StudyTable("Errors", ("model", "RMS"), [["a", "1.25"]])
        numbers = {"rms_um": 1.25, "unknown_um": float("nan")}
        figures = (Figure(f"{name}-fig", "Fig. 1", [panel]),)
        return Study(name, f"Title of {name}", CLAIMS, (table,), figures, numbers)

    monkeypatch.setattr(studies, "run", made)
    return found


def test_the_names_are_those_of_the_studies() -> None:
    assert get_args(papers.Name) == (*studies.STUDIES, papers.CROSS)


def test_help_lists_the_names(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["papers", "--help"]) == 0
    said = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert f"[choices: {', '.join((*studies.STUDIES, papers.CROSS))}]" in said


def test_all_five_for_people(
    asked: list[tuple[str, int]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("COLUMNS", "120")
    page = tmp_path / "papers.html"
    assert run(["papers", "-o", str(page), "--seed", "3"]) == 0
    assert asked == [(name, seed) for name in studies.STUDIES for seed in (3, 103, 203)]
    said = capsys.readouterr().out
    for name in studies.STUDIES:
        assert f"Title of {name}" in said
        assert f"Title of {name}" in page.read_text(encoding="utf-8")
    assert said.count("H-18 It does not: [noise].") == 5
    assert said.count("1 of 2 claims hold on the virtual machine in each of 3 runs; 0 s") == 5
    assert "Grouping raises [it]" in said
    assert str(page.name) in said
    assert run(["papers", "-o", str(page)]) == 2  # not overwritten without being asked
    assert "exists already" in capsys.readouterr().err
    assert len(asked) == 15  # and that before any work
    assert run(["papers", "hwang", "-o", str(page), "--overwrite"]) == 0


def test_some_for_programs(asked: list[tuple[str, int]], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["papers", "hwang", "chen1996", "hwang", "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert [s["name"] for s in content["studies"]] == ["hwang", "chen1996"]
    (first, second), numbers = content["studies"][0]["claims"], content["studies"][0]["numbers"]
    assert first == {
        "ids": ["H-16"],
        "claim": "Grouping raises [it]",
        "paper": "3.3",
        "ours": "2.5",
        "holds": True,
        "finding": "",
        "again": [True, True],
        "softer": False,
        "testable": True,
    }
    assert second["holds"] is False
    assert numbers == {"rms_um": 1.25, "unknown_um": None}
    assert content["studies"][0]["tables"][0]["rows"] == [["a", "1.25"]]


def test_runs_that_do_not_agree_are_told(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def made(name: str, *, seed: int, progress: Progress, physics: str | None = None) -> Study:
        progress(1.0, "all of it")
        finding = "" if seed in (1, 100) else f"not with {seed}"
        claims = (
            Claim(("H-15",), "More without", "7", f"{seed}", seed in (1, 100), finding),
            Claim(("P-03",), "n", "", "1", None),
        )
        return Study(name, name, claims, (), (), {})

    monkeypatch.setattr(studies, "run", made)
    assert run(["papers", "hwang"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "1 of 3" in said
    assert "0 of 1 claims hold on the virtual machine in each of 3 runs, 1 in some of them; 1 more number" in said
    assert "not with 0" in said
    assert run(["papers", "hwang", "--seed", "1"]) == 0
    assert "H-15 Seed 101: not with 101" in capsys.readouterr().out
    assert run(["papers", "hwang", "--repeats", "1", "--seed", "1"]) == 0
    assert "1 of 1 claims hold on the virtual machine; 1 more" in capsys.readouterr().out
    assert run(["papers", "hwang", "--repeats", "0"]) == 2
    assert "--repeats 0: must be at least 1" in capsys.readouterr().err


def test_cross_judges_on_measured_recordings_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    drift = tmp_path / "drift.csv"
    recordings.write(small_machine(), drift)
    given: list[tuple[object, ...]] = []

    def made(
        seed: int,
        progress: Progress,
        recordings: Sequence[Recording],
        *,
        methods: Sequence[str],
        targets: Sequence[str] | None,
        jobs: int,
    ) -> Study:
        given.append((seed, [t.name for t in recordings], tuple(methods), targets, jobs))
        return Study("cross", "All methods", (), (StudyTable("RMS", ("method", "drift"), [["ols", "1.25"]]),), (), {})

    monkeypatch.setattr(cross, "run", made)
    assert run(["papers", "cross"]) == 0
    assert "1.25" in capsys.readouterr().out
    assert (
        run(
            [
                "papers",
                "cross",
                "--with",
                str(drift),
                "--target",
                "x_um",
                "--models",
                "ols",
                "mra",
                "--json",
                "--jobs",
                "2",
            ]
        )
        == 0
    )
    assert given == [(0, [], tuple(cross.FAST), None, 1), (0, ["drift"], ("ols", "mra"), ["x_um"], 2)]


def test_an_unknown_name_is_told_the_names(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        run(["papers", "chen"])
    assert stop.value.code == 2
    said = capsys.readouterr().err
    assert all(f'"{name}"' in said for name in studies.STUDIES)


def test_the_physics_is_asked_for_where_it_is_known(asked: list[tuple[str, int]]) -> None:
    assert run(["papers", "wessel2004", "--physics", "nonlinear", "--repeats", "2", "--json"]) == 0
    assert asked == [("wessel2004, nonlinear", 0), ("wessel2004, nonlinear", 100)]


def test_refusals(asked: list[tuple[str, int]], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    drift = tmp_path / "drift.csv"
    recordings.write(small_machine(), drift)
    for line, told in (
        (["--seed", "-1"], "must not be negative"),
        (["hwang", "--with", str(drift)], "--with is for cross"),
        (["hwang", "--models", "ols"], "--models is for cross"),
        (["hwang", "--physics", "nonlinear"], "--physics is for wessel2004, not for hwang"),
        (["--physics", "linear"], "--physics is for wessel2004, not for chen1996"),
        (["cross", "--physics", "nonlinear"], "--physics is for wessel2004, not for cross"),
        (["cross", "--target", "x_um"], "--target is for measured recordings"),
        (["cross", "--with", str(tmp_path / "no.csv")], "no.csv"),
        (["hwang", "-o", str(tmp_path / "no" / "p.html")], "there is no folder"),
        (["cross", "--with", str(drift), "-o", str(drift), "--overwrite"], "is also an input"),
    ):
        assert run(["papers", *line]) == 2, line
        captured = capsys.readouterr()
        assert told in " ".join(captured.err.replace("│", " ").split()), (line, captured)
    assert not asked


def test_a_real_study(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["papers", "hwang", "--json"]) == 0
    (study,) = json.loads(capsys.readouterr().out)["studies"]
    ids = {i for c in study["claims"] for i in c["ids"]}
    assert {"H-16", "H-18"} <= ids
    assert study["numbers"]["models_tried_without_grouping"] == 8191


def test_a_study_that_fails_leaves_the_others(
    asked: list[tuple[str, int]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    made, (first, second, *_) = studies.run, studies.STUDIES

    def some(name: str, *, seed: int, progress: Progress, physics: str | None = None) -> Study:
        if name == first:
            raise ZeroDivisionError("by <zero>")
        return made(name, seed=seed, progress=progress)

    monkeypatch.setattr(studies, "run", some)
    page = tmp_path / "papers.html"
    assert run(["papers", first, second, "-o", str(page)]) == 1
    printed = capsys.readouterr().out
    assert f"{first}: not reproduced" in printed
    assert "ZeroDivisionError: by <zero>" in printed
    assert f"Title of {second}" in printed
    text = page.read_text(encoding="utf-8")
    assert "ZeroDivisionError: by &lt;zero&gt;" in text
    assert f"Title of {second}" in text
    assert run(["papers", first, "--json"]) == 1
    (told,) = json.loads(capsys.readouterr().out)["studies"]
    assert told["claims"][0]["finding"] == "ZeroDivisionError: by <zero>"
