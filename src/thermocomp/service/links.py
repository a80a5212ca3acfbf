"""Links of the service: each source and each sink in a task of its own, connected anew when it is lost."""

import asyncio
import contextlib
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from typing import TypeVar

from thermocomp.core.correction import Correction
from thermocomp.core.exceptions import ThermocompError
from thermocomp.core.ports import Confirming, Probe, Sink, Source
from thermocomp.core.reading import Measurement, Reading

_Said = TypeVar("_Said", Reading, Measurement)

#: a connection that takes longer, or a sink that does not answer for so long, has failed [s]
TIMEOUT = 5.0
#: between two attempts: at first, and at most [s]
FIRST, LONGEST = 0.5, 30.0
#: a sink is asked what is in force at least so often [s]
OFTEN = 2.0


async def read_from(
    source: Source | Probe, said: Callable[[], AsyncIterator[_Said]], take: Callable[[_Said], None]
) -> None:
    """Take what a source says for ever; one that is played to its end stays closed.

    Parameters
    ----------
    source : Source or Probe
    said : callable
        Its readings, or measurements.
    take : callable
        Called with each of them.
    """
    wait = FIRST
    while True:
        try:
            await source.connect(TIMEOUT)
            async for one in said():
                take(one)
                wait = FIRST
            if source.status().state == "closed":
                return
        except (ThermocompError, OSError):
            pass  # its status says why
        finally:
            with contextlib.suppress(ThermocompError, OSError):
                if source.status().state != "closed":
                    await source.close()
        await asyncio.sleep(wait)
        wait = min(2 * wait, LONGEST)


class Outlet:
    """A sink that gets the newest corrections, as fast as it takes them.

    Parameters
    ----------
    sink : Sink
    heard : callable, optional
        Called with what the sink confirms to be in force, if it does.
    """

    def __init__(self, sink: Sink, heard: Callable[[Sink, Mapping[str, Correction]], None] | None = None) -> None:
        self.sink = sink
        self.heard = heard
        self._newest: dict[str, Correction] = {}
        self._news = asyncio.Event()

    def put(self, corrections: Mapping[str, Correction]) -> None:
        """Hand corrections over, at once; what was not taken yet is replaced."""
        self._newest = dict(corrections)
        self._news.set()

    async def run(self) -> None:
        """Apply what is put, for ever."""
        wait = FIRST
        while True:
            try:
                await self.sink.connect(TIMEOUT)
                while True:
                    with contextlib.suppress(TimeoutError):
                        async with asyncio.timeout(OFTEN):
                            await self._news.wait()
                    newest = self._newest if self._news.is_set() else {}
                    self._news.clear()
                    async with asyncio.timeout(TIMEOUT):
                        if newest:  # before the first reading there is nothing to say
                            await self.sink.apply(newest)
                        await self._confirm()
                    wait = FIRST
            except (ThermocompError, OSError, TimeoutError, ValueError, RuntimeError):
                self._news.set()  # what was lost is applied after the next connection
            await asyncio.sleep(wait)
            wait = min(2 * wait, LONGEST)

    async def _confirm(self) -> None:
        if self.heard is not None and isinstance(self.sink, Confirming):
            in_force = await self.sink.confirmed()
            self.heard(self.sink, in_force or {})

    async def flush(self) -> None:
        """Apply what was put last, if the sink is there; what is in force stays if nothing was."""
        if not self._newest:
            return
        with contextlib.suppress(ThermocompError, OSError, TimeoutError, ValueError, RuntimeError):
            async with asyncio.timeout(TIMEOUT):
                await self.sink.apply(self._newest)


async def within(seconds: float, work: Awaitable[None]) -> None:
    """Do something that may fail or take too long, without waiting for ever."""
    with contextlib.suppress(ThermocompError, OSError, TimeoutError):
        async with asyncio.timeout(seconds):
            await work
