"""Long tables: one row per reading, with its time, the name of its channel, and its value."""

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np
import pandas as pd

from thermocomp.core.exceptions import InputError, TwoReadingsError
from thermocomp.core.messages import Message
from thermocomp.core.units import is_unit
from thermocomp.recordings.headings import is_time_name, plain_name
from thermocomp.recordings.readers.cellkinds import find_kind
from thermocomp.recordings.readers.cellunits import has_unit
from thermocomp.recordings.readers.dayforms import EPOCH, PARTS, find_column_kind
from thermocomp.recordings.readers.guesses import understand_or_none
from thermocomp.recordings.readers.mapping import Mapping
from thermocomp.recordings.readers.numbers import is_filler, is_number_like
from thermocomp.recordings.readers.series import TimeScale, TimeSeries, join_series, seconds_to_ns
from thermocomp.recordings.readers.stamps import AmbiguousDatesError, parse, parse_stamps
from thermocomp.recordings.readers.tables import FileTable
from thermocomp.recordings.readers.timecolumns import find_time
from thermocomp.recordings.words import read_words

#: headings of the columns of a long table, without underscores and signs around them
_IDS, _VALUES, _UNITS = (read_words(key) for key in ("long_ids", "long_values", "long_units"))
#: a long table has few columns, and few channels
_MOST_COLUMNS, _MOST_CHANNELS = 60, 500
#: the unit among the attributes that Home Assistant stores as JSON
_ATTRIBUTE = re.compile(r"unit_of_measurement[\"']?\s*[:=]\s*[\"']?([^\"',}]+)")


def pivot(table: FileTable, mapping: Mapping) -> FileTable:
    """Return a long table as one with a column per channel; another table unchanged."""
    headings = table.headings
    value, ids, units = _find_columns(headings)
    if value is None or not ids:
        return table
    meanings = [understand_or_none(h) for h in headings]
    kinds = cache(partial(find_column_kind, table))
    try:
        plan = find_time(table, meanings, mapping, kinds)
    except InputError:
        return table
    if kinds(plan.time) == "number" and not mapping.time.column:  # dates are surer than Time_ms of unknown origin
        plan = plan._replace(time=next((k for k in range(len(headings)) if kinds(k) == "stamp"), plan.time))
    wanted = dict.fromkeys(k for k in (plan.time, plan.date, value, *ids, *units) if k is not None)
    cells = table.load([], list(wanted))[0].astype(object)
    cells = cells[cells[plan.time].notna() & cells[value].notna()]
    labels = _label(cells, ids) if len(cells) else pd.Series(dtype=object)
    if not 0 < labels.nunique() <= _MOST_CHANNELS or (labels.nunique() < 2 and meanings[value] is not None):
        return table
    shown = cells[plan.time].astype(str)
    if plan.date is not None:
        shown = cells[plan.date].astype(str) + " " + shown
    instants = _instants(shown.reset_index(drop=True), headings[plan.time], table, mapping)
    if instants is None:
        return table
    times, zone, notes = instants
    series, dropped = list[TimeSeries](), list[str]()
    for label, rows in cells.groupby(labels.to_numpy(), sort=False).indices.items():
        part = cells.iloc[rows]
        texts = part[value].astype(str)
        filled = [cell for cell in texts if not is_filler(cell)]
        if 2 * sum(is_number_like(cell) or has_unit(cell) for cell in filled) <= len(filled):
            dropped.append(str(label))
            continue
        common = meanings[value]
        unit = _unit(part[units]) or (common.unit.symbol if common else "")
        series.append(TimeSeries(_heading(str(label), unit), times[rows], texts.to_numpy(dtype=object)))
    if not series:
        return table
    heads = [s.heading.partition(".")[2] for s in series]
    if all(heads) and len({*heads}) == len(heads):  # sensor.t1, as Home Assistant writes
        series = [replace(s, heading=head) for s, head in zip(series, heads, strict=True)]
    decimal = table.decimal or "." * (getattr(table, "delimiter", "") == ",")
    told = [
        *table.notes,
        *notes,
        Message("a long table: {name!r} holds the values of {n} channels", name=headings[value], n=len(series)),
    ]
    told += [f"not read, holding no numbers: {', '.join(dropped)}"] * bool(dropped)
    clock = TimeScale(headings[plan.time] if zone else "time_s", zone)
    return join_series(table.path, series, clock, mapping.limits, told, decimal)


def _find_columns(headings: Sequence[str]) -> tuple[int | None, list[int], list[int]]:
    """Return the columns of the values, of the names of the channels, and of the units; none in a wide table."""
    if len(headings) > _MOST_COLUMNS:
        return None, [], []
    names = [plain_name(h).strip("_@ ") for h in headings]
    meanings = [understand_or_none(h) for h in headings]
    channels = [k for k, m in enumerate(meanings) if m and m.unit.quantity != "time" and not is_time_name(m.base)]
    bases = [
        plain_name(m.base) if m and k in channels else name
        for k, (m, name) in enumerate(zip(meanings, names, strict=True))
    ]
    value = next((bases.index(word) for word in _VALUES if word in bases), channels[0] if len(channels) == 1 else None)
    if {*channels} - {value}:
        return None, [], []
    ids = [names.index(word) for word in _IDS if word in names]
    units = [k for k, name in enumerate(names) if name in (*_UNITS, "attributes")]
    return value, [k for k in dict.fromkeys(ids) if k != value], units


def _label(cells: pd.DataFrame, ids: list[int]) -> "pd.Series[Any]":
    """Return the name of the channel of each reading, from the columns that distinguish channels."""
    chosen = [ids[0]]
    for k in ids[1:]:
        if cells.groupby([cells[j].astype(str) for j in chosen])[k].nunique().max() > 1:
            chosen.append(k)
    chosen = [k for k in chosen if cells[k].nunique() > 1] or chosen[:1]
    parts = [cells[k].astype(str).str.strip() for k in reversed(chosen)]
    labels = parts[0]
    for part in parts[1:]:
        labels = labels + "_" + part
    return labels


def _heading(label: str, unit: str) -> str:
    known = understand_or_none(label) is not None
    return f"{label} [{unit}]" if unit and not known else label


def _unit(cells: pd.DataFrame) -> str:
    for text in (str(cell) for k in cells for cell in cells[k].dropna().iloc[:1]):
        found = _ATTRIBUTE.search(text)
        unit = (found[1] if found else text).strip()
        if unit and is_unit(unit):
            return unit
    return ""


def _instants(
    shown: "pd.Series[Any]", heading: str, table: FileTable, mapping: Mapping
) -> tuple[Any, Any, tuple[str, ...]] | None:
    """Return the instants of readings [ns], their zone, and notes; None if they are no timestamps."""
    numbers = pd.to_numeric(shown, errors="coerce").to_numpy(dtype=np.float64)
    meaning = understand_or_none(heading)
    if meaning is not None and meaning.unit.quantity == "time":
        with suppress(ValueError):
            return seconds_to_ns(numbers * meaning.unit.scale), "", ()
    for parts in PARTS:
        if np.isfinite(numbers).all() and EPOCH[0] * parts <= numbers.min() <= numbers.max() < EPOCH[1] * parts:
            return np.round(numbers * (1e9 / parts)).astype(np.int64), "UTC", (f"{heading!r} counts from 1970",)
    zone: Any = "naive"
    notes: tuple[str, ...] = ()
    if mapping.time.format:
        stamps = parse(shown, mapping.time.format)
    elif find_kind(shown.iloc[:100].tolist()) not in ("stamp", "date"):
        return None
    else:
        try:
            found = parse_stamps(shown, heading)
        except AmbiguousDatesError as e:
            raise TwoReadingsError(
                f"{table.path}: column {heading!r}: {shown.iloc[0]!r} can be read as {e}; state how it is written",
                [{"time": {"column": heading, "format": form}} for form in e.readings],
            ) from e
        if found is None:
            stamps = pd.Series([pd.NaT])
        else:
            stamps = found.stamps
            notes, zone = found.notes, (pd.Timestamp(found.start).tzinfo if found.start else None) or "naive"
    if stamps.isna().any():
        return None
    return stamps.to_numpy(dtype="M8[ns]").view(np.int64), zone, notes
