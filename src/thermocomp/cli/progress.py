"""Progress of long work on stderr: a transient bar on a terminal, else a line at growing intervals."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Protocol

from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from thermocomp.cli import loudness
from thermocomp.cli.terminal import make_console
from thermocomp.core.shown import replace_unprintable, shorten

#: time of the first line without a terminal; each further one comes after four times as long [s]
OFTEN, LATER = 30.0, 4.0
#: length of the task in such a line [characters]
LONGEST = 50

_console = make_console(stderr=True)


class Share(Protocol):
    """Callable that reports the completed fraction of the work and the current task."""

    def __call__(self, share: float, text: str = "", /) -> None: ...  # noqa: D102


class Steps:
    """Progress display of a verb: completed and total number of steps.

    Parameters
    ----------
    bar : Progress
    hidden : bool
    warn : callable
        Shows the data-quality problems before the work.
    """

    def __init__(self, bar: Progress, hidden: bool, warn: Callable[[list[str]], object] = lambda _: None) -> None:
        self._bar, self._line, self.warn = bar, _Lines(hidden), warn
        self._task, self._done, self._total = bar.add_task("working", total=None, visible=False), 0, 0

    def begin(self, total: int) -> None:
        """Set the total number of steps."""
        self._total = total
        self._bar.update(self._task, total=total, visible=True)

    def __call__(self, text: str, /, steps: int = 1) -> None:
        """Report the current task, and the number of steps completed since the last call."""
        self._done += steps
        self._bar.update(self._task, description=replace_unprintable(text), advance=steps)
        done = f"{self._done} of {self._total}" if self._total else ""
        if loudness.verbose:
            loudness.tell(f"{text}: {done}" if done else text)
        else:
            self._line.tell(text, done)


@contextmanager
def show_progress(*, hidden: bool, warn: Callable[[list[str]], object] = lambda _: None) -> Iterator[Steps]:
    """Show the steps of a verb; nothing if `hidden` or with ``--quiet``."""
    hidden = hidden or loudness.quiet
    with _bar(MofNCompleteColumn(), hidden) as bar:
        yield Steps(bar, hidden, warn)


@contextmanager
def show_share(name: str, *, hidden: bool) -> Iterator[Share]:
    """Show the completed percentage; nothing if `hidden` or with ``--quiet``."""
    hidden = hidden or loudness.quiet
    with _bar(TaskProgressColumn(), hidden) as bar:
        task = bar.add_task(name, total=1.0)
        line = _Lines(hidden)

        def tell(share: float, text: str = "", /) -> None:
            said = f"{name}: {text}" if text else name
            bar.update(task, completed=share, description=replace_unprintable(said))
            line.tell(said, f"{min(share, 1.0):.0%}")

        yield tell


class _Lines:
    """Progress as separate lines, where there is no terminal for a bar."""

    def __init__(self, hidden: bool) -> None:
        self._silent = hidden or _console.file.isatty()
        self._begun, self._next = time.monotonic(), OFTEN

    def tell(self, text: str, done: str) -> None:
        """Print the current task and the completed fraction, if it is time."""
        took = time.monotonic() - self._begun
        if not self._silent and took >= self._next:
            self._next = LATER * took
            print(f"{shorten(text, LONGEST)}: {done} after {took:.0f} s", file=sys.stderr, flush=True)


def _bar(done: ProgressColumn, hidden: bool) -> Progress:
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        done,
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    return Progress(*columns, console=_console, transient=True, disable=hidden or not _console.file.isatty())
