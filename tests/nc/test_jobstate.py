"""State files of jobs: what is written comes back, everything else is refused."""

import json
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import pytest
from driftmodels import lags, net, ticking

from thermocomp.core.exceptions import InputError, ModelFileError
from thermocomp.files import jsonfile, modelfile
from thermocomp.nc.revision import jobstate
from thermocomp.nc.thermal import start
from thermocomp.nc.thermal.drift import Drift
from thermocomp.nc.thermal.jobstate import JobState
from thermocomp.nc.thermal.stations import Station

NOON = datetime(2026, 11, 21, 12, 0, 0, 250000, tzinfo=UTC)


@pytest.fixture
def left() -> JobState:
    stations = [
        Station("X", net("x_um"), shadow=True),
        Station("Y", ticking("y_um"), shadow=True),
        Station("Z", lags(), shadow=True),
    ]
    drift = Drift(stations, start.begin_cold(stations, {}))
    drift.advance(1234.5, 3210.0)
    drift.advance(0.3, 0.0)
    return drift.state()


def test_a_state_comes_back_to_the_last_bit(left: JobState, tmp_path: Path) -> None:
    path = tmp_path / "job.json"
    jobstate.write(left, NOON.astimezone(timezone(timedelta(hours=2))), path)
    saved = jobstate.read(path)
    assert saved == jobstate.SavedJob(NOON, left)
    assert saved.written.utcoffset() == timedelta(0)
    assert any(s.deviation != 0 for s in saved.state.stations)


def test_nothing_is_overwritten_unless_told(left: JobState, tmp_path: Path) -> None:
    path = tmp_path / "job.json"
    jobstate.write(left, NOON, path)
    with pytest.raises(InputError, match="exists already"):
        jobstate.write(left, NOON, path)
    jobstate.write(left, NOON + timedelta(hours=1), path, overwrite=True)
    assert jobstate.read(path).written == NOON + timedelta(hours=1)


def test_a_time_without_its_zone_is_refused(left: JobState) -> None:
    with pytest.raises(InputError, match="time zone"):
        jobstate.dumps(left, NOON.replace(tzinfo=None))


def test_damage_is_refused(left: JobState, tmp_path: Path) -> None:
    text = jobstate.dumps(left, NOON)
    content = json.loads(text)
    content["models"][0]["state"]["stations"][2]["zero"] += 1e-9
    with pytest.raises(ModelFileError, match="checksum"):
        jobstate.loads(json.dumps(content))
    with pytest.raises(ModelFileError, match="is incomplete"):
        jobstate.loads(text[: len(text) // 2])
    with pytest.raises(ModelFileError, match="version 2"):
        jobstate.loads(text.replace('"version": 1', '"version": 2'))
    with pytest.raises(ModelFileError, match="a state file of a job but a model file"):
        jobstate.loads(modelfile.dumps([lags()]))
    with pytest.raises(ModelFileError, match="no such state file"):
        jobstate.read(tmp_path / "none.json")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"written": "yesterday"}, "written"),
        ({"written": "2026-11-21T12:00:00"}, "timezone"),
        ({"state": {"stations": [], "zero_known": True}}, "each station once, found none"),
        ({"more": 1}, "more"),
    ],
)
def test_what_is_no_state_is_refused(left: JobState, change: dict[str, object], says: str) -> None:
    content = json.loads(jobstate.dumps(left, NOON))
    body = [content["models"][0] | change]
    with pytest.raises(ModelFileError, match=says):
        jobstate.loads(jsonfile.pack(jobstate.KIND, body))


def test_a_file_is_of_one_job(left: JobState) -> None:
    body = json.loads(jobstate.dumps(left, NOON))["models"]
    with pytest.raises(ModelFileError, match="contains the states of 2 jobs; expected one"):
        jobstate.loads(jsonfile.pack(jobstate.KIND, body * 2))
