"""Recordings from a byte stream, stored in a temporary file for reading."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from thermocomp.files.scratch import scratch
from thermocomp.recordings.readers.limits import FileLimits


@contextmanager
def spooled(stream: BinaryIO, owner: str) -> Iterator[Path]:
    """Provide a CSV file with the content of a stream; it is removed at the end."""
    with scratch() as folder:
        path = folder / "stdin.csv"
        with path.open("wb") as file:
            while block := stream.read(1 << 20):
                FileLimits().check("file_bytes", file.tell() + len(block), owner)
                file.write(block)
        yield path
