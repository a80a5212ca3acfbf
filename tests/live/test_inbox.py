"""Messages that arrive faster than they are processed: the newest value of each channel, in time, in bounded memory."""

import asyncio
import math
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from broker import Mosquitto
from hypothesis import given
from hypothesis import strategies as st
from test_loop import machine

from thermocomp.core.reading import Reading
from thermocomp.live.adapters.inbox import LATE, MOST, Inbox
from thermocomp.live.adapters.mqtt import MqttSource
from thermocomp.live.latest import Latest
from thermocomp.live.loop import Service
from thermocomp.live.stamps import explain_stamp

NOW = 1_790_000_000.0


@given(
    st.lists(
        st.tuples(st.floats(0.0, 100.0), st.dictionaries(st.sampled_from("abc"), st.floats(-9.0, 9.0))), max_size=9
    )
)
def test_the_newest_value_of_each_channel_remains(messages: list[tuple[float, dict[str, float]]]) -> None:
    inbox = Inbox()
    newest: dict[str, tuple[float, float]] = {}
    for at, values in messages:
        inbox.put(Reading(at, values))
        for name, value in values.items():
            if name not in newest or newest[name][0] <= at:
                newest[name] = at, value
    if not messages:
        return
    found = asyncio.run(inbox.take())
    assert [r.time for r in found] == sorted({at for at, _ in newest.values()})
    assert {name: (r.time, v) for r in found for name, v in r.values.items()} == newest
    assert inbox.replaced == sum(len(values) for _, values in messages) - len(newest)


def test_a_message_that_may_have_waited_is_no_new_one() -> None:
    """The loop was busy, so nobody knows for how long it has been in the socket."""

    async def work() -> None:
        inbox = Inbox()
        pull = asyncio.ensure_future(inbox.take())
        await asyncio.sleep(1.5)
        assert time.time() - inbox.arrival() < 0.1  # none had come
        time.sleep(1.2)
        assert 1.2 <= time.time() - inbox.arrival() < 2.5
        inbox.put(Reading(1.0, {"a": 1.0}))
        await pull
        assert time.time() - inbox.arrival() < 0.1

    asyncio.run(work())


def test_its_memory_is_bounded_and_the_newest_stay() -> None:
    inbox = Inbox()
    for k in range(3 * MOST // 1000):
        inbox.put(Reading(float(k), {f"t{k} {n}": 1.0 for n in range(1000)}))
    found = asyncio.run(inbox.take())
    assert [r.time for r in found] == [float(k) for k in range(2 * MOST // 1000, 3 * MOST // 1000)]
    assert inbox.replaced == 2 * MOST


def resident() -> float:
    """Return the memory of this process [MB]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


#: sends MQTT messages by hand, since a client library would be too slow: port, messages a second, seconds
PUBLISH = """
import json, socket, sys, time
port, rate, seconds = int(sys.argv[1]), float(sys.argv[2]), float(sys.argv[3])
def packet(kind, body):
    assert len(body) < 128
    return bytes([kind, len(body)]) + body
out, sent, begin = socket.create_connection(("127.0.0.1", port)), 0, time.monotonic()
out.sendall(packet(0x10, bytes([0, 4]) + b"MQTT" + bytes([4, 2, 0, 60, 0, 0])))
while (passed := time.monotonic() - begin) < seconds:
    due = int(rate * passed) - sent
    row = json.dumps({"sent": time.time(), "other": 1.0}).encode()
    out.sendall(packet(0x30, bytes([0, 3]) + b"m/t" + row) * due)
    sent += due
    time.sleep(0.005)
print(sent)
"""


@pytest.mark.parametrize("seconds", [2.0, pytest.param(300.0, marks=pytest.mark.long)])
def test_a_slow_service_uses_fresh_values(tmp_path: Path, seconds: float) -> None:
    """5,000 messages a second, without time, against a service that takes 1 ms for each."""
    broker, memory, younger = Mosquitto(tmp_path), list[float](), list[float]()
    broker.start()
    busy = time.process_time()

    async def run() -> tuple[list[float], MqttSource, int]:
        source, ages = MqttSource(topic="m/t", port=broker.port), list[float]()
        await source.connect(5.0)
        try:
            stream = source.readings()
            pull = asyncio.ensure_future(anext(stream))
            await asyncio.sleep(0.2)  # subscribed
            command = [sys.executable, "-c", PUBLISH, str(broker.port), "5000", str(seconds)]
            process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
            while True:
                done, _ = await asyncio.wait({pull}, timeout=2.0)
                if not done and ages:  # all messages have been published
                    pull.cancel()
                    return ages, source, int(process.communicate()[0])
                if done:
                    sent, reading = pull.result().values["sent"], pull.result()
                    ages.append(time.time() - sent)
                    younger.append(reading.time - sent)
                    memory.append(resident())
                    time.sleep(0.001)  # the service is busy
                    pull = asyncio.ensure_future(anext(stream))
        finally:
            await source.close()

    try:
        ages, source, sent = asyncio.run(run())
    finally:
        broker.kill()
    used, early = np.quantile(ages, [0.5, 0.999]), max(memory[: 1 + len(memory) // 10])
    told = f"{used[0]:.3f} s, 99.9 % {used[1]:.3f} s, oldest {max(ages):.3f} s"
    print(f"{sent / seconds:.0f} messages/s, {len(ages)} readings, age {told}, {early:.0f} -> {memory[-1]:.0f} MB,")
    print(f"{1e6 * (time.process_time() - busy) / sent:.0f} us of processor time a message")
    assert max(younger) < LATE + 0.05  # if messages wait in the socket of a busy computer, their time tells it
    assert source.replaced > 0
    assert len(ages) < sent
    assert memory[-1] < early + 20.0


def test_an_older_value_does_not_replace_a_newer_one() -> None:
    latest = Latest(["t"])
    latest.take({"t": 1.0}, 100.0, 60.0, 95.0)
    latest.take({"t": 2.0}, 101.0, 60.0, 90.0)
    assert latest["t"] == (1.0, 95.0)
    assert latest.behind == 5.0
    latest.take({"t": 3.0}, 102.0, 60.0, 95.0)
    assert latest["t"] == (3.0, 95.0)
    assert latest.behind == 0.0


def test_values_behind_those_used_are_reported_once_a_minute() -> None:
    service = Service(machine(), [], [])
    now = time.time()
    for stamp in (now, now - 1.0, now - 30.0, now - 29.0):
        service.take(Reading(stamp, {"t": 20.0}))
    assert [e.text for e in service.events if "behind" in e.text] == [
        "values are ignored: their time is 30 s behind that of values before"
    ]


@pytest.mark.parametrize(
    ("stamp", "words"),
    [
        (NOW + 59.0, ""),
        (NOW - 60.0, ""),
        (NOW * 1e3, "looks like milliseconds"),
        ((NOW + 5000.0) * 1e6, "looks like microseconds"),
        (NOW * 1e9, "looks like nanoseconds"),
        (123.0, "since the start of the device"),
        (NOW + 7200.0, "7,200 s ahead of the clock of this computer, 2 h: the source sends local time"),
        (NOW - 3600.0 + 5.0, "3,595 s behind the clock of this computer, 1 h: the source sends local time"),
        (NOW - 19_800.0, "5.5 h: the source sends local time"),
        (NOW + 400.0, "400 s ahead of the clock of this computer, where 60 s are allowed: set the clock of the source"),
        (NOW - 40 * 86400.0, "where 60 s are allowed"),
        (-5.0, "since the start of the device"),
    ],
)
def test_a_stamp_that_cannot_be_right_is_named(stamp: float, words: str) -> None:
    found = explain_stamp(stamp, NOW, 60.0)
    assert words in found if words else not found


@given(st.floats(-1e18, 1e18))
def test_every_stamp_is_used_or_explained(stamp: float) -> None:
    assert math.isfinite(stamp)
    assert (explain_stamp(stamp, NOW, 60.0) == "") == (abs(stamp - NOW) <= 60.0)
