"""Text files whose header labels its rows: LabVIEW measurement files, exports of TwinCAT Scope.

The header states one property in each row, such as ``Y_Unit_Label`` or ``SampleTime[ms]``, with one cell per column
below. Columns may have their own times; further headers start further segments.
"""

import re
from dataclasses import dataclass, field
from io import BytesIO
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd

from thermocomp.core.arrays import FloatArray
from thermocomp.core.exceptions import RecordingError
from thermocomp.core.messages import Message, join
from thermocomp.recordings.readers.encodings import bring_to_utf8, find_encoding
from thermocomp.recordings.readers.limits import FileLimits
from thermocomp.recordings.readers.mapping import ReadOptions
from thermocomp.recordings.readers.numbers import is_number_like
from thermocomp.recordings.readers.series import TimeScale, TimeSeries, join_series, seconds_to_ns
from thermocomp.recordings.readers.tables import FileTable, FrameTable
from thermocomp.recordings.readers.textfile import open_csv
from thermocomp.recordings.readers.textlines import Lines, is_utf8, open_lines, split_line
from thermocomp.recordings.readers.timefaults import refuse_tests

_SIGN = re.compile(rb"(?:\xef\xbb\xbf)?\"?(?:Writer_Version|Starttime of export|SampleTime\[ms\])\"?([\t;,])")
#: number of lines in which the kind of file is recognised, and of bytes of each
_FIRST, _LONGEST = 30, 4096
#: rows whose labels stand above the times, and whose other cells name the columns
_NAMES = ("X_Value", "Name")
_UNITS = ("Y_Unit_Label", "Unit")
#: remarks within a LabVIEW file
_SPECIAL = ("***Start_Special***", "***End_Special***")
#: larger numbers are not times, whatever the clock
_FARTHEST = 1e18
#: 1970 in the clock of Windows, which counts 100 ns from 1601
_WINDOWS = 116_444_736_000_000_000


@dataclass
class _Segment:
    """A header and the rows below it."""

    header: dict[str, list[str]]
    rows: list[list[str]] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)  #: 1-based

    def cell(self, key: str, column: int) -> str:
        """Return the cell of a header row for a column; the first one if it has none."""
        cells = self.header.get(key, [""])[1:]
        own = cells[column - 1].strip() if 0 < column <= len(cells) else ""
        return own or next((cell.strip() for cell in cells if cell.strip()), "")

    def numbers(self, column: int) -> FloatArray:
        """Return the numbers of a column; NaN where a row has none."""
        texts = pd.Series([row[column].replace(",", ".") if column < len(row) else "" for row in self.rows])
        return pd.to_numeric(texts, errors="coerce").to_numpy(dtype=np.float64)


def open_text(path: Path, options: ReadOptions, limits: FileLimits) -> FileTable:
    """Open a text file: with a labelled header as a table with one time, else as `open_csv` does."""
    data, _ = bring_to_utf8(path, limits)
    with path.open("rb") if data is None else BytesIO(data) as f:
        signs = (_SIGN.match(f.readline(_LONGEST)) for _ in range(_FIRST))
        delimiter = next((match[1].decode() for match in signs if match), "")
    try:
        found = _open(open_lines(path, data, options, limits), delimiter) if delimiter else None
    except (ValueError, OverflowError) as e:  # damaged numbers and dates of the header
        raise RecordingError(f"{path}: the header is damaged ({e}); export the file again") from e
    return open_csv(path, options, limits) if found is None else found


def _open(lines: Lines, delimiter: str) -> FrameTable | None:
    path, limits = lines.path, lines.limits
    content = list(lines.content([]))
    limits.check("recoded_bytes", sum(len(line) for _, line in content), path)
    odd = [line for _, line in content if not is_utf8(line)]
    encoding = lines.options.encoding or (find_encoding(odd) if odd else "utf-8")
    segments = _split([(n + 1, split_line(line.decode(encoding, "replace"), delimiter)) for n, line in content])
    if not segments:
        return None
    found: dict[str, list[TimeSeries]] = {}
    for segment in segments:
        for series in (s for s in _read(segment, path) if s.times.size):
            found.setdefault(series.heading, []).append(series)
    parts = list(found.values())
    _refuse_restart(segments, parts[0] if parts else [], path)
    joined = [
        TimeSeries(p[0].heading, np.concatenate([s.times for s in p]), np.concatenate([s.values for s in p]))
        for p in parts
    ]
    notes = [Message("the file has {n} segments", n=len(segments))] * (len(segments) > 1)
    scaled = [key for key in ("ScaleFactor", "Offset") for s in segments for k in s.header.get(key, [])[1:]
              if is_number_like(k) and float(k.replace(",", ".")) != (key == "ScaleFactor")]  # fmt: skip
    if scaled:
        notes.append(
            Message("{names} of the display are not applied", names=join([*dict.fromkeys(scaled)], Message(" and ")))
        )
    decimal = segments[0].cell("Decimal_Separator", 1)
    clock = TimeScale("timestamp", "UTC" if "Starttime of export" in segments[0].header else "naive")
    dated = clock.zone == "UTC" or bool(segments[0].cell("Date", 1))
    return join_series(path, joined, clock if dated else TimeScale(), limits, notes, decimal if decimal in ".," else "")


def _split(rows: list[tuple[int, list[str]]]) -> list[_Segment]:
    header: dict[str, list[str]] = {}
    segments: list[_Segment] = []
    begun = special = False
    for number, row in rows:
        label = row[0].strip()
        special = (special or label == _SPECIAL[0]) and label != _SPECIAL[1]
        first = next((cell for cell in row if cell.strip()), "")
        if special or not first or label == "EOF":
            continue
        if not is_number_like(first):
            begun = False
            header = {**header, label: row}
        elif any(key in header for key in _NAMES):
            if not begun:
                segments.append(_Segment(header))
                begun = True
            segments[-1].rows.append(row)
            segments[-1].lines.append(number)
    return segments


def _read(segment: _Segment, path: Path) -> list[TimeSeries]:
    key = next(key for key in _NAMES if key in segment.header)
    names = [cell.strip() for cell in segment.header[key]]
    if (kind := segment.cell("X_Dimension", 1)) not in ("", "Time"):
        raise RecordingError(f"{path}: the rows are {kind.lower()}s, not times; a recording has rows at rising times")
    times = [k for k, name in enumerate(names) if name == key]
    found: list[TimeSeries] = []
    for k, name in enumerate(names):
        if k in times or not name or (name == "Comment" and k == len(names) - 1):
            continue
        cells = np.array([row[k].strip() if k < len(row) else "" for row in segment.rows], dtype=object)
        time = _times(segment, max(t for t in times if t < k), k)
        good = np.isfinite(time) & (cells != "")
        unit = next((u for u in (_own(segment, u, k) for u in _UNITS) if u), "").strip("[]()")
        heading = f"{name} [{unit}]" if unit and unit != "None" else name
        if any(s.heading == heading for s in found):
            heading = f"{_own(segment, 'SymbolName', k) or k} {heading}"
        found.append(TimeSeries(heading, _begin(segment, k) + seconds_to_ns(time[good]), cells[good]))
    return found


def _own(segment: _Segment, key: str, column: int) -> str:
    cells = segment.header.get(key, [])
    return cells[column].strip() if column < len(cells) else ""


def _times(segment: _Segment, column: int, channel: int) -> FloatArray:
    """Return the times of a channel [s], from their column or from the first instant and the interval."""
    said = segment.numbers(column)
    said = np.where(np.abs(said) < _FARTHEST, said, np.nan)
    timed = bool(np.isfinite(said).any())
    if "SampleTime[ms]" in segment.header or "Starttime of export" in segment.header:
        if not timed:
            return said
        said = said - _WINDOWS if float(np.nanmax(said)) > _WINDOWS else said
        if float(np.nanmax(said)) > _WINDOWS / 1e4:  # 100 ns since 1970
            return np.asarray((said - _begin(segment, channel) / 100) * 1e-7, dtype=np.float64)
        every = segment.cell("SampleTime[ms]", channel).replace(",", ".")
        steps = np.diff(said[np.isfinite(said)])
        counted = is_number_like(every) and bool(steps.size) and float(np.median(steps)) == 1.0
        return np.asarray(said * (float(every) if counted else 1.0) * 1e-3, dtype=np.float64)
    if timed:
        return said
    start, step = (segment.cell(key, channel).replace(",", ".") for key in ("X0", "Delta_X"))
    return np.asarray(float(start or 0) + float(step or np.nan) * np.arange(len(said)), dtype=np.float64)


def _begin(segment: _Segment, column: int) -> int:
    """Return the instant from which the times of a channel are counted [ns]."""
    if windows := segment.cell("Starttime of export", 1):
        return (int(windows) - _WINDOWS) * 100
    day = segment.cell("Date", column).replace("/", "-")
    clock = re.sub(r"([.,]\d{9})\d+$", r"\1", segment.cell("Time", column)).replace(",", ".")
    return pd.Timestamp(f"{day} {clock}".strip()).value if day else 0


def _refuse_restart(segments: list[_Segment], parts: list[TimeSeries], path: Path) -> None:
    """Reject segments whose times start again: they are separate tests."""
    if any(a.times[-1] >= b.times[0] for a, b in pairwise(parts)):
        refuse_tests(str(path), [[s.lines[0], s.lines[-1]] for s in segments])
