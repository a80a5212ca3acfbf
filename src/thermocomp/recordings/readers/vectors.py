"""Files of arrays (TDMS, HDF5, MAT): the vectors of one group become the columns of a table."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from thermocomp.core.exceptions import InputError, MissingExtraError, RecordingError
from thermocomp.core.messages import Message
from thermocomp.recordings.headings import BRACKETS, is_time_name
from thermocomp.recordings.readers.guesses import understand_or_none
from thermocomp.recordings.readers.limits import FileLimits
from thermocomp.recordings.readers.mapping import ReadOptions
from thermocomp.recordings.readers.series import TimeScale, TimeSeries, join_series, seconds_to_ns
from thermocomp.recordings.readers.tables import FrameTable, check_headings, clean_heading

#: maximum number of names in a message
_MOST_NAMED = 12


@dataclass(frozen=True, kw_only=True)
class Vector:
    """A vector of a file of arrays, not yet loaded.

    Parameters
    ----------
    group : str
        Table to which it belongs; vectors of other groups are other tables.
    name : str
    size : int
        Number of values.
    load : callable
        Function that returns the values, of shape (size,).
    unit : str
    kind : str
        Kind of the values, as in ``numpy.dtype.kind``.
    step : float
        Interval of the rows [s]; 0 if the times are another vector.
    start : int
        Instant of the first row [ns since 1970]; 0 if it is not known.
    offset : float
        Time of the first row after `start` [s].
    """

    group: str
    name: str
    size: int
    load: Callable[[], NDArray[Any]]
    unit: str = ""
    kind: str = "f"
    step: float = 0.0
    start: int = 0
    offset: float = 0.0

    @property
    def heading(self) -> str:
        """Name with its unit in brackets, unless the name contains one."""
        name = f"{self.name} [s]" if self.kind == "m" else self.name
        return f"{name} [{self.unit}]" if self.unit and understand_or_none(name) is None else name

    @property
    def is_time(self) -> bool:
        """Whether the vector holds times, by its values or its name."""
        meaning = understand_or_none(self.name)
        named = is_time_name(meaning.base if meaning else self.name)
        return self.kind in "mM" or named or (meaning is not None and meaning.unit.quantity == "time")


@contextmanager
def translated(path: Path, what: str, library: str) -> Iterator[None]:
    """Convert any error that a damaged file causes in the library of its format to a `RecordingError`."""
    try:
        yield
    except ImportError as e:
        raise MissingExtraError("files", library) from e
    except (InputError, OSError) as e:
        if isinstance(e, InputError) or e.filename is not None:
            raise
        raise _refuse(path, what, e) from e
    except Exception as e:
        raise _refuse(path, what, e) from e


def _refuse(path: Path, what: str, e: Exception) -> RecordingError:
    said = " ".join(str(e).split())[:200]
    return RecordingError(f"{path}: this is not {what}, or a damaged one ({type(e).__name__}: {said}); export it again")


def as_columns(
    name: str, shape: tuple[int, int], names: Sequence[tuple[str, Sequence[str]]]
) -> list[tuple[str, tuple[Any, Any]]]:
    """Return name and index of each vector of a matrix: its longer side is the time.

    Parameters
    ----------
    names : sequence of (str, sequence of str)
        Lists of texts of the same group, with their names; the one most similar to `name` names the vectors.
    """
    across = shape[0] < shape[1]
    n = min(shape)
    if n == 1:
        return [(name, (0, slice(None)) if across else (slice(None), 0))]
    lists = {key: texts for key, texts in names if len(texts) == n}
    nearest = get_close_matches(name, lists, n=1, cutoff=0)
    split = understand_or_none(name)
    unit = f" [{split.unit.symbol}]" if split else ""
    labels = lists[nearest[0]] if nearest else [f"{split.base if split else name}{k}" for k in range(1, n + 1)]
    labels = [label.strip() if understand_or_none(label) else f"{label.strip()}{unit}" for label in labels]
    return [(label, (k, slice(None)) if across else (slice(None), k)) for k, label in enumerate(labels)]


def make_table(path: Path, vectors: Sequence[Vector], options: ReadOptions, limits: FileLimits) -> FrameTable:
    """Return the table of the group that holds a recording."""
    chosen, notes = _choose(path, [v for v in vectors if v.size > 1], options)
    limits.check_table(max(v.size for v in chosen), len(chosen), path)
    limits.check_unpacked(sum(8 * v.size for v in chosen), path)
    headings = [clean_heading(v.heading) for v in chosen]
    check_headings(path, [*headings, ""] if len(headings) > 1 else [*headings, "time"], chosen[0].size, limits)
    columns = [_plain(v.load(), v) for v in chosen]
    if not chosen[0].step:
        frame = pd.DataFrame(dict(enumerate(columns)), copy=False)
        return FrameTable(path, tuple(headings), frame, range(1, len(frame) + 1), notes=notes, decimal=options.decimal)
    clock = TimeScale("timestamp", "UTC") if all(v.start for v in chosen) else TimeScale()
    origin = [v.start if clock.zone else 0 for v in chosen]
    times = [
        at + seconds_to_ns(np.asarray(v.offset + v.step * np.arange(v.size), dtype=np.float64))
        for at, v in zip(origin, chosen, strict=True)
    ]
    if len({(v.size, v.step, v.offset, at) for v, at in zip(chosen, origin, strict=True)}) > 1:
        series = [TimeSeries(h, t, c.to_numpy()) for h, t, c in zip(headings, times, columns, strict=True)]
        return join_series(path, series, clock, limits, notes, options.decimal)
    frame = pd.DataFrame(dict(enumerate([clock.column(times[0]), *columns])), copy=False)
    headings = [clock.heading, *headings]
    return FrameTable(path, tuple(headings), frame, range(1, len(frame) + 1), notes=notes, decimal=options.decimal)


def _plain(values: NDArray[Any], vector: Vector) -> "pd.Series[Any]":
    """Return values as a column of numbers, times or texts."""
    if len(values) != vector.size:
        raise ValueError(f"{vector.name}: {len(values)} values in place of {vector.size}")
    if vector.kind == "m":
        return pd.Series(values / np.timedelta64(1, "s"))
    return pd.Series(values)


def _choose(path: Path, vectors: list[Vector], options: ReadOptions) -> tuple[list[Vector], tuple[str, ...]]:
    """Return the vectors to read, and notes on the others."""
    groups: dict[str, list[Vector]] = {}
    for v in vectors:
        groups.setdefault(v.group, []).append(v)
    named = ", ".join(map(repr, list(groups)[:_MOST_NAMED])) + " ..." * (len(groups) > _MOST_NAMED)
    if options.sheet:
        if options.sheet not in groups:
            raise RecordingError(f"{path}: mapping [read]: there is no group {options.sheet!r}; there are {named}")
        groups = {options.sheet: groups[options.sheet]}
    stepped = [v for group in groups.values() for v in group if v.step]
    timed = {name: group for name, group in groups.items() if any(v.is_time for v in group) and len(group) > 1}
    if stepped and not timed and max(Counter(v.heading for v in stepped).values()) == 1:
        return stepped, _tell_rest([v for group in groups.values() for v in group if not v.step], "without an interval")
    likely = timed or {v.group: groups[v.group] for v in stepped}
    if not likely and len(groups) == 1 and len(vectors) > 1:
        likely = timed = groups  # the columns are asked for, as in other files
    if not likely:
        names = ", ".join(repr(v.name) for v in vectors[:_MOST_NAMED]) + " ..." * (len(vectors) > _MOST_NAMED)
        raise RecordingError(
            f"{path}: no times beside the values: {f'found {names}' if names else 'there are no vectors'}; "
            "export it with a vector named time, with time stamps, or (TDMS) with the interval wf_increment"
        )
    if len(likely) > 1:
        shown = ", ".join(map(repr, list(likely)[:_MOST_NAMED]))
        raise RecordingError(
            f"{path}: the groups {shown} all hold a table; state which in a mapping, such as [read] sheet = "
            f'"{next(iter(likely))}"',
            [{"read": {"sheet": name}} for name in likely],
        )
    name, group = next(iter(likely.items()))
    if name not in timed:
        return [v for v in group if v.step], ()
    sizes = Counter(v.size for v in group if v.is_time) or Counter(v.size for v in group)
    size = max(sizes, key=lambda n: (sum(v.size == n for v in group), n))
    notes = (Message("group {name!r} of {names} is read", name=name, names=named),) if len(groups) > 1 else ()
    return [v for v in group if v.size == size], notes + _tell_rest(
        [v for v in group if v.size != size], "of another length"
    )


def _tell_rest(vectors: list[Vector], why: str) -> tuple[str, ...]:
    names = ", ".join([v.name for v in vectors if v.kind not in "OS"][:_MOST_NAMED])
    return (f"not read, {why}: {names}",) if names else ()


def number_to_stamp(values: NDArray[Any], days: tuple[float, float], origin: float, day: float) -> Any:
    """Return increasing times counted from an origin of their own as timestamps; other vectors as they are.

    Parameters
    ----------
    days : (float, float)
        Range of the numbers that are such times.
    origin : float
        Number of 1 January 1970.
    day : float
        Length of one unit of the numbers [s].
    """
    if values.dtype.kind not in "fiu" or not values.size or not (np.diff(values) > 0).all():
        return values
    if not days[0] <= values[0] <= values[-1] < days[1]:
        return values
    return np.round((values - origin) * (day * 1e3)).astype("M8[ms]").astype("M8[ns]")


def find_waveform(said: Mapping[str, Any]) -> dict[str, Any]:
    """Return interval, instant and time of the first value of a waveform, from its properties in TDMS."""
    start = said.get("wf_start_time")
    try:
        at = pd.Timestamp(start.decode() if isinstance(start, bytes) else start) if start is not None else pd.NaT
    except (ValueError, TypeError):
        at = pd.NaT
    return {
        "step": _number(said.get("wf_increment")),
        "start": 0 if pd.isna(at) else max(at.value, 0),  # 1904 if it was not set
        "offset": _number(said.get("wf_start_offset")),
    }


def _number(said: object) -> float:
    """Return a property as a number; 0 if it is none."""
    number = float(said) if isinstance(said, int | float | np.number) else 0.0
    return number if 0 < number < np.inf else 0.0


def find_unit_text(said: object) -> str:
    """Return a unit from a property of a file: text without brackets."""
    text = said.decode("utf-8", "replace") if isinstance(said, bytes) else said
    found = BRACKETS.fullmatch(f"x {text}") if isinstance(text, str) else None
    return (found["square"] or found["round"] or "") if found else text.strip() if isinstance(text, str) else ""
