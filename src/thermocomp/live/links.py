"""Links of the service: each source and each sink in a separate task, reconnected after a loss.

An exception of a source or a sink affects only its own link: the other links and the service continue.
"""

import asyncio
import contextlib
import time
from collections import deque
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator, Mapping
from typing import Any, TypeVar

from thermocomp.core.correction import Correction
from thermocomp.core.exceptions import ThermocompError
from thermocomp.core.ports import Confirming, Informing, LinkStatus, Probe, Sink, Source, TargetStatus
from thermocomp.core.reading import Measurement, Reading
from thermocomp.core.shown import escape

_Said = TypeVar("_Said", Reading, Measurement)

#: maximum time to connect, or for a sink to answer, before the link has failed [s]
TIMEOUT = 5.0
#: time between two connection attempts: initial and maximum [s]
FIRST, LONGEST = 0.5, 30.0
#: interval at which a sink is asked for the correction in force [s]
OFTEN = 2.0
#: minimum time between two events about refused messages of a link, or about invalid time stamps [s]
SELDOM = 60.0


class Link:
    """Connection of one source, probe or sink."""

    def __init__(self, end: Source | Probe | Sink) -> None:
        self.end = end
        self.trouble = ""  #: reason of the last loss, until connected again
        self._wait, self._told, self._refused = FIRST, "", (0, -SELDOM)
        self._last_refused = 0, -SELDOM
        self._losses = deque[str](maxlen=2)  # losses still to be reported: one may be shorter than the polling interval

    ended = False  #: a source has been played to its end

    async def run(self) -> None:
        """Connect and work indefinitely, or until a source has been played to its end."""
        task = asyncio.current_task()
        while True:
            try:
                async with asyncio.timeout(2 * TIMEOUT):
                    await self.end.connect(TIMEOUT)
                self.trouble = ""
                await self._work()
                if self.end.status().state == "closed":
                    self.ended = True
                    return
                self.trouble = "ended"
            except asyncio.CancelledError:
                if task is None or task.cancelling():
                    raise
                self.trouble = "cancelled unexpectedly"
            except Exception as e:  # noqa: BLE001 - the other links continue after any exception
                self.trouble = explain(e)
            if self.trouble != self._told:
                self._losses.append(self.trouble)
                self._told = self.trouble
            await self._lose()
            await asyncio.sleep(self._wait)
            self._wait = min(2 * self._wait, LONGEST)

    def status(self) -> LinkStatus:
        """Return the status; the reason for a loss is kept until the link is connected again."""
        if self.trouble:
            return LinkStatus("failed", self.trouble)
        try:
            return self.end.status()
        except Exception as e:  # noqa: BLE001 - displayed as the status
            return LinkStatus("failed", explain(e))

    @property
    def name(self) -> str:
        """Kind of source or sink, with its topic or path."""
        where = getattr(self.end, "topic", None) or getattr(self.end, "path", None)
        return self.kind + (f" {where}" if where else "")

    @property
    def kind(self) -> str:
        """Kind of source or sink: the attribute ``label`` of its class, or the name of the class."""
        return str(getattr(self.end, "label", type(self.end).__name__))

    @property
    def refusing(self) -> str:
        """Reason why messages of the last minute were refused; empty if none was."""
        since, reason = time.monotonic() - self._last_refused[1], getattr(self.end, "last_refusal", "")
        return f"messages are refused: {reason}" if since < SELDOM else ""

    def news(self) -> Iterator[str]:
        """Yield the events since the last call: connection lost, connected again, messages refused."""
        name = self.name
        while self._losses:
            yield f"{name}: {self._losses.popleft()}"
        if self._told and not self.trouble:
            self._told = ""
            yield f"{name}: connected again"
        (told, at), now = self._refused, time.monotonic()
        if (refused := getattr(self.end, "refused", 0)) > self._last_refused[0]:
            self._last_refused = (refused, now)
        if refused > told and now - at >= SELDOM:
            self._refused = (refused, now)
            yield f"{name}: {refused} messages refused; the last: {getattr(self.end, 'last_refusal', '')}"

    async def _work(self) -> None:
        raise NotImplementedError

    async def _lose(self) -> None:
        """Clean up after the connection was lost; each kind of link defines what this means."""


class Inlet(Link):
    """Link of a source or a probe.

    Parameters
    ----------
    said : callable
        Returns the readings or measurements of the source or probe.
    take : callable
        Called with each of them.
    """

    def __init__(
        self, source: Source | Probe, said: Callable[[], AsyncIterator[_Said]], take: Callable[[_Said], None]
    ) -> None:
        super().__init__(source)

        async def work() -> None:
            async for one in said():
                take(one)
                self._wait = FIRST

        self._work = work  # type: ignore[method-assign]

    async def _lose(self) -> None:
        await within(TIMEOUT, self.end.close())


class Outlet(Link):
    """Link of a sink, which gets the newest corrections as fast as it accepts them.

    Parameters
    ----------
    heard : callable, optional
        Called with the corrections in force, if the sink confirms them.
    """

    def __init__(self, sink: Sink, heard: Callable[[Sink, Mapping[str, Correction]], None] | None = None) -> None:
        super().__init__(sink)
        self.sink = sink
        self.heard = heard
        self._newest: dict[str, Correction] = {}
        self._news = asyncio.Event()

    def receives(self, target: str) -> bool:
        """Return whether the sink receives the corrections of a target."""
        return target in getattr(self.sink, "axes", (target,))

    def put(self, corrections: Mapping[str, Correction], statuses: Mapping[str, TargetStatus] | None = None) -> None:
        """Hand over corrections and statuses without blocking; corrections still waiting are replaced."""
        self._newest = dict(corrections)
        if statuses is not None and isinstance(self.sink, Informing):
            self.sink.inform(statuses)
        self._news.set()

    async def flush(self) -> None:
        """Apply the last corrections handed over, if any; otherwise those in force are kept."""
        if self._newest:
            await within(TIMEOUT, self.sink.apply(self._newest))

    async def _work(self) -> None:
        task = asyncio.current_task()
        while True:
            if task is not None and task.cancelling():  # `asyncio.wait_for` of Python 3.11 may lose a cancellation
                raise asyncio.CancelledError
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(OFTEN):
                    await self._news.wait()
            if (link := self.end.status()).state == "failed":  # found by the sink itself, with nothing to send
                raise ThermocompError(link.reason)
            newest = self._newest if self._news.is_set() else {}
            self._news.clear()
            async with asyncio.timeout(TIMEOUT):
                if newest:  # nothing to send before the first reading
                    await self.sink.apply(newest)
                if self.heard is not None and isinstance(self.sink, Confirming):
                    self.heard(self.sink, await self.sink.confirmed() or {})
            self._wait = FIRST

    async def _lose(self) -> None:
        self._news.set()  # corrections that were lost are applied after reconnection


def explain(error: Exception) -> str:
    """Return the reason why a link does not work, as text."""
    if isinstance(error, TimeoutError) and not str(error):
        return "no answer in time"
    known = isinstance(error, ThermocompError | OSError) and str(error)
    return escape(error if known else f"unexpected {type(error).__name__}: {error}", 400)


async def within(seconds: float, work: Coroutine[Any, Any, None]) -> None:
    """Await a coroutine with a time limit; exceptions and cancellation are ignored."""
    task = asyncio.create_task(work)
    task.add_done_callback(lambda done: done.cancelled() or done.exception())
    try:
        await asyncio.wait({task}, timeout=seconds)
    finally:
        task.cancel()
