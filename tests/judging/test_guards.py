"""Readings that a watch passes on while sensors fail are numbers, also where it has none to pass on."""

from unittest.mock import patch

import numpy as np
from test_watchrun import watched

from thermocomp.judging import guards
from thermocomp.judging.guards import let_fail


def test_a_reading_that_is_not_replaced_reads_its_zero() -> None:
    """A missing speed that nothing explains has no substitute: models cannot be replayed with a missing input."""
    watch, samples = watched()
    rows = np.ones(len(samples), np.bool_)
    names = [c.name for c in samples.inputs]
    lost = watch.names[0]
    column = names.index(lost)
    place = [i.name for i in watch.inputs].index(lost)

    def nothing(watch: object, time: object, values: np.ndarray, *_: object) -> tuple[np.ndarray, None]:
        passed = values.copy()
        passed[len(passed) // 2 :, place] = np.nan
        return passed, None

    with patch.object(guards, "run_watch", nothing):
        readings = let_fail(watch, samples, rows).readings[(lost,)]
    zero = samples.reference()[samples.test, column]
    assert np.array_equal(readings[column][samples.valid], zero[samples.valid])
