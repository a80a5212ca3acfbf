"""One word for the state of a target, everywhere; and alarms that say what to do."""

import asyncio
import json
import os
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import aiomqtt
import numpy as np
import pytest
from broker import Mosquitto
from driftmodels import growing
from test_loop import Given, machine, running, say, until
from test_page import TOKEN
from test_start_values import TOPIC

from thermocomp.core.correction import Correction, Limits
from thermocomp.core.exceptions import InputError
from thermocomp.core.reading import Measurement, Reading
from thermocomp.files import modelfile
from thermocomp.live.adapters.mqtt import ConfirmedMqttSink, MqttSink, MqttSource
from thermocomp.live.adapters.plain import FileSink
from thermocomp.live.build import build
from thermocomp.live.commands.serve import serve
from thermocomp.live.config import read_config
from thermocomp.live.journal.journal import JournalLimits
from thermocomp.live.journal.journalreader import JournalReader
from thermocomp.live.journal.journalrows import StateRow
from thermocomp.live.loop import Service
from thermocomp.live.page import orders, web
from thermocomp.live.page.page import make_app
from thermocomp.live.page.snapshot import snapshot
from thermocomp.live.recorder import Recorder
from thermocomp.runtime.compensator import Compensator

BACK = "m/7/in_force"


def shown(own: Service) -> tuple[str, str]:
    """Return the state of the only target on the page, with its reason."""
    (target,) = snapshot(own, 1.0)["targets"]
    return target["state"], target["reason"]


async def talk(source: Given) -> None:
    """Feed temperatures that change with each reading."""
    k = 0
    while True:
        say(source, 20.0 + 0.01 * (k := k + 1))
        await asyncio.sleep(0.1)


def test_message_page_journal_and_events_use_one_word(broker: Mosquitto, tmp_path: Path) -> None:
    """A controller that confirms, is killed, and comes again; and a sink that cannot confirm."""
    source, sent = Given(), list[dict[str, Any]]()
    sink = ConfirmedMqttSink(topic=TOPIC, port=broker.port, confirm_topic=BACK)
    own = Service(machine(), [source], [sink], first_start="zero")
    own.recorder = Recorder(tmp_path / "live.db", own.compensator, "off", own.clock, JournalLimits())

    async def controller() -> None:
        async with aiomqtt.Client("127.0.0.1", broker.port) as client:
            await client.subscribe(TOPIC)
            async for message in client.messages:
                await client.publish(BACK, message.payload)

    async def listen() -> None:
        async with aiomqtt.Client("127.0.0.1", broker.port) as client:
            await client.subscribe(TOPIC)
            async for message in client.messages:
                assert isinstance(message.payload, bytes)
                sent.append(json.loads(message.payload)["corrections"]["z_um"])

    async def work() -> None:
        tasks = [asyncio.create_task(talk(source)), asyncio.create_task(listen())]
        for word, alive in (("not confirmed", False), ("active", True), ("not confirmed", False)):
            answering = asyncio.create_task(controller()) if alive else None
            begin = time.monotonic()
            await until(lambda word=word: sent and sent[-1]["state"] == word, 12.0)
            if alive:
                await asyncio.sleep(6.0)  # it stays so
            else:
                assert time.monotonic() - begin < 5.5
            await until(lambda: shown(own)[0] == sent[-1]["state"], 1.0)
            assert shown(own) == (word, shown(own)[1])
            assert (sent[-1]["reason"] == "") == (word == "active")
            if answering is not None:
                answering.cancel()
        for task in tasks:
            task.cancel()

    asyncio.run(running(own, work))
    words = [s.row.word for s in JournalReader(tmp_path / "live.db").rows() if isinstance(s.row, StateRow)]
    events = [e.text.split(":")[0].removeprefix("z_um ") for e in own.events if e.kind == "state"]
    assert words == events == ["not confirmed", "active", "not confirmed"]
    assert [w for k, w in enumerate(s["state"] for s in sent) if k == 0 or sent[k - 1]["state"] != w] == words


def test_what_cannot_be_confirmed_is_sent_nowhere_active(broker: Mosquitto, tmp_path: Path) -> None:
    source, file = Given(), tmp_path / "out.json"
    own = Service(
        machine(), [source], [MqttSink(topic=TOPIC, port=broker.port), FileSink(path=file)], first_start="zero"
    )

    async def work() -> None:
        talking = asyncio.create_task(talk(source))
        await until(lambda: shown(own)[0] == "sent, not confirmed" and own.counts["readings"] > 5)
        await until(
            lambda: (
                file.exists() and json.loads(file.read_text())["corrections"]["z_um"]["state"] == "sent, not confirmed"
            )
        )
        talking.cancel()

    asyncio.run(running(own, work))
    assert not [e for e in own.events if "active" in e.text]


# -- no sink -----------------------------------------------------------------------------------------------------------


def configured(folder: Path, sinks: str, more: str = "") -> Path:
    folder.mkdir(exist_ok=True)
    modelfile.write([growing("z_um", 2.0)], folder / "z.json")
    modelfile.write([growing("x1_um", 1.0)], folder / "x.json")
    path = folder / "serve.toml"
    path.write_text(
        'models = ["z.json", "x.json"]\nown_compensation = "off"\nfirst_start = "zero"\n[[sources]]\nkind = "mqtt"\n'
        f'topic = "m"\n{sinks}{more}',
        encoding="ascii",
    )
    return path


def test_a_target_without_a_sink_is_told_at_the_start_and_on_the_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = configured(tmp_path, '[[sinks]]\nkind = "linuxcnc"\nsocket = "c.sock"\naxes = {z_um = "Z"}\n')
    advice = 'no sink carries x1_um: add it to axes of the LinuxCNC sink, x1_um = "..." for its axis, or add a table'
    with pytest.raises(InputError):  # LinuxCNC is not set up there
        serve(path, check=True)
    (tmp_path / "thermocomp.hal").write_text("--axis z,", encoding="ascii")
    capsys.readouterr()
    if not serve(path, check=True):
        assert advice in " ".join(capsys.readouterr().out.split())
    own = build(read_config(path))
    own.outlets[0].sink._connection.to("connected")  # type: ignore[attr-defined]
    for k in range(3):
        own.take(Reading(time.time(), {"t": 20.0 + k}))
    own.in_force.confirm({"z_um": own.state.corrections["z_um"]})
    state = snapshot(own, 1.0)
    words = {t["name"]: (t["state"], t["reason"]) for t in state["targets"]}
    assert words["z_um"] == ("active", "")
    assert words["x1_um"][0] == "no sink"
    assert advice in words["x1_um"][1]
    assert state["state"]["word"] == "active"
    assert advice in state["state"]["reason"]
    assert any(advice in e.text for e in own.events)


def test_without_any_sink_nothing_is_active(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = configured(tmp_path, "")
    assert serve(path, check=True) == 0
    assert "no sink carries z_um: add a table [[sinks]]" in " ".join(capsys.readouterr().out.split())
    own = build(read_config(path))
    own.take(Reading(time.time(), {"t": 20.0}))
    assert snapshot(own, 1.0)["state"]["word"] == "no sink"


# -- orders ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", ["start", "rezero"])
def test_the_command_in_the_alarm_is_the_order(tmp_path: Path, order: str) -> None:
    """Word by word, in a shell."""
    folder = tmp_path / "the mill's"
    folder.mkdir()
    (folder / "token.txt").write_text(TOKEN, encoding="ascii")
    state, file = folder / "state.json", folder / "out.json"
    if order == "rezero":  # 5 um are in force, and no state: the machine may be warm
        file.write_text(json.dumps({"corrections": {"z_um": {"offset_um": 5.0, "slope_um_per_m": 0.0,
                        "reference_position_mm": 0.0}}}), encoding="ascii")  # fmt: skip
    source = Given()
    own = Service(machine(), [source], [FileSink(path=file)], state_path=state)

    async def work() -> None:
        listening = web.listen("127.0.0.1", 0)
        serving = asyncio.create_task(web.serve(make_app(own, TOKEN), listening))
        url = "http://{}:{}".format(*listening.getsockname())
        own.in_force.way = lambda t, o: orders.explain_way(t, o, url, folder / "token.txt")
        talking = asyncio.create_task(talk(source))
        waits = {"start": "first start", "rezero": "no zero"}[order]
        await until(lambda: own.counts["readings"] > 3 and shown(own)[0] == waits)
        (alarm,) = [a for a in snapshot(own, 1.0)["alarms"] if waits in a]
        assert f"press {order.capitalize().replace('Rezero', 'Re-zero')} at z_um" in alarm
        command = alarm[alarm.index("curl ") :]
        told = await asyncio.to_thread(
            subprocess.run, ["/bin/sh", "-c", command], capture_output=True, text=True, check=False, timeout=20,
            env={**os.environ, "no_proxy": "*"},
        )  # fmt: skip
        assert json.loads(told.stdout) == {"done": order, "target": "z_um"}, (told, command)
        await until(lambda: shown(own)[0] == "sent, not confirmed", 20.0)
        assert not [a for a in snapshot(own, 1.0)["alarms"] if "curl" in a]
        for task in (talking, serving):
            task.cancel()

    asyncio.run(running(own, work))


def test_without_a_token_the_alarm_says_what_to_configure() -> None:
    own = Service(machine(), [], [FileSink(path=Path("out.json"))])
    own.in_force.way = lambda _target, _order: orders.NO_TOKEN
    own._begin()
    assert "set token_file in [page]" in shown(own)[1]


# -- messages that are refused -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("bad", "advice"),
    [
        ({"time": "2026-11-29T19:40:00Z", "t": 21.0}, "expected seconds since 1970 as a number, such as 1790000000.0"),
        ({"t": "21.0"}, "expected a number, not in quotes"),
    ],
)
def test_refused_messages_are_an_alarm_and_end_active(broker: Mosquitto, bad: dict[str, Any], advice: str) -> None:
    sink = ConfirmedMqttSink(topic=TOPIC, port=broker.port, confirm_topic=BACK)
    own = Service(machine(), [MqttSource(topic="m/t", port=broker.port)], [sink], first_start="zero")

    async def publish(message: Callable[[int], dict[str, Any]], seconds: float) -> None:
        async with aiomqtt.Client("127.0.0.1", broker.port) as client:
            for k in range(round(seconds / 0.1)):
                await client.publish("m/t", json.dumps(message(k)))
                await client.publish(BACK, json.dumps({"corrections": {"z_um": {"offset_um": 0.0,
                                     "slope_um_per_m": 0.0, "reference_position_mm": 0.0}}}))  # fmt: skip
                await asyncio.sleep(0.1)

    async def work() -> None:
        await asyncio.sleep(0.5)
        await publish(lambda k: {"t": 20.0 + 0.001 * k}, 4.0)
        assert shown(own)[0] == "active"
        assert snapshot(own, 1.0)["alarms"] == []
        await publish(lambda _: bad, 5.0)
        state = snapshot(own, 1.0)
        assert state["state"]["word"] == "holding"
        assert advice in state["targets"][0]["reason"]
        assert any(a.startswith("MQTT m/t: messages are refused:") and advice in a for a in state["alarms"])

    asyncio.run(running(own, work))


@pytest.mark.parametrize(("raw", "text"), [("21,3", '"21,3"'), ("n/a", '"n/a"'), (None, "null")])
def test_a_channel_sent_as_text_is_named_with_its_source(broker: Mosquitto, raw: str | None, text: str) -> None:
    source = MqttSource(topic="m/t", port=broker.port, names={"T": "t"})
    own = Service(machine(), [source], [])
    said = f"t: received {text} from MQTT m/t, expected a number, not in quotes"

    async def work() -> None:
        await asyncio.sleep(0.5)
        async with aiomqtt.Client("127.0.0.1", broker.port) as client:

            async def heard(message: dict[str, Any], alarms: list[str]) -> None:
                await client.publish("m/t", json.dumps(message))
                await until(lambda: snapshot(own, 1.0)["alarms"] == alarms)

            await heard({"T": 20.0, "other": 1.0}, [])
            await heard({"T": raw, "other": 1.0, "unit": "degC"}, [said])  # a text that no model uses is none
            await until(lambda: any(said == e.text for e in own.events))
            await client.publish("m/t", json.dumps({"other": 2.0}))
            await until(lambda: own.latest["other"][0] == 2.0)
            assert said in snapshot(own, 1.0)["alarms"]
            await heard({"T": 21.0}, [])

    asyncio.run(running(own, work))


# -- frozen from the first reading -------------------------------------------------------------------------------------


def fed(own: Service, values: list[float]) -> list[str]:
    """Feed temperatures; return the states."""
    found = list[str]()
    for value in values:
        own.take(Reading(time.time(), {"t": value}))
        found.append(own.find_status("z_um")[0].word)
    return found


def unconfirmed(limits: Limits = Limits(rate=1e9)) -> Service:
    own = Service(machine(limits), [], [FileSink(path=Path("out.json"))])
    own.outlets[0].sink._connection.to("connected")  # type: ignore[attr-defined]
    return own


def test_a_source_that_has_never_changed_is_not_active() -> None:
    own = unconfirmed()
    assert fed(own, [20.0] * 5)[1:] == ["holding"] * 4
    state = snapshot(own, 1.0)
    assert "no temperature has changed since the start at" in state["targets"][0]["reason"]
    assert state["sensors"][0]["state"] == "unchanged"
    own.measure(Measurement(time.time(), "z_um", 9.0, left=False, repeatability=0.1))
    assert fed(own, [20.0]) == ["holding"]
    assert own.state.learned == {}  # not corrected twice
    assert "no temperature has changed" in own.probings.checked[-1].refused
    assert own.state.corrections["z_um"] == Correction(0.0)
    assert fed(own, [20.5, 20.5]) == ["sent, not confirmed"] * 2  # the zero was known: nothing is lost
    assert own.state.corrections["z_um"].offset == -1.0


def test_a_correction_in_force_is_held_until_a_temperature_changes() -> None:
    own = unconfirmed()
    own.state = own.state._replace(corrections={"z_um": Correction(7.0)}, away=10.0)
    fed(own, [20.0] * 3)
    assert own.state.corrections["z_um"] == Correction(7.0)
    fed(own, [20.1])
    assert own.state.corrections["z_um"].offset == pytest.approx(-0.2)


def test_sources_that_work_are_not_held() -> None:
    rng = np.random.default_rng(0)
    assert "holding" not in fed(unconfirmed(), (20.0 + 0.01 * rng.standard_normal(50)).tolist())
    own = unconfirmed()
    own.compensator = Compensator(own.compensator.models, own.compensator.lines, repeats="exception")
    assert "holding" not in fed(own, [20.0] * 50)  # reports changes only
