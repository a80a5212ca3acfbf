"""Pages in a real browser, and what axe-core says of them."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

#: evaluated after `axe`: the serious faults, each with its element
RUN_AXE = """axe.run().then(found => found.violations.filter(v => ["serious", "critical"].includes(v.impact))
    .flatMap(v => v.nodes.map(n => `${v.id}: ${n.target} ${n.html.slice(0, 150)}`)))"""


def axe() -> str:
    """The script axe-core."""
    return (files("axe_playwright_python") / "axe.min.js").read_text(encoding="utf-8")


@contextmanager
def chromium() -> "Iterator[Browser]":
    """A headless Chromium."""
    playwright = pytest.importorskip("playwright.sync_api")
    if (path := shutil.which("chromium")) is None:
        pytest.skip("chromium is not installed: apt-get install chromium (make test does)")
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=path, args=["--no-sandbox", "--disable-gpu"])
        yield browser
        browser.close()


def show(page: "Page", content: str, folder: Path) -> None:
    """Open a page from a file and wait for its curves; what it asks of the network, or an error, is a failure."""
    source = folder / "page.html"
    source.write_text(content, encoding="utf-8")
    asked = list[str]()
    page.on("request", lambda r: asked.append(r.url))
    page.on("pageerror", lambda e: asked.append(str(e)))
    page.goto(source.as_uri())
    for figure in page.locator("figure:has(> script)").all():
        figure.scroll_into_view_if_needed()
        figure.locator("canvas").first.wait_for()
    assert asked == [source.as_uri()]
