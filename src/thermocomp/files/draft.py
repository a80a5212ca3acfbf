"""Safe writing of files: each file is written completely next to its target, flushed to disk, and renamed.

A failure or a killed run leaves the old file or the new one: never a partial file, and never none where one existed.

- A symbolic link is kept: its target is written, in the target's folder. The target of a dangling link is created if
  its folder exists; circular links, folders, pipes, devices and read-only files are rejected.
- The permissions of a replaced file are kept (and its owner, if the system allows it); a new file gets the default ones
  (umask). Other hard links to the file keep the old content.
- Drafts left by a killed run are removed by the next run that writes to the folder: see `thermocomp.files.scratch`.
"""

import errno
import os
import shutil
import stat
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from thermocomp.core.exceptions import InputError
from thermocomp.core.outputs import OTHERWISE, cannot_be_written, find_place
from thermocomp.files.scratch import is_scratch, scratch

#: errors of file systems that cannot flush folders
_NO_FLUSH = {errno.EINVAL, errno.ENOSYS, errno.ENOTSUP}


#: Windows does not replace a file that a program is reading just now: pauses between attempts [s]
HELD = () if os.name == "posix" else (0.01, 0.05, 0.2, 0.5, 1.0)


class Drafts(dict[Path, Path]):
    """Paths of drafts, which do not exist yet, by target path.

    Parameters
    ----------
    places : dict of Path to Path
        Real path of each target, with links followed.
    """

    def __init__(self, drafts: dict[Path, Path], places: dict[Path, Path], overwrite: bool) -> None:
        super().__init__(drafts)
        self._places = places
        self._overwrite = overwrite

    def publish(self) -> None:
        """Flush the drafts to disk and rename them to their targets in order: all of them, or none."""
        moves = [_Move(path, self._places[target]) for target, path in self.items()]
        for move in moves:
            move.seal()
        begun: list[_Move] = []
        try:
            for target, move in zip(self, moves, strict=True):
                if self._overwrite:
                    move.keep()
                begun.append(move)
                try:
                    move.replace() if self._overwrite else move.add()
                except FileExistsError as e:
                    raise InputError(
                        f"{target}: the file was created in the meantime, so nothing was written; use --overwrite to "
                        "replace it"
                    ) from e
            for folder in dict.fromkeys(move.place.parent for move in moves):
                _flush_folder(folder)
        except BaseException:  # including KeyboardInterrupt
            for move in reversed(begun):
                with suppress(OSError):
                    move.undo()
            raise


class _Move(NamedTuple):
    """A draft that is being moved to its target."""

    path: Path
    place: Path

    @property
    def old(self) -> Path:
        """Path at which the old file is kept until all files are moved."""
        return self.path.with_name(f"{self.path.name}-old")

    def seal(self) -> None:
        """Give the draft the permissions of the file that it replaces, and flush it to disk."""
        with self.path.open("r+b") as file:
            if (before := _status(self.place)) is not None and os.name == "posix":
                with suppress(OSError):  # allowed only for members of the group
                    os.chown(self.path, -1, before.st_gid)
                with suppress(OSError):  # allowed only for root
                    os.chown(self.path, before.st_uid, -1)
                self.path.chmod(stat.S_IMODE(before.st_mode))
            os.fsync(file.fileno())

    def keep(self) -> None:
        """Give the old file a second name (hard link), so that it can be restored."""
        if _status(self.place) is None:
            return
        try:
            self.old.hardlink_to(self.place)
        except OSError:  # a file system without hard links
            shutil.copy2(self.place, self.old)

    def replace(self) -> None:
        """Move the draft to its target; where a reader can prevent it for a moment, try again."""
        for pause in HELD:
            with suppress(PermissionError):
                self.path.replace(self.place)
                return
            time.sleep(pause)
        self.path.replace(self.place)

    def add(self) -> None:
        """Move the draft to a target that does not exist.

        On a file system without hard links, an empty file exists at the target for a moment.
        """
        try:
            self.place.hardlink_to(self.path)
        except FileExistsError:
            raise
        except OSError:
            self.place.open("x").close()
            try:
                self.path.replace(self.place)
            except OSError:
                self.place.unlink()
                raise

    def undo(self) -> None:
        """Restore the previous file, unless another program has written a new one in the meantime."""
        if self.old.exists():
            self.old.replace(self.place)
        elif not self.path.exists() or (self.place.exists() and self.place.samefile(self.path)):
            self.place.unlink(missing_ok=True)


@contextmanager
def drafts(targets: Sequence[Path], *, overwrite: bool) -> Iterator[Drafts]:
    """Provide a draft for each target; all drafts become the targets when they are published, or none."""
    with ExitStack() as stack:
        folders: dict[Path, Path] = {}
        places = {target: find_place(target) for target in targets}
        for target, place in places.items():
            if not overwrite and _status(place) is not None:
                raise InputError(f"{target}: the file exists already; {OTHERWISE}")
        if len(set(places.values())) < len(places):
            raise InputError(f"{', '.join(map(str, targets))}: two of these are the same file; choose other names")
        with _telling(places):
            for place in places.values():
                if place.parent not in folders:
                    folders[place.parent] = stack.enter_context(scratch(place.parent))
            started = {target: folders[p.parent] / f"draft-{k}" for k, (target, p) in enumerate(places.items())}
            yield Drafts(started, places, overwrite)


@contextmanager
def draft(target: Path, *, overwrite: bool) -> Iterator[Path]:
    """Provide the path of a draft of one file, which becomes that file if the block ends without an error."""
    with drafts([target], overwrite=overwrite) as started:
        yield started[target]
        started.publish()


def write_text(text: str, target: str | Path, *, overwrite: bool) -> Path:
    """Write a text in UTF-8 and return the path."""
    with draft(Path(target), overwrite=overwrite) as path:
        path.write_text(text, encoding="utf-8", newline="\n")
    return Path(target)


def _status(path: Path) -> os.stat_result | None:
    try:
        return path.lstat()
    except FileNotFoundError:
        return None


@contextmanager
def _telling(places: dict[Path, Path]) -> Iterator[None]:
    """Convert disk errors concerning drafts to an error that names the file; other errors pass unchanged."""
    try:
        yield
    except OSError as e:
        if not isinstance(e.filename, str | bytes):  # errors of writing and flushing have no file name
            raise cannot_be_written(next(reversed(places)), e) from e
        where = Path(os.fsdecode(e.filename))
        for target, place in places.items():
            beside = where.parts[len(place.parent.parts) :] if where.is_relative_to(place.parent) else (".",)
            if not beside or where == place or is_scratch(beside[0]):
                raise cannot_be_written(target, e) from e
        raise


def _flush_folder(folder: Path) -> None:
    """Flush the entries of a folder to disk; systems that do so automatically do not allow opening a folder."""
    if os.name != "posix":
        return
    try:
        handle = os.open(folder, os.O_RDONLY)
    except PermissionError:  # files may be created there, but not listed
        return
    try:
        os.fsync(handle)
    except OSError as e:
        if e.errno not in _NO_FLUSH:
            raise
    finally:
        os.close(handle)
