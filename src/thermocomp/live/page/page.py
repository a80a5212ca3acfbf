"""Web application of the page, composed of routers."""

from collections.abc import Collection
from pathlib import Path

from fastapi import FastAPI, Request
from fastapi.staticfiles import StaticFiles
from starlette.exceptions import HTTPException as AnyHTTPException

from thermocomp.core.exceptions import InputError
from thermocomp.core.plugins import describe_plugin, find_plugins, load_plugin
from thermocomp.live.loop import Service
from thermocomp.live.page.doors import Door, Json, declare_types
from thermocomp.live.page.pages import Board, MakeRouter

_STATIC = Path(__file__).parent / "static"


def make_app(
    service: Service, token: str = "", settled: float = 1.0, hosts: tuple[str, ...] = (), pages: Collection[str] = ()
) -> FastAPI:
    """Return the application that serves the pages of a service.

    Parameters
    ----------
    settled : float
        A drift below this in ten minutes counts as settled [um].
    """
    app = FastAPI(title="thermocomp", docs_url=None, redoc_url=None, default_response_class=Json)
    app.add_middleware(Door, names=hosts)
    declare_types()
    app.mount("/static", StaticFiles(directory=_STATIC, packages=[("thermocomp.report", "static")]))  # uPlot is there

    @app.exception_handler(AnyHTTPException)
    async def refuse(_: Request, error: AnyHTTPException) -> Json:
        return Json({"detail": error.detail}, error.status_code, error.headers)

    board = Board(service, token, settled)
    for entry in find_plugins("pages").values():
        own = entry.value.startswith("thermocomp.")
        if not own and entry.name not in pages:
            continue
        try:
            make: MakeRouter = load_plugin(entry)
            app.include_router(make(board))
        except Exception as e:  # a page of another package must not terminate the service
            if own:
                raise
            why = str(e) if isinstance(e, InputError) else f"{describe_plugin(entry)}: {type(e).__name__}: {e}"
            service.say("service", f"a page is left out: {why}")
    return app
