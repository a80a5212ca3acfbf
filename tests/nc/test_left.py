"""What is left of the drift is told truly; marks, jumps and words where nobody knows the place are avoided."""

import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest
from nc_law import STATED, Growing, Trial, revise

from thermocomp.core.exceptions import ProgramError
from thermocomp.nc.interpreter.arcs import find_point, length
from thermocomp.nc.interpreter.block import Move, Point, Setup
from thermocomp.nc.planner.timeline import MotionLimits
from thermocomp.nc.rewrite.coordinates import Coordinates
from thermocomp.nc.rewrite.demand import Demand
from thermocomp.nc.rewrite.revise import Revision
from thermocomp.nc.rewrite.text import DIGITS, Vector

BEGIN = "G21 G90 G17 G94\nS3000 M3 F300\nG0 X0 Y0 Z10\n"


class Ending(Growing):
    """A drift that comes to an end, fast at first."""

    def deviation(self, point: Point) -> Vector:
        return 0.0, 0.0, 60.0 * (1.0 - math.exp(-self.time / 600.0))


class Bent(Growing):
    """A drift that depends on X: none at 0 and 600 mm, 59 um between."""

    by_position = True

    def deviation(self, point: Point) -> Vector:
        return 0.0, 0.0, 59.0 * (1.0 - abs(point[0] / 300.0 - 1.0))


def tried(
    folder: Path,
    text: str,
    drift: Growing,
    way: str = "coordinates",
    setup: Setup = STATED,
    every: float | None = None,
    split: bool = False,
) -> Trial:
    path = folder / "program.ngc"
    path.write_text(f"{BEGIN}{text}M2\n")
    return revise(path, folder, drift, way, every=every, setup=setup, split=split)


def test_the_bow_of_a_long_cut_is_in_what_is_left(tmp_path: Path) -> None:
    """A correction changes evenly along a block, the drift does not: 60 um (1 - exp(-t / 10 min)) over 50 min."""
    trial = tried(tmp_path, "G1 Z-1\nX1000 F20\nG0 Z10\n", Ending())
    begin = trial.run.seconds - 3000.0
    rows = {row.number: row for row in trial.rows}
    z = {k: rows[k].carried[2] for k in (4, 5)}
    shares = [k / 1000 for k in range(1001)]
    start = rows[5].start
    gaps = [
        60.0 * (1.0 - math.exp(-(start + s * (rows[5].end - start)) / 600.0)) + z[4] + s * (z[5] - z[4]) for s in shares
    ]
    assert begin > 0
    assert max(map(abs, gaps)) > 20.0
    assert trial.run.left.most[2] == pytest.approx(max(map(abs, gaps)), abs=0.3)
    assert trial.run.left.line[2] == 5


def test_the_bow_along_the_way_is_in_what_is_left(tmp_path: Path) -> None:
    setup = Setup(inch=False, speed=3000.0, offsets={1: (0.0, 0.0, 0.0)})
    trial = tried(tmp_path, "G1 Z-1\nX600\nG0 Z10\n", Bent(), setup=setup)
    assert trial.run.left.most[2] == pytest.approx(59.0, abs=4.0)


def test_a_dwell_in_the_cut_is_in_what_is_left(tmp_path: Path) -> None:
    trial = tried(tmp_path, "G1 Z-1\nG4 P3000\nG0 Z10\n", Ending())
    assert trial.run.left.most[2] > 50.0
    assert trial.run.left.line[2] == 5
    lifted = tried(tmp_path, "G1 Z-1\nG0 Z10\nG4 P3000\n", Ending())
    assert lifted.run.left.most[2] < 3.0


def test_an_origin_that_is_unknown_is_asked_for(tmp_path: Path) -> None:
    with pytest.raises(ProgramError, match=r"line 4: .*the origin of G54 is unknown: --origin"):
        tried(tmp_path, "G1 Z-1\n", Bent())
    setup = Setup(inch=False, speed=3000.0, offsets={1: (0.0, 0.0, 0.0)})
    with pytest.raises(ProgramError, match=r"line 7: .*the length of tool 2 is unknown: --tool"):
        tried(tmp_path, "T2 M6\nG43 H2\nG0 X0 Y0 Z5\nG1 Z-1\n", Bent(), setup=setup)
    assert tried(tmp_path, "G10 L2 P1 X0 Y0 Z0\nG0 X300 Y0 Z5\nG1 Z-1\n", Bent()).run.changed


@pytest.mark.parametrize(
    "text", ["X400 F20\nG0 Y5\nG1 X0\n", "X400 F20\nG0 X500\nG1 Y5\nX0\n", "X200 F20\nX400\nG0 Y9\nG0 Y5\nG1 X0\n"]
)
@pytest.mark.parametrize("every", [None, 600.0])
def test_a_rapid_at_depth_takes_no_more_than_a_cut(text: str, every: float | None, tmp_path: Path) -> None:
    """It may lead to the next pass over the same face."""
    trial = tried(tmp_path, f"G1 Z-1\n{text}G0 Z10\n", Ending(), every=every)
    trial.proved()
    rows = [row for row in trial.rows if row.block and row.block.moves][2:-1]
    for before, row in pairwise(rows):
        assert row.block
        way = sum(map(length, row.block.moves))
        assert abs(row.carried[2] - before.carried[2]) <= max(1.0, way / 10.0) + 1e-6


def test_a_lifted_tool_takes_all_at_once(tmp_path: Path) -> None:
    trial = tried(tmp_path, "G1 Z-1\nX3 F1\nG0 Z10\nX0\nG1 Z-1 F300\nX9\nG0 Z10\n", Ending())
    carried = {row.number: row.carried[2] for row in trial.rows}
    assert carried[5] - carried[6] > 5.0


def test_full_circles_have_a_way(tmp_path: Path) -> None:
    trial = tried(tmp_path, "G1 Z-1 F100\n" + "G2 X0 Y0 I50\n" * 20 + "G0 Z10\n", Ending())
    trial.proved()
    assert trial.run.left.most[2] < 4.0


@pytest.mark.parametrize("way", ["coordinates", "offset"])
def test_no_word_is_added_behind_a_tool_change(way: str, tmp_path: Path) -> None:
    """The change may take any axis anywhere: to its own height, to G30."""
    tools = replace(STATED, tools={1: 120.0, 2: 140.0}, offsets={1: (0.0, 0.0, 0.0)})
    text = "T1 M6\nG43 H1\nG0 X0 Y0 Z50\nG4 P600\nT2 M6\nG43 H2\nG0 X100\nG0 Y50\nG0 Z5\nG55\nX20 Y20\n"
    for setup in (STATED, tools):
        trial = tried(tmp_path, text, Growing(), way, setup)
        for row in trial.rows:
            if row.text.startswith(("G0 X100", "G0 Y50", "X20 Y20")):
                assert [w for w in "XYZ" if w in row.texts[-1]] == [w for w in "XYZ" if w in row.text]


def test_an_offset_is_absolute_whatever_is_modal(tmp_path: Path) -> None:
    """G52 under G91 adds up on some controls, and an aborted run may have left another one in force."""
    text = "G91 G28 Z0\nT2 M6\nG90 G0 X0 Y0\nZ6\nG1 Z-1\nG4 P900\nG0 Z6\nX1\nG1 Z-1\nG91 G28 Z0\n"
    trial = tried(tmp_path, text, Ending(), "offset")
    trial.proved()
    written = [t for row in trial.rows for t in row.texts if "G52" in t]
    assert len(written) >= 3
    assert all(t.startswith("G90 G52 ") for t in written)
    assert trial.rows[3].texts[0].startswith("G90 G52 ")  # before the first rapid
    assert written[-1] == "G90 G52 X0.0 Y0.0 Z0.0\n"


def test_lines_behind_the_end_are_counted(tmp_path: Path) -> None:
    path = tmp_path / "program.ngc"
    path.write_text(f"{BEGIN}G1 Z-1\nG0 Z10\nM2\nG1 X5\n(note)\n")
    assert revise(path, tmp_path, Growing(), "coordinates").run.idle == 1


def test_along_an_arc() -> None:
    from thermocomp.nc.interpreter.block import Arc

    half = Move(False, (10.0, 0.0, 0.0), (-10.0, 0.0, 6.0), Arc(17, (0.0, 0.0), False, 1))
    assert length(half) == pytest.approx(math.hypot(10 * math.pi, 6))
    assert find_point(half, 0.5) == pytest.approx((0.0, 10.0, 3.0))
    other = Move(False, (10.0, 0.0, 0.0), (-10.0, 0.0, 6.0), Arc(17, (0.0, 0.0), True, 2))
    assert length(other) == pytest.approx(math.hypot(30 * math.pi, 6))
    assert find_point(other, 1.0) == pytest.approx((-10.0, 0.0, 6.0))
    full = Move(False, (10.0, 0.0, 0.0), (10.0, 0.0, 0.0), Arc(17, (0.0, 0.0), True, 1))
    assert length(full) == pytest.approx(20 * math.pi)
    assert find_point(full, 0.25) == pytest.approx((0.0, -10.0, 0.0))


class Fixed(Growing):
    """A drift of Z that is there at once."""

    def __init__(self, z: float) -> None:
        super().__init__()
        self.z = z

    def deviation(self, point: Point) -> Vector:
        return 0.0, 0.0, self.z


@pytest.mark.parametrize("shift", [22.1, 0.1, 3.3, 12.7, -5.1, 31.9, 17.0, 8.2])
@pytest.mark.parametrize("hole", ["Z-22 R2 Q4", "Z-18. R2. Q5.", "Z-6 R1 Q0.7", "Z-20.2 R0.4 Q2.06"])
def test_a_shift_does_not_make_another_peck(hole: str, shift: float, tmp_path: Path) -> None:
    """Where Q divides the depth, rounded numbers may leave a rest of 1e-15 mm, which is a peck."""
    trial = tried(tmp_path, f"G98 G83 X1 {hole}\nX2\nG80\nG0 Z10\n", Fixed(-shift))
    trial.proved()
    row = trial.rows[4]
    assert row.inner[2] == pytest.approx(shift, abs=2.0)


def test_a_least_increment_coarser_than_the_step_is_used(tmp_path: Path) -> None:
    """Four decimals of an inch are 2.5 um; a step of 1 um must not hold the correction for ever."""
    path = tmp_path / "program.ngc"
    path.write_text("G20 G90 G17 G94\nS3000 M3 F12.\nG0 X0. Y0. Z.4\nG1 Z-.04\n" + "X8.\nX0.\n" * 9 + "G0 Z.4\nM30\n")
    setup = Setup(controller="fanuc", inch=False, speed=3000.0, integers="refuse")
    run = Revision(setup, MotionLimits(), Ending(), Coordinates(DIGITS["fanuc"], 1.0), Demand(1.0))
    with path.open(newline="") as file:
        list(run.revise(file))
    assert run.left.most[2] < 5.0
