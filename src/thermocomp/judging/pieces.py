"""Parallel execution of tasks in processes: a failure affects only its own task."""

from collections.abc import Callable, Iterator, Sequence
from contextvars import ContextVar
from typing import Any, TypeVar

from joblib import Parallel, delayed
from joblib.externals.loky.process_executor import BrokenProcessPool

from thermocomp.core.exceptions import ThermocompError

_Piece = TypeVar("_Piece")
_Found = TypeVar("_Found")

#: reason reported for a task whose process died
DIED = "its process ended: it crashed, or was killed by the system, for example because the memory is full"

#: executor used instead of this machine's processes, if any: called with the arguments of `work_through` except `jobs`
elsewhere: ContextVar[Callable[[Any, Sequence[Any], Any], Iterator[Any]] | None] = ContextVar("elsewhere", default=None)


def return_reason(_piece: Any, why: str) -> Any:
    """Return the reason for the failure of a task as its result."""
    return why


def work_through(
    work: Callable[[_Piece], _Found],
    pieces: Sequence[_Piece],
    failed: Callable[[_Piece, str], _Found] = return_reason,
    *,
    jobs: int,
) -> Iterator[_Found]:
    """Yield the results of the tasks, in their order.

    When a process dies, results of other tasks are lost as well, and the task that caused it is unknown: missing tasks
    are repeated one by one until the task that kills its process is found.

    Parameters
    ----------
    failed : callable
        Called with a task and the reason for its failure; returns a substitute for the result. Default: the reason.
    """
    if (share := elsewhere.get()) is not None:
        yield from share(work, pieces, failed)
        return
    done, alone = 0, False
    while done < len(pieces):
        tried = pieces[done : done + 1] if alone else pieces[done:]
        # n_jobs=2 ensures a process other than this one
        parallel = Parallel(n_jobs=2 if alone else jobs, return_as="generator")
        try:
            for found in parallel(delayed(attempt)(work, piece, failed) for piece in tried):
                yield found
                done += 1
        except Exception as e:  # noqa: BLE001 - a dead process, or an object that cannot be sent to a process
            if alone:
                yield failed(pieces[done], explain(e))
                done += 1
            alone = not alone


def attempt(work: Callable[[_Piece], _Found], piece: _Piece, failed: Callable[[_Piece, str], _Found]) -> _Found:
    """Return the result of one task; the result of `failed` if an exception is raised."""
    try:
        return work(piece)
    except (Exception, SystemExit) as e:  # noqa: BLE001 - whatever a method raises, the other tasks keep their results
        return failed(piece, explain(e))


def explain(error: BaseException) -> str:
    """Return the reason for a failure in one line, with the type of the exception if it is not one of thermocomp's."""
    if isinstance(error, ThermocompError):
        return str(error)
    if isinstance(error, BrokenProcessPool):
        return DIED
    if isinstance(error, MemoryError):
        return f"the memory is full ({str(error) or type(error).__name__})"
    return f"{type(error).__name__}: {error}"
