"""Exclusive use of a file by one process at a time."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from thermocomp.core.exceptions import InputError


@contextmanager
def alone(path: Path) -> Iterator[None]:
    """Hold a lock on an empty file next to `path`; the system releases it when the process ends, even after a crash."""
    beside = path.with_name(f"{path.name}.lock")
    try:
        lock = os.open(beside, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError as e:
        raise InputError(f"{path}: the file cannot be used: {e}") from e
    try:
        try:
            import fcntl  # not on Windows

            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as e:
            raise InputError(
                f"{path}: another thermocomp process is using it; stop that process, or name another file"
            ) from e
        except (ImportError, OSError):  # the operating system or the file system does not support locks
            pass
        yield
    finally:
        os.close(lock)
