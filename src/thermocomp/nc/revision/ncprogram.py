"""NC programs as files: bytes and line endings are preserved, and a header can be filled in at the end."""

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import TextIO

from thermocomp.core.exceptions import InputError


def open_to_read(path: Path) -> TextIO:
    """Open a program for reading; lines include their endings."""
    if path.is_dir():
        raise InputError(f"{path}: this is a directory; give an NC program")
    try:
        return path.open(encoding="latin-1", newline="")
    except FileNotFoundError as e:
        raise InputError(f"{path}: no such file") from e


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
