"""A proof in eight controllers: one thing is changed in a program that is right, and the proof names it."""

import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest
from test_precompensation_proof import NONE, PLAIN, Vector, ledger, shift, write

from thermocomp.core.exceptions import ProgramError, Unprovable
from thermocomp.nc.interpreter.block import Setup
from thermocomp.nc.linuxcnc.verification import states
from thermocomp.nc.linuxcnc.verification.verify import Proof, prove

pytestmark = pytest.mark.usefixtures("interpreter")

HEAD = "G21 G90 G17 G40 G80 G94 G54\n"
Rows = list[tuple[Vector, Vector]]


def judge(folder: Path, original: str, revised: str, rows: Rows, setup: Setup = PLAIN, **lines: object) -> Proof:
    return prove(*write(folder, original, revised), ledger(rows, **lines), setup)  # type: ignore[arg-type]


# -- N1: a feed of a rotary axis alone ----------------------------------------------------------------------------

TURN = HEAD + (
    "T1 M6\nG43 H1\nS12000 M3\nG0 X10 Y0 Z20 A0\nG0 Z2\nG1 X10 Y0 Z-1 A0 F300\nG1 X10 Y0 Z-1 A360 F720\nM30\n"
)
STEPS: Rows = [*[shift()] * 6, shift(0, 0, 50), shift(0, 0, 51)]


def test_a_rotary_axis_that_turns_alone_turns_alone(tmp_path: Path) -> None:
    right = TURN.replace("Z-1", "Z-0.95")
    judge(tmp_path, TURN, right, [*STEPS[:7], shift(0, 0, 50)])
    wrong = TURN.replace("Z-1 A0", "Z-0.95 A0").replace("Z-1 A360", "Z-0.949 A360")
    with pytest.raises(
        ProgramError, match=r"moves X, Y, Z by 1\.00 um where the original moves a rotary axis only"
    ) as e:
        judge(tmp_path, TURN, wrong, STEPS)
    assert e.value.line == 8
    assert "please report" in e.value.reason


def test_a_rapid_that_moves_nothing_moves_nothing(tmp_path: Path) -> None:
    """It may take a correction in only if nobody knows where it started."""
    original = HEAD + "G0 X0 Y0 Z20\nG0 X0\nM2\n"
    revised, rows = original.replace("G0 X0\n", "G0 X0.01\n"), [shift(), shift(), shift(10)]
    with pytest.raises(ProgramError, match=r"line 3: .*by 10\.00 um where the original moves nothing"):
        judge(tmp_path, original, revised, rows)
    judge(tmp_path, original, revised, rows, placed=False)


def test_the_rounding_of_inches_is_no_move_unless_a_rotary_axis_turns(tmp_path: Path) -> None:
    """Two inches and 50.8 mm are one place; with a correction they are two, 0.04 um apart."""
    first, rows = HEAD + "G0 X0 Y0 Z20 A0\nG1 X50.8 F100\n", [shift(), shift(), shift(10), shift(10)]
    moved = first.replace("X50.8", "X50.81")
    judge(tmp_path, first + "G1 X50.8\nM2\n", moved + "G1 X50.81004\nM2\n", rows)
    with pytest.raises(ProgramError, match=r"line 4: .*by 0\.20 um where the original moves nothing"):
        judge(tmp_path, first + "G1 X50.8\nM2\n", moved + "G1 X50.8102\nM2\n", [*rows[:3], shift(10.2)])
    with pytest.raises(ProgramError, match=r"by 0\.04 um where the original moves a rotary axis only"):
        judge(tmp_path, first + "G1 X50.8 A90 F360\nM2\n", moved + "G1 X50.81004 A90 F360\nM2\n", rows)


def test_a_circle_stays_one(tmp_path: Path) -> None:
    """So small and fast a one that its time does not tell."""
    original = HEAD + "G0 X0.05 Y0 Z0\nG2 X0.05 Y0 I-0.05 J0 F6000\nM2\n"
    with pytest.raises(ProgramError, match=r"line 3: .*turns by a different angle"):
        judge(tmp_path, original, original.replace("G2 X0.05 Y0", "G2 X0.05 Y-0.00005"), [shift()] * 4)


def test_an_arc_that_may_be_shifted_is_shifted_as_a_whole(tmp_path: Path) -> None:
    original, either = HEAD + "G0 X0 Y0 Z0\nG2 X2 Y0 I1 J0 F100\nM2\n", dict.fromkeys((2, 3, 4), (0.0, 10.0, 0.0))
    judge(tmp_path, original, original, [shift()] * 4, others=either)
    judge(tmp_path, original, original.replace("Y0", "Y0.01"), [shift()] * 4, others=either)
    with pytest.raises(ProgramError, match=r"line 3: .*moves Y of an arc's centre by 10\.00 um instead of 0\.00 um"):
        judge(tmp_path, original, original.replace("J0", "J0.01"), [shift()] * 4, others=either)


def test_a_call_belongs_to_its_line(tmp_path: Path) -> None:
    original = HEAD + "G0 X0 Y0 Z20\nM8\n\nM2\n"
    with pytest.raises(ProgramError, match=r"line 3: .*makes a 'flood' that belongs to line 4"):
        judge(tmp_path, original, original.replace("M8\n\n", "\nM8\n"), [shift()] * 5)


def test_a_move_takes_as_long(tmp_path: Path) -> None:
    """A hair's breadth of a linear axis beside a rotary one: twice the way is half the feed of the rotary axis."""
    original = HEAD + "G0 X0 Y0 Z0 A0\nG1 X0.1 A90 F1\nM2\n"
    revised = original.replace("X0.1", "X0.11")
    with pytest.raises(ProgramError, match=r"line 3: .* it takes 6\.6 s for a move of 6 s; please report"):
        judge(tmp_path, original, revised, [shift(), shift(), shift(10)])
    proof = judge(tmp_path, original, original.replace("X0.1", "X0.101"), [shift(), shift(), shift(1)])
    assert proof.slower == pytest.approx(1.0)


def test_what_is_given_back_takes_the_time_of_its_feed(tmp_path: Path) -> None:
    original = HEAD + "G49 G0 X0 Y0 Z0\nG1 Z-1 F60\nG53 G1 Z-2 F60\nM2\n"
    revised = original.replace("Z0", "Z0.05").replace("Z-1", "Z-0.95")
    rows: Rows = [shift(), shift(0, 0, 50), shift(0, 0, 50), shift()]
    here = replace(PLAIN, offsets={1: NONE})
    judge(tmp_path, original, revised, rows, here, machine=[4])
    with pytest.raises(ProgramError, match=r"line 4: .* it takes 1\.05 s for a move of 1 s"):
        judge(tmp_path, original, revised, rows, here)
    with pytest.raises(ProgramError, match=r"line 4: .*gives 'feedrate' 59 59 instead"):
        judge(tmp_path, original, revised.replace("Z-2 F60", "Z-2 F59"), rows, machine=[4])


def test_a_short_move_takes_as_long(tmp_path: Path) -> None:
    original = HEAD + "G0 X0 Y0 Z0\nG1 X0.1 F60\nM2\n"
    with pytest.raises(ProgramError, match=r"line 3: .* it takes 0\.11 s for a move of 0\.1 s"):
        judge(tmp_path, original, original.replace("X0.1", "X0.11"), [shift(), shift(), shift(10)])
    judge(tmp_path, original, original.replace("X0.1", "X0.104"), [shift(), shift(), shift(4)])


def test_a_feed_that_is_another_for_a_rotary_axis_is_found(tmp_path: Path) -> None:
    original = HEAD + "G0 X0 Y0 Z0 A0\nG93\nG1 A90 F2\nG94\nM2\n"
    with pytest.raises(ProgramError, match=r"takes 29\.85 s for a move of 30 s"):
        judge(tmp_path, original, original.replace("F2", "F2.01"), [shift()] * 6, inverse=[3, 4])
    judge(tmp_path, original, original, [shift()] * 6, inverse=[3, 4])


@pytest.mark.parametrize(
    ("words", "changed", "seconds"),
    [
        ("G95\nG1 X10 F0.1", "G95\nG1 X11 F0.1", "6.6 s for a move of 6 s"),
        ("G1 Z-1 F10\nG33 Z-11 K0.1", "G1 Z-1 F10\nG33 Z-12 K0.1", "6.6 s for a move of 6 s"),
        ("F10\nG3 X0 Y0 I5 J0 Z0", "F10\nG3 X0 Y0 I5 J0 Z20", "223.5 s for a move of 188.5 s"),
    ],
)
def test_turns_and_helices_have_their_time(tmp_path: Path, words: str, changed: str, seconds: str) -> None:
    head = HEAD + "S1000 M3\nG0 X0 Y0 Z0\n"
    of = {"X11": (1000.0, 0.0, 0.0), "Z-12": (0.0, 0.0, -1000.0), "Z20": (0.0, 0.0, 20000.0)}
    most = next(vector for word, vector in of.items() if word in changed)
    rows: Rows = [shift()] * 4 + [(most, most)]
    with pytest.raises(ProgramError, match="takes " + re.escape(seconds)):
        judge(tmp_path, head + words + "\nM2\n", head + changed + "\nM2\n", rows)


# -- N2: where a cycle ends ---------------------------------------------------------------------------------------

LEVEL = HEAD + (
    "G53 G0 Z0\nT1 M6\nG43 H1\nS12000 M3\nG0 X10 Y0\n{}G81 X10 Y0 Z-5 R2 F100\nG80\nG4 P300\nG0 X80{}\nM30\n"
)


@pytest.mark.parametrize("retract", ["G98 ", ""])
def test_a_word_after_a_cycle_that_ends_nobody_knows_where(tmp_path: Path, retract: str) -> None:
    rows: Rows = [*[shift()] * 6, (NONE, (0.0, 0.0, 50.0)), *[shift()] * 2, shift(0, 0, 51.6)]
    original = LEVEL.format(retract, "")
    wrong = LEVEL.format(retract, " Z2.0516").replace("Z-5 R2", "Z-4.95 R2.05")
    with pytest.raises(ProgramError, match=r"moves Z by -?\d+\.\d+ um instead of") as e:
        judge(tmp_path, original, wrong, rows)
    assert e.value.line in (7, 10)


def test_what_a_correction_depends_on_is_said(tmp_path: Path) -> None:
    """Right where G99 is in force, as the interpreter begins: a control that stands in G98 is not at R."""
    original = HEAD + "G0 X0 Y0 Z20\nG81 X10 Y0 Z-5 R2 F100\nG80\nG0 X80\nM2\n"
    revised = original.replace("Z-5 R2", "Z-4.95 R2.05").replace("X80", "X80 Z2.05")
    rows: Rows = [shift(), shift(), *[shift(0, 0, 50)] * 3]
    judge(tmp_path, original, revised, rows, replace(PLAIN, startup="G99"))
    with pytest.raises(ProgramError, match=r"with other values of G98/G99.*--startup") as e:
        judge(tmp_path, original, revised, rows)
    assert "please report" not in e.value.reason


def test_an_unstated_rotation_turns_a_correction(tmp_path: Path) -> None:
    original = HEAD + "G0 X0 Y0 Z20\nG1 X10 F100\nM2\n"
    in_x = [shift(), shift(), shift(10)]
    unstated = Setup(inch=False)
    with pytest.raises(ProgramError, match=r"X or Y turns with the rotation .*--rotation none") as e:
        judge(tmp_path, original, original.replace("X10", "X10.01"), in_x, unstated)
    assert "please report" not in e.value.reason
    assert e.value.line == 3
    in_z = [shift(), shift(0, 0, 20), shift(0, 0, 20)]
    proof = judge(tmp_path, original, original.replace("Z20", "Z20.02"), in_z, unstated)
    assert "rotation" in proof.drawn
    assert "G92" in proof.drawn


def test_a_system_that_is_not_named_may_be_any(tmp_path: Path) -> None:
    """Where G54 gets its origin from the place of the tool, Z20 is another place, if G54 is in force."""
    original = HEAD.replace(" G54", "") + "G0 X0 Y0 Z20\nG10 L20 P1 Z0\nX10\nZ20\nM2\n"
    revised = original.replace("Y0 Z20", "Y0 Z20.01").replace("P1 Z0", "P1 Z0.01").replace("\nZ20", "\nZ20.012")
    rows: Rows = [shift(), *[shift(0, 0, 10)] * 3, shift(0, 0, 12)]
    judge(tmp_path, "G54" + original, "G54" + revised, rows)
    with pytest.raises(ProgramError, match=r"line 5: .* with other values of system in force.*write G54 before"):
        judge(tmp_path, original, revised, rows)


def test_a_shift_in_force_is_lost_by_an_offset(tmp_path: Path) -> None:
    original = HEAD + "G0 X0 Y0 Z20\nG1 X10 F100\nM2\n"
    revised = HEAD + "G90 G52 Z-0.02\nG0 X0 Y0 Z20\nG1 X10 F100\nM2\n"
    rows: Rows = [shift(), shift(0, 0, -20), shift(0, 0, -20)]
    with pytest.raises(ProgramError, match=r"with other values of G92.*--no-g92"):
        judge(tmp_path, original, revised, rows, replace(PLAIN, no_shift=False), texts={2: 2})
    assert judge(tmp_path, original, revised, rows, texts={2: 2}).moves == 2


def test_an_arc_from_where_the_machine_happens_to_stand(tmp_path: Path) -> None:
    original = HEAD + "G2 X2 Y0 I1 J0 F100\nM2\n"
    with pytest.raises(Unprovable, match=r"line 2: the tool position depends on .*start"):
        judge(tmp_path, original, original, [shift()] * 3)


def test_an_arc_from_a_place_in_another_system(tmp_path: Path) -> None:
    original = HEAD + "G0 X0 Y0 Z5\nG55\nG2 X2 Y0 I1 J0 F100\nM2\n"
    with pytest.raises(Unprovable, match=r"line 4: the tool position depends on .*\(origins\).*--origin"):
        judge(tmp_path, original, original, [shift()] * 5)


def test_what_does_not_run_with_a_drawn_tool_is_proved_without_one(tmp_path: Path) -> None:
    original = HEAD + "T1 M6\nG0 X0 Y0 Z0\nG41 G1 X5 F100\nX10\nG3 X10 Y0.02 I0 J0.01\nG1 X5\nG40 X0\nM2\n"
    proof = judge(tmp_path, original, original, [shift()] * 9)
    assert re.search(r"tool diameters \(not in [1-8] of them, where it does not run\)", proof.sentence)


def test_the_sentence(tmp_path: Path) -> None:
    setup = Setup(inch=False, tools={1: 120.0}, offsets={1: (0.0, 0.0, -400.0)}, rotations={1: 5.0}, startup="G98")
    proof = judge(tmp_path, TURN, TURN, [shift()] * 9, setup)
    assert proof.sentence.startswith(
        "in 8 controller states; equal in all: what the program specifies, mm, G54 at X0 Y0 Z-400, tool 1 = 120 mm, "
        "G54 turned by"
    )
    assert proof.states == 8
    assert not {"unit", "G98/G99"} & set(proof.drawn)
    assert {"origins", "tool lengths", "homes", "start", "rotation", "G92"} <= set(proof.drawn)


def test_the_states_are_extreme_and_hold_what_is_stated() -> None:
    setup = Setup(tools={7: 99.0}, offsets={2: (1.0, 2.0, 3.0)}, rotations={3: 4.0}, home=(5.0, 6.0, 7.0))
    program = Path("part.ngc")
    drawn = [states.state(setup, number, set(states.list_unstated(setup)), program) for number in range(states.STATES)]
    told = {(s.stored.startup[-3:], len(s.stored.rotations) > 1, any(s.stored.shift)) for s in drawn}
    assert len(told) == 8
    assert sum(s.block_delete for s in drawn) == sum(s.inch for s in drawn) == 4
    for s in drawn:
        assert s.stored.lengths[7] == 99.0
        assert s.stored.origins[2][:3] == (1.0, 2.0, 3.0)
        assert s.stored.rotations[3] == 4.0
        assert s.stored.home28[:3] == (5.0, 6.0, 7.0)
        assert s.stored.start is not None
        assert all(s.stored.start)
    assert len({s.stored.start[2] > 0 for s in drawn if s.stored.start}) == 2
    for one, other in pairwise(drawn):
        assert one.stored.origins[1] != other.stored.origins[1]
        assert one.stored.lengths[1] != other.stored.lengths[1]
        assert one.stored.home30 != other.stored.home30
        assert one.stored.diameters[1] != other.stored.diameters[1]
        assert one.stored.parameters[100] != other.stored.parameters[100]
        assert one.stored.start != other.stored.start
        assert one.stored.active_length != other.stored.active_length
        assert one.stored.spindle != other.stored.spindle
        assert one.stored.system != other.stored.system
    held = replace(setup, inch=True, skip_optional=True, no_shift=True, startup="G98", rotations=PLAIN.rotations)
    for number in range(states.STATES):
        s = states.state(held, number, set(states.list_unstated(held)), program)
        assert s.inch
        assert s.block_delete
        assert not any(s.stored.shift)
        assert not any(s.stored.rotations.values())
        assert s.stored.startup.endswith("G98")


# -- one thing is changed -----------------------------------------------------------------------------------------

MIXED = (
    HEAD + "T1 M6\nG43 H1\nS12000 M3\nM8\nG0 X10 Y0 Z20 A0\nG1 Z-1 F300\nG4 P0.5\nX20 A10\nG3 X20 Y20 I0 J10\n"
    "M7\nM1\nG64 P0.01\nG53 G0 Z0\nM9\nM30\n"
)


@pytest.mark.parametrize(
    ("was", "now", "line", "message"),
    [
        ("F300", "F301", 7, r"gives 'feedrate' 301 301 instead of 300 300"),
        ("S12000", "S12001", 4, "gives 'speed'"),
        ("S12000 M3", "S12000 M4", 4, "makes a 'm4' instead of a 'm3'"),
        ("M8", "M7", 5, "makes a 'mist' instead of a 'flood'"),
        ("G4 P0.5", "G4 P0.6", 8, r"gives 'dwell' 0\.6 instead of 0\.5"),
        ("X20 A10", "X20 A10.01", 9, "moves an axis other than"),
        ("X20 A10", "X20.0002 A10", 9, r"moves X by 0\.20 um instead of 0\.00 um"),
        ("I0 J10", "I0.0002 J10.0002", 10, r"moves [XY] of an arc's centre by"),
        ("G3 X20", "G2 X20", 10, "turns another way"),
        ("I0 J10", "I0 J10 P2", 10, "turns another way"),
        ("M1\n", "M0\n", 12, "makes a 'm0' instead of a 'm1'"),
        ("G64 P0.01", "G64 P0.02", 13, "gives 'path'"),
        ("T1", "T2", 2, "gives 'select' 2 instead of 1"),
        ("M9\n", "\n", 15, "instead of a 'mistoff'"),
        ("G53 G0 Z0", "G53 G0 Z0.001", 14, r"moves Z by 1\.00 um"),
    ],
)
def test_one_thing_is_changed(tmp_path: Path, was: str, now: str, line: int, message: str) -> None:
    assert was in MIXED
    with pytest.raises(ProgramError, match=message) as found:
        judge(tmp_path, MIXED, MIXED.replace(was, now), [shift()] * 17)
    assert found.value.line == line
    assert "please report" in found.value.reason


def test_a_line_more_or_less_is_found(tmp_path: Path) -> None:
    assert judge(tmp_path, MIXED, MIXED, [shift()] * 17).moves == 5
    with pytest.raises(ProgramError, match=r"line (9|10): "):
        judge(tmp_path, MIXED, MIXED.replace("X20 A10\n", "X20 A10\nX20 A10\n"), [shift()] * 17)
    with pytest.raises(ProgramError, match=r"line (9|10): "):
        judge(tmp_path, MIXED, MIXED.replace("X20 A10\n", ""), [shift()] * 17)


# -- lines that are divided ---------------------------------------------------------------------------------------

LONG = HEAD + "G0 X0 Y0 Z0\nG1 X100 Y50 F1000\nG1 X0\nM2\n"
RAMP: Rows = [shift(), shift(), shift(0, 0, 20), shift(0, 0, 20), shift(0, 0, 20)]


def divided(*pieces: str) -> str:
    return LONG.replace("G1 X100 Y50 F1000\n", "".join(f"{piece}\n" for piece in pieces)).replace("X0\nM2", "X0\nM2")


def test_a_line_may_be_divided(tmp_path: Path) -> None:
    pieces = divided("G1 X25 Y12.5 Z0.005 F1000", "X50 Y25 Z0.012", "X100 Y50 Z0.02")
    proof = judge(tmp_path, LONG, pieces, RAMP, texts={3: 3}, knots={3: ((0.0, 0.0, 5.0), (0.0, 0.0, 12.0))})
    assert proof.moves == 3
    for knots in ((), ((0.0, 0.0, 5.0),), ((0.0, 0.0, 5.2), (0.0, 0.0, 12.0)), ((5.0, 0.0, 5.0), (0.0, 0.0, 12.0))):
        with pytest.raises(ProgramError, match=r"line 3: .*(into pieces other than|off its path)"):
            judge(tmp_path, LONG, pieces, RAMP, texts={3: 3}, knots={3: knots})


@pytest.mark.parametrize(
    ("pieces", "message"),
    [
        (("G1 X25 Y12.5 Z0.005 F1000", "X50 Y25.0003 Z0.01", "X100 Y50 Z0.02"), "line 3: .*a piece of a divided move"),
        (("G1 X25 Y12.5 Z0.0202 F1000", "X50 Y25 Z0.01", "X100 Y50 Z0.02"), r"Z by 15\.20 um"),
        (("G1 X50 Y25 Z0.01 F1000", "X25 Y12.5 Z0.01", "X100 Y50 Z0.02"), "a piece of a divided move|takes"),
        (("G1 X25 Y12.5 Z0.005 F1000", "X50 Y25 Z0.01", "X100 Y50 Z0.0202"), r"moves Z by 20\.20 um"),
        (("G1 X25 Y12.5 Z0.005 F1000", "G0 X50 Y25 Z0.01", "G1 X100 Y50 Z0.02"), "line 3: .*moves X by"),
        (("G1 X25 Y12.5 Z0.005 F1000", "X50 Y25 Z0.01 F900", "X100 Y50 Z0.02"), "line 3: .*moves X by"),
    ],
)
def test_a_piece_beside_its_way_is_found(tmp_path: Path, pieces: tuple[str, ...], message: str) -> None:
    with pytest.raises(ProgramError, match=message):
        judge(tmp_path, LONG, divided(*pieces), RAMP, texts={3: 3}, knots={3: ((0.0, 0.0, 5.0), (0.0, 0.0, 10.0))})


@pytest.mark.parametrize(
    "ends",
    [("X50 Y25", "X49.9 Y24.95"), ("X-0.4 Y-0.2", "X50 Y25"), ("X50 Y25", "X100.4 Y50.2"), ("X50 Y25", "X50 Y25")],
)
def test_pieces_go_on(tmp_path: Path, ends: tuple[str, str]) -> None:
    """The way of those that go back, or begin before the start, is longer by less than what time tells."""
    pieces = divided(f"G1 {ends[0]} Z0.01 F1000", f"{ends[1]} Z0.01", "X100 Y50 Z0.02")
    with pytest.raises(ProgramError, match=r"line 3: .*a piece of a divided move"):
        judge(tmp_path, LONG, pieces, RAMP, texts={3: 3}, knots={3: ((0.0, 0.0, 10.0), (0.0, 0.0, 10.0))})


def test_no_other_pieces_than_were_asked_for(tmp_path: Path) -> None:
    pieces = divided("G1 X50 Y25 F1000", "X100 Y50")
    judge(tmp_path, LONG, pieces, [shift()] * 5, texts={3: 2}, knots={3: (NONE,)})
    for knots in ({}, {3: (NONE, NONE)}):
        with pytest.raises(ProgramError, match=r"line 3: .*pieces other than those specified"):
            judge(tmp_path, LONG, pieces, [shift()] * 5, texts={3: 2}, knots=knots)


def test_pieces_turn_evenly(tmp_path: Path) -> None:
    original = LONG.replace("Z0\n", "Z0 A0\n").replace("Y50 F", "Y50 A90 F")
    pieces = original.replace("X100 Y50 A90 F1000\n", "X50 Y25 Z0.01 A45 F1000\nX100 Y50 Z0.02 A90\n")
    knots = {3: ((0.0, 0.0, 10.0),)}
    judge(tmp_path, original, pieces, RAMP, texts={3: 2}, knots=knots)
    with pytest.raises(ProgramError, match=r"line 3: .*a piece of a divided move"):
        judge(tmp_path, original, pieces.replace("A45", "A45.1"), RAMP, texts={3: 2}, knots=knots)


def test_pieces_may_bow(tmp_path: Path) -> None:
    pieces = divided("G1 X25 Y12.5 Z0.023 F1000", "X50 Y25 Z0.02", "X100 Y50 Z0.02")
    judge(tmp_path, LONG, pieces, RAMP, texts={3: 3}, knots={3: ((0.0, 0.0, 23.0), (0.0, 0.0, 20.0))})
    with pytest.raises(ProgramError, match="a piece of a divided move"):
        judge(tmp_path, LONG, pieces, RAMP, texts={3: 3}, knots={3: ((0.0, 0.0, 22.8), (0.0, 0.0, 20.0))})


def test_a_piece_of_a_slope_carries_what_it_should(tmp_path: Path) -> None:
    """Its end is not beside the way because it lies before or behind that of its neighbours."""
    original = HEAD + "G0 X0 Y0 Z190\nG1 X200 Z-80 F600\nM2\n"
    pieces = original.replace("G1 X200 Z-80 F600\n", "G1 X100 Z55.03 F600\nX150 Z-12.52\nX200 Z-80\n")
    knots = ((0.0, 0.0, 30.0), (0.0, 0.0, -20.0))
    judge(tmp_path, original, pieces, [shift()] * 4, texts={3: 3}, knots={3: knots})
    with pytest.raises(ProgramError, match=r"line 3: .*off its path: X by 0\.2"):
        judge(tmp_path, original, pieces.replace("X150", "X150.0004"), [shift()] * 4, texts={3: 3}, knots={3: knots})


def test_a_line_that_is_run_again_is_divided_each_time(tmp_path: Path) -> None:
    original = HEAD + "G0 X0 Y0 Z0 F500\nG91\no1 repeat [3]\nG1 X10\no1 endrepeat\nG90\nM2\n"
    pieces = original.replace("G1 X10\n", "G1 X4\nX6\n")
    knots = {5: (shift()[0],)}
    assert judge(tmp_path, original, pieces, [shift()] * 8, texts={5: 2}, knots=knots).moves == 4
    with pytest.raises(ProgramError):
        judge(tmp_path, original, pieces.replace("X6", "X6.0003"), [shift()] * 8, texts={5: 2}, knots=knots)


ARC = HEAD + "G0 X10 Y0 Z0\nG3 X-10 Y0 I-10 J0 F1000\nG1 X0\nM2\n"
FLAT: Rows = [shift(), shift(0, 0, 20), shift(0, 0, 26), shift(0, 0, 26), shift()]


@pytest.mark.parametrize("plane", ["G17", "G18", "G19"])
def test_an_arc_may_be_divided(tmp_path: Path, plane: str) -> None:
    original, pieces = (
        ARC,
        ARC.replace("Z0\n", "Z0.02\n").replace(
            "G3 X-10 Y0 I-10 J0 F1000\n",
            "G3 X6 Y8 Z0.022 I-10 J0 F1000\nX-6 Y8 Z0.024 I-6 J-8\nX-10 Y0 Z0.026 I6 J-8\n",
        ),
    )
    rows, k = FLAT, 2
    if plane != "G17":
        turned = str.maketrans("XYZIJK", "ZXYKIJ" if plane == "G18" else "YZXJKI")
        original, pieces = (
            t.replace("G17", "").translate(turned).replace("G3", f"{plane} G3") for t in (original, pieces)
        )
        k = 1 if plane == "G18" else 0
        rows = [(tuple(r[0][2] if i == k else 0.0 for i in range(3)),) * 2 for r in FLAT]  # type: ignore[misc]
    inside: list[Vector] = []
    for up in (22.0, 24.0):
        x, y, z = (up if i == k else 0.0 for i in range(3))
        inside.append((x, y, z))
    knots = {3: tuple(inside)}
    assert judge(tmp_path, original, pieces, rows, texts={3: 3}, knots=knots).moves == 3
    for was, now in (("8 ", "8.0004 "), ("-6 ", "-5.9996 "), ("0.024", "0.0264")):
        with pytest.raises(ProgramError, match=r"line 3: .*(piece of a divided move|moves|refuses)"):
            judge(tmp_path, original, pieces.replace(was, now), rows, texts={3: 3}, knots=knots)


#: pieces that carry nothing
FLAT_INSIDE = {3: (NONE,)}


@pytest.mark.parametrize(("first", "second"), [("G3", "G2"), ("G2", "G3")])
def test_an_arc_in_pieces_keeps_its_turn(first: str, second: str, tmp_path: Path) -> None:
    """Half a circle takes as long either way."""
    original = HEAD + "G0 X10 Y0 Z0\nG3 I-10 J0 F1000\nM2\n"
    pieces = original.replace("G3 I-10 J0 F1000\n", f"{first} X-10 I-10 J0 F1000\n{second} X10 I10\n")
    with pytest.raises(ProgramError, match=r"line 3: .*(turns another way|a piece of a divided move)"):
        judge(tmp_path, original, pieces, [shift()] * 4, texts={3: 2}, knots=FLAT_INSIDE)


def test_an_arc_in_pieces_keeps_its_centre(tmp_path: Path) -> None:
    """Where a piece is nearly a circle its end hardly tells of another centre."""
    original = HEAD + "G0 X10 Y0 Z0\nG3 I-10 J0 F1000\nM2\n"
    pieces = original.replace("G3 I-10 J0 F1000\n", "G3 X9.998 Y-0.199987 I{} F1000\nX10 Y0 I-9.998 J0.199987\n")
    judge(tmp_path, original, pieces.format("-10 J0"), [shift()] * 4, texts={3: 2}, knots=FLAT_INSIDE)
    with pytest.raises(ProgramError, match=r"line 3: .*a piece of a divided move"):
        judge(tmp_path, original, pieces.format("-9.998 J-0.00002"), [shift()] * 4, texts={3: 2}, knots=FLAT_INSIDE)


def test_a_code_that_is_taken_as_harmless_is_told() -> None:
    assert "M101 moves nothing" in states.describe_setup(replace(PLAIN, harmless=frozenset({101})))
