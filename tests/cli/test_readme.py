"""The README shows what the commands really print."""

import re
import shlex
from pathlib import Path

import pytest

from thermocomp.cli.app import app, run

README = Path(__file__).parents[2] / "README.md"


def blocks() -> list[list[str]]:
    """Return the lines of each ```text block."""
    return [b.strip("\n").split("\n") for b in re.findall(r"```text\n(.*?)```", README.read_text("utf-8"), re.DOTALL)]


def assert_printed(shown: list[str], output: str) -> None:
    """Every shown line was printed, in this order; ``...`` stands for lines left out."""
    lines = iter(line.rstrip() for line in output.split("\n"))
    for line in shown:
        if line != "...":
            assert line.rstrip() in lines, f"the README shows a line that is not printed there: {line}"


def test_the_demo_prints_what_the_readme_shows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    assert run(["demo", "--output", "demo"]) == 0
    assert_printed(blocks()[0], capsys.readouterr().out)
    assert sorted(p.name for p in Path("demo").iterdir()) == ["model.json", "recording.parquet", "report.html"]
    assert run(["demo", "--output", "demo"]) == 2
    assert "exists already" in capsys.readouterr().err


def test_python_prints_what_the_readme_shows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (program,) = re.findall(r"```python\n(.*?)```", README.read_text("utf-8"), re.DOTALL)
    exec(compile(program, "README.md", "exec"), {})
    assert_printed(blocks()[1], capsys.readouterr().out)
    assert sorted(p.name for p in Path().iterdir()) == ["model.json", "report.html"]


def test_the_real_machine_prints_what_the_readme_shows(
    shared_data: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    recording = str(shared_data / "fl_thermal" / "recording.csv")
    assert run(["compare", recording, "--target", "ch1_um", "ch2_um", "--models", "mra", "dynamic"]) == 0
    assert_printed(blocks()[3], capsys.readouterr().out)


@pytest.mark.usefixtures("interpreter")
def test_the_revision_prints_what_the_readme_shows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    shown = README.read_text("utf-8")
    wanted = r"^    thermocomp ((?:simulate precomp|fit test-1|revise).*?)(?: +#.*)?$"
    commands = re.findall(wanted, shown, re.MULTILINE)
    assert len(commands) == 3
    Path("plate.ngc").write_bytes((README.parent / "docs" / "files" / "plate.ngc").read_bytes())
    for command in commands:
        assert run(shlex.split(command)) == 0
    assert_printed(blocks()[6], capsys.readouterr().out)


def test_the_study_prints_what_the_readme_shows(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    assert run(["papers", "hwang"]) == 0
    assert_printed(blocks()[4], capsys.readouterr().out)


def test_commands_of_the_readme_exist() -> None:
    text = README.read_text("utf-8")
    for name in re.findall(r"^ +thermocomp (\S+)", text, re.MULTILINE):
        assert name in list(app)
    for target in re.findall(r"^ +make (\w+)", text, re.MULTILINE):
        assert re.search(rf"^{target}:", (README.parent / "Makefile").read_text("utf-8"), re.MULTILINE)
