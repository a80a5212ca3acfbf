"""How large errors are."""

import math

import numpy as np
import pytest

from thermocomp.core.correction import Correction, Deviation
from thermocomp.core.size import Size


def test_size_of_errors_of_any_shape() -> None:
    size = Size.of(np.array([[3.0, -4.0], [0.0, 0.0]]))
    assert size.rms == pytest.approx(2.5)
    assert size.largest == 4.0


def test_size_of_nothing_is_no_number() -> None:
    size = Size.of(np.empty((0, 3)))
    assert math.isnan(size.rms)
    assert math.isnan(size.largest)


def test_a_correction_at_many_positions_is_that_at_each() -> None:
    correction = Correction.opposing(Deviation(2.0, 30.0, 100.0))
    positions = np.array([[0.0, 100.0], [200.0, 600.0]])
    alone = [[correction.at(p) for p in row] for row in positions.tolist()]
    assert correction.at(positions).tolist() == alone
    assert correction.at(600.0) == pytest.approx(-17.0)
