"""Options of all commands: ``--details``, ``--quiet``, ``--verbose``; removed before a command parses its words."""

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from thermocomp.core.exceptions import InputError
from thermocomp.core.shown import replace_unprintable

if TYPE_CHECKING:
    from thermocomp.recordings.recording import Recording

FLAGS = {
    "--details": "Print all tables, reasons and warnings below the answer.",
    "--quiet": "Print only errors on the error stream: no progress, no data-quality problems of recordings.",
    "--verbose": "Print more on the error stream: files read, current task, elapsed time; the full traceback of an "
    "unexpected error.",
}

#: options of the current command line
details = quiet = verbose = False


def taken_off(words: Sequence[str]) -> list[str]:
    """Return a command line without the flags, wherever they are; they apply until the next call.

    Raises
    ------
    InputError
        --quiet and --verbose are given together.
    """
    global details, quiet, verbose  # noqa: PLW0603 - one process runs one command line
    details, quiet, verbose = (flag in words for flag in FLAGS)
    if quiet and verbose:
        quiet = verbose = False
        raise InputError("--quiet and --verbose exclude each other: choose one")
    return [word for word in words if word not in FLAGS]


def tell(text: str) -> None:
    """Write a line on stderr, if verbose."""
    if verbose:
        print(replace_unprintable(text), file=sys.stderr, flush=True)


def tell_read(recordings: "Sequence[Recording]") -> None:
    """Write a summary of the recordings read on stderr, if verbose."""
    for r in recordings:
        tell(f"read {r.source or r.name}: {len(r)} rows, {len(r.table.columns)} columns")
