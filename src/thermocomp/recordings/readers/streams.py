"""Recordings that come as a stream of bytes: kept in a file while they are read."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from thermocomp.files.scratch import scratch
from thermocomp.recordings.readers.limits import FileLimits


@contextmanager
def spooled(stream: BinaryIO, owner: str) -> Iterator[Path]:
    """Give a CSV file with what a stream holds; it is removed at the end.

    Raises
    ------
    RecordingError
        It holds more than a file may.
    """
    with scratch() as folder:
        path = folder / "stdin.csv"
        with path.open("wb") as file:
            while block := stream.read(1 << 20):
                FileLimits().check("file_bytes", file.tell() + len(block), owner)
                file.write(block)
        yield path
