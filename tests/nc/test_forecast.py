"""Forecasts as CSV."""

import os
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thermocomp.core.exceptions import InputError
from thermocomp.nc.revision import forecast
from thermocomp.nc.thermal.inputs import InputSignal


def written(folder: Path, text: str) -> Path:
    path = folder / "room.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_units_and_gaps(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        "# forecast of the hall\ntime_min,t3_C,room [degF],note,spindle_rpm\n"
        "0,20.5,50,cold,\n\n30,,68,,100\n90,21.5,,,\n",
    )
    found = forecast.read(path)
    assert found.columns["t3_C"] == ((0.0, 5400.0), (20.5, 21.5))
    assert found.columns["room_C"][1] == pytest.approx((10.0, 20.0))
    assert found.columns["spindle_rpm"] == ((1800.0,), (100.0,))
    assert any("note" in text for text in found.left_out)
    assert InputSignal(*found.columns["t3_C"]).at(2700.0) == 21


@pytest.mark.parametrize("delimiter", [";", "\t"])
def test_decimal_commas(tmp_path: Path, delimiter: str) -> None:
    rows = [["time_s", "t3_C"], ["-0,5", "20,25"], ["1", "21.5"]]
    found = forecast.read(written(tmp_path, "\r\n".join(delimiter.join(r) for r in rows)))
    assert found.columns == {"t3_C": ((-0.5, 1.0), (20.25, 21.5))}


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "found 0"),
        ("time_s,t_C\n", "found 1"),
        ("t3_C,t4_C\n1,2\n", "column of time such as time_s"),
        ("time_s,cycle\n1,2\n", "column of an input"),
        ("time,t3_C\n1,2\n", "unit in the heading: time_s"),
        ("timestamp,t3_C\n2026-01-01,2\n", "since the start of the program"),
        ("time_s,t3_C\n1,2\n1,3\n", r"line 3, column 'time_s': '1': every row needs a time later than"),
        ("time_s,t3_C\n1,2\n,3\n", "every row needs a time"),
        ("time_s,t3_C\n1,warm\n", "line 2, column 't3_C': 'warm' is not a number"),
        ("time_s,t3_C\n1,nan\n", "must be finite"),
        ("time_s,t3_C\n1,2,3\n", "line 2 has 3 cells, but there are 2 headings"),
        ("time_s,t3_C,t3 [degC]\n1,2,3\n", "another column also holds t3_C"),
        ("time_s,t3 [degX]\n1,2\n", "unknown unit"),
    ],
)
def test_what_is_refused(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        forecast.read(written(tmp_path, text))


def test_a_file_that_is_none(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        forecast.read(tmp_path / "none.csv")
    (tmp_path / "room.csv").write_bytes(b"time_s,t\xff_C\n1,2\n")
    with pytest.raises(InputError, match="cannot be read"):
        forecast.read(tmp_path / "room.csv")


@settings(max_examples=200, deadline=None)
@given(text=st.text(alphabet='time_s,Ct3;\n\t"0123456789.-#\r', max_size=60))
def test_any_text_is_read_or_refused(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    path = tmp_path_factory.getbasetemp() / "any.csv"
    path.write_text("time_s,t3_C\n" + text, encoding="utf-8", newline="")
    try:
        found = forecast.read(path)
    except InputError:
        return
    for time, values in found.columns.values():
        InputSignal(time, values)


def test_a_forecast_is_a_file_of_sane_size(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.csv")
    (tmp_path / "huge.csv").write_bytes(b"")
    os.truncate(tmp_path / "huge.csv", 65 << 20)
    (tmp_path / "long.csv").write_text(f'time_s,"{"x" * 140_000}"\n0,1\n')
    for name, message in (
        ("pipe.csv", "is a pipe or a device"),
        ("huge.csv", "exceeds 64 MiB"),
        ("long.csv", "line 1 cannot be read: field larger"),
    ):
        with pytest.raises(InputError, match=message):
            forecast.read(tmp_path / name)
