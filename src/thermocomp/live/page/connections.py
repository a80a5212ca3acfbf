"""Connections to the page: limited in number, and closed if they are idle or their client does not read."""

import asyncio
import time
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

#: maximum number of simultaneous connections: one more closes an idle one
MOST = 200
#: maximum time for a complete request after connecting or after the last answer [s]
PATIENCE = 10.0
#: maximum time during which part of an answer stays unread [s]
STUCK = 10.0


class Guarded(H11Protocol):
    """An HTTP connection that can be closed in favour of others; uvicorn creates one for each client.

    uvicorn itself limits only the idle time between two requests: an incomplete request may wait indefinitely, as may
    an unread answer, and at its limit (``limit_concurrency``) idle connections lock out all other clients.

    Parameters
    ----------
    config, server_state, app_state, _loop
        See uvicorn.
    """

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Accept the connection; at the limit another one is closed, preferably an idle one."""
        super().connection_made(transport)  # type: ignore[arg-type]
        self._since, self._stuck, self._served = time.monotonic(), 0.0, False
        self.app_state: dict[str, Any] = {**self.app_state, "connection": self}
        others = [c for c in self.connections if isinstance(c, Guarded) and c is not self]
        if len(others) >= MOST:
            min(others, key=Guarded._rank).drop()

    def on_response_complete(self) -> None:
        """Note that the answer is complete and the client may send the next request."""
        self._since, self._served = time.monotonic(), True
        super().on_response_complete()

    def heard(self) -> None:
        """Note that part of a long request has arrived: it may go on."""
        self._since = time.monotonic()

    @property
    def unsent(self) -> int:
        """Number of answer bytes not accepted by the system, which already buffers unread data."""
        return self.transport.get_write_buffer_size()

    def drop(self) -> None:
        """Close the connection immediately and discard unsent data."""
        self.connections.discard(self)
        self.transport.abort()

    def look(self, now: float) -> None:
        """Close the connection if it has been idle, or its data unread, for too long; to be called about once a second.

        Parameters
        ----------
        now : float
            Monotonic clock [s].
        """
        self._stuck = (self._stuck or now) if self.unsent else 0.0
        if (self._waits() and now - self._since > PATIENCE) or (self._stuck and now - self._stuck > STUCK):
            self.drop()

    def _waits(self) -> bool:
        """Return whether the client must send next: there is no request, or it is incomplete."""
        return self.cycle is None or self.cycle.response_complete or self.cycle.more_body

    def _rank(self) -> tuple[bool, bool, bool, float]:
        """Return the sort key for closing: idle before stuck before busy, never served before served, oldest first."""
        return not self._waits(), not self.unsent, self._served, self._since
