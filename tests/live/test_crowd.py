"""Many connections at the page, idle or deaf: the operator is served at once, and what nobody needs is closed."""

import asyncio
import contextlib
import gc
import json
import socket
import threading
import time
from collections.abc import Iterator

import httpx
import pytest
from test_doors import HOLD, served, serving
from test_page import RIGHT, TOKEN, fed

from thermocomp.live.page import connections, status, web
from thermocomp.live.page.page import make_app

#: an answer takes no longer, whoever else is there [s]; on an idle computer it takes some hundredths of a second
SOON = 5.0
EVENTS = b"GET /api/events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
HALF = b"POST /api/order HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Le"
NO_BODY = b"POST /api/order HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 50\r\n\r\n{"


@contextlib.contextmanager
def knocking(port: int, many: int, said: bytes = b"") -> Iterator[list[socket.socket]]:
    """Connect many times, and say something to begin with."""
    found = list[socket.socket]()
    try:
        for _ in range(many):
            found.append(socket.create_connection(("127.0.0.1", port), timeout=30.0))
            if said:
                with contextlib.suppress(OSError):  # it had to go
                    found[-1].sendall(said)
        yield found
    finally:
        for one in found:
            one.close()


def ended(one: socket.socket, within: float) -> bool:
    """Return whether the other side closes a connection within so long [s], whatever it says before."""
    deadline = time.monotonic() + within
    try:
        while (left := deadline - time.monotonic()) > 0.0:
            one.settimeout(left)
            if one.recv(4096) == b"":
                return True
    except TimeoutError:
        return False
    except OSError:
        return True
    return False


def ask(port: int) -> None:
    """Ask for the page, the state and an event, and give an order, each with a connection of its own, and soon."""
    base = f"http://127.0.0.1:{port}"
    for path in ("/", "/api/state", "/api/curves", "/static/live.js"):
        began = time.monotonic()
        assert httpx.get(base + path, timeout=20.0).status_code == 200
        assert time.monotonic() - began < SOON, path
    began = time.monotonic()
    assert httpx.post(f"{base}/api/order", json=HOLD, headers=RIGHT, timeout=20.0).status_code == 200
    assert time.monotonic() - began < SOON
    began = time.monotonic()
    with httpx.stream("GET", f"{base}/api/events", timeout=20.0) as stream:
        assert json.loads(next(stream.iter_lines()).removeprefix("data: "))["state"]["counts"]["readings"] > 0
    assert time.monotonic() - began < SOON


def test_the_operator_is_served_beside_a_crowd() -> None:
    service = serving()
    with (
        served(service, "127.0.0.1") as port,
        knocking(port, 50, EVENTS),
        knocking(port, 200),
        knocking(port, 150, HALF),
        knocking(port, 150, NO_BODY),
        knocking(port, 50, EVENTS),
    ):
        for _ in range(3):
            ask(port)
        fed(service, 25.0)  # and the service continues
    assert service.counts["readings"] == 3


def test_the_operator_is_served_while_others_come_without_end() -> None:
    with served(serving(), "127.0.0.1") as port:
        enough = threading.Event()

        def come() -> None:
            while not enough.is_set():
                with knocking(port, 40, HALF), knocking(port, 10, EVENTS):
                    enough.wait(0.05)

        crowd = threading.Thread(target=come)
        crowd.start()
        try:
            for _ in range(3):
                ask(port)
        finally:
            enough.set()
            crowd.join(20.0)


@pytest.mark.parametrize("said", [b"", HALF, NO_BODY, b"GET / HTTP/1.1\r\n"])
def test_half_a_request_is_closed(said: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "PATIENCE", 1.5)
    with served(serving(), "127.0.0.1") as port, knocking(port, 5, said) as idle:
        for k, one in enumerate(idle):
            assert ended(one, 30.0), k
        with knocking(port, 1, HALF) as (slow,):  # one that says a little more all the time
            said_more = 0
            with contextlib.suppress(ConnectionError):
                while said_more < 150:
                    slow.sendall(b"x")
                    said_more += 1
                    time.sleep(0.2)
            assert said_more < 150


@pytest.mark.parametrize("turns", range(1, 25))
def test_who_comes_while_the_page_begins_or_ends_is_closed(turns: int) -> None:
    async def begin_and_end(listening: socket.socket) -> None:
        serve = asyncio.create_task(web.serve(make_app(serving(), TOKEN), listening))
        for _ in range(turns):
            await asyncio.sleep(0)
        serve.cancel()
        await asyncio.wait([serve])

    with contextlib.ExitStack() as crowd:
        listening = web.listen("127.0.0.1", 0)
        for _ in range(40):
            one = crowd.enter_context(socket.socket())
            one.setblocking(False)
            with contextlib.suppress(BlockingIOError):
                one.connect(listening.getsockname())
        asyncio.run(begin_and_end(listening))
    gc.collect()  # a connection that is left open warns now


def test_a_server_that_ends_by_itself_ends_well(monkeypatch: pytest.MonkeyPatch) -> None:
    async def ends(*_: object) -> bool:
        return True

    monkeypatch.setattr(web._Server, "on_tick", ends)
    listening = web.listen("127.0.0.1", 0)
    asyncio.run(web.serve(make_app(serving(), TOKEN), listening))
    assert listening.fileno() == -1


def test_who_does_not_read_is_dropped_and_blocks_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "STUCK", 1.0)
    monkeypatch.setattr(status, "OFTEN", 0.01)  # the buffers are full the sooner
    service = serving()
    for k in range(200):
        service.rezero("z_um", "x" * 400 + str(k))  # long messages
    with served(service, "127.0.0.1") as port, knocking(port, 20, EVENTS) as deaf:
        base = f"http://127.0.0.1:{port}"
        with httpx.stream("GET", f"{base}/api/events", timeout=20.0) as listening:
            lines, deadline = listening.iter_lines(), time.monotonic() + 5.0
            while time.monotonic() < deadline:  # who reads continues
                assert next(lines) is not None
            ask(port)
            for k, one in enumerate(deaf):
                one.settimeout(5.0)
                read = 0
                with contextlib.suppress(ConnectionError):
                    while found := one.recv(1 << 20):
                        read += len(found)
                assert 0 < read < 2_000_000, k


def test_the_oldest_idle_connection_goes_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "MOST", 10)
    with served(serving(), "127.0.0.1") as port, knocking(port, 3, EVENTS) as streams:
        for stream in streams:
            assert stream.recv(100)
        with httpx.Client(base_url=f"http://127.0.0.1:{port}") as operator:
            assert operator.get("/api/state").status_code == 200  # and stays connected
            with knocking(port, 6) as idle, knocking(port, 2):
                time.sleep(0.2)
                assert operator.get("/api/state").status_code == 200
                assert [ended(one, 0.1) for one in idle] == [True] * 2 + [False] * 4
                for stream in streams:
                    stream.settimeout(5.0)
                    assert stream.recv(100)
