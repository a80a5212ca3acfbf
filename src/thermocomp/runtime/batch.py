"""The compensator for all readings of a test at once, as used to judge a replay.

Same gate, models and limits as `Compensator.step`, without the cost of a call per reading; a test checks that they
agree. Each reading arrives at its time of measurement, which is also the time of the clock, so none is stale.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.correction import Correction, Deviation, Limits
from thermocomp.core.model import ErrorModel
from thermocomp.core.zero import ZeroMean, find_zero, first_rows, mean_over_time
from thermocomp.runtime import adaptation
from thermocomp.runtime.gate import explain_implausible, find_plausible_range
from thermocomp.runtime.limits import fade, limit_offset

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


class ModelRun(NamedTuple):
    """Outputs of a model in a test, and those of a compensator with it."""

    deviation: FloatArray  #: (n_rows,), of the model alone: every complete reading is used, without limits
    compensated: FloatArray  #: (n_rows,), minus the correction in force: the part removed from the deviation
    outside: BoolArray  #: (n_rows,), whether an input of the model alone was outside the trained range
    rejected: BoolArray  #: (n_rows,), complete readings that the gate rejected
    why: str  #: reason for the first rejection; empty if there is none
    half_width: FloatArray  #: (n_rows,), of the band about `deviation`; nan without a band, and after a re-zero
    shift: FloatArray  #: (n_rows,), change due to probings, contained in `compensated`
    without: FloatArray  #: (n_rows,), `compensated` without probings
    refused: tuple[str, ...]  #: reasons why probings were refused


def run(
    model: ErrorModel,
    limits: Limits | None,
    time: FloatArray,
    values: FloatArray,
    *,
    reference: Sequence[float] | FloatArray | None = None,
    resting: BoolArray | None = None,
    anew: int | None = None,
    undriven: BoolArray | None = None,
    probed: FloatArray | None = None,
    repeatability: float = 0.5,
) -> ModelRun:
    """Run a model, and a compensator with this model, through a test.

    Parameters
    ----------
    limits : Limits or None
        None: the correction follows the model immediately, as for a model whose unit differs from that of the limits.
    time : ndarray of shape (n_rows,)
        Increasing time [s].
    values : ndarray of shape (n_rows, n_inputs)
        Values in the order of the model's inputs; nan where a value is missing.
    reference : array-like of shape (n_inputs,), optional
        Zero of the inputs; see `ErrorModel.init`.
    resting : ndarray of bool of shape (n_rows,), optional
        Whether the spindle is known to be stopped; default: never.
    undriven : ndarray of bool of shape (n_rows,), optional
        Rows in which the correction is not driven because essential sensors failed: it is held, then fades.
    probed : ndarray of shape (n_rows,), optional
        Deviation measured by a probing, nan elsewhere; it takes effect from the next row onwards [um].
    repeatability : float
        Repeatability of the probe, standard deviation [um].
    """
    stands = np.zeros(len(time), dtype=np.bool_) if resting is None else resting
    complete = np.asarray(np.isfinite(values).all(axis=1))
    amounts = np.array([i.unsigned for i in model.inputs], dtype=np.bool_)
    values = np.where(amounts, np.abs(values), values)
    gate = _gated(model, time, values, stands, model.init(reference).reference)
    zero, rested = find_test_zero(model, time, values, stands, complete, reference)
    alone = _said(model, time, rested, complete, zero)
    same = np.array_equal(gate.passed, complete)
    gated = alone if same else _said(model, time, *_of_gate(values, gate))
    known = gate.known
    if anew is not None:
        counted, _ = _counted(alone.deviation, model, time, complete, stands, anew)
        # the band refers to a deviation from the cold machine
        alone = alone._replace(deviation=counted, half_width=np.full(len(time), np.nan))
        counted, known = _counted(gated.deviation, model, time, gate.passed, stands, anew)
        gated = gated._replace(deviation=counted)
    turned = complete & ~gate.passed
    drives = gate.passed if undriven is None else gate.passed & ~undriven
    moved = without = _moved(gated.deviation, drives, time, limits, known)
    shift, refused = np.zeros(len(time)), tuple[str, ...]()
    if probed is not None:
        later = np.arange(len(time)) >= known
        alone, _, _ = _adapted(model, alone, time, np.where(complete & later, probed, np.nan), repeatability, limits)
        gated, shift, refused = _adapted(
            model, gated, time, np.where(drives & later, probed, np.nan), repeatability, limits
        )
        moved = _moved(gated.deviation, drives, time, limits, known)
    return ModelRun(
        deviation=alone.deviation,
        compensated=moved,
        outside=alone.outside,
        rejected=turned,
        why=gate.why,
        half_width=alone.half_width,
        shift=shift,
        without=without,
        refused=refused,
    )


def find_test_zero(
    model: ErrorModel,
    time: FloatArray,
    values: FloatArray,
    resting: BoolArray,
    usable: BoolArray,
    reference: Sequence[float] | FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Find the zero of a model in a test.

    Parameters
    ----------
    time : ndarray of shape (n_rows,)
        [s]
    values : ndarray of shape (n_rows, n_inputs)
    resting, usable : ndarray of bool of shape (n_rows,)
    reference : array-like of shape (n_inputs,), optional
        Known part of the zero; see `ErrorModel.init`.

    Returns
    -------
    zero : ndarray of shape (n_inputs,)
        nan if unknown because there is no reading.
    values : ndarray of shape (n_rows, n_inputs)
        Values with the readings of the zero replaced by their mean.
    """
    return find_zero(model.zeroing, model.init(reference).reference, time, values, resting, usable)


class _Answers(NamedTuple):
    deviation: FloatArray  #: (n_rows,)
    outside: BoolArray  #: (n_rows,), whether an input was outside
    half_width: FloatArray  #: (n_rows,), of the uncertainty band; nan without one
    directions: FloatArray  #: (n_rows, n_directions)


class _Gate(NamedTuple):
    passed: BoolArray  #: (n_rows,)
    zero: FloatArray  #: (n_inputs,)
    known: int  #: row from which the zero is known and the correction starts to move
    why: str  #: reason why the first rejected complete reading did not pass
    window: list[int]  #: rows of the zero
    mean: FloatArray  #: (n_inputs,), of these rows


def _of_gate(values: FloatArray, gate: _Gate) -> tuple[FloatArray, BoolArray, FloatArray]:
    """Return the readings with those of the zero replaced by their mean, which of them pass, and the zero."""
    rested = values.copy()
    if gate.window:
        rested[gate.window] = gate.mean
    return rested, gate.passed, gate.zero


def _gated(model: ErrorModel, time: FloatArray, values: FloatArray, stands: BoolArray, zero: FloatArray) -> _Gate:
    """Return which readings pass the gate of the compensator, the zero, and the rows averaged for it."""
    complete = np.asarray(np.isfinite(values).all(axis=1))
    passed, why, known, window, averaged = complete.copy(), "", 0, list[int](), ZeroMean()
    if np.isnan(zero).any():  # the first readings that pass determine the zero
        known = len(time)
        for row in np.flatnonzero(complete).tolist():
            found = explain_implausible(model, values[row].tolist(), zero.tolist())
            if found:
                passed[row], why = False, why or found
                continue
            if averaged.belongs(model.zeroing, float(time[row]), bool(stands[row])):
                averaged = averaged.add(float(time[row]), values[row], bool(stands[row]))
                window.append(row)
                if not averaged.complete(model.zeroing):
                    continue
            known = row
            break
        if window:
            zero = np.where(np.isnan(zero), averaged.mean, zero)
    later = slice(min(known + 1, len(time)) if known else 0, None)
    of = zip(model.inputs, zero.tolist(), strict=True)
    bounds = [find_plausible_range(i, z, model.thresholds) for i, z in of]
    low, high = np.array(bounds).reshape(-1, 2).T
    with np.errstate(invalid="ignore"):
        passed[later] &= ((values[later] >= low) & (values[later] <= high)).all(axis=1)
    turned = np.flatnonzero(complete & ~passed)
    if turned.size and not why:
        why = explain_implausible(model, values[turned[0]].tolist(), zero.tolist())
    return _Gate(passed=passed, zero=zero, known=known, why=why, window=window, mean=averaged.mean)


def _counted(
    deviation: FloatArray, model: ErrorModel, time: FloatArray, used: BoolArray, stands: BoolArray, anew: int
) -> tuple[FloatArray, int]:
    """Return the deviations relative to the new zero, and the row from which the correction moves again."""
    own = anew + np.flatnonzero(used[anew:])
    count, known = first_rows(model.zeroing, time[own], stands[own])
    shift = float(mean_over_time(time[own[:count]], deviation[own[:count]])) if count else 0.0
    return deviation - shift, int(own[known]) if known < len(own) else len(time)


def _said(model: ErrorModel, time: FloatArray, values: FloatArray, used: BoolArray, zero: FloatArray) -> _Answers:
    """Return the output of the model per row; it is held at unused readings."""
    rows, n = np.flatnonzero(used), len(time)
    if not rows.size:
        return _Answers(np.zeros(n), np.zeros(n, dtype=np.bool_), np.full(n, np.nan), np.zeros((n, 0)))
    state = model.init()._replace(reference=zero)
    ran = model.run(state, values[rows], np.diff(time[rows], prepend=time[rows[0]]))
    last = np.cumsum(used) - 1  # index of the last used reading, per row

    def spread(values: FloatArray, before: float) -> FloatArray:
        found = np.concatenate([values, np.full((1, *values.shape[1:]), before)])
        return np.asarray(found[last])  # -1: before the first

    return _Answers(
        deviation=spread(ran.deviation, 0.0),
        outside=spread(ran.outside.max(axis=1, initial=0.0), 0.0) > 0,
        half_width=spread(model.widen(ran), np.nan),
        directions=spread(ran.outputs[:, 1:], 0.0),
    )


def _adapted(
    model: ErrorModel,
    answers: _Answers,
    time: FloatArray,
    probed: FloatArray,
    repeatability: float,
    limits: Limits | None,
) -> tuple[_Answers, FloatArray, tuple[str, ...]]:
    """Return outputs adapted by probings, the change due to probings, and the reasons for refused probings."""
    honest = model.honest_error
    size, typical, drift = (0.0, 0.0, 0.0) if honest is None else (honest.rms, honest.typical, honest.none_rms)
    most = adaptation.find_most(size, drift, math.inf if limits is None else limits.magnitude, model.thresholds)
    learned = adaptation.begin(size, answers.directions.shape[1], typical, most, model.thresholds)
    shift, narrower, refused = np.zeros(len(time)), np.ones(len(time)), list[str]()
    rows = np.flatnonzero(np.isfinite(probed)).tolist()
    for row, following in zip(rows, [*rows, len(time)][1:], strict=True):
        error = float(probed[row] - answers.deviation[row])
        learned, why = adaptation.take(
            learned, answers.directions[row], float(time[row]), error, repeatability, model.thresholds
        )
        refused += [why] if why else []
        later = slice(row + 1, following + 1)
        shift[later] = learned.shift(time[later], answers.directions[later], model.thresholds)
        if model.band is not None:
            narrower[later] = learned.narrowing(
                time[later], answers.directions[later], model.band.floor, model.thresholds
            )
    adapted = answers._replace(deviation=answers.deviation + shift, half_width=answers.half_width * narrower)
    return adapted, shift, tuple(refused)


def _moved(deviation: FloatArray, passed: BoolArray, time: FloatArray, limits: Limits | None, known: int) -> FloatArray:
    """Return minus the correction in force after each reading; it remains zero until the row `known`."""
    if limits is None:
        return np.where(np.arange(len(time)) < known, 0.0, deviation)
    found, offset, idle = np.zeros(len(time)), 0.0, 0.0
    travels = np.minimum(np.diff(time, prepend=time[:1]), limits.reading_age).tolist()
    for k in range(known, len(time)):
        if passed[k] and math.isfinite(deviation[k]):
            wanted = Correction.opposing(Deviation(float(deviation[k])))
            offset, idle = limit_offset(wanted.offset, offset, travels[k], limits), 0.0
        else:
            idle += travels[k]
            offset = fade(Correction(offset), (0.0, 0.0), idle, travels[k], limits).offset
        found[k] = 0.0 - offset
    return found
