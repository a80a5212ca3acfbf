"""Status of the service: the page, the same as JSON, the curves and the event stream."""

import asyncio
import time
from collections.abc import AsyncIterator
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse, StreamingResponse

from thermocomp.live.loop import Service
from thermocomp.live.page.answers import Number, StateAnswer, describe
from thermocomp.live.page.connections import Guarded
from thermocomp.live.page.doors import Json, write_json
from thermocomp.live.page.pages import Board, read_template
from thermocomp.live.page.snapshot import curves, snapshot

#: time between two messages to an open page [s]
OFTEN = 0.5
#: maximum number of pages open at once
MOST_PAGES = 100

_SAYS = "each message is JSON: the state as of /api/state, and the last point of the curves"
_STREAM: dict[int | str, dict[str, Any]] = {
    200: {
        "description": f"events, twice a second; {_SAYS}",
        "content": {"text/event-stream": {"schema": {"type": "string"}}},
    }
}


class Streams:
    """Open event streams: all send the same messages, each created once.

    Parameters
    ----------
    settled : float
        A drift below this in ten minutes counts as settled [um].
    """

    def __init__(self, service: Service, settled: float) -> None:
        self._service, self._settled = service, settled
        self._open = dict[object, Guarded | None]()
        self._made, self._message = -OFTEN, b""

    async def messages(self, connection: Guarded | None) -> AsyncIterator[bytes]:
        """Return messages until the client disconnects; at the limit the slowest reader, or the oldest, is closed."""
        if len(self._open) >= MOST_PAGES:
            last = max(self._open, key=lambda k: c.unsent if (c := self._open[k]) else 0)
            if (lost := self._open.pop(last)) is not None:
                lost.drop()
        place = object()
        self._open[place] = connection
        try:
            while place in self._open:
                yield self._latest()
                await asyncio.sleep(OFTEN)
        finally:
            self._open.pop(place, None)

    def _latest(self) -> bytes:
        if (now := time.monotonic()) - self._made >= OFTEN / 2:
            state = snapshot(self._service, self._settled)
            point = self._service.curves[-1] if self._service.curves else {}
            self._made, self._message = now, b"data: " + write_json({"state": state, "point": point}) + b"\n\n"
        return self._message


def make_router(board: Board) -> APIRouter:
    """Return the router of ``/``, ``/api/state``, ``/api/curves`` and ``/api/events``."""
    router, service, template = APIRouter(), board.service, read_template("live.html")
    streams = Streams(service, board.settled)

    @router.get("/", response_class=HTMLResponse)
    async def show() -> HTMLResponse:
        return HTMLResponse(template.render(targets=list(service.compensator.lines), orders=bool(board.token)))

    @router.get("/api/state", responses=describe(403, answer=StateAnswer))
    async def tell() -> Json:
        return Json(snapshot(service, board.settled))

    @router.get("/api/curves", responses=describe(403, answer=dict[str, list[Number]]))
    async def draw() -> Json:
        return Json(curves(service))

    @router.get("/api/events", response_class=StreamingResponse, responses=describe(403) | _STREAM)
    async def follow(request: Request) -> StreamingResponse:
        messages = streams.messages(getattr(request.state, "connection", None))
        return StreamingResponse(messages, media_type="text/event-stream", headers={"Cache-Control": "no-store"})

    return router
