"""Temporary working folders; those left by a killed run are removed by the next run.

Each folder has a file that the run locks for its lifetime, and the system releases the lock however the run ends: if
the lock can be acquired, the run has ended and the folder is removed.
"""

import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import gettempdir
from uuid import uuid4

_PREFIX = ".thermocomp-"
_NAME = re.compile(re.escape(_PREFIX) + "[0-9a-f]{32}")
_LOCK = "lock"


@contextmanager
def scratch(folder: Path | None = None) -> Iterator[Path]:
    """Provide a new folder inside another one; it is removed at the end.

    Folders left in `folder` by killed runs are removed as well, those of active runs are not.

    Parameters
    ----------
    folder : Path, optional
        Destination of the files that will be moved out: on the same disk, a move is atomic. Default: the
        system's folder for temporary files.
    """
    folder = folder or Path(gettempdir())
    _clear(folder)
    path, lock = _made(folder)
    try:
        yield path
    finally:
        _remove(path, lock)


def is_scratch(name: str) -> bool:
    """Return whether a folder name is that of a temporary working folder."""
    return _NAME.fullmatch(name) is not None


def _made(folder: Path) -> tuple[Path, int]:
    """Return a new temporary folder and its open lock file."""
    while True:
        path = folder / f"{_PREFIX}{uuid4().hex}"
        path.mkdir(0o700)
        try:
            lock = os.open(path / _LOCK, os.O_RDWR | os.O_CREAT, 0o666)
        except FileNotFoundError:  # another run removed it before it was locked
            continue
        except OSError:  # a full disk
            path.rmdir()
            raise
        if _locked(lock) and not (path / _LOCK).exists():  # removed just after it was created
            os.close(lock)
            continue
        return path, lock


def _locked(lock: int, *, wait: bool = True) -> bool:
    """Lock a file; return False where this is impossible: then no folder of another run is removed either."""
    try:
        import fcntl  # not on Windows

        fcntl.flock(lock, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except (ImportError, OSError):  # locked by another run, or locks are not supported
        return False
    return True


def _clear(folder: Path) -> None:
    """Remove the temporary folders of runs that have ended without removing them."""
    found: list[Path] = []
    with suppress(OSError):
        found = [p for p in folder.iterdir() if is_scratch(p.name)]
    for path in found:
        try:
            lock = os.open(path / _LOCK, os.O_RDWR)
        except FileNotFoundError:
            with suppress(OSError):
                path.rmdir()  # killed before it had a lock file: the folder is empty
            continue
        except OSError:
            continue
        if _locked(lock, wait=False):
            _remove(path, lock)
        else:
            os.close(lock)


def _remove(path: Path, lock: int) -> None:
    """Remove a folder, its lock file last: a folder without a lock file is empty, even after a kill at any point.

    The lock is held until its file is deleted, so that a run waiting for it, having just created the folder, notices.
    """
    closed = os.name != "posix"  # Windows cannot delete an open file, and has no such locks
    if closed:
        os.close(lock)
    with suppress(OSError):
        for inside in path.iterdir():
            if inside.is_dir() and not inside.is_symlink():
                shutil.rmtree(inside, ignore_errors=True)
            elif inside.name != _LOCK:
                inside.unlink()
    with suppress(OSError):
        if [p.name for p in path.iterdir()] == [_LOCK]:
            (path / _LOCK).unlink()
            path.rmdir()
    if not closed:
        os.close(lock)
