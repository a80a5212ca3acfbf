"""Files of an earlier version load, and give the numbers that this version computed from them.

Commit 54ab850 wrote the files in ``old``, from 3 h of the virtual machine: model files, a state after 16 readings and a
probing, a journal of `serve`, the state at the end of a job. ``expected.json`` contains its results.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from thermocomp.core import provenance
from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError
from thermocomp.core.reading import Reading
from thermocomp.files import modelfile
from thermocomp.live import statefile
from thermocomp.live.journal.journalexport import export
from thermocomp.live.journal.journalreader import JournalReader
from thermocomp.nc.revise import revise
from thermocomp.nc.revision import jobstate
from thermocomp.runtime.compensator import Compensator

OLD = Path(__file__).parent / "old"
EXPECTED: dict[str, Any] = json.loads((OLD / "expected.json").read_text())
COLUMNS: list[str] = EXPECTED["columns"]
READINGS = [dict(zip(COLUMNS, row, strict=True)) for row in EXPECTED["readings"]]
#: of the largest number
SAME = 1e-12


def assert_same(found: Any, expected: Any) -> None:
    numbers = np.array(expected, dtype=np.float64)
    assert_allclose(np.array(found, dtype=np.float64), numbers, rtol=0.0, atol=SAME * np.nanmax(np.abs(numbers)))


@pytest.mark.parametrize("name", ["dynamic", "arx"])
def test_a_model_predicts_the_same(name: str) -> None:
    (model,) = modelfile.read(OLD / f"{name}.json")
    rows = np.array([[r[i.name] for i in model.inputs] for r in READINGS])
    state, found = model.init(rows[0]), []
    for k, row in enumerate(rows):
        state, deviation = model.step(state, row, 120.0 if k else 0.0)
        found.append(float(deviation))
    assert max(found) - min(found) > 20.0
    assert_same(found, EXPECTED[name])


@pytest.fixture
def its_rules(monkeypatch: pytest.MonkeyPatch) -> None:
    """Judge by the rules of that version: by the present ones its models are unproven."""
    monkeypatch.setattr(provenance, "RULES", 1)


def test_its_models_are_unproven_by_the_present_rules() -> None:
    with pytest.raises(InputError, match=r"unproven and runs in shadow only: judged by older rules: .*; fit it again"):
        Compensator.of(modelfile.read(OLD / "dynamic.json"), Limits(rate=0.1))


@pytest.mark.usefixtures("its_rules")
def test_a_state_continues_the_same() -> None:
    compensator = Compensator.of(modelfile.read(OLD / "dynamic.json"), Limits(rate=0.1))
    assert compensator.watches
    state, found = statefile.read(OLD / "state.json", compensator).state, []
    assert "z_um" in state.learned
    for values in READINGS[16:]:
        reading = Reading(values["time_s"], {n: values[n] for n in COLUMNS[1:]})
        state, said = compensator.step(state, reading, reading.time)
        assert (said.rejected, said.states["z_um"].word) == ("", "active")
        found.append([said.corrections["z_um"].offset, said.deviations["z_um"].offset])
    assert_same(found, EXPECTED["continued"])


def test_a_journal_is_exported_the_same() -> None:
    exported = export(JournalReader(OLD / "journal.db"))
    assert [(t.name, t.measured, t.known) for t in exported.targets] == [("z_um", 1, 1)]
    found = exported.recording.table[EXPECTED["journal"]["columns"][1:]]
    expected = np.array(EXPECTED["journal"]["rows"], dtype=np.float64)
    assert_same(found.to_numpy(), expected[:, 1:])


@pytest.mark.usefixtures("its_rules")
def test_a_job_is_continued_the_same(tmp_path: Path) -> None:
    out = tmp_path / "out.ngc"
    options: dict[str, Any] = {"controller": "linuxcnc", "axis": ["z_um=Z"], "unproved": True, "pause": "20 min"}
    revise(OLD / "part.ngc", OLD / "arx.json", out, carried=OLD / "job.json", **options)
    assert [t for t in out.read_text().splitlines() if not t.startswith("(")] == EXPECTED["job"]["lines"]
    (station,) = jobstate.read(tmp_path / "out.ngc.job.json").state.stations
    assert_same([*station.memory, station.deviation], [*EXPECTED["job"]["memory"], EXPECTED["job"]["deviation"]])
