"""A start from what is in force: confirmed, or last sent, or saved; otherwise nothing is sent until an order."""

import asyncio
import itertools
import json
import signal
import subprocess
import sys
import time
from collections.abc import Awaitable, Callable, Mapping
from datetime import datetime, timedelta
from functools import partial
from pathlib import Path
from typing import Any

import aiomqtt
import pytest
from broker import Mosquitto
from test_loop import Broken, Controller, Given, machine, running, say, until

from thermocomp.core.correction import Correction, Limits
from thermocomp.core.exceptions import ThermocompError
from thermocomp.core.ports import LinkStatus
from thermocomp.files import jsonfile
from thermocomp.live import statefile
from thermocomp.live.adapters.messages import write_message
from thermocomp.live.adapters.mqtt import ConfirmedMqttSink, MqttSink
from thermocomp.live.adapters.plain import FileSink
from thermocomp.live.loop import Service
from thermocomp.live.page.orders import PageOrder, give
from thermocomp.live.page.snapshot import snapshot

SLOW = Limits(rate=2.0)  # um/s
TOPIC = "m/7/corrections"


def service(sink: Any, state: Path | None, **options: Any) -> tuple[Service, Given]:
    source = Given()
    return Service(machine(SLOW), [source], [sink], state_path=state, **options), source


def word(own: Service) -> str:
    """Return the order in force for the target."""
    return own.state.orders["z_um"].word


async def heat(own: Service, source: Given, degrees: float, seconds: float) -> None:
    """Feed a zero, then a temperature above it."""
    end, first = time.monotonic() + seconds, True
    while time.monotonic() < end:
        say(source, 20.0 if first else 20.0 + degrees)
        first = False
        await asyncio.sleep(0.05)


async def listen(port: int, heard: list[tuple[float, dict[str, Any]]]) -> None:
    async with aiomqtt.Client("127.0.0.1", port) as client:
        await client.subscribe(f"{TOPIC}/#")
        async for message in client.messages:
            assert isinstance(message.payload, bytes)
            heard.append((time.monotonic(), {"topic": str(message.topic), **json.loads(message.payload)}))


def offsets(heard: list[tuple[float, dict[str, Any]]]) -> list[tuple[float, float]]:
    return [(at, m["corrections"]["z_um"]["offset_um"]) for at, m in heard if "corrections" in m]


def dated(state: Path, earlier: timedelta) -> None:
    """Let a state file have been written earlier, before this computer was started."""
    (entry,) = json.loads(state.read_text())["models"]
    entry["written"] = (datetime.fromisoformat(entry["written"]) - earlier).isoformat()
    state.write_text(jsonfile.pack(statefile.KIND, [entry | {"boot": ""}]))


def ran(own: Service, work: Callable[[], Awaitable[None]]) -> None:
    asyncio.run(running(own, work))


@pytest.mark.parametrize("spoiled", ["kept", "missing", "cut", "another model", "of another day"])
def test_a_restart_is_no_step(broker: Mosquitto, tmp_path: Path, spoiled: str) -> None:
    state, heard = tmp_path / "state.json", list[tuple[float, dict[str, Any]]]()
    first, source = service(MqttSink(topic=TOPIC, port=broker.port), state, first_start="zero")
    ran(first, lambda: heat(first, source, 3.0, 4.0))
    left = first.state.corrections["z_um"].offset
    assert left < -4.0
    if spoiled == "missing":
        state.unlink()
    elif spoiled == "cut":
        state.write_text(state.read_text()[:200])
    elif spoiled == "another model":
        state.write_text(state.read_text().replace('"models": "', '"models": "0'))
    elif spoiled == "of another day":
        dated(state, timedelta(days=2))
    again, source = service(MqttSink(topic=TOPIC, port=broker.port), state)

    async def work() -> None:
        listener = asyncio.create_task(listen(broker.port, heard))
        await asyncio.sleep(0.3)
        await heat(again, source, 0.0, 2.0)
        listener.cancel()

    ran(again, work)
    sent = offsets(heard)
    assert len(sent) > 3
    assert sent[0][1] == pytest.approx(left, abs=1.0)
    held = again.state.orders.get("z_um")
    assert (held.word if held else "runs") == ("runs" if spoiled == "kept" else "no zero")
    for (t, a), (later, b) in itertools.pairwise(sent):
        assert abs(b - a) <= SLOW.rate * (later - t + 0.3) + 1e-9


@pytest.mark.parametrize(("ago", "runs"), [(7200.0, False), (3 * 86400.0, True)])
def test_after_a_day_the_machine_is_cold_unless_it_was_compensated_since(
    broker: Mosquitto, tmp_path: Path, ago: float, runs: bool
) -> None:
    state = tmp_path / "state.json"
    first, source = service(MqttSink(topic=TOPIC, port=broker.port), state, first_start="zero")
    ran(first, lambda: heat(first, source, 3.0, 3.0))
    left = first.state.corrections["z_um"].offset
    assert left < -2.0
    dated(state, timedelta(days=3))
    again, source = service(MqttSink(topic=TOPIC, port=broker.port), state)

    async def work() -> None:
        async with aiomqtt.Client("127.0.0.1", broker.port) as client:
            message = write_message({"z_um": Correction(left)}, time.time() - ago)
            await client.publish(TOPIC, message, qos=1, retain=True)
        await running(again, lambda: heat(again, source, 0.0, 1.0))

    asyncio.run(work())
    assert ("z_um" not in again.state.orders) == runs


def test_a_zero_taken_on_a_machine_that_may_be_warm_is_never_used(broker: Mosquitto, tmp_path: Path) -> None:
    """Neither after another restart nor by another model; the order for a re-zero takes one."""
    state = tmp_path / "state.json"
    first, source = service(MqttSink(topic=TOPIC, port=broker.port), state, first_start="zero")
    ran(first, partial(heat, first, source, 3.0, 3.0))
    state.unlink()
    for _ in range(2):
        again, source = service(MqttSink(topic=TOPIC, port=broker.port), state)
        ran(again, partial(heat, again, source, 0.0, 1.5))
        held = again.state.orders["z_um"]
        assert held.word == "no zero"
        assert held.reason.startswith("there is no state.json, but z_um has -")
        assert again.state.corrections == first.state.corrections
    assert statefile.read_zero(state) is None
    last, source = service(MqttSink(topic=TOPIC, port=broker.port), state)

    async def work() -> None:
        await heat(last, source, 0.0, 0.5)
        assert give(last, PageOrder(target="z_um", do="run")) != ""
        assert give(last, PageOrder(target="z_um", do="rezero")) == ""
        await heat(last, source, 0.0, 1.0)
        assert last.state.orders == {}

    ran(last, work)
    assert statefile.read_zero(state) is not None


def test_nothing_is_sent_while_the_correction_in_force_is_unknown(broker: Mosquitto, tmp_path: Path) -> None:
    state, heard = tmp_path / "state.json", list[tuple[float, dict[str, Any]]]()
    state.write_text('{"format": "thermocomp-state", "version": 2, "sha256": "", "models": [{}]}')
    own, source = service(MqttSink(topic=TOPIC, port=broker.port), state)

    async def work() -> None:
        listener = asyncio.create_task(listen(broker.port, heard))
        await heat(own, source, 3.0, 1.5)
        assert offsets(heard) == []
        shown = snapshot(own, 1.0)
        assert shown["targets"][0]["at_controller"]["state"] == "not sent"
        assert (shown["targets"][0]["state"], shown["state"]["word"]) == ("unknown", "unknown")
        assert "order 'start'" in shown["alarms"][0]
        for do in ("run", "hold", "shadow", "rezero"):
            assert "unknown" in give(own, PageOrder(target="z_um", do=do))
        assert give(own, PageOrder(target="z_um", do="start")) == ""
        assert "is known" in give(own, PageOrder(target="z_um", do="start"))
        await heat(own, source, 3.0, 1.5)
        sent = offsets(heard)
        assert abs(sent[0][1]) <= SLOW.rate * 0.5
        assert sent[-1][1] < -1.0
        listener.cancel()

    ran(own, work)


def test_a_first_start_waits_for_an_order_also_after_a_restart(tmp_path: Path) -> None:
    path, state = tmp_path / "out.json", tmp_path / "state.json"
    for _ in range(2):
        own, source = service(FileSink(path=path), state)
        ran(own, partial(heat, own, source, 3.0, 1.5))
        assert own.state.orders["z_um"].word == "first start"
        assert not path.exists()
        assert state.exists()
    own, source = service(FileSink(path=path), state, first_start="zero")

    async def work() -> None:
        await heat(own, source, 3.0, 0.5)
        assert give(own, PageOrder(target="z_um", do="start")) == ""
        await heat(own, source, 3.0, 1.0)

    ran(own, work)
    assert path.exists()


def test_a_controller_that_comes_later_says_what_is_in_force(tmp_path: Path) -> None:
    controller = Controller()
    controller.offset = None
    own, _ = service(controller, tmp_path / "state.json")

    async def work() -> None:
        await until(lambda: "z_um" in own.state.orders)
        assert word(own) == "first start"
        controller.offset = -5.0
        await until(lambda: word(own) == "no zero")  # where a correction is in force it may be warm
        assert own.state.corrections["z_um"] == Correction(-5.0)

    ran(own, work)


class Late(Broken):
    """A sink out of reach at the start, which then knows what it was sent last, and confirms nothing."""

    def __init__(self) -> None:
        super().__init__(hangs=False)
        self.there, self.sent = False, list[float]()

    async def connect(self, timeout: float) -> None:
        if not self.there:
            raise ThermocompError("out of reach")

    async def apply(self, corrections: Mapping[str, Correction]) -> None:
        self.sent.append(corrections["z_um"].offset)

    async def last_sent(self) -> dict[str, Correction]:
        return {"z_um": Correction(-6.0)}

    def status(self) -> LinkStatus:
        return LinkStatus("connected" if self.there else "failed", "out of reach")


@pytest.mark.parametrize("first", ["order", "zero"])
def test_a_sink_that_is_out_of_reach_at_the_start_knows_later(tmp_path: Path, first: str) -> None:
    late = Late()
    own, source = service(late, tmp_path / "state.json", first_start=first)

    async def work() -> None:
        heating = asyncio.create_task(heat(own, source, 0.0, 30.0))
        await until(lambda: "z_um" in own.state.orders)
        late.there = True
        await until(lambda: word(own) == "no zero", 20.0)
        await until(lambda: len(late.sent) > 2)
        heating.cancel()

    ran(own, work)
    assert late.sent[0] == pytest.approx(-6.0, abs=SLOW.rate * 0.5)


def test_a_consumer_knows_state_reason_and_end(broker: Mosquitto, tmp_path: Path) -> None:
    heard = list[tuple[float, dict[str, Any]]]()
    sink = MqttSink(topic=TOPIC, port=broker.port)
    own, source = service(sink, tmp_path / "state.json", first_start="zero")

    async def work() -> None:
        await heat(own, source, 3.0, 1.0)
        listener = asyncio.create_task(listen(broker.port, heard))  # later: the messages are retained
        await until(lambda: len({m["topic"] for _, m in heard}) == 2)
        assert {m["topic"]: m.get("state") for _, m in heard} == {TOPIC: None, f"{TOPIC}/status": "running"}
        give(own, PageOrder(target="z_um", do="hold"))
        await heat(own, source, 3.0, 0.5)
        await until(lambda: offsets(heard)[-1:] != [])
        last = [m for _, m in heard if "corrections" in m][-1]
        assert last["corrections"]["z_um"]["state"] == "holding"
        assert last["corrections"]["z_um"]["reason"] == "by hand, on the page"
        numbers = [m["sequence"] for _, m in heard if "corrections" in m]
        assert numbers == sorted(set(numbers))
        listener.cancel()
        heard.clear()

    ran(own, work)

    async def after() -> None:
        listener = asyncio.create_task(listen(broker.port, heard))
        await until(lambda: any(m.get("state") == "stopped" for _, m in heard))
        listener.cancel()

    asyncio.run(after())


CHILD = """
import asyncio, sys
from thermocomp.files import jsonfile
from thermocomp.live import statefile
from thermocomp.live.adapters.messages import write_message
from thermocomp.live.adapters.mqtt import MqttSink
async def run():
    await MqttSink(topic=sys.argv[1], port=int(sys.argv[2])).connect(5.0)
    print("connected", flush=True)
    await asyncio.sleep(60.0)
asyncio.run(run())
"""


def test_a_killed_compensator_is_published_by_the_broker_as_lost(broker: Mosquitto) -> None:
    heard = list[tuple[float, dict[str, Any]]]()
    child = subprocess.Popen([sys.executable, "-c", CHILD, TOPIC, str(broker.port)], stdout=subprocess.PIPE, text=True)
    assert child.stdout is not None
    assert child.stdout.readline() == "connected\n"

    async def work() -> None:
        listener = asyncio.create_task(listen(broker.port, heard))
        await until(lambda: [m["state"] for _, m in heard] == ["running"])
        child.kill()
        await until(lambda: [m["state"] for _, m in heard] == ["running", "lost"])
        listener.cancel()
        heard.clear()
        later = asyncio.create_task(listen(broker.port, heard))
        await until(lambda: [m["state"] for _, m in heard] == ["lost"])
        later.cancel()

    try:
        asyncio.run(work())
    finally:
        child.kill()
        child.communicate()


def test_active_only_while_the_controller_confirms(broker: Mosquitto, tmp_path: Path) -> None:
    sink = ConfirmedMqttSink(topic=TOPIC, port=broker.port, confirm_topic="m/7/confirmed")
    own, source = service(sink, tmp_path / "state.json", first_start="zero")

    def word() -> str:
        return str(snapshot(own, 1.0)["targets"][0]["state"])

    async def confirm() -> None:
        async with aiomqtt.Client("127.0.0.1", broker.port) as client:
            await client.subscribe(TOPIC)
            async for message in client.messages:
                assert isinstance(message.payload, bytes)
                await client.publish("m/7/confirmed", message.payload)

    async def work() -> None:
        heating = asyncio.create_task(heat(own, source, 1.0, 60.0))
        await until(lambda: word() == "not confirmed")
        controller = asyncio.create_task(confirm())
        await until(lambda: word() == "active")
        controller.cancel()
        await until(lambda: word() == "not confirmed", 5.0)
        await asyncio.to_thread(broker.kill)
        await until(lambda: "MQTT" in " ".join(snapshot(own, 1.0)["alarms"]), 5.0)
        heating.cancel()

    ran(own, work)


def test_sent_is_not_confirmed(broker: Mosquitto, tmp_path: Path) -> None:
    own, source = service(MqttSink(topic=TOPIC, port=broker.port), tmp_path / "state.json", first_start="zero")

    async def work() -> None:
        await heat(own, source, 1.0, 2.0)
        shown = snapshot(own, 1.0)
        assert shown["targets"][0]["state"] == "sent, not confirmed"
        assert (shown["state"]["word"], shown["alarms"]) == ("sent, not confirmed", [])
        heating = asyncio.create_task(heat(own, source, 1.0, 30.0))
        await asyncio.to_thread(broker.kill)
        begin = time.monotonic()
        await until(lambda: snapshot(own, 1.0)["state"]["word"] == "not confirmed", 6.0)
        assert time.monotonic() - begin < 5.0
        assert "MQTT" in snapshot(own, 1.0)["alarms"][0]
        heating.cancel()

    ran(own, work)


async def report(port: int, offset: float) -> None:
    """Report a correction in force, ten times a second, as a controller."""
    own = {"offset_um": offset, "slope_um_per_m": 0.0, "reference_position_mm": 0.0}
    async with aiomqtt.Client("127.0.0.1", port) as client:
        while True:
            await client.publish("m/7/confirmed", json.dumps({"corrections": {"z_um": own}}))
            await asyncio.sleep(0.1)


def test_what_the_controller_confirms_goes_before_what_was_sent(broker: Mosquitto, tmp_path: Path) -> None:
    heard = list[tuple[float, dict[str, Any]]]()
    sink = ConfirmedMqttSink(topic=TOPIC, port=broker.port, confirm_topic="m/7/confirmed")
    own, source = service(sink, tmp_path / "state.json")

    async def before() -> None:
        own = {"offset_um": -2.0, "slope_um_per_m": 0.0, "reference_position_mm": 0.0}
        async with aiomqtt.Client("127.0.0.1", broker.port) as client:
            await client.publish(TOPIC, json.dumps({"corrections": {"z_um": own}}), retain=True)

    async def work() -> None:
        reporting = asyncio.create_task(report(broker.port, -9.0))
        listener = asyncio.create_task(listen(broker.port, heard))
        await heat(own, source, 0.0, 3.0)
        listener.cancel()
        reporting.cancel()

    asyncio.run(before())
    ran(own, work)
    sent = [offset for _, offset in offsets(heard) if offset != -2.0]
    assert sent[0] == pytest.approx(-9.0, abs=SLOW.rate * 0.5)


def test_a_confirmation_of_something_else_is_none(broker: Mosquitto, tmp_path: Path) -> None:
    sink = ConfirmedMqttSink(topic=TOPIC, port=broker.port, confirm_topic="m/7/confirmed")
    own, source = service(sink, tmp_path / "state.json", first_start="zero")

    def word() -> str:
        return str(snapshot(own, 1.0)["targets"][0]["state"])

    async def work() -> None:
        reporting = asyncio.create_task(report(broker.port, 0.0))
        heating = asyncio.create_task(heat(own, source, 0.1, 60.0))
        await until(lambda: word() == "active")
        await asyncio.sleep(1.5)  # noticed by the periodic work, too
        reporting.cancel()
        for wrong in (500.0, 5.0, -3.0):
            reporting = asyncio.create_task(report(broker.port, wrong))
            await until(lambda wrong=wrong: f"{wrong:+.1f} um in force" in " ".join(snapshot(own, 1.0)["alarms"]))
            assert word() == "not confirmed"
            reporting.cancel()
        await until(lambda: any("not confirmed" in e.text for e in own.events))
        heating.cancel()

    ran(own, work)


def test_a_broker_that_hangs_is_found(broker: Mosquitto, tmp_path: Path) -> None:
    own, source = service(MqttSink(topic=TOPIC, port=broker.port), tmp_path / "state.json", first_start="zero")

    async def work() -> None:
        heating = asyncio.create_task(heat(own, source, 1.0, 60.0))
        await until(lambda: snapshot(own, 1.0)["state"]["word"] == "sent, not confirmed")
        assert broker.process is not None
        broker.process.send_signal(signal.SIGSTOP)
        try:
            await until(lambda: snapshot(own, 1.0)["state"]["word"] == "not confirmed", 5.0)
        finally:
            broker.process.send_signal(signal.SIGCONT)
        await until(lambda: snapshot(own, 1.0)["state"]["word"] == "sent, not confirmed", 20.0)
        heating.cancel()

    ran(own, work)
