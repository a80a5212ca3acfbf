"""Whatever a source or a sink raises is the trouble of its own link; the others and the service continue."""

import asyncio
import json
from collections.abc import AsyncIterator, Mapping
from pathlib import Path

import httpx
import pytest
from test_loop import Broken, Given, machine, running, say, until

from thermocomp.core.correction import Correction
from thermocomp.core.exceptions import ThermocompError
from thermocomp.core.ports import LinkStatus
from thermocomp.core.reading import Measurement, Reading
from thermocomp.live import links
from thermocomp.live.adapters.mqtt import MqttSink, MqttSource
from thermocomp.live.adapters.plain import FileSink, ReplaySource
from thermocomp.live.loop import Service
from thermocomp.live.page.page import make_app


class Outlandish(Exception):  # noqa: N818 - of a library that nobody knows
    pass


ERRORS = (
    ValueError("Invalid host."),
    KeyError("t"),
    UnicodeError("label empty or too long"),
    UnicodeDecodeError("utf-8", b"\xff", 0, 1, "invalid start byte"),
    RuntimeError("no running event loop"),
    AssertionError(),
    RecursionError("maximum recursion depth exceeded"),
    MemoryError(),
    ZeroDivisionError("division by zero"),
    StopAsyncIteration(),
    ExceptionGroup("several", [ValueError("a")]),
    asyncio.CancelledError(),
    Outlandish("\ud800\x1b[31m"),
    OSError(5, "Input/output error"),
    ThermocompError("lost"),
)


class Bad(Given):
    """A source that fails somewhere."""

    def __init__(self, error: BaseException, where: str) -> None:
        super().__init__()
        self.error, self.where, self.failed = error, where, False

    def fail(self, where: str) -> None:
        if self.where == where:
            self.failed = True
            raise self.error

    async def connect(self, timeout: float) -> None:
        await super().connect(timeout)
        self.fail("connect")

    async def readings(self) -> AsyncIterator[Reading]:
        self.fail("begin")
        async for one in super().readings():
            yield one
            self.fail("middle")

    async def measurements(self) -> AsyncIterator[Measurement]:
        self.fail("begin")
        await self.queue.get()
        yield Measurement(0.0, "z_um", 1.0, False)
        self.fail("middle")

    def status(self) -> LinkStatus:
        self.fail("status")
        return super().status()

    async def close(self) -> None:
        self.fail("close")


class BadSink(Broken):
    """A sink that fails somewhere."""

    def __init__(self, error: BaseException, where: str) -> None:
        super().__init__(hangs=False)
        self.error, self.where = error, where

    async def connect(self, timeout: float) -> None:
        self.tried += 1
        if self.where == "connect":
            raise self.error

    async def apply(self, corrections: Mapping[str, Correction]) -> None:
        if self.where == "apply":
            raise self.error

    async def confirmed(self) -> dict[str, Correction] | None:
        if self.where == "confirmed":
            raise self.error
        return {}

    def status(self) -> LinkStatus:
        return LinkStatus("connected")

    async def close(self) -> None:
        if self.where == "close":
            raise self.error


@pytest.fixture(autouse=True)
def quickly(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(links, "FIRST", 0.05)


async def shown(service: Service) -> list[dict[str, str]]:
    transport = httpx.ASGITransport(app=make_app(service))
    async with httpx.AsyncClient(transport=transport, base_url="http://127.0.0.1") as client:
        found: list[dict[str, str]] = (await client.get("/api/state")).json()["links"]
        return found


@pytest.mark.parametrize("error", ERRORS, ids=repr)
@pytest.mark.parametrize("where", ["connect", "begin", "middle", "status"])
def test_a_source_that_fails_stops_nothing(where: str, error: BaseException, tmp_path: Path) -> None:
    bad, probe, good, path = Bad(error, where), Bad(error, where), Given(), tmp_path / "out.json"
    service = Service(machine(), [bad, good], [FileSink(path=path)], probes=[probe], first_start="zero")

    async def work() -> None:
        say(bad, 20.0)
        probe.queue.put_nowait(None)
        await until(lambda: where == "status" or (bad.failed and probe.failed))
        await until(lambda: service.sinks[0].status().state == "connected")
        first, second, third, fourth = await shown(service)
        for one in (first, third):
            assert one["state"] == "failed"
            assert one["reason"].isprintable()
            assert len(one["reason"]) > 3
        assert second["state"] == fourth["state"] == "connected"
        count = service.counts["readings"]
        for k in range(3):
            say(good, 20.0 + k)
            await until(lambda k=k: service.counts["readings"] == count + k + 1)
        await until(lambda: path.exists() and '"offset_um": -4.0' in path.read_text())
        if where != "status":
            await until(lambda: bad.connects >= 2 and probe.connects >= 2)
            await until(lambda: sum(e.kind == "link" and e.text.startswith("Bad: ") for e in service.events) >= 2)

    if isinstance(error, asyncio.CancelledError) and where == "status":
        pytest.skip("a status is asked for at once: nothing can be cancelled")
    asyncio.run(running(service, work))


@pytest.mark.parametrize("error", ERRORS, ids=repr)
@pytest.mark.parametrize("where", ["connect", "apply", "confirmed", "close"])
def test_a_sink_that_fails_stops_nothing(where: str, error: BaseException, tmp_path: Path) -> None:
    source, bad, path, state = Given(), BadSink(error, where), tmp_path / "out.json", tmp_path / "state.json"
    service = Service(machine(), [source], [bad, FileSink(path=path)], state_path=state, first_start="zero")

    async def work() -> None:
        for k in range(3):
            say(source, 20.0 + k)
            await until(lambda k=k: service.counts["readings"] == k + 1)
        await until(lambda: path.exists() and '"offset_um": -4.0' in path.read_text())
        if where != "close":
            await until(lambda: bool(service.outlets[0].trouble))
            _, found, _ = await shown(service)
            assert (found["state"], found["reason"].isprintable()) == ("failed", True)

    asyncio.run(running(service, work))
    assert state.exists()
    assert json.loads(path.read_text())["corrections"]["z_um"]["offset_um"] == -4.0


def test_a_compensator_that_fails_at_a_reading_goes_on_with_the_next() -> None:
    good = Given()
    service = Service(machine(), [good], [])

    async def work() -> None:
        good.queue.put_nowait("no reading")  # type: ignore[arg-type]
        await until(lambda: "AttributeError" in service.links()[0].trouble)
        say(good, 20.0)
        await until(lambda: service.counts["readings"] == 1)
        await until(lambda: service.links()[0].trouble == "")

    asyncio.run(running(service, work))


def test_a_connection_that_hangs_is_tried_again_and_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(links, "TIMEOUT", 0.2)

    class Hanging(Given):
        async def connect(self, timeout: float) -> None:
            self.connects += 1
            await asyncio.sleep(1e6)

    bad, good = Hanging(), Given()
    service = Service(machine(), [bad, good], [])

    async def work() -> None:
        say(good, 20.0)
        await until(lambda: service.counts["readings"] == 1 and bad.connects >= 2)
        assert (await shown(service))[0] == {
            "kind": "source",
            "name": "Hanging",
            "state": "failed",
            "reason": "no answer in time",
            "replaced": 0,
        }

    asyncio.run(running(service, work))


@pytest.mark.parametrize(
    ("topic", "host"),
    [("machine/#/x", "127.0.0.1"), ("a", ""), ("a", "a..b"), ("a", "x" * 300), ("a\x00", "::1"), ("", "127.0.0.1")],
)
def test_a_broker_that_cannot_be_is_the_trouble_of_its_link(topic: str, host: str, tmp_path: Path) -> None:
    """What a configuration refuses, and what nobody checked."""
    source, path = Given(), tmp_path / "out.json"
    odd = MqttSource(topic=topic, host=host), MqttSink(topic=topic, host=host)
    day = tmp_path / "day.csv"
    day.write_bytes(b"time_s,t\n0,\xff\n")
    service = Service(
        machine(), [odd[0], source, ReplaySource(path=day)], [odd[1], FileSink(path=path)], first_start="zero"
    )

    async def work() -> None:
        say(source, 20.0)
        say(source, 21.0)
        await until(lambda: path.exists() and '"offset_um": -2.0' in path.read_text())
        states: list[str] = []
        async with asyncio.timeout(30.0):
            while states != ["failed", "connected", "failed", "failed", "connected"]:
                found = await shown(service)
                states = [one["state"] for one in found]
                await asyncio.sleep(0.01)
        assert "day.csv" in found[2]["reason"]

    asyncio.run(running(service, work))


@pytest.mark.parametrize(
    "content", ["[]", "{}", '{"corrections": []}', '{"corrections": {"z_um": 1}}', "[" * 100_000, "\ud800", "nan"]
)
def test_a_file_of_corrections_that_is_none_stops_nothing(content: str, tmp_path: Path) -> None:
    path, source = tmp_path / "out.json", Given()
    path.write_text(content, encoding="utf-8", errors="surrogatepass")
    service = Service(machine(), [source], [FileSink(path=path)], first_start="zero")

    async def work() -> None:
        say(source, 20.0)
        say(source, 21.0)
        await until(lambda: '"offset_um": -2.0' in path.read_text(encoding="utf-8", errors="replace"))

    asyncio.run(running(service, work))


def test_a_loss_and_a_return_are_told_once() -> None:
    source = Given()
    service = Service(machine(), [source], [])

    async def work() -> None:
        say(source, 20.0)
        await until(lambda: service.counts["readings"] == 1)
        source.queue.put_nowait(None)
        await until(lambda: source.connects == 2)
        await asyncio.sleep(2.5)

    asyncio.run(running(service, work))
    told = [e.text for e in service.events if e.kind == "link"]
    assert told == ["Given: lost", "Given: connected again"]
