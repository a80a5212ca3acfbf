"""The pages on position and volume say what the code does: keys of the machine file, command lines, components."""

import importlib.util
import re
import shlex
import shutil
from pathlib import Path

import pytest

from thermocomp.cli.app import run
from thermocomp.core.components import COMPONENTS
from thermocomp.files import machinekeys

DOCS = Path(__file__).resolve().parents[2] / "docs"
TABLES = {"The machine": machinekeys.MACHINE, "axes.X": machinekeys.AXIS, "spindle": {"measured_tool"}}


def test_every_key_of_a_machine_file_is_described_and_no_other() -> None:
    page = (DOCS / "machine_file.rst").read_text(encoding="utf-8")
    keys = page.partition("The keys\n")[2].partition(".. _instruments:")[0]
    sections = re.split(r"^(?:``\[(?=\S+\]``\n\^))?(The machine|\S+?)(?:\]``)?\n\^+\n", keys, flags=re.MULTILINE)
    described = {
        name: set(re.findall(r"^``(\w+)``$", text, re.MULTILINE))
        for name, text in zip(sections[1::2], sections[2::2], strict=True)
    }
    tables = {"axes", "spindle", "components"}
    assert described == {**{name: set(known) - tables for name, known in TABLES.items()}, "components": set()}
    assert tables < set(machinekeys.MACHINE)
    assert all(key in sections[-1] for key in machinekeys.COMPONENT)


@pytest.mark.parametrize("page", [p.name for p in sorted(DOCS.glob("*.rst")) if ".. cli-run::" in p.read_text("utf-8")])
def test_the_command_lines_of_a_page_run(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(DOCS / "files", tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)

    lines = re.findall(r"^\.\. cli-run:: (.+)$", (DOCS / page).read_text(encoding="utf-8"), re.MULTILINE)

    assert {line: run(shlex.split(line)) for line in lines} == dict.fromkeys(lines, 0)
    assert capsys.readouterr().out.strip()


def test_the_table_of_components_has_every_group() -> None:
    spec = importlib.util.spec_from_file_location("component_table", DOCS / "_ext" / "component_table.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)

    assert list(module._GROUPS) == list(dict.fromkeys(c.group for c in COMPONENTS))
