"""Every command's ``--json`` is what its schema in ``docs/files/json`` says, and the page tells of each entry."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from driftmodels import lags
from linuxcncmill import write_linuxcnc_mill
from projects import small_project
from reviseruns import PLATE, judged, write_models
from smallmachine import small_machine
from smallmill import write_mill

from thermocomp.cli import app
from thermocomp.cli.app import run
from thermocomp.core.machine import Channel
from thermocomp.live.journal.journal import Journal, JournalLimits
from thermocomp.live.journal.journalrows import AlarmRow, ReadingRow, StartRow, TargetRow
from thermocomp.papers import studies
from thermocomp.papers.study import Claim, Study, StudyTable
from thermocomp.recordings.declared import Declared, ExpandingBody, HeaderData, Workpiece
from thermocomp.recordings.readers import recordings

DOCS = Path(__file__).parents[2] / "docs"
SCHEMAS = DOCS / "files" / "json"
#: what runs until it is stopped prints no result
COMMANDS = [name for name in app.COMMANDS if name not in ("serve", "app")]
#: what a schema may say; the check knows no other words
WORDS = {
    *("$schema", "$defs", "$ref", "title", "description", "type", "properties", "required"),
    *("additionalProperties", "items", "anyOf", "enum"),
}
TYPES: dict[str, tuple[type, ...]] = {
    "object": (dict,),
    "array": (list,),
    "string": (str,),
    "integer": (int,),
    "number": (int, float),
    "boolean": (bool,),
    "null": (type(None),),
}


def schema(name: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((SCHEMAS / name).read_text(encoding="utf-8"))
    return found


def wrong(value: Any, rule: dict[str, Any], file: str, where: str = "") -> list[str]:
    """Return what of a value is not as a schema says, a line each."""
    assert set(rule) <= WORDS, set(rule) - WORDS
    found = []
    if "$ref" in rule:
        other, _, path = rule["$ref"].partition("#")
        target = schema(other or file)
        for part in path.split("/")[1:]:
            target = target[part]
        found += wrong(value, target, other or file, where)
    if "anyOf" in rule:
        tried = [wrong(value, one, file, where) for one in rule["anyOf"]]
        found += sorted(tried, key=len)[0]
    if "enum" in rule and value not in rule["enum"]:
        found.append(f"{where}: {value!r} is none of {rule['enum']}")
    if "type" in rule and not _is(value, rule["type"]):
        return [*found, f"{where}: {value!r:.60} is no {rule['type']}"]
    if isinstance(value, dict) and ("properties" in rule or "additionalProperties" in rule):
        known, others = rule.get("properties", {}), rule.get("additionalProperties", {})
        found += [f"{where}: has no {key}" for key in rule.get("required", ()) if key not in value]
        for key, part in value.items():
            if key not in known and others is False:
                found.append(f"{where}.{key}: nobody knows it")
            else:
                found += wrong(part, known.get(key, others), file, f"{where}.{key}")
    if isinstance(value, list) and "items" in rule:
        for k, part in enumerate(value):
            found += wrong(part, rule["items"], file, f"{where}[{k}]")
    return found


def _is(value: Any, names: str | Sequence[str]) -> bool:
    wanted = [names] if isinstance(names, str) else names
    if isinstance(value, bool):
        return "boolean" in wanted
    return any(isinstance(value, TYPES[name]) for name in wanted)


def held(name: str, capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, Any]:
    """Run a command, and hold what it prints to its schema."""
    assert run([name, *arguments, "--json"]) in (0, 1), capsys.readouterr().err
    content: dict[str, Any] = json.loads(capsys.readouterr().out)
    assert wrong(content, schema(f"{name}.json"), f"{name}.json") == []
    return content


@pytest.fixture
def drift(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    body, workpiece = ExpandingBody(250.0, 11.5, 0.4), Workpiece(300.0, 23.0, "t1_C")
    declared = Declared(HeaderData(machine="VMC 3"), expansion={"fixture": body}, workpiece=workpiece)
    recordings.write(replace(small_machine(), declared=declared), tmp_path / "drift.csv")
    return "drift.csv"


def test_every_command_has_a_schema() -> None:
    assert {p.stem for p in SCHEMAS.glob("*.json")} == {*COMMANDS, "common"}


def test_the_check_finds_what_is_wrong() -> None:
    rule = schema("fit.json")
    right = {"thermocomp": "1", "arguments": [], "judging": "", "starts": [], "file": "", "trouble": [], "models": []}
    assert wrong(right, rule, "fit.json") == []
    assert wrong(right | {"more": 1}, rule, "fit.json") == [".more: nobody knows it"]
    assert wrong(right | {"trouble": [None]}, rule, "fit.json") == [".trouble[0]: None is no string"]
    assert wrong({k: v for k, v in right.items() if k != "file"}, rule, "fit.json") == [": has no file"]
    start = {"recording": "a", "start": "warm", "how_known": "", "earlier": [], "zero_degC": {"t1_C": True}}
    assert len(wrong(right | {"starts": [start]}, rule, "fit.json")) == 2


def test_models_and_their_judging(drift: str, capsys: pytest.CaptureFixture[str]) -> None:
    study = ("--target", "z_um", "--jobs", "1")
    assert held("compare", capsys, drift, *study, "--models", "ols", "mra")["results"][0]["uncertainty"]
    assert held("select", capsys, drift, *study, "--method", "partial-f")["choices"]
    assert held("fit", capsys, drift, *study, "--model", "ols", "-o", "model.json")["models"]
    assert held("plan", capsys, drift, *study)["curve"]["cycles"]
    written = held("plan", capsys, drift, *study, "--no-curve", "-o", "next.ngc")["files"]
    assert written == ["next.ngc", "next.csv", "next.png"]
    assert held("plan", capsys, drift, *study, "--running")["running"]["states"]
    assert held("assess", capsys, "model.json", drift)["results"]
    probed = held("assess", capsys, "model.json", drift, "--probing", "every 10 min")["results"]
    assert all(r["probings"]["made"] for r in probed)
    assert held("explain", capsys, "model.json")["models"][0]["sensors"]
    assert held("iso230", capsys, drift, "--model", "model.json")["thermal"]


def test_recordings(drift: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    checked = held("check", capsys, drift, "-o", "page.html")
    assert checked["page"] == "page.html"
    assert {"test", "workpiece"} <= set(checked["recordings"][0])
    assert held("simulate", capsys, "demo", "-o", "demo.parquet")["recordings"]
    assert held("run", capsys, str(small_project(tmp_path / "project")))["steps"][0]["step"] == "check"
    assert held("join", capsys, drift, drift, "--offset", "30", "-o", "joined.csv")["clocks"][0]["given"]
    assert held("simulate", capsys, "--list")["experiments"]


def test_positions_and_volume(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    laser = str(DOCS / "files" / "laser_y.csv")
    one = ("--component", "EYY", "--columns", "y_laser_*", "--model", "ols", "--jobs", "1", "--split", "0.6/0.4")
    assert held("position", capsys, laser, *one)["factors"] is not None
    named = (DOCS / "files" / "laser_y.csv").read_text(encoding="utf-8").replace("y_laser_", "EYY_")
    (tmp_path / "named.csv").write_text(named, encoding="utf-8")
    several = ("--component", "all", *one[4:])
    assert len(held("position", capsys, str(tmp_path / "named.csv"), *several)["components"]) == 1
    machine, recording = write_mill(tmp_path)
    assert held("volumetric", capsys, str(machine), "--recording", str(recording))["states"]
    assert held("iso230", capsys, "--positioning", str(DOCS / "files" / "positioning.csv"))["positioning"]


def test_a_linuxcnc(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert held("linuxcnc", capsys, "setup", str(write_linuxcnc_mill(tmp_path)))["todo"]


def test_an_export(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = held("export", capsys, "model.json", "--to", "c99", "-o", "out")
    assert (len(found["files"]), found["refused"]) == (4, {})


#: of the program of `reviseruns`
REVISION = ("part.ngc", "--model", "model.json", "--cold", "--controller", "linuxcnc", "-o", "out.ngc")


def test_a_revision(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert held("revise", capsys, *REVISION)["axes"]


def test_a_journal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    start = StartRow(1e9, (TargetRow("z_um"),), (Channel("z_um", "displacement", "um"),), "off")
    journal = Journal.open("live.db", JournalLimits(), start)
    assert held("journal", capsys, "show", "live.db")["counts"]["reading"] == 0
    for row in (ReadingRow(1e9, {"z_um": 1.0}), AlarmRow(1e9, "sensor", "stuck")):
        journal.add(row)
    journal.close()
    assert held("journal", capsys, "show", "live.db")["events"]
    assert held("journal", capsys, "export", "live.db", "-o", "out.csv")["compensation"] == "unknown"


@pytest.mark.usefixtures("interpreter")
def test_a_revision_with_its_proof(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    write_models([judged(lags("z_um"))], "model.json")
    Path("part.ngc").write_text(PLATE, encoding="ascii")
    assert held("revise", capsys, *REVISION)["proof"]


@pytest.mark.long
def test_the_demo_prints_what_compare_prints(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert held("demo", capsys, "-o", str(tmp_path / "demo"))["recommended"]


def test_papers(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    claims = (Claim(("H-16",), "It rises", "3.3", "2.5", True), Claim(("H-18",), "It falls", "", "0.4", None))
    table = StudyTable("Errors", ("model", "RMS"), [["a", "1.25"]])
    done = Study("hwang", "Title", claims, (table,), (), {"rms_um": 1.25, "unknown_um": float("nan")})
    monkeypatch.setattr(studies, "run", lambda *_, **__: done)
    assert held("papers", capsys, "hwang", "--repeats", "2")["studies"]


def test_an_error_is_the_same_for_all_commands(capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("check", "compare", "assess", "position"):
        more = {"assess": ["nowhere.csv"], "position": ["--component", "EYY"]}.get(name, ["--target", "z"])
        assert run([name, "nowhere.csv", *(more if name != "check" else []), "--json"]) == 2
        content = json.loads(capsys.readouterr().out)
        assert wrong(content, {"$ref": "common.json#/$defs/error"}, "common.json") == []


def test_the_page_tells_of_every_entry() -> None:
    told = " ".join((DOCS / "json.rst").read_text(encoding="utf-8").split())
    parts = dict(schema("common.json")["$defs"])
    del parts["error"]
    for name in COMMANDS:
        content = schema(f"{name}.json")
        parts[name] = content["anyOf"][1] if "anyOf" in content else content
    for name, part in parts.items():
        _, _, rest = told.partition(f" ``{name}`` {'~' * (len(name) + 4)} ")
        section = rest.partition("~~~")[0]
        for entry, rule in part.get("properties", {}).items():
            if entry not in ("thermocomp", "arguments"):
                assert f"* - ``{entry}`` " in section, (name, entry)
                assert rule.get("description", "") in section, (name, entry)
