"""The journal of the service: what was read, asked for, confirmed and measured."""

import asyncio
import time
from pathlib import Path

import pytest
from test_loop import Given, machine, running, say, until

from thermocomp.core.reading import Measurement, Reading
from thermocomp.live.adapters.plain import FileSink
from thermocomp.live.journal.journal import JournalLimits
from thermocomp.live.journal.journalexport import export
from thermocomp.live.journal.journalreader import JournalReader
from thermocomp.live.journal.journalrows import measured_by
from thermocomp.live.loop import Service
from thermocomp.live.recorder import Recorder
from thermocomp.runtime.state import Status


def recorded(folder: Path, own: str = "off") -> tuple[Service, Given]:
    source, compensator = Given(), machine()
    service = Service(compensator, [source], [FileSink(path=folder / "corrections.json")], first_start="zero")
    kept = {"t9_C": "temperature"}
    service.recorder = Recorder(folder / "live.db", compensator, own, service.clock, JournalLimits(), kept)  # type: ignore[arg-type]
    return service, source


def test_what_is_measured_under_a_correction_becomes_the_deviation(tmp_path: Path) -> None:
    service, source = recorded(tmp_path)

    async def work() -> None:
        for k in range(5):
            say(source, 20.0 + k)
            await until(lambda k=k: service.counts["readings"] == k + 1)
            await until(lambda k=k: k == 0 or service.in_force.confirmed["z_um"][0].offset == -2.0 * k)
        # the machine is off by 9 um, and 8 of them are corrected
        service.measure(Measurement(time.time(), "z_um", 1.0, left=True, repeatability=0.1))
        say(source, 24.0)
        await until(lambda: len(service.probings.checked) == 1)
        service.measure(Measurement(time.time(), "z_um", 5000.0, left=True, repeatability=0.1))
        say(source, 24.0)
        await until(lambda: len(service.probings.checked) == 2)
        service.measure(Measurement(time.time(), "z_um", 9.0, left=False, repeatability=0.1))
        say(source, 24.0)
        await until(lambda: len(service.probings.checked) == 3)
        service.rezero("z_um", "homing")
        service.order("z_um", Status("holding", "by hand"))
        source.queue.put_nowait(Reading(time.time(), {"t": 24.0, "t9_C": 19.5, "t10_C": 3.0}))
        await until(lambda: service.counts["readings"] == 9)

    asyncio.run(running(service, work))
    reader = JournalReader(tmp_path / "live.db")
    rows = [stored.row for stored in reader.rows()]
    kinds = {type(row).__name__ for row in rows}
    assert kinds == {
        *("StartRow", "ReadingRow", "DemandRow", "ConfirmationRow", "StateRow", "ReferenceRow", "MeasurementRow"),
        *("AlarmRow", "UpdateRow"),
    }
    start = next(r for r in rows if type(r).__name__ == "StartRow")
    found = [measured_by(r, start) for r in rows if type(r).__name__ == "MeasurementRow"]  # type: ignore[arg-type]
    assert found == [pytest.approx(9.0), pytest.approx(9.0)]  # and not the five thousand, which was refused
    updates = [r for r in rows if type(r).__name__ == "UpdateRow"]
    assert [bool(u.refused) for u in updates] == [False, True, False]  # type: ignore[union-attr]
    assert (updates[0].measured, updates[0].before) == (pytest.approx(9.0), pytest.approx(8.0))  # type: ignore[union-attr]
    assert [r.why for r in rows if type(r).__name__ == "ReferenceRow"][-1] == "homing"  # type: ignore[union-attr]
    assert [r.word for r in rows if type(r).__name__ == "StateRow"] == ["sent, not confirmed", "holding"]  # type: ignore[union-attr]
    exported = export(reader)
    assert exported.recording.table["t9_C"].dropna().tolist()[-1] == 19.5
    assert "t10_C" not in exported.recording.table
    (column,) = [c for c in exported.recording.table.columns if c == "z_um"]
    told = exported.recording.table[column].dropna().tolist()
    assert told
    assert told == pytest.approx([9.0] * len(told))


def test_a_journal_that_cannot_be_written_stops_nothing(tmp_path: Path) -> None:
    service, source = recorded(tmp_path)
    assert service.recorder is not None
    journal = service.recorder.journal
    journal.close()
    journal.path = tmp_path / "gone" / "live.db"

    async def work() -> None:
        for k in range(3):
            say(source, 20.0 + k)
            await until(lambda k=k: service.counts["readings"] == k + 1)
        await until(lambda: any("journal" in e.text for e in service.events), 5.0)

    asyncio.run(running(service, work))
    assert service.state.corrections["z_um"].offset == -4.0
