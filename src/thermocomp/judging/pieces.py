"""Work in pieces, shared among processes: what fails in one piece is that piece's, whatever it is."""

from collections.abc import Callable, Iterator, Sequence
from contextvars import ContextVar
from typing import Any, TypeVar

from joblib import Parallel, delayed
from joblib.externals.loky.process_executor import BrokenProcessPool

from thermocomp.core.exceptions import ThermocompError

_Piece = TypeVar("_Piece")
_Found = TypeVar("_Found")

#: why nothing came of a piece whose process died
DIED = "its process died: it crashed, or was killed, as the system does if the memory is full"

#: what does the work in place of this machine's processes, if anything: takes what `work_through` takes, but for `jobs`
elsewhere: ContextVar[Callable[[Any, Sequence[Any], Any], Iterator[Any]] | None] = ContextVar("elsewhere", default=None)


def work_through(
    work: Callable[[_Piece], _Found],
    pieces: Sequence[_Piece],
    failed: Callable[[_Piece, str], _Found],
    *,
    jobs: int,
) -> Iterator[_Found]:
    """Yield the results of the tasks, in their order.

    A process that dies takes the others' results with it, and nobody knows whose fault it was: what is missing is done
    again, piece by piece, until the one is found that kills its process.

    Parameters
    ----------
    work : callable
        Takes a piece.
    pieces : sequence
    failed : callable
        Called with a task and the reason of its failure; returns the replacement of the result.
    jobs : int
        Processes to share the work among; 1 is this one, -1 takes all cores. Within
        `thermocomp.judging.cluster.shared_among` it is of no account.

    Yields
    ------
    object
        From `work`, or from `failed` where anything was raised or the process died.
    """
    if (share := elsewhere.get()) is not None:
        yield from share(work, pieces, failed)
        return
    done, alone = 0, False
    while done < len(pieces):
        tried = pieces[done : done + 1] if alone else pieces[done:]
        # with two there is another process than this one
        parallel = Parallel(n_jobs=2 if alone else jobs, return_as="generator")
        try:
            for found in parallel(delayed(attempt)(work, piece, failed) for piece in tried):
                yield found
                done += 1
        except Exception as e:  # noqa: BLE001 - a dead process, or what cannot be sent to one
            if alone:
                yield failed(pieces[done], explain(e))
                done += 1
            alone = not alone


def attempt(work: Callable[[_Piece], _Found], piece: _Piece, failed: Callable[[_Piece, str], _Found]) -> _Found:
    """Return the result of one task; that of `failed` if an exception is raised."""
    try:
        return work(piece)
    except (Exception, SystemExit) as e:  # noqa: BLE001 - whatever a method raises, the others have their results
        return failed(piece, explain(e))


def explain(error: BaseException) -> str:
    """Return the reason of a failure in one line; for foreign exceptions with the type."""
    if isinstance(error, ThermocompError):
        return str(error)
    if isinstance(error, BrokenProcessPool):
        return DIED
    if isinstance(error, MemoryError):
        return f"the memory is full ({str(error) or type(error).__name__})"
    return f"{type(error).__name__}: {error}"
