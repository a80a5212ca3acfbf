"""What a program can contain, one after the other, judged by LinuxCNC's interpreter.

Adding the drift to every Z of the text is wrong for most of these; each is either revised so that the interpreter's
moves are the original's plus the correction, or refused with its line.
"""

import math
import re
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import pytest
from nc_law import STEADY, Growing, Steady, Still, revise

from thermocomp.core.exceptions import ProgramError
from thermocomp.nc.rewrite import header

pytestmark = pytest.mark.usefixtures("interpreter")

BEGIN = "G21 G90 G17 G94\nS3000 M3 F300\nG0 X0 Y0 Z10\n"


class Feature(NamedTuple):
    name: str
    text: str
    refused: int = 0  #: line that is refused by both ways
    offset: int = 0  #: line that --method offset refuses, beyond that


FEATURES = [
    Feature("absolute", "G1 Z-1\nX50\nY20 Z-2\nG0 Z10\n"),
    Feature("lines without Z", "G1 Z-1\nX50\nY20\nX0\nG0 Z10\n"),
    Feature("incremental", "G1 Z-1\nG91\nX5\nY5 Z-0.5\nX-5\nG90\nG0 Z10\n"),
    Feature("incremental rapids up there", "G4 P60\nG91\nG0 X5\nX5 Y2\nG90\nX0\nG1 Z-1\nG0 Z10\n"),
    Feature("inches", "G20\nG0 Z0.5\nG1 Z-0.05\nX1.5 Y0.25\nG0 Z0.5\n"),
    Feature("numbers with spaces", "G1 Z - 1 . 5\nX + 5 0\nG 0 Z 1 0\n"),
    Feature("parameters", "#1=-1.5\n#<deep>=[#1*2]\nG1 Z#1\nX20 Z#<deep>\nZ-#1\nG0 Z10\n"),
    Feature("expressions", "G1 Z[-1-0.5]\nX[2*10] Z[SIN[30]*-4]\nG0 Z[5+5]\n"),
    Feature("loop", "#1=0\no100 while [#1 LT 3]\nG1 Z-#1\n#1=[#1+1]\no100 endwhile\n", refused=5),
    Feature("subprogram", "o100 sub\nG1 Z-1\no100 endsub\no100 call\n", refused=4),
    Feature("drilling with a retract plane", "G81 X10 Y10 Z-5 R2\nG80\nG0 Z10\n"),
    Feature("sticky words of a cycle", "G98 G81 X10 Y10 Z-5 R2\nX20\nY20\nX30 Y30\nG80\nG0 Z20\n"),
    Feature("peck drilling", "G99 G83 X10 Y10 Z-8 R2 Q3\nX20\nG80\nG0 Z10\n"),
    Feature("incremental cycle", "G91 G81 X5 Y5 Z-6 R-3 L3\nG80 G90\nG0 Z10\n"),
    Feature("origin by G10 L2", "G10 L2 P1 Z-3\nG0 Z10\nG1 Z-1\nX5\nG10 L2 P1 Z0\nG0 Z10\n"),
    Feature("origin by G10 L20", "G1 Z-1\nG10 L20 P0 Z0\nX20\nG1 Z-1\nG0 Z12\n"),
    Feature("tool length by G43.1", "G43.1 Z25\nG0 Z10\nG1 Z-1\nX5\nG0 Z10\nG49\nG0 Z20\n"),
    Feature("machine coordinates", "G1 Z-1\nG53 G0 Z20\nX30\nG0 Z5\nG1 Z-1\nG53 G0 X0 Y0 Z20\n"),
    Feature("home", "G1 Z-1\nG28 Z5\nG0 X20\nZ5\nG1 Z-1\nG91 G28 Z0\nG90\n"),
    Feature("arc with centre", "G1 Z-1\nG2 X20 Y0 I10 J0\nG3 X40 Y0 I10\nG1 X50\nG0 Z10\n"),
    Feature("arc with radius, absolute centre", "G1 Z-1\nG2 X20 Y0 R15\nG90.1\nG3 X40 Y0 I30 J0\nG91.1\nG0 Z10\n"),
    Feature("helices", "G1 Z-1\nG2 X20 Y0 Z-3 I10 J0\nG3 I-5 Z-4\nG0 Z10\n"),
    Feature("arcs in the other planes", "G1 Z-1\nG18 G2 X20 Z-1 I10 K0\nG19 G3 Y20 Z-1 J10 K0\nG17\nG0 Z10\n"),
    Feature("place named by G92", "G1 Z-1\nG92 Z0\nX20\nZ-1\nG0 Z11\nG92.1\nG0 Z12\n", offset=5),
    Feature("place named by G52", "G52 X5 Z1\nG0 X0 Z10\nG1 Z-1\nG52 X0 Z0\nG0 Z10\n", offset=4),
    Feature("comments", "G1 Z-1 (Z-2)\nX5 (MSG, Z7) Y5 ; Z-9\n; Z-3\nG0 (a) Z1 0 (b)\n"),
    Feature("a cut that may be skipped", "X9\n/G1 Z-1 F100\n/X20\nG0 Z10\nX0\n"),
    Feature("block delete", "G1 Z-1\n/ Z-2\nX20\nZ-1.5\nG0 Z10\n"),
    Feature(
        "rotated coordinates", "G54 G10 L2 P1 R30\nG0 X10 Y0\nG1 Z-1\nX20\nY20\nG10 L2 P1 R0\nG0 X0 Y0 Z10\n", offset=5
    ),
    Feature("other systems", "G55\nG0 X5 Y5 Z10\nG1 Z-1\nG54 G0 Z10\nX0 Y0\n"),
    Feature("cutter compensation", "G0 X-20 Y-20\nG1 Z-1\nG41.1 D4 G1 X0 Y-10\nY20\nX20\nG40 X30 Y30\nG0 Z10\n"),
    Feature("inverse time, feed per turn", "G93 G1 Z-1 F10\nX20 F5\nG95 F0.1\nX0\nG94 F300\nG0 Z10\n"),
    Feature("probing", "G38.2 Z-10\nG0 Z10\n", refused=4),
    Feature("place read back", "G1 Z-1\n#1=#<_z>\nG1 Z[#1-1]\n", refused=5),
]


def program(folder: Path, feature: Feature) -> Path:
    path = folder / "program.ngc"
    path.write_text(f"{BEGIN}{feature.text}M2\n")
    return path


def named(way: str, feature: Feature) -> int:
    return feature.refused or (feature.offset if way == "offset" else 0)


@pytest.mark.parametrize("way", ["coordinates", "offset"])
@pytest.mark.parametrize("feature", FEATURES, ids=[f.name for f in FEATURES])
def test_a_feature_is_revised_rightly_or_refused(feature: Feature, way: str, tmp_path: Path) -> None:
    path = program(tmp_path, feature)
    for drift, every in ((Growing(), 5.0), (Growing(rate=(1, 1, 2)), None)):
        if line := named(way, feature):
            with pytest.raises(ProgramError, match=f"^line {line}: ") as found:
                revise(path, tmp_path, drift, way, every=every)
            assert len(found.value.reason) > 20
        else:
            trial = revise(path, tmp_path, drift, way, every=every)
            assert trial.proved().moves >= 4
            assert trial.run.changed > 0


@pytest.mark.parametrize("feature", [f for f in FEATURES if not f.refused], ids=lambda f: f.name)
def test_a_feature_without_drift_stays_byte_for_byte(feature: Feature, tmp_path: Path) -> None:
    trial = revise(program(tmp_path, feature), tmp_path, Still(), "coordinates")
    written = trial.revised.read_bytes()
    marks = "".join(header.make_blank("\n")).encode()
    assert written == marks + trial.original.read_bytes()
    assert trial.run.changed == 0


#: cycles end where they began, and turned coordinates mix X and Y: what they carry is told by the interpreter alone
PLAIN = [f for f in FEATURES if not f.refused and "G8" not in f.text and "R30" not in f.text and "G41" not in f.text]


@pytest.mark.parametrize("feature", PLAIN, ids=[f.name for f in PLAIN])
def test_every_axis_in_work_coordinates_has_the_whole_correction(feature: Feature, tmp_path: Path) -> None:
    """Read from the text alone: an axis that was named has it, one that was named by G53, G28 or G30 has none."""
    trial = revise(program(tmp_path, feature), tmp_path, Steady(), "coordinates")
    lines = re.sub(r"\([^)]*\)|;.*", "", trial.original.read_text()).splitlines()
    shifts = trial.shifts()
    for i, letter in enumerate("XYZ"):
        carries = 0.0
        for number, text in enumerate(lines, start=1):
            moves = [shift[i] for line, shift in shifts if line == number]
            if letter in text and moves:
                carries = 0.0 if re.search("G53|G28|G30", text) else -STEADY[i]
            if moves:
                assert moves[-1] == pytest.approx(carries, abs=0.1), (text, letter)


def test_where_a_cycle_ends_unsaid_no_word_is_added_behind_it(tmp_path: Path) -> None:
    """Without G98 or G99 the controller decides: a Z that is added could take the tool down to R."""
    text = "G81 X10 Y10 Z-5 R2\nX20\nG80\nG1 X50\nX60\nG0 Z10\n"
    path = program(tmp_path, Feature("", text))
    trial = revise(path, tmp_path, Growing(rate=(0.0, 0.0, 2.0)), "coordinates")
    trial.proved()
    assert not any("Z" in row.texts[0] for row in trial.rows if row.text.startswith(("G1 X50", "X60")))
    path = program(tmp_path, Feature("", f"G99 {text}"))
    trial = revise(path, tmp_path, Growing(rate=(0.0, 0.0, 2.0)), "coordinates")
    trial.proved()
    assert all("Z" in row.texts[0] for row in trial.rows if row.text.startswith(("G1 X50", "X60")))


def test_a_line_with_a_long_comment_may_grow(tmp_path: Path) -> None:
    """LinuxCNC takes what is behind the 252nd character for the next line."""
    text = f"G1 Z-1 ({'a' * 235})\nX5\nG0 Z10\n"
    trial = revise(program(tmp_path, Feature("", text)), tmp_path, Steady(), "coordinates")
    assert trial.proved().moves >= 3
    assert trial.rows[4].texts == (f"({'a' * 235})\n", "G1 Z-1.025\n")


def cut(folder: Path, moves: str, step: float = 1.0) -> list[tuple[float, float]]:
    """Return way [mm] and change of the correction of Z [um] of each block of a cut, the drift growing fast."""
    path = program(folder, Feature("", f"G1 Z-1\n{moves}G0 Z10\n"))
    trial = revise(path, folder, Growing(rate=(0.0, 0.0, 1.0), slope=0.0), "coordinates", step=step)
    trial.proved()
    cuts = [row for row in trial.rows if row.block and row.block.moves and not row.block.moves[-1].rapid]
    return [
        (math.dist(b.block.moves[-1].start, b.block.moves[-1].end), b.carried[2] - a.carried[2])
        for a, b in pairwise(cuts)
        if b.block
    ]


def test_a_finished_surface_gets_no_mark(tmp_path: Path) -> None:
    """In a cut the correction changes by a step per 10 mm of way at most, spread over its block."""
    short = "".join(f"X{k / 2}\n" for k in range(1, 200))
    for moves in (short, "X100\nX0\nX100\n", "X9.5\nX19\nX0\nY4\nX80\n"):
        for step in (0.5, 1.0, 3.0):
            gone = 0.0
            last = math.inf
            for way, change in cut(tmp_path, moves, step):
                assert abs(change) <= step * max(1.0, way / 10) + 1e-6
                if change:
                    assert last >= 10 - 1e-6 or abs(change) <= step * way / 10 + 1e-6
                    last = 0.0
                last += way
                gone += change
            assert gone < -3 * step  # it does follow
