"""A project is run: the same files as by the single commands, nothing twice, nothing lost."""

import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from projects import QUICK, small_project

import thermocomp as tc
from thermocomp.api.keywords import silent
from thermocomp.app import running
from thermocomp.app.project import Project
from thermocomp.app.runfolder import SILENT, RunFolder, runs_of
from thermocomp.app.running import ProjectRun, run_project
from thermocomp.cli.app import run as command
from thermocomp.core.alone import alone
from thermocomp.core.exceptions import InputError

AFTER = """
[export]
to = "nowhere"

[[assess]]
file = "files/drift.csv"
"""


def steps(folder: RunFolder) -> list[str]:
    return [step["name"] for step in folder.read()["steps"]]


def rerun(folder: Path, *, again: bool = False) -> RunFolder:
    return run_project(Project(folder), silent, again=again).folder


def change(folder: Path, before: str, after: str) -> None:
    file = folder / "project.toml"
    text = file.read_text(encoding="utf-8")
    assert before in text
    file.write_text(text.replace(before, after), encoding="utf-8")


def test_the_model_is_that_of_fit(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = small_project(tmp_path / "project")
    assert command(["run", str(folder)]) == 1  # robustness = false accepts nothing
    assert f"Written: {folder / 'runs' / '1'}" in capsys.readouterr().out
    fitted = tc.fit(folder / "files" / "drift.csv", "z_um", "ols", jobs=1)
    compared = tc.compare(folder / "files" / "drift.csv", "z_um", ["ols"], robustness=False, jobs=1)
    compared.fit().save(tmp_path / "compared.json")
    assert (folder / "runs" / "1" / "model.json").read_bytes() == (tmp_path / "compared.json").read_bytes()
    change(folder, "robustness = false\n", "")
    second = rerun(folder)
    fitted.save(tmp_path / "fitted.json")
    assert (second.path / "model.json").read_bytes() == (tmp_path / "fitted.json").read_bytes()
    assert {"check.html", "comparison.html", "compare.json", "fit.json", "project.toml"} <= {
        p.name for p in second.path.iterdir()
    }


def test_what_has_not_changed_is_not_done_again(tmp_path: Path) -> None:
    folder = small_project(tmp_path / "project")
    first = rerun(folder)
    written = (first.path / "model.json").stat().st_mtime_ns
    assert rerun(folder).number == 1
    change(folder, "Small machine", "Another name")
    assert rerun(folder).number == 1
    assert (first.path / "model.json").stat().st_mtime_ns == written
    assert rerun(folder, again=True).number == 2
    change(folder, '["ols"]', '["ridge"]')
    assert rerun(folder).number == 3
    drift = folder / "files" / "drift.csv"
    drift.write_text("\n".join(drift.read_text(encoding="utf-8").splitlines()[:-3]) + "\n", encoding="utf-8")
    assert rerun(folder).number == 4
    assert [r.number for r in runs_of(folder)] == [1, 2, 3, 4]
    assert 'models = ["ridge"]' in (folder / "runs" / "3" / "project.toml").read_text(encoding="utf-8")


def test_an_export_is_added_to_its_run(tmp_path: Path) -> None:
    folder = small_project(tmp_path / "project")
    rerun(folder)
    for to, names in (("c99", ["export-c99"]), ("st", ["export-c99", "export-st"])):
        if to == "c99":
            (folder / "project.toml").write_text(QUICK + '\n[export]\nto = "c99"\n', encoding="utf-8")
        else:
            change(folder, '"c99"', '"st"')
        found = rerun(folder)
        assert found.number == 1
        assert sorted(p.name for p in found.path.iterdir() if p.is_dir()) == names
    assert steps(found) == ["check", "compare", "fit", "export", "export"]
    change(folder, 'to = "st"', 'to = "st"\nname = "mill"')
    assert (rerun(folder).path / "export-st-2" / "tc_mill.st").exists()


def test_a_stopped_run_goes_on_where_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = small_project(tmp_path / "project", QUICK + '\n[export]\nto = "c99"\n')

    def stop(_: ProjectRun) -> tuple[list[str], str]:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(ProjectRun, "_export", stop)
        with pytest.raises(KeyboardInterrupt):
            rerun(folder)
    (run,) = runs_of(folder)
    assert (run.read()["state"], steps(run)) == ("stopped", ["check", "compare", "fit"])
    monkeypatch.setattr(running, "compare", lambda *_, **__: pytest.fail("it was compared again"))
    assert rerun(folder).number == 1
    assert (run.read()["state"], steps(run)) == ("done", ["check", "compare", "fit", "export"])


def test_what_fails_says_why_and_stays(tmp_path: Path) -> None:
    folder = small_project(tmp_path / "project", QUICK.replace("z_um", "nothing_um"))
    with pytest.raises(InputError, match="nothing_um"):
        rerun(folder)
    (run,) = runs_of(folder)
    assert run.read()["state"] == "failed"
    assert "nothing_um" in run.read()["error"]
    change(folder, "nothing_um", "z_um")
    assert rerun(folder).number == 2


def test_a_failed_export_keeps_the_model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = small_project(
        tmp_path / "project", QUICK + '\n[export]\nto = "nowhere"\n\n[[assess]]\nfile = "files/drift.csv"\n'
    )
    run = rerun(folder)
    assert (run.read()["state"], steps(run)) == ("done", ["check", "compare", "fit", "export", "assess"])
    (failed,) = run.errors()
    assert failed.startswith("export: --to 'nowhere': no such target")
    assert rerun(folder).errors() == [failed]
    assert [p.name for p in run.path.glob("assessment*.html")] == ["assessment.html"], "it was assessed again"
    change(folder, "nowhere", "c99")
    monkeypatch.setattr(running, "compare", lambda *_, **__: pytest.fail("it was compared again"))
    assert rerun(folder).number == 1
    assert (run.read()["state"], run.errors(), sorted(steps(run))) == (
        "done",
        [],
        ["assess", "check", "compare", "export", "fit"],
    )


def test_the_models_of_an_earlier_run_are_exported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = small_project(tmp_path / "project")
    first = rerun(folder)
    before = (first.path / "model.json").read_bytes()
    change(folder, 'models = ["ols"]', 'models = ["partial-f"]')
    second = rerun(folder)
    assert second.number == 2
    change(folder, "[compare]", '[export]\nto = "c99"\n\n[compare]')
    with monkeypatch.context() as patched:
        patched.setattr(running, "compare", lambda *_, **__: pytest.fail("it was compared again"))
        run = run_project(Project(folder), silent, number=1).folder
    assert (run.number, steps(run)[-1], (first.path / "model.json").read_bytes()) == (1, "export", before)
    assert "partial-f" not in (first.path / "project.toml").read_text(encoding="utf-8")
    assert "export" not in steps(second)
    assert rerun(folder).number == 2, "the project itself goes on with its last run"
    with pytest.raises(InputError, match="there is no run 7"):
        run_project(Project(folder), silent, number=7)
    drift = folder / "files" / "drift.csv"
    drift.write_bytes(drift.read_bytes() + b"\n")
    with pytest.raises(InputError, match="since this run a recording, a mapping or the version"):
        run_project(Project(folder), silent, number=1)


def test_a_reduced_model_has_no_other_inputs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither the model for a simple controller, nor the full model that it is compared with."""
    folder = small_project(tmp_path / "project", QUICK + '\n[export]\nto = "fanuc"\n')
    change(folder, "robustness", 'inputs = ["t2_C", "spindle_rpm"]\nrobustness')
    given = list[Any]()

    def reduce(model: Path, to: str, recordings: list[Any], **options: Any) -> Any:
        given.extend(recordings)
        return tc.export(model, to, recordings, **options)

    monkeypatch.setattr(running, "export", reduce)
    rerun(folder)
    assert [[c.name for c in r.temperatures] for r in given] == [["t2_C"]]
    assert [c.name for c in given[0].displacements] == ["z_um", "x_um"]


def test_an_earlier_run_is_not_planned_again(tmp_path: Path) -> None:
    folder = small_project(tmp_path / "project")
    rerun(folder)
    change(folder, "[compare]", '[select]\nmax_sensors = 1\n\n[export]\nto = "c99"\n\n[compare]')
    run = run_project(Project(folder), silent, number=1).folder
    assert steps(run) == ["check", "compare", "fit", "export"]
    assert steps(rerun(folder)) == ["check", "compare", "fit", "export", "select"]


def test_a_file_that_changes_meanwhile_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = small_project(tmp_path / "project")
    drift = folder / "files" / "drift.csv"

    def changing(*args: Any, **given: Any) -> Any:
        drift.write_bytes(drift.read_bytes() + b"\n")
        return tc.compare(*args, **given)

    monkeypatch.setattr(running, "compare", changing)
    with pytest.raises(InputError, match="changed during the run"):
        rerun(folder)
    assert not (folder / "runs" / "1" / "model.json").exists()


def test_a_run_is_for_one_process(tmp_path: Path) -> None:
    folder = small_project(tmp_path / "project")
    run = rerun(folder)
    change(folder, "[compare]", '[export]\nto = "c99"\n\n[compare]')
    with alone(run.path / "run.json"), pytest.raises(InputError, match="another thermocomp process"):
        rerun(folder)
    assert run.read()["state"] == "done"
    assert steps(rerun(folder))[-1] == "export"


def test_a_killed_run_is_told_from_one_that_goes_on(tmp_path: Path) -> None:
    folder = small_project(tmp_path / "project")
    run = rerun(folder)
    state = json.loads((run.path / "run.json").read_text(encoding="utf-8"))
    state |= {"state": "running", "seen": time.time(), "steps": state["steps"][:1]}
    (run.path / "run.json").write_text(json.dumps(state), encoding="utf-8")
    with pytest.raises(InputError, match="going on in another process"):
        rerun(folder)
    state["seen"] -= SILENT + 1.0
    (run.path / "run.json").write_text(json.dumps(state), encoding="utf-8")
    assert run.read()["state"] == "stopped"
    assert "without a word" in run.read()["error"]
    assert steps(rerun(folder)) == ["check", "compare", "fit"]
    (run.path / "run.json").unlink()  # killed before its first state
    assert run.read()["state"] == "stopped"
    assert rerun(folder).number == 2


#: a run in a process of its own whose comparison takes long
SLOW = """
import signal, sys, time
signal.signal(signal.SIGINT, signal.SIG_IGN if sys.argv[2] == "background" else signal.default_int_handler)
from thermocomp.app import running
from thermocomp.cli.app import run
running.compare = lambda *_, **__: time.sleep(300.0)
sys.exit(run(["run", sys.argv[1]]))
"""


@pytest.mark.parametrize("started", ["foreground", "background"])
def test_a_run_obeys(tmp_path: Path, started: str) -> None:
    """Asked to stop by a file, as the page does; a shell lets what it starts in the background ignore interrupts."""
    folder = small_project(tmp_path / "project")
    words = [sys.executable, "-c", SLOW, str(folder), started]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        try:
            until = time.monotonic() + 120.0
            while not ((found := runs_of(folder)) and found[0].read()["step"] == "compare"):
                assert time.monotonic() < until, "it never began to compare"
                assert process.poll() is None
                time.sleep(0.05)
            found[0].ask_to_stop()
            assert process.wait(60.0) == 130
        finally:
            process.kill()
    state = found[0].read()
    assert (state["state"], [s["name"] for s in state["steps"]]) == ("stopped", ["check"])
    assert not (found[0].path / "stop").exists()


def test_other_recordings_are_assessed(tmp_path: Path) -> None:
    folder = small_project(tmp_path / "project", QUICK + '\n[[assess]]\nfile = "files/drift.csv"\n')
    run = rerun(folder)
    assert steps(run)[-1] == "assess"
    assert (run.path / "assessment.html").exists()


def test_two_loggers_are_joined(tmp_path: Path) -> None:
    folder = small_project(tmp_path / "project", QUICK + "\n[join]\noffset = [0.0]\n")
    table = tc.read(folder / "files" / "drift.csv").to_frame()
    probes = [c for c in table.columns if c.endswith("_um")]
    table.drop(columns=probes).to_csv(folder / "files" / "drift.csv", index=False)
    table[["time_s", *probes]].to_csv(folder / "files" / "probes.csv", index=False)
    change(folder, "\n[compare]", '\n[[recordings]]\nfile = "files/probes.csv"\n\n[compare]')
    run = rerun(folder)
    assert steps(run)[0] == "join"
    assert (run.path / "joined.parquet").exists()
    assert tc.compare(run.path / "joined.parquet", "z_um", ["ols"], robustness=False, jobs=1).best


@pytest.mark.parametrize(
    ("before", "after", "says"),
    [
        ('models = ["ols"]', 'model = ["ols"]', r"compare\.model: this key does not exist"),
        ('models = ["ols"]', 'targets_ = "z"', r"compare\.targets_: this key does not exist"),
        ("jobs = 1", 'jobs = "1"', r"compare\.jobs = '1'"),
        ("jobs = 1", 'leave_one = "week"', r"compare\.leave_one = 'week'"),
        ('file = "files/drift.csv"', 'mapping = "x.toml"', r"recordings\.0\.file: this key is missing"),
        ('file = "files/drift.csv"', 'file = "../drift.csv"', "not in the project's folder"),
        ('file = "files/drift.csv"', 'file = "files/other.csv"', r"other\.csv: the file cannot be read"),
        ('[[recordings]]\nfile = "files/drift.csv"', "", r"names no recording: add a table \[\[recordings\]\]"),
        ("[compare]", "[export]\n[compare]", r"export\.to: this key is missing"),
        ("[compare]", "[compare", "not valid TOML"),
    ],
)
def test_settings_that_cannot_be_used(
    tmp_path: Path, before: str, after: str, says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = small_project(tmp_path / "project")
    change(folder, before, after)
    with pytest.raises(InputError, match=says):
        rerun(folder)
    assert command(["run", str(folder / "project.toml")]) == 2
    assert "project.toml" in capsys.readouterr().err


def test_json_has_the_state(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = small_project(tmp_path / "project")
    assert command(["run", str(folder), "--json"]) == 1
    said = json.loads(capsys.readouterr().out)
    assert said["folder"] == str(folder / "runs" / "1")
    assert [s["step"] for s in said["steps"]] == ["check", "compare", "fit"]
