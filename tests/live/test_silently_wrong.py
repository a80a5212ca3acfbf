"""What looks right and is not: another sender, a clock that was set, a slope, repeated values, a spindle in reverse."""

import asyncio
import json
import re
import time
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import aiomqtt
import pytest
from broker import Mosquitto
from driftmodels import ACCEPTED, lags
from test_loop import machine, running, until
from test_start_values import SLOW, TOPIC, dated, heat, listen, ran, service

from thermocomp.core.correction import Correction, Limits
from thermocomp.core.exceptions import ReadingError
from thermocomp.core.ports import Confirming
from thermocomp.core.reading import Reading
from thermocomp.files import jsonfile
from thermocomp.live import statefile
from thermocomp.live.adapters.messages import read_message
from thermocomp.live.adapters.mqtt import ConfirmedMqttSink, MqttSink
from thermocomp.live.clock import ServiceClock
from thermocomp.live.inforce import ConfirmedCorrections
from thermocomp.live.loop import Service
from thermocomp.live.page.snapshot import snapshot
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.lines import DeviationLine, constant
from thermocomp.runtime.orders import AVERAGED, wait_for_start, zero_anew


def shown(own: Service) -> dict[str, Any]:
    target: dict[str, Any] = snapshot(own, 1.0)["targets"][0]
    return target


def test_a_second_sender_on_the_topic_is_an_alarm(broker: Mosquitto, tmp_path: Path) -> None:
    """Of two services the controller gets the corrections in turn; each of them knows."""
    sinks = [MqttSink(topic=TOPIC, port=broker.port) for _ in range(2)]
    (one, source), (other, more) = (
        service(sink, tmp_path / f"{k}.json", first_start="zero") for k, sink in enumerate(sinks)
    )

    async def second() -> None:
        heating = asyncio.create_task(heat(other, more, 0.2, 60.0))  # less than a warm machine
        await until(lambda: shown(one)["state"] == shown(other)["state"] == "not confirmed")
        assert "another sender" in shown(one)["reason"]
        assert any("another sender" in alarm for alarm in snapshot(other, 1.0)["alarms"])
        heating.cancel()

    async def work() -> None:
        heating = asyncio.create_task(heat(one, source, 0.2, 60.0))
        await until(lambda: shown(one)["state"] == "sent, not confirmed")
        await asyncio.sleep(1.0)
        assert shown(one)["state"] == "sent, not confirmed"  # its own messages are those of no other
        await running(other, second)
        heating.cancel()

    ran(one, work)


def test_lost_of_an_earlier_connection_does_not_remain(broker: Mosquitto) -> None:
    """The broker may find out after the new connection that the old one is dead (keep-alive: 90 s)."""
    heard = list[tuple[float, dict[str, Any]]]()

    async def work() -> None:
        sink = MqttSink(topic=TOPIC, port=broker.port)
        listener = asyncio.create_task(listen(broker.port, heard))
        await sink.connect(5.0)
        async with aiomqtt.Client("127.0.0.1", broker.port) as client:
            await client.publish(f"{TOPIC}/status", '{"state": "lost"}', qos=1, retain=True)
        await until(lambda: [m["state"] for _, m in heard] == ["running", "lost", "running"])
        await sink.close()
        await until(lambda: heard[-1][1]["state"] == "stopped")
        await asyncio.sleep(0.3)
        assert heard[-1][1]["state"] == "stopped"
        listener.cancel()

    asyncio.run(work())


def rewritten(state: Path, change: Callable[[dict[str, Any]], None]) -> None:
    (entry,) = json.loads(state.read_text())["models"]
    change(entry)
    state.write_text(jsonfile.pack(statefile.KIND, [entry]))


def warm(broker: Mosquitto, state: Path) -> None:
    """Leave a state on a warm machine whose corrections have faded."""
    first, source = service(MqttSink(topic=TOPIC, port=broker.port), state, first_start="zero")

    async def work() -> None:
        await heat(first, source, 3.0, 3.0)
        await first.fade_out()

    ran(first, work)
    assert abs(first.state.raw["z_um"].offset) > 4.0
    assert first.state.corrections["z_um"] == Correction(0.0)


@pytest.mark.parametrize("hours", [-1.0, 1.0, 50.0])
def test_a_clock_that_was_set_makes_no_new_zero(broker: Mosquitto, tmp_path: Path, hours: float) -> None:
    state = tmp_path / "state.json"
    warm(broker, state)

    def move(entry: dict[str, Any]) -> None:
        entry["written"] = (datetime.fromisoformat(entry["written"]) - timedelta(hours=hours)).isoformat()

    rewritten(state, move)
    again, source = service(MqttSink(topic=TOPIC, port=broker.port), state)
    ran(again, lambda: heat(again, source, 3.0, 1.0))
    assert again.state.raw["z_um"].offset == pytest.approx(6.0)
    assert again.keeper.cold == ""
    (age,) = (m[1] for e in again.events if (m := re.match(r"start after (\d+) s", e.text)))
    assert int(age) < 20


def test_a_warm_state_of_a_time_to_come_is_held(broker: Mosquitto, tmp_path: Path) -> None:
    """Another boot, and the clock is earlier than before: nobody knows how long the machine has cooled."""
    state = tmp_path / "state.json"
    warm(broker, state)
    dated(state, timedelta(hours=-1))
    again, source = service(MqttSink(topic=TOPIC, port=broker.port), state)
    ran(again, lambda: heat(again, source, 3.0, 1.0))
    assert again.state.orders["z_um"].word == "no zero"
    assert "of a time to come" in again.state.orders["z_um"].reason


def test_a_slope_is_confirmed_over_the_travel() -> None:
    class Told(ConfirmedMqttSink):
        async def confirmed(self) -> dict[str, Correction] | None:
            return None

    sink = Told(topic="m/c", confirm_topic="m/d")
    assert isinstance(sink, Confirming)
    own = Service(machine(SLOW), [], [sink])
    lines = {"z_um": DeviationLine(slice(0, 1), (0.0, 500.0), constant)}
    found = ConfirmedCorrections([sink], ServiceClock(), lines)
    sink._connection.to("connected")
    found.demand({"z_um": Correction(-3.0, 100.0)})
    found.confirm({"z_um": Correction(-3.0, 99.0)})
    assert found.at_controller("z_um", own.outlets).word == "confirmed"
    found.confirm({"z_um": Correction(-3.0, 0.0)})  # 50 um are missing at the end of the travel
    told = found.at_controller("z_um", own.outlets)
    assert told.word == "not confirmed"
    assert "at 500 mm, the controller has -3.0 um in force, where +47.0 um were sent" in told.reason


def test_repeated_values_are_no_good_sensors() -> None:
    own = Service(machine(), [], [])
    for k in range(60):
        own.take(Reading(time.time(), {"t": 20.0 + 0.01 * (k % 7) + 0.02 * k}))
    assert snapshot(own, 1.0)["sensors"][0]["state"] == "not watched"
    for _ in range(30):
        own.take(Reading(time.time(), {"t": 22.0}))
    assert "the source has stopped" in snapshot(own, 1.0)["rejected"]
    assert snapshot(own, 1.0)["sensors"][0]["state"] == "stale"
    own.take(Reading(time.time(), {"t": 22.1}))
    assert snapshot(own, 1.0)["sensors"][0]["state"] == "not watched"


def test_a_new_zero_is_not_taken_from_a_source_that_has_stopped() -> None:
    own = Service(machine(), [], [])
    for k in range(60):
        own.take(Reading(time.time(), {"t": 20.0 + 0.01 * (k % 7)}))
    for _ in range(30):
        own.take(Reading(time.time(), {"t": 22.0}))
    own.state = zero_anew(own.compensator, wait_for_start(own.state, "z_um", AVERAGED))
    for _ in range(30):
        own.take(Reading(time.time(), {"t": 22.0}))
    assert own.state.references == {}
    own.take(Reading(time.time(), {"t": 22.1}))
    assert "z_um" in own.state.references


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_spindle_in_reverse_is_as_warm(sign: float) -> None:
    model = replace(lags(), honest_error=ACCEPTED)
    own = Service(Compensator.of([model], Limits(rate=1e9, magnitude=100.0)), [], [])
    own.take(Reading(time.time(), {"spindle_rpm": 0.0}))
    own.take(Reading(time.time(), {"spindle_rpm": sign * 4000.0}))
    assert own.state.raw["z_um"].offset == pytest.approx(0.8, abs=0.1)  # 0.0002 um per 1/min at once


@pytest.mark.parametrize("message", ['{"t1_C": "21.3"}', '{"data": {"t1_C": 21.3}}', '{"time": 1.0}'])
def test_a_message_without_a_number_is_refused_with_a_reason(message: str) -> None:
    with pytest.raises(ReadingError, match="without any number"):
        read_message(message, 1.0, {})
