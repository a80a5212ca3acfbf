"""What all commands share: help, version, standard input, what programs read, errors."""

import io
import json
import subprocess
import sys
from pathlib import Path

import pytest
from smallmachine import small_machine

from thermocomp import __version__
from thermocomp.cli.app import COMMANDS, app, run
from thermocomp.core.plugins import read_summary
from thermocomp.recordings.readers import recordings
from thermocomp.virtual import datasets as virtual


def test_the_line_of_a_command_is_that_of_its_docstring() -> None:
    assert set(COMMANDS) == {name for name in app if not name.startswith("-")}
    for entry in COMMANDS.values():
        assert " ".join(entry.load().__doc__.split("\n\n")[0].split()) == read_summary(entry)


def test_help_loads_nothing_but_the_door() -> None:
    asked = "import sys; from thermocomp.cli.app import run; run(['--help']); print(sorted(sys.modules))"
    said = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True).stdout
    assert "assess" in said
    assert not any(f"'{heavy}'" in said for heavy in ("numpy", "pandas", "pydantic", "thermocomp.cli.compare"))


@pytest.mark.parametrize("flag", ["-V", "--version"])
def test_the_package_is_a_program(flag: str) -> None:
    said = subprocess.run([sys.executable, "-m", "thermocomp", flag], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == __version__


def test_a_recording_from_standard_input(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    recordings.write(small_machine(), tmp_path / "drift.csv")
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO((tmp_path / "drift.csv").read_bytes())))
    assert run(["check", "-", "--json"]) in (0, 1)
    said = json.loads(capsys.readouterr().out)
    assert said["thermocomp"] == __version__
    assert said["arguments"] == ["check", "-", "--json"]
    assert said["recordings"][0]["rows"] == len(small_machine())
    assert run(["check", "-", "-"]) == 2
    assert "standard input can be read only once" in capsys.readouterr().err


def test_without_a_target_all_displacements_are_predicted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recordings.write(small_machine(), tmp_path / "drift.csv")
    drift, model = str(tmp_path / "drift.csv"), str(tmp_path / "m.json")
    assert run(["fit", drift, "--model", "ols", "-o", model, "--json", "--jobs", "1"]) == 0
    assert [m["target"] for m in json.loads(capsys.readouterr().out)["models"]] == ["z_um", "x_um"]


def test_an_error_is_told_to_programs_too(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["check", "nowhere.csv", "--json"]) == 2
    said = capsys.readouterr()
    assert json.loads(said.out)["error"] in said.err


def test_the_experiments_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["simulate", "--list", "--json"]) == 0
    assert [e["name"] for e in json.loads(capsys.readouterr().out)["experiments"]] == list(virtual.EXPERIMENTS)
    assert run(["simulate", "--list"]) == 0
    assert "six thermal cycles" in capsys.readouterr().out
    assert run(["simulate", "demo"]) == 2
    assert "--list" in capsys.readouterr().err
