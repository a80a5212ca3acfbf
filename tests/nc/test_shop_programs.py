"""What shops send: holes in G91 with the levels of G90, fine boring, R above the start, a byte-order mark, no end."""

import shutil
import subprocess
from itertools import pairwise
from pathlib import Path

import pytest
from reviseruns import PLATE, said, without_header
from reviseruns import revise as command
from test_fanuc_programs import SETUP, Trial, moves, revise, some_controller

from thermocomp.core.exceptions import ProgramError
from thermocomp.nc.expansion.corners import write_corners
from thermocomp.nc.linuxcnc.verification.verify import prove

HEAD = "%\nO7\nG21 G90 G17 G40 G49 G80\nG91 G28 Z0.\nT1 M6\nG90 G54 G0 X0. Y0. S3000 M3\nG43 H1 Z50.\n"
TAIL = "G80\nG0 Z50.\nG91 G28 Z0.\nM30\n%\n"
#: a program as shops write it, and the same in plain words
SAME = {
    "repeats in G91": (
        "G0 Z5.\nG99 G81 X0. Y0. Z-5. R2. F60.\nG91 X10. K3\nY4.\nG90 X3.\n",
        "G0 Z5.\nG99 G81 X0. Y0. Z-5. R2. F60.\nX10.\nX20.\nX30.\nY4.\nX3.\n",
    ),
    "G98, on a line of its own": (
        "G0 Z9.\nG98 G83 X0. Y0. Z-5. R2. Q2. F60.\nG91\nX10. Y1. L2\nX5.\nG90\n",
        "G0 Z9.\nG98 G83 X0. Y0. Z-5. R2. Q2. F60.\nX10. Y1.\nX20. Y2.\nX25.\n",
    ),
    "fine boring": (
        "G0 Z5.\nG99 G76 X5. Y0. Z-9. R2. Q0.3 P500 F60.\nX30.\n",
        "G0 Z5.\nG99 G82 X5. Y0. Z-9. R2. P500 F60.\nX30.\n",
    ),
    "R above the start": (
        "G0 Z2.\nG90 G99 G81 X5. Y3. Z-9. R8. F60.\nX30.\n",
        "G0 Z2.\nG0 X5. Y3.\nG0 Z8.\nG99 G81 X5. Y3. Z-9. R8. F60.\nX30.\n",
    ),
}

pytestmark = pytest.mark.usefixtures("interpreter")


def tried(text: str, folder: Path, way: str = "coordinates") -> Trial:
    path = folder / "program.nc"
    path.write_text(f"{HEAD}{text}{TAIL}", "ascii")
    return revise(path, folder, way)


def route(trial: Path, seed: int) -> list[tuple[float, ...]]:
    """Return where LinuxCNC moves, without the moves that end where they start."""
    places = [end for _, end in moves(trial, some_controller(seed))]
    return [
        b for a, b in pairwise([(0.0, 0.0, 0.0), *places]) if max(abs(p - q) for p, q in zip(a, b, strict=True)) > 1e-7
    ]


@pytest.mark.parametrize("texts", SAME.values(), ids=SAME)
def test_it_moves_like_the_program_in_plain_words(texts: tuple[str, str], tmp_path: Path) -> None:
    for seed in (1, 2):
        found = []
        for text in texts:
            path = tmp_path / "program.nc"
            path.write_text(f"{HEAD}{text}{TAIL}", "ascii")
            found.append(route(path, seed))
        assert len(found[0]) > 8
        assert len(found[0]) == len(found[1])
        for a, b in zip(*found, strict=True):
            assert a == pytest.approx(b, abs=1e-6)


@pytest.mark.parametrize("way", ["coordinates", "offset"])
@pytest.mark.parametrize("texts", SAME.values(), ids=SAME)
def test_its_revision_is_proved(texts: tuple[str, str], way: str, tmp_path: Path) -> None:
    trial = tried(texts[0], tmp_path, way)
    assert prove(trial.original, trial.revised, trial.ledger, SETUP).states == 8
    if way == "coordinates":
        depths = {row.inner[2] for row in trial.rows if row.block and row.block.kind == "cycle"}
        assert any(abs(depth) > 1.0 for depth in depths)


def test_incremental_holes_keep_the_shifted_levels(tmp_path: Path) -> None:
    """The control drills them at the levels of the line before: no words are added, and the table says so."""
    trial = tried("G0 Z5.\nG98 G81 X0. Y0. Z-5. R2. F6.\nG91 X10. K3\nX1.\n", tmp_path)
    rows = [row for row in trial.rows if row.block and row.block.kind == "cycle"]
    assert {row.inner[2] for row in rows} == {rows[0].inner[2]}
    assert all("Z" not in text and "R" not in text for row in rows[1:] for text in row.texts)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("G0 Z5.\nG99 G81 X0. Y0. Z-5. R2. F60.\nG91 X10. Z-6.\n", "R or Z in G91"),
        ("G0 Z5.\nG99 G81 X0. Y0. Z-5. R2. F60.\nG91\nG83 X10. Q1.\n", "a new cycle"),
        ("G0 Z5.\nG91 G99 G81 X5. Y0. Z-5. R-2. F60.\nG90 X10.\n", "change their meaning"),
        ("G0 Z2.\nG98 G81 X5. Y3. Z-9. R8. F60.\n", "write G99"),
        ("G0 Z2.\nG91 G99 G81 X5. Y3. Z-9. R8. F60.\n", "write G99"),
    ],
)
def test_what_controls_read_differently_is_refused(text: str, reason: str, tmp_path: Path) -> None:
    with pytest.raises(ProgramError, match=reason):
        tried(text, tmp_path)


@pytest.mark.skipif(shutil.which("patch") is None, reason="the tool patch is not installed")
def test_a_byte_order_mark_is_left_out(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert command("--date", "2026-01-31", out="plain.ngc", proved=True) == 0
    Path("part.ngc").write_bytes(b"\xef\xbb\xbf" + PLATE.encode())
    capsys.readouterr()
    assert command("--date", "2026-01-31", proved=True) == 0
    assert "note the byte-order mark at the beginning of the file" in " ".join(capsys.readouterr().out.split())
    assert without_header("out.ngc") == without_header("plain.ngc")
    shutil.copy("part.ngc", "patched.ngc")
    with Path("out.ngc.diff").open("rb") as given:
        subprocess.run(["patch", "--binary", "-s", "-F0", "patched.ngc"], stdin=given, check=True)
    assert Path("patched.ngc").read_bytes() == Path("out.ngc").read_bytes()


def test_a_program_without_end_is_told_to_add_one(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("part.ngc").write_text(PLATE.replace("%\n", "").replace("M2\n", ""), encoding="ascii")
    assert command(proved=True) == 2
    error = said(capsys)
    assert "add M2 or M30 as its last line" in error
    assert "--unproved" not in error
    assert command() == 0


SQUARE = (
    "G0 Z2.\nG1 Z-1. F100.\nG42 D1 X10. Y0. F300.\nN10 X40. ,R5. (A CORNER)\n\nN20 Y30. ,C2. F200.\nX0.,R3. M8\n"
    "G1 Y10.\nG40 X-9.\n"
)
#: the same by hand: centres and ends from the drawing
BY_HAND = (
    "G0 Z2.\nG1 Z-1. F100.\nG42 D1 X10. Y0. F300.\nX35. Y0.\nG3 X40. Y5. I0. J5.\nG1 X40. Y28. F200.\nX38. Y30.\n"
    "X3. Y30. M8\nG3 X0. Y27. I0. J-3.\nG1 Y10.\nG40 X-9.\n"
)


def cornered(text: str) -> str:
    lines = f"{HEAD}{text}{TAIL}".splitlines(keepends=True)
    return "".join(t for t, _ in write_corners([(t, k) for k, t in enumerate(lines, 1)], SETUP))


def test_corners_are_written_as_on_the_drawing(tmp_path: Path) -> None:
    found, path = [], tmp_path / "program.nc"
    for text in (cornered(SQUARE), f"{HEAD}{BY_HAND}{TAIL}"):
        path.write_text(text, "ascii")
        found.append(route(path, 1))
    assert len(found[0]) == len(found[1]) > 10
    for a, b in zip(*found, strict=True):
        assert a == pytest.approx(b, abs=1e-5)
    assert "(A CORNER)" in cornered(SQUARE)


def test_a_corner_that_is_not_square_touches_both_lines() -> None:
    """60 degrees to the left, R5: the tangents are 5 tan 30 deg = 2.887 mm long."""
    text = cornered("G0 Z2.\nG1 Z-1. F100.\nX20. ,R5. F300.\nX30. Y17.32051\n")
    assert "X17.113 Y0." in text
    assert "G3 X21.443 Y2.5 R5." in text
    right = cornered("G0 Z2.\nG1 Z-1. F100.\nX20. ,R5. F300.\nX30. Y-17.32051\n")
    assert "G2 X21.443 Y-2.5 R5." in right


def test_programs_without_corners_stay_as_they_are() -> None:
    text = f"{HEAD}G0 Z2.\n(A ,R5. IN A COMMENT)\nG1 X5. (,C1.)\n{TAIL}"
    assert "".join(t for t, _ in write_corners([(t, 1) for t in text.splitlines(keepends=True)], SETUP)) == text


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("G1 X20. ,R15. F300.\nY10.\n", "does not fit between its lines"),
        ("G1 X20. ,R5. F300.\nX40.\n", "does not fit between its lines"),
        ("G1 X20. ,R5. F300.\nG2 X40. Y0. R10.\n", "needs two feed lines"),
        ("G1 X20. ,R5. F300.\nG0 Y9.\n", "needs two feed lines"),
        ("G1 X20. ,R5. F300.\nY9. Z-2.\n", "needs two feed lines"),
        ("G91 G1 X20. ,R5. F300.\nY9.\n", "needs two feed lines"),
        ("G1 X20. ,R5. F300.\nG54\nY9.\n", "needs two feed lines"),
        ("G1 X20. ,R5. F300.\n", "needs two feed lines"),
        ("M0\nG1 X20. ,R5. F300.\nY9.\n", "needs two feed lines"),
        ("G1 X20. ,R5 F300.\nY9.\n", "no decimal point"),
    ],
)
def test_corners_that_are_not_plain_are_refused(text: str, reason: str) -> None:
    with pytest.raises(ProgramError, match=reason):
        cornered(f"G0 Z2.\n{text}")


def test_the_command_expands_corners(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("part.ngc").write_text(f"{HEAD}G4 P900000\n{SQUARE}{TAIL}", "ascii")
    told = ["--controller", "fanuc", "--home", "0 mm, 0 mm, 300 mm"]
    assert command(*told, proved=True) == 2
    assert "--expand writes it as plain moves" in said(capsys)
    assert command(*told, "--expand", proved=True) == 0
    assert ",R" not in Path("out.ngc").read_text("ascii")
