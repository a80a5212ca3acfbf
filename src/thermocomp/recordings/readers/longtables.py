"""Error profiles from long tables: one row per position."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from thermocomp.core.arrays import FloatArray, IntArray
from thermocomp.core.exceptions import InputError, RecordingError, UnitError
from thermocomp.recordings.profiles import QUANTITY, ProfileOptions, Profiles
from thermocomp.recordings.readers.mapping import Mapping
from thermocomp.recordings.readers.recordings import make_recording, read_rows
from thermocomp.recordings.rows import Rows

#: column names of the position, in addition to the name of the axis
_POSITIONS = ("position_mm", "pos_mm")
#: column names of the thermal state
_STATES = ("state", "State", "profile", "Profile")


def read_long(path: str | Path, mapping: Mapping | None, options: ProfileOptions) -> Profiles:
    """Read profiles from a table with one row per position."""
    axis, unit = options.about
    rows = read_rows(path, mapping, rising=False, extra=(options.state,) if options.state else _STATES)
    owner = f"{rows.source}: {options.target}"
    column = _error_column(rows, options.columns, unit, owner)
    places = _place_columns(rows, options.position, axis, owner)
    names = [*places.values()]
    where = rows.table[names].to_numpy(dtype=np.float64)
    missing = np.flatnonzero(~np.isfinite(where).all(axis=1))
    if missing.size:
        name = names[int(np.flatnonzero(~np.isfinite(where[missing[0]]))[0])]
        raise RecordingError(
            f"{rows.source}: {rows.place(int(missing[0]))}, column {name!r}: the position is missing; fill it in or "
            "delete the row"
        )
    at = np.zeros((len(where), 3))
    at[:, ["XYZ".index(a) for a in places]] = where
    number = _states(rows, options.state, at)
    _refuse_unsorted(rows, at, number, "XYZ".index(axis), names[0])
    points = _in_order(at, axis)
    most = int(np.bincount(number).max())
    if len(points) > 2 * most:
        raise RecordingError(
            f"{owner}: {len(points)} different positions in all, but at most {most} in one thermal state: give the "
            "commanded positions, which are the same in every state"
        )
    index = {tuple(p): k for k, p in enumerate(points.tolist())}
    values = np.full((number[-1] + 1, len(points)), np.nan)
    values[number, [index[tuple(p)] for p in at.tolist()]] = rows.table[column].to_numpy(dtype=np.float64)
    kept = [c.name for c in rows.channels if c.name not in (column, *names)]
    first = np.flatnonzero(np.diff(number, prepend=-1))
    time = _mean(rows.time[:, None], first)[:, 0]
    table = pd.DataFrame(_mean(rows.table[kept].to_numpy(dtype=np.float64), first), columns=kept)
    labels = [rows.labels[k] for k in first] if rows.labels is not None else None
    stuck = np.flatnonzero(~(np.diff(time) > 0))
    if stuck.size:
        row = int(first[stuck[0] + 1])
        raise RecordingError(
            f"{rows.source}: {rows.place(row)}: a new state begins at the same time as the previous one; correct the "
            "time, or the column of states"
        )
    return Profiles(
        target=options.target,
        unit=unit,
        axis=axis,
        points=points,
        values=values,
        states=make_recording(rows, time, table, labels),
    )


def _error_column(rows: Rows, wanted: str, unit: str, owner: str) -> str:
    if wanted:
        name = rows.aliases.get(wanted, wanted)
        found = [c for c in rows.channels if c.name == name]
        if not found:
            there = ", ".join(c.name for c in rows.channels)
            raise InputError(f"{owner}: no column is called {wanted!r}; there are {there}")
        if found[0].quantity != QUANTITY[unit]:
            raise UnitError(f"{owner}: column {name!r} measures {found[0].quantity}, not {QUANTITY[unit]} in {unit}")
        return name
    names = [c.name for c in rows.channels if c.quantity == QUANTITY[unit]]
    if len(names) != 1:
        said = (
            f"there are {', '.join(names)}: specify one of them"
            if names
            else f"there is none: name one like error_{unit}"
        )
        raise RecordingError(f"{owner}: expected one column of {QUANTITY[unit]}s; {said}")
    _refuse_mixed(rows, names[0], unit, owner)
    return names[0]


def _refuse_mixed(rows: Rows, column: str, unit: str, owner: str) -> None:
    """Reject a second column in the other unit that has values where the column itself has none."""
    other = "urad" if unit == "um" else "um"
    twin = f"{column.removesuffix(f'_{unit}')}_{other}"
    if twin not in rows.table:
        return
    gaps = np.flatnonzero(rows.table[column].isna() & rows.table[twin].notna())
    if gaps.size:
        raise UnitError(
            f"{owner}: {rows.place(int(gaps[0]))}: there is a value in {twin!r} and none in {column!r}: correct the "
            f"unit, or select {column!r} explicitly"
        )


def _place_columns(rows: Rows, position: str, axis: str, owner: str) -> dict[str, str]:
    """Return the position columns by axis, the measured axis first."""
    there = [c.name for c in rows.channels if c.quantity == "position"]
    own = rows.aliases.get(position, position)
    wanted = (own,) if own else (*_POSITIONS, f"{axis.lower()}_mm", f"{axis}_mm")
    found = [name for name in wanted if name in there]
    if not found:
        raise RecordingError(
            f"{owner}: no column of positions is called {' or '.join(wanted)}; rename the column, or specify it. "
            f"Position columns: {', '.join(there) or 'none'}"
        )
    others = {a: n for a in "XYZ" if a != axis for n in (f"{a.lower()}_mm", f"{a}_mm") if n in there}
    return {axis: found[0], **others}


def _states(rows: Rows, column: str, at: FloatArray) -> IntArray:
    """Return the index of the thermal state to which each row belongs."""
    if column and column not in rows.extra:
        raise InputError(f"{rows.source}: there is no column {column!r} for the states")
    labels = next(iter(rows.extra.values()), None)
    if labels is not None:
        begins = [k == 0 or labels[k] != labels[k - 1] for k in range(len(labels))]
        seen: set[Any] = set()
        for k in np.flatnonzero(begins):
            if labels[k] in seen:
                raise RecordingError(
                    f"{rows.source}: {rows.place(int(k))}: state {labels[k]!r} appears again after another state; "
                    "rename it, or sort the rows"
                )
            seen.add(labels[k])
    elif (np.diff(rows.time) == 0).any():
        begins = (np.diff(rows.time, prepend=-np.inf) > 0).tolist()
    else:
        begins, been = [], set[tuple[float, ...]]()
        for point in map(tuple, at.tolist()):
            begins.append(not been or point in been)
            been = {point} if begins[-1] else been | {point}
    return np.cumsum(begins).astype(np.intp) - 1


def _refuse_unsorted(rows: Rows, at: FloatArray, state: IntArray, own: int, column: str) -> None:
    last: dict[tuple[float, ...], float] = {}
    for k, point in enumerate(at.tolist()):
        if k and state[k] != state[k - 1]:
            last = {}
        line = tuple(np.delete(point, own).tolist())
        before = last.get(line, -np.inf)
        if point[own] <= before:
            what = "occurs twice" if point[own] == before else f"follows {before:g} mm"
            raise RecordingError(
                f"{rows.source}: {rows.place(k)}, column {column!r}: {point[own]:g} mm {what} in one thermal state, "
                "but positions must increase: sort the rows, average repeated measurements, or separate the states "
                "by a column 'state'"
            )
        last[line] = point[own]


def _in_order(at: FloatArray, axis: str) -> FloatArray:
    """Return the measured points, line by line, with the position of the axis itself increasing."""
    own = "XYZ".index(axis)
    keys = [at[:, own], *(at[:, k] for k in range(3) if k != own)]
    ordered = at[np.lexsort(keys)]
    new = np.concatenate([[True], (np.diff(ordered, axis=0) != 0).any(axis=1)])
    points: FloatArray = ordered[new]
    return points


def _mean(values: FloatArray, first: IntArray) -> FloatArray:
    """Return the mean over the rows of each state; the mean of equal values is exact to the last bit."""
    out = np.full((len(first), values.shape[1]), np.nan)
    for k, rows in enumerate(np.split(values, first[1:])):
        for j, column in enumerate(rows.T):
            there = column[np.isfinite(column)]
            if there.size:
                out[k, j] = there[0] + np.mean(there - there[0])
    return out
