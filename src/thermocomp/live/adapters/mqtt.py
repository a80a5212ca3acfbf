"""MQTT: incoming readings and outgoing corrections as plain JSON."""

import asyncio
import json
import math
import time
from collections import deque
from collections.abc import AsyncIterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import ClassVar

import aiomqtt

from thermocomp.core.correction import Correction
from thermocomp.core.exceptions import ReadingError, ThermocompError
from thermocomp.core.ports import LinkStatus, TargetStatus
from thermocomp.core.reading import Reading
from thermocomp.core.shown import escape
from thermocomp.live.adapters.connection import Connection
from thermocomp.live.adapters.inbox import Inbox
from thermocomp.live.adapters.messages import read_corrections, read_message, read_time, write_message
from thermocomp.live.adapters.reportedchanges import ReportedChanges

#: time for which another sender on the topic of a sink is reported after its last message [s]
OTHER = 60.0


@dataclass(kw_only=True)
class Broker:
    """Address of a broker, and a topic on it."""

    label: ClassVar[str] = "MQTT"
    topic: str
    host: str = "127.0.0.1"
    port: int = 1883
    _client: aiomqtt.Client | None = field(default=None, init=False, repr=False)
    _connection: Connection = field(default_factory=Connection, init=False, repr=False)

    async def connect(self, timeout: float) -> None:
        """Connect, or raise `ThermocompError` with the reason after `timeout` seconds."""
        await self._hang_up()
        self._connection.to("connecting")
        try:
            client = aiomqtt.Client(self.host, self.port, timeout=timeout, queue_type=self._queue(), will=self._will())
            async with asyncio.timeout(timeout):
                await client.__aenter__()
        except (aiomqtt.MqttError, OSError, TimeoutError, ValueError) as e:
            reason = f"MQTT broker {self.host}:{self.port}: {str(e) or 'no answer'}"
            self._connection.to("failed", reason)
            raise ThermocompError(reason) from e
        self._client = client
        self._connection.to("connected")

    def _queue(self) -> type[asyncio.Queue[aiomqtt.Message]] | None:
        """Return the queue of incoming messages; default: that of the library."""
        return None

    def _will(self) -> aiomqtt.Will | None:
        """Return the message that the broker publishes if the connection breaks; default: none."""
        return None

    def status(self) -> LinkStatus:
        """Return the connection status without blocking."""
        return self._connection.now

    async def close(self) -> None:
        """Close the connection; idempotent."""
        await self._hang_up()

    async def _hang_up(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            with suppress(aiomqtt.MqttError, OSError, TimeoutError):  # connection lost earlier
                await client.__aexit__(None, None, None)
        self._connection.to("closed")

    def _fail(self, error: Exception) -> ThermocompError:
        reason = f"MQTT broker {self.host}:{self.port}, topic {self.topic}: {str(error) or 'connection lost'}"
        self._connection.to("failed", reason)
        return ThermocompError(reason)

    def _connected(self) -> aiomqtt.Client:
        if self._client is None:
            raise ThermocompError(f"MQTT broker {self.host}:{self.port}: not connected")
        return self._client


@dataclass(kw_only=True)
class MqttSource(Broker):
    """Source of readings from an MQTT topic.

    Parameters
    ----------
    names : dict of str to str
        Channel by the name in the message.
    counter : str
        Channel that shows whether unchanged values are still measured, if only changes are published; empty: each
        message is a reading.
    """

    names: dict[str, str] = field(default_factory=dict)
    counter: str = ""
    refused: int = field(default=0, init=False)  #: number of invalid messages
    last_refusal: str = field(default="", init=False)
    unread: dict[str, str] = field(default_factory=dict, init=False)  #: channels whose last value was not a number
    _inbox: Inbox | None = field(default=None, init=False, repr=False)
    _changes: ReportedChanges | None = field(default=None, init=False, repr=False)

    @property
    def replaced(self) -> int:
        """Number of values that were replaced by newer ones before they were processed, since the last connection."""
        return self._inbox.replaced if self._inbox else 0

    def _queue(self) -> type[asyncio.Queue[aiomqtt.Message]]:
        """Return a queue that hands over each message on arrival: in a queue its age would be unknown."""
        inbox, receive = Inbox(), self._receive
        self._inbox = inbox
        self._changes = ReportedChanges(self.counter) if self.counter else None

        class Door(asyncio.Queue[aiomqtt.Message]):
            def put_nowait(self, item: aiomqtt.Message) -> None:
                receive(inbox, item)

        return Door

    def _receive(self, inbox: Inbox, message: aiomqtt.Message) -> None:
        try:
            payload = message.payload if isinstance(message.payload, bytes | str) else b""
            reading = read_message(payload, -1.0 if message.retain else inbox.arrival(), self.names, self.unread)
        except ReadingError as e:
            self.refused, self.last_refusal = self.refused + 1, f"{escape(message.topic, 200)}: {e}"
            return
        if message.retain and self._changes is not None:
            self._changes.keep(reading.values)
        elif reading.time >= 0.0:
            inbox.put(reading)

    async def readings(self) -> AsyncIterator[Reading]:
        """Return readings as they arrive, until the connection to the broker is lost.

        A message without time is stamped when it arrives. If messages arrive faster than they are processed, the newest
        value of each channel is used. A message retained by the broker is used only if it contains its time, or
        as a value of a source that publishes changes only.
        """
        client, inbox = self._connected(), self._inbox
        assert inbox is not None
        try:
            await client.subscribe(self.topic, qos=0)
            lost = asyncio.create_task(_wait_for_loss(client))
            lost.add_done_callback(lambda _: inbox.close())
            try:
                while not inbox.closed:
                    for reading in await inbox.take():
                        whole = self._changes.complete(reading) if self._changes else reading
                        if whole.values:
                            yield whole
                await lost
            finally:
                lost.cancel()
        except (aiomqtt.MqttError, OSError, ValueError) as e:
            raise self._fail(e) from e


async def _wait_for_loss(client: aiomqtt.Client) -> None:
    """Wait until the connection is lost: messages do not pass this way."""
    async for _ in client.messages:
        pass


@dataclass(kw_only=True)
class MqttSink(Broker):
    """Sink that publishes corrections on an MQTT topic, and whether it runs on the topic with ``/status`` appended.

    Both messages are retained: a consumer that connects later gets them at once. If the connection breaks, the broker
    publishes the status ``lost``, which is replaced at once if it is that of an earlier connection or another sender.

    Parameters
    ----------
    confirm_topic : str
        Topic on which the controller reports the corrections in force, in the form in which they are published; empty:
        it does not.
    """

    confirm_topic: str = ""
    refused: int = field(default=0, init=False)  #: number of invalid messages
    last_refusal: str = field(default="", init=False)
    last_time: float = field(default=-math.inf, init=False)  #: of the retained message [s since 1970]
    _statuses: dict[str, TargetStatus] = field(default_factory=dict, init=False, repr=False)
    _sequence: int = field(default=0, init=False, repr=False)
    _before: dict[str, Correction] | None = field(default=None, init=False, repr=False)
    _reported: dict[str, Correction] | None = field(default=None, init=False, repr=False)
    _listening: asyncio.Task[None] | None = field(default=None, init=False, repr=False)
    _own: deque[bytes] = field(default_factory=lambda: deque(maxlen=100), init=False, repr=False)  # published last
    _other: float = field(default=-math.inf, init=False, repr=False)  # last message of another sender [s]

    @property
    def other_sender(self) -> str:
        """Whether another sender has published here lately, as text; empty if none has."""
        return "another sender publishes on this topic" if time.monotonic() - self._other <= OTHER else ""

    def inform(self, statuses: Mapping[str, TargetStatus]) -> None:
        """Store the statuses for the next corrections."""
        self._statuses = dict(statuses)

    def _will(self) -> aiomqtt.Will:
        return aiomqtt.Will(self._status_topic, _status("lost", "the connection of the compensator broke"), 1, True)

    @property
    def _status_topic(self) -> str:
        return f"{self.topic}/status"

    async def connect(self, timeout: float) -> None:
        """Connect and read the last own message, or raise `ThermocompError` with the reason."""
        await super().connect(timeout)
        client = self._connected()
        self._before = self._reported = None
        try:
            async with asyncio.timeout(timeout):
                for topic in filter(None, (self.topic, self._status_topic, self.confirm_topic)):
                    await client.subscribe(topic, qos=1)
                await self._publish(self._status_topic, _status("running"), timeout)
        except (aiomqtt.MqttError, OSError, TimeoutError, ValueError) as e:
            await self._hang_up()
            raise self._fail(e) from e
        self._listening = asyncio.create_task(self._listen(client))

    async def _listen(self, client: aiomqtt.Client) -> None:
        """Read what was sent by an earlier run and by others, and what the controller confirms, until it is lost."""
        try:
            async for message in client.messages:
                payload = message.payload if isinstance(message.payload, bytes) else b""
                of_others = not message.retain and payload not in self._own
                if message.topic.matches(self._status_topic):
                    if of_others and b'"running"' not in payload:  # lost: an earlier connection, or another sender
                        await self._publish(self._status_topic, _status("running"), 3.0)
                    continue
                if message.topic.matches(self.topic) and not message.retain:
                    self._other = time.monotonic() if of_others and payload else self._other
                    continue
                try:
                    found = read_corrections(payload)
                except ReadingError as e:
                    self.refused, self.last_refusal = self.refused + 1, f"{escape(message.topic, 200)}: {e}"
                    continue
                if message.topic.matches(self.topic):
                    self._before, self.last_time = found, read_time(payload)
                elif not message.retain:
                    self._reported = found
        except (aiomqtt.MqttError, OSError, ValueError) as e:
            if client is self._client:
                self._fail(e)

    async def _publish(self, topic: str, text: str, timeout: float) -> None:
        self._own.append(text.encode())
        await self._connected().publish(topic, text, qos=1, retain=True, timeout=timeout)

    async def last_sent(self) -> Mapping[str, Correction] | None:
        """Return the corrections in the retained message of an earlier run; None without one."""
        for _ in range(20):
            if self._before is not None:
                break
            await asyncio.sleep(0.05)
        return self._before

    async def apply(self, corrections: Mapping[str, Correction]) -> None:
        """Publish corrections with their statuses, or raise `ThermocompError` with the reason."""
        self._sequence += 1
        text = write_message(corrections, time.time(), self._statuses, self._sequence)
        try:
            # acknowledged: a broker that does not answer is found
            await self._publish(self.topic, text, 3.0)
        except (aiomqtt.MqttError, OSError, TimeoutError, ValueError) as e:
            raise self._fail(e) from e

    async def close(self) -> None:
        """Publish that the compensator has stopped, and close the connection; idempotent."""
        if self._client is not None and self._connection.now.state == "connected":
            with suppress(aiomqtt.MqttError, OSError, TimeoutError, ValueError):
                await self._publish(self._status_topic, _status("stopped", "corrections are unchanged"), 1.0)
        await self._hang_up()

    async def _hang_up(self) -> None:
        listening, self._listening = self._listening, None
        if listening is not None:
            listening.cancel()
        await super()._hang_up()


@dataclass(kw_only=True)
class ConfirmedMqttSink(MqttSink):
    """The same, with a topic on which the controller confirms."""

    async def confirmed(self) -> Mapping[str, Correction] | None:
        """Return the corrections in force that the controller has reported since the last call; None: no report."""
        found, self._reported = self._reported, None
        return found


def _status(state: str, reason: str = "") -> str:
    return json.dumps({"state": state, "reason": reason, "time": time.time()})
