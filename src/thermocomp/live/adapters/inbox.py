"""Messages that wait to be processed: only the newest value of each channel, so that a slow machine uses fresh ones."""

import asyncio
import time
from collections import deque
from contextlib import suppress

from thermocomp.core.reading import Reading

#: maximum number of values that wait
MOST = 100_000
#: event-loop rounds without a new message after which all messages that have arrived are known; one message takes three
ROUNDS = 4
#: maximum time for which messages are collected before they are processed [s]
LONGEST = 0.05
#: time since all messages that had arrived were known, up to which one that is read counts as just arrived [s]
LATE = 1.0


class Inbox:
    """Readings that have arrived and are not processed yet."""

    def __init__(self) -> None:
        self._waiting = deque[Reading]()
        self._values = 0  # in the waiting readings
        self._news = asyncio.Event()
        self._arrived = 0
        self.replaced = 0  #: number of values that were not processed, because there was a newer one or no room
        self._emptied = time.monotonic()  # when all that had arrived were known
        self.closed = False  #: no further reading can arrive

    def arrival(self) -> float:
        """Return when a message that is read now has arrived; the earliest time if others have waited before it [s]."""
        late = time.monotonic() - self._emptied
        return time.time() - (late if late > LATE else 0.0)

    def put(self, reading: Reading) -> None:
        """Add a reading; if there are too many values, the oldest readings are dropped."""
        self._arrived += 1
        self._waiting.append(reading)
        self._values += len(reading.values)
        while self._values > MOST:
            oldest = self._waiting.popleft()
            self._values -= len(oldest.values)
            self.replaced += len(oldest.values)
        self._news.set()

    def close(self) -> None:
        """End the wait for readings."""
        self.closed = True
        self._news.set()

    async def take(self) -> list[Reading]:
        """Wait for readings and collect all that have arrived; return the newest value of each channel.

        Returns
        -------
        list of Reading
            One for each time, the oldest first.
        """
        while not self._news.is_set():
            self._emptied = time.monotonic()
            with suppress(TimeoutError):
                async with asyncio.timeout(LATE / 2.0):
                    await self._news.wait()
        loop, quiet = asyncio.get_running_loop(), 0
        end = loop.time() + LONGEST
        while quiet < ROUNDS and loop.time() < end:
            before = self._arrived
            await asyncio.sleep(0)
            quiet = quiet + 1 if self._arrived == before else 0
        if quiet == ROUNDS:
            self._emptied = time.monotonic()
        if not self.closed:
            self._news.clear()
        newest: dict[str, tuple[float, float]] = {}
        for reading in self._waiting:
            for name, value in reading.values.items():
                if name not in newest or newest[name][0] <= reading.time:
                    newest[name] = reading.time, value
        self.replaced += self._values - len(newest)
        self._waiting.clear()
        self._values = 0
        by_time: dict[float, dict[str, float]] = {}
        for name, (at, value) in newest.items():
            by_time.setdefault(at, {})[name] = value
        return [Reading(at, values) for at, values in sorted(by_time.items())]
