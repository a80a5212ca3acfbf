"""Write beside and move: a crash never leaves half a file where a whole one was, and what it leaves is cleared away.

Drafts stand in hidden folders beside their targets. The system holds a lock on each for as long as the run lives that
has made it, however that ends: whoever can lock one knows that its run is dead, and removes it.
"""

import os
import re
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from uuid import uuid4

from thermocomp.core.exceptions import InputError

_PREFIX = ".thermocomp-"
_NAME = re.compile(re.escape(_PREFIX) + "[0-9a-f]{32}")
_LOCK = "lock"


@contextmanager
def scratch(folder: Path) -> Iterator[Path]:
    """Give a new folder for drafts in another one; it is removed at the end.

    What killed runs have left in `folder` is removed too, what living ones use is not.

    Parameters
    ----------
    folder : Path
        Where the files will go: moving a draft there is one step, as both are on one disk.

    Yields
    ------
    Path
        Of a folder that holds nothing but its lock.
    """
    _clear(folder)
    path, lock = _made(folder)
    try:
        yield path
    finally:
        shutil.rmtree(path, ignore_errors=True)
        os.close(lock)


@contextmanager
def draft(target: Path) -> Iterator[Path]:
    """Give the path of a draft of `target`; it becomes `target` if the block ends well.

    Not by the standard library's temporary files: nobody but their owner may read those.

    Parameters
    ----------
    target : Path
        A file of that name is replaced.

    Yields
    ------
    Path
        Of a file that does not exist yet.
    """
    with scratch(target.parent) as folder:
        path = folder / "draft"
        yield path
        path.replace(target)


def refuse_existing(paths: Sequence[Path], overwrite: bool, inputs: Sequence[Path] = (), ending: str = "") -> None:
    """Raise `InputError` if an output cannot be written, before any work is done.

    Parameters
    ----------
    paths : sequence of Path
        To be written.
    overwrite : bool
        Existing files may be replaced.
    inputs : sequence of Path
        What is read: never to be replaced.
    ending : str
        Of the names of such files, such as ``.html``.
    """
    for path in paths:
        if not path.parent.is_dir():
            raise InputError(f"{path}: there is no folder {path.parent}; make it first")
        if path.is_dir():
            raise InputError(f"{path}: is a folder; name a file")
        if any(path.exists() and other.exists() and path.samefile(other) for other in inputs):
            raise InputError(f"{path}: is also an input; choose another name")
        if path.exists() and not overwrite:
            raise InputError(f"{path}: exists already; choose another name or allow overwriting with --overwrite")
        if ending and path.suffix.lower() != ending:
            raise InputError(f"{path}: the file is written as {ending[1:]}; name it {path.with_suffix(ending)}")


def publish(drafts: Mapping[Path, Path], *, overwrite: bool) -> None:
    """Move drafts to where they belong, the last one last: all of them, or none.

    Parameters
    ----------
    drafts : mapping of Path to Path
        Drafts by target.
    overwrite : bool
        Files of these names are replaced.

    Raises
    ------
    InputError
        A file of such a name has come into being since somebody looked.
    """
    done: list[Path] = []
    try:
        for target, path in drafts.items():
            if overwrite:
                path.replace(target)
            else:
                _link(path, target)
                done.append(target)
    except FileExistsError as e:
        for target in done:
            target.unlink()
        raise InputError(f"{target}: has come into being meanwhile; nothing was written: use --overwrite") from e


def _link(path: Path, target: Path) -> None:
    """Let a file have another name, unless there is one."""
    try:
        target.hardlink_to(path)
    except FileExistsError:
        raise
    except OSError:  # a disk without links
        with path.open("rb") as source, target.open("xb") as copy:
            shutil.copyfileobj(source, copy)


def _made(folder: Path) -> tuple[Path, int]:
    """Return a new folder, and its lock."""
    while True:
        path = folder / f"{_PREFIX}{uuid4().hex}"
        path.mkdir()
        try:
            lock = os.open(path / _LOCK, os.O_RDWR | os.O_CREAT, 0o666)
        except FileNotFoundError:  # taken for a dead one before it had its lock
            continue
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
        found = [p for p in folder.iterdir() if _NAME.fullmatch(p.name)]
    for path in found:
        try:
            lock = os.open(path / _LOCK, os.O_RDWR)
        except FileNotFoundError:
            with suppress(OSError):
                path.rmdir()  # killed before it had a lock: there is nothing in it
            continue
        except OSError:
            continue
        try:
            if _locked(lock, wait=False):
                shutil.rmtree(path, ignore_errors=True)
        finally:
            os.close(lock)
