"""`Recording`: the synchronised table of one test, with units, roles and thermal cycles."""

import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import PurePath
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from thermocomp.core.arrays import FloatArray
from thermocomp.core.exceptions import InputError, RecordingError, tell_nearest
from thermocomp.core.machine import Channel
from thermocomp.recordings.cycles import Cycle
from thermocomp.recordings.declared import Declared
from thermocomp.recordings.frames import parts_of

AMBIENT = re.compile(
    r"(?:^|[_\W])(air|ambient|room|workshop|environment|umgeb\w*|umg|luft|lufttemp\w*|raum\w*|halle\w*)(?:$|[_\W])",
    re.IGNORECASE,
)


@dataclass(frozen=True, eq=False)
class Recording:
    """One test: the readings of the sensors and the displacement probes, row by row.

    Parameters
    ----------
    name : str
        Name of the test; usually the file name without its extension.
    time : ndarray of shape (n_rows,)
        Seconds since the first row [s], strictly increasing.
    table : DataFrame of shape (n_rows, n_channels)
        One float column per channel, in house units; NaN where a value is missing.
    channels : tuple of Channel
        One per column of `table`, in the same order.
    cycles : tuple of Cycle
        Thermal cycles, one or more; together they cover all rows.
    source : str
        File from which it was read; empty if there is none.
    sha256 : str
        Hash of the file.
    start : str
        ISO timestamp of the first row; empty if the file has only relative times.
    origin : float
        Time between the first row of the file and of the recording, if the first rows were removed [s].
    aliases : mapping of str to str
        Alternative names of channels: the heading in the file, the name without its unit.
    notes : tuple of str
        Notes of the reader for the user.
    changed : tuple of str
        Notes on changes of the values by a mapping.
    compensation : {'', 'off', 'known', 'unknown'}
        ``off``: no correction was in force at the machine; ``known``: one was, and is recorded; ``unknown``: one may
        have been; empty: not specified. See `thermocomp.recordings.compensated`.
    time_unit : str
        Unit that the source file states for its times, ``timestamp`` for dates and times of day; empty if a mapping
        states it.
    clocks : str
        How the clocks of several loggers were brought together, as text; empty for a single logger.
    declared : Declared
        Header data, measurement uncertainty and workpiece, as declared by a mapping.

    Examples
    --------
    >>> import pandas as pd
    >>> from thermocomp import Recording
    >>> table = pd.DataFrame({"time_s": [0, 60, 120], "t_front_C": [20.0, 20.6, 21.1], "z_um": [0.0, 2.1, 3.8]})
    >>> recording = Recording.from_dataframe(table, name="monday")
    >>> recording
    <Recording monday: 3 rows, 0.0 h, 1 temperatures, 1 displacements, 1 thermal cycle(s)>
    >>> recording.time.tolist(), recording.table["z_um"].tolist()
    ([0.0, 60.0, 120.0], [0.0, 2.1, 3.8])
    """

    name: str
    time: FloatArray
    table: pd.DataFrame
    channels: tuple[Channel, ...]
    cycles: tuple[Cycle, ...]
    source: str = ""
    sha256: str = ""
    start: str = ""
    origin: float = 0.0
    aliases: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    changed: tuple[str, ...] = ()
    compensation: str = ""
    time_unit: str = "s"
    clocks: str = ""
    declared: Declared = Declared()

    def __post_init__(self) -> None:
        if len(self.time) != len(self.table):
            raise RecordingError(f"{self.name}: {len(self.time)} times for {len(self.table)} rows")
        if list(self.table.columns) != [c.name for c in self.channels]:
            raise RecordingError(
                f"{self.name}: the columns of the table, {list(self.table.columns)}, are not the channels, "
                f"{[c.name for c in self.channels]}"
            )
        if len(self.time) > 1 and not (np.diff(self.time) > 0).all():
            row = int(np.flatnonzero(~(np.diff(self.time) > 0))[0]) + 1
            raise RecordingError(f"{self.name}: time does not increase at row {row}")
        covered = [row for c in self.cycles for row in (c.start, c.stop)]
        if covered != sorted(covered) or covered[:1] != [0] or covered[-1:] != [len(self.time)]:
            raise RecordingError(
                f"{self.name}: cycles {self.cycles}: expected consecutive cycles that cover rows 0 to {len(self.time)}"
            )

    @classmethod
    def from_dataframe(
        cls,
        table: pd.DataFrame,
        *,
        time: str | ArrayLike | None = None,
        units: Mapping[str, str] | None = None,
        cycles: str | Sequence[object] | None = None,
        name: str = "table",
    ) -> "Recording":
        """Return a recording made from a table.

        Parameters
        ----------
        table : DataFrame of shape (n_rows, n_columns)
            A column is a channel if its heading has a unit (``t1_C``, ``drift_um``, ``spindle_rpm``) or `units` defines
            it; omitted columns are listed in `notes`.
        time : str or array-like of shape (n_rows,), optional
            Name of a column, or the time of each row: numbers (seconds without a unit), datetimes with or
            without a time zone (the first is kept as `start`), or timedeltas. Default: the only time column, such as
            ``time_s``, or an index of times.
        units : mapping of str to str, optional
            Column to unit, such as ``{"T1": "degC", "Z": "um"}``.
        cycles : str or sequence of object of shape (n_rows,), optional
            Name of a column, or the label of each row's thermal cycle. Default: the column ``cycle``, or the spindle
            speed.
        name : str
            Name of the test.

        Returns
        -------
        Recording
            Recording in house units.

        Raises
        ------
        RecordingError
            There is no time, or it does not increase; no column is a channel; a cell is not a number.
        UnitError
            A unit is unknown.
        InputError
            A named column does not exist, or an array has another length.
        """
        return cls(**parts_of(table, time=time, units=units or {}, cycles=cycles, name=name))

    def to_frame(self) -> pd.DataFrame:
        """Return the table with the time since the first row in front, as ``time_s``."""
        table = self.table.reset_index(drop=True)
        table.insert(0, "time_s", self.time)
        return table

    def plot(self) -> Any:
        """Return a matplotlib figure of the channels over time [h], a panel per quantity."""
        quantities = list(dict.fromkeys((c.quantity, c.unit) for c in self.channels))
        panels = [tuple(c.name for c in self.channels if (c.quantity, c.unit) == q) for q in quantities]
        table = self.table.set_axis(self.time / 3600)
        size = (9.6, 0.8 + 2.2 * len(panels))
        axes = table.plot(subplots=panels, figsize=size, lw=1.0, fontsize=8, layout=(len(panels), 1))[:, 0]
        for ax, (quantity, unit) in zip(axes, quantities, strict=True):
            ax.set(ylabel=f"{quantity.replace('_', ' ')} [{unit}]", xlabel="time [h]")
        return axes[0].figure

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        hours = self.time[-1] / 3600 if len(self) else 0.0
        return (
            f"<Recording {self.name}: {len(self)} rows, {hours:.1f} h, {len(self.temperatures)} temperatures, "
            f"{len(self.displacements)} displacements, {len(self.cycles)} thermal cycle(s)>"
        )

    def of_quantity(self, quantity: str) -> tuple[Channel, ...]:
        """Return the channels of a quantity, in the order of the table."""
        return tuple(c for c in self.channels if c.quantity == quantity)

    @property
    def temperatures(self) -> tuple[Channel, ...]:
        """Temperature channels [degC]."""
        return self.of_quantity("temperature")

    @property
    def displacements(self) -> tuple[Channel, ...]:
        """Displacement channels [um]."""
        return self.of_quantity("displacement")

    @property
    def ambient(self) -> Channel | None:
        """The first temperature named after air, ambient, room, workshop or environment; None if there is none."""
        return next((c for c in self.temperatures if AMBIENT.search(c.name)), None)

    @property
    def speed(self) -> Channel | None:
        """The spindle speed [1/min], if recorded."""
        found = self.of_quantity("spindle_speed")
        return found[0] if found else None

    def channel(self, name: str) -> Channel:
        """Return a channel by its name, its heading in the file, or its name without the unit.

        Raises
        ------
        InputError
            The channel does not exist; the message names the most similar one.
        """
        wanted = self.aliases.get(name, name)
        for c in self.channels:
            if c.name == wanted:
                return c
        hint = tell_nearest(name, [c.name for c in self.channels])
        raise InputError(f"{PurePath(self.source).name or self.name}: no channel is named {name!r}; {hint}")

    def has(self, name: str) -> bool:
        """Return whether the recording has a channel of this name, which may be its heading in the file."""
        try:
            self.channel(name)
        except InputError:
            return False
        return True

    def values(self, channels: Sequence[Channel]) -> FloatArray:
        """Return the columns of `channels` as an array of shape (n_rows, n_channels), in house units."""
        return self.table[[c.name for c in channels]].to_numpy(dtype=np.float64)

    def with_cycles(self, cycles: Sequence[Cycle]) -> "Recording":
        """Return the recording with a different division into thermal cycles."""
        return replace(self, cycles=tuple(cycles))

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 of times and values: the same for the same test in any file format."""
        digest = hashlib.sha256(np.ascontiguousarray(self.time).tobytes())
        for name in sorted(str(c) for c in self.table.columns):
            digest.update(name.encode())
            digest.update(np.ascontiguousarray(self.table[name].to_numpy(dtype=np.float64)).tobytes())
        return digest.hexdigest()

    @property
    def sampling_interval(self) -> float:
        """Median time between two rows [s]; NaN for a single row."""
        return float(np.median(np.diff(self.time))) if len(self) > 1 else float("nan")
