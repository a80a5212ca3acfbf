"""Mapping file (TOML): roles and units of the columns of a foreign recording."""

import codecs
import math
from collections.abc import Mapping as AbstractMapping
from dataclasses import dataclass, field, fields, replace
from datetime import datetime
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, Literal
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from pydantic import Field, ValidationError
from pydantic_core import ErrorDetails

from thermocomp.core.exceptions import InputError, UnitError
from thermocomp.core.units import HOUSE_UNITS, Unit, find_unit
from thermocomp.files.plaintext import strict_adapter
from thermocomp.files.tomlfile import as_json, read_toml
from thermocomp.recordings.cleaning import Cut, Resample, Rezero, Shift, Swap
from thermocomp.recordings.declared import Declared, ExpandingBody, HeaderData, MeasuringUncertainty, Workpiece
from thermocomp.recordings.readers.limits import FileLimits
from thermocomp.recordings.rows import Instant

#: a column by its heading or 1-based number
Place = str | int
#: a table ``[[clean]]``
CleaningStep = Annotated[Cut | Shift | Rezero | Swap | Resample, Field(discriminator="do")]
Role = Literal[
    "temperature",
    "displacement",
    "spindle_speed",
    "position",
    "angle",
    "feed",
    "dimensionless",
    "residual",
    "correction",
    "cycle",
    "ignore",
]


@dataclass(frozen=True)
class TimeColumn:
    """Table ``[time]``: the column that contains the time.

    Parameters
    ----------
    column : str or int
        Heading or 1-based number; empty: found by its heading (``time_s``, ``timestamp`` ...).
    unit : str
        Unit of time, or ``timestamp`` for dates with a time of day; empty: from the heading and the cells.
    format : str
        Format of timestamps, in the letters of `datetime.strptime`; empty: ISO 8601.
    start : str
        ISO timestamp of the first row, for files that contain only relative times: it defines the dates, and the
        order of files that continue each other.
    date : str or int
        Column of the dates if `column` contains only the time of day.
    zone : str
        Time zone of timestamps without one, such as ``Europe/Berlin``; ``UTC`` for a clock without daylight saving.
    """

    column: Place = ""
    unit: str = ""
    format: str = ""
    start: str = ""
    date: Place = ""
    zone: str = ""


@dataclass(frozen=True)
class ColumnMap:
    """Table ``[columns.NAME]``: a column for the channel NAME.

    The value in the file's unit is ``scale * (number in the file - zero)``.

    Parameters
    ----------
    column : str or int
        Heading or 1-based number (for duplicate headings) in the file; empty: NAME itself.
    unit : str
        Unit of the scaled value; empty: the house unit of the role, or the unit in the heading.
    role : str, optional
        Measured quantity, or ``cycle`` (labels of thermal cycles), or ``ignore``. Default: determined by the unit.
    scale : float
        Factor from the number in the file to `unit`.
    zero : float or 'first'
        Number in the file that counts as zero; ``first``: the first valid one of the column.
    missing : tuple of float or str
        Numbers or words in the file that denote a missing value.
    place : str
        Location of the sensor as text.
    valid : tuple of float, optional
        Minimum and maximum valid value, in `unit` after `scale` and `zero`; values outside are missing.
    reason : str
        Why the column is ignored, as a note on the recording.
    """

    column: Place = ""
    unit: str = ""
    role: Role | None = None
    scale: float = 1.0
    zero: float | Literal["first"] = 0.0
    missing: tuple[float | str, ...] = ()
    place: str = ""
    valid: tuple[float, float] | None = None
    reason: str = ""

    @property
    def conversion(self) -> Unit | None:
        """Conversion to the house unit; None if neither unit nor role defines it."""
        quantity = self.role if self.role in HOUSE_UNITS else None
        if self.unit:
            return find_unit(self.unit, quantity)
        return find_unit(HOUSE_UNITS[quantity], quantity) if quantity else None


@dataclass(frozen=True)
class ReadOptions:
    """Table ``[read]``: format of the file; empty entries are detected automatically.

    Parameters
    ----------
    delimiter : str
        One character; a space denotes any white space.
    encoding : str
        Encoding, such as ``cp1252``; empty: UTF-8, or Latin-1 if it is not UTF-8.
    comment : str
        Start of lines that are skipped; empty: none.
    missing : tuple of float or str
        Numbers or words that denote a missing value in every column.
    only_mapped : bool
        True: columns without a table ``[columns.NAME]`` are left out.
    heading : int
        Line or row of the headings (1-based); 0: detected automatically.
    skip : tuple of int or pair of int
        Lines or rows to be skipped (1-based), as in error messages; a pair is a range that includes both ends.
    sheet : str
        Sheet of a workbook, group of a TDMS or HDF5 file, variable of a MAT file; empty: the only one, or the only one
        with a table that has a time.
    """

    delimiter: str = ""
    decimal: Literal["", ".", ","] = ""
    encoding: str = ""
    comment: str = "#"
    missing: tuple[float | str, ...] = ()
    only_mapped: bool = False
    heading: int = 0
    skip: tuple[int | tuple[int, int], ...] = ()
    sheet: str = ""

    def skips(self, place: int) -> bool:
        """Return whether the mapping skips a line or row (1-based) of the file."""
        return any(place == s if isinstance(s, int) else s[0] <= place <= s[1] for s in self.skip)


@dataclass(frozen=True)
class CycleRule:
    """Table ``[cycles]``: division of the test into thermal cycles.

    Parameters
    ----------
    column : str or int
        Column of labels; empty: a column named ``cycle``, else the spindle speed.
    min_run_s, min_stop_s : float
        Shorter runs and stops of the spindle do not split the test [s].
    starts : tuple of Instant
        Times at which the cycles begin, except for the first; they replace labels and speed.
    """

    column: Place = ""
    min_run_s: float = 300.0
    min_stop_s: float = 300.0
    starts: tuple[Instant, ...] = ()


@dataclass(frozen=True)
class Mapping:
    """Roles and units of the columns of a file; see the classes of the tables.

    Parameters
    ----------
    columns : mapping of str to ColumnMap
        By channel name.
    clean : tuple of Step
        Changes of the values read, in this order; see `thermocomp.recordings.cleaning`.
    compensation : {'', 'off', 'known', 'unknown'}
        ``off``: no correction was in force at the machine; ``known``: one was, and is recorded; ``unknown``: one may
        have been; empty: not specified. See `thermocomp.recordings.compensated`.
    clocks : str
        Written by ``thermocomp join``: how the clocks of the loggers were brought together.
    test, uncertainty, expansion, workpiece
        See `thermocomp.recordings.declared`.
    """

    time: TimeColumn = TimeColumn()
    columns: AbstractMapping[str, ColumnMap] = field(default_factory=dict)
    read: ReadOptions = ReadOptions()
    cycles: CycleRule = CycleRule()
    clean: tuple[CleaningStep, ...] = ()
    limits: FileLimits = FileLimits()
    compensation: Literal["", "off", "known", "unknown"] = ""
    clocks: str = ""
    test: HeaderData = HeaderData()
    uncertainty: MeasuringUncertainty = MeasuringUncertainty()
    expansion: AbstractMapping[str, ExpandingBody] = field(default_factory=dict)
    workpiece: Workpiece | None = None

    def __post_init__(self) -> None:
        _ = self.declared  # checks the numbers
        if self.time.unit not in ("", "timestamp"):
            _unit_in("[time]", self.time.unit, "time")
        _check_start(self.time.start)
        _check_zone(self.time.zone)
        for name, column in self.columns.items():
            table = f"[columns.{name}]"
            _unit_in(table, column.unit, column.role if column.role in HOUSE_UNITS else None)
            if column.scale == 0 or not math.isfinite(column.scale):
                raise InputError(f"{table}: scale = {column.scale}: must be a number other than 0")
            if column.valid is not None and not column.valid[0] < column.valid[1]:
                raise InputError(f"{table}: valid = {list(column.valid)}: the first must be below the second")
        if len(self.read.delimiter) > 1:
            raise InputError(f"[read]: delimiter = {self.read.delimiter!r}: must be one character")
        for name in ("min_run_s", "min_stop_s"):
            if not getattr(self.cycles, name) >= 0:
                raise InputError(f"[cycles]: {name} = {getattr(self.cycles, name)}: must not be negative")
        _check_encoding(self.read.encoding or "utf-8")

    @property
    def declared(self) -> Declared:
        """What it declares about the test."""
        return Declared(self.test, self.uncertainty, self.expansion, self.workpiece)

    def over(self, below: "Mapping") -> "Mapping":
        """Return this mapping, completed by the entries that only `below` has (not read, cycles, clean, limits)."""
        time = below.time if self.time == TimeColumn() else self.time
        taken = {rule.column or name for name, rule in self.columns.items()}
        added = {name: rule for name, rule in below.columns.items() if (rule.column or name) not in taken}
        said = self.compensation or below.compensation
        columns, clocks = {**added, **self.columns}, self.clocks or below.clocks
        declared = vars(self.declared.over(below.declared))
        return replace(self, time=time, columns=columns, compensation=said, clocks=clocks, **declared)


#: only validator of external mappings; also used for the mapping that thermocomp writes into its own files
ADAPTER = strict_adapter(Mapping)

_STEPS: dict[str, type] = {step.do: step for step in (Cut, Shift, Rezero, Swap, Resample)}
_TABLES: dict[str, type] = {
    "time": TimeColumn,
    "columns": ColumnMap,
    "read": ReadOptions,
    "cycles": CycleRule,
    "limits": FileLimits,
    "test": HeaderData,
    "uncertainty": MeasuringUncertainty,
    "expansion": ExpandingBody,
    "workpiece": Workpiece,
}


def read_mapping(path: str | Path) -> Mapping:
    """Read a mapping file (TOML).

    Examples
    --------
    A stepper's counts as a displacement, and a sensor that reports -180 if it is not connected::

        [time]
        column = "time"
        format = "%Y/%m/%d-%H:%M:%S"

        [columns.z]
        column = "mcu_pos_z"
        role = "displacement"
        unit = "mm"
        scale = 0.0025
        zero = "first"

        [columns.chamber]
        column = "chamber_t"
        role = "temperature"
        missing = [-180.0]
    """
    return check_content(read_toml(path, "mapping file"), str(path))


def check_content(content: dict[str, Any], owner: str) -> Mapping:
    """Return the mapping defined by the content of a TOML file, or raise an error that names the key."""
    try:
        return ADAPTER.validate_json(as_json(content))
    except ValidationError as e:
        raise InputError(f"{owner}: {_explain(e)}") from e
    except InputError as e:
        raise type(e)(f"{owner}: {e}") from e


def _explain(failure: ValidationError) -> str:
    """Return the table, the key and the nearest known key for the first error of pydantic."""
    errors = failure.errors()
    error = min(errors, key=lambda e: "missing" in e["type"])  # a misspelt key first
    if not error["loc"]:  # a text with half a character
        return error["msg"]
    if error["loc"][:1] == ("clean",):
        return _explain_step(error)
    depth = 3 if error["loc"][0] in ("columns", "expansion") else 2
    loc = [str(part) for part in error["loc"][:depth]]  # the remaining parts are union members, not written by the user
    inside = _TABLES.get(loc[0]) if len(loc) == depth else None
    table = f"table [{'.'.join(loc[:-1])}]" if len(loc) > 1 else "top level"
    key = loc[-1]
    if "missing" in error["type"]:
        return f"{table}: key {key!r} is missing; add it"
    if error["type"] != "unexpected_keyword_argument":
        reasons = " or: ".join(e["msg"] for e in errors if e["loc"][:depth] == error["loc"][:depth])
        return f"{table}: key {key!r} = {error['input']!r:.80}: {reasons}"
    return _unknown_key(table, key, inside or Mapping)


def _explain_step(error: ErrorDetails) -> str:
    """Return the error message for an invalid table ``[[clean]]``."""
    loc = error["loc"]
    table = f"[[clean]] number {int(loc[1]) + 1}" if len(loc) > 1 else "[[clean]]"
    if len(loc) < 4:
        want = f"must be a table with do = one of {', '.join(map(repr, _STEPS))}"
        return f"{table}: {want if 'tag' in error['type'] else error['msg']}"
    key = str(loc[3])
    if error["type"] == "unexpected_keyword_argument":
        return _unknown_key(table, key, _STEPS[str(loc[2])])
    return f"{table}: key {key!r} = {error['input']!r:.80}: {error['msg']}"


def _unknown_key(table: str, key: str, inside: type) -> str:
    known = [f.name for f in fields(inside)]
    near = get_close_matches(key, known, n=1, cutoff=0.5)
    hint = f"did you mean {near[0]!r}? " if near else ""
    return f"{table}: unknown key {key!r}; {hint}known keys: {', '.join(known)}"


def _unit_in(table: str, symbol: str, quantity: str | None) -> None:
    try:
        if symbol:
            find_unit(symbol, quantity)
    except UnitError as e:
        raise UnitError(f"{table}: {e}") from e


def _check_start(stamp: str) -> None:
    try:
        if stamp:
            datetime.fromisoformat(stamp)
    except ValueError as e:
        raise InputError(
            f"[time]: start = {stamp!r} is not an ISO timestamp: write year, month, day and time of day, such as "
            '"2024-03-01T08:00:00" or, with its offset from UTC, "2024-03-01T08:00:00+01:00"'
        ) from e


def _check_zone(name: str) -> None:
    try:
        if name:
            ZoneInfo(name)
    except (ZoneInfoNotFoundError, ValueError, OSError) as e:
        raise InputError(
            f'[time]: zone = {name!r} is not known; write a name from the time zone database, such as "Europe/Berlin" '
            'or "America/Detroit", or "UTC"'
        ) from e


def _check_encoding(name: str) -> None:
    try:
        plain = codecs.decode(b"a;1\n", name) == "a;1\n"
    except (LookupError, UnicodeDecodeError, TypeError) as e:
        raise InputError(f"[read]: encoding = {name!r} is not known; use utf-8, latin-1 or cp1252") from e
    if not plain:
        raise InputError(
            f"[read]: encoding = {name!r}: save the file as UTF-8; only encodings that contain ASCII are supported"
        )
