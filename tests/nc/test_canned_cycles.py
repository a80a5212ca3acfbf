"""Canned cycles: the moves LinuxCNC makes, and words that stay in force."""

import pytest

from thermocomp.core.exceptions import ProgramError
from thermocomp.nc.interpreter.block import Block, Modal, Setup
from thermocomp.nc.interpreter.cycles import CannedCycle, CycleError
from thermocomp.nc.interpreter.interpret import follow_program
from thermocomp.nc.parser.tokens import read_lines, split_lines


def run(text: str, setup: Setup | None = None) -> list[Block]:
    setup = setup or Setup(inch=False)
    return list(follow_program(read_lines(split_lines(text), setup.controller), setup))


def ways(block: Block) -> list[tuple[str, float, float, float]]:
    """Moves that lead anywhere."""
    made = []
    for move in block.moves:
        if move.start != move.end:
            x, y, z = (round(v, 9) for v in move.end)
            made.append(("rapid" if move.rapid else "feed", x, y, z))
    return made


def test_drilling_goes_back_to_where_it_came_from_or_to_r() -> None:
    blocks = run("F100 G0 Z5 G98\nG81 X1 Z-1 R2\nG99 X2\n")
    assert ways(blocks[1]) == [("rapid", 1, 0, 5), ("rapid", 1, 0, 2), ("feed", 1, 0, -1), ("rapid", 1, 0, 5)]
    assert ways(blocks[2]) == [("rapid", 2, 0, 5), ("rapid", 2, 0, 2), ("feed", 2, 0, -1), ("rapid", 2, 0, 2)]


def test_back_to_the_first_level_after_r() -> None:
    """From R LinuxCNC goes to the next hole and to the first level at once; from a hair above R it stays there."""
    blocks = run("F100 G0 Z5 G98\nG81 X1 Z-1 R2\nG99 X2\nG98 X3\n")
    assert ways(blocks[3]) == [("rapid", 3, 0, 5), ("rapid", 3, 0, 2), ("feed", 3, 0, -1), ("rapid", 3, 0, 5)]
    assert blocks[3].known == (True, False, True)
    with pytest.raises(ProgramError, match="almost the same R"):
        run("F100 G0 Z5 G98\nG81 X1 Z-1 R2.00002\nG99 X2\nG98 X3 R2\n")


@pytest.mark.parametrize("codes", ["G99", "G98", ""])
def test_where_a_cycle_ends_is_certain_if_the_level_is_or_by_g99(codes: str) -> None:
    unknown = f"F100 {codes}\nG81 X1 Y1 Z-1 R2\nX2\n"
    assert [b.known[2] for b in run(f"{unknown}G80\n")[1:]] == [codes == "G99"] * 3
    above = run(f"F100 {codes}\nG0 Z5\nG81 X1 Y1 Z-1 R2\n")[-1]
    assert above.known[2] is (codes != "")
    below = run(f"F100 {codes}\nG0 Z1\nG81 X1 Y1 Z-1 R2\n")[-1]
    assert below.known[2]
    assert not run(f"F100 {codes}\nG0 Z5\nG91 G81 X1 Y1 Z-1 R2\nM0\n")[-1].known[2]
    for stop in ("M0", "M6 T1"):  # the level is where the axes stood before
        assert run(f"F100 {codes}\nG0 Z5\nG81 X1 Y1 Z-1 R2\n{stop}\nX2\n")[-1].known[2] is (codes == "G99")
    assert not run(f"F100 {codes}\nG91 G81 X1 Y1 Z-1 R2\n")[-1].known[2]  # R counts from there


def test_the_tool_goes_up_to_r_first() -> None:
    (block,) = run("F100 G81 X1 Z-1 R2")
    assert ways(block) == [("rapid", 0, 0, 2), ("rapid", 1, 0, 2), ("feed", 1, 0, -1), ("rapid", 1, 0, 2)]


def test_incremental_with_repeats_counts_r_from_the_first_level() -> None:
    blocks = run("F100 G0 Z5 G99\nG91 G81 X1 Y2 R-2 Z-3 L2\nX1\n")
    ends = [w for w in ways(blocks[1]) if w[0] == "feed"]
    assert ends == [("feed", 1, 2, 0), ("feed", 2, 4, 0)]
    assert blocks[2].end == (3.0, 4.0, 3.0)


def test_pecks() -> None:
    (block,) = run("F100 G83 X0 Z-1 R2 Q1")
    assert [w[3] for w in ways(block)] == [2, 1, 2, 1.254, 0, 2, 0.254, -1, 2]
    (block,) = run("F100 G73 X0 Z-1 R2 Q2")
    assert [w[3] for w in ways(block)] == [2, 0, 0.254, -1, 2]
    (block,) = run("F10 G73 X0 Z-1 R2 Q2", Setup(inch=True))
    assert [w[3] / 25.4 for w in ways(block)] == pytest.approx([2, 0, 0.01, -1, 2])


@pytest.mark.parametrize(
    ("code", "rapid_out", "pause"),
    [("G81", True, 0.0), ("G82", True, 0.5), ("G85", False, 0.0), ("G86", True, 0.5), ("G89", False, 0.5)],
)
def test_the_way_out(code: str, rapid_out: bool, pause: float) -> None:
    word = "P0.5" if pause else ""
    block = run(f"S1 M3 F100\n{code} X0 Z-1 R2 {word}")[-1]
    assert block.moves[-1].end[2] == 2.0
    assert [m.rapid for m in block.moves if m.start[2] == -1.0] == [rapid_out]
    assert block.pause == pause


def test_taps() -> None:
    block = run("S1 M3 F100\nG84 X0 Z-1 R2\n")[-1]
    assert [m.rapid for m in block.moves][-2:] == [False, False]
    block = run("S300 F100\nG74 X0 Z-1 R2\n", Setup("fanuc", inch=False))[-1]
    assert block.speed == -300.0  # Fanuc starts the spindle for the tap


def test_sticky_words() -> None:
    blocks = run("F100 G0 Z5\nG83 X1 Z-1 R2 Q1\nX2 Q3\nX3 Z-2\nG80\n")
    assert blocks[1].sticky == {"Z": -1.0, "R": 2.0, "Q": 1.0}
    assert blocks[2].sticky == {"Z": -1.0, "R": 2.0, "Q": 3.0}
    assert blocks[3].sticky == {"Z": -2.0, "R": 2.0, "Q": 3.0}
    assert blocks[3].kind == "cycle"
    assert blocks[4].modal.motion == ""


def test_other_planes() -> None:
    block = run("F100 G19 G0 X5\nG81 Y1 Z-1 R2 X0\n")[-1]
    assert ways(block) == [("rapid", 5, 1, -1), ("rapid", 2, 1, -1), ("feed", 0, 1, -1), ("rapid", 2, 1, -1)]


def test_what_is_known_after_a_cycle() -> None:
    blocks = run("F100 G98\nG81 X1 Y1 Z-1 R-0.5\nG99 X2\nG80\n")
    assert blocks[1].known == (True, True, False)  # back where it was, and nobody knows where
    assert blocks[2].known == (True, True, True)


@pytest.mark.parametrize("shift", [0.0, 0.0123456, -1 / 3])
def test_the_number_of_moves_does_not_depend_on_a_shift(shift: float) -> None:
    made = [
        len(list(CannedCycle(Modal("G81", retract=retract), (0.0, 0.0, start), {"X": 1.0}, sticky, start, 2).steps()))
        for retract in (98, 99)
        for start in (2.0 + shift, 5.0)
        for sticky in ({"R": 2.0 + shift, "Z": -1.0 + shift},)
    ]
    assert made == [9, 9, 9, 9]


def test_impossible_cycles() -> None:
    with pytest.raises(CycleError, match="below the bottom"):
        list(CannedCycle(Modal("G81", retract=99), (0.0, 0.0, 5.0), {}, {"R": 1.0, "Z": 2.0}, 5.0).steps())
    with pytest.raises(CycleError, match="pecks"):
        list(CannedCycle(Modal("G83", retract=99), (0.0, 0.0, 5.0), {}, {"R": 1.0, "Z": 0.0, "Q": 1e-9}, 5.0).steps())


@pytest.mark.parametrize("text", ["G81 X1 Z-1 R1 L999999999", "G83 X1 Z-10 R1 Q0.01 L9999"])
def test_repeats_have_a_bound(text: str) -> None:
    with pytest.raises(ProgramError, match=r"line 2: G8[13]: \d+ repeats make more than 100000 strokes"):
        run(f"G21 G90 G94 G99 G0 X0 Y0 Z5 F100\n{text}\n")
