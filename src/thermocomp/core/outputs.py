"""Checks of output paths: before any work is done, and again on writing."""

import errno
import os
from collections.abc import Sequence
from pathlib import Path

from thermocomp.core.browsers import find_browser
from thermocomp.core.exceptions import InputError

OTHERWISE = "choose another name or allow overwriting with --overwrite"
#: errors when creating the draft next to the target
_NOT_ALLOWED = {errno.EACCES, errno.EPERM, errno.EROFS}


def refuse_existing(paths: Sequence[Path], overwrite: bool, inputs: Sequence[Path] = (), *endings: str) -> None:
    """Raise `InputError` if an output cannot be written, before any work is done."""
    for path in paths:
        place = find_place(path)
        if any(place.exists() and other.exists() and place.samefile(other) for other in inputs):
            raise InputError(f"{path}: this file is also an input; choose another name")
        if place.exists() and not overwrite:
            raise InputError(f"{path}: the file exists already; {OTHERWISE}")
        if endings and path.suffix.lower() not in endings:
            raise InputError(
                f"{path}: the file is written in the format {' or '.join(e[1:] for e in endings)}; name it "
                f"{path.with_suffix(endings[0])}"
            )
        if path.suffix.lower() == ".pdf":
            find_browser()


def find_place(target: Path) -> Path:
    """Return the real path of a file: links are followed, the last one even if its target does not exist."""
    place = Path(os.path.realpath(target))
    try:
        target.stat()
    except FileNotFoundError:
        pass
    except OSError as e:  # circular links, a name that is too long, a file in place of a folder
        raise cannot_be_written(target, e) from e
    folder = place.parent if target.is_symlink() else target.parent
    if not folder.is_dir():
        raise InputError(f"{target}: there is no folder {folder}; create it first")
    if place.is_dir():
        raise InputError(f"{target}: this is a folder; name a file")
    if place.exists():
        if not place.is_file():
            raise InputError(f"{target}: this is a pipe or a device, not a file; choose another name")
        if not os.access(place, os.W_OK):
            raise InputError(f"{target}: the file is read-only; choose another name, or make it writable")
    return place


def cannot_be_written(target: Path, error: OSError) -> InputError:
    """Return the error for a file that cannot be written, with the reason given by the system."""
    hint = f"; you need permission to create files in its folder {target.parent}" if error.errno in _NOT_ALLOWED else ""
    why = os.strerror(error.errno) if error.errno else error
    return InputError(f"{target}: the file cannot be written: {why}{hint}; an existing file is unchanged")
