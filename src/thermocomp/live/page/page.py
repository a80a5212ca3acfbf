"""The page beside the machine: how it is, as HTML and as JSON; buttons behind a token."""

import asyncio
import time
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Annotated, Literal

import jinja2
from fastapi import Depends, FastAPI, HTTPException, Request
from fastapi.responses import HTMLResponse, StreamingResponse
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer
from fastapi.staticfiles import StaticFiles
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from starlette.exceptions import HTTPException as AnyHTTPException

from thermocomp.core.exceptions import InputError
from thermocomp.core.shown import escape, shorten
from thermocomp.core.strictjson import parse_json
from thermocomp.live.loop import Service
from thermocomp.live.page.connections import Guarded
from thermocomp.live.page.doors import Door, Doorkeeper, Json, write_json
from thermocomp.live.page.snapshot import curves, snapshot
from thermocomp.runtime.state import Status

_HERE = Path(__file__).parent
#: time between two messages to a page that is open [s]
OFTEN = 0.5
#: pages that are open at once, at most
MOST_PAGES = 100


class PageOrder(BaseModel):
    """Request body of an order."""

    model_config = ConfigDict(extra="forbid", strict=True)
    target: Annotated[str, Field(max_length=200)]
    do: Literal["run", "hold", "shadow", "rezero", "roll back"]


class Streams:
    """The event streams that are open: all send the same messages, each made once.

    Parameters
    ----------
    service : Service
    settled : float
        A drift below this in ten minutes counts as settled [um].
    """

    def __init__(self, service: Service, settled: float) -> None:
        self._service, self._settled = service, settled
        self._open = dict[object, Guarded | None]()
        self._made, self._message = -OFTEN, b""

    async def messages(self, connection: Guarded | None) -> AsyncIterator[bytes]:
        """Return messages until the client is gone; at the bound whoever reads least makes room, or the oldest."""
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


def make_app(service: Service, token: str = "", settled: float = 1.0, hosts: tuple[str, ...] = ()) -> FastAPI:
    """Return the application that serves the page of a service.

    Parameters
    ----------
    service : Service
    token : str
        That orders want; empty: none are taken.
    settled : float
        A drift below this in ten minutes counts as settled [um].
    hosts : tuple of str
        Names by which it may be called, beside ``localhost`` and the addresses of this computer.
    """
    app = FastAPI(title="thermocomp", docs_url=None, redoc_url=None, default_response_class=Json)
    app.add_middleware(Door, names=hosts)
    app.mount("/static", StaticFiles(directory=_HERE / "static"))
    door, streams = Doorkeeper(token), Streams(service, settled)
    loader = jinja2.Environment(loader=jinja2.FileSystemLoader(_HERE / "templates"), autoescape=True)
    template = loader.get_template("live.html")

    @app.exception_handler(AnyHTTPException)
    async def refuse(_: Request, error: AnyHTTPException) -> Json:
        return Json({"detail": error.detail}, error.status_code, error.headers)

    def allowed(given: Annotated[HTTPAuthorizationCredentials | None, Depends(HTTPBearer(auto_error=False))]) -> None:
        door.check(given.credentials.strip() if given else "")

    @app.get("/")
    async def show() -> HTMLResponse:
        return HTMLResponse(template.render(targets=list(service.compensator.lines), orders=bool(token)))

    @app.get("/api/state")
    async def tell() -> Json:
        return Json(snapshot(service, settled))

    @app.get("/api/curves")
    async def draw() -> Json:
        return Json(curves(service))

    @app.get("/api/events")
    async def follow(request: Request) -> StreamingResponse:
        messages = streams.messages(getattr(request.state, "connection", None))
        return StreamingResponse(messages, media_type="text/event-stream", headers={"Cache-Control": "no-store"})

    @app.post("/api/order", dependencies=[Depends(allowed)])
    async def order(request: Request) -> Json:
        wanted = read_order(await request.body())
        if wanted.target not in service.compensator.lines:
            known = ", ".join(service.compensator.lines)
            raise HTTPException(404, f"no target is named {shorten(wanted.target, 80)}; there are {known}")
        try:
            why = give(service, wanted)
        except InputError as e:  # not now, such as before the first reading
            why = str(e)
        if why:
            raise HTTPException(409, why)
        return Json({"done": wanted.do, "target": wanted.target})

    return app


def read_order(body: bytes) -> PageOrder:
    """Return the order in the body of a request.

    Raises
    ------
    HTTPException
        It is no JSON in UTF-8 (400), or not such an order (422).
    """
    try:
        content = parse_json(body)
    except ValueError as e:
        raise HTTPException(400, f"body: want JSON in UTF-8: {escape(e, 200)}") from e
    try:
        return PageOrder.model_validate(content)
    except ValidationError as e:
        found = (f"{'.'.join(map(str, p['loc'])) or 'body'}: {p['msg']}" for p in e.errors(include_url=False))
        raise HTTPException(422, escape("; ".join(found), 400)) from e


def give(service: Service, wanted: PageOrder) -> str:
    """Carry an order out; return why not, or the empty string.

    Parameters
    ----------
    service : Service
    wanted : PageOrder
    """
    target = wanted.target
    if wanted.do == "rezero":
        service.rezero(target, "by hand, at the page")
    elif wanted.do == "roll back":
        return service.roll_back(target)
    elif wanted.do == "run":
        if refused := service.compensator.shadow.get(target):
            return f"it must not run: {refused.reason}"
        service.order(target, None)
    else:
        service.order(target, Status("holding" if wanted.do == "hold" else "shadow", "by hand, at the page"))
    return ""
