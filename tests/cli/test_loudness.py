"""``--quiet`` and ``--verbose``: one place for all commands; what stands on stdout is the same."""

import json
from pathlib import Path

import numpy as np
import pytest
from smallmachine import small_machine

from thermocomp.cli import progress
from thermocomp.cli.app import run
from thermocomp.recordings.readers import mending


@pytest.fixture
def stuck(tmp_path: Path) -> str:
    """A recording with trouble: a value is missing for long."""
    made = small_machine()
    table = made.table.copy()
    table.loc[100:300, "t2_C"] = np.nan
    path = tmp_path / "drift.csv"
    table.insert(0, "time_s", made.time)
    table.to_csv(path, index=False)
    return str(path)


def fitted(stuck: str, *flags: str) -> list[str]:
    model = str(Path(stuck).with_name("model.json"))
    return ["fit", stuck, "--target", "z_um", "--model", "ols", "--jobs", "1", "-o", model, "--overwrite", *flags]


def test_quiet_leaves_stdout_as_it_is_and_nothing_on_stderr(
    stuck: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(progress, "OFTEN", 0.0)
    code = run(fitted(stuck))
    usual = capsys.readouterr()
    assert "trouble" in usual.err
    assert " of " in usual.err
    assert run(fitted(stuck, "--quiet")) == code
    assert capsys.readouterr() == (usual.out, "")
    assert run(["--quiet", *fitted(stuck)]) == code
    assert capsys.readouterr() == (usual.out, "")


def test_quiet_work_still_tells_errors(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["check", "nowhere.csv", "--quiet"]) == 2
    assert "nowhere.csv" in capsys.readouterr().err


@pytest.mark.parametrize("front", [True, False])
def test_verbose_tells_what_is_read_and_done_and_how_long_it_took(
    front: bool, stuck: str, capsys: pytest.CaptureFixture[str]
) -> None:
    code = run(fitted(stuck))
    usual = capsys.readouterr().out
    assert run(["--verbose", *fitted(stuck)] if front else fitted(stuck, "--verbose")) == code
    said = capsys.readouterr()
    assert said.out == usual
    lines = said.err.splitlines()
    assert lines[0] == f"read {stuck}: 800 rows, 6 columns"
    assert any(line.startswith("trouble") for line in lines)
    assert any(line.startswith("z_um ols") and line.endswith("1 of 4") for line in lines)
    assert lines[-1].startswith("took ")


def test_a_flag_holds_for_one_command_line(stuck: str, capsys: pytest.CaptureFixture[str]) -> None:
    run(["check", stuck, "--verbose"])
    assert "took" in capsys.readouterr().err
    run(["check", stuck])
    assert "took" not in capsys.readouterr().err


def test_programs_see_the_flag_among_the_arguments(stuck: str, capsys: pytest.CaptureFixture[str]) -> None:
    run(["check", stuck, "--json", "--quiet"])
    assert json.loads(capsys.readouterr().out)["arguments"] == ["check", stuck, "--json", "--quiet"]


def test_both_flags_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--quiet", "check", "x.csv", "--verbose"]) == 2
    assert "exclude each other" in capsys.readouterr().err


def test_help_names_the_flags_once(capsys: pytest.CaptureFixture[str]) -> None:
    run(["--help"])
    said = capsys.readouterr().out
    assert said.count("--quiet") == said.count("--verbose") == 1
    run(["check", "--help"])
    assert "--quiet" not in capsys.readouterr().out


def test_an_unexpected_error_is_one_line_and_verbose_tells_where(
    stuck: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(*_: object) -> None:
        raise ZeroDivisionError("by [zero]")

    monkeypatch.setattr(mending, "read_or_offer", broken)
    assert run(["check", stuck, "--json"]) == 3
    said = capsys.readouterr()
    assert "unexpected: ZeroDivisionError: by [zero]" in said.err
    assert "Traceback" not in said.err
    assert json.loads(said.out)["error"] == "unexpected: ZeroDivisionError: by [zero]"
    assert run(["check", stuck, "--verbose"]) == 3
    assert "in broken" in capsys.readouterr().err


def test_words_that_no_command_takes_are_told_to_programs_too(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        run(["check", "x.csv", "--nope", "--json"])
    assert stop.value.code == 2
    assert "--nope" in json.loads(capsys.readouterr().out)["error"]
