"""The service is killed on a warm machine and its state spoiled: no step, and never running with a wrong correction."""

import asyncio
import json
import random
import time
from collections.abc import Callable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import aiomqtt
import numpy as np
import paho.mqtt.publish as publisher
import pytest
from broker import Mosquitto
from shopfloor import FACTOR, RESTARTS, SEED, Machine, Service, model, undisturbed
from spoiledstates import SPOILED

from thermocomp.files import modelfile

#: rate in seconds of the world [um/s]
RATE = 3.0
#: time after which the correction must be sound, in seconds of the world: half an hour of the machine
SOON = 1800.0 / FACTOR
#: a message may be this late [s]
LATE = 0.3
TOPIC = "m/7/corrections"

CONFIG = f"""
models = ["model.json"]
state = "state.json"
speed = {FACTOR}
own_compensation = "off"
first_start = "FIRST"

[limits]
magnitude = 100.0
rate = {RATE / FACTOR}
reading_age = {2.0 * FACTOR}

[[sources]]
kind = "mqtt"
topic = "mill/temperatures"
port = PORT
virtual = true

[[sinks]]
kind = "mqtt"
topic = "{TOPIC}"
port = PORT
"""


class Heard(NamedTuple):
    """A message of the service."""

    at: float  #: monotonic clock [s]
    offset: float  #: [um]
    state: str


async def listen(port: int, heard: list[Heard]) -> None:
    """Note all corrections that are sent, as a controller; a broker that is lost is tried again."""
    while True:
        try:
            async with aiomqtt.Client("127.0.0.1", port, timeout=2.0) as client:
                await client.subscribe(TOPIC, qos=1)
                async for message in client.messages:
                    if message.payload and not message.retain:
                        assert isinstance(message.payload, bytes)
                        own = json.loads(message.payload)["corrections"]["z_um"]
                        heard.append(Heard(time.monotonic(), own["offset_um"], own["state"]))
        except aiomqtt.MqttError:
            await asyncio.sleep(0.05)


def restart(_: Path, broker: Mosquitto) -> None:
    broker.kill()
    broker.start()


def clear(_: Path, broker: Mosquitto) -> None:
    publisher.single(TOPIC, payload=None, retain=True, port=broker.port)


#: what happens while the service does not run, and whether it runs on afterwards
CASES: Mapping[str, tuple[Callable[[Path, Mosquitto], None], bool]] = {
    "nothing": (lambda _state, _broker: None, True),
    "broker restarted": (restart, True),
    "no retained message": (clear, True),
} | {name: (lambda state, _, spoil=spoil: spoil(state), False) for name, spoil in SPOILED.items()}


@pytest.mark.long
@pytest.mark.parametrize("case", CASES)
def test_a_restart_is_no_step_and_is_sound_or_held(case: str, tmp_path: Path) -> None:
    spoil, runs = CASES[case]
    rng, broker = random.Random(f"{case} {SEED}"), Mosquitto(tmp_path)
    broker.start()
    modelfile.write([model()], tmp_path / "model.json")
    config, service, machine = tmp_path / "serve.toml", Service(tmp_path), Machine(broker.port, FACTOR)
    heard, judged = list[Heard](), list[tuple[float, float]]()

    def configure(first: str) -> None:
        config.write_text(CONFIG.replace("FIRST", first).replace("PORT", str(broker.port)), encoding="ascii")

    async def work() -> None:
        listening = asyncio.create_task(listen(broker.port, heard))
        configure("zero")
        service.start()
        await asyncio.sleep(8.0)
        machine.start()
        await asyncio.sleep(45.0)
        configure("order")
        for _ in range(RESTARTS):
            await asyncio.to_thread(service.kill)
            await asyncio.to_thread(spoil, tmp_path / "state.json", broker)
            service.start()
            begin = time.monotonic()
            while heard[-1].at < begin and time.monotonic() < begin + 60.0:  # the start on a busy computer is no heat
                await asyncio.sleep(0.1)
            await asyncio.sleep(SOON + rng.uniform(2.0, 7.0))
            assert heard[-1].at > begin
            assert (heard[-1].state == "sent, not confirmed") == runs, heard[-1]
            judged.append((time.monotonic(), machine.deviation() + heard[-1].offset))
        listening.cancel()

    try:
        asyncio.run(work())
    finally:
        service.kill()
        machine.end()
        broker.kill()
    for before, after in pairwise(heard):
        assert abs(after.offset - before.offset) <= RATE * (after.at - before.at + LATE) + 1e-9
    assert max(abs(one.offset) for one in heard) > 10.0
    if runs:
        at, left = np.array(judged).T
        sound = np.interp(at, *_deviations(machine)) + undisturbed(machine, at, RATE)
        print(f"{case}: RMS {np.sqrt(np.mean(left**2)):.2f} um, {np.sqrt(np.mean(sound**2)):.2f} um without kills")
        assert np.sqrt(np.mean(left**2)) <= 1.5 * np.sqrt(np.mean(sound**2))


def _deviations(machine: Machine) -> tuple[Any, Any]:
    """Return the uncompensated deviation of the machine over the time of the world."""
    return machine.begun + (machine.time - machine.time[0]) / FACTOR, machine.truth
