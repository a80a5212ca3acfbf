"""Columns of a recording: determined by the units in their headings, or by a mapping."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache, partial

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.exceptions import RecordingError, UnitError
from thermocomp.core.machine import Channel
from thermocomp.core.messages import Message
from thermocomp.core.units import Unit, find_unit
from thermocomp.recordings.headings import Meaning, understand
from thermocomp.recordings.readers.dayforms import find_column_kind
from thermocomp.recordings.readers.mapping import ColumnMap, Mapping, Place
from thermocomp.recordings.readers.tables import FileTable, tell_places
from thermocomp.recordings.readers.timecolumns import TimePlan, find_position, find_time

#: no absolute temperature of a machine is below this value [K]
_COLDEST = 200.0
_SCPI_INFINITY = 9.9e37
#: possible meanings of numbers that are too small for kelvins
_DOUBTFUL = ({"unit": "degC"}, {"role": "ignore"})
# A factor, such as the length of a level's base, converts one of these to another.
_GEOMETRY = ("displacement", "angle", "position")


@dataclass(frozen=True)
class PlannedColumn:
    """A column of the file and its channel.

    Parameters
    ----------
    index : int
        Position in the file.
    unit : Unit
        Unit of the scaled value.
    rule : ColumnMap
        Scale, zero and missing-value codes.
    """

    index: int
    channel: Channel
    unit: Unit
    rule: ColumnMap

    def refuse_doubtful(self, raw: FloatArray, heading: str, source: str) -> None:
        """Reject temperatures in kelvins that are differences: nothing in a machine hall is colder than -73 degC."""
        valid = np.abs(raw[np.isfinite(raw)])
        if self.unit.symbol == "K" and not self.rule.unit and valid.size and float(np.median(valid)) < _COLDEST:
            raise RecordingError(
                f"{source}: column {heading!r}: values about {float(np.median(valid)):.3g} K cannot be temperatures: "
                f'they are differences, or in degC; state which in a mapping, [columns.NAME] column = "{heading}" and '
                'unit = "degC", or role = "ignore"',
                [{"columns": {self.channel.name: {"column": heading, **said}}} for said in _DOUBTFUL],
            )

    @np.errstate(over="ignore", invalid="ignore")
    def convert(
        self, raw: FloatArray, missing: Sequence[float | str], place: Callable[[int], str]
    ) -> tuple[FloatArray, tuple[str, ...]]:
        """Return the values in the house unit, NaN where missing, and notes on replaced values and their rows."""
        notes, of = [], {"name": self.channel.name, "of": len(raw)}
        codes = np.array([code for code in (*self.rule.missing, *missing) if not isinstance(code, str)])
        absent = np.isin(raw, codes) if codes.size else np.zeros(len(raw), dtype=np.bool_)
        if absent.any():
            found = ", ".join(f"{c:g}" for c in np.unique(raw[absent]))
            code = Message(
                "{name}: missing-value code {code} in {n} of {of} cells", code=found, n=int(absent.sum()), **of
            )
            notes.append(code)
        # SCPI: 9.9E37 denotes infinity, 9.91E37 denotes NaN
        infinite = (np.abs(raw) >= _SCPI_INFINITY) & ~absent
        if infinite.any():
            n = int(infinite.sum())
            notes.append(Message("{name}: infinite, taken as missing, in {n} of {of} cells", n=n, **of))
        values = np.where(absent | infinite, np.nan, raw) if notes else raw
        if self.rule.zero == "first":
            valid = np.flatnonzero(np.isfinite(values))
            values = values - values[valid[0]] if valid.size else values
        elif self.rule.zero:
            values = values - self.rule.zero
        # Multiplying only where needed preserves the digits of the file, and saves memory.
        values = values if self.rule.scale == 1 else values * self.rule.scale
        if self.rule.valid is not None:
            low, high = self.rule.valid
            beyond = np.flatnonzero((values < low) | (values > high))
            if beyond.size:
                values = np.array(values)
                values[beyond] = np.nan
                notes.append(
                    Message(
                        "{name}: not within {low:g} to {high:g} {unit}, taken as missing, in {n} of {of} cells: "
                        "{places}",
                        low=float(low),
                        high=float(high),
                        unit=self.unit.symbol,
                        n=int(beyond.size),
                        places=tell_places(beyond.tolist(), place),
                        **of,
                    )
                )
        values = values if self.unit.scale == 1 else values * self.unit.scale
        values = values + self.unit.shift if self.unit.shift else values
        if (infinite := np.isinf(values)).any():
            n = int(infinite.sum())
            notes.append(Message("{name}: infinite by its scale or unit, taken as missing, in {n} cells", n=n, **of))
            values = np.where(infinite, np.nan, values)
        return values, tuple(notes)


@dataclass(frozen=True)
class ColumnPlan:
    """Columns of a file that are read, and their meaning.

    Parameters
    ----------
    times : TimePlan
        Columns that contain the time.
    time_unit : str
        Unit of time, ``timestamp``, or empty if neither heading nor mapping specifies one.
    beside : tuple of int
        Positions of further columns that must contain the same times: one next to each channel.
    cycle : int or None
        Position of the column of cycle labels.
    columns : tuple of PlannedColumn
        One per channel.
    left_out : tuple of int
        Positions of the columns that neither their heading nor the mapping defines.
    aliases : dict of str to str
        Channel names by heading and by name without unit.
    """

    times: TimePlan
    time_unit: str
    beside: tuple[int, ...]
    cycle: int | None
    columns: tuple[PlannedColumn, ...]
    left_out: tuple[int, ...] = ()
    aliases: dict[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def plan(table: FileTable, mapping: Mapping) -> ColumnPlan:
    """Determine the columns of a file that are read, and the quantity and unit of each."""
    headings, source = table.headings, str(table.path)
    kinds = cache(partial(find_column_kind, table))
    meanings = _understand_all(headings, mapping, source)
    try:
        times = find_time(table, meanings, mapping, kinds)
    except RecordingError:
        _refuse_twins(headings, mapping, source)
        raise
    time, notes = times.time, [*times.notes]
    twins = [k for k, heading in enumerate(headings) if heading and heading == headings[time] and k != time]
    beside = () if mapping.time.column else tuple(twins)
    _refuse_twins(headings, mapping, source, headings[time] if beside else "")
    cycle = _find_cycle(headings, mapping, source)
    ignored = {k for k in (time, times.date, times.half, times.fraction, cycle, *beside) if k is not None}
    columns, used, noted = _plan_mapped(mapping, headings, meanings, source)
    ignored |= used
    notes += noted
    left_out: list[int] = []
    if not mapping.read.only_mapped:
        for k, meaning in enumerate(meanings):
            if k not in ignored and meaning is not None and meaning.unit.quantity != "time":
                channel = Channel(meaning.name, meaning.unit.quantity, meaning.unit.house)
                columns.append(PlannedColumn(k, channel, meaning.unit, ColumnMap()))
                ignored.add(k)
        left_out = [k for k, h in enumerate(headings) if h and k not in ignored]
    _check_names(columns, headings, source)
    columns.sort(key=lambda c: c.index)
    is_stamp = kinds(time) in ("date", "clock", "passed", "stamp")
    # the contents of the cells take precedence over the heading
    said = None if is_stamp else meanings[time]
    time_unit, note = _time_unit(headings[time], said, mapping, source)
    notes.extend([note] if note else [])
    return ColumnPlan(
        times=times,
        time_unit=time_unit,
        beside=beside,
        cycle=cycle,
        columns=tuple(columns),
        left_out=tuple(left_out),
        aliases=_aliases(columns, headings, meanings),
        notes=tuple(notes),
    )


def _plan_mapped(
    mapping: Mapping, headings: Sequence[str], meanings: Sequence[Meaning | None], source: str
) -> tuple[list[PlannedColumn], set[int], list[str]]:
    """Return the columns used by a mapping, the numbers of all columns that it names, and notes."""
    columns, used, notes = list[PlannedColumn](), set[int](), list[str]()
    tables: dict[int, str] = {}
    for name, rule in mapping.columns.items():
        place = rule.column or name
        if rule.role == "ignore" and isinstance(place, str) and place not in headings:
            continue
        index = find_position(place, headings, f"[columns.{name}]", source)
        heading = headings[index]
        used.add(index)
        if rule.role == "ignore":
            said = rule.reason if name in rule.reason else f"{name}: {rule.reason}"
            notes.extend([Message("ignored by the mapping: {why}", why=said)] if rule.reason else [])
            continue
        other = tables.setdefault(index, name)
        if other != name:
            raise RecordingError(
                f"{source}: mapping: [columns.{other}] and [columns.{name}] both use the column {heading!r}; "
                "delete one of the two tables"
            )
        if rule.role == "cycle":
            continue
        meant, note = _meant(rule, meanings[index], f"{source}: mapping [columns.{name}]", heading)
        notes.extend([Message("{name}: {note}", name=name, note=note)] if note else [])
        columns.append(PlannedColumn(index, Channel(name, meant.quantity, meant.house, rule.place), meant, rule))
    return columns, used, notes


def _meant(rule: ColumnMap, meaning: Meaning | None, where: str, heading: str) -> tuple[Unit, str]:
    """Return the unit of a mapped column (mapping before heading), and a note where the two differ."""
    meant = rule.conversion
    if meaning is None:
        if meant is None:
            raise RecordingError(f"{where}: specify a unit or a role; {heading!r} has none")
        return meant, ""
    said = meaning.unit
    if meant is None:
        return said, ""
    try:
        said = find_unit(said.symbol, meant.quantity)
    except UnitError as e:
        if rule.unit and rule.scale != 1 and {said.quantity, meant.quantity} <= set(_GEOMETRY):
            return meant, ""
        raise UnitError(
            f"{where}: expected a {meant.quantity} in {meant.symbol}, but the heading {heading!r} specifies "
            f"{said.symbol}, a unit of {said.quantity}; correct role and unit in the mapping, or the heading in the "
            "file if that is wrong"
        ) from e
    if not rule.unit or said == meant:
        return said, ""
    return meant, _contradicted(heading, said.symbol, meant.symbol)


def _contradicted(heading: str, said: str, meant: str) -> Message:
    return Message(
        "the heading {heading!r} specifies {said}, the mapping {meant}; the mapping applies",
        heading=heading,
        said=said,
        meant=meant,
    )


def _understand_all(headings: Sequence[str], mapping: Mapping, source: str) -> list[Meaning | None]:
    """Interpret every heading; a mistyped unit matters only if the mapping does not name the column."""
    mapped = _mapped(mapping) | {mapping.time.column}
    meanings: list[Meaning | None] = []
    for k, heading in enumerate(headings, start=1):
        try:
            meanings.append(understand(heading))
        except UnitError as e:
            if mapped.isdisjoint((heading, k)) and not mapping.read.only_mapped:
                raise UnitError(
                    f"{source}: heading {heading!r} of column {k}: {e}. Correct it, or leave the column out by a "
                    f'mapping with [columns."{heading}"] role = "ignore"'
                ) from e
            meanings.append(None)
    return meanings


def _time_unit(heading: str, meaning: Meaning | None, mapping: Mapping, source: str) -> tuple[str, str]:
    """Return the unit of time (mapping before heading), and a note where the two differ."""
    given = mapping.time.unit or ("timestamp" if mapping.time.format else "")
    if meaning is None:
        return given, ""
    said = meaning.unit
    if said.quantity != "time":
        raise UnitError(
            f"{source}: mapping [time]: the heading {heading!r} specifies {said.symbol}, a unit of {said.quantity}, "
            f"not {given or 's'}; name the column that contains the time, or correct the heading"
        )
    if given in ("", "timestamp") or find_unit(given, "time") == said:
        return given or said.symbol, ""
    return given, f"time: the heading {heading!r} specifies {said.symbol}, the mapping {given}; the mapping applies"


def _find_cycle(headings: Sequence[str], mapping: Mapping, source: str) -> int | None:
    if mapping.cycles.column:
        return find_position(mapping.cycles.column, headings, "[cycles]", source)
    for name, rule in mapping.columns.items():
        if rule.role == "cycle":
            return find_position(rule.column or name, headings, f"[columns.{name}]", source)
    mapped = _mapped(mapping)
    return next((k for k, h in enumerate(headings) if h.casefold() == "cycle" and h not in mapped), None)


def _mapped(mapping: Mapping) -> set[Place]:
    return {rule.column or name for name, rule in mapping.columns.items()}


def _refuse_twins(headings: Sequence[str], mapping: Mapping, source: str, time: str = "") -> None:
    """Reject columns with equal headings, except the time column and columns that the mapping names by number."""
    numbered = {*_mapped(mapping), mapping.time.column, mapping.time.date}
    places: dict[str, list[int]] = {}
    for k, heading in enumerate(headings, start=1):
        places.setdefault(heading, []).append(k)
    found = {}
    for heading, twins in places.items():
        alone = mapping.read.only_mapped and heading not in numbered
        if heading not in ("", time) and len(twins) > 1 and not alone and not numbered.issuperset(twins):
            found[heading] = twins
    if found:
        told = ", ".join(
            f"columns {' and '.join(map(str, twins))} are {'both' if len(twins) == 2 else 'all'} named {heading!r}"
            for heading, twins in found.items()
        )
        number = next(iter(found.values()))[1]
        tables = [_numbered(heading, *twins) for heading, twins in found.items()]
        raise RecordingError(
            f"{source}: {told}; rename them, or name each by number in a mapping, such as [columns.NAME] column = "
            f"{number}",
            [{"columns": {name: said for table in tables for name, said in table.items()}}],
        )


def _numbered(heading: str, *places: int) -> dict[str, dict[str, object]]:
    """Return mapping tables for columns with equal headings, by their numbers."""
    meaning = understand(heading)
    if meaning is None:
        return {f"{'_'.join(heading.split())}_{k}": {"column": place} for k, place in enumerate(places, start=1)}
    suffix = meaning.name.removeprefix("_".join(meaning.base.split()))
    base = meaning.name.removesuffix(suffix)
    return {f"{base}_{k}{suffix}": {"column": place} for k, place in enumerate(places, start=1)}


def _check_names(columns: Sequence[PlannedColumn], headings: Sequence[str], source: str) -> None:
    if not columns:
        raise RecordingError(
            f"{source}: none of the columns {', '.join(h for h in headings if h)} is recognized as a channel; append "
            "the unit to the name (t1_C, drift_um, spindle_rpm) or give a mapping with a table [columns.NAME] for each"
        )
    seen: dict[str, PlannedColumn] = {}
    for column in columns:
        other = seen.setdefault(column.channel.name, column)
        if other is not column:
            raise RecordingError(
                f"{source}: columns {headings[other.index]!r} and {headings[column.index]!r} would both become channel "
                f"{column.channel.name!r}; rename one of them, or map it",
                [{"columns": {f"{column.channel.name}_2": {"column": headings[column.index]}}}],
            )


def _aliases(
    columns: Sequence[PlannedColumn], headings: Sequence[str], meanings: Sequence[Meaning | None]
) -> dict[str, str]:
    """Return channel names by heading, and by name without unit where it is unique."""
    names = {c.channel.name for c in columns}
    aliases: dict[str, str] = {}
    for c in columns:
        aliases.setdefault(headings[c.index], c.channel.name)
    bases = [(m.base, c.channel.name) for c in columns if (m := meanings[c.index]) is not None]
    counts = Counter(base for base, _ in bases)
    for base, name in bases:
        if counts[base] == 1:
            aliases.setdefault(base, name)
    return {alias: name for alias, name in aliases.items() if alias not in names}
