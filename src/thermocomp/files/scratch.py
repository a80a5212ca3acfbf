"""Folders for work in progress; what a killed run leaves of them the next run clears away.

The system holds a lock on each for as long as the run lives that has made it, however that ends: whoever can lock one
knows that its run is dead, and removes it.
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
    """Give a new folder in another one; it is removed at the end.

    What killed runs have left in `folder` is removed too, what living ones use is not.

    Parameters
    ----------
    folder : Path, optional
        Where files will go that are moved out of it: that is one step, as both are on one disk. The system's folder for
        temporary files if not given.

    Yields
    ------
    Path
        Path of a folder that contains only its lock.
    """
    folder = folder or Path(gettempdir())
    _clear(folder)
    path, lock = _made(folder)
    try:
        yield path
    finally:
        _remove(path, lock)


def is_scratch(name: str) -> bool:
    """Return whether a folder of that name is one of these."""
    return _NAME.fullmatch(name) is not None


def _made(folder: Path) -> tuple[Path, int]:
    """Return a new folder, and its lock."""
    while True:
        path = folder / f"{_PREFIX}{uuid4().hex}"
        path.mkdir(0o700)
        try:
            lock = os.open(path / _LOCK, os.O_RDWR | os.O_CREAT, 0o666)
        except FileNotFoundError:  # taken for a dead one before it had its lock
            continue
        except OSError:  # a full disk
            path.rmdir()
            raise
        if _locked(lock) and not (path / _LOCK).exists():  # or just after
            os.close(lock)
            continue
        return path, lock


def _locked(lock: int, *, wait: bool = True) -> bool:
    """Lock a file; return False where that cannot be: then nothing of others is removed either."""
    try:
        import fcntl  # not on Windows

        fcntl.flock(lock, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except (ImportError, OSError):  # or somebody has it, or the disk knows no locks
        return False
    return True


def _clear(folder: Path) -> None:
    """Remove the folders of dead runs."""
    found: list[Path] = []
    with suppress(OSError):
        found = [p for p in folder.iterdir() if is_scratch(p.name)]
    for path in found:
        try:
            lock = os.open(path / _LOCK, os.O_RDWR)
        except FileNotFoundError:
            with suppress(OSError):
                path.rmdir()  # killed before it had a lock: there is nothing in it
            continue
        except OSError:
            continue
        if _locked(lock, wait=False):
            _remove(path, lock)
        else:
            os.close(lock)


def _remove(path: Path, lock: int) -> None:
    """Remove a folder, its lock last: one without a lock is empty, wherever this is killed.

    The lock is held until its file is gone: who waits for it, having just made the folder, then sees that.
    """
    closed = os.name != "posix"  # Windows removes no file that is open, and knows no such locks
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
