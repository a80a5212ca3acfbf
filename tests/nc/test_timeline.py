"""The time line against what can be worked out on paper."""

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thermocomp.core.exceptions import ProgramError, SettingError
from thermocomp.core.machine import Axis, Machine
from thermocomp.core.structure import Structure
from thermocomp.nc.interpreter.block import Arc, Block, Modal, Move, Point
from thermocomp.nc.parser.line import Line, Word
from thermocomp.nc.planner.timeline import ACCELERATION, AHEAD, CHUNK, RAPID, MotionLimits, time_blocks

#: 100, 80, 50 mm/s; a cycle that no figure feels
MILL = MotionLimits(
    (6000.0, 4800.0, 3000.0), (1000.0, 800.0, 500.0), tool_change=7.0, stop=30.0, spindle=2.0, cycle=1e-9
)
EXACT = Modal(blend=None)


def block(*moves: Move, modal: Modal = EXACT, codes: tuple[str, ...] = (), **others: object) -> Block:
    return Block(Line(1, ""), modal, "line", codes, moves=list(moves), **others)  # type: ignore[arg-type]


def path(points: Sequence[Point], feed: float, modal: Modal = EXACT) -> Iterator[Block]:
    for start, end in pairwise(points):
        yield block(Move(feed == 0.0, start, end, None, feed), modal=modal)


def lasting(*blocks: Block, kinematics: MotionLimits = MILL) -> float:
    return list(time_blocks(blocks, kinematics))[-1].end


def from_rest(length: float, speed: float, acceleration: float) -> float:
    """Return how long a way takes from rest to rest [s]."""
    if length < speed**2 / acceleration:
        return 2.0 * math.sqrt(length / acceleration)
    return length / speed + speed / acceleration


def test_one_move_is_a_trapezoid_or_a_triangle() -> None:
    for length, feed in ((100.0, 3000.0), (2.0, 6000.0), (1e-3, 600.0)):
        move = Move(False, (0.0, 0.0, 0.0), (length, 0.0, 0.0), None, feed)
        assert lasting(block(move)) == pytest.approx(from_rest(length, feed / 60.0, 1000.0), rel=1e-6)


def test_the_slowest_axis_limits_a_rapid_and_a_feed() -> None:
    way = (0.0, 0.0, 0.0), (60.0, 48.0, 60.0)
    length = math.dist(*way)
    limits = length * 50.0 / 60.0, length * 500.0 / 60.0
    for move in (Move(True, *way), Move(False, *way, None, 1e6)):
        assert lasting(block(move)) == pytest.approx(from_rest(length, *limits), rel=1e-6)


def test_most_feed_along_the_path_is_the_machines() -> None:
    slow = MotionLimits((6000.0,) * 3, (1000.0,) * 3, feed=1200.0, cycle=1e-9)
    move = Move(False, (0.0, 0.0, 0.0), (100.0, 0.0, 0.0), None, 3000.0)
    assert lasting(block(move), kinematics=slow) == pytest.approx(from_rest(100.0, 20.0, 1000.0), rel=1e-6)


@pytest.mark.parametrize("modal", [EXACT, Modal(blend=0.0), Modal(blend=0.01)])
def test_moves_in_one_line_run_through(modal: Modal) -> None:
    points = [(float(x), 0.0, 0.0) for x in (0, 10, 11, 50, 100)]
    whole = lasting(*path([points[0], points[-1]], 3000.0, modal))
    assert lasting(*path(points, 3000.0, modal)) == pytest.approx(whole, rel=1e-3 if modal.blend is None else 0.02)


def test_a_right_angle_is_a_stop_if_the_path_is_exact_and_is_cut_if_it_is_not() -> None:
    def cut(blend: float | None) -> float:
        modal = Modal(blend=blend)
        corner = path([(0.0, 0.0, 0.0), (100.0, 0.0, 0.0), (100.0, 50.0, 0.0)], 3000.0, modal)
        rapid = path([(100.0, 50.0, 0.0), (100.0, 50.0, 9.0)], 0.0, modal)
        return list(time_blocks([*corner, *rapid], MILL))[1].end

    # a tenth of the acceleration is kept back for the corner
    assert cut(None) == pytest.approx(from_rest(100.0, 50.0, 900.0) + from_rest(50.0, 50.0, 720.0), rel=1e-6)
    assert 3.0 < cut(0.0) < cut(0.5) < cut(0.01) < cut(None)


def test_how_fast_a_right_angle_is_cut() -> None:
    """The arc within the tolerance has a radius of tolerance / (sqrt 2 - 1), and sqrt 3/4 of the acceleration."""
    speed = math.sqrt(math.sqrt(0.75) * 800.0 * 0.1 / (math.sqrt(2.0) - 1.0))
    cut = 0.1 / (math.sqrt(2.0) - 1.0)

    def run_in(length: float, a: float) -> float:
        return (length - (2 * 50.0**2 - speed**2) / (2 * a)) / 50.0 + 50.0 / a + (50.0 - speed) / a

    points = [(0.0, 0.0, 0.0), (100.0, 0.0, 0.0), (100.0, 80.0, 0.0), (100.0, 80.0, 1.0)]
    blocks = [*path(points[:3], 3000.0, Modal(blend=0.1)), *path(points[2:], 0.0, Modal(blend=0.1))]
    ends = [t.end for t in time_blocks(blocks, MILL)]
    corner = cut * math.pi / 2.0 / speed
    assert ends[0] == pytest.approx(run_in(100.0 - cut, 1000.0), rel=1e-4)
    assert ends[1] - ends[0] == pytest.approx(corner + run_in(80.0 - cut, 800.0), rel=1e-4)


def test_turning_back_is_a_stop() -> None:
    points = [(0.0, 0.0, 0.0), (50.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)]
    blocks = [*path(points[:3], 3000.0, Modal()), *path(points[2:], 0.0, Modal())]
    assert list(time_blocks(blocks, MILL))[1].end == pytest.approx(2.0 * from_rest(50.0, 50.0, 1000.0), rel=1e-6)


def test_an_arc_goes_no_faster_than_it_can_turn() -> None:
    def circle(radius: float, feed: float, turns: int = 1, climb: float = 0.0) -> float:
        arc = Arc(17, (radius, 0.0), True, turns)
        return lasting(block(Move(False, (0.0, 0.0, 0.0), (0.0, 0.0, climb), arc, feed)))

    most = math.sqrt(math.sqrt(0.75) * 800.0 * 5.0)
    assert most < 80.0
    assert circle(5.0, 6000.0, 10) == pytest.approx(from_rest(100.0 * math.pi, most, 400.0), rel=1e-4)
    assert circle(5.0, 600.0) == pytest.approx(10.0 * math.pi / 10.0, rel=0.02)
    length = math.hypot(10.0 * math.pi, 20.0)
    assert circle(5.0, 600.0, 1, 20.0) == pytest.approx(length / 10.0, rel=0.02)


@pytest.mark.parametrize("plane", [17, 18, 19])
@pytest.mark.parametrize("clockwise", [False, True])
def test_a_quarter_turns_the_right_way(plane: int, clockwise: bool) -> None:
    """From 10 0 about 0 0 to 0 10, in the axes of the plane, it is a quarter, or three of them."""
    first = {17: 0, 18: 2, 19: 1}[plane]
    start, end = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
    start[first], end[(first + 1) % 3] = 10.0, 10.0
    move = Move(
        False, (start[0], start[1], start[2]), (end[0], end[1], end[2]), Arc(plane, (0.0, 0.0), clockwise, 1), 60.0
    )
    assert lasting(block(move)) == pytest.approx((15.0 if clockwise else 5.0) * math.pi, rel=0.01)


def test_a_line_that_leaves_an_arc_along_its_tangent_does_not_stop() -> None:
    arc = Move(False, (0.0, 0.0, 0.0), (20.0, 0.0, 0.0), Arc(17, (10.0, 0.0), True, 1), 1200.0)
    line = Move(False, (20.0, 0.0, 0.0), (20.0, -30.0, 0.0), None, 1200.0)
    across = Move(False, (20.0, 0.0, 0.0), (50.0, 0.0, 0.0), None, 1200.0)
    through = lasting(block(arc), block(line))
    assert through == pytest.approx((10.0 * math.pi + 30.0) / 20.0, rel=0.02)
    assert lasting(block(arc), block(across)) > through + 0.015


def test_pauses_tool_changes_stops_and_the_spindle_add_up() -> None:
    move = Move(False, (0.0, 0.0, 0.0), (100.0, 0.0, 0.0), None, 3000.0)
    alone = lasting(block(move))
    blocks = [
        block(speed=1000.0, codes=("M3",)),
        block(move, speed=1000.0),
        block(pause=1.5, speed=1000.0, codes=("G4",)),
        block(tool_change=3, codes=("M6",)),
        block(move, pause=0.5),
        block(stops=True, codes=("M0",)),
        block(ends=True, codes=("M2",)),
    ]
    lengths = [t.end - t.start for t in time_blocks(blocks, MILL)]
    assert lengths == pytest.approx([2.0, alone, 1.5, 9.0, alone + 0.5, 30.0, 0.0], rel=1e-6)


def test_a_change_of_the_spindle_speed_interrupts_the_path() -> None:
    blocks = list(path([(0.0, 0.0, 0.0), (50.0, 0.0, 0.0), (100.0, 0.0, 0.0)], 3000.0))
    through = lasting(*blocks)
    blocks[1].words["S"] = Word("S", 0, 2, "1", 1.0)
    assert lasting(*blocks) == pytest.approx(through + 0.05, rel=1e-6)


def test_what_the_program_says_in_seconds_it_takes() -> None:
    move = Move(False, (0.0, 0.0, 0.0), (100.0, 0.0, 0.0), None, 0.0, seconds=10.0)
    assert lasting(block(move)) == pytest.approx(from_rest(100.0, 10.0, 1000.0), rel=1e-6)


def test_rotary_axes_go_in_degrees() -> None:
    here = (1.0, 2.0, 3.0)
    turning = block(Move(False, here, here, None, 360.0, rotary=-180.0))
    assert lasting(turning) == pytest.approx(from_rest(180.0, 6.0, 500.0), rel=1e-6)
    rapid = block(Move(True, here, here, rotary=90.0))
    assert lasting(rapid) == pytest.approx(from_rest(90.0, 100.0, 500.0), rel=1e-6)
    # 10 mm and 360 degrees: the rotary axis is the slow one
    both = block(Move(False, here, (11.0, 2.0, 3.0), None, 6000.0, rotary=360.0))
    assert lasting(both) == pytest.approx(from_rest(360.0, 100.0, 500.0), rel=1e-6)
    blending = [
        block(Move(False, here, here, None, 1200.0, rotary=90.0), modal=Modal()),
        block(Move(False, here, here, None, 1200.0, rotary=-90.0), modal=Modal()),
    ]
    assert 2.0 * 90.0 / 20.0 - 0.1 < lasting(*blending) < 2.0 * from_rest(90.0, 20.0, 250.0)


def test_under_a_tolerance_lines_become_one() -> None:
    """Saw teeth of 10 um would be 500 corners; within 50 um they are a line."""
    points = [(0.1 * k, 0.01 * (k % 2), 0.0) for k in range(501)]
    straight = lasting(*path([points[0], points[-1]], 3000.0))
    assert lasting(*path(points, 3000.0, Modal(blend=0.05, naive=0.05))) == pytest.approx(straight, rel=0.03)
    assert lasting(*path(points, 3000.0, Modal(blend=0.05))) > 1.1 * straight


def test_a_move_in_feed_without_a_feed_is_refused() -> None:
    with pytest.raises(ProgramError, match="line 1: a feed move, but no feed is in force: write F before it"):
        lasting(block(Move(False, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0))))
    with pytest.raises(ProgramError, match="line 1: the centre of the arc is at its start or end"):
        lasting(block(Move(False, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), Arc(17, (0.0, 0.0), True, 1), 60.0)))


def test_kinematics_of_a_machine_file() -> None:
    axes = (Axis("X", (0.0, 1.0), rapid=12_000.0), Axis("Z", (0.0, 1.0), acceleration=700.0))
    found = MotionLimits.of(Machine("m", Structure(("X",), ("Z",)), axes), tool_change=4.0)
    assert found == MotionLimits((12_000.0, RAPID, RAPID), (ACCELERATION, ACCELERATION, 700.0), tool_change=4.0)
    for wrong in ({"feed": 0.0}, {"cycle": -1.0}, {"stop": -1.0}, {"spindle": math.nan}, {"rotary_rapid": math.nan}):
        with pytest.raises(SettingError) as caught:
            MotionLimits(**wrong)  # type: ignore[arg-type]
        assert caught.value.path == tuple(wrong)
    with pytest.raises(SettingError, match="must be positive"):
        MotionLimits(rapid=(1.0, 0.0, 1.0))


coordinates = st.floats(-20.0, 20.0).map(lambda v: round(v, 2))
points = st.tuples(coordinates, coordinates, coordinates)
modals = st.sampled_from([EXACT, Modal(), Modal(blend=0.05)])


@settings(deadline=None, max_examples=200)
@given(corners=st.lists(points, min_size=2, max_size=30), feed=st.floats(10.0, 20_000.0), modal=modals)
def test_no_path_is_faster_than_its_feed_and_its_axes_nor_slower_than_with_stops(
    corners: list[Point], feed: float, modal: Modal
) -> None:
    blocks = list(path(corners, feed, modal))
    found = list(time_blocks(blocks, MILL))
    assert [t.block for t in found] == blocks
    assert found[0].start == 0.0
    assert all(a.end == b.start for a, b in pairwise(found))
    assert all(t.end >= t.start for t in found)
    # a corner that is cut is shorter by less than 2 - pi/2 of what it takes; nothing else makes the way shorter
    axes = max(sum(abs(b[k] - a[k]) for a, b in pairwise(corners)) / MILL.rapid[k] * 60.0 for k in range(3))
    least = max(sum(math.dist(a, b) for a, b in pairwise(corners)) * 60.0 / feed, axes)
    assert found[-1].end >= (1.0 if modal.blend is None else 0.5) * least * (1.0 - 1e-9)
    stopping = sum(lasting(b) for b in path(corners, feed))
    assert found[-1].end <= 2.0 * stopping + 1e-6


@settings(deadline=None, max_examples=50)
@given(first=st.lists(points, min_size=2, max_size=9), second=st.lists(points, min_size=1, max_size=9), modal=modals)
def test_times_on_both_sides_of_a_stop_add_up(first: list[Point], second: list[Point], modal: Modal) -> None:
    one = list(path(first, 2000.0, modal))
    two = list(path([first[-1], *second], 2000.0, modal))
    pause = block(pause=1.0, codes=("G4",), modal=modal)
    apart = lasting(*one) + 1.0 + lasting(*two)
    assert lasting(*one, pause, *two) == pytest.approx(apart, rel=1e-9)


def test_it_streams_and_does_not_depend_on_how_it_is_cut() -> None:
    """Some hundred blocks are looked ahead, however long the program is; a stop shows in the last of them only."""
    n = 3 * CHUNK
    curve = [(0.2 * k, 5.0 * math.sin(k / 20.0), 0.0) for k in range(2 * n)]
    asked = 0

    def blocks(most: int) -> Iterator[Block]:
        nonlocal asked
        for asked, made in enumerate(path(curve[: most + 1], 5000.0, Modal()), 1):  # noqa: B007
            yield made

    ahead = 0
    ends = []
    for k, t in enumerate(time_blocks(blocks(2 * n - 1), MILL)):
        ends.append(t.end)
        ahead = max(ahead, asked - k)
    assert ahead <= CHUNK + AHEAD + 2
    shorter = [t.end for t in time_blocks(blocks(n), MILL)]
    same = sum(a == pytest.approx(b, rel=1e-12) for a, b in zip(ends, shorter, strict=False))
    assert n - AHEAD - 1 <= same < n
