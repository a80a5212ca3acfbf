"""The online step over all readings of a test at once: what a replay is judged by.

The same gate, models and limits as `thermocomp.compensation.online`, without the cost of one call per reading; a test
holds the two together. The readings come when they were taken: none is stale, and the clock is their time.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thermocomp.compensation import online
from thermocomp.compensation.limits import limited
from thermocomp.core.correction import Correction, Deviation, Limits
from thermocomp.core.model import ErrorModel

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


class Run(NamedTuple):
    """What a model says in a test, and what a compensator with it does."""

    deviation: FloatArray  #: (n_rows,), of the model alone: every complete reading is used, nothing is limited
    compensated: FloatArray  #: (n_rows,), minus the correction in force: what is taken off the deviation
    outside: BoolArray  #: (n_rows,), an input of the model alone was outside the trained range
    rejected: BoolArray  #: (n_rows,), complete readings that the gate turned away
    why: str  #: the first of them; empty if there is none


def run(
    model: ErrorModel,
    limits: Limits | None,
    time: FloatArray,
    values: FloatArray,
    reference: Sequence[float] | FloatArray | None = None,
) -> Run:
    """Run a model, and a compensator with it, through a test.

    Parameters
    ----------
    model : ErrorModel
        Of any unit; refused or not: it is being judged.
    limits : Limits or None
        None: the correction follows the model at once, as for a model that predicts another unit than that of limits.
    time : ndarray of shape (n_rows,)
        Rising [s].
    values : ndarray of shape (n_rows, n_inputs)
        In the order of the model's inputs; nan where a value is missing.
    reference : array-like of shape (n_inputs,), optional
        What counts as zero; see `ErrorModel.init`.

    Returns
    -------
    Run
    """
    complete = np.asarray(np.isfinite(values).all(axis=1))
    passed, why = _gated(model, values, complete, model.init(reference).reference)
    alone, outside = _said(model, time, values, complete, reference)
    gated = alone if np.array_equal(passed, complete) else _said(model, time, values, passed, reference)[0]
    return Run(alone, _moved(gated, passed, time, limits), outside, complete & ~passed, why)


def _gated(model: ErrorModel, values: FloatArray, complete: BoolArray, zero: FloatArray) -> tuple[BoolArray, str]:
    """Return the readings that pass the gate of the online step, and why the first complete one did not."""
    passed, why, start = complete.copy(), "", 0
    if np.isnan(zero).any():  # the first reading that passes decides what counts as zero
        for start in np.flatnonzero(complete).tolist():
            found = online.implausible(model, values[start].tolist(), zero.tolist())
            if not found:
                zero = np.where(np.isnan(zero), values[start], zero)
                break
            passed[start], why = False, why or found
        else:
            return passed, why
    low, high = (
        np.array([online.plausible(i, z) for i, z in zip(model.inputs, zero.tolist(), strict=True)]).reshape(-1, 2).T
    )
    with np.errstate(invalid="ignore"):
        passed[start:] &= ((values[start:] >= low) & (values[start:] <= high)).all(axis=1)
    turned = np.flatnonzero(complete & ~passed)
    if turned.size and not why:
        why = online.implausible(model, values[turned[0]].tolist(), zero.tolist())
    return passed, why


def _said(
    model: ErrorModel,
    time: FloatArray,
    values: FloatArray,
    used: BoolArray,
    reference: Sequence[float] | FloatArray | None,
) -> tuple[FloatArray, BoolArray]:
    """Return deviation and whether an input was outside, per row; a reading that is not used holds the last one."""
    rows = np.flatnonzero(used)
    deviation, outside = np.zeros(len(time)), np.zeros(len(time), dtype=np.bool_)
    beyond: BoolArray
    if not rows.size:
        return deviation, outside
    state = model.init(reference)
    if model.remembers or model.support.policy == "hold":
        said, beyond = np.empty(len(rows)), np.empty(len(rows), dtype=np.bool_)
        last = float(time[rows[0]])
        for k, row in enumerate(rows.tolist()):
            state, said[k] = model.step(state, values[row], float(time[row]) - last)
            beyond[k], last = bool(state.outside.any()), float(time[row])
    else:  # each reading stands alone: all in one step
        zero = np.where(np.isnan(state.reference), values[rows[0]], state.reference)
        state, each = model.step(model.init(zero), values[rows], 0.0)
        said, beyond = np.broadcast_to(each, rows.shape), np.asarray(state.outside.any(axis=-1))
    before = np.cumsum(used) - 1  # the last reading that was used, per row
    known = before >= 0
    deviation[known], outside[known] = said[before[known]], beyond[before[known]]
    return deviation, outside


def _moved(deviation: FloatArray, passed: BoolArray, time: FloatArray, limits: Limits | None) -> FloatArray:
    """Return minus the correction in force after each reading."""
    if limits is None:
        return deviation
    found, offset = np.empty(len(time)), 0.0
    travels = np.minimum(np.diff(time, prepend=time[:1]), limits.reading_age).tolist()
    for k, (wanted, usable, travel) in enumerate(zip(deviation.tolist(), passed.tolist(), travels, strict=True)):
        if usable and math.isfinite(wanted):
            offset = limited(Correction.opposing(Deviation(wanted)).offset, offset, travel, limits)
        found[k] = 0.0 - offset
    return found
