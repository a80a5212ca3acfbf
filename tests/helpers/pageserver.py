"""The page of a project as the command serves it."""

import contextlib
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path


def start_page(folder: Path) -> tuple["subprocess.Popen[str]", str]:
    """Start the command; return its process and the address of the page."""
    words = [sys.executable, "-m", "thermocomp", "app", str(folder), "--no-browser"]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    return process, next(line.strip() for line in process.stdout if line.startswith("http://127.0.0.1:"))


@contextlib.contextmanager
def served(folder: Path) -> Iterator[str]:
    """A page as the command serves it; yields its address."""
    process, address = start_page(folder)
    with process:
        try:
            yield address
        finally:
            process.terminate()
            process.communicate()
