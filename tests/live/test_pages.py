"""Pages of other packages stand beside the service's own; one that fails is left out and named."""

import asyncio
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import httpx
import pytest
from test_loop import Given, machine

from thermocomp.core.exceptions import InputError
from thermocomp.core.plugins import find_plugins
from thermocomp.live.config import Page
from thermocomp.live.loop import Service
from thermocomp.live.page import page
from thermocomp.live.page.page import make_app

CODE = """
from fastapi import APIRouter

def make_router(board):
    router = APIRouter()

    @router.get("/note")
    def note():
        return {"targets": list(board.service.compensator.lines)}

    @router.post("/api/note", dependencies=board.orders_only())
    def order():
        return {"done": True}

    return router

def broken(board):
    raise RuntimeError("no board today")
"""
TOKEN = "0123456789abcdef"


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "notepage.py").write_text(CODE, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "notepage", raising=False)
    outside = {
        name: EntryPoint(name, f"notepage:{what}", "thermocomp.pages")
        for name, what in (("note", "make_router"), ("broken", "broken"), ("absent", "nothing"))
    }
    monkeypatch.setattr(page, "find_plugins", lambda group: find_plugins(group) | outside)


@pytest.mark.usefixtures("installed")
def test_pages_that_are_named_are_served_and_no_others() -> None:
    service = Service(machine(), [Given()], [])

    async def ask(*pages: str) -> tuple[int, int, int, int]:
        transport = httpx.ASGITransport(app=make_app(service, TOKEN, pages=pages))
        async with httpx.AsyncClient(transport=transport, base_url="http://localhost") as client:
            found = [(await client.get(path)).status_code for path in ("/note", "/api/state")]
            found.append((await client.post("/api/note")).status_code)
            found.append((await client.post("/api/note", headers={"Authorization": f"Bearer {TOKEN}"})).status_code)
        return found[0], found[1], found[2], found[3]

    assert asyncio.run(ask("note", "broken", "absent")) == (200, 200, 401, 200)
    told = [e.text for e in service.events]
    assert "a page is left out: plug-in broken (thermocomp.pages): RuntimeError: no board today" in told
    assert any("plug-in absent (thermocomp.pages) cannot be loaded: AttributeError" in text for text in told)
    assert asyncio.run(ask()) == (404, 200, 404, 404)


def test_a_page_that_is_not_installed_is_refused() -> None:
    with pytest.raises(InputError, match="'note' is not installed; there are orders, status"):
        Page(pages=("note",))
