"""Files of positioning tests: a long table, one row per approach to a target."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.exceptions import RecordingError, UnitError
from thermocomp.core.units import Unit, find_unit
from thermocomp.recordings.headings import understand
from thermocomp.recordings.readers.limits import FileLimits, check_file
from thermocomp.recordings.readers.mapping import ReadOptions
from thermocomp.recordings.readers.textfile import CsvTable, open_csv
from thermocomp.volumetric.positioning import Positioning

ENDINGS = (".csv", ".tsv", ".txt")
#: accepted names of the columns, without their unit
NAMES = {
    "position": ("position", "target", "pos"),
    "deviation": ("deviation", "error"),
    "direction": ("direction", "approach"),
    "run": ("run", "cycle"),
    "state": ("state", "thermal_state"),
    "axis": ("axis",),
}
_REQUIRED = ("position", "deviation", "direction", "run")
_DIRECTIONS = {
    **dict.fromkeys(("+", "+1", "1", "up", "positive", "pos", "forward", "↑"), "+"),
    **dict.fromkeys(("-", "-1", "−", "down", "negative", "neg", "backward", "↓"), "-"),
}
_QUANTITIES = {"position": ("position",), "deviation": ("displacement", "angle")}
_EXAMPLE = "position_mm,deviation_um,direction,run"


def read(path: str | Path) -> tuple[Positioning, ...]:
    """Read positioning tests from a CSV file.

    Columns: ``position_mm`` (or ``target_mm``), ``deviation_um`` (or ``error_um``; actual minus target; ``urad`` for an
    angle), ``direction`` (+ or -), ``run``, and if there are several ``state`` (thermal state) and ``axis``. Other
    columns are ignored. Other units of length are converted; the unit is given in the heading.
    """
    source = Path(path)
    if source.suffix.lower() not in ENDINGS:
        raise RecordingError(f"{source}: a positioning test is read from one of {', '.join(ENDINGS)}")
    try:
        limits = FileLimits()
        check_file(source, limits)
        table = open_csv(source, ReadOptions(), limits)
    except FileNotFoundError as e:
        raise RecordingError(f"{source}: no such file") from e
    except OSError as e:
        raise RecordingError(f"{source}: the file cannot be read: {e.strerror or e}") from e
    columns = {role: k for role in NAMES if (k := _find(table, role)) is not None}
    numbers = {role: columns[role] for role in ("position", "deviation")}
    texts = {role: k for role, k in columns.items() if role not in numbers}
    cells, _ = table.load(list(numbers.values()), list(texts.values()))
    values = {}
    for role, column in numbers.items():
        raw, meant = cells[column].to_numpy(dtype=np.float64), _unit(table, column, role)
        for row in np.flatnonzero(~np.isfinite(raw))[:1]:
            _refuse(table, int(row), column, "is missing; complete or delete the line")
        values[role] = raw * meant.scale
    told = {role: ["" if not isinstance(v, str) else v.strip() for v in cells[k]] for role, k in texts.items()}
    directions = _read_directions(table, columns["direction"], told["direction"])
    for row, text in enumerate(told["run"]):
        if not text:
            _refuse(table, row, columns["run"], "is missing: number the runs")
    deviation_unit = _unit(table, columns["deviation"], "deviation").house
    blank = [""] * len(directions)
    keys = list(zip(told.get("axis", blank), told.get("state", blank), strict=True))
    found = []
    for axis, state in dict.fromkeys(keys):
        mine = [row for row, key in enumerate(keys) if key == (axis, state)]
        targets = sorted({float(values["position"][row]) for row in mine})
        sides = {
            side: _matrix(
                table,
                columns["position"],
                [row for row in mine if directions[row] == side],
                told["run"],
                targets,
                values,
            )
            for side in dict.fromkeys(directions[row] for row in mine)
        }
        name = axis.upper() or _axis(table.headings[columns["position"]])
        found.append(
            Positioning(
                axis=name,
                state=state,
                unit=deviation_unit,
                positions=np.array(targets),
                up=sides.get("+"),
                down=sides.get("-"),
                source=str(source),
            )
        )
    return tuple(found)


def _read_directions(table: CsvTable, column: int, texts: Sequence[str]) -> list[str]:
    for row, text in enumerate(texts):
        if text.casefold() not in _DIRECTIONS:
            _refuse(table, row, column, f"is {text!r}: write + or - for the direction of approach")
    return [_DIRECTIONS[text.casefold()] for text in texts]


def _matrix(
    table: CsvTable,
    column: int,
    rows: Sequence[int],
    runs: Sequence[str],
    targets: Sequence[float],
    values: dict[str, FloatArray],
) -> FloatArray:
    """Return the deviations of one direction, (n_runs, n_targets)."""
    position = values["position"]
    names = list(dict.fromkeys(runs[row] for row in rows))
    filled = np.full((len(names), len(targets)), np.nan)
    for j, name in enumerate(names):
        mine = [row for row in rows if runs[row] == name]
        _refuse_unsorted(table, column, mine, position, name)
        for row in mine:
            filled[j, targets.index(float(position[row]))] = values["deviation"][row]
        missing = np.flatnonzero(np.isnan(filled[j]))
        if missing.size:
            _refuse(
                table,
                mine[-1],
                column,
                f"run {name} in this direction ends here without the target {targets[missing[0]]:g} mm, which other "
                "runs have: complete the run, or delete the target from all runs",
            )
    return filled


def _refuse_unsorted(table: CsvTable, column: int, rows: Sequence[int], position: FloatArray, run: str) -> None:
    """Raise an error for a run with reversed or repeated targets: a direction, run or position is wrong there."""
    steps = np.diff(position[list(rows)])
    if not steps.size:
        return
    turned = np.flatnonzero(steps * np.sign(steps[0]) <= 0)
    if turned.size:
        before, row = rows[int(turned[0])], rows[int(turned[0]) + 1]
        what = "is repeated" if position[row] == position[before] else "reverses the direction"
        _refuse(
            table,
            row,
            column,
            f"is unsorted: {position[row]:g} mm {what} after {position[before]:g} mm ({table.place(before)}) in run "
            f"{run} of one direction; check position, direction and run there",
        )


def _find(table: CsvTable, role: str) -> int | None:
    """Return the index of the column with a role, such as position or deviation; None if there is none."""
    fitting = [k for k, h in enumerate(table.headings) if _name(h) in NAMES[role]]
    if not fitting:
        # x_mm, Y_mm: position of an axis
        fitting = [k for k, h in enumerate(table.headings) if role == "position" and _axis(h)]
    if len(fitting) > 1:
        named = " and ".join(repr(table.headings[k]) for k in fitting)
        raise RecordingError(f"{table.path}: heading line: columns {named} all contain a {role}: keep one, in one unit")
    if not fitting and role in _REQUIRED:
        raise RecordingError(
            f"{table.path}: heading line: no column {role!r} among {', '.join(h for h in table.headings if h)}; a "
            f"positioning test has the columns {_EXAMPLE} (direction is + or -; state and axis if there are several)"
        )
    return fitting[0] if fitting else None


def _name(heading: str) -> str:
    """Return a heading without its unit, in lower case and as one word."""
    bare = re.sub(r"\s*[\[(].*[\])]\s*$", "", heading)
    meaning = understand(heading) if bare == heading else None
    return "_".join((meaning.base if meaning is not None else bare).casefold().split())


def _axis(heading: str) -> str:
    """Return the axis named by a heading such as ``y_mm``; empty if none."""
    return _name(heading).upper() if _name(heading) in ("x", "y", "z", "u", "v", "w") else ""


def _unit(table: CsvTable, column: int, role: str) -> Unit:
    """Return the unit in the heading of a column."""
    heading = table.headings[column]
    found = re.search(r"[\[(](.*)[\])]\s*$", heading)
    symbol = found[1].strip() if found else heading.rpartition("_")[2] if "_" in heading else ""
    if not symbol or symbol.casefold() in NAMES[role]:
        raise RecordingError(
            f"{table.path}: heading line, column {heading!r}: no unit; append it to the name, such as {_EXAMPLE}"
        )
    for quantity in _QUANTITIES[role]:
        try:
            return find_unit(symbol, quantity)
        except UnitError as e:
            failure = e
    raise UnitError(f"{table.path}: heading line, column {heading!r}: {failure}") from failure


def _refuse(table: CsvTable, row: int, column: int, what: str) -> NoReturn:
    raise RecordingError(f"{table.path}: {table.place(row)}, column {table.headings[column]!r}: {what}")
