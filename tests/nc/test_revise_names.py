"""No name of a file gets out of its comment, line, column or title, whatever it holds."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from driftmodels import lags
from reviseruns import PLATE, judged, revise, table, without_header, write_models

from thermocomp.nc.rewrite.header import MARK, WIDTH, fill, make_blank, wrap_text

ENDINGS = ["\n", "\r", "\r\n", "\x0b", "\x0c", "\x1c", "\x1d", "\x1e", "\x85", "\u2028", "\u2029"]
NASTY = [
    *(f"a{end}G0 Z-50 (x" for end in ENDINGS),
    "a)G0 Z-50(",
    "a%",
    "a;G0 Z-50",
    "a\x1b[31m[red]$_{",
    "a\udcff\u0416",
]
LINE = re.compile(rf"\({MARK} [ !-$&'*-:<-~]*\)")  # no ( ) % ;


@pytest.mark.parametrize("name", NASTY)
@pytest.mark.parametrize("upper", [False, True])
def test_a_header_is_plain_comments(name: str, upper: bool) -> None:
    facts = [f"program {name}", name * 40, *wrap_text(name * 20, 2)]
    lines = fill(facts, "\r\n", 9, upper=upper)
    assert len(lines) == len(make_blank("\r\n", 9)) == 9
    for line in lines:
        assert line.endswith("\r\n")
        text = line.removesuffix("\r\n")
        assert LINE.fullmatch(text), text
        assert len(text) <= WIDTH
        assert not upper or text == text.upper()


@pytest.mark.parametrize("name", NASTY)
def test_a_name_changes_nothing_but_its_mention(
    name: str, job_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert revise("--date", "2026-01-31") == 0
    plain = {end: Path(f"out.ngc{end}").read_bytes() for end in (".csv", ".job.json")}
    body = without_header("out.ngc")
    shutil.copy("part.ngc", f"{name}.ngc")
    write_models([judged(lags("z_um"))], f"{name}.json")
    capsys.readouterr()
    assert revise("--model", f"{name}.json", "--date", "2026-01-31", program=f"{name}.ngc", out=f"out{name}") == 0
    printed = capsys.readouterr().out
    assert all(c.isprintable() for c in printed.replace("\n", ""))
    assert sum("\u2501" in line for line in printed.splitlines()) == 2  # lines of the table
    assert without_header(f"out{name}") == body
    header = [line for line in Path(f"out{name}").read_bytes().split(b"\n") if MARK.encode() in line]
    assert all(LINE.fullmatch(line.decode("ascii")) for line in header)
    assert {end: Path(f"out{name}{end}").read_bytes() for end in plain} == plain
    difference = Path(f"out{name}.diff").read_bytes().split(b"\n")
    assert [line[:3] for line in difference[:3]] == [b"---", b"+++", b"@@ "]
    assert all(b" " <= bytes([c]) <= b"~" for line in difference[:2] for c in line)
    assert len(table(f"out{name}.csv")) == PLATE.count("\n")


def test_numbers_for_programs_name_any_file(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copy("part.ngc", "a\udcff\n\u0416.ngc")
    assert revise("--json", program="a\udcff\n\u0416.ngc") == 0
    assert json.loads(capsys.readouterr().out)["program"] == "a\udcff\n\u0416.ngc"


@pytest.mark.usefixtures("interpreter")
def test_the_interpreter_sees_comments_only(job_folder: Path) -> None:
    name = "a\nG0 Z-50 (x)\r"
    shutil.copy("part.ngc", name)
    write_models([judged(lags("z_um"))], "m\nG0 Z-50.json")
    assert revise("--model", "m\nG0 Z-50.json", program=name, proved=True) == 0
    assert b"\nG0 Z-50" not in Path("out.ngc").read_bytes()


@pytest.mark.skipif(shutil.which("patch") is None, reason="the tool patch is not installed")
@pytest.mark.parametrize("name", ["a\nb", "a\tb c", 'a"b\\', "\u0416"])
def test_the_diff_of_any_name_makes_the_revised_program(job_folder: Path, name: str) -> None:
    shutil.copy("part.ngc", name)
    assert revise(program=name, out=f"out {name}") == 0
    shutil.copy(name, "patched")
    with Path(f"out {name}.diff").open("rb") as given:
        subprocess.run(["patch", "--binary", "-s", "-F0", "patched"], stdin=given, check=True)
    assert Path("patched").read_bytes() == Path(f"out {name}").read_bytes()


def test_the_picture_has_any_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_models([judged(lags("z_um"))], "model.json")
    name = "a\n\x1c$_{^$\\frac\x85.ngc"
    Path(name).write_text(PLATE, encoding="ascii")
    assert revise(program=name) == 0
    assert Path("out.ngc.png").read_bytes().startswith(b"\x89PNG")


def test_an_error_names_any_file(job_folder: Path) -> None:
    code = "import sys\nfrom thermocomp.cli.app import run\nsys.exit(run(sys.argv[1:]))"
    options = ["--model", "model.json", "--cold", "--unproved", "-o", "out.ngc"]
    for name in (b"gone\x1b[31m\nx.ngc", b"\xff.ngc"):
        command = [sys.executable.encode(), b"-c", code.encode(), b"revise", name, *(o.encode() for o in options)]
        done = subprocess.run(command, capture_output=True, check=False)
        assert done.returncode == 2
        assert b"Traceback" not in done.stderr
        assert b"no such file" in done.stderr
        assert b"\x1b[31m" not in done.stderr
