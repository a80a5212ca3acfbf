"""NC programs as files: bytes and line endings are preserved, and a header can be filled in at the end."""

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import TextIO

from thermocomp.core.exceptions import InputError

#: UTF-8 byte-order mark, which editors write at the beginning of a file and no control can read
MARK = b"\xef\xbb\xbf"


def open_to_read(path: Path) -> TextIO:
    """Open a program for reading, after its byte-order mark; lines include their endings."""
    if path.is_dir():
        raise InputError(f"{path}: this is a directory; give an NC program")
    try:
        file = path.open(encoding="latin-1", newline="")
    except FileNotFoundError as e:
        raise InputError(f"{path}: no such file") from e
    if file.read(len(MARK)).encode("latin-1") != MARK:
        file.seek(0)
    return file


def has_mark(path: Path) -> bool:
    """Return whether a file begins with a byte-order mark."""
    with path.open("rb") as file:
        return file.read(len(MARK)) == MARK


def copy_without_mark(path: Path, target: Path) -> Path:
    """Return a program that begins without a byte-order mark: the file itself, or a copy."""
    if not has_mark(path):
        return path
    with open_to_read(path) as source, open_to_write(target) as written:
        shutil.copyfileobj(source, written)
    return target


def open_to_write(path: Path) -> TextIO:
    """Open a program for writing, without translation of line endings."""
    return path.open("w", encoding="latin-1", newline="")


def replace_lines(draft: Path, target: Path, lines: Mapping[str, str]) -> None:
    """Copy a program, or its diff, with some lines replaced."""
    waiting = [(old.encode("latin-1"), new.encode("latin-1")) for old, new in lines.items()]
    with draft.open("rb") as source, target.open("wb") as written:
        while waiting and (line := source.readline()):
            if line == waiting[0][0]:
                line = waiting.pop(0)[1]
            written.write(line)
        if waiting:
            raise ValueError(f"there is no line {waiting[0][0]!r} in {draft}")
        shutil.copyfileobj(source, written)
