"""The online step: one reading in, one correction per target out. State in, state out.

The way of a reading: gate (complete? finite? plausible? fresh? later than the last?) -> minus the reference state and
`ErrorModel.step` per component -> minus sign -> limits -> `Correction`. What the gate turns away changes nothing: every
correction stays where it was. The first readings after a start are averaged: they are what temperatures count from, and
the corrections stay zero until it is known, as long as the spindle stands (`ErrorModel.zeroing`).
"""

import math
import sys
from collections.abc import Mapping, Sequence
from numbers import Real
from statistics import median
from typing import NamedTuple

import numpy as np

from thermocomp.core.correction import Correction, Deviation, Limits
from thermocomp.core.exceptions import InputError
from thermocomp.core.model import ErrorModel, FloatArray, Input, State
from thermocomp.core.reading import Reading
from thermocomp.core.zero import Gathered, centre
from thermocomp.runtime.limits import limited

#: what a sensor can say at all, per quantity: beyond it the sensor, not the machine, is the news
PLAUSIBLE: dict[str, tuple[float, float]] = {
    "temperature": (-40.0, 150.0),  # degC
    "spindle_speed": (-500_000.0, 500_000.0),  # 1/min
    "position": (-100_000.0, 100_000.0),  # mm
}

#: any number at all; finite, so that an infinity is none
ANY = (-sys.float_info.max, sys.float_info.max)
#: how far the zero of a day may lie from the zero of the training [degC]
DAY = 15.0
#: least room beyond the trained range of a temperature [degC]
MIN_SPAN = 10.0
#: room beyond the trained range of what nature sets no bounds to (a displacement, a number), in widths of that range
WIDE = 10.0
#: how far ahead of the clock a reading may be stamped [s]
CLOCK_SKEW = 1.0


class OnlineState(NamedTuple):
    """All that the online step remembers."""

    models: tuple[State, ...]  #: one per model
    corrections: tuple[Correction, ...]  #: in force, one per model
    time: float | None  #: of the last reading that passed the gate [s]
    clock: float | None  #: the latest at which the step was taken, whatever the gate said [s]
    gathered: tuple[Gathered, ...]  #: readings that the zero is averaged of, one per model; empty once it is known


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
        Two models predict the same target, a model does not predict micrometres, or the do-no-harm gate refused it.
    """
    targets = [m.target for m in models]
    if len(set(targets)) != len(targets):
        raise InputError(f"two models for the same target among {', '.join(targets)}")
    for m in models:
        if m.unit != "um":
            raise InputError(f"model of {m.target} predicts {m.unit}; the online step corrects um")
        m.check_may_run()
    none = tuple(Correction(0.0) for _ in models)
    return OnlineState(tuple(m.init() for m in models), none, None, None, tuple(Gathered() for _ in models))


def gate(models: Sequence[ErrorModel], reading: Reading, state: OnlineState, now: float, limits: Limits) -> str:
    """Say why a reading must not be used; the empty string if it may.

    A temperature is plausible while it stays within its trained range widened by the whole span of that range. The
    first readings decide what counts as zero: there the temperatures as a whole (their median) have to be within `DAY`
    of the zero of the training, and each of them as near to the others as it was then, give or take `MIN_SPAN` or its
    trained span. What nature sets no bounds to, a displacement or a bare number, has its trained range, widened by
    `WIDE` times its width.

    Parameters
    ----------
    models : sequence of ErrorModel
        Their inputs have to be in the reading.
    reading : Reading
    state : OnlineState
        Before the reading.
    now : float
        The clock of the reading's source, now [s].
    limits : Limits

    Returns
    -------
    str
    """
    untimely = _untimely(reading, state, now, limits)
    if untimely:
        return untimely
    for model, memory in zip(models, state.models, strict=True):
        why = implausible(model, [reading.values.get(i.name) for i in model.inputs], memory.reference.tolist())
        if why:
            return why
    return ""


def implausible(model: ErrorModel, values: Sequence[object], reference: Sequence[float]) -> str:
    """Say which value of a reading must not be used and why; the empty string if all may.

    Parameters
    ----------
    model : ErrorModel
    values : sequence of shape (n_inputs,)
        As a source gave them; None is a value that is missing.
    reference : sequence of float of shape (n_inputs,)
        What counts as zero; nan where it is not known yet.

    Returns
    -------
    str
    """
    undecided = []
    for channel, value, zero in zip(model.inputs, values, reference, strict=True):
        if value is None:
            return f"{channel.name} is missing"
        low, high = plausible(channel, zero)
        # a plain float needs no further look: a nan fails every comparison, an infinity those with finite bounds
        if not ((type(value) is float or _is_number(value)) and low <= value <= high):  # type: ignore[operator]
            return f"{channel.name} = {value} {channel.unit} is not plausible"
        if math.isnan(zero) and channel.quantity == "temperature":
            undecided.append((channel, float(value) - channel.reference))  # type: ignore[arg-type]
    return _no_start(undecided) if undecided else ""


def _no_start(offsets: Sequence[tuple[Input, float]]) -> str:
    """Say why temperatures, given from the zero of the training, cannot be those of a machine that starts."""
    middle = median(offset for _, offset in offsets)
    for channel, offset in offsets:
        start = f"{channel.name} = {channel.reference + offset:g} {channel.unit} is not plausible as a start"
        if abs(middle) > DAY:
            return f"{start}: the machine is {middle:+.1f} degC from the zero of its training"
        if abs(offset - middle) > max(channel.high - channel.low, MIN_SPAN):
            return f"{start}: {offset - middle:+.1f} degC off the others, counted from the zero of its training"
    return ""


def _untimely(reading: Reading, state: OnlineState, now: float, limits: Limits) -> str:
    if not (_is_number(reading.time) and _is_number(now)):
        return f"time {reading.time} or clock {now} is not a number"
    if reading.time > now + CLOCK_SKEW:
        return f"reading is {reading.time - now:.1f} s ahead of the clock"
    if now - reading.time > limits.reading_age:
        return f"reading is {now - reading.time:.1f} s old; at most {limits.reading_age:g} s"
    if state.time is not None and reading.time <= state.time:
        return f"reading of {reading.time:g} s is not later than the last one of {state.time:g} s"
    return ""


#: what is said to be outside where each input is inside its own range, but all together are unlike the training
TOGETHER = "inputs together"


def plausible(channel: Input, zero: float) -> tuple[float, float]:
    """Return the range outside which a value says that the sensor is broken, not that the machine is warm.

    `zero` is what counts as zero now; nan while it is not known.
    """
    low, high = PLAUSIBLE.get(channel.quantity, ANY)
    if channel.quantity == "temperature" and not math.isnan(zero):
        span = max(channel.high - channel.low, MIN_SPAN)
        low, high = max(low, zero + channel.low - span), min(high, zero + channel.high + span)
    elif channel.quantity not in PLAUSIBLE:
        around = channel.reference if math.isnan(zero) else zero
        room = WIDE * max(channel.high - channel.low, abs(channel.low), abs(channel.high), 1.0)
        low, high = max(low, around + channel.low - room), min(high, around + channel.high + room)
    return low, high


def _is_number(value: object) -> bool:
    return type(value) is not bool and isinstance(value, Real) and math.isfinite(value)


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
    rejected = gate(models, reading, state, now, limits)
    if rejected:
        waiting = state._replace(clock=_later(state.clock, now)) if math.isfinite(now) else state
        return waiting, _result(models, state.corrections, rejected, ())
    dt = 0.0 if state.time is None else reading.time - state.time
    # Travel is not saved up: an outage, with rejected readings or with none, must not end in a jump.
    travel = 0.0 if state.clock is None else min(now - state.clock, limits.reading_age)
    states, corrections, begins, outside = [], [], [], []
    for k, (model, current) in enumerate(zip(models, state.corrections, strict=True)):
        memory = state.models[k]
        values = np.array([reading.values[i.name] for i in model.inputs])
        gathered, known = state.gathered[k], True
        if memory.memory is None and np.isnan(memory.reference).any():
            resting = model.zeroing.stands(reading.values.get(model.zeroing.speed))
            memory, gathered, known, values = _zeroed(model, memory, gathered, (reading.time, values, resting))
        begins.append(gathered)
        if known:
            after, deviation = model.step(memory, values, dt)
            wanted = Correction.opposing(Deviation(float(deviation)))
            states.append(after)
            corrections.append(Correction(limited(wanted.offset, current.offset, travel, limits)))
            if after.outside.any():
                outside += [i.name for i, out in zip(model.inputs, after.outside, strict=True) if out]
            elif not model.distance(after, values) <= 1.0:
                outside.append(TOGETHER)
        else:
            states.append(memory)
            corrections.append(current)
    new = OnlineState(tuple(states), tuple(corrections), reading.time, _later(state.clock, now), tuple(begins))
    return new, _result(models, new.corrections, "", tuple(dict.fromkeys(outside)))


def _zeroed(
    model: ErrorModel, memory: State, gathered: Gathered, reading: tuple[float, FloatArray, bool]
) -> tuple[State, Gathered, bool, FloatArray]:
    """Take a reading into the zero if it belongs there; return whether that is known now, and what the reading says.

    Once it is, the model goes through the readings before this one, as if it had been known from the first of them; all
    readings of the zero say their mean.
    """
    before, values = gathered, reading[1]
    if gathered.belongs(model.zeroing, reading[0], reading[2]):
        gathered = gathered.add(*reading)
        if not gathered.complete(model.zeroing):
            return memory, gathered, False, values
        values = centre(gathered.values)
    mean, last = centre(gathered.values), gathered.times[0]
    memory = memory._replace(reference=np.where(np.isnan(memory.reference), mean, memory.reference))
    for time in before.times:
        memory, _ = model.step(memory, mean, time - last)
        last = time
    return memory, Gathered(), True, values


def _later(clock: float | None, now: float) -> float:
    """Return the clock, which never goes back: time that was travelled in must not be there to travel in again."""
    return now if clock is None else max(clock, now)


def _result(
    models: Sequence[ErrorModel], corrections: Sequence[Correction], rejected: str, outside: tuple[str, ...]
) -> OnlineResult:
    by_target: Mapping[str, Correction] = {m.target: c for m, c in zip(models, corrections, strict=True)}
    return OnlineResult(dict(by_target), rejected, outside)
