"""`Recording.from_dataframe`: times, units, cycles, and what is refused."""

from datetime import timedelta
from typing import Any

import numpy as np
import pandas as pd
import pytest

from thermocomp.core.exceptions import InputError, RecordingError, UnitError
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.stacking import stack

TABLE = pd.DataFrame(
    {"time_min": [0.0, 1.0, 2.5], "T1": [20.0, 21.0, np.inf], "drift_mm": [0.0, 0.001, 0.002], "n": [0, 0, 9]}
)
UNITS = {"T1": "degF", "n": "rpm", "drift_mm": "mm"}


def test_units_and_time() -> None:
    found = Recording.from_dataframe(TABLE, units=UNITS, name="mine")
    assert found.name == "mine"
    assert found.time.tolist() == [0.0, 60.0, 150.0]
    assert [(c.name, c.quantity, c.unit) for c in found.channels] == [
        ("T1", "temperature", "degC"), ("drift_um", "displacement", "um"), ("n", "spindle_speed", "1/min")
    ]  # fmt: skip
    assert found.table["T1"].tolist()[:2] == pytest.approx([(20 - 32) / 1.8, (21 - 32) / 1.8])
    assert np.isnan(found.table["T1"][2])
    assert found.table["drift_um"].tolist() == [0.0, 1.0, 2.0]
    assert found.channel("drift_mm").name == "drift_um"
    assert [c.name for c in found.cycles] == ["1 (9 1/min)"]


def test_what_has_no_unit_is_left_out_and_told() -> None:
    found = Recording.from_dataframe(TABLE)
    assert [c.name for c in found.channels] == ["drift_um"]
    assert "left out: 'T1' has no unit of a channel; give it by units={'T1': 'degC'}" in found.notes


@pytest.mark.parametrize(
    "time",
    [
        "t",
        [0.0, 60.0, 150.0],
        np.array([7.0, 67.0, 157.0]),
        pd.to_datetime(["2026-01-01 10:00:00", "2026-01-01 10:01:00", "2026-01-01 10:02:30"]),
        pd.to_timedelta([0, 60, 150], unit="s"),
    ],
    ids=["column", "list", "array", "stamps", "timedeltas"],
)
def test_ways_to_give_the_time(time: Any) -> None:
    table = TABLE.drop(columns="time_min").assign(t=[3600.0, 3660.0, 3750.0])
    assert Recording.from_dataframe(table, time=time, units={"T1": "degC"}).time.tolist() == [0.0, 60.0, 150.0]
    stamped = table.drop(columns="t").set_index(pd.to_timedelta([0, 60, 150], unit="s"))
    assert Recording.from_dataframe(stamped).time.tolist() == [0.0, 60.0, 150.0]


BERLIN = pd.to_datetime(["2026-03-29T01:59:00", "2026-03-29T03:00:00", "2026-03-29T03:01:30"]).tz_localize(
    "Europe/Berlin"
)
AUTUMN = pd.to_datetime(["2026-10-25T00:59:00", "2026-10-25T01:00:00", "2026-10-25T01:01:30"], utc=True)


@pytest.mark.parametrize(
    ("time", "start"),
    [
        (BERLIN, "2026-03-29T01:59:00+01:00"),
        (BERLIN.to_series(), "2026-03-29T01:59:00+01:00"),
        (BERLIN.to_pydatetime(), "2026-03-29T01:59:00+01:00"),
        (AUTUMN.tz_convert("Europe/Berlin"), "2026-10-25T02:59:00+02:00"),
        (AUTUMN.tz_localize(None), "2026-10-25T00:59:00"),
        (AUTUMN.tz_localize(None).to_pydatetime().tolist(), "2026-10-25T00:59:00"),
        ([timedelta(), timedelta(minutes=1), timedelta(minutes=2.5)], ""),
    ],
    ids=["index", "series", "zoned", "clock put back", "plain", "list", "timedeltas"],
)
def test_dates_are_kept(time: Any, start: str) -> None:
    """Seconds pass as in UTC, whatever the clock on the wall did."""
    table = TABLE.drop(columns="time_min")
    found = [
        Recording.from_dataframe(table, time=time),
        Recording.from_dataframe(table.assign(stamp=list(time)), time="stamp"),
        Recording.from_dataframe(table.set_index(pd.Index(time))),
    ]
    for r in found:
        assert r.time.tolist() == [0.0, 60.0, 150.0]
        assert r.start == start


def test_days_of_tables() -> None:
    begin = pd.Timestamp("2026-01-01T23:30", tz="Europe/Berlin")
    stamps = pd.date_range(begin, periods=60, freq="min")
    table = pd.DataFrame({"t_C": np.arange(60.0), "z_um": np.arange(60.0)}, index=stamps)
    samples = stack([Recording.from_dataframe(table)], ["z_um"])
    assert np.unique(samples.days()).astype(str).tolist() == ["2026-01-01", "2026-01-02"]


def test_cycles() -> None:
    labelled = TABLE.assign(cycle=["a", "a", "b"], day=[1, 2, 2])
    assert [c.name for c in Recording.from_dataframe(labelled).cycles] == ["a", "b"]
    assert [len(c) for c in Recording.from_dataframe(labelled, cycles="day").cycles] == [1, 2]
    assert [c.name for c in Recording.from_dataframe(TABLE, cycles=[5, 5, 6]).cycles] == ["5", "6"]


def test_there_and_back(recording: Recording) -> None:
    again = Recording.from_dataframe(recording.to_frame())
    assert again.fingerprint == recording.fingerprint
    assert again.cycles == recording.cycles
    assert again.channels == recording.channels
    assert repr(again).startswith("<Recording table: 800 rows, 13.3 h, 3 temperatures")


@pytest.mark.parametrize(
    ("table", "more", "error", "message"),
    [
        (TABLE.drop(columns="time_min"), {}, RecordingError, "which column is the time.*no column such as time_s"),
        (TABLE.assign(t_s=0.0), {}, RecordingError, "there are time_min, t_s: give time="),
        (TABLE, {"time": "clock"}, InputError, "no column is named 'clock'"),
        (TABLE, {"time": [1, 2]}, InputError, "expected 3 values"),
        (TABLE, {"time": [0, 2, 1]}, RecordingError, "time does not increase at row 2"),
        (TABLE, {"time": [BERLIN[0], pd.NaT, BERLIN[2]]}, RecordingError, "time is missing in row 1"),
        (TABLE, {"time": [BERLIN[0], pd.Timestamp(0), 3]}, RecordingError, "neither a number nor a datetime"),
        (TABLE, {"time": list("abc")}, RecordingError, "neither a number nor a datetime"),
        (TABLE, {"time": [0, np.nan, 1]}, RecordingError, "time is missing in row 1"),
        (TABLE, {"units": {"T9": "degC"}}, InputError, "units: no column is named 'T9'"),
        (TABLE, {"units": {"T1": "degX"}}, UnitError, "unknown unit 'degX'"),
        (TABLE, {"cycles": "day"}, InputError, "no column is named 'day'"),
        (TABLE, {"cycles": [1]}, InputError, "1 labels for 3 rows"),
        (TABLE[["time_min", "n"]], {}, RecordingError, "none of the columns time_min, n is recognized"),
        (TABLE.assign(T1="warm"), {"units": UNITS}, RecordingError, "column 'T1' contains a non-numeric value"),
        (TABLE.iloc[:0], {}, RecordingError, "has no row"),
        (TABLE.assign(drift_um=0.0), {}, RecordingError, "two columns would become the same channel"),
        (pd.DataFrame([[0.0, 1.0]], columns=["a_C", "a_C"]), {}, RecordingError, "two columns are named 'a_C'"),
    ],
)  # fmt: skip
def test_what_is_refused(table: pd.DataFrame, more: dict[str, Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        Recording.from_dataframe(table, **more)
