"""Trial of the models of a run: the live page in shadow, with a replay of a recording as its source.

It is a process of its own, which ends with the server, because the end of the server is the end of its input.
"""

import asyncio
import os
import signal
import sys
import threading
from asyncio.subprocess import PIPE, Process
from contextlib import suppress
from pathlib import Path

from thermocomp.app.runfolder import RunFolder
from thermocomp.core.exceptions import InputError

#: longest time from the start to the address of the live page [s]
PATIENCE = 120.0
#: age at which a reading is stale [s], and as a multiple of the recording's interval: the larger
AGE, INTERVALS = 60.0, 3.0
#: the recording is replayed this many times faster than it was recorded
SPEED = 60
_ADDRESS = b"Page: "
_CONFIG = """\
# Trial of the models of this run, in shadow: a recording of the project is replayed.
models = ["../model.json"]
shadow = true
speed = {speed}.0
first_start = "zero"

[limits]
reading_age = {age:.0f}.0

[[sources]]
kind = "replay"
file = "replay.csv"

[[sinks]]
kind = "file"
file = "corrections.json"

[page]
port = 0
"""


class LiveTrial:
    """At most one trial at a time."""

    def __init__(self) -> None:
        self._process: Process | None = None
        self._address, self._number = "", 0
        self._one = asyncio.Lock()

    def tell(self) -> dict[str, object]:
        """Return the run that is tried, and the address of its live page; empty if there is none."""
        goes_on = self._process is not None and self._process.returncode is None
        return {"run": self._number, "address": self._address} if goes_on and self._address else {}

    async def start(self, run: RunFolder) -> None:
        """Start a trial; another one ends.

        Raises
        ------
        InputError
            The live page has not started; with the reason.
        """
        async with self._one:
            await self._end()
            words = [sys.executable, "-u", "-m", "thermocomp.app.livetrial", str(run.path.resolve())]
            log = run.path / "trial.log"
            with log.open("wb") as said:
                process = await asyncio.create_subprocess_exec(*words, stdin=PIPE, stdout=PIPE, stderr=said)
            self._process, self._number = process, run.number
            try:
                self._address = await asyncio.wait_for(_find_address(process), PATIENCE)
            except (TimeoutError, EOFError) as e:
                await self._end()
                last = log.read_text(encoding="utf-8", errors="replace").strip().rpartition("\n")[2]
                raise InputError(f"the live page has not started: {last or 'it took too long'}") from e

    async def stop(self) -> None:
        """End the trial."""
        async with self._one:
            await self._end()

    async def _end(self) -> None:
        process, self._process, self._address = self._process, None, ""
        if process is not None:
            with suppress(ProcessLookupError):  # it has ended
                process.kill()
            await process.wait()


async def _find_address(process: Process) -> str:
    assert process.stdout is not None
    async for line in process.stdout:
        if line.startswith(_ADDRESS):
            return line.removeprefix(_ADDRESS).decode().strip()
    raise EOFError


def main() -> None:
    """Serve the live page of a run's folder until the input ends."""
    from thermocomp.api.inputs import read
    from thermocomp.app.project import settings_of
    from thermocomp.app.store import NAME, find_inside
    from thermocomp.files.draft import write_text
    from thermocomp.files.tomlfile import read_toml
    from thermocomp.live.commands.serve import serve
    from thermocomp.recordings.readers.recordings import write

    threading.Thread(target=_end_with_server, daemon=True).start()
    folder = Path(sys.argv[1])
    project, trial, joined = folder.parent.parent, folder / "trial", folder / "joined.parquet"
    try:
        first = settings_of(read_toml(folder / NAME, "project file"), folder / NAME).recordings[0]
        file, mapping = find_inside(project, first.file), first.mapping and find_inside(project, first.mapping)
        recording = read(joined) if joined.exists() else read(file, mapping or None)
        trial.mkdir(exist_ok=True)
        write(recording, trial / "replay.csv", overwrite=True)
        age = max(AGE, INTERVALS * recording.sampling_interval)
        write_text(_CONFIG.format(speed=SPEED, age=age), trial / "live.toml", overwrite=True)
        sys.exit(serve(trial / "live.toml"))
    except (InputError, OSError) as e:
        sys.exit(str(e))


def _end_with_server() -> None:
    while os.read(0, 1024):  # not sys.stdin: its lock would be held when the interpreter ends
        pass
    os.kill(os.getpid(), signal.SIGTERM)


if __name__ == "__main__":
    main()
