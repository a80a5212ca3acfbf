"""What the interpreter may read for an expansion: no loop for ever, and no file outside the given folders."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from thermocomp.core.exceptions import ProgramError
from thermocomp.nc.linuxcnc import rs274
from thermocomp.nc.linuxcnc.expansion.expand import expand

pytestmark = pytest.mark.usefixtures("interpreter")

HEAD = "G21 G90 G64 P0.01\nS100 M3\nG0 X0\n"
SUB = "o<sub> sub\nG1 X5 F100\no<sub> endsub\nM2\n"
Refusal = Callable[..., ProgramError]


@pytest.fixture
def refusal(tmp_path: Path) -> Refusal:
    """Return the error of an expansion."""

    def refusal(text: str, **options: list[Path]) -> ProgramError:
        folder = tmp_path / "programs"
        folder.mkdir(exist_ok=True)
        (folder / "part.ngc").write_text(text, encoding="ascii")
        with pytest.raises(ProgramError) as found:
            expand(folder / "part.ngc", tmp_path / "plain.ngc", inch=False, **options)  # type: ignore[arg-type]
        assert not (tmp_path / "plain.ngc").exists()
        return found.value

    return refusal


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("#1=0\no100 while [1]\n#1=[#1+1]\no100 endwhile\n", 5),
        ("#1=0\no1 do\n#1=[#1+1]\no1 while [#1 GT 0]\n", 5),
        ("o1 repeat [1000000000]\n#1=1\no1 endrepeat\n", 4),
        ("o1 while [1]\no2 if [1]\n(DEBUG,hello)\no2 endif\no1 endwhile\n", 4),
        ("o1 while [1]\no2 repeat [3]\n#1=1\no2 endrepeat\no1 continue\no1 endwhile\n", 4),
        ("o1 sub\no2 repeat [2]\n#2=1\no2 endrepeat\no1 endsub\no3 while [1]\no1 call\no3 endwhile\n", 9),
    ],
)
def test_a_loop_that_does_nothing_is_refused(refusal: Refusal, text: str, line: int) -> None:
    error = refusal(f"{HEAD}{text}M30\n")
    assert (error.line, "without a move of an axis" in error.reason) == (line, True)
    assert "seems to have no end; write a condition that becomes false" in error.reason


@pytest.mark.parametrize(
    "inner",
    [
        "G10 L2 P1 X0",
        "S3000 M3\nM5",
        "G90\nF100",
        "G4 P0.1",
        "G0 X0",
        "T1 M6",
        "o<sub> call",
    ],
)
def test_what_moves_no_axis_keeps_no_loop_alive(refusal: Refusal, tmp_path: Path, inner: str) -> None:
    (tmp_path / "programs").mkdir()
    (tmp_path / "programs" / "sub.ngc").write_text(SUB.replace("G1 X5 F100", "#2=1"), encoding="ascii")
    error = refusal(f"{HEAD}#1=0\no1 while [#1 GE 0]\n{inner}\no1 endwhile\nM30\n")
    assert (error.line, "without a move of an axis" in error.reason) == (5, True)


def test_a_loop_without_end_that_moves_is_refused(refusal: Refusal) -> None:
    error = refusal(f"{HEAD}#1=0\no1 while [#1 GE 0]\nG1 X#1 F100\n#1=[#1+1]\no1 endwhile\nM30\n")
    assert (error.line, "more than 1,200,000 lines" in error.reason) == (5, True)


def test_lines_without_a_move_are_run_if_they_end(tmp_path: Path) -> None:
    """More than a loop may have, once each; and in loops with a full circle, or a move, now and then."""
    path = tmp_path / "still.ngc"
    still = "o1 repeat [4]\nG2 I1 F100\no2 repeat [50000]\n#1=1\no2 endrepeat\nG1 X#1\nG1 X0\no1 endrepeat\n"
    path.write_text(HEAD + "F100\n" * 310_000 + f"{still}M30\n", encoding="ascii")
    assert [call.kind for call in rs274.read(path) if call.kind in ("arc", "feed")] == ["arc", "feed", "feed"] * 4


def test_a_subprogram_that_calls_itself_is_refused(refusal: Refusal) -> None:
    error = refusal(f"o<r> sub\no<r> call\no<r> endsub\n{HEAD}o<r> call\nM30\n")
    assert "a subprogram that calls itself does not end" in error.reason


@pytest.mark.parametrize(
    "text",
    [
        "G81 X1. Z-1. R1. L999999999 F100.",
        "G99 G83 X1. Z-1000. R1. Q0.0001 F100.",
        "G91 G82 X1. Z-1. R0 P0.01 L40000000 F100.",
    ],
)
def test_a_line_without_end_is_refused(refusal: Refusal, text: str) -> None:
    error = refusal(f"{HEAD}G0 Z5\n{text}\nG80\nM30\n")
    assert (error.line, "this line makes more than 100,000 moves" in error.reason) == (5, True)


def test_a_line_of_a_subprogram_without_end_is_refused(refusal: Refusal, tmp_path: Path) -> None:
    (tmp_path / "programs").mkdir()
    sub = SUB.replace("G1 X5 F100", "G81 X1 Z-1 R1 L9999999 F100")
    (tmp_path / "programs" / "sub.ngc").write_text(sub, encoding="ascii")
    error = refusal(f"{HEAD}G0 Z5\no<sub> call\nM30\n")
    assert "this line makes more than 100,000 moves" in error.reason


def test_many_long_lines_are_refused(refusal: Refusal) -> None:
    error = refusal(f"{HEAD}o1 repeat [100000]\nG0 Z5\nG81 X1 Z-1 R1 L30000 F100\no1 endrepeat\nM30\n")
    assert (error.line, "moves have been made up to here" in error.reason) == (6, True)


def test_many_repeats_are_run(tmp_path: Path) -> None:
    path = tmp_path / "holes.ngc"
    path.write_text(f"{HEAD}G0 Z5\nG91 G81 X1 Z-1 R-1 L9000 F100\nG80\nM30\n", encoding="ascii")
    assert sum(call.kind == "feed" for call in rs274.read(path)) == 9000


def test_a_pipe_in_the_folder_is_not_waited_for(refusal: Refusal, tmp_path: Path) -> None:
    (tmp_path / "programs").mkdir()
    os.mkfifo(tmp_path / "programs" / "sub.ngc")
    error = refusal(f"{HEAD}o<sub> call\nM30\n")
    assert (error.line, "sub.ngc is a pipe or a device" in error.reason) == (4, True)


@pytest.mark.parametrize("end", ["M99", "N9 m 099 (again)", "#1=99\nM#1", "o1 if [1]\nM99\no1 endif\nM30"])
def test_a_main_program_that_repeats_itself_is_refused(refusal: Refusal, end: str) -> None:
    error = refusal(
        f"{HEAD}G1 X5 F100\n{end}\n",
    )
    assert error.line == 5 + (end[0] in "#o")
    assert "M99 in a main program repeats it endlessly: end it with M2 or M30" in error.reason


@pytest.mark.long
def test_a_long_loop_has_its_end(tmp_path: Path) -> None:
    path = tmp_path / "pocket.ngc"
    rows = "o1 while [#1 LT 400]\n#2=0\no2 while [#2 LT 500]\nG1 X#2 Y#1 F1000\n#2=[#2+1]\no2 endwhile\n#1=[#1+1]\n"
    path.write_text(f"{HEAD}#1=0\n{rows}o1 endwhile\nM30\n", encoding="ascii")
    assert sum(call.kind == "feed" for call in rs274.read(path)) == 200_000


@pytest.mark.long
def test_a_long_program_without_loops_is_run(tmp_path: Path) -> None:
    path = tmp_path / "long.ngc"
    with path.open("w", encoding="ascii") as file:
        file.write(HEAD)
        file.writelines("(nothing)\n" for _ in range(400_000))
        file.writelines(f"G1 X{k % 100} F1000\n" for k in range(1_000_000))
        file.write("M30\n")
    assert sum(call.kind == "feed" for call in rs274.read(path)) == 1_000_000


@pytest.mark.parametrize("name", ["../elsewhere/sub", "{root}/elsewhere/sub", "sub", "inner/../../elsewhere/sub"])
def test_a_file_outside_the_folders_is_not_read(refusal: Refusal, tmp_path: Path, name: str) -> None:
    outside = tmp_path / "elsewhere"
    outside.mkdir()
    (tmp_path / "programs" / "inner").mkdir(parents=True)
    (outside / "sub.ngc").write_text(SUB, encoding="ascii")
    if name == "sub":
        (tmp_path / "programs" / "sub.ngc").symlink_to(outside / "sub.ngc")
    error = refusal(f"{HEAD}o<{name.format(root=tmp_path)}> call\nM30\n")
    assert error.line == 4
    assert f"the program would read {outside / 'sub.ngc'}, which is outside its own folder" in error.reason


def test_a_link_to_a_folder_leads_nowhere(refusal: Refusal, tmp_path: Path) -> None:
    """A number as M98 has it, too."""
    outside, given = tmp_path / "elsewhere", tmp_path / "given"
    outside.mkdir()
    given.mkdir()
    (outside / "7.ngc").write_text("o7 sub\nG1 X5 F100\no7 endsub\nM2\n", encoding="ascii")
    (given / "7.ngc").symlink_to(outside / "7.ngc")
    for call in ("o7 call", "M98 P7"):
        error = refusal(f"{HEAD}{call}\nM30\n", subroutines=[given])
        assert (error.line, f"the program would read {outside / '7.ngc'}" in error.reason) == (4, True)


def test_what_is_in_the_folders_is_read(tmp_path: Path) -> None:
    """Also where the folder itself is a link, or a link stays inside."""
    given = tmp_path / "given"
    given.mkdir()
    (tmp_path / "link").symlink_to(given)
    (given / "real.ngc").write_text(SUB, encoding="ascii")
    (given / "sub.ngc").symlink_to(given / "real.ngc")
    path = tmp_path / "part.ngc"
    path.write_text(f"{HEAD}o<sub> call\nM30\n", encoding="ascii")
    expand(path, tmp_path / "plain.ngc", inch=False, subroutines=[tmp_path / "link"])
    assert "G1 X5" in (tmp_path / "plain.ngc").read_text(encoding="ascii")
