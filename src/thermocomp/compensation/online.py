"""The online step: one reading in, one correction per target out. State in, state out.

The way of a reading: gate (complete? finite? plausible? fresh? later than the last?) -> minus the reference state and
`ErrorModel.step` per component -> minus sign -> limits -> `Correction`. What the gate turns away changes nothing: every
correction stays where it was.
"""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from thermocomp.compensation.limits import limited
from thermocomp.core.correction import Correction, Deviation, Limits
from thermocomp.core.exceptions import InputError
from thermocomp.core.model import ErrorModel, State
from thermocomp.core.reading import Reading

#: what a sensor can say at all, per quantity: beyond it the sensor, not the machine, is the news
PLAUSIBLE: dict[str, tuple[float, float]] = {
    "temperature": (-40.0, 150.0),  # degC
    "spindle_speed": (-500_000.0, 500_000.0),  # 1/min
    "position": (-100_000.0, 100_000.0),  # mm
}


class OnlineState(NamedTuple):
    """All that the online step remembers."""

    models: tuple[State, ...]  #: one per model
    corrections: tuple[Correction, ...]  #: in force, one per model
    time: float | None  #: of the last reading that passed the gate [s]
    clock: float | None  #: when the step was last taken, whatever the gate said [s]


class OnlineResult(NamedTuple):
    """What the online step says of one reading."""

    corrections: dict[str, Correction]  #: in force after this reading, by target
    rejected: str  #: why the gate turned the reading away; empty if it passed
    outside: tuple[str, ...]  #: inputs outside the trained range of a model


def start(models: Sequence[ErrorModel]) -> OnlineState:
    """Return the state of a compensator that has seen no reading: all corrections are zero.

    Raises
    ------
    InputError
        Two models predict the same target, or a model does not predict micrometres.
    """
    targets = [m.target for m in models]
    if len(set(targets)) != len(targets):
        raise InputError(f"two models for the same target among {', '.join(targets)}")
    for m in models:
        if m.unit != "um":
            raise InputError(f"model of {m.target} predicts {m.unit}; the online step corrects um")
    return OnlineState(tuple(m.init() for m in models), tuple(Correction(0.0) for _ in models), None, None)


def gate(models: Sequence[ErrorModel], reading: Reading, last: float | None, now: float, limits: Limits) -> str:
    """Say why a reading must not be used; the empty string if it may.

    Parameters
    ----------
    models : sequence of ErrorModel
        Their inputs have to be in the reading.
    reading : Reading
    last : float or None
        Time of the last reading that passed [s].
    now : float
        The clock of the reading's source, now [s].
    limits : Limits

    Returns
    -------
    str
    """
    if not math.isfinite(reading.time) or not math.isfinite(now):
        return f"time {reading.time} or clock {now} is not a number"
    if now - reading.time > limits.reading_age:
        return f"reading is {now - reading.time:.1f} s old; at most {limits.reading_age:g} s"
    if last is not None and reading.time <= last:
        return f"reading of {reading.time:g} s is not later than the last one of {last:g} s"
    for model in models:
        for channel in model.inputs:
            value = reading.values.get(channel.name)
            if value is None:
                return f"{channel.name} is missing"
            low, high = PLAUSIBLE.get(channel.quantity, (-math.inf, math.inf))
            if not (low <= value <= high and math.isfinite(value)):  # a nan fails every comparison
                return f"{channel.name} = {value} {channel.unit} is not plausible"
    return ""


def step(
    models: Sequence[ErrorModel], limits: Limits, state: OnlineState, reading: Reading, now: float
) -> tuple[OnlineState, OnlineResult]:
    """Take one reading in and give the corrections that are in force after it.

    Parameters
    ----------
    models : sequence of ErrorModel
    limits : Limits
    state : OnlineState
        From `start` or the previous `step`.
    reading : Reading
    now : float
        The clock of the reading's source, now [s].

    Returns
    -------
    state : OnlineState
    result : OnlineResult
    """
    rejected = gate(models, reading, state.time, now, limits)
    if rejected:
        waiting = state._replace(clock=now) if math.isfinite(now) else state
        return waiting, _result(models, state.corrections, rejected, ())
    dt = 0.0 if state.time is None else reading.time - state.time
    # Travel is not saved up: an outage, with rejected readings or with none, must not end in a jump.
    travel = 0.0 if state.clock is None else min(now - state.clock, limits.reading_age)
    states, corrections, outside = [], [], []
    for model, memory, current in zip(models, state.models, state.corrections, strict=True):
        values = np.array([reading.values[i.name] for i in model.inputs])
        after, deviation = model.step(memory, values, dt)
        wanted = Correction.opposing(Deviation(float(deviation)))
        states.append(after)
        corrections.append(Correction(limited(wanted.offset, current.offset, travel, limits)))
        if after.outside.any():
            outside += [i.name for i, out in zip(model.inputs, after.outside, strict=True) if out]
    new = OnlineState(tuple(states), tuple(corrections), reading.time, now)
    return new, _result(models, new.corrections, "", tuple(dict.fromkeys(outside)))


def _result(
    models: Sequence[ErrorModel], corrections: Sequence[Correction], rejected: str, outside: tuple[str, ...]
) -> OnlineResult:
    by_target: Mapping[str, Correction] = {m.target: c for m, c in zip(models, corrections, strict=True)}
    return OnlineResult(dict(by_target), rejected, outside)
