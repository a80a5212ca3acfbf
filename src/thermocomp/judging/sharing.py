"""Execution of tasks: by the processes of this machine, or by a cluster."""

from collections.abc import Iterator
from contextlib import contextmanager

from thermocomp.core.exceptions import MissingExtraError
from thermocomp.judging.pieces import elsewhere


@contextmanager
def shared_among(scheduler: str | None) -> Iterator[None]:
    """Distribute the tasks of `thermocomp.judging.pieces.work_through` among the workers of a Dask cluster.

    Parameters
    ----------
    scheduler : str or None
        Address of the scheduler, such as ``tcp://192.168.1.20:8786``; None: tasks run on this machine.
    """
    if scheduler is None:
        yield
        return
    try:
        from thermocomp.judging.cluster import connect
    except ModuleNotFoundError as e:
        raise MissingExtraError("dask", e.name or "distributed") from e
    with connect(scheduler) as cluster:
        token = elsewhere.set(cluster.share)
        try:
            yield
        finally:
            elsewhere.reset(token)
