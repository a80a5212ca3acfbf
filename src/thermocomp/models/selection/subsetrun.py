"""Execution of the searches of `best_subsets`: threads, time limit, and guarantees of the result."""

import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Literal

import numpy as np
from joblib import Parallel, delayed

from thermocomp.core.arrays import FloatArray
from thermocomp.models.selection.subsetsearch import Adding, Dropping, Problem, Search, Swapping

Route = Literal["dropping", "adding"]
Stop = Literal["", "nodes", "seconds", "interrupted"]


class SearchResult:
    """A search that has ended, complete or stopped.

    Parameters
    ----------
    limit : ndarray of shape (p + 1,)
        See `Search`.
    """

    def __init__(self, problem: Problem, limit: FloatArray, n_best: int) -> None:
        self.problem, self.limit, self.n_best = problem, limit, n_best
        self.parts: list[Search] = []
        self.looked = 0
        self.stopped: Stop = ""
        self._open = np.full(len(limit), np.inf)

    def sets(self, size: int) -> list[tuple[int, ...]]:
        """Return the sets of a size that may be the best: all within the margin, and at least the number requested."""
        found = self._merged(size)
        return [c for i, (v, c) in enumerate(found) if v < self.limit[size] or i < self.n_best]

    def safe(self, size: int) -> tuple[float, bool]:
        """Return a lower bound of the sums of all other sets of a size, and whether none was lost below the margin."""
        found = self._merged(size)
        if not found:
            return self.problem.full_rss, False
        lost = min(float(part.lost[size]) for part in self.parts)
        beyond = min(lost, float(self._open[size]), float(self.limit[size]))
        worst = found[min(self.n_best, len(found)) - 1][0]
        needed = (np.sqrt(worst) + 2 * self.problem.error(worst)) ** 2
        complete = min(lost, float(self._open[size])) >= self.limit[size] and self.limit[size] >= needed * (1 - 1e-12)
        if beyond == np.inf:
            return beyond, complete
        return float(max(np.sqrt(beyond) - self.problem.error(max(beyond, worst)), 0.0) ** 2), complete

    def _merged(self, size: int) -> list[tuple[float, tuple[int, ...]]]:
        found: dict[tuple[int, ...], float] = {}
        for part in self.parts:
            for value, flags in zip(part.values[size], part.contents[size], strict=True):
                if value < np.inf:
                    columns = part.columns(flags)
                    found[columns] = min(float(value), found.get(columns, np.inf))
        return sorted((v, c) for c, v in found.items())

    def leave_open(self, least: FloatArray) -> None:
        """Record the lower bound of the residual sums of squares of the sets that were not examined."""
        self._open = np.minimum(self._open, least)


def run(
    problem: Problem,
    route: Route,
    sizes: int,
    n_best: int,
    jobs: int,
    nodes: int | None,
    seconds: float | None,
    progress: Callable[[str], None] | None,
) -> SearchResult:
    """Search the best subsets of each size.

    Parameters
    ----------
    seconds : float or None
        Time limit, approximate [s].
    """
    p = problem.triangle.shape[1] - 1
    limit = np.full(p + 1, -np.inf)
    limit[1 : sizes + 1] = np.inf
    bound = limit.copy()
    kind: Any = {"dropping": Dropping, "adding": Adding}[route]
    result = SearchResult(problem, limit, n_best)
    result.parts = [kind(problem, sizes, n_best, limit, bound) for _ in range(jobs)]
    n_tasks = result.parts[0].tasks
    for part in result.parts:
        part.start(0, 0)
    if route == "dropping":
        result.parts.append(Swapping(problem, sizes, n_best, limit, bound))
    # dropping starts with the cheap branches at the end, which contain good sets; adding with those at the beginning
    turns = list(range(n_tasks)) if route == "dropping" else list(range(n_tasks))[::-1]
    watch = _Watch(result, nodes, seconds, progress)

    def work(part: Search) -> None:
        while turns and not result.stopped:
            task = turns.pop()  # one at a time, ensured by the GIL
            part.start(task, task + 1)
            watch.through(part)

    try:
        with _interrupts(result):
            if jobs > 1:
                Parallel(n_jobs=jobs, prefer="threads")(delayed(work)(part) for part in result.parts[:jobs])
            elif turns:
                turns.clear()
                result.parts[0].start(0, n_tasks)
                watch.through(result.parts[0])
    except KeyboardInterrupt:  # before the handler was installed, or from `progress`
        result.stopped = "interrupted"
    for part in result.parts:
        result.leave_open(part.open_from())
    for task in turns:
        part = kind(problem, sizes, n_best, limit.copy(), bound.copy())
        part.start(task, task + 1)
        result.leave_open(part.open_from())
    return result


class _Watch:
    """Stop conditions of a search, and the receiver of its progress."""

    def __init__(
        self, result: SearchResult, nodes: int | None, seconds: float | None, progress: Callable[[str], None] | None
    ) -> None:
        self.result, self.nodes, self.seconds, self.progress = result, nodes, seconds, progress
        self.began = self.said = time.monotonic()

    def through(self, part: Search) -> None:
        """Examine the sets of the branches assigned to a part until none are left or the search is stopped."""
        result = self.result
        chunk = part.chunk if self.nodes is None else min(part.chunk, self.nodes)
        while not result.stopped and (done := part.go_on(chunk)):
            result.looked += done
            now = time.monotonic()
            if self.nodes is not None and result.looked >= self.nodes:
                result.stopped = result.stopped or "nodes"
            elif self.seconds is not None and now - self.began >= self.seconds:
                result.stopped = result.stopped or "seconds"
            if self.progress is not None and now - self.said >= 1:
                self.said = now
                self.progress(f"best subsets: {result.looked:,} sets examined in {now - self.began:.0f} s")


@contextmanager
def _interrupts(result: SearchResult) -> Iterator[None]:
    """Let Ctrl+C stop a search by a flag: a raised interrupt may get lost in a callback of the search threads."""
    ours = threading.current_thread() is threading.main_thread()
    if not ours or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return

    def stop(*_: object) -> None:
        result.stopped = "interrupted"

    signal.signal(signal.SIGINT, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
