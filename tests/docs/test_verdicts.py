"""`docs/verdicts.json` belongs to the code, and the tables of `docs/studies.rst` are made from it."""

import importlib.util
import json
import re
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from thermocomp.papers.report.papers import text
from thermocomp.papers.studies import STUDIES
from thermocomp.papers.study import Claim, Study

ROOT = Path(__file__).resolve().parents[2]


def load(file: str) -> Any:
    spec = importlib.util.spec_from_file_location(Path(file).stem, ROOT / file)
    assert spec is not None
    assert spec.loader is not None
    module: ModuleType = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


script, page = load("scripts/verdicts.py"), load("docs/_ext/verdict_table.py")
KEPT = json.loads(script.FILE.read_text(encoding="utf-8"))


def test_every_study_is_there() -> None:
    assert [*KEPT["studies"]] == [*STUDIES]
    assert (KEPT["seed"], KEPT["repeats"]) == (0, 3)


@pytest.mark.parametrize("study", STUDIES)
def test_claims_are_those_of_the_code(study: str) -> None:
    kept = KEPT["studies"][study]
    refresh = f"make verdicts STUDIES={study}"
    known = sorted(entry["ids"] for entry in script.entries(study))
    assert sorted(" ".join(c["ids"]) for c in kept["claims"]) == known, refresh
    assert kept["digest"] == script.digest(study), f"sentences or criteria have changed: {refresh}"


@pytest.mark.parametrize(
    ("old", "new", "same"),
    [
        ('holds = "ratio <= SAME"', 'holds = "ratio <= OTHER"', False),
        ('whole = "raised >= paper"', 'whole = "raised >= ours"', False),
        ("Grouping saves computing time", "Grouping saves time", False),
        ('paper = "7 instead of 4"', 'paper = "8 instead of 4"', False),
        ("Here the smallest mean square needs", "The smallest mean square needs", True),
    ],
)
def test_a_digest_is_that_of_sentences_and_criteria(
    old: str, new: str, same: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = script.digest("hwang")
    claims = (script.PAPERS / "hwang" / "claims.toml").read_text(encoding="utf-8")
    assert old in claims
    (tmp_path / "hwang").mkdir()
    (tmp_path / "hwang" / "claims.toml").write_text(claims.replace(old, new), encoding="utf-8")
    monkeypatch.setattr(script, "PAPERS", tmp_path)
    assert (script.digest("hwang") == before) is same


def test_one_study_is_made_again_and_the_others_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    claim = {"ids": ["H-16"], "claim": "It", "paper": "", "ours": "1", "holds": None, "again": [], "softer": False}
    made = {"seed": 0, "repeats": 3, "studies": [{"name": "hwang", "title": "New", "claims": [claim], "numbers": {}}]}
    asked: list[list[str]] = []

    def run(line: list[str], **_: object) -> SimpleNamespace:
        asked.append(line)
        return SimpleNamespace(stdout=json.dumps(made))

    monkeypatch.setattr(script.subprocess, "run", run)
    monkeypatch.setattr(script, "FILE", tmp_path / "verdicts.json")
    (tmp_path / "verdicts.json").write_text(json.dumps(KEPT), encoding="utf-8")
    script.main(["hwang"])
    found = json.loads((tmp_path / "verdicts.json").read_text(encoding="utf-8"))
    assert asked[0][2:5] == ["thermocomp.cli.app", "papers", "hwang"]
    assert [*found["studies"]] == [*STUDIES]
    assert found["studies"]["hwang"] == {"title": "New", "digest": script.digest("hwang"), "claims": [claim]}
    assert all(found["studies"][s] == KEPT["studies"][s] for s in STUDIES if s != "hwang")


CLAIMS = (
    Claim(("W-08",), "At rest", "MLR 5.7 um", "2 um", True, again=(True, True)),
    Claim(("W-08",), "Locally", "in total 5.7x", "3x", True, "Half, not *all*.", again=(True, True), softer=True),
    Claim(("W-08",), "Range", "30 to 50", "_", False, "No.", again=(False, True)),
    Claim(("W-09",), "At work", "5.0 um", "9 um", False, "Noise.", again=(False, False)),
    Claim(("W-08",), "Only a number", "MLR 5.7 um", "1", None),
)
MADE = {"made": Study("made", "Made", CLAIMS, tables=(), figures=(), numbers={})}


def test_verdicts_are_counted() -> None:
    header, row = page.VerdictTable.rows(None, MADE)
    assert header[:5] == ("study", "hold in each run", "in part", "in none", "in some runs")
    assert row[:5] == ("``made``", "1", "1", "1", "1")


def test_headlines_are_claims_with_a_verdict() -> None:
    said = [(line, [c.text for c in page.headlines(line, MADE)]) for line in ("made W-08 MLR 5.7", "made W-08")]
    assert said == [("made W-08 MLR 5.7", ["At rest"]), ("made W-08", ["At rest", "Locally", "Range"])]
    table = SimpleNamespace(content=["made W-08 in total"])
    assert [*page.HeadlineTable.rows(table, MADE)] == [
        ("study", "claim", "paper", "here", "holds", "why"),
        ("``made``", "Locally", "in total 5.7x", "3x", "in part", r"Half, not \*all\*."),
    ]
    with pytest.raises(ValueError, match=r"no claim of made W-08 5\.8"):
        page.headlines("made W-08 5.8", MADE)


def test_errors_on_a_measured_machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Pooled over the cycles, without the limits of a compensator; the table is made of what is kept (W-08)."""

    def result(model: str, target: str, rms: float, block: str = "all unseen cycles") -> dict[str, object]:
        return {
            "model": model,
            "target": target,
            "block": block,
            "none_rms_um": 9.0,
            "rms_um": 0.0,
            "alone_rms_um": rms,
        }

    results = [result("ols", "ch1_um", 5.0, "cycle 1"), result("ols", "ch1_um", 7.46), result("ace", "ch1_um", 4.9)]
    made = {"thermocomp": "1", "arguments": ["compare"], "judging": "each cycle", "results": results}
    asked: list[tuple[list[str], Path]] = []

    def run(line: list[str], *, cwd: Path, **_: object) -> SimpleNamespace:
        asked.append((line, cwd))
        return SimpleNamespace(stdout=json.dumps(made))

    monkeypatch.setattr(script.subprocess, "run", run)
    monkeypatch.setattr(script, "METHODS", ("ols", "ace"))
    monkeypatch.setenv("THERMOCOMP_DATA", str(tmp_path))
    for module in (script, page):
        monkeypatch.setattr(module, "MEASURED", tmp_path / "measured.json")
    script.main(["measured"])
    ((line, folder),) = asked
    assert line[2:8] == ["thermocomp.cli.app", "compare", "recording.csv", "--models", "ols", "ace"]
    assert folder == tmp_path / "fl_thermal"
    rows = [*page.MeasuredTable.rows(None, {})]
    assert rows == [("method", "``ch1_um``"), ("none", "9.0"), ("``ols``", "7.5"), ("``ace``", "4.9")]


def test_the_page_says_what_the_measured_errors_are() -> None:
    """W-08: the sentences below the table, from the same file."""
    rms = json.loads(page.MEASURED.read_text(encoding="utf-8"))["rms_um"]
    gains = {m: [rms["ols"][c] / rms[m][c] for c in rms["ols"]] for m in ("ace", "ace-monotone")}
    better, worse = [g for g in gains["ace"] if g > 1], [1 / g for g in gains["ace"] if g < 1]
    monotone = gains["ace-monotone"]
    content = " ".join((ROOT / "docs" / "studies.rst").read_text(encoding="utf-8").split())
    assert f"ACE is {min(better):.1f} to {max(better):.1f} times better than linear regression in the first" in content
    assert f"{min(worse):.1f} to {max(worse):.1f} times worse in the other three" in content
    assert f"it is {min(monotone):.1f} to {max(monotone):.1f} times better in all five channels" in content
    assert ([g > 1 for g in gains["ace"]], min(monotone) > 1) == ([True, True, False, False, False], True)


def test_the_page_shows_headlines_of_all_papers() -> None:
    content = (ROOT / "docs" / "studies.rst").read_text(encoding="utf-8")
    (lines,) = re.findall(r"headline-table::\n\n((?:   .+\n)+)", content)
    studies = page.read()
    found = [(line.split()[0], page.headlines(line, studies)) for line in lines.splitlines()]
    assert {name for name, _ in found} == {*STUDIES}
    assert sum(len(claims) for _, claims in found) >= 12
    (shown,) = re.findall(r"verdict-text:: (\S+) (.+)\n", content)
    for key in shown[1].split():
        assert f"{key}" in text(studies[shown[0]], key)
