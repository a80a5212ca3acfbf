"""Sources that publish changes only: unchanged values are valid while a counter advances, and no longer."""

import asyncio
import json
from contextlib import suppress
from pathlib import Path

import aiomqtt
import pytest
from broker import Mosquitto
from test_page import Told
from watchedmachine import watched_model

from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import SettingError
from thermocomp.core.reading import Reading
from thermocomp.files import modelfile
from thermocomp.live.adapters.mqtt import MqttSource
from thermocomp.live.adapters.network import MqttIn
from thermocomp.live.adapters.plain import FileSink
from thermocomp.live.adapters.reportedchanges import ReportedChanges
from thermocomp.live.build import build
from thermocomp.live.config import Config, ServiceSettings
from thermocomp.live.loop import Service
from thermocomp.runtime.compensator import Compensator

REST = {"t1_C": 22.0, "t2_C": 21.0, "t3_C": 20.5, "spindle_rpm": 0.0}


def test_unchanged_values_are_as_new_as_the_counter() -> None:
    source = ReportedChanges("beat")
    source.keep({"t1_C": 20.0, "beat": 7.0})

    def said(**values: float) -> dict[str, float]:
        return dict(source.complete(Reading(1.0, values)).values)

    assert said(beat=7.0) == {}  # what the broker had retained is not said to be valid now
    assert said(t2_C=21.0) == {"t2_C": 21.0}
    assert said(beat=8.0) == {"t1_C": 20.0, "t2_C": 21.0, "beat": 8.0}
    assert said(beat=8.0, t2_C=21.0) == {}  # a gateway that repeats its last message
    assert said(t2_C=21.0) == {}
    assert said(t1_C=20.5) == {"t1_C": 20.5}
    assert said(beat=9.0, t1_C=20.5) == {"t1_C": 20.5, "t2_C": 21.0, "beat": 9.0}


def test_a_source_has_a_counter_if_it_reports_changes_only() -> None:
    found = MqttIn(kind="mqtt", topic="m/#", repeats="exception", counter="n", names={"n": "beat"})
    source = found.open(Path(), 1.0)
    assert isinstance(source, MqttSource)
    assert source.counter == "beat"
    for wrong in ({"repeats": "exception"}, {"counter": "n"}):
        with pytest.raises(SettingError, match="needs the name of a counter"):
            MqttIn(kind="mqtt", topic="m/#", **wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("repeats", ["watch", "exception"])
def test_repeated_temperatures_are_no_stop_of_such_a_source(tmp_path: Path, repeats: str) -> None:
    (tmp_path / "m.json").write_text(modelfile.dumps([watched_model()]), encoding="utf-8")
    source = MqttIn(kind="mqtt", topic="m", repeats=repeats, counter="n" if repeats == "exception" else "")  # type: ignore[arg-type]
    service = build(ServiceSettings(Config(sources=(source,), models=("m.json",)), tmp_path))
    assert service.compensator.repeats == repeats


def test_retained_values_wait_for_the_counter(tmp_path: Path) -> None:
    broker = Mosquitto(tmp_path)
    broker.start()

    async def run() -> list[dict[str, float]]:
        found = list[dict[str, float]]()
        source = MqttSource(topic="m/#", port=broker.port, counter="beat")
        async with aiomqtt.Client("127.0.0.1", broker.port) as client:
            await client.publish("m/t1", json.dumps({"t1_C": 20.0}), qos=1, retain=True)
            await source.connect(5.0)

            async def listen() -> None:
                async for reading in source.readings():
                    found.append(dict(reading.values))

            task = asyncio.create_task(listen())
            await asyncio.sleep(0.3)
            for message in ({"t2_C": 21.0}, {"beat": 1}, {"beat": 1}, {"t2_C": 21.0}, {"beat": 2, "t2_C": 22.0}):
                await client.publish("m/x", json.dumps(message), qos=1)
                await asyncio.sleep(0.1)
            task.cancel()
            with suppress(asyncio.CancelledError):
                await task
            await source.close()
        return found

    try:
        assert asyncio.run(run()) == [
            {"t2_C": 21.0},
            {"t1_C": 20.0, "t2_C": 21.0, "beat": 1.0},
            {"t1_C": 20.0, "t2_C": 22.0, "beat": 2.0},
        ]
    finally:
        broker.kill()


def word(service: Service) -> str:
    assert service.said is not None
    return service.said.states["z_um"].word


def test_a_gateway_that_repeats_its_last_message_is_an_event(tmp_path: Path) -> None:
    clock, compensator = Told(), Compensator.of([watched_model()], Limits())
    service = Service(compensator, [], [FileSink(path=tmp_path / "out.json")], clock)
    for k in range(100):
        values = {n: v + 0.01 * ((7 * k + j) % 5) * (v > 0.0) for j, (n, v) in enumerate(REST.items())}
        clock.at = 10.0 * k
        service.take(Reading(clock.now(), values))
    assert word(service) == "active"
    for k in range(100, 125):
        clock.at = 10.0 * k
        service.take(Reading(clock.now(), values))
    assert word(service) == "holding"
    (event,) = (e for e in service.events if "holding" in e.text)
    assert "all 3 temperatures have repeated for 16 readings" in event.text
    assert service.said is not None
    assert service.said.failed == {}
