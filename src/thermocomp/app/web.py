"""Web application of a project: its files, runs and results, under an address that contains a token."""

import asyncio
import json
import mimetypes
import os
import secrets
import shlex
import subprocess
import time
from collections.abc import AsyncIterator, Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import jinja2
import tomlkit
from babel.core import negotiate_locale
from fastapi import APIRouter, Body, FastAPI, Query, Request
from fastapi import Path as InPath
from fastapi.exceptions import RequestValidationError
from fastapi.responses import FileResponse, HTMLResponse, StreamingResponse
from fastapi.staticfiles import StaticFiles
from starlette.exceptions import HTTPException

from thermocomp.app.comparing import read_json
from thermocomp.app.runfolder import runs_of
from thermocomp.app.runviews import run_of, view_runs
from thermocomp.app.store import LARGEST, Store, find_inside
from thermocomp.core.exceptions import InputError
from thermocomp.live.page.doors import Door, Json, declare_types
from thermocomp.report.language import LANGUAGES, load_words, translate

_HERE = Path(__file__).parent
#: largest settings, and answers to questions about a file [bytes]
SETTINGS = 1_000_000
#: time between two looks at the runs, for the event stream [s]
OFTEN = 0.5
#: pages of results have their own scripts; they must not reach the page of the project
_ALONE = {"Content-Security-Policy": "sandbox allow-scripts allow-downloads", "X-Content-Type-Options": "nosniff"}


def make_app(store: Store, token: str = "") -> FastAPI:
    """Return the application that serves a project under ``/TOKEN/``.

    Parameters
    ----------
    store : Store
    token : str
        Default: a random one.
    """
    token = token or secrets.token_urlsafe(24)
    # its description names the token in every path
    app = FastAPI(
        title="thermocomp app",
        openapi_url=f"/{token}/openapi.json",
        docs_url=None,
        redoc_url=None,
        default_response_class=Json,
    )
    app.state.token = token
    app.add_middleware(Door, most=_largest, private=True)
    declare_types()
    static = StaticFiles(directory=_HERE / "static", packages=[("thermocomp.report", "static")])
    app.mount(f"/{token}/static", static)
    app.include_router(_files(store), prefix=f"/{token}")
    app.include_router(_results(store), prefix=f"/{token}")
    app.include_router(view_runs(store), prefix=f"/{token}")

    @app.exception_handler(HTTPException)
    async def refuse(_: Request, error: HTTPException) -> Json:
        return Json({"detail": error.detail}, error.status_code, error.headers)

    @app.exception_handler(RequestValidationError)
    async def list_wrong(_: Request, error: RequestValidationError) -> Json:
        told = [f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors()]
        return Json({"detail": "; ".join(told)}, 422)

    @app.exception_handler(InputError)
    async def explain(_: Request, error: InputError) -> Json:
        return Json({"detail": str(error)}, 422)

    return app


def _largest(request: Request) -> int:
    """Return the maximum size of a request: files go to the disk, everything else into memory."""
    return LARGEST if request.method == "PUT" and "/api/drop/" in request.url.path else SETTINGS


def _files(store: Store) -> APIRouter:
    """Return the routes of the page, the settings and the recordings."""
    router, loader = APIRouter(), jinja2.FileSystemLoader(_HERE / "templates")
    pages = jinja2.Environment(loader=loader, autoescape=True)

    @router.get("/", response_class=HTMLResponse)
    async def show(request: Request) -> HTMLResponse:
        store.workers.warm_up()
        store.preferred = _preferred(request.headers.get("accept-language", ""))
        language = store.language()
        words = load_words(language, "app/static/", "report/static/", "words")
        template = pages.get_template("app.html", globals={"_": partial(translate, language=language)})
        folder = str(store.folder.resolve())
        return HTMLResponse(template.render(folder=folder, language=language, languages=LANGUAGES, words=words))

    @router.get("/api/project")
    async def tell() -> Json:
        return Json(_state(store))

    @router.put("/api/settings")
    async def change(content: Annotated[dict[str, Any], Body()]) -> Json:
        async with store.editing:
            await store.save(_changed(store.document(), content))
        return Json(_state(store))

    @router.put("/api/drop/{name}")
    async def drop(name: str, request: Request) -> Json:
        file = await store.receive(name, _parts(request))
        return Json({"file": file, **await store.adopt(file)})

    @router.get("/api/recordings/{name:path}")
    async def look(name: str) -> Json:
        return Json({"file": name, **await store.preview(name)})

    @router.post("/api/recordings/{name:path}")
    async def answer(name: str, answers: Annotated[list[dict[str, Any]], Body()]) -> Json:
        return Json({"file": name, **await store.answer(name, answers)})

    @router.delete("/api/recordings/{name:path}")
    async def remove(name: str) -> Json:
        await store.move(name)
        return Json(_state(store))

    @router.post("/api/uses/{name:path}")
    async def use(name: str, to: Literal["recordings", "assess"]) -> Json:
        await store.move(name, to)
        return Json(_state(store))

    @router.post("/api/undo/{name:path}")
    async def undo(name: str) -> Json:
        async with store.editing:
            store.undo(str(store.entry(store.document(), name).get("mapping", "")) or f"{name}.toml")
        return Json({"file": name, **await store.preview(name)})

    return router


def _preferred(accepted: str) -> str:
    """Return the language of the page that a browser prefers, from its header ``Accept-Language``."""
    codes = [part.partition(";")[0].strip() for part in accepted.split(",")]
    return negotiate_locale([c.replace("-", "_") for c in codes], [*LANGUAGES]) or "en"


def _results(store: Store) -> APIRouter:
    """Return the routes of the runs."""
    router = APIRouter()

    @router.post("/api/runs")
    async def start(again: bool = False, number: Annotated[int, Query(ge=0, le=10**9)] = 0) -> Json:
        if not store.content().get("recordings"):
            raise InputError("the project has no recording: drop a file on the page first")
        async with store.editing:
            await store.start_run(again=again, number=number)
        return Json({"started": True})

    @router.delete("/api/runs/{number}")
    async def stop(number: Annotated[int, InPath(ge=1, le=10**9)]) -> Json:
        run_of(store.folder, number).ask_to_stop()
        return Json({"asked": True})

    @router.get("/api/runs/{number}")
    async def result(number: Annotated[int, InPath(ge=1, le=10**9)]) -> Json:
        folder = run_of(store.folder, number)
        names = ("check", "compare", "fit", "assess", "sensors", "plan")
        found = {n: read_json(folder.path / f"{n}.json") for n in names}
        words = read_json(folder.path / "words.json")
        told = {k: words.get(k) for k in ("words", "axes", "driven")} if isinstance(words, dict) else {}
        return Json({**folder.read(), "results": found, **told})

    @router.get("/runs/{number}/{name:path}")
    async def file(number: Annotated[int, InPath(ge=1, le=10**9)], name: str) -> FileResponse:
        folder = run_of(store.folder, number).path
        if not name or not (path := find_inside(folder, name)).is_file():
            raise HTTPException(404, f"run {number} has no file {name}")
        kind = mimetypes.guess_type(path.name)[0] or "text/plain"
        return FileResponse(path, media_type=kind, headers=_ALONE)

    @router.get("/api/events", response_class=StreamingResponse)
    async def follow() -> StreamingResponse:
        return StreamingResponse(_events(store), media_type="text/event-stream", headers={"Cache-Control": "no-store"})

    return router


async def _parts(request: Request) -> AsyncIterator[bytes]:
    """Return the content of a request of any duration, as long as something arrives."""
    connection = getattr(request.state, "connection", None)
    async for part in request.stream():
        if connection is not None:
            connection.heard()
        yield part


async def _events(store: Store) -> AsyncIterator[bytes]:
    """Return the state of the project whenever it has changed, and a comment every ten seconds."""
    last, spoke = "", time.monotonic()
    while True:
        text = json.dumps(_state(store), default=str)
        if text != last:
            last, spoke = text, time.monotonic()
            yield f"data: {text}\n\n".encode()
        elif time.monotonic() - spoke > 10.0:
            spoke = time.monotonic()
            yield b": still here\n\n"
        await asyncio.sleep(OFTEN)


def _state(store: Store) -> dict[str, Any]:
    runs = [r.read() for r in runs_of(store.folder)]
    for run in runs:
        run.pop("seen", None)
    words = ["thermocomp", "run", str(store.folder.resolve())]
    command = shlex.join(words) if os.name == "posix" else subprocess.list2cmdline(words)
    told = {"command": command, "trouble": store.trouble()}
    return {"folder": str(store.folder), "settings": store.content(), "runs": runs, **told}


def _changed(document: tomlkit.TOMLDocument, content: Mapping[str, Any]) -> tomlkit.TOMLDocument:
    """Return settings with tables changed by JSON, after a look whether TOML can hold them; null removes a table."""
    try:
        for key, value in content.items():
            if value is None:
                document.pop(key, None)
            else:
                document[key] = value
        text = tomlkit.dumps(document)
        text.encode()  # half a character
        return tomlkit.parse(text)
    except (tomlkit.exceptions.TOMLKitError, ValueError, TypeError, RecursionError) as e:
        raise InputError(f"these settings cannot be written as TOML: {e}") from e
