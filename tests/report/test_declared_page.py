"""Header data, workpiece and measurement uncertainty on pages and in printed results; none unless declared."""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from html import unescape
from pathlib import Path

import pytest
from smallmachine import small_machine

import thermocomp as tc
from thermocomp.cli.app import run
from thermocomp.cli.terminal import console
from thermocomp.recordings.declared import Declared, HeaderData, MeasuringUncertainty, Workpiece
from thermocomp.recordings.readers import recordings

DECLARED = Declared(
    HeaderData(machine="VMC <3>", serial="4711"),
    MeasuringUncertainty(probe_um=0.8, repeatability_um=0.0),
    workpiece=Workpiece(300.0, 23.0, "t1_C", material="aluminium"),
)
WORKPIECE = "Workpiece (aluminium, 300 mm, 23 um/(m K), t1_C): longer than at 20 degC by "


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    whole = replace(small_machine(dt=300.0), name="first")
    recordings.write(replace(whole, declared=DECLARED), "first.csv")
    recordings.write(replace(small_machine(seed=2, dt=300.0), name="second", declared=DECLARED), "second.csv")
    recordings.write(whole, "bare.csv")
    return tmp_path


@pytest.fixture
def out(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Callable[..., str]:
    monkeypatch.setattr(console, "_width", 200)

    def ran(*arguments: str) -> str:
        assert run(arguments) in (0, 1)
        return capsys.readouterr().out

    return ran


def words(page: Path) -> str:
    """The page without its figures."""
    bare = re.sub(r"<svg.*?</svg>", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    return " ".join(unescape(re.sub(r"<[^>]+>", " ", bare)).split())


def test_compare_and_assess_state_them(folder: Path, out: Callable[..., str]) -> None:
    study = ("--target", "z_um", "--jobs", "1")
    short = out("compare", "first.csv", *study, "--models", "ols", "-o", "page.html")
    assert "Measurement uncertainty (k = 2) [um]: RMS ± 0.80, largest ± 0.80." in short
    page = words(folder / "page.html")
    result = tc.compare(["first.csv"], "z_um", "ols", robustness=False, jobs=1).comparison.overall()[0]
    figures = [result.none_metric("rms"), result.none_metric("max_abs"), result.metric("rms"), result.metric("max_abs")]
    assert [f"{v:.2f} ± 0.80" for v in figures if f" {v:.2f} ± 0.80 " not in page] == []
    assert page.index("Test: machine VMC <3>, serial 4711") < page.index("Use ols for z_um")
    assert WORKPIECE.replace("um/", "µm/").replace("degC", "°C") in page
    assert "Not stated, so not contained: sensitivity_pct, misalignment_deg" in page

    out("fit", "bare.csv", *study, "--model", "ols", "-o", "model.json")
    full = out("assess", "model.json", "second.csv", "--details", "-o", "assessed.html")
    assert "Test: machine VMC <3>, serial 4711" in full
    assert WORKPIECE in full
    assert re.search(r"expanded \(k = 2\) +│ +0\.80 │ +0\.80 │ +0\.80 │ +0\.80 │", full)
    assert full.count(" ± 0.80 │") == 4
    assert words(folder / "assessed.html").count(" ± 0.80 ") == 6  # in the verdict, too
    (found, *_) = json.loads(out("assess", "model.json", "second.csv", "--json"))["results"]
    assert found["uncertainty"]["standard"]["probe"] == pytest.approx(
        dict.fromkeys(found["uncertainty"]["expanded"], 0.4)
    )


def test_what_is_not_declared_is_not_there(folder: Path, out: Callable[..., str]) -> None:
    short = out("compare", "bare.csv", "--target", "z_um", "--jobs", "1", "--models", "ols", "-o", "page.html")
    page = words(folder / "page.html")
    assert [word for word in ("ncertainty (k", "±", "Workpiece", "Test:") if word in short or word in page] == []
    (found,) = json.loads(out("check", "bare.csv", "--json"))["recordings"]
    assert not {"test", "workpiece"} & set(found)


def test_check_states_header_and_workpiece(folder: Path, out: Callable[..., str]) -> None:
    (found,) = json.loads(out("check", "first.csv", "--json", "-o", "check.html"))["recordings"]
    assert found["test"] == {"machine": "VMC <3>", "serial": "4711"}
    low = min(c["smallest"] for c in found["channels"] if c["name"] == "t1_C")
    assert found["workpiece"]["smallest_um"] == pytest.approx(6.9 * (low - 20.0), rel=0.01)  # 0.3 m x 23 um/(m K)
    assert "machine VMC <3>, serial 4711" in words(folder / "check.html")

    other = replace(DECLARED, workpiece=Workpiece(300.0, 23.0, "t9_C"))
    recordings.write(replace(small_machine(dt=300.0), declared=other), "other.csv")
    (found,) = json.loads(out("check", "other.csv", "--json"))["recordings"]
    assert found["workpiece"]["smallest_um"] is None
    assert "t9_C): the recording has no such temperature; correct [workpiece] temperature" in found["workpiece"]["text"]
