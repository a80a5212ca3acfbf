"""Execution of tasks by the workers of a Dask cluster, instead of the processes of this machine."""

import logging
import socket
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from queue import Empty, SimpleQueue
from typing import Any
from urllib.parse import urlsplit
from uuid import uuid4

import cloudpickle
import dask
from distributed import Client, Future, KilledWorker, get_worker
from distributed.versions import get_versions
from joblib import parallel_config
from threadpoolctl import threadpool_limits

from thermocomp.core.exceptions import InputError
from thermocomp.judging.pieces import DIED, attempt, explain

#: a scheduler that does not answer a connection within this time is regarded as absent [s]
ANSWERS = 10.0
#: interval without a result after which the scheduler is checked; also the time limit for its answer [s]
ASKED = 15.0
#: time without a worker after which a cluster is given up [s]
WORKERLESS = 30.0
#: packages whose versions must agree for identical results
ALIKE = ("python", "thermocomp", "numpy", "scipy", "scikit-learn", "numba", "pandas")

#: a worker executes one task at a time, whatever its number of threads: this bounds its memory, and warnings are per
#: process
_turn = threading.Lock()


class ClusterError(InputError):
    """A cluster cannot be used, or was lost; the message names the address of the scheduler."""


@contextmanager
def connect(address: str) -> Iterator["Cluster"]:
    """Connect to a Dask scheduler."""
    host, port, speaks = _read_address(address)
    with _unlogged():
        try:
            # The client would wait forever for the first message of a server that only listens.
            with socket.create_connection((host, port), ANSWERS) as line:
                if speaks and not line.recv(1):
                    raise ConnectionError("the server closed the connection")
            client = Client(address, timeout=ANSWERS, set_as_default=False, name="thermocomp")
        except (OSError, ValueError) as e:
            raise ClusterError(
                f"{address}: no Dask scheduler answers there ({explain(e)}); check that 'dask scheduler' is running"
            ) from e
        try:
            yield Cluster(client, address)
        finally:
            client.close(timeout=ANSWERS)


@contextmanager
def _unlogged() -> Iterator[None]:
    """Keep Dask's tracebacks of lost connections off the error stream: a single line of thermocomp reports them."""
    loggers = [logging.getLogger(name) for name in ("distributed", "distributed.client")]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


def _read_address(address: str) -> tuple[str, int, bool]:
    """Return host and port, and whether the scheduler sends the first message."""
    try:
        parts = urlsplit(address)
        if parts.scheme in ("tcp", "tls") and parts.hostname and parts.port:
            return parts.hostname, parts.port, parts.scheme == "tcp"
    except ValueError:  # invalid port
        pass
    raise ClusterError(
        f"scheduler {address!r}: expected the address that 'dask scheduler' prints, such as tcp://192.168.1.20:8786"
    )


class Cluster:
    """A scheduler and its workers, with the same package versions as this machine.

    Parameters
    ----------
    address : str
        Address of the scheduler, for messages.
    """

    def __init__(self, client: Client, address: str) -> None:
        self._client = client
        self._address = address
        try:
            client.wait_for_workers(1, timeout=WORKERLESS)
        except TimeoutError as e:
            raise self._workerless() from e
        found = client.get_versions(packages=ALIKE)
        self._versions = _alike(found["client"]["packages"])
        for worker, its in found["workers"].items():
            _check_versions(self._versions, _alike(its["packages"]), worker)

    def share(
        self, work: Callable[[Any], Any], pieces: Sequence[Any], failed: Callable[[Any, str], Any]
    ) -> Iterator[Any]:
        """Yield the results of the tasks, in their order; see `thermocomp.judging.pieces.work_through`."""
        waiting: dict[int, Any] = {}
        turn = 0
        for number, found in self._results(work, pieces, failed):
            waiting[number] = found
            while turn in waiting:
                yield waiting.pop(turn)
                turn += 1

    def _results(
        self, work: Callable[[Any], Any], pieces: Sequence[Any], failed: Callable[[Any, str], Any]
    ) -> Iterator[tuple[int, Any]]:
        """Yield indices of tasks and their results, as they are completed."""
        unsendable = {k: why for k, piece in enumerate(pieces) if (why := _unsendable(piece))}
        for k, why in unsendable.items():
            yield k, failed(pieces[k], why)
        sent = [None if k in unsendable else piece for k, piece in enumerate(pieces)]
        with dask.config.set({"distributed.admin.large-graph-warning-threshold": "1TiB"}):
            # As a task, not scattered: the scheduler keeps the bytes, so it outlives every worker.
            shared = self._client.submit(cloudpickle.loads, cloudpickle.dumps((work, sent, failed)), pure=False)
        suspects = []
        for k, found in self._run(shared, [k for k in range(len(pieces)) if k not in unsendable]):
            if isinstance(found, KilledWorker):
                suspects.append(k)  # or another task on the same worker was the cause
            else:
                yield k, found
        for k in suspects:
            for _, found in self._run(shared, [k]):
                yield k, failed(pieces[k], DIED) if isinstance(found, KilledWorker) else found

    def _run(self, shared: Future, numbers: Sequence[int]) -> Iterator[tuple[int, Any]]:
        """Yield indices and results, or `KilledWorker` for a task whose workers died; remaining tasks are cancelled."""
        done: SimpleQueue[int] = SimpleQueue()
        name = f"thermocomp-{uuid4().hex}"
        futures = {
            # submitted in order; otherwise the progress, reported in order, would lag behind
            k: self._client.submit(_do, shared, k, self._versions, key=f"{name}-{k}", priority=-k)
            for k in numbers
        }
        for k, future in futures.items():
            future.add_done_callback(lambda _, k=k: done.put(k))
        try:
            while futures:
                k = self._next(done)
                try:
                    found = cloudpickle.loads(futures[k].result(timeout=ASKED))
                except KilledWorker as e:
                    found = e
                except TimeoutError:  # the worker died before the result was fetched: the task is repeated
                    self._ask()
                    done.put(k)
                    continue
                except ClusterError:
                    raise
                except (CancelledError, OSError) as e:
                    raise self._lost() from e
                except Exception as e:
                    raise ClusterError(f"{self._address}: a worker cannot accept the task: {explain(e)}") from e
                del futures[k]  # the worker releases the result
                yield k, found
        finally:
            if self._client.status == "running":  # a closed client has already cancelled them
                self._client.cancel(list(futures.values()), force=True)

    def _next(self, done: SimpleQueue[int]) -> int:
        """Return the index of the next completed task; while waiting, check for scheduler and workers."""
        lonely = False
        while True:
            try:
                return done.get(timeout=ASKED)
            except Empty:
                if self._ask():
                    lonely = False
                elif lonely:
                    raise self._workerless() from None
                else:
                    lonely = True

    def _ask(self) -> int:
        """Return the number of workers connected to the scheduler."""
        try:
            return len(self._client.nthreads(callback_timeout=ASKED))
        except Exception as e:
            raise self._lost() from e

    def _lost(self) -> ClusterError:
        return ClusterError(
            f"{self._address}: the connection to the scheduler was lost, and with it all results so far; "
            "check that the scheduler is running, then start again"
        )

    def _workerless(self) -> ClusterError:
        return ClusterError(
            f"{self._address}: the scheduler has no worker; start some with: "
            f"dask worker {self._address} --nthreads 1 --nworkers auto"
        )


def _do(shared: tuple[Any, Sequence[Any], Any], number: int, versions: Mapping[str, str | None]) -> bytes:
    """Execute one task in a worker."""
    # check a worker that joined later
    _check_versions(versions, _alike(get_versions(ALIKE)["packages"]), get_worker().address)
    work, pieces, failed = shared
    with _turn, parallel_config("sequential"):
        threadpool_limits(1)  # permanent: the next task of any user needs it, too
        found = attempt(work, pieces[number], failed)
        sent: bytes
        try:
            sent = cloudpickle.dumps(found)
        except Exception as e:  # noqa: BLE001 - any exception of the task
            sent = cloudpickle.dumps(failed(pieces[number], explain(e)))
    return sent


def _unsendable(what: Any) -> str:
    """Return the reason why an object cannot be sent to another process; empty if it can."""
    try:
        cloudpickle.dumps(what)
    except Exception as e:  # noqa: BLE001 - any exception of the serialisation
        return f"it cannot be sent to another process: {explain(e)}"
    return ""


def _alike(packages: Mapping[str, Any]) -> dict[str, str | None]:
    found = {name: packages.get(name) for name in ALIKE}
    return {**found, "python": ".".join(str(found["python"]).split(".")[:2])}


def _check_versions(here: Mapping[str, str | None], there: Mapping[str, str | None], worker: str) -> None:
    other = [f"{name} {there[name] or 'is missing'} (here {here[name]})" for name in ALIKE if here[name] != there[name]]
    if other:
        raise ClusterError(
            f"worker {worker}: {', '.join(other)}; install the same versions for the worker as here, then start the "
            "worker again"
        )
