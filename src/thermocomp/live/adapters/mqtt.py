"""MQTT: incoming readings and outgoing corrections as plain JSON."""

import asyncio
import time
from collections.abc import AsyncIterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field

import aiomqtt

from thermocomp.core.correction import Correction
from thermocomp.core.exceptions import ReadingError, ThermocompError
from thermocomp.core.ports import LinkStatus
from thermocomp.core.reading import Reading
from thermocomp.core.shown import escape
from thermocomp.live.adapters.connection import Connection
from thermocomp.live.adapters.inbox import Inbox
from thermocomp.live.adapters.messages import read_message, write_message


@dataclass(kw_only=True)
class Broker:
    """Address of a broker, and a topic on it."""

    topic: str
    host: str = "127.0.0.1"
    port: int = 1883
    _client: aiomqtt.Client | None = field(default=None, init=False, repr=False)
    _connection: Connection = field(default_factory=Connection, init=False, repr=False)

    async def connect(self, timeout: float) -> None:
        """Connect, or raise `ThermocompError` with the reason after `timeout` seconds."""
        await self.close()
        self._connection.to("connecting")
        try:
            client = aiomqtt.Client(self.host, self.port, timeout=timeout, queue_type=self._queue())
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

    def status(self) -> LinkStatus:
        """Return the connection status without blocking."""
        return self._connection.now

    async def close(self) -> None:
        """Close the connection; idempotent."""
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
    """

    names: dict[str, str] = field(default_factory=dict)
    refused: int = field(default=0, init=False)  #: number of invalid messages
    last_refusal: str = field(default="", init=False)
    _inbox: Inbox | None = field(default=None, init=False, repr=False)

    @property
    def replaced(self) -> int:
        """Number of values that were replaced by newer ones before they were processed, since the last connection."""
        return self._inbox.replaced if self._inbox else 0

    def _queue(self) -> type[asyncio.Queue[aiomqtt.Message]]:
        """Return a queue that hands over each message on arrival: in a queue its age would be unknown."""
        inbox, receive = Inbox(), self._receive
        self._inbox = inbox

        class Door(asyncio.Queue[aiomqtt.Message]):
            def put_nowait(self, item: aiomqtt.Message) -> None:
                receive(inbox, item)

        return Door

    def _receive(self, inbox: Inbox, message: aiomqtt.Message) -> None:
        try:
            payload = message.payload if isinstance(message.payload, bytes | str) else b""
            reading = read_message(payload, -1.0 if message.retain else time.time(), self.names)
        except ReadingError as e:
            self.refused, self.last_refusal = self.refused + 1, f"{escape(message.topic, 200)}: {e}"
            return
        if reading.time >= 0.0:
            inbox.put(reading)

    async def readings(self) -> AsyncIterator[Reading]:
        """Return readings as they arrive, until the connection to the broker is lost.

        A message without time is stamped when it arrives. If messages arrive faster than they are processed, the newest
        value of each channel is used. A message retained by the broker is used only if it contains its time.
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
                        yield reading
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
    """Sink that publishes corrections on an MQTT topic."""

    async def apply(self, corrections: Mapping[str, Correction]) -> None:
        """Publish corrections, or raise `ThermocompError` with the reason."""
        try:
            await self._connected().publish(self.topic, write_message(corrections, time.time()), qos=0, timeout=5.0)
        except (aiomqtt.MqttError, OSError, TimeoutError, ValueError) as e:
            raise self._fail(e) from e
