"""Reading of a journal: the rows of all its files, each row verified."""

import math
import re
import sqlite3
import zlib
from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from contextlib import ExitStack, closing, contextmanager
from heapq import merge
from pathlib import Path
from typing import Any, NamedTuple

from thermocomp.core.exceptions import InputError
from thermocomp.live.journal.journalrows import KINDS, ReadingRow, Row, StartRow, loads

#: application id ``tcJl``, and version of the tables
APPLICATION, VERSION = 0x74634A6C, 1
SCHEMA = """
CREATE TABLE rows (
  id INTEGER PRIMARY KEY,   -- in the order in which they were written
  run INTEGER NOT NULL,     -- of the service, drawn by lot
  seq INTEGER NOT NULL,     -- in this run, from 1; 0: its start, which each file repeats
  time REAL NOT NULL,       -- s since 1970
  kind TEXT NOT NULL,
  content TEXT NOT NULL,    -- JSON
  crc INTEGER NOT NULL,     -- of all these
  UNIQUE (run, seq)
)
"""
#: kinds of rows that are not written with every reading
EVENTS = ("state", "reference", "measurement", "alarm", "update")
#: a row earlier by more than this than one written before it indicates that a clock was set back [s]
SET_BACK = 5.0
_ROWS = "SELECT run, seq, time, kind, content, crc FROM rows"


class StoredRun(NamedTuple):
    """A row of the journal, with the number of its run of the service and its sequence number."""

    run: int
    seq: int
    row: Row


class Summary(NamedTuple):
    """Summary of a journal: period, numbers of rows by kind, and missing rows."""

    files: tuple[Path, ...]
    size_bytes: int
    first: float | None  #: [s] since 1970; None: there are no rows
    last: float | None
    counts: dict[str, int]  #: number of rows by kind
    lost: int  #: number of rows missing within their runs


class JournalReader:
    """A journal opened for reading, also while a service writes to it.

    Parameters
    ----------
    path : str or Path
        Path given to the service, to read all files of the journal; or one of these files.

    Raises
    ------
    InputError
        Journal missing, or a file is not a journal, damaged, or of a newer version.
    """

    def __init__(self, path: str | Path) -> None:
        given = Path(path)
        self.paths = tuple(numbered(given).values()) or ((given,) if given.is_file() else ())
        if not self.paths:
            raise InputError(f"{given}: there is no journal of that name; name the one in the service's configuration")
        self.starts: dict[int, StartRow] = {}  #: start row by run
        for file, stored in self._each(f"{_ROWS} WHERE kind = 'start'"):
            start = self._row(file, *stored).row
            assert isinstance(start, StartRow)
            self.starts[stored[0]] = start

    def rows(self, kinds: Collection[str] = tuple(KINDS)) -> Iterator[StoredRun]:
        """Return the rows of the given kinds in order of time; the start row of each run once."""
        marks = ",".join("?" * len(kinds))
        query = f"{_ROWS} WHERE kind IN ({marks}) ORDER BY time, id"
        begun = set()
        with ExitStack() as stack:
            parts = [self._read(stack, path, query, tuple(kinds)) for path in self.paths]
            for stored in merge(*parts, key=lambda s: s.row.time):
                if stored.seq or stored.run not in begun:
                    begun |= {stored.run} if not stored.seq else set()
                    yield stored

    def readings(self, since: float, interval: Callable[[float], float]) -> list[ReadingRow]:
        """Return the readings since a time in order of time, at most one per interval, and the last one.

        Parameters
        ----------
        interval : callable
            Returns the minimum interval after a reading at a given time [s].

        Raises
        ------
        InputError
            Since that time, the clock was set back: the order of the readings is known, but not the time between them.
        """
        kept, last = list[tuple[Path, Any]](), None
        for path, found in self._each(f"{_ROWS} WHERE kind = 'reading' AND time >= {since!r} ORDER BY id"):
            if last is not None and found[2] < last[1][2] - SET_BACK:
                raise InputError(f"{path}: the clock was set back at row {found[1]} of run {found[0]}")
            if not kept or found[2] - kept[-1][1][2] >= interval(kept[-1][1][2]):
                kept.append((path, found))
            last = path, found
        if last is not None and last[1][2] > kept[-1][1][2]:
            kept.append(last)
        rows = [self._row(path, *found).row for path, found in kept]
        return [row for row in rows if isinstance(row, ReadingRow)]

    def overtaken(self) -> Callable[[StoredRun], bool]:
        """Return a predicate for rows whose times occur again in later rows, because a clock was set back.

        Only the later rows are then valid; the earlier ones must not be mixed with them.
        """
        begins: list[tuple[int, int, float]] = []  # run, row and time at which the clock went back
        last = -math.inf
        for _, (run, seq, time) in self._each("SELECT run, seq, time FROM rows WHERE seq > 0 ORDER BY id"):
            if time < last - SET_BACK:
                begins.append((run, seq, time))
                last = time
            last = max(last, time)
        if not begins:
            return lambda _: False
        order = {run: k for k, run in enumerate(self.starts)}
        places = [(order[run], seq) for run, seq, _ in begins]
        firsts = [min(time for *_, time in begins[k:]) for k in range(len(begins))]

        def told(stored: StoredRun) -> bool:
            k = bisect_right(places, (order[stored.run], stored.seq))
            return k < len(firsts) and stored.row.time >= firsts[k]

        return told

    def latest(self, n: int, kinds: Collection[str] = EVENTS) -> list[StoredRun]:
        """Return the most recently written rows of the given kinds, oldest first."""
        marks = ",".join("?" * len(kinds))
        query = f"{_ROWS} WHERE kind IN ({marks}) ORDER BY id DESC LIMIT ?"
        found: list[StoredRun] = []
        with ExitStack() as stack:
            for path in reversed(self.paths):
                found += self._read(stack, path, query, (*kinds, n - len(found)))
        return found[::-1]

    def summary(self) -> Summary:
        """Return a summary of the journal."""
        counts: Counter[str] = Counter(dict.fromkeys(KINDS, 0))
        for _, (kind, n) in self._each("SELECT kind, COUNT(*) FROM rows WHERE seq > 0 GROUP BY kind"):
            counts[kind] += n
        counts["start"] = len(self.starts)
        runs: dict[int, list[int]] = {}
        for _, (run, low, high, n) in self._each(
            "SELECT run, MIN(seq), MAX(seq), COUNT(*) FROM rows WHERE seq > 0 GROUP BY run"
        ):
            before = runs.setdefault(run, [low, high, 0])
            runs[run] = [min(before[0], low), max(before[1], high), before[2] + n]
        ends = [e for _, e in self._each("SELECT MIN(time), MAX(time) FROM rows") if e[0] is not None]
        return Summary(
            files=self.paths,
            size_bytes=sum(size(p) for p in self.paths),
            first=min((e[0] for e in ends), default=None),
            last=max((e[1] for e in ends), default=None),
            counts=dict(counts),
            lost=sum(high - low + 1 - n for low, high, n in runs.values()),
        )

    def _each(self, query: str) -> Iterator[tuple[Path, Any]]:
        for path in self.paths:
            with reading(path) as connection:
                for found in connection.execute(query) if connection else ():
                    yield path, found

    def _read(self, stack: ExitStack, path: Path, query: str, values: tuple[object, ...]) -> Iterator[StoredRun]:
        connection = stack.enter_context(reading(path))
        with telling(path):
            for found in connection.execute(query, values) if connection else ():
                yield self._row(path, *found)

    def _row(self, path: Path, run: int, seq: int, time: float, kind: str, text: str, crc: int) -> StoredRun:
        where = f"{path}: row {seq} of run {run}"
        if crc != checksum(run, seq, time, kind, text):
            raise InputError(f"{where} is damaged; set the file aside, {_OTHERS}")
        try:
            return StoredRun(run, seq, loads(kind, time, text, self.starts.get(run)))
        except (ValueError, TypeError, InputError) as e:
            raise InputError(f"{where} cannot be interpreted: {e}") from e


_OTHERS = "and read the other files"


# -- files -------------------------------------------------------------------------------------------------------------


def numbered(path: Path) -> dict[int, Path]:
    """Return the files of a journal by number, oldest first: ``live.db`` is ``live.000001.db`` ..."""
    pattern = re.compile(rf"{re.escape(path.stem)}\.(\d{{6,}}){re.escape(path.suffix)}")
    names = {p: pattern.fullmatch(p.name) for p in (path.parent.iterdir() if path.parent.is_dir() else ())}
    return dict(sorted((int(m[1]), p) for p, m in names.items() if m and p.is_file()))


def size(path: Path) -> int:
    """Return the size of a journal file including its write-ahead log [bytes]."""
    beside = (path, path.with_name(f"{path.name}-wal"))
    return sum(p.stat().st_size for p in beside if p.exists())


def checksum(run: int, seq: int, time: float, kind: str, text: str) -> int:
    """Return the checksum (CRC-32) of a row of the journal."""
    # SQLite does not store -0.0
    return zlib.crc32(f"{run} {seq} {time + 0.0!r} {kind} {text}".encode())


def find_version(connection: sqlite3.Connection) -> int | None:
    """Return the version of a journal; 0: empty database; None: another application's database."""
    (application,) = connection.execute("PRAGMA application_id").fetchone()
    (version,) = connection.execute("PRAGMA user_version").fetchone()
    if application == APPLICATION:
        return int(version)
    (tables,) = connection.execute("SELECT COUNT(*) FROM sqlite_master").fetchone()
    return None if application or version or tables else 0


@contextmanager
def telling(path: Path) -> Iterator[None]:
    """Convert an SQLite error into an error that names the file."""
    try:
        yield
    except sqlite3.Error as e:
        code = getattr(e, "sqlite_errorcode", 0) & 0xFF
        if code == sqlite3.SQLITE_NOTADB:
            raise InputError(f"{path}: this is not a journal of thermocomp, and not a database") from e
        if code == sqlite3.SQLITE_CANTOPEN:
            hint = (
                "check that you may read it; otherwise copy it, with all files whose names begin alike, to a writable "
                "folder"
            )
            raise InputError(f"{path}: the file cannot be opened; {hint}") from e
        raise InputError(f"{path}: the file cannot be read ({e}); set the file aside, {_OTHERS}") from e


@contextmanager
def reading(path: Path) -> Iterator[sqlite3.Connection | None]:
    """Open a journal file for reading; None if it was removed meanwhile, or is still empty."""
    # without permission to create files next to it, SQLite reads a file without a writer only as immutable
    how = "mode=ro" if path.with_name(f"{path.name}-wal").exists() else "mode=ro&immutable=1"
    if not path.exists():
        yield None
        return
    with telling(path), closing(sqlite3.connect(f"{path.resolve().as_uri()}?{how}", uri=True)) as connection:
        version = find_version(connection)
        if version is None:
            raise InputError(f"{path}: this is not a journal of thermocomp but another database")
        if version > VERSION:
            raise InputError(
                f"{path}: a journal of version {version}, but this thermocomp supports {VERSION}: read it with a "
                "newer thermocomp"
            )
        yield connection if version else None
