"""Measurements of the tool point while the machine runs: from MQTT or from the virtual machine."""

import asyncio
import random
import time
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from typing import ClassVar

import aiomqtt

from thermocomp.core.exceptions import ReadingError
from thermocomp.core.ports import LinkStatus
from thermocomp.core.reading import Measurement
from thermocomp.live.adapters.connection import Connection
from thermocomp.live.adapters.messages import read_measurement
from thermocomp.live.adapters.mqtt import Broker
from thermocomp.live.adapters.plain import SimulatedSource


@dataclass(kw_only=True)
class MqttProbe(Broker):
    """Source of measurements from an MQTT topic; ignores messages retained by the broker: none is used twice."""

    refused: int = field(default=0, init=False)  #: number of invalid messages
    last_refusal: str = field(default="", init=False)

    async def measurements(self) -> AsyncIterator[Measurement]:
        """Return measurements as they arrive, until the connection to the broker is lost."""
        client = self._connected()
        try:
            await client.subscribe(self.topic, qos=1)
            async for message in client.messages:
                if message.retain:
                    continue
                try:
                    payload = message.payload if isinstance(message.payload, bytes | str) else b""
                    yield read_measurement(payload, time.time())
                except ReadingError as e:
                    self.refused, self.last_refusal = self.refused + 1, str(e)
        except (aiomqtt.MqttError, OSError) as e:
            raise self._fail(e) from e


@dataclass(kw_only=True)
class SimulatedProbe:
    """A probe in the virtual machine: it measures the uncompensated deviation.

    Parameters
    ----------
    every : float
        Machine time between two probings [s].
    repeatability : float
        Standard deviation [um].
    """

    label: ClassVar[str] = "probe of the virtual machine"
    machine: SimulatedSource
    targets: tuple[str, ...]
    every: float
    repeatability: float
    _connection: Connection = field(default_factory=Connection, init=False, repr=False)

    async def connect(self, timeout: float) -> None:  # noqa: ARG002 - part of the interface
        """Set the connection status to connected."""
        self._connection.to("connected")

    async def measurements(self) -> AsyncIterator[Measurement]:
        """Return a measurement of each target whenever a probing is due."""
        noise = random.Random(self.machine.seed)
        while True:
            await asyncio.sleep(self.every / self.machine.speed)
            for target in self.targets:
                if (true := self.machine.truth.get(target)) is not None:
                    now, found = time.time(), true + noise.gauss(0.0, self.repeatability)
                    yield Measurement(
                        time=now,
                        target=target,
                        measured=found,
                        left=False,
                        repeatability=self.repeatability,
                        keys=(f"time {now!r}",),
                    )

    def status(self) -> LinkStatus:
        """Return the connection status without blocking."""
        return self._connection.now

    async def close(self) -> None:
        """Stop the measurements; idempotent."""
        self._connection.to("closed")
