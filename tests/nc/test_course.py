"""The points of the picture: few, and no extreme is lost."""

import math
import random

import numpy as np

from thermocomp.nc.interpreter.block import Block, Modal, Move
from thermocomp.nc.parser.line import Line
from thermocomp.nc.rewrite.course import Course
from thermocomp.nc.rewrite.demand import Left
from thermocomp.nc.rewrite.revise import Revised

Vector = tuple[float, float, float]


def row(
    end: float,
    drift: Vector,
    carried: Vector = (0.0, 0.0, 0.0),
    before: tuple[Vector, Vector] | None = None,
    *,
    rapid: bool = False,
) -> Revised:
    """A cut, or a rapid, from what was before it to a drift and a correction [um]."""
    move = Move(rapid, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    block = Block(Line(1, "X1\n"), Modal(), "line", moves=[move], speed=-3000.0)
    cut = None if rapid else Left().take(1, [before or (drift, carried), (drift, carried)])
    return Revised(1, "X1\n", ("X1\n",), block, 0.0, end, drift, carried, carried, cut)


def test_rows_as_they_are_while_they_are_few() -> None:
    course = Course()
    first, second = ((0.0, 1.0, 2.0), (0.0, 0.0, 0.0)), ((0.0, 2.0, 4.0), (0.0, -1.0, -2.0))
    course.take(row(1.0, *first))
    course.take(row(2.0, *second, before=first))
    course.take(row(3.0, *second))
    course.take(row(4.0, *second))  # only time has passed
    course.take(row(5.0, (0.0, 2.0, 6.0), (0.0, -1.0, -2.0), rapid=True))
    run = course.run()
    assert run.time.tolist() == [1.0, 2.0, 4.0, 5.0]
    assert run.deviation[:, 0].tolist() == [[0, 1, 2], [0, 1, 2], [0, 2, 4], [0, 2, 6]]  # what is met inside counts
    assert run.deviation[:, 1].tolist() == [[0, 1, 2], [0, 2, 4], [0, 2, 4], [0, 2, 6]]
    assert run.carried[:, 0, 2].tolist() == [0.0, -2.0, -2.0, -2.0]
    assert run.speed.tolist() == [[3000.0, 3000.0]] * 4
    # both ends of a cut count; a rapid is none
    assert run.left[:3, :, 1].tolist() == [[1.0, 1.0]] * 3
    assert run.left[:3, :, 2].tolist() == [[2.0, 2.0]] * 3
    assert np.isnan(run.left[3]).all()


def test_the_picture_has_the_residual_that_is_told() -> None:
    chance = random.Random(4)
    course, told = Course(most=50), Left()
    for k in range(999):
        samples = [((0.0, 0.0, chance.gauss(0, 3)), (0.0, 0.0, -1.0)) for _ in range(chance.choice((2, 9)))]
        cut = told.take(k, samples)
        course.take(row(float(k), *samples[-1])._replace(cut=cut))
    assert np.nanmax(np.abs(course.run().left[:, :, 2])) == told.most[2]
    assert np.abs(course.run().deviation[:, :, 2]).max() == told.without[2]


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
