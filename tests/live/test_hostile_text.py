"""Hostile text and names without end, through a real broker: refused at the door, and the page continues telling."""

import asyncio
import json
import threading
import time
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import aiomqtt
import httpx
import pytest
from broker import Mosquitto
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from test_loop import machine
from test_page import TOKEN

from thermocomp.core.exceptions import InputError, ThermocompError
from thermocomp.core.ports import Probe, Source
from thermocomp.live.adapters.mqtt import MqttSource
from thermocomp.live.adapters.plain import ReplaySource
from thermocomp.live.adapters.probes import MqttProbe
from thermocomp.live.config import read_config
from thermocomp.live.loop import Service
from thermocomp.live.page import web
from thermocomp.live.page.page import make_app

Message = tuple[str, bytes]


class Floor:
    """A service with a page, in a thread, between a broker and whoever publishes."""

    def __init__(self, broker: Mosquitto) -> None:
        self.broker, self.loop = broker, asyncio.new_event_loop()
        source = MqttSource(topic="m/#", port=broker.port)
        probe = MqttProbe(topic="p", port=broker.port)
        self.service = Service(machine(), [source], [], probes=[probe])
        self.listening = web.listen("127.0.0.1", 0)
        self.url = "http://{}:{}".format(*self.listening.getsockname())
        work: list[Coroutine[Any, Any, None]] = [
            self.service.run(),
            web.serve(make_app(self.service, TOKEN), self.listening),
        ]
        self.tasks = [self.loop.create_task(one) for one in work]
        self.thread = threading.Thread(target=lambda: self.loop.run_until_complete(asyncio.wait(self.tasks)))
        self.count = 0

    def publish(self, messages: list[Message]) -> None:
        """Publish messages and wait until they have come through."""
        self.count += 1
        sign = 20.0 + self.count % 7 + self.count * 1e-6

        async def work() -> None:
            async with aiomqtt.Client("127.0.0.1", self.broker.port) as client:
                for topic, payload in messages:
                    await client.publish(topic, payload, qos=1)
                await client.publish("m/good", json.dumps({"t": sign}), qos=1)

        asyncio.run(work())
        self.until(lambda: self.service.latest.get("t", (0.0, 0.0))[0] == sign)

    def until(self, right: Callable[[], bool]) -> None:
        """Wait until something holds."""
        deadline = time.monotonic() + 20.0
        while not right():
            assert time.monotonic() < deadline
            assert not any(t.done() for t in self.tasks)
            time.sleep(0.01)

    def state(self) -> dict[str, Any]:
        """Ask for the state, twice: as JSON, and as an event."""
        answer = httpx.get(f"{self.url}/api/state", timeout=20.0)
        assert answer.status_code == 200
        assert httpx.get(f"{self.url}/api/curves", timeout=20.0).status_code == 200
        with httpx.stream("GET", f"{self.url}/api/events", timeout=20.0) as stream:
            event = json.loads(next(stream.iter_lines()).removeprefix("data: "))
        assert set(event["state"]) == set(answer.json())
        found: dict[str, Any] = answer.json()
        return found


@contextmanager
def floor(folder: Path) -> Iterator[Floor]:
    broker = Mosquitto(folder)
    broker.start()
    found = Floor(broker)
    ends: list[Source | Probe] = [*found.service.sources, *found.service.probes]
    found.thread.start()
    try:
        found.until(lambda: all(one.status().state == "connected" for one in ends))
        time.sleep(0.3)  # it has subscribed
        yield found
    finally:
        for task in found.tasks:
            found.loop.call_soon_threadsafe(task.cancel)
        found.thread.join(20.0)
        found.loop.close()
        broker.kill()


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Floor]:
    with floor(tmp_path_factory.mktemp("shop")) as found:
        yield found


HOSTILE = [
    b'{"\\ud800": 1}',
    b'{"t": 1, "\\udfff\\ud800": 1}',
    b'{"\xed\xa0\x80": 1}',  # half a surrogate pair in what would be UTF-8
    b'{"t\\u0000": 1}',
    b'{"\\u001b[31m": 1}',
    b'{"\\u202e": 1}',
    json.dumps({"x" * 50_000: 1}).encode(),
    json.dumps({"t": 1, "\n": 2}).encode(),
    b'{"t": "\\ud800"}',
    b'{"t": "\\u0007"}',
    '{"t": 1}'.encode("utf-16"),
    b'{"t": 1, "t": 90}',
    b'{"time": "\\ud800", "t": 1}',
    b"\xff",
]
PROBINGS = [
    b'{"target": "\\ud800", "measured_um": 1, "under_correction": true}',
    b'{"target": "a\\u0000", "measured_um": 1, "under_correction": false}',
    json.dumps({"target": "z" * 1000, "measured_um": 1, "under_correction": True}).encode(),
    b'{"\\ud800": 1}',
    b'{"target": "z_um", "measured_um": 1, "under_correction": true, "\\udc00": 1}',
]


def test_each_hostile_message_is_refused_with_a_reason(shop: Floor) -> None:
    before = shop.service.counts["readings"]
    source, probe = shop.service.sources[0], shop.service.probes[0]
    refused = source.refused, probe.refused  # type: ignore[attr-defined]
    shop.publish([("m/7", payload) for payload in HOSTILE] + [("p", payload) for payload in PROBINGS])
    shop.until(lambda: probe.refused == refused[1] + len(PROBINGS))  # type: ignore[attr-defined]
    assert source.refused == refused[0] + len(HOSTILE)  # type: ignore[attr-defined]
    assert shop.service.counts["readings"] == before + 1
    state = shop.state()
    assert [s["name"] for s in state["sensors"]] == ["t"]
    shop.until(lambda: sum("messages refused" in e.text for e in shop.service.events) >= 2)
    texts = [e["text"] for e in shop.state()["events"] if "messages refused" in e["text"]]
    assert any("m/7: a message" in t for t in texts)
    assert any("MQTT p: " in t for t in texts)
    assert all(t.isprintable() for t in texts)


text = st.text(st.characters(codec=None), max_size=12) | st.sampled_from(["t", "time", "target", "\ud800", "\x00"])
values = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | text,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(text, inner, max_size=3),
    max_leaves=6,
)
tables = st.dictionaries(text, values, max_size=8).map(lambda t: json.dumps(t).encode())
raw = st.dictionaries(text, st.floats(), max_size=5).map(
    lambda t: json.dumps(t, ensure_ascii=False).encode("utf-8", "surrogatepass")
)
probings = st.builds(
    lambda name, measured, left: json.dumps(
        {"target": name, "measured_um": measured, "under_correction": left}
    ).encode(),
    text,
    st.floats(),
    st.booleans() | text,
)
# who publishes control characters in a topic is thrown out by mosquitto itself
topics = st.text(st.characters(codec="utf-8", exclude_categories=["C"], exclude_characters="+#"), max_size=8).map(
    lambda t: f"m/{t}"
)
message = st.tuples(topics, tables | raw | st.binary(max_size=40)) | st.tuples(st.just("p"), tables | probings)


@settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.lists(message, max_size=15))
def test_whatever_comes_in_the_page_tells(shop: Floor, messages: list[Message]) -> None:
    shop.publish(messages)
    state = shop.state()
    assert state["counts"]["readings"] > 0
    for one in (*state["sensors"], *state["events"], *state["links"]):
        for word in one.values():
            assert not isinstance(word, str) or word.replace("\n", "").isprintable()


def test_names_without_end_are_counted_and_cost_nothing(tmp_path: Path) -> None:
    with floor(tmp_path) as shop:
        shop.publish([])
        few = time.monotonic()
        shop.state()
        few = time.monotonic() - few
        for second in range(10):
            names = [[f"x{second}_{k}_{n}" for n in range(900)] for k in range(10)]
            shop.publish([("m/7", json.dumps(dict.fromkeys(found, 1.5)).encode()) for found in names])
        began = time.monotonic()
        state = shop.state()
        assert time.monotonic() - began < max(1.0, 20 * few)
        assert len(state["sensors"]) == 65
        assert state["left_out"] == 10_000
        assert next(s for s in state["sensors"] if s["name"] == "t")["value"] > 20.0
        assert len(shop.service.latest) == 65
        told = [e.text for e in shop.service.events]
        assert any("names that no model uses" in t for t in told)
        assert len(told) < 15


def test_events_are_not_drowned(tmp_path: Path) -> None:
    with floor(tmp_path) as shop:
        shop.publish([])
        shop.until(lambda: "z_um" in shop.service.state.raw)
        shop.service.rezero("z_um", "a new part")
        for k in range(5):
            many: list[Message] = [("m/7", b"{")] * 100
            found = [{"target": f"a{k}_{n}", "measured_um": 1, "under_correction": True} for n in range(100)]
            shop.publish(many + [("p", json.dumps(one).encode()) for one in found])
            time.sleep(1.1)
        texts = [e["text"] for e in shop.state()["events"]]
        assert "z_um is re-zeroed: a new part" in texts
        assert sum("refused: no target" in t for t in texts) <= 30
        assert sum("messages refused" in t for t in texts) == 1


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('topic = "m"', 'topic = "m\\u0007"', "sources.1.topic: 'm\\x07' contains non-printable characters"),
        (
            'topic = "m"',
            'topic = "m"\nnames = {"a\\u202E" = "t"}',
            "sources.1.names: 'a\\u202e' contains non-printable characters",
        ),
        (
            'topic = "m"',
            'topic = "m"\nnames = {a = "t\\n"}',
            "sources.1.names.a: 't\\n' contains non-printable characters",
        ),
        (
            'topic = "m"',
            'topic = "m"\nhost = "a\\u0000b"',
            "sources.1.host: 'a\\x00b' contains non-printable characters",
        ),
        ("[[sources]]", f'state = "{"s" * 70_000}"\n[[sources]]', "characters; at most 65,535"),
    ],
)
def test_a_configuration_with_text_that_cannot_be_printed(old: str, new: str, says: str, tmp_path: Path) -> None:
    text = 'models = ["a.json"]\n[[sources]]\nkind = "mqtt"\ntopic = "m"\n'
    path = tmp_path / "serve.toml"
    path.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_config(path)
    assert says in str(caught.value)
    assert str(caught.value).replace("\n", "").isprintable()


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"time_s,t\x07_C\n0,20\n", "line 1: 't\\x07_C' contains non-printable characters"),
        (b"time_s," + b"t" * 500 + b"\n0,20\n", "at most 200"),
        (b"time_s,t_C\n0,20\n1,\xff\n2,20\n", " cannot be read"),
        (b"time_s,\xff\n0,20\n", " cannot be read"),
        (b"t_C\n20\n", "no column time_s"),
        (b"", "no column time_s"),
        (b'time_s,t_C\n0,"' + b"x" * 200_000 + b'"\n', " cannot be read"),
    ],
)
def test_a_recording_that_cannot_be_replayed(content: bytes, says: str, tmp_path: Path) -> None:
    path = tmp_path / "day.csv"
    path.write_bytes(content)
    source = ReplaySource(path=path, speed=1e6)

    async def play() -> None:
        await source.connect(1.0)
        async for _ in source.readings():
            pass

    for _ in range(2):  # it is not played to its end by trying again
        with pytest.raises(ThermocompError, match=r"day\.csv") as caught:
            asyncio.run(play())
        assert says in str(caught.value)
        assert source.status().state == "failed"
