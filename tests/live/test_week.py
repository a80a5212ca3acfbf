"""A week of the virtual machine goes by in the service: its memory does not grow."""

import asyncio
import gc
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from shopfloor import model
from test_page import Told, asking

from thermocomp.core.correction import Limits
from thermocomp.core.reading import Measurement, Reading
from thermocomp.live.adapters.plain import FileSink
from thermocomp.live.journal.journal import JournalLimits
from thermocomp.live.loop import Service
from thermocomp.live.page.page import make_app
from thermocomp.live.recorder import Recorder
from thermocomp.runtime.compensator import Compensator
from thermocomp.virtual.datasets import record


@pytest.mark.parametrize("days", [2, pytest.param(7, marks=pytest.mark.long)])
def test_memory_is_flat(days: int, tmp_path: Path) -> None:
    (day,) = record("demo", seed=3)
    # one a minute: tracing costs three times what the service does
    rows = [{str(n): float(v) for n, v in row.items()} for row in day.table.iloc[:2880:2].to_dict("records")]
    clock, compensator = Told(), Compensator.of([model()], Limits())
    service = Service(compensator, [], [FileSink(path=tmp_path / "out.json")], clock, tmp_path / "state.json")
    service.recorder = Recorder(
        tmp_path / "live.db", compensator, "off", clock, JournalLimits(size_bytes=4 * 2**20, files=3)
    )
    held = list[int]()

    async def work() -> None:
        async with asking(make_app(service)) as client:
            for k in range(days):
                for j, row in enumerate(rows):
                    clock.at = 86400.0 * k + 60.0 * j
                    if j % 240 == 120:
                        service.measure(Measurement(clock.now(), "z_um", float(np.sin(j)), left=False))
                    service.take(Reading(clock.now(), row))
                    if j % 100 == 0:
                        assert service.recorder is not None
                        service.recorder.journal.flush()
                        assert (await client.get("/api/state")).status_code == 200
                        assert (await client.get("/api/curves")).status_code == 200
                gc.collect()
                held.append(tracemalloc.get_traced_memory()[0])

    tracemalloc.start()
    try:
        asyncio.run(work())
    finally:
        tracemalloc.stop()
        service.recorder.journal.close()
    print(f"held after each day [kB]: {[n // 1000 for n in held]}")
    assert held[-1] - held[0] < 100_000
    on_disk = sum(p.stat().st_size for p in tmp_path.glob("live.*"))
    assert on_disk < 3 * 8 * 2**20
