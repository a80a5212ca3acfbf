"""The points of the picture: few, and no extreme is lost."""

import math
import random
from dataclasses import replace

import numpy as np
import pytest

from thermocomp.compensation.nc.following.block import Block, Kind, Modal, Move
from thermocomp.compensation.nc.reading.line import Line
from thermocomp.compensation.nc.revising.course import Course
from thermocomp.compensation.nc.revising.revise import Revised

Vector = tuple[float, float, float]


def row(
    end: float, drift: Vector, carried: Vector = (0.0, 0.0, 0.0), *, rapid: bool = False, kind: Kind = "line"
) -> Revised:
    move = Move(rapid, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    block = Block(Line(1, "X1\n"), Modal(), kind, moves=[move], speed=-3000.0)
    return Revised(1, "X1\n", ("X1\n",), block, 0.0, end, drift, carried, carried)


def test_rows_as_they_are_while_they_are_few() -> None:
    course = Course()
    course.take(row(1.0, (0.0, 1.0, 2.0)))
    course.take(row(2.0, (0.0, 2.0, 4.0), (0.0, -1.0, -2.0)))
    course.take(row(3.0, (0.0, 2.0, 4.0), (0.0, -1.0, -2.0)))  # only time has passed
    course.take(row(4.0, (0.0, 2.0, 6.0), (0.0, -1.0, -2.0), rapid=True))
    run = course.run()
    assert run.time.tolist() == [1.0, 3.0, 4.0]
    assert run.deviation[:, 0].tolist() == run.deviation[:, 1].tolist() == [[0, 1, 2], [0, 2, 4], [0, 2, 6]]
    assert run.carried[:, 0, 2].tolist() == [0.0, -2.0, -2.0]
    assert run.speed.tolist() == [[3000.0, 3000.0]] * 3
    # both ends of a cut count; a rapid is none
    assert run.left[0, :, 2].tolist() == [2.0, 2.0]
    assert run.left[1, :, 2].tolist() == [2.0, 2.0]
    assert np.isnan(run.left[2]).all()


@pytest.mark.parametrize("kind", ["machine", "home"])
def test_moves_in_machine_coordinates_leave_nothing(kind: Kind) -> None:
    course = Course()
    course.take(row(1.0, (0.0, 0.0, 5.0), kind=kind))
    course.take(replace_block(row(2.0, (0.0, 0.0, 5.0))))
    assert np.isnan(course.run().left).all()


def replace_block(revised: Revised) -> Revised:
    assert revised.block is not None
    return revised._replace(block=replace(revised.block, moves=[]))


def test_no_extreme_is_lost() -> None:
    chance = random.Random(3)
    course = Course(most=50)
    rows = []
    for k in range(3217):
        drift = (chance.gauss(0, 1), math.sin(k / 50), 0.0)
        rows.append(row(float(k + 1), drift, (0.0, chance.gauss(0, 1), 0.0), rapid=k % 7 == 0))
        course.take(rows[-1])
    run = course.run()
    assert 20 <= len(run.time) <= 50
    assert run.time[-1] == 3217.0
    assert (np.diff(run.time) > 0).all()
    begin = 0.0
    for k, end in enumerate(run.time):
        mine = np.array([r.deviation for r in rows if begin < r.end <= end])
        assert run.deviation[k, 0].tolist() == mine.min(axis=0).tolist()
        assert run.deviation[k, 1].tolist() == mine.max(axis=0).tolist()
        begin = end
    left = [d + c for a in rows if not a.block.moves[0].rapid for d, c in [(a.deviation[1], a.carried[1])]]  # type: ignore[union-attr]
    assert np.nanmax(run.left[:, 1, 1]) >= max(left)
    assert np.nanmin(run.left[:, 0, 1]) <= min(left)
