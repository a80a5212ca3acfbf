"""Programs that once came out wrong: in other states of the controller, or in the time that a move takes."""

import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Literal

import pytest
from nc_law import STATED, Growing, Steady, Trial, revise

from thermocomp.core.exceptions import ProgramError
from thermocomp.nc.interpreter.block import Point, Setup
from thermocomp.nc.linuxcnc import rs274
from thermocomp.nc.rewrite.text import Vector

pytestmark = pytest.mark.usefixtures("interpreter")

BEGIN = "G21 G90 G17 G40 G80 G94 G54\n"
#: G54 far below and above the machine's zero, with long and short tools, in G98 and G99
STATES = [
    rs274.Stored(origins={1: (x, y, z)}, lengths={1: length, 2: 30.0}, startup=f"G64 {code}", start=(5.0, 6.0, top))
    for (x, y, z), length, top in (
        ((0.0, 0.0, 0.0), 0.0, 0.0),
        ((123.0, -77.0, -450.0), 100.0, -20.0),
        ((-9.0, 31.0, 260.0), 180.0, 300.0),
    )
    for code in ("G98", "G99")
]


class Deep(Steady):
    """Z alone drifts."""

    def deviation(self, point: Point) -> Vector:
        return 0.0, 0.0, 50.0


def tried(
    folder: Path, text: str, way: str = "coordinates", setup: Setup = STATED, drift: Steady | None = None
) -> Trial:
    path = folder / "program.ngc"
    path.write_text(text)
    return revise(path, folder, drift or Growing(rate=(0.0, 0.0, 0.5)), way, setup=setup)


def moves(path: Path, stored: rs274.Stored) -> list[rs274.Canonical]:
    return [c for c in rs274.read(path, stored) if c.kind in ("rapid", "feed", "arc") and c.line]


def farthest(trial: Trial, *, kinds: tuple[str, ...] = ("rapid", "feed", "arc")) -> float:
    """Return the largest shift in any state [mm]."""
    worst = 0.0
    for stored in STATES:
        for a, b in zip(moves(trial.original, stored), moves(trial.revised, stored), strict=True):
            if a.kind in kinds:
                worst = max(worst, math.dist(a.machine[:3], b.machine[:3]))
    return worst


def still_moves(trial: Trial) -> list[int]:
    """Return the lines in which a linear axis moves that stands still in the original."""
    found = []
    for stored in STATES:
        first, second = moves(trial.original, stored), moves(trial.revised, stored)
        for (a, b), (c, d) in zip(pairwise(first), pairwise(second), strict=True):
            if math.dist(a.machine[:3], b.machine[:3]) < 1e-9 < math.dist(c.machine[:3], d.machine[:3]):
                found.append(b.line)
    return found


TURNS = "T1 M6\nG43 H1\nS12000 M3\nG0 X10 Y0 Z20 A0\nG0 Z2\nG1 X10 Y0 Z-1 A0 F300\n"
TABLE = replace(STATED, rotary={"A": "table", "B": "table"})


@pytest.mark.parametrize("way", ["coordinates", "offset"])
@pytest.mark.parametrize(
    "turn",
    [
        "G1 X10 Y0 Z-1 A{} F720",
        "G95 G1 X10 Y0 Z-1 A{} F0.5",
        "G0 X10 Y0 Z-1 A{}",
        "G1 A{} Z-1 F720",
        "G0 Z20\nG4 P60\nG0 X{0}\nG4 P60\nG0 X{0} Z20 A{0}\nG0 X10",
    ],
)
def test_a_turn_of_the_table_stays_one(way: str, turn: str, tmp_path: Path) -> None:
    """F counts degrees only while X, Y and Z stand still: a micrometre of Z makes 3.6 s of 30 s."""
    turns = "\n".join(turn.format(a) for a in (360, 720, 1080))
    trial = tried(tmp_path, f"{BEGIN}{TURNS}{turns}\nG94 G0 Z20\nG1 X0 Y0 Z-1 F300\nM30\n", way, TABLE)
    assert still_moves(trial) == []
    assert trial.run.changed > 1


def test_a_turn_from_a_place_that_nobody_knows_is_refused(tmp_path: Path) -> None:
    with pytest.raises(
        ProgramError, match=r"line 6: the line turns a rotary axis at feed rate.*position X Y Z by a rapid"
    ):
        tried(tmp_path, f"{BEGIN}S1000 M3\nG0 X1 Y1 Z1\nG1 Z0 F100\nM0\nG1 X1 Y1 Z0 A90 F720\nM2\n", setup=TABLE)


@pytest.mark.parametrize(
    "cycle",
    [
        "G98 G81 X10 Y0 Z-5 R2 F100\nG80\nG4 P100\nG0 X80\nG0 X100\nG0 Z50\n",
        "G81 X10 Y0 Z-5 R2 F100\nG81 X20 Y0 Z-5 R3\nG80\nG4 P100\nG0 X80\nG0 Z50\n",
        "G0 Z50\nG81 X10 Y0 Z-5 R2 F100\nG81 X20 Y0 Z-5 R3\nG80\nG4 P100\nG0 X80\nG0 Z50\n",
        "G0 Z50\nG81 X10 Y0 Z-5 R2 F100\nM0\nX20\nG80\nG4 P100\nG0 X80\nG0 Z50\n",
        "G91 G81 X10 Y0 Z-5 R-2 F100 L2\nG80\nG90 G4 P100\nG0 X80\nG0 Z50\n",
    ],
)
def test_where_a_cycle_ends_nobody_dives(cycle: str, tmp_path: Path) -> None:
    trial = tried(tmp_path, f"{BEGIN}G53 G0 Z0\nT1 M6\nG43 H1\nS12000 M3\nG0 X10 Y0\n{cycle}M30\n")
    assert 0.01 < farthest(trial) < 1.0


@pytest.mark.parametrize("before", ["", "G0 Z5\nG55\n", "G0 Z5\nG43 H2\n", "G0 Z5\nG10 L2 P1 Z0\n"])
def test_no_word_is_added_where_nobody_knows(before: str, tmp_path: Path) -> None:
    """At the start, and where an origin or a length changes that the program does not tell."""
    trial = tried(tmp_path, f"{BEGIN}S1000 M3\nG0 X0 Y0\n{before}G4 P200\nG0 X50\nG1 X60 F100\nG0 Z5\nG1 Z-1\nM2\n")
    rows = {row.text.strip(): row for row in trial.rows}
    assert not any("Z" in rows[line].texts[-1] for line in ("G0 X50", "G1 X60 F100"))
    assert rows["G1 Z-1"].texts != ("G1 Z-1\n",)


@pytest.mark.parametrize("stop", ["M0", "M1", "M60"])
def test_no_word_is_added_behind_a_stop(stop: str, tmp_path: Path) -> None:
    """The operator may have moved the axes: X alone would become a diagonal rapid."""
    text = f"{BEGIN}S1000 M3\nG0 X0 Y0 Z5\nG1 Z-1 F100\nG0 Z5\n{stop}\nG4 P200\nG0 X50\nX60\nG1 Y5\nG0 Z5\nG1 Z-1\nM2\n"
    trial = tried(tmp_path, text)
    rows = {row.text.strip(): row for row in trial.rows}
    assert not any("Z" in rows[line].texts[-1] for line in ("G0 X50", "X60", "G1 Y5"))
    assert rows["G0 Z5"].texts != ("G0 Z5\n",)


@pytest.mark.parametrize(
    ("text", "rotary", "line"),
    [
        ("G0 B90\nG1 Z-1 F100\n", {}, 4),
        ("G0 B90\nG1 Z-1 F100\n", {"B": "head"}, 4),
        ("G0 B90\nG1 Z-1 F100\n", {"B": "table"}, 0),
        ("G0 B360\nG1 Z-1 F100\n", {}, 0),
        ("G0 B0 A0\nG1 Z-1 F100\n", {}, 0),
        ("G91 G0 B30\nG90\nG1 Z-1 F100\n", {"A": "table"}, 4),
        ("G92 B0\nG1 Z-1 F100\n", {}, 4),
        ("G10 L2 P1 B5\nG1 Z-1 F100\n", {}, 4),
        ("G92 B0\nG1 Z-1 F100\n", {"B": "table"}, 0),
    ],
)
def test_a_tilted_head_is_refused(
    text: str, rotary: dict[str, Literal["head", "table"]], line: int, tmp_path: Path
) -> None:
    setup = replace(STATED, rotary=rotary)
    program = f"{BEGIN}S1000 M3\nG0 X0 Y0 Z5\n{text}M2\n"
    if not line:
        assert tried(tmp_path, program, setup=setup).run.changed
        return
    with pytest.raises(ProgramError, match=f"line {line}: B (is at|gets a new).*(--machine|in the head)"):
        tried(tmp_path, program, setup=setup)


@pytest.mark.parametrize("way", ["coordinates", "offset"])
def test_a_rotation_that_may_be_stored_has_to_be_said(way: str, tmp_path: Path) -> None:
    untold = replace(STATED, rotations={})
    text = f"{BEGIN}S1000 M3\nG0 X0 Y0 Z5\nG4 P100\nG0 X5 Y5\nG1 Z-1 F100\nG0 Z5\nM2\n"
    with pytest.raises(ProgramError, match=r"line 3: X or Y is corrected.*--rotation none"):
        tried(tmp_path, text, way, untold, Growing())
    assert tried(tmp_path, text.replace("S1000", "G10 L2 P1 R0\nS1000"), way, untold, Growing()).run.changed
    assert tried(tmp_path, text, way, untold, Deep()).run.changed


def test_lengths_and_origins_are_told_by_the_program_too(tmp_path: Path) -> None:
    """Of G43.1 and G43.2 as of G43."""
    origins = replace(STATED, offsets={1: (0.0, 0.0, 0.0)}, tools={1: 100.0})
    placed = Growing(rate=(0.0, 0.0, 0.1))
    placed.by_position = True
    for code in ("G43 H1", "G43.1 Z80", "G43 H1\nG43.2 H1", "G10 L1 P5 Z70\nG43 H5", "G49"):
        text = f"{BEGIN}S1000 M3\n{code}\nG0 X0 Y0 Z5\nG1 Z-1 F100\nM2\n"
        assert tried(tmp_path, text, setup=origins, drift=placed).run.changed
    for code, tool in (("G43 H5", 5), ("G43 H1\nG43.2 H5", 5), ("G43 H5\nG43.2 H1", 5)):
        text = f"{BEGIN}S1000 M3\n{code}\nG0 X0 Y0 Z5\nG1 Z-1 F100\nM2\n"
        with pytest.raises(ProgramError, match=f"the length of tool {tool} is unknown"):
            tried(tmp_path, text, setup=origins, drift=placed)


def test_short_cuts_take_as_long_as_they_did(tmp_path: Path) -> None:
    """A correction of 25 um that is due in a move of 0.1 mm at 10 mm/min would make it 25 % longer."""
    text = f"{BEGIN}S1000 M3\nG0 X0 Y0 Z0.6\nG4 P100\nG1 Z0 F10\nX0.1\nX0.2\nG4 P200\nG1 Z-0.6 F10\nG0 Z5\nM2\n"
    trial = tried(tmp_path, text)
    for stored in STATES[:1]:
        first, second = moves(trial.original, stored), moves(trial.revised, stored)
        for (a, b), (c, d) in zip(pairwise(first), pairwise(second), strict=True):
            if b.kind == "feed":
                was, now = math.dist(a.machine[:3], b.machine[:3]), math.dist(c.machine[:3], d.machine[:3])
                assert abs(now - was) <= max(0.02 * was, 0.005 * 10 / 60)


@pytest.mark.parametrize("stop", ["M0", "M1"])
def test_a_stop_comes_after_the_move_of_its_line(stop: str, tmp_path: Path) -> None:
    """The operator moves the axes, and nobody knows any more what they carry: their place cannot be named."""
    with pytest.raises(ProgramError, match="line 4: the position of X before this line is unknown"):
        tried(tmp_path, f"{BEGIN}S1000 M3\nX5 Y5 Z2 F100 G1 {stop}\nG92 X0\nG0 Z5\nM2\n")


def test_a_place_behind_a_tool_change_has_no_name(tmp_path: Path) -> None:
    """The changer moves the axes, and nobody knows any more what they carry."""
    with pytest.raises(ProgramError, match="line 5: the position of X before this line is unknown"):
        tried(tmp_path, f"{BEGIN}S1000 M3\nG0 X5 Y5 Z2\nT1 M6\nG92 X0\nG0 Z5\nM2\n")


def test_an_offset_is_taken_up_by_rapids_alone(tmp_path: Path) -> None:
    """X and Y of a renewed offset would move in the cuts that name them first: a square would become a wedge."""
    text = f"{BEGIN}S6000 M3\nG0 X10 Y0 Z50\nG4 P100\nG0 Z2\nG1 Z-1 F300\nX100\nY50\nX10\nY0\nG0 Z50\nX0 Y0\nM2\n"
    trial = tried(tmp_path, text, "offset", drift=Growing())
    cuts = [row.carried[:2] for row in trial.rows if row.block and row.block.moves and not row.block.moves[-1].rapid]
    assert len(set(cuts)) == 1
    assert len({row.carried[2] for row in trial.rows}) > 2
