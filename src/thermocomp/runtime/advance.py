"""Advance all models of a compensator by one reading, each group with a separate zero."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.reading import Reading
from thermocomp.core.state import State
from thermocomp.core.zero import ZeroMean
from thermocomp.runtime.group import Group


class Advanced(NamedTuple):
    """States and outputs of all models after a reading."""

    states: tuple[State, ...]
    averaged: tuple[ZeroMean, ...]  #: mean of the readings of a zero that is not yet known
    said: list[float]  #: deviation of each model; nan while its zero is unknown
    half_widths: list[float]  #: of the uncertainty bands; nan without a band
    values: list[FloatArray]  #: inputs of each model; readings of the zero are replaced by their mean
    outside: tuple[str, ...]  #: inputs outside the trained range


def advance(
    groups: Sequence[Group],
    states: Sequence[State],
    averaged: Sequence[ZeroMean],
    reading: Reading,
    time: float,
    dt: float,
) -> Advanced:
    """Pass an accepted reading to all models.

    Parameters
    ----------
    time : float
        Time of the reading [s].
    dt : float
        Time since the previous reading [s].
    """
    after, begins, n = list(states), list(averaged), len(states)
    said, widths, given, outside = [math.nan] * n, [math.nan] * n, [np.empty(0)] * n, list[str]()
    for group in groups:
        first, known = group.members[0], True
        mine = [states[k] for k in group.members]
        values = np.array(group.ranges.pick(reading.values), dtype=np.float64)
        if mine[0].memory is None and np.isnan(mine[0].reference).any():
            zeroing, most = group.lead.zeroing, group.lead.thresholds.stopped_speed
            resting = zeroing.stands(reading.values.get(zeroing.speed), most)
            mine, begun, known, values = _zeroed(group, mine, begins[first], (time, values, resting))
            for k in group.members:
                begins[k] = begun
        answers, bands = [math.nan] * len(mine), [math.nan] * len(mine)
        if known:
            mine, answers, bands = group.step(mine, values, dt)
            outside += group.beyond(mine, values)
        for k, state, answer, width in zip(group.members, mine, answers, bands, strict=True):
            after[k], said[k], widths[k], given[k] = state, answer, width, values
    return Advanced(
        states=tuple(after),
        averaged=tuple(begins),
        said=said,
        half_widths=widths,
        values=given,
        outside=tuple(dict.fromkeys(outside)),
    )


def _zeroed(
    group: Group, states: list[State], before: ZeroMean, reading: tuple[float, FloatArray, bool]
) -> tuple[list[State], ZeroMean, bool, FloatArray]:
    """Add a reading to the zero if it belongs there; return whether the zero is now known, and the zeroed reading.

    Once the zero is known, the models are advanced over the earlier readings as if it had been known from the start;
    all readings of the zero are replaced by their mean.
    """
    averaged, values, zeroing = before, reading[1], group.lead.zeroing
    if before.belongs(zeroing, reading[0], reading[2]):
        averaged = before.add(*reading)
        if not averaged.complete(zeroing):
            return states, averaged, False, values
        values = averaged.mean
    reference = np.where(np.isnan(states[0].reference), averaged.mean, states[0].reference)
    states = [s._replace(reference=reference) for s in states]
    if before.recent:
        states, _, _ = group.step(states, averaged.mean, 0.0)
    if before.last > before.first:
        states, _, _ = group.step(states, averaged.mean, before.last - before.first)
    return states, ZeroMean(), True, values
