"""The follower against LinuxCNC's interpreter, and what a block tells beyond the moves."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from oracle_run import Oracle, compare
from random_programs import programs

from thermocomp.core.exceptions import ProgramError
from thermocomp.nc.interpreter.block import Block, Setup
from thermocomp.nc.interpreter.interpret import Follower, follow_program
from thermocomp.nc.parser.tokens import program_lines, read_lines, split_lines

NC_FILES = Path("/usr/share/linuxcnc/ncfiles")
MM = Setup(inch=False)
LENGTHS = {n: float(n) for n in range(1, 100)}

needs_linuxcnc = pytest.mark.usefixtures("interpreter")


def run(text: str, setup: Setup = MM) -> list[Block]:
    return list(follow_program(read_lines(split_lines(text), setup.controller), setup))


@pytest.fixture(scope="module")
def oracle() -> Iterator[Oracle]:
    with Oracle(LENGTHS) as running:
        yield running


@needs_linuxcnc
def test_moves_of_the_nc_files_are_those_of_the_interpreter(oracle: Oracle) -> None:
    followed = moves = 0
    for path in sorted(NC_FILES.rglob("*.ngc")):
        with path.open(encoding="latin-1", newline="") as stream:
            try:
                blocks = list(follow_program(read_lines(program_lines(stream)), Setup(inch=False, tools=LENGTHS)))
            except ProgramError as error:
                assert error.reason  # noqa: PT017
                continue
        ran = oracle.run(path)
        # bare pieces have no end, which the interpreter says when it has run them
        assert ran.error in ("", "File ended with no percent sign or program end"), path
        compared = compare(blocks, ran)
        assert not compared.where, (path, compared)
        assert compared.apart < 1e-6
        followed += 1
        moves += compared.moves
    assert followed >= 20
    assert moves > 7000


@needs_linuxcnc
@settings(
    max_examples=150,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(program=programs)
def test_moves_of_random_programs_are_those_of_the_interpreter(oracle: Oracle, program: str) -> None:
    follower = Follower(Setup(inch=False, tools=LENGTHS))
    blocks = []
    refused = 0
    for line in read_lines(split_lines(program)):
        try:
            blocks.append(follower.step(line))
        except ProgramError as error:
            refused = error.line
            break
    ran = oracle.run(program)
    if refused:  # compare what was before
        ran = ran._replace(out=[event for event in ran.out if event[0] < refused])
        # what the interpreter refuses is never accepted; it may read one line ahead
        assert not ran.error or ran.line >= refused, ran.error
    else:
        assert not ran.error
    compared = compare(blocks, ran)
    assert not compared.where
    assert compared.apart < 1e-6


def test_every_line_gives_a_block_and_nothing_runs_behind_the_end() -> None:
    blocks = run("%\n(start)\nG21 G90 G0 X1\n\nM30\nG0 X5\n%\n")
    assert [b.line.number for b in blocks] == [1, 2, 3, 4, 5, 6, 7]
    assert [b.ends for b in blocks] == [False] * 4 + [True] + [False] * 2
    assert blocks[5].end == (1.0, 0.0, 0.0)
    assert not blocks[5].moves


def test_percent_ends_the_program() -> None:
    blocks = run("%\nG21 G0 X1\n%\nG0 X2\n")
    assert [b.ends for b in blocks] == [False, False, True, False]
    assert blocks[-1].end[0] == 1.0
    with pytest.raises(ProgramError, match="does not begin"):
        run("G21 G0 X1\n%\n")


def test_axes_are_known_once_an_absolute_word_has_come() -> None:
    blocks = run("G54 G21 G90 G0 X1\nG91 Y1\nG90 Z5 Y2\nG53 G0 Z0\nG1 F100 Z1\nG28 X3\nX1\nG54\nG55\n")
    assert [b.known for b in blocks] == [
        (True, False, False),
        (True, False, False),
        (True, True, True),
        (True, True, False),
        (True, True, True),
        (False, True, True),
        (True, True, True),
        (True, True, True),
        (False, False, False),
    ]


def test_a_system_the_setup_knows_tells_the_place_and_nothing_certain() -> None:
    setup = Setup(inch=False, offsets={1: (1.0, 2.0, 3.0), 2: (10.0, 20.0, 30.0)})
    blocks = run("G52 X0 Y0 Z0\nG49 G0 X1 Y1 Z1\nG55\nG0 X1\n", setup)
    assert blocks[1].moves[0].end == (2.0, 3.0, 4.0)
    assert blocks[2].known == (False, False, False)
    assert blocks[2].end == (-8.0, -17.0, -26.0)
    assert blocks[3].moves[0].end == (11.0, 3.0, 4.0)


def test_tool_lengths_that_are_not_known_make_z_uncertain() -> None:
    """What the setup says of a tool tells where the machine is; only the program itself makes it certain."""
    blocks = run("G21 G49 G0 X0 Y0 Z0\nG43 H1\nZ5\nG43 H2\nZ5\nG49\n", Setup(tools={1: 100.0}))
    assert [b.known[2] for b in blocks] == [True, False, True, False, True, False]
    assert blocks[1].end[2] == -100.0
    assert blocks[2].moves[0].end[2] == 105.0
    assert all(b.known[:2] == (True, True) for b in blocks)
    blocks = run("G21 G49 G10 L1 P1 Z100\nG0 Z0\nG43 H1\nG49\n", Setup())
    assert [b.known[2] for b in blocks] == [False, True, True, True]


@pytest.mark.parametrize("controller", ["linuxcnc", "fanuc"])
def test_nothing_is_known_after_a_tool_change(controller: str) -> None:
    """Settings and macros of the machine move axes to the changer."""
    blocks = run("G90 G0 X1. Y1. Z1.\nT2\nM6\nX2.\nT3 M6 G0 Y1.\n", Setup(controller, inch=False))  # type: ignore[arg-type]
    assert [b.known for b in blocks[1:]] == [
        (True, True, True),
        (False, False, False),
        (True, False, False),
        (False, True, False),
    ]
    cycle = run("G90 G0 X1. Z5.\nG98 G81 X1. Z-1. R1. F100\nT1 M6\nX2.\n", Setup(controller, inch=False))  # type: ignore[arg-type]
    assert [b.known[2] for b in cycle] == [True, True, False, False]


def test_snapshots_are_shared() -> None:
    blocks = run("G21 G90 G0 X1\nG1 X2 F100\nX3\nG0 X4\nG1 X5\n")
    assert blocks[1].modal is blocks[2].modal is blocks[4].modal
    assert blocks[0].modal is blocks[3].modal
    assert blocks[0].modal.motion == "G0"


def test_words_and_values() -> None:
    (block,) = run("#1=3\ng1 x [ #1 * 2 ] y-.5 f100 m8 s 500 (cut)\n")[1:]
    assert block.codes == ("G1", "M8")
    assert block.values == {"X": 6.0, "Y": -0.5, "F": 100.0, "S": 500.0}
    assert block.words["X"].value == "[ #1 * 2 ]"
    assert block.speed == 0.0  # M3 has not come


def test_values_are_those_before_the_assignments_of_the_line() -> None:
    blocks = run("#1=5\nG0 X#1 #1=6\nX#1\n")
    assert [b.end[0] for b in blocks] == [0.0, 5.0, 6.0]


@pytest.mark.parametrize(
    ("text", "feed", "seconds"),
    [
        ("G94 F120 G1 X10", 120.0, None),
        ("G93 F2 G1 X10", 0.0, 30.0),
        ("S600 M3\nG95 F0.5 G1 X10", 300.0, 2.0),
        ("S600 M4\nG33 Z-10 K2", 1200.0, 0.5),
        ("G20\nF10 G1 X10", 254.0, None),
        ("G94 F120 G1 A10", 120.0, None),
        ("G20\nF10 G1 A10", 10.0, None),
    ],
)
def test_feeds_and_times(text: str, feed: float, seconds: float | None) -> None:
    (move,) = run(text)[-1].moves
    assert move.feed == pytest.approx(feed)
    assert move.seconds == (None if seconds is None else pytest.approx(seconds))


def test_time_of_an_arc_and_of_a_tap() -> None:
    (move,) = run("S600 M3\nG95 F1 G2 X0 Y0 I10 P2")[-1].moves
    assert move.seconds == pytest.approx(2 * 2 * 3.141592653589793 * 10.0 / 600.0 * 60.0)
    down, up = run("S600 M3\nG33.1 Z-10 K1 I2")[-1].moves
    assert (down.end[2], up.end[2]) == (-10.0, 0.0)
    assert down.seconds == pytest.approx(1.0)
    assert up.seconds == pytest.approx(0.5)


def test_f_beside_g20_is_read_in_the_old_unit_as_linuxcnc_does() -> None:
    assert run("G20 F10 G1 X1")[0].feed == 10.0
    assert run("G20 F10 G1 X1", Setup("fanuc", inch=False))[0].feed == 254.0


def test_speed_and_what_stops_the_spindle() -> None:
    blocks = run("M3 S1000\nS2000\nM4\nM5\nM3\nT1 M6\nM3\nM19\n")
    assert [b.speed for b in blocks] == [1000.0, 2000.0, -2000.0, 0.0, 2000.0, 0.0, 2000.0, 0.0]
    assert run("M3", Setup(speed=800.0))[0].speed == 800.0


def test_pauses_stops_and_tool_changes() -> None:
    blocks = run("G4 P1.5\nM0\nM1\nT7\nM6\nM60\nM66 P0 L3 Q5\nM6 T2\nG21 F100 G82 X1 Z-1 R1 P0.5 L3\n")
    assert [b.pause for b in blocks] == [1.5, 0, 0, 0, 0, 0, 0, 0, 1.5]
    assert [b.stops for b in blocks] == [False, True, True, False, False, True, True, False, False]
    assert [b.tool_change for b in blocks] == [None] * 4 + [7, None, None, 2, None]
    assert run("M6")[0].tool_change == -1


def test_arc_tells_centre_and_sense_in_machine_coordinates() -> None:
    block = run("G10 L2 P1 X100 Y0 R90\nG0 X0 Y0\nF100 G3 X2 Y0 I1 J0 P3")[-1]
    arc = block.moves[0].arc
    assert arc is not None
    assert arc.centre == pytest.approx((100.0, 1.0))
    assert (arc.plane, arc.clockwise, arc.turns) == (17, False, 3)
    assert block.moves[0].end == pytest.approx((100.0, 2.0, 0.0))
    assert block.end == (2.0, 0.0, 0.0)
    assert block.modal.rotation == 90.0


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("G0 Z5\n/G1 Z-1 F100\n/X9\nG0 Z20\nX5\n", 0),
        ("G0 Z5\n/G1 Z-1 F100\n/G0 Z5\nX9\n", 0),
        ("G0 Z5\n/G1 Z-1 F100\nM8\nX9\n", 4),
        ("/G1 Z-1 F100\nX9\n", 2),
        ("G0 Z5\n/G1 Z-1 F100\nG80\nG0 X9\n", 0),
        ("G0 Z5\n/G81 X1 Z-1 R2 F100\nG80\n", 2),
        ("G1 Z5 F50\n/X9 F100\nX10\n", 0),
    ],
)
def test_the_motion_code_of_an_optional_line(text: str, line: int) -> None:
    if not line:
        assert run(text)
        return
    with pytest.raises(
        ProgramError, match=f"line {line}: .*(its motion code is G1, from an optional line|optional line)"
    ):
        run(text)


def test_optional_lines() -> None:
    text = "G21 G90 G0 X1 Y1 Z1\n/X2\nY5\n"
    assert [b.known for b in run(text)] == [(True, True, True), (False, True, True), (False, True, True)]
    skipped = run(text, Setup(inch=False, skip_optional=True))
    assert skipped[1].moves == []
    assert skipped[2].end == (1.0, 5.0, 1.0)


def test_cutter_compensation_leaves_the_place_uncertain() -> None:
    blocks = run("G21 F100\nG0 X0 Y0 Z5\nG41 D1\nG1 X10\nG40\nG0 Z10\nX0 Y0\n")
    assert [b.modal.cutter for b in blocks] == [False, False, True, True, False, False, False]
    assert blocks[5].known == (False, False, True)
    assert blocks[6].known == (True, True, True)


def test_fanuc() -> None:
    text = (
        "%\nO1234 (PART)\nG21 G17 G40 G49 G80 G90\nG91 G28 Z0\nT3 M6\nG54.1 P2\nG90 G0 X10. Y5 S1000 M3\nG43 H3 Z50.\n"
        "G4 P500\nG4 X2.\nG98 G81 Z-5. R2. F100 K2\nG80\nM30\n%\n"
    )
    blocks = run(text, Setup("fanuc", tools={3: 120.0}, offsets={102: (300.0, 200.0, 0.0)}))
    by_line = {b.line.number: b for b in blocks}
    assert by_line[5].tool_change == 3
    assert by_line[7].moves[0].end == (310.0, 205.0, 0.0)
    assert by_line[8].moves[0].end == (310.0, 205.0, 170.0)
    assert (by_line[9].pause, by_line[10].pause) == (0.5, 2.0)
    assert by_line[11].end == (10.0, 5.0, 50.0)
    assert by_line[11].modal.system == 102
    assert by_line[13].ends


def test_fanuc_text_before_the_first_percent_is_a_leader() -> None:
    setup = Setup("fanuc", inch=False)
    blocks = run("(MADE BY CAM)\n\n%\nO1234\nG0 X1.\n%\nX2.\n", setup)
    assert [b.ends for b in blocks] == [False] * 5 + [True, False]
    assert blocks[-1].end[0] == 1.0
    blocks = run("O1234\nG0 X1.\n%\nX2.\n", setup)
    assert [b.ends for b in blocks] == [False, False, True, False]


def test_fanuc_goes_on_with_the_motion_of_before_a_cycle() -> None:
    setup = Setup("fanuc", inch=False)
    blocks = run("G0 X0 Z50.\nG98 G81 X1. Z-1. R1. F100\nG83 X2. Z-3. R1. Q1.\nG80\nZ60.\nG80\nX9.\n", setup)
    assert blocks[3].modal.motion == "G0"
    assert [(b.kind, b.moves[0].rapid, b.end) for b in (blocks[4], blocks[6])] == [
        ("line", True, (2.0, 0.0, 60.0)),
        ("line", True, (9.0, 0.0, 60.0)),
    ]
    blocks = run("G1 X0 F100\nG81 X1. Z-1. R1.\nG0 X5.\nG81 X1. Z-1. R1.\nG80\nX3.\nG31 X4.\nX5.\n", setup)
    assert blocks[5].moves[0].rapid
    assert [b.kind for b in blocks[6:]] == ["probe", "line"]


def test_tools_with_large_numbers_are_no_lathe_once_they_are_changed() -> None:
    text = "T1212\nG91 G28 Z0\nM6\nT1313\nG90 G1 X1. F100\nM6\nT0101 M6\n"
    assert [b.tool_change for b in run(text, Setup("fanuc", inch=False)) if b.tool_change] == [1212, 1313, 101]
    assert run("T0101 M6\n", Setup("fanuc"))[0].tool_change == 101


@pytest.mark.parametrize(("integers", "x"), [("whole", 1500.0), ("least", 1.5)])
def test_lengths_without_a_point(integers: str, x: float) -> None:
    setup = Setup("fanuc", inch=False, integers=integers)  # type: ignore[arg-type]
    blocks = run("G90 G0 X1500\nX1.5\nG4 P1500\n", setup)
    assert blocks[0].end[0] == pytest.approx(x)
    assert blocks[1].end[0] == pytest.approx(1.5)
    assert blocks[2].pause == 1.5


def test_diameters_are_told_as_radii() -> None:
    blocks = run("G7 G0 X10\nG91 X10\nG8 G90 X10\n")
    assert [b.end[0] for b in blocks] == [5.0, 10.0, 10.0]
    assert blocks[0].modal.diameter


def test_fanuc_goes_home_beside_a_motion_code() -> None:
    setup = Setup("fanuc", inch=False)
    text = "G1 X1. Y1. Z5. F100\n{}\nG90 X2.\n"
    for line in ("G0 G91 G28 Z0.", "G91 G28 G00 Z0.", "G28 G91 Z0. G0"):
        _, home, behind = run(text.format(line), setup)
        assert home.kind == "home"
        assert [m.end for m in home.moves] == [(1.0, 1.0, 5.0), (1.0, 1.0, 0.0)]
        assert behind.moves[0].rapid
    blocks = run("G0 Z5.\nG99 G81 X1. Y0 Z-1. R1. F100\nG0 G28 Z5.\nX3.\n", setup)
    assert [(b.kind, len(b.moves)) for b in blocks[2:]] == [("home", 2), ("line", 1)]  # the cycle has ended


def test_fanuc_moves_beside_g80() -> None:
    setup = Setup("fanuc", inch=False)
    blocks = run("G0 X0 Y0 Z5.\nG99 G81 X1. Z-1. R2. F100\nG80 Z50.\nX5.\nG80 X6. Y1.\n", setup)
    assert [(b.kind, b.moves[0].rapid, b.end) for b in blocks[2:]] == [
        ("line", True, (1.0, 0.0, 50.0)),
        ("line", True, (5.0, 0.0, 50.0)),
        ("line", True, (6.0, 1.0, 50.0)),
    ]
    blocks = run("G0 Z5.\nG1 X0 F100\nG99 G81 X1. Z-1. R2.\nG80 X5.\n", setup)
    assert not blocks[3].moves[0].rapid


def test_fanuc_stores_the_words_of_a_cycle() -> None:
    setup = Setup("fanuc", inch=False)
    for word in ("K0", "L0", "X0. L0"):
        blocks = run(f"G0 X0 Y0 Z5.\nG98 G81 Z-1. R2. F100 {word}\nX1.\nG80\n", setup)
        assert [len(b.moves) for b in blocks] == [1, 0, 5, 0]
        assert blocks[1].sticky == {"Z": -1.0, "R": 2.0}
        assert blocks[2].end == (1.0, 0.0, 5.0)


def test_look_ahead_moves_nothing() -> None:
    assert [len(b.moves) for b in run("G103 P1\nG0 X1.\nG103\n", Setup("fanuc", inch=False))] == [0, 1, 0]


def test_fanuc_turns_its_coordinates() -> None:
    """About a centre in program coordinates, behind G52 and before the origin."""
    setup = Setup("fanuc", offsets={1: (100.0, 200.0, 300.0)}, inch=False)
    text = "G54 G52 X1. Y2.\nG0 X0 Y0 Z5.\nG68 X10. Y0. R90.\nZ3.\nX12. Y0\nY3.\nG91 X1.\nG90\nG69\nX0 Y0\nG69\nX1.\n"
    blocks = run(text, setup)
    assert blocks[3].moves[0].end == pytest.approx((101.0, 202.0, 303.0))
    assert blocks[4].moves[0].end == pytest.approx((111.0, 204.0, 303.0))
    assert blocks[5].moves[0].end == pytest.approx((108.0, 204.0, 303.0))
    assert blocks[6].moves[0].end == pytest.approx((108.0, 205.0, 303.0))
    assert blocks[9].moves[0].end == pytest.approx((101.0, 202.0, 303.0))
    assert [b.modal.rotation for b in blocks[1:10]] == [0, 90, 90, 90, 90, 90, 90, 0, 0]
    assert [b.known[0] for b in blocks[1:]] == [True, False, False, True, True, True, True, False, True, True, True]
    with pytest.raises(ProgramError, match="no decimal point"):
        run("G68 X0 Y0 R30\n", Setup("fanuc", inch=True, integers="refuse"))
    turned = run("G68 X0 Y0 R30000\n", Setup("fanuc", inch=True, integers="least"))
    assert turned[0].modal.rotation == pytest.approx(30.0)
