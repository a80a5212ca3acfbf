"""Journal of a live compensator: readings, demands and corrections in force, resistant to kills and full disks.

Rows wait in memory until `Journal.flush` writes them to the disk in one transaction; then they are confirmed. Disk
faults raise no exception: rows wait while there is memory for them, and lost rows are counted.
"""

import os
import re
import sqlite3
import threading
from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, Self

from thermocomp.core.exceptions import InputError, SettingError
from thermocomp.live.journal.journalreader import APPLICATION, SCHEMA, VERSION, checksum, find_version, numbered, size
from thermocomp.live.journal.journalrows import Row, StartRow, dumps, kind_of

#: SQLite error codes of a file that is damaged or not a database
_DAMAGED = {sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB}
#: memory of a waiting row in addition to its text [bytes]
_OVERHEAD = 200
_INSERT = "INSERT OR IGNORE INTO rows (run, seq, time, kind, content, crc) VALUES (?, ?, ?, ?, ?, ?)"


@dataclass(frozen=True)
class JournalLimits:
    """Limits of the size of a journal.

    Parameters
    ----------
    size_bytes : int
        Size above which a new file is started.
    files : int
        Maximum number of files; the oldest is removed.
    waiting_bytes : int
        Memory for rows waiting for the disk; beyond it the oldest rows are dropped.
    """

    size_bytes: int = 64 * 2**20
    files: int = 8
    waiting_bytes: int = 8 * 2**20

    def __post_init__(self) -> None:
        for name, least in (("size_bytes", 2**16), ("files", 2), ("waiting_bytes", 2**10)):
            if not getattr(self, name) >= least:
                raise SettingError(f"journal {name} = {getattr(self, name)}: expected at least {least}")


class JournalStatus(NamedTuple):
    """Status of a journal: its files, and the rows written, waiting and lost."""

    file: Path | None  #: file being written; None: none at present
    files: int
    size_bytes: int  #: total size of all files
    confirmed: int  #: number of rows of this run on the disk
    waiting: int  #: number of rows not yet on the disk
    lost: int  #: number of rows dropped for lack of memory
    refused: int  #: number of invalid rows
    reason: str  #: reason why rows wait or were refused; empty if there is none


class Journal:
    """A journal opened for writing: see `open`."""

    def __init__(self, path: Path, limits: JournalLimits, start: StartRow) -> None:
        self.path, self.limits = path, limits
        self._run = int.from_bytes(os.urandom(7))
        try:
            self._start = dumps(start, start)
        except (ValueError, InputError) as e:
            raise InputError(f"{path}: the journal cannot be started: {e}") from e
        self._described, self._begun = start, start.time
        self._waiting: deque[tuple[int, float, str, str]] = deque()
        self._bytes = self._seq = self._confirmed = self._lost = self._refused = 0
        self._odd = self._trouble = ""
        self._connection: sqlite3.Connection | None = None
        self._file: Path | None = None
        self._sound: Path | None = None  #: file that has been checked already
        self._adding, self._writing = threading.Lock(), threading.Lock()

    @classmethod
    def open(cls, path: str | Path, limits: JournalLimits, start: StartRow) -> Self:
        """Open a journal, existing or new; disk faults are reported by `status`.

        A damaged file, or one that is not a journal, is renamed to ``.refused``; one of a newer version is left
        unchanged.
        """
        journal = cls(Path(path), limits, start)
        journal.flush()
        return journal

    def add(self, row: Row) -> None:
        """Queue a row for the next `flush`; an invalid row is counted; no exception is raised."""
        try:
            kind, text, time = kind_of(row), dumps(row, self._described), float(row.time)
        except Exception as e:  # noqa: BLE001 - whatever the row, the service continues
            self._refused += 1
            self._odd = f"{type(row).__name__} refused: {e}"
            return
        with self._adding:
            self._seq += 1
            self._waiting.append((self._seq, time, kind, text))
            self._bytes += len(text) + _OVERHEAD
            self._shed()

    def flush(self) -> bool:
        """Write all waiting rows to the disk in one transaction; call it from a single thread."""
        with self._writing:
            with self._adding:
                batch, self._waiting, self._bytes = self._waiting, deque(), 0
            try:
                self._insert(batch)
                self._confirmed += len(batch)
                self._trouble = ""
            except (sqlite3.Error, OSError) as e:
                self._fail(e)
                with self._adding:
                    self._waiting.extendleft(reversed(batch))
                    self._bytes = sum(len(w[3]) + _OVERHEAD for w in self._waiting)
                    self._shed()
                return False
            try:
                self._rotate_if_full()
            except (sqlite3.Error, OSError) as e:
                self._fail(e)
            return True

    def status(self) -> JournalStatus:
        """Return the status of the journal; never raises."""
        files: list[Path] = []
        total = 0
        with suppress(OSError):
            files = list(numbered(self.path).values())
            total = sum(size(p) for p in files)
        with self._adding:
            waiting = len(self._waiting)
        reason = self._trouble or self._odd
        return JournalStatus(
            file=self._file,
            files=len(files),
            size_bytes=total,
            confirmed=self._confirmed,
            waiting=waiting,
            lost=self._lost,
            refused=self._refused,
            reason=reason,
        )

    def close(self) -> None:
        """Flush the journal and close its file; idempotent."""
        if self._connection is not None or self._waiting:
            self.flush()
        with self._writing:
            self._disconnect()

    # -- inside --------------------------------------------------------------------------------------------------------

    def _shed(self) -> None:
        while self._bytes > self.limits.waiting_bytes:
            self._bytes -= len(self._waiting.popleft()[3]) + _OVERHEAD
            self._lost += 1

    def _insert(self, batch: deque[tuple[int, float, str, str]]) -> None:
        if self._file is not None and not self._file.exists():
            self._odd = f"{self._file.name} was removed: a new file is started"
            self._disconnect()
        connection = self._connection or self._connect()
        if not batch:
            return
        connection.execute("BEGIN IMMEDIATE")
        connection.executemany(_INSERT, ((self._run, *row, checksum(self._run, *row)) for row in batch))
        connection.execute("COMMIT")

    def _connect(self) -> sqlite3.Connection:
        """Continue with the newest file, or create one."""
        files = numbered(self.path)
        newest = files[max(files)] if files else None
        if newest is not None:
            found = self._attach(newest)
            if found is not None:
                return found
        found = self._attach(self._next())
        if found is None:
            raise sqlite3.OperationalError("the new journal file cannot be used")
        return found

    def _attach(self, path: Path) -> sqlite3.Connection | None:
        """Return the connection to a file to be continued; None if it is of a newer version, or was set aside."""
        if not path.exists():  # only its owner may read it; SQLite gives its other files the same permissions
            os.close(os.open(path, os.O_CREAT | os.O_RDWR, 0o600))
        connection = sqlite3.connect(path, timeout=0.2, isolation_level=None, check_same_thread=False)
        try:
            version = find_version(connection)
            if version is not None and version > VERSION:
                connection.close()
                self._odd = (
                    f"{path.name} is a journal of version {version}: it is left unchanged, and a new file is started"
                )
                return None
            if version is None or (path != self._sound and not _is_sound(connection)):
                raise _Damaged
            pages = max(16, min(1000, self.limits.size_bytes // 2**15))
            for pragma in ("journal_mode = WAL", "synchronous = FULL", f"wal_autocheckpoint = {pages}"):
                connection.execute(f"PRAGMA {pragma}").fetchall()
            connection.execute("BEGIN IMMEDIATE")
            if version == 0:
                connection.execute(SCHEMA)
                connection.execute(f"PRAGMA application_id = {APPLICATION}")
                connection.execute(f"PRAGMA user_version = {VERSION}")
            first = (0, self._begun, "start", self._start)
            connection.execute(_INSERT, (self._run, *first, checksum(self._run, *first)))
            connection.execute("COMMIT")
        except sqlite3.Error as e:
            connection.close()
            if not _is_damage(e):
                raise
            self._set_aside(path)
            return None
        self._connection, self._file, self._sound = connection, path, path
        return connection

    def _next(self) -> Path:
        """Return a file name that has not been used before."""
        pattern = re.compile(rf"{re.escape(self.path.stem)}\.(\d{{6,}}){re.escape(self.path.suffix)}")
        taken = [int(m[1]) for p in self.path.parent.iterdir() if (m := pattern.match(p.name))]
        return self.path.with_name(f"{self.path.stem}.{max(taken, default=0) + 1:06d}{self.path.suffix}")

    def _rotate_if_full(self) -> None:
        assert self._connection is not None
        (pages,), (page,) = (self._connection.execute(f"PRAGMA page_{k}").fetchone() for k in ("count", "size"))
        if pages * page <= self.limits.size_bytes:
            return
        self._connection.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchall()
        self._disconnect()
        files = list(numbered(self.path).values())
        for old in files[: max(0, len(files) + 1 - self.limits.files)]:
            for part in (old, *(old.with_name(f"{old.name}-{end}") for end in ("wal", "shm"))):
                part.unlink(missing_ok=True)
        self._attach(self._next())

    def _fail(self, error: Exception) -> None:
        where = self._file or self.path
        self._disconnect()
        self._trouble = f"{where.name}: {error}"
        if _is_damage(error):
            with suppress(OSError):
                self._set_aside(where)

    def _set_aside(self, path: Path) -> None:
        """Rename a damaged file and its companion files."""
        refused = path.with_name(f"{path.name}.refused")
        self._odd = f"{path.name} is damaged or not a journal: it is kept as {refused.name}, and a new file is started"
        for end in ("", "-wal"):
            with suppress(FileNotFoundError):
                path.with_name(f"{path.name}{end}").replace(refused.with_name(f"{refused.name}{end}"))
        path.with_name(f"{path.name}-shm").unlink(missing_ok=True)

    def _disconnect(self) -> None:
        connection, self._connection, self._file = self._connection, None, None
        if connection is not None:
            with suppress(sqlite3.Error):
                connection.close()


class _Damaged(sqlite3.DatabaseError):
    """Error for a file that is a database, but not a valid journal."""


def _is_damage(error: Exception) -> bool:
    return isinstance(error, _Damaged) or getattr(error, "sqlite_errorcode", 0) & 0xFF in _DAMAGED


def _is_sound(connection: sqlite3.Connection) -> bool:
    return bool(connection.execute("PRAGMA quick_check(1)").fetchone() == ("ok",))
