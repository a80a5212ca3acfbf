"""The service between sources and sinks: what is lost comes back, and nothing stops the rest."""

import asyncio
import json
import time
from collections.abc import AsyncIterator, Mapping
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import aiomqtt
import pytest
from broker import Mosquitto
from driftmodels import ACCEPTED, growing

from thermocomp.core.correction import Correction, Limits
from thermocomp.core.exceptions import InputError, ThermocompError
from thermocomp.core.inputs import Input
from thermocomp.core.ports import LinkStatus
from thermocomp.core.reading import Measurement, Reading
from thermocomp.live import inforce, statefile
from thermocomp.live.adapters.mqtt import MqttSink, MqttSource
from thermocomp.live.adapters.plain import FileSink
from thermocomp.live.adapters.probes import MqttProbe
from thermocomp.live.loop import Service
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.state import Status

QUICK = Limits(rate=1e9)


def machine(limits: Limits = QUICK) -> Compensator:
    return Compensator.of([growing("z_um", 2.0)], limits)


class Given:
    """A source that says what it is given."""

    def __init__(self) -> None:
        self.queue: asyncio.Queue[Reading | None] = asyncio.Queue()
        self.connects = 0

    async def connect(self, timeout: float) -> None:
        self.connects += timeout > 0

    async def readings(self) -> AsyncIterator[Reading]:
        while (reading := await self.queue.get()) is not None:
            yield reading
        raise ThermocompError("lost")

    def status(self) -> LinkStatus:
        return LinkStatus("connected")

    async def close(self) -> None:
        pass


class Broken:
    """A sink that never takes anything, or hangs."""

    def __init__(self, *, hangs: bool) -> None:
        self.hangs, self.tried = hangs, 0

    async def connect(self, timeout: float) -> None:
        self.tried += timeout > 0

    async def apply(self, corrections: Mapping[str, Correction]) -> None:
        if self.hangs:
            await asyncio.sleep(1e6)
        raise ThermocompError(f"refused {len(corrections)}")

    def status(self) -> LinkStatus:
        return LinkStatus("failed")

    async def close(self) -> None:
        pass


def say(source: Given, temperature: float) -> None:
    source.queue.put_nowait(Reading(time.time(), {"t": temperature}))


async def until(right: object, seconds: float = 10.0) -> None:
    """Wait until something holds."""
    assert callable(right)
    async with asyncio.timeout(seconds):
        while not right():
            await asyncio.sleep(0.01)


async def running(service: Service, work: object) -> None:
    """Do something while the service runs."""
    assert callable(work)
    task = asyncio.create_task(service.run())
    try:
        await work()
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


def test_readings_go_in_and_corrections_come_out(tmp_path: Path) -> None:
    source, path = Given(), tmp_path / "corrections.json"
    service = Service(machine(), [source], [FileSink(path=path)], first_start="zero")

    async def work() -> None:
        for k in range(3):
            say(source, 20.0 + k)
            await until(lambda k=k: service.counts["readings"] == k + 1)
        await until(lambda: path.exists() and json.loads(path.read_text())["corrections"]["z_um"]["offset_um"] == -4.0)

    asyncio.run(running(service, work))
    assert service.counts == {"readings": 3, "rejected": 0}
    (told,) = [e.text for e in service.events if e.kind == "state"]
    assert told == f"z_um sent, not confirmed: file {path} does not confirm what the controller has"


@pytest.mark.parametrize("hangs", [True, False])
def test_one_dead_sink_and_a_lost_source_stop_nothing(hangs: bool, tmp_path: Path) -> None:
    first, second, broken, path = Given(), Given(), Broken(hangs=hangs), tmp_path / "corrections.json"
    service = Service(machine(), [first, second], [broken, FileSink(path=path)], first_start="zero")

    async def work() -> None:
        say(second, 20.0)
        await until(lambda: service.counts["readings"] == 1)
        first.queue.put_nowait(None)
        say(second, 21.0)
        await until(lambda: path.exists() and '"offset_um": -2.0' in path.read_text())
        await until(lambda: first.connects == 2)
        say(first, 22.0)
        await until(lambda: '"offset_um": -4.0' in path.read_text())

    asyncio.run(running(service, work))
    assert broken.tried >= 1


def test_a_restart_goes_on_where_it_was(tmp_path: Path) -> None:
    source, path = Given(), tmp_path / "state.json"
    service = Service(machine(), [source], [], state_path=path)

    async def warm() -> None:
        for k in range(3):
            say(source, 20.0 + k)
            await until(lambda k=k: service.counts["readings"] == k + 1)

    asyncio.run(running(service, warm))
    assert statefile.read(path, machine()).state.corrections["z_um"].offset == -4.0
    slow = machine(Limits(rate=0.1))
    again, other = Service(slow, [source], [], state_path=path), Given()
    again.sources = [other]
    assert again.state.corrections["z_um"].offset == -4.0
    assert "continues" in again.events[0].text

    async def on() -> None:
        say(other, 22.0)
        await until(lambda: again.counts["readings"] == 1)

    asyncio.run(running(again, on))
    assert again.state.corrections["z_um"].offset == -4.0
    assert again.state.references == service.state.references


def test_a_damaged_state_is_a_cold_start_and_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "state.json"
    statefile.write(machine().start(), machine(), path, datetime.now(UTC))
    cut = path.read_text(encoding="utf-8")[:700]
    path.write_text(cut, encoding="utf-8")
    service = Service(machine(), [], [], state_path=path)
    assert service.events[0].text.startswith("cold start: ")
    assert path.read_text(encoding="utf-8") == cut  # only looked at

    async def work() -> None:
        await until((tmp_path / "state.json.refused").exists)

    asyncio.run(running(service, work))
    assert (tmp_path / "state.json.refused").read_text(encoding="utf-8") == cut
    other = replace(growing("z_um", 2.0), intercept=1.0, honest_error=ACCEPTED)
    statefile.write(machine().start(), machine(), path, datetime.now(UTC))
    assert "other models" in Service(Compensator.of([other]), [], [], state_path=path).events[0].text


@pytest.mark.parametrize("content", ["{}", '{"format": "thermocomp-model"}', "the state of affairs", None])
def test_a_file_of_others_is_not_written_over(content: str | None, tmp_path: Path) -> None:
    path = tmp_path / "state.json"
    path.mkdir() if content is None else path.write_text(content, encoding="ascii")
    with pytest.raises(InputError, match="not a state file and would be overwritten"):
        Service(machine(), [], [], state_path=path)
    assert path.is_dir() if content is None else path.read_text(encoding="ascii") == content


def test_it_fades_out_without_a_reading_and_the_next_start_runs(tmp_path: Path) -> None:
    path, limits = tmp_path / "state.json", Limits(rate=4.0)
    service = Service(machine(limits), [], [FileSink(path=tmp_path / "out.json")], state_path=path, first_start="zero")
    for t in (20.0, 20.5):
        service.take(Reading(time.time(), {"t": t}))
        time.sleep(0.3)
    service.take(Reading(time.time(), {"t": 20.5}))
    assert service.state.corrections["z_um"].offset < -0.9
    seen: list[float] = []

    async def work() -> None:
        fading = asyncio.create_task(service.fade_out())
        while not fading.done():
            seen.append(service.state.corrections["z_um"].offset)
            service.take(Reading(time.time(), {"t": 30.0}))  # too late
            await asyncio.sleep(0.05)

    asyncio.run(running(service, work))
    assert service.state.corrections["z_um"].offset == 0.0
    assert any(-0.9 < v < -0.05 for v in seen)  # within the rate
    again = Service(machine(limits), [], [], state_path=path)
    assert again.state.orders == {}


class Odd(Broken):
    """A sink that fails in a way nobody foresaw."""

    async def apply(self, corrections: Mapping[str, Correction]) -> None:
        raise ValueError("Publish topic cannot contain wildcards.")


def test_a_sink_that_fails_in_an_odd_way_stops_nothing(tmp_path: Path) -> None:
    source, path = Given(), tmp_path / "out.json"
    service = Service(machine(), [source], [Odd(hangs=False), FileSink(path=path)], first_start="zero")

    async def work() -> None:
        for k in range(2):
            say(source, 20.0 + k)
            await until(lambda k=k: service.counts["readings"] == k + 1)
        await until(lambda: path.exists() and "-2.0" in path.read_text())

    asyncio.run(running(service, work))


def test_a_reading_of_tomorrow_is_not_used() -> None:
    service = Service(machine(), [], [])
    service.take(Reading(time.time(), {"t": 20.0}))
    service.take(Reading(time.time() + 3600.0, {"t": 25.0}))
    service.take(Reading(1e18, {"t": 25.0}))
    assert service.counts == {"readings": 1, "rejected": 2}


def test_without_a_reading_it_holds_and_says_so() -> None:
    source = Given()
    service = Service(machine(), [source], [])

    async def work() -> None:
        say(source, 20.0)
        await until(lambda: service.counts["readings"] == 1)
        await until(lambda: service.said is not None and service.said.states["z_um"].word == "holding")

    asyncio.run(running(service, work))
    assert any("no reading for" in e.text for e in service.events)


def test_a_sensor_that_is_off_the_others_at_the_start_is_reported_once() -> None:
    inputs = tuple(Input(f"t{k}", "temperature", "degC", 20.0, True, -1.0, 5.0) for k in range(3))
    model = replace(growing("z_um", 2.0), inputs=inputs)
    service = Service(Compensator.of([model], QUICK), [], [])
    for k in range(3):
        service.take(Reading(time.time(), {"t0": 20.0 + k, "t1": 50.9 + k, "t2": 20.0 + k}))
        time.sleep(0.01)
    assert service.counts == {"readings": 3, "rejected": 0}
    (told,) = [e for e in service.events if e.kind == "sensor"]
    assert told.text.startswith("compared with the training, these start off the other temperatures: t1 +30.9 degC: ")


def test_what_is_ordered_is_in_the_events() -> None:
    service = Service(machine(), [], [])
    service.take(Reading(time.time(), {"t": 20.0}))
    time.sleep(0.01)
    service.take(Reading(time.time(), {"t": 21.0}))
    service.order("z_um", Status("holding", "by M. Weber"))
    service.rezero("z_um", "homing")
    assert [e.text for e in service.events][-2:] == [
        "z_um holding: by M. Weber, as ordered",
        "z_um is re-zeroed: homing",
    ]


def test_an_old_reading_is_not_used() -> None:
    service = Service(machine(), [], [])
    service.take(Reading(time.time() - 100.0, {"t": 20.0}))
    assert service.counts == {"readings": 0, "rejected": 1}
    assert service.said is None


def test_a_real_broker_that_is_killed_and_comes_back(broker: Mosquitto) -> None:
    source = MqttSource(topic="m/7", port=broker.port, names={"temperature": "t"})
    sink = MqttSink(topic="m/7/corrections", port=broker.port)
    service = Service(machine(), [source], [sink], first_start="zero")
    heard: list[float] = []

    async def listen() -> None:
        async with aiomqtt.Client("127.0.0.1", broker.port) as client:
            await client.subscribe("m/7/corrections")
            async for message in client.messages:
                assert isinstance(message.payload, bytes)
                heard.append(json.loads(message.payload)["corrections"]["z_um"]["offset_um"])

    async def publish(temperature: float, count: int) -> None:
        async with aiomqtt.Client("127.0.0.1", broker.port) as client:
            await client.publish("m/7", b"nonsense")
            await client.publish("m/7", json.dumps({"temperature": temperature, "time": time.time()}))
            await until(lambda: service.counts["readings"] >= count)

    async def work() -> None:
        listener = asyncio.create_task(listen())
        await until(lambda: source.status().state == "connected")
        await asyncio.sleep(0.3)
        await publish(20.0, 1)
        await publish(21.0, 2)
        await until(lambda: heard[-1:] == [-2.0])
        await asyncio.gather(asyncio.to_thread(broker.kill))
        await until(lambda: source.status().state == "failed" or source.status().state == "closed")
        broker.start()
        await until(lambda: source.status().state == "connected", 20.0)
        listener.cancel()
        listener = asyncio.create_task(listen())
        await asyncio.sleep(1.0)
        await publish(22.0, 3)
        await until(lambda: heard[-1:] == [-4.0], 20.0)
        listener.cancel()

    asyncio.run(running(service, work))
    assert source.refused == 3
    assert "not JSON" in source.last_refusal


def test_a_stop_before_the_first_reading_leaves_what_is_in_force(tmp_path: Path) -> None:
    path = tmp_path / "out.json"
    first = Service(machine(), [], [FileSink(path=path)], first_start="zero")
    first.take(Reading(time.time(), {"t": 20.0}))
    first.take(Reading(time.time(), {"t": 23.0}))

    async def briefly() -> None:
        await asyncio.sleep(0.3)

    asyncio.run(running(first, briefly))
    before = json.loads(path.read_text())["corrections"]
    assert before["z_um"]["offset_um"] == -6.0
    asyncio.run(running(Service(machine(), [Given()], [FileSink(path=path)], first_start="zero"), briefly))
    assert json.loads(path.read_text())["corrections"] == before


@pytest.mark.parametrize(
    ("order", "stays"),
    [
        (Status("holding", "by hand, on the page"), True),
        (Status("shadow", "by hand, on the page"), True),
        (Status("suspended", "the controller is not homed"), False),  # it will say so again, if it is there
        (None, False),
    ],
)
def test_orders_of_a_person_outlast_a_restart_and_no_others(order: Status | None, stays: bool, tmp_path: Path) -> None:
    path = tmp_path / "state.json"
    service = Service(machine(), [], [], state_path=path)
    service.take(Reading(time.time(), {"t": 20.0}))
    if order is None:
        service.watch_only("z_um")  # shadow = true, which the next configuration has not
    else:
        service.order("z_um", order)
    statefile.write(service.state, service.compensator, path, datetime.now(UTC))
    again = Service(machine(), [], [], state_path=path)
    assert again.state.orders == ({"z_um": order} if stays else {})


class Controller(Broken):
    """A controller that says what is in force, until it is lost."""

    def __init__(self) -> None:
        super().__init__(hangs=False)
        self.offset: float | None = 5.0
        self.away: dict[str, str] = {}
        self.told: dict[str, str] = {}

    async def apply(self, corrections: Mapping[str, Correction]) -> None:
        if self.offset is None:
            raise ThermocompError("lost")

    async def confirmed(self) -> dict[str, Correction] | None:
        return None if self.offset is None else {"z_um": Correction(self.offset)}

    def status(self) -> LinkStatus:
        return LinkStatus("connected")

    def suspended(self) -> dict[str, str]:
        return self.away

    def alarms(self) -> dict[str, str]:
        return self.told


def test_what_a_controller_says_goes_before_what_a_file_says(tmp_path: Path) -> None:
    source, controller = Given(), Controller()
    service = Service(machine(), [source], [controller, FileSink(path=tmp_path / "out.json")], first_start="zero")

    async def work() -> None:
        for k in range(4):
            say(source, 20.0 + k)
            await until(lambda k=k: service.counts["readings"] == k + 1)
            await asyncio.sleep(0.1)
        found = service.in_force.of("z_um", service.state)
        assert found is not None
        assert found.offset == 5.0

    asyncio.run(running(service, work))


def test_a_measurement_under_a_correction_that_nobody_knows_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(inforce, "CONFIRM_WITHIN", 0.3)
    source, controller = Given(), Controller()
    controller.offset = 0.5
    service = Service(machine(), [source], [controller])

    async def work() -> None:
        say(source, 20.0)
        await until(lambda: service.in_force.of("z_um", service.state) is not None)
        controller.offset = None
        say(source, 21.0)
        await until(lambda: service.in_force.of("z_um", service.state) is None)
        service.measure(Measurement(time.time(), "z_um", 1.0, left=True))
        assert service.probings.waiting == {}
        assert "not known" in service.events[-1].text
        service.measure(Measurement(time.time(), "z_um", 2.0, left=False))
        assert service.probings.waiting["z_um"].deviation == 2.0

    asyncio.run(running(service, work))


@pytest.mark.parametrize("more", [{}, {"id": "chip 1"}, {"time": 0.0}])
@pytest.mark.parametrize("measured", [10.0, 60.0, -15_000.0])
def test_a_real_broker_that_repeats_a_probing(
    broker: Mosquitto, more: dict[str, object], measured: float, tmp_path: Path
) -> None:
    """The same bytes twice between two readings, after the next, and after a restart."""
    source, probe = Given(), MqttProbe(topic="m/7/probe", port=broker.port)
    service = Service(machine(), [source], [], state_path=tmp_path / "state.json", probes=[probe])
    message = {"target": "z_um", "measured_um": measured, "under_correction": True, **more}

    async def send(times: int) -> None:
        async with aiomqtt.Client("127.0.0.1", broker.port) as client:
            for _ in range(times):
                await client.publish("m/7/probe", json.dumps(message), qos=1)

    async def events(own: Service, count: int) -> None:
        await until(lambda: len([e for e in own.events if e.kind == "probing"]) >= count)

    async def work() -> None:
        await until(lambda: probe.status().state == "connected")
        await asyncio.sleep(0.3)
        for value in (20.0, 20.5, 20.0):  # before a temperature has changed, a probing is refused
            say(source, value)
        await until(lambda: service.counts["readings"] == 3)
        if "time" in more:
            message["time"] = time.time()
        await send(2)
        await events(service, 1)
        say(source, 20.0)
        await until(lambda: service.counts["readings"] == 4)
        await send(3)
        await events(service, 5)

    asyncio.run(running(service, work))
    feed, after = Given(), MqttProbe(topic="m/7/probe", port=broker.port)
    later = Service(machine(), [feed], [], state_path=tmp_path / "state.json", probes=[after])

    async def again() -> None:
        await until(lambda: after.status().state == "connected")
        await asyncio.sleep(0.3)
        say(feed, 20.0)
        await send(1)
        await events(later, 1)
        say(feed, 20.0)
        await until(lambda: later.counts["readings"] == 2)

    asyncio.run(running(later, again))
    for own in (service, later):
        assert own.state.corrections["z_um"].offset == 0.0
        assert sum("delivered before" in e.text for e in own.events) >= (4 if own is service else 1)


def test_a_new_zero_forgets_what_counted_from_the_one_before() -> None:
    service = Service(machine(), [Given()], [])
    feed = [20.0, 21.0]
    for value in feed:
        service.take(Reading(time.time(), {"t": value}))
    early = time.time()
    service.measure(Measurement(early, "z_um", 3.0, left=False, keys=("id 1",)))
    service.take(Reading(time.time(), {"t": 21.0}))
    assert service.state.learned["z_um"].mean[-1] > 0.5
    service.measure(Measurement(time.time(), "z_um", 3.1, left=False, keys=("id 2",)))  # waits
    service.rezero("z_um", "homing")
    service.measure(Measurement(early, "z_um", 3.2, left=False, keys=("id 3",)))
    assert "made before the present zero" in service.events[-1].text
    service.take(Reading(time.time(), {"t": 21.0}))
    assert not service.state.learned
    assert service.roll_back("z_um")  # of the zero before
    assert not service.state.learned


def test_a_folder_that_is_gone_is_told_once(tmp_path: Path) -> None:
    service = Service(machine(), [Given()], [], state_path=tmp_path / "gone" / "state.json")
    for _ in range(5):
        service.keeper.save(service.state)
    assert sum("not saved" in e.text for e in service.events) == 1


def test_two_probings_before_a_reading_and_one_of_tomorrow() -> None:
    service = Service(machine(), [Given()], [])
    for _ in range(2):
        service.take(Reading(time.time(), {"t": 20.0}))
    for measured, ahead in ((1.0, 0.0), (1.1, 0.0), (1.2, 3600.0)):
        at = time.time() + ahead
        service.measure(Measurement(at, "z_um", measured, left=False, keys=(f"time {at}",)))
    assert [e.text for e in service.events if e.kind == "probing"] == [
        "z_um refused: another measurement is waiting for the next reading",
        "z_um refused: the time of the measurement is 3600 s ahead of the clock",
    ]


def test_an_alarm_is_told_and_suspends_nothing() -> None:
    source, controller = Given(), Controller()
    controller.offset = 0.0
    service = Service(machine(), [source], [controller])

    async def work() -> None:
        say(source, 20.0)
        say(source, 23.0)
        await until(lambda: service.counts["readings"] == 2)
        controller.told, controller.offset = {"z_um": "the controller does not respond"}, None
        await until(lambda: any("does not respond" in e.text for e in service.events))
        assert service.state.corrections["z_um"].offset == -6.0
        assert service.state.orders == {}
        controller.told, controller.offset, controller.away = {}, 0.0, {"z_um": "the controller is off"}
        await until(lambda: "z_um" in service.state.orders)
        assert service.state.corrections["z_um"].offset == 0.0
        controller.away = {}
        await until(lambda: service.state.orders == {})

    asyncio.run(running(service, work))
    assert [e.text for e in service.events if e.kind == "link" and e.text.startswith("z_um")] == [
        "z_um: the controller does not respond",
        "z_um: the correction is in force again as commanded",
    ]
