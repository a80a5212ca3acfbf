"""Processes of `thermocomp.app.worker`: one per task, started ahead so that a task does not wait for imports."""

import asyncio
import json
import sys
from asyncio.subprocess import PIPE, Process
from collections.abc import Mapping
from contextlib import nullcontext
from typing import Any

from thermocomp.core.exceptions import InputError

#: longest time for a task [s]
PATIENCE = 120.0


class Workers:
    """Source of processes, one of which is always ahead."""

    def __init__(self) -> None:
        self._ahead: asyncio.Task[Process] | None = None
        self._reading = asyncio.Lock()  # one file at a time: each may need most of the memory that is meant for all

    def warm_up(self) -> None:
        """Start the process for the next task."""
        if self._ahead is None:
            self._ahead = asyncio.create_task(_start())

    async def close(self) -> None:
        """End the process that is ahead."""
        if self._ahead is not None:
            process, self._ahead = await self._ahead, None
            process.kill()
            await process.communicate()

    async def ask(self, task: Mapping[str, Any]) -> dict[str, Any]:
        """Return the result of a task.

        Raises
        ------
        InputError
            The task was refused, took too long, or its process ended without a result.
        """
        async with self._reading if "file" in task else nullcontext():
            self.warm_up()
            started, self._ahead = self._ahead, None
            assert started is not None
            process = await started
            self.warm_up()
            try:
                out, said = await asyncio.wait_for(process.communicate(json.dumps(task).encode()), PATIENCE)
            except TimeoutError as e:
                raise InputError(f"reading took more than {PATIENCE:g} s; give a smaller file") from e
            finally:
                if process.returncode is None:
                    process.kill()
                    await process.wait()
        try:
            found: dict[str, Any] = json.loads(out)
        except ValueError as e:
            last = said.decode(errors="replace").strip().rpartition("\n")[2]
            raise InputError(f"the file could not be read: {last or 'the process ended without a word'}") from e
        if "refused" in found:
            raise InputError(found["refused"])
        return found


async def _start() -> Process:
    # a process whose server ends finds the end of its input, and ends too
    return await asyncio.create_subprocess_exec(
        sys.executable, "-m", "thermocomp.app.worker", stdin=PIPE, stdout=PIPE, stderr=PIPE
    )
