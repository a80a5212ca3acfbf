"""``thermocomp revise`` is told what stands at the controller: startup codes, diameters, folders of subprograms."""

import json
from pathlib import Path

import pytest
from reviseruns import revise, said

interpreter = pytest.mark.usefixtures("interpreter")

HEAD = "G21 G90 G17 G54 G94\nS4000 M3\nG0 X0 Y0 Z5\n"
DRILL = f"{HEAD}G4 P600\nG81 X10 Y0 Z-2 R1 F100\nX20\nG80\nM5\nM2\n"
LOOP = f"{HEAD}#1=0\no1 while [#1 LT 2]\nG81 X[10+#1*5] Y0 Z-2 R1 F100\n#1=[#1+1]\no1 endwhile\nG80\nM5\nM2\n"
POCKET = f"{HEAD}G64\nT1 M6\nS4000 M3\nG1 Z-1 F100\nG41 D1 X10 Y0\nX30\nY20\nX0\nG40 X-10\nG0 Z5\nM5\nM2\n"
CALL = f"{HEAD}G64\no<slot> call [7]\nM5\nM2\n"
SLOT = "o<slot> sub\nG1 Z-1 F100\nX#1\nG0 Z5\no<slot> endsub\nM2\n"


def written(text: str) -> None:
    Path("part.ngc").write_text(text, encoding="ascii")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--startup", "G7"], "--startup 'G7': startup codes may only be G61, G61.1 or G64, and G98 or G99"),
        (["--startup", "G64 P0.1", "--controller", "fanuc"], "--startup 'G64 P0.1': P and Q are tolerances"),
        (["--diameter", "1=10 mm"], "--diameter requires --expand"),
        (["--subroutines", "."], "--subroutines requires --expand"),
    ],
)
def test_what_is_told_has_to_make_sense(
    job_folder: Path, options: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    before = set(job_folder.iterdir())
    assert revise(*options) == 2
    assert message in said(capsys)
    assert set(job_folder.iterdir()) == before


@interpreter
@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--diameter", "1=10"], "write a value with its unit"),
        (["--diameter", "one=10 mm"], "--diameter 'one=10 mm': expected the number of a tool"),
        (["--subroutines", "gone"], "--subroutines gone: no such directory"),
        (["--subroutines", *["."] * 9], "found 9 folders of subprograms; the interpreter reads up to 8"),
    ],
)
def test_what_is_told_for_the_expansion_has_to_make_sense(
    job_folder: Path, options: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    before = set(job_folder.iterdir())
    assert revise("--expand", *options) == 2
    assert message in said(capsys)
    assert set(job_folder.iterdir()) == before


@pytest.mark.parametrize("proved", [False, True])
def test_where_cycles_go_back_to_can_be_told(job_folder: Path, proved: bool, request: pytest.FixtureRequest) -> None:
    """A program that says neither G98 nor G99: told, it comes out as one that says it."""
    if proved:
        request.getfixturevalue("interpreter")
    results = []
    for startup, program in (
        ("G64 P0.01 G98", DRILL),
        ("G64 G99", DRILL),
        ("", f"G98\n{DRILL}"),
        ("", f"G99\n{DRILL}"),
    ):
        written(program)
        told = ["--startup", startup] if startup else []
        assert revise(*told, "--overwrite", proved=proved) == 0
        lines = Path("out.ngc").read_text(encoding="ascii").splitlines()
        results.append([line for line in lines if line[:1] != "(" and line not in ("G98", "G99")])
    assert results[0] == results[2]
    assert results[1] == results[3]
    assert results[0] != DRILL.splitlines()


@interpreter
def test_a_loop_of_cycles_is_unrolled_as_told(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    written(LOOP)
    assert revise("--expand") == 2
    assert "part.ngc: line 6: the program cannot be written as plain lines: the end position in Z depends on" in said(
        capsys
    )
    plain = {}
    for code in ("G98", "G99"):
        options = ["--startup", f"G64 P0.01 {code}", "--tolerance", "0.1 um", "--json", "--overwrite"]
        assert revise("--expand", *options, proved=True) == 0
        assert json.loads(capsys.readouterr().out)["proof"]["moves"] >= 7
        plain[code] = Path("out.ngc.expanded").read_text(encoding="ascii").splitlines()
    assert "G21 G64 P0.01 G98" in plain["G98"]
    assert plain["G98"].count("G0 X15 Y0 Z5") == 2
    assert plain["G99"].count("G0 X15 Y0 Z5") == 0


@interpreter
def test_cutter_compensation_is_worked_out_for_diameters(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    written(POCKET)
    for options in ([], ["--diameter", "2=10 mm"]):
        assert revise("--expand", *options) == 2
        assert (
            "part.ngc: line 8: the program cannot be written as plain lines: the end position in X, Y depends on"
            in said(capsys)
        )
    assert revise("--expand", "--diameter", "1=10 mm", "T2=8 mm", proved=True) == 0
    plain = Path("out.ngc.expanded").read_text(encoding="ascii").splitlines()
    assert "G1 X25 Y15 Z-1" in plain
    assert not any("G41" in line for line in plain)


@interpreter
def test_subprograms_are_found_in_folders(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    written(CALL)
    Path("subs").mkdir()
    Path("subs/slot.ngc").write_text(SLOT, encoding="ascii")
    assert revise("--expand") == 2
    assert "part.ngc: line 5:" in said(capsys)
    assert revise("--expand", "--subroutines", "subs", proved=True) == 0
    assert any(line.startswith("G1 X7") for line in Path("out.ngc.expanded").read_text(encoding="ascii").splitlines())


@interpreter
def test_a_refusal_behind_the_expansion_names_the_line_of_the_program(
    job_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    written(LOOP.replace("G80", "G80\nG1 U2").replace("G54", "G54 G64 G98"))
    before = set(job_folder.iterdir())
    assert revise("--expand") == 2
    message = said(capsys)
    assert "part.ngc: line 10: (line " in message
    assert "U: the axes U V W are not supported" in message
    assert set(job_folder.iterdir()) == before
