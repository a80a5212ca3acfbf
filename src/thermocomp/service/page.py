"""The page beside the machine: how it is, as HTML and as JSON; buttons behind a token."""

import asyncio
import hmac
import json
import time
from collections import deque
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Annotated, Any, Literal

import jinja2
from fastapi import Depends, FastAPI, HTTPException, Request, Response
from fastapi.responses import HTMLResponse, JSONResponse, StreamingResponse
from fastapi.staticfiles import StaticFiles
from pydantic import BaseModel, ConfigDict, Field
from starlette.middleware.trustedhost import TrustedHostMiddleware

from thermocomp.runtime.state import Status
from thermocomp.service.loop import Service
from thermocomp.service.snapshot import curves, snapshot

_HERE = Path(__file__).parent
#: time between two messages to a page that is open [s]
OFTEN = 0.5
#: pages that are open at once, at most
MOST_PAGES = 20
#: wrong tokens, and orders, within a minute, at most
MOST_WRONG, MOST_ORDERS = 5, 60
#: bytes of an order, at most
MOST_BYTES = 2_000
_LOCAL = ("127.0.0.1", "localhost", "::1")
_HEADERS = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' data:; style-src 'self' 'unsafe-inline'; "
    "frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
}


class Order(BaseModel):
    """What a button says."""

    model_config = ConfigDict(extra="forbid", strict=True)
    target: Annotated[str, Field(max_length=200)]
    do: Literal["run", "hold", "shadow", "rezero", "roll back"]


class Doorkeeper:
    """Who may give orders: those that have the token, and not too often.

    Parameters
    ----------
    token : str
        Empty: nobody may.
    """

    def __init__(self, token: str) -> None:
        self._token = token.encode()
        self._wrong, self._orders = deque[float](maxlen=MOST_WRONG), deque[float](maxlen=MOST_ORDERS)

    def check(self, given: str) -> None:
        """Let an order pass, or raise.

        Raises
        ------
        HTTPException
            403 there is no token, 429 too often, 401 the token is wrong.
        """
        if not self._token:
            raise HTTPException(403, "no token is configured: this page only shows ([page] token_file)")
        if _full(self._wrong):
            raise HTTPException(429, "too many wrong tokens: wait a minute")
        if not hmac.compare_digest(given.encode(), self._token):
            self._wrong.append(time.monotonic())
            raise HTTPException(401, "the token is wrong")
        if _full(self._orders):
            raise HTTPException(429, "too many orders: wait a minute")
        self._orders.append(time.monotonic())


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
        Names by which it may be called, beside those of this computer.
    """
    app = FastAPI(title="thermocomp", docs_url=None, redoc_url=None, openapi_url=None)
    # another site must not reach a page on this computer by a name of its own
    app.add_middleware(TrustedHostMiddleware, allowed_hosts=[*_LOCAL, *hosts])
    app.mount("/static", StaticFiles(directory=_HERE / "static"))
    door, open_pages = Doorkeeper(token), [0]
    loader = jinja2.Environment(loader=jinja2.FileSystemLoader(_HERE / "templates"), autoescape=True)
    template = loader.get_template("live.html")

    @app.middleware("http")
    async def guard(request: Request, answer: Any) -> Response:
        length = request.headers.get("content-length", "0")
        if not length.isdigit() or int(length) > MOST_BYTES or "transfer-encoding" in request.headers:
            return JSONResponse({"detail": f"at most {MOST_BYTES} bytes, with their length stated"}, 413)
        response: Response = await answer(request)
        response.headers.update(_HEADERS)
        return response

    def allowed(request: Request) -> None:
        scheme, _, given = request.headers.get("authorization", "").partition(" ")
        door.check(given.strip() if scheme.lower() == "bearer" else "")

    @app.get("/")
    async def show() -> HTMLResponse:
        return HTMLResponse(template.render(targets=list(service.compensator.lines), orders=bool(token)))

    @app.get("/api/state")
    async def tell() -> JSONResponse:
        return JSONResponse(_clean(snapshot(service, settled)))

    @app.get("/api/curves")
    async def draw() -> JSONResponse:
        return JSONResponse(_clean(curves(service)))

    @app.get("/api/events")
    async def follow(request: Request) -> StreamingResponse:
        if open_pages[0] >= MOST_PAGES:
            raise HTTPException(503, f"{MOST_PAGES} pages are open: close one")

        async def messages() -> AsyncIterator[str]:
            open_pages[0] += 1
            try:
                while not await request.is_disconnected():
                    state = _clean(snapshot(service, settled))
                    point = _clean(service.curves[-1]) if service.curves else {}
                    yield f"data: {json.dumps({'state': state, 'point': point}, allow_nan=False)}\n\n"
                    await asyncio.sleep(OFTEN)
            finally:
                open_pages[0] -= 1

        return StreamingResponse(messages(), media_type="text/event-stream", headers={"Cache-Control": "no-store"})

    @app.post("/api/order", dependencies=[Depends(allowed)])
    async def order(wanted: Order) -> JSONResponse:
        if wanted.target not in service.compensator.lines:
            known = ", ".join(service.compensator.lines)
            raise HTTPException(404, f"no target is named {wanted.target}; there are {known}")
        if why := give(service, wanted):
            raise HTTPException(409, why)
        return JSONResponse({"done": wanted.do, "target": wanted.target})

    return app


def give(service: Service, wanted: Order) -> str:
    """Carry an order out; return why not, or the empty string.

    Parameters
    ----------
    service : Service
    wanted : Order
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


def _full(times: "deque[float]") -> bool:
    return len(times) == times.maxlen and time.monotonic() - times[0] < 60.0


def _clean(value: Any) -> Any:
    """Return it without numbers that JSON has not got."""
    if isinstance(value, dict):
        return {k: _clean(v) for k, v in value.items()}
    if isinstance(value, list):
        return [_clean(v) for v in value]
    return None if isinstance(value, float) and not abs(value) < float("inf") else value
