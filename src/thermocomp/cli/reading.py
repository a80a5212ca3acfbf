"""Reading of recordings named on the command line, with their problems reported on stderr."""

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from thermocomp.cli import loudness
from thermocomp.cli.answers import count_others, print_folded
from thermocomp.cli.exits import STDIN
from thermocomp.cli.terminal import make_console, marked, words
from thermocomp.core.exceptions import InputError
from thermocomp.report.layout import PrintedLine, Toned

if TYPE_CHECKING:
    from thermocomp.recordings.recording import Recording

_stderr = make_console(stderr=True)


class RecordingReader(Protocol):
    """Reader of the files named on the command line for a parameter of a verb."""

    def __call__(self, paths: Any, mapping: Path | None, /, *, tell: bool = True) -> Any: ...  # noqa: D102


def read_recordings(paths: list[Path], mapping: Path | None, *, tell: bool = True) -> "list[Recording]":
    """Read the recordings named on the command line; ``-`` is a CSV file on standard input.

    Changes of the values by a mapping are reported on stderr, unless `tell` is False because they are shown elsewhere.
    """
    if not paths:
        raise InputError("no recording given: name at least one CSV, XLSX or Parquet file")
    from thermocomp.recordings.readers import mapping as mappings
    from thermocomp.recordings.readers.mending import read_or_offer

    columns = mappings.read_mapping(mapping) if mapping is not None else None
    found = _read_all(paths, lambda named: [read_or_offer(p, columns) for p in named])
    loudness.tell_read(found)
    if tell:
        _print_worst(Toned("note ", "soft"), [f"{r.name}: {change}" for r in found for change in r.changed])
    return found


def read_one(path: Path, mapping: Path | None, *, tell: bool = True) -> "Recording":
    """Read the single recording named by an option."""
    (found,) = read_recordings([path], mapping, tell=tell)
    return found


def _read_all(paths: list[Path], read: "Callable[[list[Path]], list[Recording]]") -> "list[Recording]":
    if STDIN not in paths:
        return read(paths)
    from thermocomp.recordings.readers.streams import spooled

    if paths.count(STDIN) > 1:
        raise InputError("-: standard input can be read only once")
    with spooled(sys.stdin.buffer, "standard input") as typed:
        return read([typed if p == STDIN else p for p in paths])


def tell_trouble(tests: "Sequence[Recording]") -> list[str]:
    """Print the data-quality problems of recordings on stderr, and return them.

    Parameters
    ----------
    tests : sequence of Recording

    Returns
    -------
    list of str
        One line per problem, and per excluded column.
    """
    from thermocomp.api.inputs import trouble_of

    return print_trouble(trouble_of(tests))


def print_trouble(lines: list[str]) -> list[str]:
    """Print data-quality problems on stderr, without ``--details`` only the first, and return them."""
    _print_worst(Toned("trouble ", "grave"), lines)
    return lines


def _print_worst(mark: Toned, lines: Sequence[str]) -> None:
    if loudness.quiet:
        return
    if loudness.details:
        for line in lines:
            _stderr.print(f"{marked(mark)}{words(line)}", soft_wrap=True)
    elif lines:
        print_folded(PrintedLine(lines[0], mark), 2, _stderr, count_others(len(lines) - 1))
