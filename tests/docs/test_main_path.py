"""`examples/main_path.py` runs, and the files it names are there."""

import asyncio
import re
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "examples" / "main_path.py"


def test_it_takes_a_machine_from_recordings_to_corrections(capsys: pytest.CaptureFixture[str]) -> None:
    left = asyncio.run(runpy.run_path(str(EXAMPLE))["main"]())
    told = capsys.readouterr().out
    assert "Use ols for s1_um" in told
    assert 5.0 < left < 40.0  # of 160 um, um


def test_the_files_it_names_are_there() -> None:
    text = EXAMPLE.read_text(encoding="utf-8")
    named = re.findall(r"[a-z0-9_/]+/[a-z0-9_]+\.py", text.partition('"""\n')[2])
    assert len(named) > 10
    for name in named:
        assert (ROOT / "src" / "thermocomp" / name).is_file(), name
    assert len(text.splitlines()) <= 45
