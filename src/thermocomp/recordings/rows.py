"""`Rows`: content of a file, row by row, before it becomes a recording."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Any

import numpy as np
import pandas as pd

from thermocomp.core.arrays import FloatArray, IntArray
from thermocomp.core.exceptions import InputError, tell_nearest
from thermocomp.core.machine import Channel
from thermocomp.recordings.declared import Declared

#: a time as seconds since the first row of the file [s], or as a timestamp
Instant = float | datetime | str


@dataclass(frozen=True, eq=False)
class Rows:
    """Content of a file, row by row, in house units.

    Parameters
    ----------
    source : str
        Path of the file.
    sha256 : str
        Hash of the file.
    time : ndarray of shape (n_rows,)
        Seconds since the first row of the file [s].
    start : str
        ISO timestamp of the first row of the file, if known.
    table : DataFrame of shape (n_rows, n_channels)
    channels : tuple of Channel
        One per column of `table`.
    labels : list of object or None
        Thermal cycle of each row, if the file contains it.
    place : callable
        Function that returns the location of a row in the file, such as ``line 7``.
    extra : dict of str to list of object
        Cells of further requested columns that exist.
    min_run, min_stop : float
        Shorter runs and stops of the spindle do not split the test into thermal cycles [s].
    starts : tuple of Instant
        Times at which thermal cycles begin, except for the first; empty: as labels or speed say.
    most_cycles : int
        Maximum number of thermal cycles.
    aliases : mapping of str to str
        Channel names by heading and by name without unit.
    notes : tuple of str
        Notes of the reader.
    changed : tuple of str
        Changes of the values by a mapping.
    compensation : str
        Whether a correction was in force, see `Recording`.
    time_unit : str
        Unit that the file states for its times, see `Recording`.
    clocks : str
        How the clocks of several loggers were brought together, see `Recording`.
    declared : Declared
        What the mapping declares about the test.
    """

    source: str
    sha256: str
    time: FloatArray
    start: str
    table: pd.DataFrame
    channels: tuple[Channel, ...]
    labels: list[Any] | None
    place: Callable[[int], str]
    extra: dict[str, list[Any]] = field(default_factory=dict)
    min_run: float = 300.0
    min_stop: float = 300.0
    starts: tuple[Instant, ...] = ()
    most_cycles: int = 10_000
    aliases: dict[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    changed: tuple[str, ...] = ()
    compensation: str = ""
    time_unit: str = "s"
    clocks: str = ""
    declared: Declared = Declared()

    def kept(self, rows: IntArray) -> "Rows":
        """Return only the rows with the given indices."""
        numbers = rows.tolist()
        return replace(
            self,
            time=self.time[rows],
            table=self.table.iloc[rows].reset_index(drop=True),
            labels=None if self.labels is None else [self.labels[k] for k in numbers],
            place=lambda row: self.place(numbers[row]),
            extra={name: [cells[k] for k in numbers] for name, cells in self.extra.items()},
        )

    def noted(self, *changes: str) -> "Rows":
        """Return the rows with further notes on changes of their values."""
        return replace(self, changed=(*self.changed, *changes))

    def seconds(self, at: Instant, owner: str) -> float:
        """Return a time as seconds since the first row of the file [s]."""
        if isinstance(at, int | float):
            return float(at)
        if not self.start:
            raise InputError(
                f"{self.source}: {owner}: {at}: the file has no timestamps; give seconds since its first row, or its "
                "[time] start"
            )
        try:
            stamp = at if isinstance(at, datetime) else datetime.fromisoformat(at)
            return (stamp - datetime.fromisoformat(self.start)).total_seconds()
        except (ValueError, TypeError) as e:
            raise InputError(
                f"{self.source}: {owner}: {at}: expected seconds since the first row of the file, or a timestamp "
                f"like that of the first row, {self.start}"
            ) from e

    def columns(self, names: Sequence[str], owner: str) -> list[str]:
        """Return the names of the given channels, or raise an error if one does not exist."""
        known = [str(c) for c in self.table.columns]
        for name in names:
            if name not in known:
                hint = tell_nearest(name, known)
                raise InputError(f"{self.source}: {owner}: no channel is named {name!r}; {hint}")
        return list(names)

    def refuse_twins(self, owner: str) -> None:
        """Raise `InputError` unless each row is later than the previous one."""
        if not (np.diff(self.time) > 0).all():
            raise InputError(
                f"{self.source}: {owner} requires one row per time, but several rows have the same time; remove the "
                "duplicates first"
            )
