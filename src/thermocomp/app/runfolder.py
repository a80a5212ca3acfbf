"""Folder of one run of a project: its results, and its state in ``run.json``; readable without the training code."""

import json
import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

from thermocomp.core.alone import alone
from thermocomp.core.exceptions import InputError
from thermocomp.files.draft import write_text

State = Literal["running", "done", "stopped", "failed"]
#: a running job writes its state at least this often; one silent for `SILENT` was killed [s]
BEAT, SILENT = 2.0, 15.0
_STOP = "stop"
#: tables of the project file that determine the models, and with that the run
LEARNED = ("recordings", "join", "compare", "limits", "fit")


@dataclass(frozen=True, kw_only=True)
class RunStep:
    """A finished step of a run.

    Parameters
    ----------
    files : list of str
        Files written, relative to the folder of the run.
    text : str
        The result in a sentence or two.
    key : str
        Key of the settings that only this step depends on.
    error : str
        Reason why it could not be done; the steps that do not depend on it were done.
    """

    name: str
    seconds: float
    files: list[str]
    text: str
    key: str = ""
    error: str = ""


@dataclass
class RunState:
    """Content of ``run.json``.

    Parameters
    ----------
    fingerprint : str
        See `thermocomp.app.project.Project.fingerprint`.
    step : str
        Current step.
    done, total : int
        Completed and total tasks of the current step; 0 where unknown.
    error : str
        Reason of a failure.
    """

    fingerprint: str = ""
    version: str = ""
    began: str = ""
    ended: str = ""
    seen: float = 0.0
    state: State = "running"
    step: str = ""
    task: str = ""
    done: int = 0
    total: int = 0
    step_began: float = 0.0
    steps: list[RunStep] = field(default_factory=list)
    error: str = ""


class RunFolder:
    """Folder of one run.

    Parameters
    ----------
    path : Path
        ``runs/NUMBER`` in the folder of the project.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.number = int(path.name)
        self.state = RunState()
        self._guard = threading.Lock()

    def read(self) -> dict[str, Any]:
        """Return the state for a page: a run that has been silent for too long counts as stopped."""
        try:
            found: dict[str, Any] = json.loads((self.path / "run.json").read_text(encoding="utf-8"))
        except (OSError, ValueError):  # created, and killed before the first state
            found = asdict(RunState(state="stopped"))
        if found["state"] == "running" and abs(time.time() - found["seen"]) > SILENT:
            found |= {"state": "stopped", "error": "the process ended without a word; start it again to continue"}
        return {"number": self.number, **found}

    def take_up(self) -> None:
        """Continue with the state of an earlier process: finished steps are kept.

        Raises
        ------
        InputError
            The run is going on in another process.
        """
        found = self.read()
        if found["state"] == "running":
            raise InputError(f"{self.path}: this run is going on in another process; stop that one first")
        steps = [RunStep(**s) for s in found["steps"]]
        self.state = RunState(
            fingerprint=found["fingerprint"], version=found["version"], began=found["began"], steps=steps
        )

    def errors(self) -> list[str]:
        """Return why steps after the fit could not be done."""
        return [f"{step['name']}: {step['error']}" for step in self.read()["steps"] if step.get("error")]

    def save(self) -> None:
        """Write the state."""
        with self._guard:
            self.state.seen = time.time()
            write_text(json.dumps(asdict(self.state), ensure_ascii=False), self.path / "run.json", overwrite=True)

    def ask_to_stop(self) -> None:
        """Ask the process of the run to stop; what its current step has finished is kept where the step allows it."""
        (self.path / _STOP).touch()

    @contextmanager
    def working(self) -> Iterator[None]:
        """Write the state regularly, obey `ask_to_stop`, and write how the work ended; for one process at a time."""
        with alone(self.path / "run.json"), self._beating():
            yield

    @contextmanager
    def _beating(self) -> Iterator[None]:
        (self.path / _STOP).unlink(missing_ok=True)
        ended = threading.Event()
        self.state.state, self.state.error = "running", ""
        self.state.began = self.state.began or _now()
        self.save()

        def beat() -> None:
            while not ended.wait(BEAT / 4 if (self.path / _STOP).exists() else BEAT):
                if (self.path / _STOP).exists():
                    (self.path / _STOP).unlink(missing_ok=True)
                    _interrupt()
                with suppress(OSError, InputError):  # a full disk must not end the work
                    self.save()

        thread = threading.Thread(target=beat, daemon=True)
        thread.start()
        # a process that was started in the background inherits that interrupts are ignored
        main = threading.current_thread() is threading.main_thread()
        ignored = main and signal.getsignal(signal.SIGINT) is signal.SIG_IGN
        if ignored:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        try:
            yield
            self.state.state = "done"
        except KeyboardInterrupt:
            self.state.state = "stopped"
            raise
        except BaseException as e:
            self.state.state, self.state.error = "failed", str(e) or type(e).__name__
            raise
        finally:
            ended.set()
            thread.join()
            if ignored:
                signal.signal(signal.SIGINT, signal.SIG_IGN)
            self.state.ended = _now()
            self.save()


def runs_of(folder: Path) -> list[RunFolder]:
    """Return the runs of a project, the oldest first."""
    with suppress(OSError):
        found = [p for p in (folder / "runs").iterdir() if p.is_dir() and p.name.isascii() and p.name.isdigit()]
        return [RunFolder(p) for p in sorted(found, key=lambda p: int(p.name))]
    return []


def new_run(folder: Path) -> RunFolder:
    """Create the folder of the next run."""
    (folder / "runs").mkdir(exist_ok=True)
    number = max((r.number for r in runs_of(folder)), default=0) + 1
    while True:
        try:
            (folder / "runs" / str(number)).mkdir()
        except FileExistsError:  # another process was faster
            number += 1
        else:
            return RunFolder(folder / "runs" / str(number))


def _interrupt() -> None:
    """Interrupt the main thread, also while it waits for other processes."""
    if os.name == "posix":
        os.kill(os.getpid(), signal.SIGINT)
    else:
        signal.raise_signal(signal.SIGINT)


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
