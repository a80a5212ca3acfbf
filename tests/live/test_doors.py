"""Doors of the page: other names, other origins, wrong tokens; the operator is never kept out by them."""

import asyncio
import json
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import httpx
import pytest
from pydantic import TypeAdapter, ValidationError
from test_loop import Controller, Given, machine
from test_page import RIGHT, TOKEN, asking, fed, run

from thermocomp.core.exceptions import InputError
from thermocomp.core.reading import Measurement
from thermocomp.live.loop import Service
from thermocomp.live.page import web
from thermocomp.live.page.answers import DoneAnswer, Number, RefusedAnswer, StateAnswer
from thermocomp.live.page.page import make_app

HOLD = {"target": "z_um", "do": "hold"}
OWN = "http://127.0.0.1"


def serving() -> Service:
    service = Service(machine(), [Given()], [])
    fed(service, 20.0, 21.0)
    return service


@pytest.mark.parametrize(
    "foreign",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "http://127.0.0.1:3000"},
        {"Origin": "http://localhost"},
        {"Origin": "https://127.0.0.1"},
        {"Origin": "null"},
        {"Origin": ""},
        {"Sec-Fetch-Site": "cross-site"},
        {"Sec-Fetch-Site": "same-site"},
        {"Origin": OWN, "Sec-Fetch-Site": "cross-site"},
    ],
)
def test_a_page_of_another_origin_does_nothing_and_counts_for_nothing(foreign: dict[str, str]) -> None:
    service = serving()

    async def work() -> None:
        async with asking(make_app(service, TOKEN)) as client:
            for token in ("wrong", TOKEN):
                for _ in range(10):
                    headers = foreign | {"Authorization": f"Bearer {token}"}
                    assert (await client.post("/api/order", json=HOLD, headers=headers)).status_code == 403
            for method in ("PUT", "DELETE", "PATCH", "OPTIONS"):
                answer = await client.request(method, "/api/order", headers=foreign)
                assert answer.status_code == 403
                assert not [h for h in answer.headers if h.startswith("access-control")]
            for path in ("/api/state", "/api/curves", "/api/events"):
                assert (await client.get(path, headers=foreign)).status_code == 403
            assert (await client.get("/", headers=foreign)).status_code == 200  # it may be linked to
            assert service.state.orders == {}
            # none of them was counted as a wrong token
            wrong = [(await client.post("/api/order", json=HOLD, headers=bearer("x"))).status_code for _ in range(6)]
            assert wrong == [401] * 5 + [429]

    run(work)


def bearer(token: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {token}"}


def test_the_right_token_passes_after_any_number_of_wrong_ones_and_orders() -> None:
    service = serving()

    async def work() -> None:
        async with asking(make_app(service, TOKEN)) as client:
            codes = [
                (await client.post("/api/order", json=HOLD, headers=bearer(f"wrong{k}"))).status_code
                for k in range(200)
            ]
            assert codes == [401] * 5 + [429] * 195
            for headers in (RIGHT, RIGHT | {"Origin": OWN, "Sec-Fetch-Site": "same-origin"}):
                for _ in range(100):
                    assert (await client.post("/api/order", json=HOLD, headers=headers)).status_code == 200
            assert service.state.orders["z_um"].word == "holding"
            none = [(await client.post("/api/order", json=HOLD, headers=h)).status_code for h in ({}, bearer(""))]
            assert none == [429, 429]

    run(work)


def test_an_order_that_cannot_be_carried_out_yet_is_told() -> None:
    async def work() -> None:
        async with asking(make_app(Service(machine(), [Given()], []), TOKEN)) as client:
            early = await client.post("/api/order", json=HOLD | {"do": "rezero"}, headers=RIGHT)
            assert (early.status_code, "zero" in early.json()["detail"]) == (409, True)
            assert (await client.post("/api/order", json=HOLD, headers=RIGHT)).status_code == 200

    run(work)


def test_nothing_guessed_is_not_counted() -> None:
    async def work() -> None:
        async with asking(make_app(serving(), TOKEN)) as client:
            for _ in range(20):
                assert (await client.post("/api/order", json=HOLD)).status_code == 401

    run(work)


HERE = socket.gethostbyname(socket.gethostname())


@pytest.mark.parametrize(
    ("host", "code"),
    [
        *((h, 200) for h in ("127.0.0.1:8731", "127.0.0.1", "localhost", "LOCALHOST:80", "localhost.", "[::1]:8731")),
        *(
            (h, 200)
            for h in ("xn--frse-moa.example", "mill7.shop:8731", "Mill7.Shop", "[::ffff:127.0.0.1]", "127.8.9.1", HERE)
        ),
        *((h, 400) for h in ("", "evil.example", "127.0.0.1.evil.example", "localhost.evil.example", "mill7.shop.x")),
        *((h, 400) for h in ("203.0.113.7", "[2001:db8::7]:80", "127.1", "2130706433", "0x7f.1", "localhost:80:80")),
        *((h, 400) for h in ("a@localhost", "localhost/x", "localhost#", "[::1", "::1", "[localhost]", "mill7.shop..")),
    ],
)
def test_by_which_names_it_may_be_called(host: str, code: int) -> None:
    app = make_app(serving(), TOKEN, hosts=("Mill7.shop", "Fräse.example."))

    async def work() -> None:
        async with asking(app) as client:
            for path in ("/", "/api/state", "/static/live.js"):
                assert (await client.get(path, headers={"Host": host})).status_code == code
            found = await client.post("/api/order", json=HOLD, headers=RIGHT | {"Host": host})
            assert found.status_code == code
            if code == 400:
                assert "hosts in [page]" in found.json()["detail"]

    run(work)


def test_what_can_be_asked_is_described_with_its_answers() -> None:
    service = Service(machine(), [Given()], [Controller()])

    async def work() -> None:
        async with asking(make_app(service, TOKEN)) as client:

            async def state() -> dict[str, Any]:
                found: dict[str, Any] = (await client.get("/api/state")).json()
                StateAnswer.model_validate(found, strict=True)
                return found

            found = (await client.get("/openapi.json")).json()
            assert set(found["paths"]) == {"/", "/api/state", "/api/curves", "/api/events", "/api/order"}
            assert (await client.get("/docs")).status_code == 404  # its page comes from another site
            for path, kind, says in (
                ("/", "text/html", {"type": "string"}),
                ("/api/events", "text/event-stream", {"type": "string"}),
                ("/api/state", "application/json", {"$ref": "#/components/schemas/StateAnswer"}),
                ("/api/curves", "application/json", {"type": "object"}),
            ):
                content = found["paths"][path]["get"]["responses"]["200"]["content"]
                assert set(content) == {kind}
                assert says.items() <= content[kind]["schema"].items()
            await state()
            fed(service, 20.0, 23.0)
            service.measure(Measurement(time.time(), "z_um", 6.5, left=False))
            fed(service, 23.0)
            told = await state()
            assert told["residuals"]
            assert told["targets"][0]["reference"]
            TypeAdapter(dict[str, list[Number]]).validate_python((await client.get("/api/curves")).json(), strict=True)
            with pytest.raises(ValidationError):
                StateAnswer.model_validate(told | {"not described": 1})
            order = found["paths"]["/api/order"]["post"]
            for body, headers, code in (
                (HOLD, RIGHT, 200),
                (HOLD | {"target": "a"}, RIGHT, 404),
                (HOLD | {"do": "roll back"}, RIGHT, 200),
                (HOLD | {"do": "roll back"}, RIGHT, 409),
                (HOLD | {"do": "roll back"}, {}, 401),
                ({}, RIGHT, 422),
            ):
                answer = await client.post("/api/order", json=body, headers=headers)
                assert answer.status_code == code
                name = order["responses"][str(code)]["content"]["application/json"]["schema"]["$ref"]
                described = DoneAnswer if name.endswith("DoneAnswer") else RefusedAnswer
                described.model_validate(answer.json())
            says = order["requestBody"]["content"]["application/json"]["schema"]
            assert set(says["properties"]) == {"target", "do"}

    run(work)


@pytest.mark.parametrize(
    "body",
    [
        b'{"target": "\\ud800", "do": "hold"}',
        b'{"target": "z_um", "do": "\\udfff"}',
        b'{"\\ud800": 1}',
        b'{"target": NaN, "do": Infinity}',
        b'{"target": "\\u0000\\u202e", "do": "hold"}',
        b"\xff\xfe\xff",
        *(json.dumps(HOLD).encode(e) for e in ("utf-16", "utf-16-le", "utf-32-be", "utf-8-sig")),
        b'{"target": "z_um", "do": "hold", "do": "run"}',
        b'"\\ud800"',
        b"[" * 1900,
        b'{"target": ' + b"9" * 1900 + b', "do": "hold"}',
    ],
)
def test_a_hostile_order_is_refused_in_words(body: bytes) -> None:
    async def work() -> None:
        async with asking(make_app(serving(), TOKEN)) as client:
            headers = RIGHT | {"Content-Type": "application/json"}
            found = await client.post("/api/order", content=body, headers=headers)
            assert found.status_code in (400, 404, 422)
            assert isinstance(found.json()["detail"], str)
            assert found.json()["detail"].isprintable()

    run(work)


@contextmanager
def served(service: Service, host: str, hosts: tuple[str, ...] = ()) -> Iterator[int]:
    """Serve the page in a thread of its own; return its port."""
    listening, loop = web.listen(host, 0), asyncio.new_event_loop()
    task = loop.create_task(web.serve(make_app(service, TOKEN, hosts=hosts), listening))
    thread = threading.Thread(target=lambda: loop.run_until_complete(asyncio.wait([task])))
    thread.start()
    try:
        yield listening.getsockname()[1]
    finally:
        loop.call_soon_threadsafe(task.cancel)
        thread.join(20.0)
        loop.close()


@pytest.mark.parametrize(
    ("host", "names"),
    [
        ("127.0.0.1", ("127.0.0.1", "localhost")),
        ("::1", ("[::1]",)),
        ("[::1]", ("[::1]",)),
        ("localhost", ("127.0.0.1", "localhost")),
        ("0.0.0.0", ("127.0.0.1", "localhost", HERE)),
        ("::", ("[::1]", "127.0.0.1", "localhost", HERE)),
        ("[::]", ("[::1]", "127.0.0.1", HERE)),
        (HERE, (HERE,)),
        (socket.gethostname(), (socket.gethostname(), HERE)),
    ],
)
def test_a_page_answers_at_every_address_by_which_it_is_reached(host: str, names: tuple[str, ...]) -> None:
    if ":" in host and not socket.has_ipv6:
        pytest.skip("no IPv6 here")
    with served(serving(), host, (host,)) as port:
        for name in names:
            assert httpx.get(f"http://{name}:{port}/").status_code == 200
            origin = f"http://{name}:{port}"
            found = httpx.post(f"{origin}/api/order", json=HOLD, headers=RIGHT | {"Origin": origin})
            assert found.json() == {"done": "hold", "target": "z_um"}
            assert httpx.get(f"{origin}/api/state", headers={"Host": "evil.example"}).status_code == 400


@pytest.mark.parametrize("host", ["no such host", "x" * 64, "a..b", "\u0660", "nowhere.invalid", "203.0.113.7"])
def test_a_host_that_cannot_be_is_told(host: str) -> None:
    with pytest.raises(InputError, match="page on"):
        web.listen(host, 0)


EVIL = """<!doctype html><title>another page</title>
<script>
const order = JSON.stringify({ target: "z_um", do: "shadow" });
const kinds = ["text/plain", "application/json", "application/x-www-form-urlencoded"];
async function attack(to) {
  const url = to + "/api/order", said = [], method = "POST";
  const attempt = async (name, work) => {
    try { said.push([name, await work()]); } catch (e) { said.push([name, "failed"]); }
  };
  const post = async options => (await fetch(url, { method, body: order, ...options })).status;
  for (let k = 0; k < 6; k++) {
    for (const token of ["wrong" + k, "TOKEN"]) {
      const headers = { "Content-Type": "application/json", Authorization: "Bearer " + token };
      await attempt("fetch", () => post({ headers }));
      await attempt("fetch with credentials", () => post({ headers, credentials: "include" }));
    }
    for (const type of kinds) {
      await attempt("no-cors " + type, () => post({ mode: "no-cors", headers: { "Content-Type": type } }));
      await attempt("beacon " + type, () => navigator.sendBeacon(url, new Blob([order], { type })));
    }
    await attempt("beacon", () => navigator.sendBeacon(url, order));
  }
  for (const options of [{ credentials: "include" }, { mode: "no-cors" }])
    await attempt("read", async () => (await (await fetch(to + "/api/state", options)).text()).length);
  await attempt("events", () => new Promise(done => {
    const source = new EventSource(to + "/api/events", { withCredentials: true });
    source.onmessage = m => done(m.data.length); source.onerror = () => done("failed");
  }));
  return said;
}
async function submit(to) {
  for (const type of ["text/plain", "application/x-www-form-urlencoded", "multipart/form-data"]) {
    const [form, field, frame] = ["form", "input", "iframe"].map(n => document.createElement(n));
    frame.name = "f" + Math.random();
    Object.assign(form, { target: frame.name, method: "post", enctype: type, action: to + "/api/order" });
    Object.assign(field, { name: '{"target": "z_um", "do": "shadow", "x": "', value: '"}' });
    form.append(field);
    document.body.append(frame, form);
    form.submit();
    await new Promise(done => { frame.onload = done; setTimeout(done, 1000); });
  }
}
</script><body>"""


class Evil(BaseHTTPRequestHandler):
    """A page of another site."""

    def do_GET(self) -> None:
        body = EVIL.replace("TOKEN", TOKEN).encode()
        if self.path == "/sandboxed":
            body = b'<body><iframe sandbox="allow-scripts allow-forms" src="/" width="500"></iframe>'
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *args: Any) -> None:
        pass


def test_in_a_browser_other_origins_do_nothing_and_hold_works_at_once() -> None:
    playwright = pytest.importorskip("playwright.sync_api")
    if not Path("/usr/bin/chromium").exists():
        pytest.skip("Chromium is not installed (Debian package chromium)")
    service = serving()
    other = ThreadingHTTPServer(("127.0.0.1", 0), Evil)
    threading.Thread(target=other.serve_forever, daemon=True).start()
    with served(service, "127.0.0.1") as port, playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path="/usr/bin/chromium", args=["--no-sandbox", "--disable-gpu"])
        for name, target in (("127.0.0.1", "127.0.0.1"), ("localhost", "127.0.0.1"), ("127.0.0.1", "localhost")):
            for path in ("/", "/sandboxed"):
                evil = browser.new_page()
                evil.goto(f"http://{name}:{other.server_port}{path}")
                page = evil.frames[-1]
                if path == "/sandboxed":
                    assert page.evaluate("self.origin") == "null"
                said = page.evaluate("to => attack(to)", f"http://{target}:{port}")
                assert len(said) == 6 * 11 + 3
                for what, found in said:
                    if what.startswith(("fetch", "read", "events")):
                        assert found in ("failed", 0), what
                page.evaluate("to => submit(to)", f"http://{target}:{port}")
                assert service.state.orders == {}
                evil.close()
        shown = browser.new_page()
        shown.goto(f"http://127.0.0.1:{port}")
        card = shown.locator('[data-target="z_um"]')
        shown.locator("#token").fill(TOKEN)
        card.get_by_role("button", name="Hold").click()
        playwright.expect(card.locator(".answer")).to_have_text("done: hold", timeout=2_000)
        assert service.state.orders["z_um"].word == "holding"
        browser.close()
    other.shutdown()
    other.server_close()


def test_a_script_without_an_origin_gives_orders() -> None:
    service = serving()
    with served(service, "127.0.0.1") as port:
        found = httpx.post(
            f"http://127.0.0.1:{port}/api/order",
            content=json.dumps(HOLD),
            headers=RIGHT | {"Content-Type": "application/json"},
        )
    assert found.status_code == 200
    assert service.state.orders["z_um"].word == "holding"
