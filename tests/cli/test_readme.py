"""README and docs show what the commands really print."""

import re
import shlex
import subprocess
from pathlib import Path

import pytest

from thermocomp.cli.app import app, run

ROOT = Path(__file__).parents[2]
README = ROOT / "README.md"


def blocks() -> list[list[str]]:
    """Return the lines of each ```text block of the README."""
    return [b.strip("\n").split("\n") for b in re.findall(r"```text\n(.*?)```", README.read_text("utf-8"), re.DOTALL)]


def page_blocks(name: str) -> list[list[str]]:
    """Return the lines of each block of text of a page of the docs."""
    found = re.findall(r"code-block:: text\n\n((?:(?:   .*)?\n)+)", (ROOT / "docs" / name).read_text("utf-8"))
    return [[line[3:] for line in block.rstrip("\n").split("\n")] for block in found]


def assert_printed(shown: list[str], output: str) -> None:
    """Every shown line was printed, in this order; ``...`` stands for lines left out."""
    lines = iter(line.rstrip() for line in output.split("\n"))
    for line in shown:
        if line != "...":
            assert line.rstrip() in lines, f"the README shows a line that is not printed there: {line}"


@pytest.mark.long
def test_the_demo_prints_what_the_readme_shows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    assert run(["demo", "--output", "demo"]) == 0
    printed = capsys.readouterr().out
    assert_printed(blocks()[0], printed)
    assert_printed(page_blocks("demo.rst")[0], printed)
    assert sorted(p.name for p in Path("demo").iterdir()) == ["model.json", "recording.parquet", "report.html"]
    assert run(["demo", "--output", "demo"]) == 2
    assert "exists already" in capsys.readouterr().err


@pytest.mark.long
def test_python_prints_what_the_readme_shows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (program,) = re.findall(r"```python\n(.*?)```", README.read_text("utf-8"), re.DOTALL)
    exec(compile(program, "README.md", "exec"), {})
    assert_printed(blocks()[1], capsys.readouterr().out)
    assert sorted(p.name for p in Path().iterdir()) == ["model.json", "report.html"]


@pytest.mark.long
def test_the_readme_revises_a_program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = README.read_text("utf-8")
    for begin in ("thermocomp simulate demo -o", "thermocomp fit .*speed.json", "printf", "thermocomp revise"):
        (line,) = re.findall(rf"^    ({begin}.*)$", text, re.MULTILINE)
        if line.startswith("printf"):
            subprocess.run(["/bin/sh", "-c", line], check=True)
        else:
            assert run(shlex.split(line, comments=True)[1:]) == 0, line
    assert "Y19.99" in Path("revised.ngc").read_text("ascii")


@pytest.mark.long
def test_the_real_machine_prints_what_its_page_shows(
    shared_data: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    recording = str(shared_data / "fl_thermal" / "recording.csv")
    assert run(["compare", recording, "--target", "ch1_um", "ch2_um", "--models", "mra", "dynamic", "--details"]) == 0
    assert_printed(page_blocks("real_machine.rst")[1], capsys.readouterr().out)


def test_the_readme_is_short_and_its_table_is_that_of_the_page() -> None:
    assert len(README.read_bytes()) <= 8_000
    assert set(blocks()[2]) <= set(page_blocks("real_machine.rst")[0])


def test_commands_of_the_readme_exist() -> None:
    text = README.read_text("utf-8")
    for name in re.findall(r"^ +thermocomp (\S+)", text, re.MULTILINE):
        assert name in list(app)
    for target in re.findall(r"^ +make (\w+)", text, re.MULTILINE):
        assert re.search(rf"^{target}:", (ROOT / "Makefile").read_text("utf-8"), re.MULTILINE)
