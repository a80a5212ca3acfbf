"""Offsets between program and machine coordinates."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thermocomp.core.exceptions import ProgramError
from thermocomp.nc.interpreter.block import Block, Point, Setup
from thermocomp.nc.interpreter.interpret import follow_program
from thermocomp.nc.interpreter.offsets import Offsets
from thermocomp.nc.parser.tokens import read_lines, split_lines

ALL, NONE = (True, True, True), (False, False, False)
coordinates = st.tuples(*[st.floats(-1e3, 1e3)] * 3)


def run(text: str, setup: Setup | None = None) -> list[Block]:
    setup = setup or Setup(inch=False)
    return list(follow_program(read_lines(split_lines(text), setup.controller), setup))


@given(coordinates, coordinates, coordinates, coordinates, st.floats(-360.0, 360.0))
def test_there_and_back(origin: Point, shift: Point, tool: Point, place: Point, rotation: float) -> None:
    offsets = Offsets(Setup(offsets={1: origin}))
    offsets.set_origin(1, {}, rotation)
    offsets.set_shift(dict(enumerate(shift)))
    offsets.set_tool(tool, ALL)
    assert offsets.program(offsets.machine(place)) == pytest.approx(place, abs=1e-9)


@given(coordinates, coordinates, st.floats(-360.0, 360.0), st.sets(st.integers(0, 2), min_size=1))
def test_named_axes_get_their_values_and_the_others_stay(
    point: Point, wanted: Point, rotation: float, axes: set[int]
) -> None:
    values = {i: wanted[i] for i in axes}
    by_shift, by_origin = Offsets(Setup()), Offsets(Setup())
    for offsets in (by_shift, by_origin):
        offsets.set_origin(1, {0: 5.0, 2: -3.0}, rotation)
    before = by_shift.program(point)
    by_shift.name_place(before, values, ALL)
    by_origin.name_origin(1, point, values, ALL)
    expected = tuple(values.get(i, before[i]) for i in range(3))
    assert by_shift.program(point) == pytest.approx(expected, abs=1e-9)
    assert by_origin.program(point) == pytest.approx(expected, abs=1e-9)


def test_rotation_turns_about_the_origin_before_the_tool_is_added() -> None:
    offsets = Offsets(Setup(offsets={1: (10.0, 0.0, 0.0)}))
    offsets.set_origin(1, {}, 90.0)
    offsets.set_tool((1.0, 0.0, 50.0), ALL)
    assert offsets.machine((2.0, 0.0, 0.0)) == pytest.approx((11.0, 2.0, 50.0))


def test_g92_and_g52_share_a_store_in_linuxcnc() -> None:
    blocks = run("G52 X10\nG0 X0\nG52 X5 Y5\nG0 X0 Y0\nG92 X3\nG0 X0 Y0\nG52 X0 Y0\nG0 X0\n")
    ends = [b.moves[0].end[:2] for b in blocks if b.moves]
    assert ends == [(10.0, 0.0), (5.0, 5.0), (2.0, 5.0), (0.0, 5.0)]
    assert [b.kind for b in blocks] == ["set", "line"] * 4


def test_g92_put_away_and_back() -> None:
    blocks = run("G0 X1\nG92 X5\nG92.2\nX0\nG92.3\nX0\nG92.1\nX0\nG92.3\nX0\n")
    assert [b.moves[0].end[0] for b in blocks if b.moves] == [1.0, 0.0, -4.0, 0.0, 0.0]


def test_g92_names_the_place_and_tells_nothing_new_about_where_it_is() -> None:
    blocks = run("G92 X0 Y0\nG0 X5\nG92 X1 Z3\n")
    assert blocks[0].known == (False, False, False)
    assert blocks[2].known == (True, False, False)
    assert (blocks[2].start[0], blocks[2].end[0], blocks[2].end[2]) == (5.0, 1.0, 3.0)


def test_g10_l2_of_the_active_system_makes_its_axes_uncertain() -> None:
    blocks = run("G54 G0 X1 Y1 Z1\nG10 L2 P0 Z5\nZ1\nG10 L2 P3 X9\nG10 L2 P1 R30\n")
    assert [b.known for b in blocks[1:]] == [(True, True, False), ALL, ALL, (False, False, True)]
    assert blocks[1].end == (1.0, 1.0, -4.0)
    assert blocks[4].modal.rotation == 30.0


def test_systems_the_program_sets_are_certain() -> None:
    text = "G54 G10 L2 P1 X0 Y0 Z0\nG10 L2 P2 X100 Y0 Z0\nG92.1 G49\nG0 X1 Y1 Z1\nG55\n"
    assert run(text)[-1].known == ALL
    assert run(text)[-1].end == (-99.0, 1.0, 1.0)


def test_which_system_is_in_force_is_not_known_until_it_is_named() -> None:
    origins = "G92.1 G49\nG10 L2 P1 X0 Y0 Z0\nG10 L2 P2 X100 Y0 Z0\n"
    blocks = run(f"{origins}G0 X1 Y1 Z1\nG54\nX2 Y2 Z2\nG54\nG55\n")
    assert [b.known for b in blocks[3:]] == [ALL, NONE, ALL, ALL, ALL]
    assert [b.modal.system_told for b in blocks] == [False] * 4 + [True] * 4
    # the one that is set may be the one in force
    blocks = run("G0 X1 Y1 Z1\nG10 L2 P5 X0 Z3\nX1 Y1 Z1\nG10 L20 P1 Y1\nG10 L20 P0 X5\n")
    assert [b.known for b in blocks] == [ALL, (False, True, False), ALL, (True, False, True), (True, False, True)]
    with pytest.raises(ProgramError, match=r"line 1: G10 L2 P0 .* write G54 \(or another\) before it"):
        run("G10 L2 P0 X1\n")


@pytest.mark.parametrize("angle", [0.0, 7.0])
def test_a_rotation_of_all_systems_is_known_whichever_is_in_force(angle: float) -> None:
    told = [b.modal.rotation_told for b in run("G0 X0\nG54\n", Setup(inch=False, rotations={1: angle}))]
    assert told == [False, True]
    every = Setup(inch=False, rotations=dict.fromkeys(range(1, 10), angle))
    assert run("G0 X0\n", every)[0].modal.rotation_told
    assert not run("G0 X0\n", replace(every, rotations={**every.rotations, 9: 3.0}))[0].modal.rotation_told


def test_tool_lengths_of_g10() -> None:
    blocks = run("G21 G49 G10 L1 P5 Z10\nG0 Z0\nG43 H5\nZ0\nT5 M6\nG10 L10 P5 Z1\nG43\n")
    assert blocks[2].known[2]
    assert blocks[3].moves[0].end[2] == 10.0
    assert blocks[5].kind == "set"
    assert blocks[6].end[2] == 1.0


def test_fanuc_origins() -> None:
    text = "G90 G10 L2 P1 X10.\nG91 G10 L2 P1 X5.\nG90 G10 L2 P0 X100.\nG0 X0\nG10 L20 P7 X1.\nG54.1 P7 X0\n"
    blocks = run(text, Setup("fanuc", inch=False))
    assert [b.moves[0].end[0] for b in blocks if b.moves] == [115.0, 101.0]


def test_home_goes_by_way_of_the_words() -> None:
    blocks = run("G0 X10 Y10 Z10\nG91 G28 Z2\nG90\nG28\n", Setup(inch=False, home=(1.0, 2.0, 3.0)))
    assert [m.end for m in blocks[1].moves] == [(10.0, 10.0, 12.0), (10.0, 10.0, 3.0)]
    assert blocks[1].known == (True, True, False)
    assert blocks[3].moves[-1].end == (1.0, 2.0, 3.0)
    assert blocks[3].known == (False, False, False)
