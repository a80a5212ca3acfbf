"""Connections to the page: bounded in number, and closed when they are idle or do not read what they asked for."""

import asyncio
import time
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

#: connections at once, at most: at one more, an idle one is closed
MOST = 200
#: a request is complete so long after the connection, or after the last answer, or the connection is closed [s]
PATIENCE = 10.0
#: an answer is read to its end for a moment within this time, or the connection is closed [s]
STUCK = 10.0


class Guarded(H11Protocol):
    """An HTTP connection that can be closed for others; uvicorn makes one for each client.

    uvicorn itself bounds only how long it waits between two requests: half a request may wait for ever there, an answer
    that nobody reads too, and at its bound (``limit_concurrency``) idle connections keep everybody else out.

    Parameters
    ----------
    config, server_state, app_state, _loop
        As for uvicorn.
    """

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin; at the bound another one goes, an idle one if there is one.

        Parameters
        ----------
        transport : asyncio.BaseTransport
        """
        super().connection_made(transport)  # type: ignore[arg-type]
        self._since, self._stuck, self._served = time.monotonic(), 0.0, False
        self.app_state: dict[str, Any] = {**self.app_state, "connection": self}
        others = [c for c in self.connections if isinstance(c, Guarded) and c is not self]
        if len(others) >= MOST:
            min(others, key=Guarded._rank).drop()

    def on_response_complete(self) -> None:
        """Wait for the next request."""
        self._since, self._served = time.monotonic(), True
        super().on_response_complete()

    @property
    def unsent(self) -> int:
        """Bytes of an answer that the system does not take yet: it holds enough that was not read."""
        return self.transport.get_write_buffer_size()

    def drop(self) -> None:
        """Close at once, without what was not sent."""
        self.connections.discard(self)
        self.transport.abort()

    def look(self, now: float) -> None:
        """Close if it has been idle, or has not read, for too long; call it about once a second.

        Parameters
        ----------
        now : float
            On the monotone clock [s].
        """
        self._stuck = (self._stuck or now) if self.unsent else 0.0
        if (self._waits() and now - self._since > PATIENCE) or (self._stuck and now - self._stuck > STUCK):
            self.drop()

    def _waits(self) -> bool:
        """Return whether the client must send something next: there is no request, or it is incomplete."""
        return self.cycle is None or self.cycle.response_complete or self.cycle.more_body

    def _rank(self) -> tuple[bool, bool, bool, float]:
        """Return the sort key for precedence: idle before stuck before busy, never served before served, by age."""
        return not self._waits(), not self.unsent, self._served, self._since
