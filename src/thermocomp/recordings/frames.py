"""Conversion of a table in memory to a recording."""

from collections.abc import Mapping, Sequence
from datetime import datetime, timedelta
from typing import Any

import numpy as np
import pandas as pd

from thermocomp.core.arrays import FloatArray
from thermocomp.core.exceptions import InputError, RecordingError
from thermocomp.core.instants import seconds
from thermocomp.core.machine import Channel
from thermocomp.core.messages import Message
from thermocomp.core.units import find_unit
from thermocomp.recordings.cycles import Cycle, find_cycles, make_single_cycle, split_by_labels
from thermocomp.recordings.headings import Meaning, understand


def parts_of(
    table: pd.DataFrame, *, time: Any, units: Mapping[str, str], cycles: str | Sequence[object] | None, name: str
) -> dict[str, Any]:
    """Return the arguments of `Recording` for a table in memory."""
    columns = [str(c) for c in table.columns]
    twice = sorted({c for c in columns if columns.count(c) > 1})
    if twice:
        raise RecordingError(f"{name}: two columns are named {twice[0]!r}; rename one of them")
    for column in units:
        if column not in columns:
            raise InputError(f"{name}: units: no column is named {column!r}; there are {', '.join(columns)}")
    if not len(table):
        raise RecordingError(f"{name}: the table has no rows; a recording needs at least one")
    plain = table.set_axis(columns, axis=1)
    labelled = cycles if isinstance(cycles, str) else "cycle" if cycles is None and "cycle" in columns else None
    if labelled is not None and labelled not in columns:
        raise InputError(f"{name}: cycles: no column is named {labelled!r}; there are {', '.join(columns)}")
    clock, start, used, unit = _time(plain, time, units, name)
    data: dict[str, FloatArray] = {}
    aliases: dict[str, str] = {}
    channels, notes = [], []
    for column in columns:
        if column in (used, labelled):
            continue
        meaning = _meaning(column, units)
        if meaning is None or meaning.unit.quantity == "time":
            notes.append(
                Message(
                    "left out: {column!r} has no unit of a channel; give it by units={{{column!r}: 'degC'}}",
                    column=column,
                )
            )
            continue
        values = _numbers(plain[column], f"{name}: column {column!r}")
        data[meaning.name] = values * meaning.unit.scale + meaning.unit.shift
        channels.append(Channel(meaning.name, meaning.unit.quantity, meaning.unit.house))
        aliases |= {alias: meaning.name for alias in (column, meaning.base) if alias != meaning.name}
    if not channels:
        raise RecordingError(
            f"{name}: none of the columns {', '.join(columns)} is recognized as a channel: name them like t1_C, "
            "drift_um or spindle_rpm, or give their units, such as units={'T1': 'degC'}"
        )
    if len(data) < len(channels):
        raise RecordingError(f"{name}: two columns would become the same channel; rename one of them")
    speed = next((data[c.name] for c in channels if c.quantity == "spindle_speed"), None)
    return {
        "name": name,
        "time": clock,
        "table": pd.DataFrame(data),
        "channels": tuple(channels),
        "cycles": tuple(_cycles(plain[labelled].tolist() if labelled is not None else cycles, clock, speed, name)),
        "start": start,
        "aliases": aliases,
        "notes": tuple(notes),
        "time_unit": unit,
    }


def _time(
    table: pd.DataFrame, given: Any, units: Mapping[str, str], name: str
) -> tuple[FloatArray, str, str | None, str]:
    """Return the time since the first row [s], the time stamp of the first row, and column and unit of the time."""
    used = None
    symbol = "s"
    if given is None:
        named = [c for c in table.columns if (m := _meaning(c, units)) is not None and m.unit.quantity == "time"]
        if len(named) == 1:
            given = named[0]
        elif not named and isinstance(table.index, pd.DatetimeIndex | pd.TimedeltaIndex):
            given = table.index
        else:
            found = f"there are {', '.join(named)}" if named else "no column such as time_s and no index of times"
            raise RecordingError(
                f"{name}: which column is the time? {found}: give time=, the name of a column or an array"
            )
    if isinstance(given, str):
        if given not in table.columns:
            raise InputError(f"{name}: time: no column is named {given!r}; there are {', '.join(table.columns)}")
        used, meaning = given, _meaning(given, units)
        symbol = meaning.unit.symbol if meaning is not None else units.get(given, "s")
        given = table[given]
    values = np.asarray(given)
    if values.shape != (len(table),):
        raise InputError(f"{name}: time: expected {len(table)} values, found an array of shape {values.shape}")
    try:
        passed = seconds(values)
    except (TypeError, ValueError) as e:
        raise RecordingError(f"{name}: the time contains a value that is neither a number nor a datetime: {e}") from e
    wrong = np.flatnonzero(~np.isfinite(passed))
    if wrong.size:
        raise RecordingError(f"{name}: the time is missing in row {wrong[0]}")
    first = values[0]
    if isinstance(first, datetime | np.datetime64):
        return passed, pd.Timestamp(first).isoformat(), used, "timestamp"
    if isinstance(first, timedelta | np.timedelta64):
        return passed - passed[0], "", used, "timestamp"
    unit = find_unit(symbol, "time")
    return (passed - passed[0]) * unit.scale, "", used, unit.symbol


def _meaning(column: str, units: Mapping[str, str]) -> Meaning | None:
    """Return the meaning of a column, from `units` or its heading."""
    if column not in units:
        return understand(column)
    meant = find_unit(units[column])
    told = understand(column)
    if told is not None and told.unit.quantity == meant.quantity:
        return Meaning(told.name, told.base, meant)
    return Meaning("_".join(column.split()), column, meant)


def _numbers(values: Any, what: str) -> FloatArray:
    try:
        found = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as e:
        raise RecordingError(f"{what} contains a non-numeric value: {e}") from e
    return np.where(np.isinf(found), np.nan, found)


def _cycles(labels: Sequence[object] | None, time: FloatArray, speed: FloatArray | None, name: str) -> Sequence[Cycle]:
    if labels is not None:
        if len(labels) != len(time):
            raise InputError(f"{name}: cycles: {len(labels)} labels for {len(time)} rows")
        return split_by_labels(labels)
    return make_single_cycle(len(time)) if speed is None else find_cycles(time, speed)
