"""Test vectors from a recording: its readings at its times, beside those of the scenarios."""

import math
from typing import Any

import numpy as np

from thermocomp.core.exceptions import InputError
from thermocomp.export.scenarios import make_readings
from thermocomp.export.vectors import NOTHING, TOLD_COLD, Readings
from thermocomp.runtime.program.tables import Tables

#: a controller has to hold the vectors: of a longer recording every second, third, ... reading is taken
MOST = 1500


def find_readings(tables: Tables, recording: Any) -> Readings:
    """Return the readings of the scenarios, then those of a recording if there is one.

    Raises
    ------
    InputError
        The recording lacks an input, or has it in another unit.
    """
    made = make_readings(tables)
    if recording is None:
        return made
    found = _of_recording(tables, recording)
    one, other = ((r.values, r.age, r.dt, *r.columns[:, -3:].T) for r in (made, found))
    values, age, dt, counter, event, amount = (np.concatenate(pair) for pair in zip(one, other, strict=True))
    return Readings(values=values, age=age, dt=dt, counter=counter, event=event.astype(int), amount=amount)


def _of_recording(tables: Tables, recording: Any) -> Readings:
    """Return the readings of a recording; each of its cycles starts cold."""
    source = recording.source or recording.name
    if missing := [c.name for c in tables.channels if not recording.has(c.name)]:
        has = ", ".join(c.name for c in recording.channels)
        raise InputError(
            f"--vectors-from {source}: no column {', '.join(missing)}, an input of the models; it has {has}"
        )
    channels = [recording.channel(c.name) for c in tables.channels]
    for own, channel in zip(tables.channels, channels, strict=True):
        if own.unit != channel.unit:
            raise InputError(f"--vectors-from {source}: {own.name} is in {channel.unit}; the model expects {own.unit}")
    step = math.ceil(len(recording) / MOST)
    event = np.full(len(recording), NOTHING)
    event[[cycle.start // step * step for cycle in recording.cycles]] = TOLD_COLD
    time = recording.time[::step]
    dt = np.diff(time, prepend=time[0] - float(np.median(np.diff(time))) if len(time) > 1 else time[0])
    return Readings(recording.values(channels)[::step], np.zeros(len(time)), dt, event=event[::step])
