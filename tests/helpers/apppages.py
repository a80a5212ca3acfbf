"""The page of a project in a real browser, and a finished project for it."""

import asyncio
import contextlib
import shutil
import subprocess
import sys
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import httpx
from browsing import RUN_AXE, axe, chromium
from projects import small_project

from thermocomp.api.keywords import silent
from thermocomp.app.project import Project
from thermocomp.app.running import run_project
from thermocomp.app.store import Store
from thermocomp.app.web import make_app

if TYPE_CHECKING:
    from playwright.sync_api import Page

TOKEN = "a-secret-of-the-test"
#: two methods, sensors and the next test; quick, since nothing is tried with noise
WHOLE = """name = "Small machine"

[[recordings]]
file = "files/drift.csv"

[compare]
targets = ["z_um"]
models = ["ols", "averaged"]
robustness = false
jobs = 1

[select]
max_sensors = 2

[plan]
hours = 6.0
curve = false
"""


@contextlib.contextmanager
def opened(folder: Path, *, width: int = 400, dark: bool = True) -> "Iterator[Page]":
    """Yield the page of a project; at the end no script has failed, nothing exceeds the window, axe finds no fault."""
    words = [sys.executable, "-m", "thermocomp", "app", str(folder), "--no-browser"]
    with chromium() as browser, subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            address = next(line.strip() for line in process.stdout if line.startswith("http://127.0.0.1:"))
            context = browser.new_context(
                bypass_csp=True,
                viewport={"width": width, "height": 900},
                color_scheme="dark" if dark else "light",
            )
            page = context.new_page()
            errors, asked = list[str](), list[str]()
            page.on("pageerror", lambda e: errors.append(str(e)))
            page.on("dialog", lambda d: errors.append(d.message))
            page.on("request", lambda r: asked.append(r.url))
            page.goto(address)
            yield page
            assert errors == [], errors
            assert [url for url in asked if not url.startswith(address)] == []
            assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
            page.evaluate(axe())
            assert (faults := page.evaluate(RUN_AXE)) == [], faults
        finally:
            process.terminate()
            process.communicate()


def finished(folder: Path) -> Path:
    """Return a project whose only run has all steps; for tests that only read it."""
    small_project(folder, WHOLE)
    run_project(Project(folder), silent)
    return folder


def copy_of(folder: Path, to: Path) -> Path:
    """Return a copy of a project that a test may change."""
    shutil.copytree(folder, to)
    return to


def asked_of(folder: Path, work: Callable[[httpx.AsyncClient], Awaitable[None]]) -> None:
    """Send requests to the page of a project without a browser."""

    async def whole() -> None:
        store = Store(folder)
        transport = httpx.ASGITransport(app=make_app(store, TOKEN))
        async with httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1") as client:
            try:
                await work(client)
            finally:
                await store.workers.close()

    asyncio.run(whole())
