"""Forecasts of inputs that do not follow from a program: CSV files with a time column and one column per input."""

import csv
import math
from dataclasses import dataclass
from pathlib import Path

from thermocomp.core.exceptions import InputError, UnitError
from thermocomp.core.units import Unit
from thermocomp.recordings.headings import understand
from thermocomp.recordings.readers.leftout import why_left_out
from thermocomp.recordings.readers.limits import FileLimits, check_file

#: maximum file size; several hours with one row per second take less than 1 MiB
_MOST_BYTES = 64 << 20
_TIME = ("time", "t", "elapsed")


@dataclass(frozen=True)
class Forecast:
    """Content of a forecast file, in internal units.

    Parameters
    ----------
    source : str
        Path of the file.
    columns : dict of str to (tuple of float, tuple of float)
        By channel name, such as ``t3_C``: times since the start of the program [s], and values; empty cells are
        omitted.
    left_out : tuple of str
        Reasons why columns were not read.
    """

    source: str
    columns: dict[str, tuple[tuple[float, ...], tuple[float, ...]]]
    left_out: tuple[str, ...] = ()


def read(path: str | Path) -> Forecast:
    """Read a forecast.

    Headings specify the unit as in a recording: ``time_min``, ``t3_C``, ``room [degF]``. Lines that begin with ``#``
    are comments. Columns are separated by comma, semicolon or tab; a decimal comma is accepted unless commas separate
    columns.
    """
    source = Path(path)
    try:
        check_file(source, FileLimits())
        if source.stat().st_size > _MOST_BYTES:
            raise InputError(
                f"{source}: the file exceeds {_MOST_BYTES >> 20} MiB, the limit of a forecast; remove rows"
            )
        text = source.read_text(encoding="utf-8-sig")
    except FileNotFoundError as e:
        raise InputError(f"{source}: no such file") from e
    except (OSError, UnicodeDecodeError) as e:
        raise InputError(f"{source}: the file cannot be read as text: {e}") from e
    lines = [
        (n, line) for n, line in enumerate(text.splitlines(), start=1) if line.strip() and not line.startswith("#")
    ]
    if len(lines) < 2:
        raise InputError(
            f"{source}: a forecast needs a line of headings and rows of numbers below it; found {len(lines)} line(s)"
        )
    delimiter = next((d for d in "\t;" if d in lines[0][1]), ",")
    cells = [_cells(line, delimiter, f"{source}: line {number}") for number, line in lines]
    headings = [h.strip() for h in cells[0]]
    kept, left_out = _columns(headings, str(source))
    time = next((k for k, (name, _) in kept.items() if name == ""), None)
    if time is None or len(kept) < 2:
        what = "a column of time such as time_s" if time is None else "a column of an input such as t3_C"
        raise InputError(f"{source}: a forecast needs {what}; found {', '.join(headings)}")
    found: dict[str, tuple[list[float], list[float]]] = {name: ([], []) for name, _ in kept.values() if name}
    last = -math.inf
    for (number, _), row in zip(lines[1:], cells[1:], strict=True):
        where = f"{source}: line {number}"
        if len(row) != len(headings):
            raise InputError(f"{where} has {len(row)} cells, but there are {len(headings)} headings")
        numbers = {
            k: _number(row[k], unit, delimiter, f"{where}, column {headings[k]!r}") for k, (_, unit) in kept.items()
        }
        now = numbers.pop(time)
        if now is None or not now > last:
            raise InputError(
                f"{where}, column {headings[time]!r}: {row[time]!r}: every row needs a time later than that of the "
                "row before"
            )
        last = now
        for k, value in numbers.items():
            if value is not None:
                times, values = found[kept[k][0]]
                times.append(now)
                values.append(value)
    for name, (times, _) in found.items():
        if not times:
            left_out.append(f"{name} is empty")
    return Forecast(str(source), {n: (tuple(t), tuple(v)) for n, (t, v) in found.items() if t}, tuple(left_out))


def _cells(line: str, delimiter: str, where: str) -> list[str]:
    try:
        return next(csv.reader([line], delimiter=delimiter))
    except csv.Error as e:
        raise InputError(f"{where} cannot be read: {e}") from e


def _columns(headings: list[str], source: str) -> tuple[dict[int, tuple[str, Unit]], list[str]]:
    """Return name and unit of the readable columns, by position; the name of the time column is empty."""
    kept: dict[int, tuple[str, Unit]] = {}
    left_out = []
    for k, heading in enumerate(headings):
        try:
            meaning = understand(heading)
        except UnitError as e:
            raise InputError(f"{source}: column {heading!r}: {e}") from e
        if meaning is None:
            if heading.casefold() in (*_TIME, "timestamp", "date", "datetime"):
                raise InputError(
                    f"{source}: column {heading!r}: write the time as a number since the start of the program, and its "
                    "unit in the heading: time_s, time_min"
                )
            left_out.append(why_left_out(heading) if heading else f"column {k + 1} has no heading")
            continue
        is_time = meaning.unit.quantity == "time"
        name = "" if is_time else meaning.name
        if name in (n for n, _ in kept.values()):
            raise InputError(f"{source}: column {heading!r}: another column also holds {name or 'time'}; delete one")
        kept[k] = name, meaning.unit
    return kept, left_out


def _number(cell: str, unit: Unit, delimiter: str, where: str) -> float | None:
    """Return the value of a cell in the internal unit; None if it is empty."""
    text = cell.strip()
    if not text:
        return None
    try:
        number = float(text if delimiter == "," else text.replace(",", "."))
    except ValueError as e:
        raise InputError(f"{where}: {text!r} is not a number") from e
    if not math.isfinite(number):
        raise InputError(f"{where}: {text!r} must be finite; remove NaN and infinity")
    return unit.scale * number + unit.shift
