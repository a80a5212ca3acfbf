"""Ports are filled by shape, not by inheritance, and a compensator runs between them."""

import asyncio
from collections.abc import AsyncIterator, Mapping

from driftmodels import growing

from thermocomp.core.correction import Correction, Limits
from thermocomp.core.ports import LinkStatus, Sink, Source
from thermocomp.core.reading import Reading
from thermocomp.runtime.compensator import Compensator


class Memory:
    """A source that plays readings back, and a sink that keeps what it is given."""

    def __init__(self, readings: list[Reading]) -> None:
        self.kept, self.open = readings, False
        self.applied: list[Mapping[str, Correction]] = []

    async def connect(self, timeout: float) -> None:
        self.open = timeout > 0

    async def readings(self) -> AsyncIterator[Reading]:
        for reading in self.kept:
            yield reading

    async def apply(self, corrections: Mapping[str, Correction]) -> None:
        self.applied.append(corrections)

    def status(self) -> LinkStatus:
        return LinkStatus("connected" if self.open else "closed")

    async def close(self) -> None:
        self.open = False


async def run(source: Source, compensator: Compensator, sink: Sink) -> None:
    await source.connect(1.0)
    await sink.connect(1.0)
    state = compensator.start()
    async for reading in source.readings():
        state, said = compensator.step(state, reading, reading.time)
        await sink.apply(said.corrections)
    await source.close()
    await sink.close()


def test_a_compensator_runs_from_a_source_to_a_sink() -> None:
    readings = [Reading(10.0 * k, {"t": 20.0 + k}) for k in range(3)]
    source, sink = Memory(readings), Memory([])
    assert isinstance(source, Source)
    assert isinstance(sink, Sink)
    assert not isinstance(Limits(), Source)
    asyncio.run(run(source, Compensator.of([growing("z", 2.0)], Limits(rate=1.0)), sink))
    assert [said["z"].offset for said in sink.applied] == [0.0, -2.0, -4.0]
    assert source.status() == sink.status() == LinkStatus("closed")
