"""Bars that show how far long work is; they go to stderr and leave nothing behind."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
)

_console = Console(stderr=True)


class Steps(Protocol):
    """Tells what is worked on, and how many steps are done since it was told last."""

    def __call__(self, text: str, /, steps: int = 1) -> None: ...  # noqa: D102


class Share(Protocol):
    """Tells how far the work is, as a share of it, and on what."""

    def __call__(self, share: float, text: str = "", /) -> None: ...  # noqa: D102


@contextmanager
def by_steps(total: int, *, hidden: bool) -> Iterator[Steps]:
    """Show a bar of so many steps; without one if `hidden`."""
    with _bar(MofNCompleteColumn(), hidden) as bar:
        task = bar.add_task("working", total=total)

        def tell(text: str, /, steps: int = 1) -> None:
            bar.update(task, description=text, advance=steps)

        yield tell


@contextmanager
def by_share(name: str, *, hidden: bool) -> Iterator[Share]:
    """Show a bar with the percentage that is done; without one if `hidden`."""
    with _bar(TaskProgressColumn(), hidden) as bar:
        task = bar.add_task(name, total=1.0)

        def tell(share: float, text: str = "", /) -> None:
            bar.update(task, completed=share, description=f"{name}: {text}" if text else name)

        yield tell


def _bar(done: ProgressColumn, hidden: bool) -> Progress:
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), done, TimeElapsedColumn())
    return Progress(*columns, console=_console, transient=True, disable=hidden)
