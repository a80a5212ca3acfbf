"""Tables for model replay: any object that returns a column by name."""

from collections.abc import Iterator
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thermocomp.core.exceptions import InputError
from thermocomp.core.instants import seconds

FloatArray = NDArray[np.float64]


class Columns(Protocol):
    """A table that returns a column by name: a DataFrame, or a dict of arrays."""

    def __getitem__(self, name: str, /) -> Any:
        """Return a column."""

    def __contains__(self, name: object, /) -> bool:
        """Return whether a column of this name exists."""

    def __iter__(self) -> Iterator[Any]:
        """Return an iterator over the column names."""


def read_column(table: Columns, name: str, owner: str) -> NDArray[Any]:
    """Return a column of a table by name; raise `InputError` if it does not exist."""
    try:
        return np.asarray(table[name])
    except (KeyError, ValueError, IndexError, TypeError) as e:
        raise InputError(f"{owner}: the table has no column {name!r}; give a DataFrame, or a dict of columns") from e


def read_numbers(table: Columns, name: str, owner: str) -> FloatArray:
    """Return a numeric column; raise `InputError` if it is missing or not numeric."""
    values = read_column(table, name, owner)
    try:
        if values.dtype.kind in "mM":
            raise TypeError("found dates and times")
        return values.astype(np.float64)
    except (TypeError, ValueError) as e:
        raise InputError(f"{owner}: column {name!r} contains a non-numeric value: {e}") from e


def count_rows(table: Columns) -> int:
    """Return the number of rows of a table when no particular column is needed."""
    return max((np.size(table[name]) for name in table), default=0)


def read_clock(table: Columns, time: ArrayLike | str | None, owner: str, *, needed: bool) -> FloatArray | None:
    """Return the time of each row of a table [s]; None if the table has no time.

    Parameters
    ----------
    time : str or array-like or None
        Times, or the name of their column; None: the column ``time_s``, if present.
    """
    if time is None and "time_s" in table:
        time = "time_s"
    if time is None:
        if needed:
            raise InputError(
                f"{owner} has a memory and needs the time of the rows [s]: give a column name or an array as time=, "
                "or add a column time_s"
            )
        return None
    given = read_column(table, time, owner) if isinstance(time, str) else np.asarray(time)
    try:
        clock = seconds(given)
    except (TypeError, ValueError) as e:
        named = f"the time in column {time!r}" if isinstance(time, str) else "the time"
        raise InputError(f"{owner}: {named} must be numbers [s] or datetimes: {e}") from e
    if not np.isfinite(clock).all():
        raise InputError(f"{owner}: the time must be finite; remove NaN and infinity")
    return clock
