"""All models of a compensator, one reading further: each from a zero of its own."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from thermocomp.core.model import ErrorModel, FloatArray, State
from thermocomp.core.reading import Reading
from thermocomp.core.zero import Gathered, robust_mean

#: what is said to be outside where each input is inside its own range, but all together are unlike the training
TOGETHER = "inputs together"


class Advanced(NamedTuple):
    """Models after a reading."""

    states: tuple[State, ...]
    gathered: tuple[Gathered, ...]  #: readings that the zero is averaged of, where it is not known
    said: list[float]  #: deviation of each; nan while its zero is not known
    values: list[FloatArray]  #: what each took in; a reading of the zero is the mean of all of them
    outside: tuple[str, ...]  #: inputs outside the trained range


def advance(
    models: Sequence[ErrorModel],
    states: Sequence[State],
    gathered: Sequence[Gathered],
    reading: Reading,
    time: float,
    dt: float,
) -> Advanced:
    """Take a reading that passed the gate into all models.

    Parameters
    ----------
    models, states, gathered : sequence of ErrorModel, State, Gathered
    reading : Reading
    time : float
        When it was taken [s].
    dt : float
        Since the reading before [s].

    Returns
    -------
    Advanced
    """
    after, begins, said, given, outside = list(states), list(gathered), list[float](), list[FloatArray](), list[str]()
    for k, model in enumerate(models):
        memory, known = states[k], True
        values = np.array([reading.values[i.name] for i in model.inputs], dtype=np.float64)
        if memory.memory is None and np.isnan(memory.reference).any():
            resting = model.zeroing.stands(reading.values.get(model.zeroing.speed))
            memory, begins[k], known, values = _zeroed(model, memory, begins[k], (time, values, resting))
        said.append(math.nan)
        if known:
            memory, deviation = model.step(memory, values, dt)
            said[k] = float(deviation)
            outside += _beyond(model, memory, values)
        after[k] = memory
        given.append(values)
    return Advanced(tuple(after), tuple(begins), said, given, tuple(dict.fromkeys(outside)))


def _beyond(model: ErrorModel, after: State, values: FloatArray) -> list[str]:
    """Return the inputs that are outside the trained range."""
    if after.outside.any():
        return [i.name for i, out in zip(model.inputs, after.outside, strict=True) if out]
    return [] if model.distance(after, values) <= 1.0 else [TOGETHER]


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
        values = robust_mean(gathered.values)
    mean, last = robust_mean(gathered.values), gathered.times[0]
    memory = memory._replace(reference=np.where(np.isnan(memory.reference), mean, memory.reference))
    for time in before.times:
        memory, _ = model.step(memory, mean, time - last)
        last = time
    return memory, Gathered(), True, values
