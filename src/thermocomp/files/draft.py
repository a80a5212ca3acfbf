"""Writing of files: each is written completely next to its target, flushed to the disk, and renamed.

Whatever fails, or kills the run, leaves the old file or the new one: never half of one, never none where there was one.

- A symbolic link stays: its target is written, in the target's folder. A link to nothing gets its target made if that
  has a folder; links that lead in a circle, folders, pipes and devices are refused, and so is a read-only file.
- A file that is replaced hands its permissions on (and its owner, as far as the system lets us); a new one gets those
  that the umask leaves. Under other hard links the old content stays.
- What a killed run has left, the next one that writes into the same folder removes: see `thermocomp.files.scratch`.
"""

import errno
import os
import shutil
import stat
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from thermocomp.core.exceptions import InputError
from thermocomp.core.outputs import OTHERWISE, cannot_be_written, find_place
from thermocomp.files.scratch import is_scratch, scratch

#: a disk whose folders are not flushed says so
_NO_FLUSH = {errno.EINVAL, errno.ENOSYS, errno.ENOTSUP}


class Drafts(dict[Path, Path]):
    """Paths of drafts, which do not exist yet, by what they will be.

    Parameters
    ----------
    drafts : dict of Path to Path
    places : dict of Path to Path
        Real path of each target, with links followed.
    overwrite : bool
    """

    def __init__(self, drafts: dict[Path, Path], places: dict[Path, Path], overwrite: bool) -> None:
        super().__init__(drafts)
        self._places = places
        self._overwrite = overwrite

    def publish(self) -> None:
        """Put the drafts on the disk and move them to their names, the last one last: all of them, or none.

        Raises
        ------
        InputError
            A file of such a name has come into being meanwhile, and nothing may be overwritten.
        OSError
            The disk does not do it; what was there is there again.
        """
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
                        f"{target}: was created in the meantime; nothing was written: use --overwrite"
                    ) from e
            for folder in dict.fromkeys(move.place.parent for move in moves):
                _flush_folder(folder)
        except BaseException:  # the keyboard too
            for move in reversed(begun):
                with suppress(OSError):
                    move.undo()
            raise


class _Move(NamedTuple):
    """A draft on its way."""

    path: Path
    place: Path

    @property
    def old(self) -> Path:
        """Path at which the old file is kept until all is done."""
        return self.path.with_name(f"{self.path.name}-old")

    def seal(self) -> None:
        """Give the draft the permissions of the file that it replaces, and put it on the disk."""
        with self.path.open("r+b") as file:
            if (before := _status(self.place)) is not None and os.name == "posix":
                with suppress(OSError):  # only for members of the group
                    os.chown(self.path, -1, before.st_gid)
                with suppress(OSError):  # only for root
                    os.chown(self.path, before.st_uid, -1)
                self.path.chmod(stat.S_IMODE(before.st_mode))
            os.fsync(file.fileno())

    def keep(self) -> None:
        """Let the old file have a second name."""
        if _status(self.place) is None:
            return
        try:
            self.old.hardlink_to(self.place)
        except OSError:  # a disk without links
            shutil.copy2(self.place, self.old)

    def replace(self) -> None:
        """Move the draft to its place."""
        self.path.replace(self.place)

    def add(self) -> None:
        """Move the draft to a place where nothing is.

        Where a disk has no hard links, there is an empty file for a moment.

        Raises
        ------
        FileExistsError
            Something is there.
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
        """Restore the previous files, unless another program has written new ones meanwhile."""
        if self.old.exists():
            self.old.replace(self.place)
        elif not self.path.exists() or (self.place.exists() and self.place.samefile(self.path)):
            self.place.unlink(missing_ok=True)


@contextmanager
def drafts(targets: Sequence[Path], *, overwrite: bool) -> Iterator[Drafts]:
    """Give a draft for each of some files; they become these files when they are published, all of them or none.

    Parameters
    ----------
    targets : sequence of Path
    overwrite : bool
        Files of these names are replaced. Otherwise one that comes into being until the end is not.

    Yields
    ------
    Drafts

    Raises
    ------
    InputError
        A file cannot be there, is there and must not be replaced, or the disk does not take it (it is full, say): what
        was there is as it was.
    """
    with ExitStack() as stack:
        folders: dict[Path, Path] = {}
        places = {target: find_place(target) for target in targets}
        for target, place in places.items():
            if not overwrite and _status(place) is not None:
                raise InputError(f"{target}: exists already; {OTHERWISE}")
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
    """Give the path of a draft of one file; it becomes that file if the block ends well.

    Parameters
    ----------
    target, overwrite
        See `drafts`.

    Yields
    ------
    Path
        Path of a file that does not exist yet.

    Raises
    ------
    InputError
        See `drafts`.
    """
    with drafts([target], overwrite=overwrite) as started:
        yield started[target]
        started.publish()


def write_text(text: str, target: str | Path, *, overwrite: bool) -> Path:
    """Write a text, in UTF-8; return its path.

    Parameters
    ----------
    text : str
    target, overwrite
        See `drafts`.

    Raises
    ------
    InputError
        See `drafts`.
    """
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
    """Turn errors of the disk about drafts into an error that names the file; errors of other files pass."""
    try:
        yield
    except OSError as e:
        if not isinstance(e.filename, str | bytes):  # writing and flushing do not say what
            raise cannot_be_written(next(reversed(places)), e) from e
        where = Path(os.fsdecode(e.filename))
        for target, place in places.items():
            beside = where.parts[len(place.parent.parts) :] if where.is_relative_to(place.parent) else (".",)
            if not beside or where == place or is_scratch(beside[0]):
                raise cannot_be_written(target, e) from e
        raise


def _flush_folder(folder: Path) -> None:
    """Put the names in a folder on the disk; systems that do that by themselves do not let anybody open one."""
    if os.name != "posix":
        return
    try:
        handle = os.open(folder, os.O_RDONLY)
    except PermissionError:  # files may be made there, but not listed
        return
    try:
        os.fsync(handle)
    except OSError as e:
        if e.errno not in _NO_FLUSH:
            raise
    finally:
        os.close(handle)
