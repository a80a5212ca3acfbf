"""A file that one process at a time may use."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from thermocomp.core.exceptions import InputError


@contextmanager
def alone(path: Path) -> Iterator[None]:
    """Hold a lock on an empty file next to a file: the system releases it when the process ends, however it does.

    Parameters
    ----------
    path : Path
        Its folder has to exist.

    Raises
    ------
    InputError
        Another process holds it, or there is no writing there.
    """
    beside = path.with_name(f"{path.name}.lock")
    try:
        lock = os.open(beside, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError as e:
        raise InputError(f"{path}: cannot be used: {e}") from e
    try:
        try:
            import fcntl  # not on Windows

            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as e:
            raise InputError(
                f"{path}: another thermocomp process is using it; stop that process, or name another file"
            ) from e
        except (ImportError, OSError):  # the system, or the disk, knows no locks
            pass
        yield
    finally:
        os.close(lock)
