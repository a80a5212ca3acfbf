"""Test vectors of the graph of a model: readings with faults, and what `ErrorModel.step` says of each."""

import math
from typing import Any

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.exceptions import ReadingError
from thermocomp.core.model import ErrorModel
from thermocomp.export.vectors import find_tolerance

#: minimum tolerance of a runtime, as a fraction of the deviation, or absolute for deviations below 1
_TOLERANCE = 1e-9
#: time steps, repeated in turn [s]
_STEPS = (1.0, 10.0, 15.0, 0.0, 60.0, 7.5, 600.0, 14.999, 15.001, 3.0, 3600.0)


def write_vectors(model: ErrorModel) -> dict[str, Any]:
    """Return test vectors for a JSON file; NaN and infinity are strings that Python's `float` accepts."""
    zero = np.array([i.reference + 0.25 * i.rezero for i in model.inputs])
    values, steps = make_readings(model, zero)
    return {
        "tolerance": max(_TOLERANCE, find_tolerance([model])),
        "zero": zero.tolist(),
        "calls": [
            {"value": _numbers(v), "dt": _numbers(dt)[0], "deviation": _numbers(said)[0], "outside": outside}
            for v, dt, said, outside in zip(values, steps[:, None], *answer(model, values, steps, zero), strict=True)
        ],
    }


def make_readings(model: ErrorModel, zero: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return readings, (n_calls, n_inputs), and time steps, (n_calls,), in which each input leaves its range."""
    n, calls = len(model.inputs), 176
    low, high = (np.array(ends) for ends in model.bounds[:2])
    k, c = np.arange(calls)[:, None], np.arange(n)
    swing = np.where(k < calls // 2, 0.45, 0.7) * np.sin(2.0 * np.pi * k / (11.3 + 7 * (c % 5)) - 0.7 * c)
    values = np.round(zero + (low + high) / 2 + swing * np.maximum(high - low, 1.0), 4)
    values[0], steps = zero, np.resize(_STEPS, calls)
    steps[-20] = 1e6
    for place, wild in enumerate((*[math.nan] * n, math.inf), start=40):
        values[place % calls, place % max(n, 1) : place % max(n, 1) + 1] = wild
    steps[[5, 6]] = math.nan, -1.0
    return values, steps


def answer(
    model: ErrorModel, values: FloatArray, steps: FloatArray, zero: FloatArray
) -> tuple[FloatArray, list[list[bool]]]:
    """Return the deviations, (n_calls,), and which inputs were outside; NaN where a call is rejected."""
    state, said, outside = model.init(zero), list[float](), list[list[bool]]()
    for row, dt in zip(values, steps.tolist(), strict=True):
        try:
            state, deviation = model.step(state, row, dt if model.remembers else 0.0)
        except ReadingError:
            said.append(math.nan)
        else:
            said.append(float(deviation))
        outside.append(state.outside.tolist())
    return np.array(said), outside


def _numbers(row: float | FloatArray) -> list[float | str]:
    return [x if math.isfinite(x) else str(x) for x in np.atleast_1d(row).tolist()]
