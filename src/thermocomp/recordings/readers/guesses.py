"""Guesses for columns without a clear heading: by name and values, to be confirmed by the user."""

import re
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pandas as pd

from thermocomp.core.arrays import FloatArray
from thermocomp.core.exceptions import InputError, Remedy, UnitError
from thermocomp.core.units import HOUSE_UNITS
from thermocomp.recordings.headings import HOUSE_SUFFIX, Meaning, is_time_name, understand
from thermocomp.recordings.readers.dayforms import find_day_columns
from thermocomp.recordings.readers.leftout import find_electric_unit, tell_sensitivity
from thermocomp.recordings.readers.mapping import Mapping
from thermocomp.recordings.readers.tables import FileTable
from thermocomp.recordings.readers.timecolumns import find_parts
from thermocomp.recordings.readers.times import find_likely_units

#: maximum number of columns with guesses
MOST_GUESSES = 100
#: words in names, by meaning
_TEMPERATURE = re.compile(
    r"t\d*|tc\d*|pt\d+\w*|rtd\d*|ntc\d*|temp\w*|thermo\w*|lager|bearing|motor|ambient|umgebung|raum|room|air|luft|"
    r"coolant|k[uü]hl\w*|[oö]l|oil|housing|geh[aä]use|flansch|flange|nose|bett|bed|column|st[aä]nder|chamber"
)
_SPEED = re.compile(r"n|s|rpm|drehzahl|speed|spindle|spindel|spindeldrehzahl|broche|vitesse|velocidad")
_DISPLACEMENT = re.compile(
    r"d?[xyz]\d*|drift|disp\w*|displacement|weg\d*|verlagerung|taster\d*|probe\d*|error|fehler|abweichung|deviation|"
    r"deformation|lvdt\d*|eddy\d*|dial\d*|uhr\d*"
)
#: words for setpoints, which are not measured
_SET = re.compile(r"target|set|setpoint|soll\w*|sp|consigne")
#: range of temperatures of a machine [degC], and smallest plausible top speed of a spindle [1/min]
_DEGREES = (-40.0, 200.0)
_TURNING = 50.0
#: largest span of a drift in mm
_MILLIMETRES = 0.5
#: other possible roles of a column, after the guess
_ROLES = ("temperature", "displacement", "spindle_speed", "position")


def guess(table: FileTable, mapping: Mapping) -> tuple[Remedy, ...]:
    """Guess the time, and the meaning of columns that neither heading nor mapping defines."""
    if find_parts(table.headings):
        return ()  # no single column contains the time
    columns: dict[str, Any] = {}
    for _, options in guess_columns(table, mapping):
        columns.update(options[0]["columns"])
    found = []
    for time in _guess_times(table, mapping) or [{}]:
        others = {n: keys for n, keys in columns.items() if not time or keys.get("column", n) != time["column"]}
        found.append({**({"time": time} if time else {}), **({"columns": others} if others else {})})
    return tuple(way for way in found if way)


def guess_columns(table: FileTable, mapping: Mapping) -> list[tuple[str, list[Remedy]]]:
    """Guess the meaning of numeric columns that neither heading nor mapping defines."""
    known = {rule.column or name for name, rule in mapping.columns.items()}
    known |= {mapping.time.column, mapping.time.date, mapping.cycles.column}
    unknown = [
        k
        for k, heading in enumerate(table.headings)
        if heading and known.isdisjoint((heading, k + 1)) and heading.casefold() != "cycle"
        if understand_or_none(heading) is None and table.is_number(k, empty=False)
    ]
    days = set(find_day_columns(table, unknown[:MOST_GUESSES]))  # left out only with the user's confirmation
    unknown = [k for k in unknown if k not in days]
    found = []
    for k, values in _numbers(table, unknown[:MOST_GUESSES]).items():
        heading = table.headings[k]
        place = heading if table.headings.count(heading) == 1 else k + 1
        shown = ", ".join(f"{v:g}" for v in values[np.isfinite(values)][:3])
        if unit := find_electric_unit(heading):  # its sensitivity is not known
            text = f"{heading!r} ({shown} ...) is in {unit}: {tell_sensitivity(unit)}"
            found.append((text, [_table(heading, k, place, "", "")]))
            continue
        best = _role(heading, values)
        others = [(role, HOUSE_UNITS[role]) for role in _ROLES if role != best[0]] + [("", "")] * bool(best[0])
        ways = [_table(heading, k, place, role, unit) for role, unit in (best, *others)]
        found.append((f"{heading!r} ({shown} ...) has no known unit", ways))
    return found


def _table(heading: str, number: int, place: str | int, role: str, unit: str) -> Remedy:
    """Return the suggested mapping entry for a column, with its role if one was guessed."""
    base = "_".join(re.sub(r"[^\w\s.-]", " ", heading).split()) or f"column_{number + 1}"
    name = f"{base}_{HOUSE_SUFFIX[HOUSE_UNITS[role]]}" if role else base
    said: dict[str, Any] = {} if name == place else {"column": place}
    said |= {"role": role, "unit": unit} if role else {"role": "ignore"}
    return {"columns": {name: said}}


def understand_or_none(heading: str) -> Meaning | None:
    """Return the meaning of a heading; None if it is not understood, or has an unknown unit."""
    try:
        return understand(heading)
    except UnitError:
        return None


def _numbers(table: FileTable, columns: Sequence[int]) -> dict[int, FloatArray]:
    """Return the numeric columns; those with more texts than numbers are omitted."""
    if not columns:
        return {}
    try:
        cells, _ = table.load(columns, [])
        found = {k: cells[k].to_numpy(dtype=np.float64) for k in columns}
    except InputError:  # a column contains text
        if len(columns) < 2:
            return _mostly_numbers(table, columns)
        half = len(columns) // 2
        found = {**_numbers(table, columns[:half]), **_numbers(table, columns[half:])}
    return {k: values for k, values in found.items() if np.isfinite(values).any()}


def _mostly_numbers(table: FileTable, columns: Sequence[int]) -> dict[int, FloatArray]:
    """Return the columns in which more cells contain numbers than text, as numbers."""
    cells, _ = table.load([], columns)
    found = {}
    for k in columns:
        filled = cells[k].dropna().astype(str).str.replace(",", ".", regex=False)
        values = pd.to_numeric(filled, errors="coerce").to_numpy(dtype=np.float64)
        if 2 * np.isfinite(values).sum() > len(values):
            found[k] = values
    return found


def _role(heading: str, values: FloatArray) -> tuple[str, str]:
    """Return the quantity of a column and its unit, both empty if its name does not indicate them."""
    words = [w for w in re.split(r"[\W_]+", heading.casefold()) if w]
    good = values[np.isfinite(values)]
    low, middle, high = (float(v) for v in np.quantile(good, (0.02, 0.5, 0.98)))

    def says(pattern: re.Pattern[str], some: Iterable[str]) -> bool:
        return any(pattern.fullmatch(w) for w in some)

    if says(_SET, words):
        return "", ""
    if says(_SPEED, words) and high >= _TURNING and low >= 0:
        return "spindle_speed", "1/min"
    if says(_TEMPERATURE, words) and _DEGREES[0] <= middle <= _DEGREES[1]:
        return "temperature", "degC"
    if says(_DISPLACEMENT, words):
        return "displacement", "um" if high - low >= _MILLIMETRES else "mm"
    return "", ""


def _guess_times(table: FileTable, mapping: Mapping) -> list[dict[str, Any]]:
    """Return the first column that always increases, in its likely units, or contains dates, unless one is named."""
    dated = any(is_time_name(h) and not table.is_number(k) for k, h in enumerate(table.headings))
    if mapping.time.column or dated or any(_names_time(h) for h in table.headings):
        return []
    for k, heading in enumerate(table.headings):
        if not heading:
            continue
        if table.is_number(k, empty=False):
            values = _numbers(table, [k]).get(k)
            if values is None or understand_or_none(heading) is not None or _role(heading, values)[0]:
                continue
            if units := find_likely_units(values):
                return [{"column": heading, "unit": unit} for unit in units]
        else:
            cells = table.load([], [k])[0][k].dropna().astype(str)
            if len(cells) and pd.to_datetime(cells.iloc[:1], format="ISO8601", utc=True, errors="coerce").notna().all():
                return [{"column": heading, "unit": "timestamp"}]
    return []


def _names_time(heading: str) -> bool:
    meaning = understand_or_none(heading)
    return meaning is not None and meaning.unit.quantity == "time"
