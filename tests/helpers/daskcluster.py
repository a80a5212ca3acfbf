"""A Dask scheduler and its workers as processes of their own, on this machine."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import thermocomp

_FOLDERS = [Path(thermocomp.__file__).parent.parent, Path(__file__).parent, Path(__file__).parent.parent / "judging"]
_SOON = 30.0


@dataclass
class DaskCluster:
    """What runs, and where what it says is written."""

    folder: Path
    environment: Mapping[str, str]
    address: str = ""
    scheduler: "subprocess.Popen[bytes] | None" = None
    nannies: "list[subprocess.Popen[bytes]]" = field(default_factory=list)

    def start_scheduler(self) -> None:
        told = self.folder / "scheduler.json"
        self.scheduler = self._start("scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(told))
        wait_until(lambda: told.exists() and told.stat().st_size > 0)
        self.address = json.loads(told.read_text())["address"]

    def start_worker(self, *options: str, folders: tuple[Path, ...] = ()) -> None:
        nanny = self._start("worker", self.address, "--nthreads", "1", *options, folders=folders)
        self.nannies.append(nanny)

    def workers(self) -> list[int]:
        """Return the processes that do the work; their nannies start new ones if they die."""
        return [pid for nanny in self.nannies if nanny.poll() is None for pid in _children(nanny.pid)]

    def stop(self) -> None:
        """Kill all of them: asked to end, they would first look for each other."""
        workers = self.workers()
        for process in (*self.nannies, *([self.scheduler] if self.scheduler else [])):
            process.kill()
            process.wait()
        for pid in workers:
            with suppress(ProcessLookupError):  # it has seen that its nanny is gone
                os.kill(pid, signal.SIGKILL)

    def _start(self, *words: str, folders: tuple[Path, ...] = ()) -> "subprocess.Popen[bytes]":
        path = os.pathsep.join(map(str, (*folders, *_FOLDERS)))
        environment = {k: v for k, v in os.environ.items() if not k.endswith("_NUM_THREADS")}
        with (self.folder / f"{words[0]}-{len(self.nannies)}.log").open("wb") as log:
            return subprocess.Popen(
                [sys.executable, "-m", "dask", *words, "--no-dashboard"],
                env={**environment, **self.environment, "PYTHONPATH": path},
                cwd=self.folder,
                stdout=log,
                stderr=subprocess.STDOUT,
            )


def slow(piece: int) -> int:
    """Work that takes a while; it stands here because a worker imports little for it."""
    time.sleep(0.2)
    return piece


def lost(_: int, why: str) -> Any:
    """Say why nothing came of a piece."""
    return why


@contextmanager
def dask_cluster(
    folder: Path, *, workers: int = 2, memory_limit: str = "auto", **environment: str
) -> Iterator[DaskCluster]:
    """Start a scheduler and workers of one thread each; all of them are ended."""
    cluster = DaskCluster(folder, environment)
    try:
        cluster.start_scheduler()
        for _ in range(workers):
            cluster.start_worker("--local-directory", str(folder), "--memory-limit", memory_limit)
        yield cluster
    finally:
        cluster.stop()


def peak_memory(pid: int) -> int:
    """Return the most memory that a process has held, in bytes."""
    status = Path(f"/proc/{pid}/status").read_text()
    return 1024 * int(next(line for line in status.splitlines() if line.startswith("VmHWM")).split()[1])


def _children(pid: int) -> list[int]:
    """Return the children that run Python code of their own: not the resource tracker of multiprocessing."""
    found = []
    for thread in Path(f"/proc/{pid}/task").iterdir():
        for child in (thread / "children").read_text().split():
            if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes():
                found.append(int(child))
    return found


def wait_until(true: Callable[[], bool]) -> None:
    end = time.monotonic() + _SOON
    while not true():
        assert time.monotonic() < end
        time.sleep(0.05)
