"""The page beside the machine: what it tells, and who may give orders."""

import asyncio
import json
import time
from collections.abc import Awaitable, Callable, Mapping
from pathlib import Path

import httpx
import pytest
from browsing import RUN_AXE, axe
from fastapi import FastAPI
from test_loop import Given, machine
from watchedmachine import failing, watched_model

from thermocomp.core.correction import Correction, Limits
from thermocomp.core.exceptions import InputError
from thermocomp.core.ports import LinkStatus
from thermocomp.core.reading import Measurement, Reading
from thermocomp.live.clock import ServiceClock
from thermocomp.live.loop import Service
from thermocomp.live.page import status as page
from thermocomp.live.page import web
from thermocomp.live.page.page import make_app
from thermocomp.runtime.compensator import Compensator

TOKEN = "0123456789abcdef"
RIGHT = {"Authorization": f"Bearer {TOKEN}"}


def asking(app: FastAPI, host: str = "127.0.0.1") -> httpx.AsyncClient:
    return httpx.AsyncClient(transport=httpx.ASGITransport(app=app), base_url=f"http://{host}")


def run(work: Callable[[], Awaitable[None]]) -> None:
    asyncio.run(work())  # type: ignore[arg-type]


def fed(service: Service, *temperatures: float) -> None:
    for value in temperatures:
        service.take(Reading(time.time(), {"t": value}))


def test_what_is_shown_is_what_is_in_force() -> None:
    service = Service(machine(), [Given()], [])
    app = make_app(service)

    async def work() -> None:
        async with asking(app) as client:
            state = (await client.get("/api/state")).json()
            assert state["targets"][0]["reason"].startswith("no sink carries z_um")
            fed(service, 20.0, 21.5)
            state = (await client.get("/api/state")).json()
            (target,) = state["targets"]
            assert (target["name"], target["state"], target["correction_um"]) == ("z_um", "no sink", -3.0)
            assert target["deviation_um"] == 3.0
            assert state["sensors"][0] | {"age_s": 0} == {
                "name": "t",
                "value": 21.5,
                "age_s": 0,
                "state": "not watched",
            }
            assert state["counts"] == {"readings": 2, "rejected": 0}
            assert (await client.get("/api/curves")).json()["z_um predicted"] == [0.0]
            html = await client.get("/")
            assert "z_um" in html.text
            assert "frame-ancestors 'none'" in html.headers["content-security-policy"]
            for name in ("uplot.min.js", "live.js", "live.css", "uplot.min.css"):
                assert (await client.get(f"/static/{name}")).status_code == 200

    run(work)


def test_orders_want_the_token() -> None:
    service = Service(machine(), [Given()], [])
    fed(service, 20.0, 21.0)
    order = {"target": "z_um", "do": "hold"}

    async def work() -> None:
        async with asking(make_app(service)) as client:
            assert (await client.post("/api/order", json=order, headers=RIGHT)).status_code == 403
        async with asking(make_app(service, TOKEN)) as client:
            assert (await client.post("/api/order", json=order)).status_code == 401
            for other in (TOKEN[:-1], TOKEN + "x", TOKEN.upper(), "é" * 16):
                headers: dict[bytes, bytes] = {b"Authorization": f"Bearer {other}".encode()}
                assert (await client.post("/api/order", json=order, headers=headers)).status_code == 401
            assert service.state.orders == {}
            assert (await client.post("/api/order", json=order, headers=RIGHT)).status_code == 200
            assert service.state.orders["z_um"].word == "holding"
            fed(service, 25.0)
            assert service.state.corrections["z_um"].offset == -2.0
            unknown = await client.post("/api/order", json={"target": "y_um", "do": "hold"}, headers=RIGHT)
            assert (unknown.status_code, unknown.json()["detail"]) == (
                404,
                "no target is named y_um; there are z_um",
            )
            others: tuple[object, ...] = (
                {"target": "z_um"},
                {"target": "z_um", "do": "jump"},
                {"target": 1, "do": "hold"},
                [],
                order | {"x": 1},
            )
            for bad in others:
                assert (await client.post("/api/order", json=bad, headers=RIGHT)).status_code == 422
            assert (await client.post("/api/order", json=order | {"do": "run"}, headers=RIGHT)).status_code == 200
            fed(service, 25.0)
            assert service.state.corrections["z_um"].offset == -10.0
            assert (await client.post("/api/order", json=order | {"do": "rezero"}, headers=RIGHT)).status_code == 200
            fed(service, 25.0)
            assert service.state.corrections["z_um"].offset == -10.0
            assert service.state.references["z_um"].why == "by hand, on the page"

    run(work)


def test_an_order_is_small_and_states_its_length() -> None:
    service = Service(machine(), [Given()], [])

    async def work() -> None:
        async with asking(make_app(service, TOKEN)) as client:
            large = await client.post("/api/order", content=b"x" * 3000, headers=RIGHT)
            assert large.status_code == 413

            async def pieces() -> object:
                yield b"x"

            assert (await client.post("/api/order", content=pieces(), headers=RIGHT)).status_code == 413  # type: ignore[arg-type]

    run(work)


def test_a_probing_is_charted_and_taken_back_in_one_step() -> None:
    service = Service(machine(), [Given()], [])
    fed(service, 20.0, 21.0)
    app = make_app(service, TOKEN)
    before = service.state.learned

    async def work() -> None:
        service.measure(Measurement(time.time(), "z_um", 0.5, left=True, repeatability=0.1))
        fed(service, 21.0, 21.0)
        assert service.probings.checked[0].residual == pytest.approx(
            0.5
        )  # deviation 2, corrected by -2: half a micrometre is left
        assert service.state.corrections["z_um"].offset < -2.2
        async with asking(app) as client:
            (shown,) = (await client.get("/api/state")).json()["residuals"]
            assert (shown["target"], shown["refused"]) == ("z_um", "")
            back = {"target": "z_um", "do": "roll back"}
            assert (await client.post("/api/order", json=back, headers=RIGHT)).status_code == 200
            assert service.state.learned == before
            again = await client.post("/api/order", json=back, headers=RIGHT)
            assert (again.status_code, "no probing" in again.json()["detail"]) == (409, True)
        fed(service, 21.0)
        assert service.state.corrections["z_um"].offset == -2.0

    run(work)


def test_a_measurement_without_the_correction_in_it_is_the_deviation() -> None:
    service = Service(machine(), [Given()], [])
    fed(service, 20.0, 25.0)
    service.measure(Measurement(time.time(), "z_um", 10.5, left=False, repeatability=0.1))
    service.measure(Measurement(time.time(), "nobody", 1.0, left=False))
    fed(service, 25.0)
    assert service.probings.checked[0].residual == pytest.approx(0.5)
    service.measure(Measurement(time.time() - 3600.0, "z_um", 10.5, left=False))
    assert service.probings.waiting == {}
    assert next(e.text for e in service.events if "refused" in e.text) == "nobody refused: no target is named nobody"


def test_an_implausible_one_is_refused_and_asks_for_action() -> None:
    service = Service(machine(), [Given()], [])
    fed(service, 20.0, 21.0)
    service.measure(Measurement(time.time(), "z_um", 400.0, left=False))
    fed(service, 21.0, 21.0)
    assert service.probings.checked[0].refused
    assert service.probings.checked[0].beyond
    assert service.state.corrections["z_um"].offset == -2.0
    assert "z_um" not in service.probings.before
    assert any("look for the cause" in e.text for e in service.events)


@pytest.mark.parametrize(
    "content",
    [
        "",
        "short",
        "not ascii é 0123456789",
        "0123456789abcdef\n0123456789abcdef\n",
        "0123456789 abcdef",
        "0123456789\tabcdef",
    ],
)
def test_a_token_that_is_none_is_refused(content: str, tmp_path: Path) -> None:
    path = tmp_path / "token"
    path.write_text(content, encoding="utf-8")
    path.chmod(0o600)
    with pytest.raises(InputError, match="token"):
        web.read_token(path)
    with pytest.raises(InputError, match="cannot be read"):
        web.read_token(tmp_path / "none")


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o644, 0o660])
def test_a_token_that_others_can_read_is_refused(mode: int, tmp_path: Path) -> None:
    path = tmp_path / "token"
    path.write_text(TOKEN, encoding="ascii")
    path.chmod(mode)
    with pytest.raises(InputError, match="chmod 600"):
        web.read_token(path)
    path.chmod(0o600)
    assert web.read_token(path) == TOKEN


def test_a_port_that_is_taken_is_told() -> None:
    with web.listen("127.0.0.1", 0) as taken, pytest.raises(InputError, match="choose another with --port"):
        web.listen("127.0.0.1", taken.getsockname()[1])


class Told(ServiceClock):
    """The clock of a machine whose rows say what time it is."""

    at = 0.0

    def tick(self) -> float:
        return self.at

    def now(self) -> float:
        return 1.8e9 + self.at

    def of(self, stamp: float) -> float:
        return stamp


class Echo:
    """A controller that has the corrections as soon as they are sent."""

    def __init__(self) -> None:
        self.has = {"z_um": Correction(0.0)}

    async def connect(self, timeout: float) -> None:
        """Connect."""

    async def apply(self, corrections: Mapping[str, Correction]) -> None:
        self.has |= corrections

    async def confirmed(self) -> dict[str, Correction]:
        return self.has

    def status(self) -> LinkStatus:
        return LinkStatus("connected")

    async def close(self) -> None:
        """Close."""


def test_in_a_browser(tmp_path: Path) -> None:
    playwright = pytest.importorskip("playwright.async_api")
    if not Path("/usr/bin/chromium").exists():
        pytest.skip("Chromium is not installed (Debian package chromium)")
    model, day, source = watched_model(), failing(), Given()
    clock = Told()
    service = Service(Compensator.of([model], Limits(rate=1e9), watching=True), [source], [Echo()], clock)

    async def feed(rows: range, missing: str = "") -> None:
        for k in rows:
            row = {str(n): float(v) for n, v in day.table.iloc[k].items() if n != missing}
            clock.at = float(day.time[k])
            service.take(Reading(clock.now(), row))
            await asyncio.sleep(0.005)

    async def work() -> None:
        listening = web.listen("127.0.0.1", 0)
        tasks = [asyncio.create_task(service.run())]
        tasks += [asyncio.create_task(web.serve(make_app(service, TOKEN), listening))]
        async with playwright.async_playwright() as started:
            browser = await started.chromium.launch(
                executable_path="/usr/bin/chromium", args=["--no-sandbox", "--disable-gpu"]
            )
            shown = await browser.new_page(viewport={"width": 1180, "height": 820})
            wrong = list[str]()
            shown.on("pageerror", lambda e: wrong.append(str(e)))
            await shown.goto("http://{}:{}".format(*listening.getsockname()))
            card = shown.locator('[data-target="z_um"]')
            await feed(range(150))
            await playwright.expect(card.locator(".word")).to_have_text("active", timeout=10_000)
            await playwright.expect(card.locator("canvas")).to_be_visible()
            first = await card.locator("canvas").evaluate("c => c.toDataURL()")
            await feed(range(150, 250))
            await shown.wait_for_timeout(700)
            assert await card.locator("canvas").evaluate("c => c.toDataURL()") != first  # the curve moves
            assert await shown.locator("#alarm").is_hidden()
            await feed(range(250, 260), missing="t1_C")
            await playwright.expect(shown.locator("#alarm")).to_have_text("t1_C missing", timeout=5_000)
            await playwright.expect(shown.locator("#events")).to_contain_text("t1_C missing")
            await card.get_by_role("button", name="Hold").click()
            await playwright.expect(card.locator(".answer")).to_have_text("the token is wrong")
            await shown.locator("#token").fill(TOKEN)
            await card.get_by_role("button", name="Hold").click()
            await playwright.expect(card.locator(".answer")).to_have_text("done: hold")
            await feed(range(260, 265))
            await playwright.expect(card.locator(".word")).to_have_text("holding", timeout=5_000)
            await playwright.expect(card.locator(".reason")).to_have_text("by hand, on the page")
            await card.get_by_role("button", name="Run").click()
            await playwright.expect(card.locator(".answer")).to_have_text("done: run")
            await feed(range(265, 270))
            await playwright.expect(card.locator(".word")).to_have_text("active", timeout=5_000)
            assert wrong == []
            await shown.evaluate(axe())
            for width, scheme in ((1180, "light"), (1180, "dark"), (400, "dark")):
                await shown.set_viewport_size({"width": width, "height": 820})
                await shown.emulate_media(color_scheme=scheme)
                assert await shown.evaluate(RUN_AXE) == [], (width, scheme)
                assert await shown.evaluate("document.documentElement.scrollWidth") <= width
            await browser.close()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    run(work)


def test_an_event_stream_is_json_and_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(page, "MOST_PAGES", 2)
    service = Service(machine(), [Given()], [])

    async def work() -> None:
        listening = web.listen("127.0.0.1", 0)
        task = asyncio.create_task(web.serve(make_app(service), listening))
        url = "http://{}:{}/api/events".format(*listening.getsockname())
        async with (
            httpx.AsyncClient() as client,
            client.stream("GET", url) as one,
            client.stream("GET", url) as two,
            client.stream("GET", url) as three,
        ):
            for stream in (two, three):
                line = await anext(stream.aiter_lines())
                assert json.loads(line.removeprefix("data: "))["state"]["rejected"] == "no reading yet"
            with pytest.raises(httpx.TransportError):  # the oldest made room
                await one.aread()
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    run(work)
