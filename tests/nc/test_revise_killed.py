"""What a killed run of ``thermocomp revise`` leaves, the next one in that folder clears away."""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest
from reviseruns import revise

CODE = "import sys\nfrom thermocomp.cli.app import run\nsys.exit(run(sys.argv[1:]))"
OPTIONS = ["--model", "model.json", "--cold", "--unproved", "--controller", "linuxcnc"]


def started(program: str, out: str) -> subprocess.Popen[bytes]:
    """A run that has begun to write."""
    there = set(hidden())
    run = subprocess.Popen(
        [sys.executable, "-c", CODE, "revise", program, *OPTIONS, "-o", out], stdout=subprocess.DEVNULL
    )
    while not any((folder / "program").exists() for folder in set(hidden()) - there):
        assert run.poll() is None
        time.sleep(0.02)
    return run


def hidden() -> list[Path]:
    return sorted(p for p in Path().iterdir() if p.name.startswith("."))


@pytest.mark.long
def test_the_next_run_clears_away_what_a_killed_one_has_left(job_folder: Path) -> None:
    head = "G21 G90 G17 G54 G94\nS4000 M3\nG0 X0 Y0 Z5\nG1 Z-1 F50\n"
    Path("long.ngc").write_text(head + "X1\nX0\n" * 20_000 + "M2\n", encoding="ascii")
    killed = started("long.ngc", "a.ngc")
    living = started("long.ngc", "b.ngc")
    try:
        assert len(hidden()) == 2
        killed.kill()
        killed.wait()
        assert len(hidden()) == 2
        assert revise() == 0
        assert living.poll() is None
        (left,) = hidden()
        assert (left / "program").exists()
        assert living.wait() == 0
    finally:
        for run in (killed, living):
            run.kill()
            run.wait()
    assert hidden() == []
    assert Path("b.ngc").exists()
    assert not Path("a.ngc").exists()


@pytest.mark.usefixtures("interpreter")
def test_the_interpreter_s_folder_goes_too(job_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    temporary = job_folder / "tmp"
    temporary.mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    code = "import sys, time\nfrom pathlib import Path\nfrom thermocomp.nc.linuxcnc.rs274 import read\n"
    code += "calls = read(Path(sys.argv[1]))\nnext(calls)\nprint('begun', flush=True)\ntime.sleep(60)\n"
    with subprocess.Popen([sys.executable, "-c", code, "part.ngc"], stdout=subprocess.PIPE, text=True) as killed:
        assert killed.stdout is not None
        assert killed.stdout.readline() == "begun\n"
        killed.kill()
    assert len(list(temporary.iterdir())) == 1
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    assert revise(proved=True) == 0
    assert not list(temporary.iterdir())
