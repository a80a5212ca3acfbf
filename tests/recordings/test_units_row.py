"""A row of units below the headings: whatever it says of dates and times of day, what their cells hold decides."""

from collections.abc import Sequence
from datetime import date, datetime, time, timedelta
from pathlib import Path

import numpy as np
import openpyxl
import pytest

from thermocomp.cli.app import run
from thermocomp.core.exceptions import InputError, TwoReadingsError
from thermocomp.recordings.checks.quality import check
from thermocomp.recordings.readers.mapping import Mapping, check_content
from thermocomp.recordings.readers.recordings import read
from thermocomp.recordings.recording import Recording

#: three tests on three days, each beginning at a later hour than the last one ended
INSTANTS = [
    datetime(2024, 3, day, hour) + timedelta(minutes=6 * k)
    for day, hour in ((5, 9), (7, 12), (10, 15))
    for k in range(20)
]
CELLS = [(20 + k / 8, k / 4) for k in range(60)]
#: of a row over Date, Time, T1, Z
UNITS = (
    *("Unit,,degC,um", "Units,,degC,um", "Einheit,,°C,µm", "unit:,,C,um", "Einh.,,°C,µm", "[-],[-],[degC],[um]"),
    *("-,-,degC,um", "yyyy-mm-dd,hh:mm:ss,degC,um", "[yyyy-mm-dd],[hh:mm:ss],[°C],[µm]", "n/a,n/a,degC,um"),
    *("NO.,Time,degC,um", "Date,Time,degC,um", "Time,,degC,um", ",,degC,um", "[date],[time],[°C],[µm]", "TS,,Deg C,um"),
    *("d,h,degC,um", "s,s,degC,um", ",hh:mm:ss,degC,um", "Measure,of,degC,um", "(Unit),,(C),(um)", "JJJJ-MM-TT,,°C,µm"),
)


def rows(form: str = "%Y-%m-%d,%H:%M:%S", delimiter: str = ",") -> str:
    return "".join(
        f"{t.strftime(form)},{a:.3f},{z:.2f}\n".replace(",", delimiter)
        for t, (a, z) in zip(INSTANTS, CELLS, strict=True)
    )


def write(folder: Path, content: str) -> Path:
    path = folder / "logger.csv"
    path.write_text(content, encoding="utf-8")
    return path


def is_whole(recording: Recording, units: Sequence[str] = ("degC", "um")) -> None:
    assert recording.start == "2024-03-05T09:00:00"
    assert recording.time.tolist() == [(t - INSTANTS[0]).total_seconds() for t in INSTANTS]
    assert [c.unit for c in recording.channels] == list(units)
    np.testing.assert_allclose(recording.table.to_numpy(), CELLS, rtol=0, atol=1e-9)


@pytest.mark.parametrize("units", UNITS)
def test_no_label_throws_the_date_away_or_hides_the_units(units: str, tmp_path: Path) -> None:
    is_whole(read(write(tmp_path, f"Device Type,GM10\nDate,Time,T1,Z\n{units}\n{rows()}")))


@pytest.mark.parametrize("delimiter", [";", "\t", "|"])
@pytest.mark.parametrize("units", ["Einheit,,°C,µm", "tt.mm.jjjj,hh:mm:ss,°C,µm", "[-],[-],[°C],[µm]"])
def test_other_delimiters(delimiter: str, units: str, tmp_path: Path) -> None:
    head = f"Datum,Uhrzeit,T1,Z\n{units}\n".replace(",", delimiter)
    is_whole(read(write(tmp_path, head + rows("%d.%m.%Y,%H:%M:%S", delimiter))))


@pytest.mark.parametrize(
    "head",
    [
        "Date,Time,T1,Z\n\nUnit,,degC,um\n\n",
        "Date,Time,T1,Z\n,,,\nUnit,,degC,um\n",
        "Date,Time,T1,Z\nUnit,,degC,um\n,,,\n",
        "Date,Time,T1,Z\nLabel,,TC_K,DC\nUnit,,degC,um\n",
        "Date,Time,T1,Z\nUnit,,degC,um\nType,,Avg,Smp\n",
        "Date,Time,CH1,CH2\nTag,,T1,Z\nUnit,,degC,um\n",
    ],
)
def test_rows_between(head: str, tmp_path: Path) -> None:
    is_whole(read(write(tmp_path, head + rows())))


@pytest.mark.parametrize(
    "units", ["Unit,,,degC,um", "NO.,yyyy-mm-dd,hh:mm:ss,degC,um", "[-],[-],[-],[°C],[µm]", ",,,C,um"]
)
def test_a_number_of_the_row_may_come_first(units: str, tmp_path: Path) -> None:
    numbered = "".join(f"{k},{row}\n" for k, row in enumerate(rows().splitlines(), start=1))
    recording = read(write(tmp_path, f"No.,Date,Time,T1,Z\n{units}\n{numbered}"))
    is_whole(recording)
    assert not any("No. [" in note for note in recording.notes)


def test_a_datalogger_of_four_heading_lines(tmp_path: Path) -> None:
    """Units of no use here are units too, and the number of the record has none."""
    body = "".join(
        f'"{t}",{k},{a},{z},{50 + k / 9:.1f},3.1\n' for k, (t, (a, z)) in enumerate(zip(INSTANTS, CELLS, strict=True))
    )
    head = (
        '"TOA5","CR1000","CR1000","83014","CR1000.Std.32","CPU:drift.CR1","12345","Table1"\n'
        '"TIMESTAMP","RECORD","T1_Avg","Z","RH","BattV"\n'
        '"TS","RN","Deg C","um","%","V"\n"","","Avg","Smp","Avg","Min"\n'
    )
    is_whole(read(write(tmp_path, head + body)))


def test_the_second_heading_line_of_a_recorder(tmp_path: Path) -> None:
    """Alarms are words: what stands over them is no unit, and none of them counts."""
    body = "".join(
        f"{k},{t:%Y/%m/%d %H:%M:%S},0,+{a:.3f},{z:+.2f},LLLLLLLLLL,LLLL\n"
        for k, (t, (a, z)) in enumerate(zip(INSTANTS, CELLS, strict=True), start=1)
    )
    head = "Number,Date&Time,ms,CH1,CH2,Alarm1-10,AlarmOut\nNO.,Time,ms,degC,um,A1234567890,A1234\n"
    is_whole(read(write(tmp_path, head + body)))


@pytest.mark.parametrize(
    ("unit", "factor"), [("s", 1), ("[s]", 1), ("min", 60), ("h", 3600), ("ms", 1e-3), ("(sec)", 1)]
)
def test_a_time_of_numbers_takes_its_unit(unit: str, factor: float, tmp_path: Path) -> None:
    body = "".join(f"{k},{20 + k / 8},{k / 4}\n" for k in range(30))
    recording = read(write(tmp_path, f"Time,T1,Z\n{unit},degC,um\n{body}"))
    np.testing.assert_allclose(recording.time, np.arange(30) * factor)


def test_a_time_of_numbers_takes_no_label(tmp_path: Path) -> None:
    body = "".join(f"{k},{20 + k / 8},{k / 4}\n" for k in range(30))
    with pytest.raises(InputError, match=r"column 'Time' holds numbers .* has no unit"):
        read(write(tmp_path, f"Time,T1,Z\nUnit,degC,um\n{body}"))


@pytest.mark.parametrize("unit", ["ms", "[ms]", "", "-"])
def test_milliseconds_beside_are_added(unit: str, tmp_path: Path) -> None:
    body = "".join(f"2024-03-05,09:00:{k // 2:02},{500 * (k % 2) + 125},2{k % 10},{k}\n" for k in range(40))
    recording = read(write(tmp_path, f"Date,Time,ms,T1,Z\nUnit,,{unit},degC,um\n{body}"))
    np.testing.assert_allclose(recording.time, np.arange(40) / 2)


def test_a_workbook_with_dates_and_times_of_day(tmp_path: Path) -> None:
    for k, labels in enumerate((("Unit", None), ("yyyy-mm-dd", "hh:mm:ss"), ("[-]", "[-]"), ("Einheit", "s"))):
        book = openpyxl.Workbook()
        sheet = book.active
        assert sheet is not None
        for row in (("Date", "Time", "T1", "Z"), (None,), (*labels, "degC", "um")):
            sheet.append(row)
        for t, (a, z) in zip(INSTANTS, CELLS, strict=True):
            sheet.append((date(t.year, t.month, t.day), time(t.hour, t.minute), a, z))
        path = tmp_path / f"book{k}.xlsx"
        book.save(path)
        is_whole(read(path))


# -- a column of dates is not passed over ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("headings", "form"),
    [
        ("Messtag,Uhrzeit", "%Y-%m-%d,%H:%M:%S"),
        ("Datum der Messung,Uhrzeit der Messung", "%d.%m.%Y,%H:%M:%S"),
        ("Clock,Recorded on", "%H:%M:%S,%d-%b-%Y"),
        ("Date [d],Time [h]", "%Y-%m-%d,%H:%M"),
        ("Date,Time", "%Y%m%d,%H:%M:%S"),
        ("Day,Time", "%a %Y-%m-%d,%I:%M:%S %p"),
        ("Date,Time", "%Y-%m-%d 00:00:00,1899-12-30 %H:%M:%S"),
    ],
)
def test_what_the_cells_hold_finds_it(headings: str, form: str, tmp_path: Path) -> None:
    is_whole(read(write(tmp_path, f"{headings},T1 [degC],Z [um]\n{rows(form)}")))


def test_a_mapping_that_names_the_time_of_day_alone_finds_it_too(tmp_path: Path) -> None:
    path = write(tmp_path, f"Datum,Uhrzeit,T1 [degC],Z [um]\n{rows()}")
    recording = read(path, check_content({"time": {"column": "Uhrzeit"}, "read": {"only_mapped": False}}, "m"))
    is_whole(recording)
    assert "'Datum' holds the dates, 'Uhrzeit' the time of day" in recording.notes


@pytest.mark.parametrize(
    ("headings", "keys"),
    [
        ("Datum,Uhrzeit", {"time": {"column": "Uhrzeit", "format": "%H:%M:%S"}}),
        ("Datum,Laufzeit", {}),
    ],
)
def test_dates_that_the_time_does_not_go_with_are_trouble(
    headings: str, keys: dict[str, object], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path, f"{headings},T1 [degC],Z [um]\n{rows()}")
    with pytest.raises(
        TwoReadingsError, match=r"'Datum' contains 2024-03-07 in line 22, which is not the day 3\.00 h after"
    ):
        read(path, check_content(keys, "m"))
    mapping = tmp_path / "mapping.toml"
    mapping.write_text('[time]\ncolumn = "Uhrzeit"\nformat = "%H:%M:%S"\n' if keys else "", encoding="utf-8")
    for command in (["check"], ["map", "--yes"], ["fit", "--target", "Z_um", "-o", str(tmp_path / "m.json")]):
        assert run([command[0], str(path), "--mapping", str(mapping), *command[1:]]) == 2
        assert "date = " in capsys.readouterr().err
    # the first remedy reads it
    with pytest.raises(TwoReadingsError) as caught:
        read(path, check_content(keys, "m"))
    is_whole(read(path, check_content(dict(caught.value.remedies[0]), "m")))


def test_of_two_columns_of_dates_the_wrong_one_is_not_taken(tmp_path: Path) -> None:
    printed = rows("%H:%M:%S,2024-05-01,%Y-%m-%d")
    path = write(tmp_path, f"Time,Printed,Measured,T1 [degC],Z [um]\n{printed}")
    with pytest.raises(TwoReadingsError, match="'Measured' contains 2024-03-07 in line 22") as caught:
        read(path)
    is_whole(read(path, check_content(dict(caught.value.remedies[0]), "m")))


def test_numbers_of_a_day_do_not_go_with_dates_either(tmp_path: Path) -> None:
    body = "".join(
        f"{t:%Y-%m-%d},{t.hour * 3600 + t.minute * 60},{a},{z}\n" for t, (a, z) in zip(INSTANTS, CELLS, strict=True)
    )
    path = write(tmp_path, f"Date,Time,T1,Z\n,s,degC,um\n{body}")
    for keys in ({}, {"time": {"column": "Time [s]", "date": "Date"}}):
        with pytest.raises(TwoReadingsError, match="split the file into tests"):
            read(path, check_content(keys, "m"))


def test_a_mapping_that_leaves_the_dates_out_is_warned_of(tmp_path: Path) -> None:
    path = write(tmp_path, f"Datum,Uhrzeit,T1 [degC],Z [um]\n{rows()}")
    keys = {"time": {"column": "Uhrzeit"}, "columns": {"Datum": {"role": "ignore"}}}
    (warning,) = (f for f in check(read(path, check_content(keys, "m"))) if f.kind == "left out")
    assert warning.severity == "warning"
    assert "'Datum' contains 2024-03-07 in line 22" in warning.text


@pytest.mark.parametrize("heading", ["Elapsed", "Laufzeit", "Rel. time"])
def test_time_that_passed_goes_with_the_dates_it_runs_through(heading: str, tmp_path: Path) -> None:
    begin = datetime(2024, 3, 5, 20)
    body = "".join(
        f"{begin + timedelta(minutes=10 * k):%d/%m/%Y},{k // 6:02}:{k % 6}0:00,{20 + k / 9:.2f},{k / 4}\n"
        for k in range(90)
    )
    recording = read(write(tmp_path, f"Datum,{heading},T1 [degC],Z [um]\n{body}"))
    assert recording.time.tolist() == [600.0 * k for k in range(90)]


def test_a_stamp_that_never_changes_is_no_time(tmp_path: Path) -> None:
    body = "".join(f"2024-01-31 08:00:00,{10 * k},{20 + k / 9:.2f},{k / 4}\n" for k in range(60))
    with pytest.raises(InputError, match="no time column found among Begun, Since"):
        read(write(tmp_path, f"Begun,Since,T1 [degC],Z [um]\n{body}"))


def test_time_that_passed_under_another_name_is_asked_for(tmp_path: Path) -> None:
    """From 20:00 on: at midnight the date changes, and the time runs on."""
    begin = datetime(2024, 3, 5, 20)
    days = [f"{begin + timedelta(minutes=10 * k):%Y-%m-%d}" for k in range(200)]
    passed = [f"{k // 6:02}:{k % 6}0:00,{20 + k / 9:.2f},{k / 4}\n" for k in range(200)]
    for count in (100, 200):  # beyond a day nothing else is possible
        body = "".join(f"{day},{row}" for day, row in zip(days[:count], passed, strict=False))
        path = write(tmp_path, f"Date,Time,T1 [degC],Z [um]\n{body}")
        with pytest.raises(InputError) as caught:
            read(path)
        if count == 100:
            assert "is it an elapsed time, or was there a pause of a whole day?" in str(caught.value)
            remedy = check_content(dict(caught.value.remedies[0]), "m")
            assert read(path, remedy).time.tolist() == [600.0 * k for k in range(count)]


def test_a_date_that_never_changes_is_that_of_the_test(tmp_path: Path) -> None:
    body = "".join(f"2024-01-31,{3600 * k},{20 + k / 9:.2f},{k / 4}\n" for k in range(60))
    assert read(write(tmp_path, f"Calibrated,time_s,T1 [degC],Z [um]\n{body}"), Mapping()).time[-1] == 59 * 3600


def test_tests_on_several_days_are_not_asked_for_the_unit_of_their_times(tmp_path: Path) -> None:
    """Temperatures that take days for their span: the stamps tell how long that was."""
    days = [datetime(2024, 3, day, 9) + timedelta(minutes=8 * k) for day in (5, 7, 10) for k in range(15)]
    cells = "".join(f"{t:%Y/%m/%d,%H:%M:%S},{20 + k % 15 / 4 + k / 9:.2f},{k % 15:.2f}\n" for k, t in enumerate(days))
    path = write(tmp_path, f"Date,Time,T,Z\nUnit,,degC,um\n{cells}")
    assert not [f for f in check(read(path)) if f.kind == "time unit"]
    assert run(["map", str(path), "--yes", "-o", str(tmp_path / "map.toml")]) == 0
    mapping = (tmp_path / "map.toml").read_text()
    assert 'unit = "ms"' not in mapping


@pytest.mark.parametrize(
    ("said", "seconds"), [("hh:mm", 60), ("[HH:MM]", 60), ("h:mm", 60), ("mm:ss", 1), ("(m:ss)", 1), ("MM:SS", 1)]
)
@pytest.mark.parametrize("below", [True, False])
def test_a_time_of_two_parts_is_read_as_stated(said: str, seconds: int, below: bool, tmp_path: Path) -> None:
    body = "".join(f"{k // 60 + 58:02}:{k % 60:02},{20 + k / 80},{k / 4}\n" for k in range(150))
    head = f"Time,T1,Z\n{said},degC,um\n" if below else f"Time ({said.strip('[]()')}),T1 [degC],Z [um]\n"
    path = write(tmp_path, head + body)
    recording = read(path)
    assert recording.time.tolist() == [float(k * seconds) for k in range(150)]
    assert any("as the heading specifies" in note for note in recording.notes)
    form = "%H:%M" if seconds == 60 else "%M:%S"
    assert f"is read as {form}" in " ".join(recording.notes)


def test_a_mapping_of_the_time_without_its_form_still_fits(tmp_path: Path) -> None:
    path = write(tmp_path, "Time,T1,Z\nmm:ss,degC,um\n" + "".join(f"00:{k:02},{20 + k},{k}\n" for k in range(30)))
    mapping = check_content({"time": {"column": "Time", "format": "%H:%M"}}, "m")
    assert read(path, mapping).time[-1] == 29 * 60


@pytest.mark.parametrize(("said", "cell"), [("hh:mm", "00:01:30"), ("mm:ss", "00:75"), ("mm:ss", "01:02:03")])
def test_a_stated_form_that_a_row_does_not_have_is_refused(said: str, cell: str, tmp_path: Path) -> None:
    body = "".join(f"00:{k:02},{20 + k},{k}\n" for k in range(30))
    with pytest.raises(InputError, match=f"'{cell}' is not a time like '00:00'"):
        read(write(tmp_path, f"Time,T1,Z\n{said},degC,um\n{body}{cell},50,30\n"))


def _write_clock(folder: Path, said: str, cells: Sequence[str], *, below: bool = False, date: str = "") -> Path:
    """Write a file whose heading or row of units states a format; the date, if any, is in a column before it."""
    first = "Date," * bool(date)
    head = (
        f"{first}Time,T1,Z\n{',' * bool(date)}{said},degC,um\n"
        if below
        else f"{first}Time{f' [{said}]' * bool(said)},T1_C,Z_um\n"
    )
    body = (f"{date}{',' * bool(date)}{cell},{20 + k / 80},{k / 4}\n" for k, cell in enumerate(cells))
    return write(folder, head + "".join(body))


def _parts(seconds: int) -> dict[str, int]:
    return {"d": seconds // 86400, "h": seconds // 3600 % 24, "m": seconds // 60 % 60, "s": seconds % 60}


@pytest.mark.parametrize(
    ("said", "shown", "step"),
    [
        *(("d:hh:mm", "{d}:{h:02}:{m:02}", 1800), ("DDD:HH:MM", "{d:03}:{h:02}:{m:02}", 1800)),
        *(("d:hh:mm:ss", "{d}:{h:02}:{m:02}:{s:02}", 1790), ("dd:hh:mm:ss", "{d:02}:{h:02}:{m:02}:{s:02}", 10)),
        *(("mm:ss.f", "{m}:{s:02}.0", 7), ("mm:ss:fff", "{m:02}:{s:02}:000", 7), ("MM:SS.000", "{m}:{s:02}.000", 7)),
        *(("min:sec", "{m}:{s:02}", 7), ("m:ss", "{m}:{s:02}", 7)),
    ],
)
@pytest.mark.parametrize("below", [True, False])
def test_elapsed_times_are_read_in_the_stated_format(
    said: str, shown: str, step: int, below: bool, tmp_path: Path
) -> None:
    cells = [shown.format(**_parts(step * k)) for k in range(150)]
    recording = read(_write_clock(tmp_path, said, cells, below=below))
    assert recording.time.tolist() == [float(step * k) for k in range(150)]
    assert "is read as" in " ".join(recording.notes)


@pytest.mark.parametrize(("said", "days"), [("mm:ss:ms", ""), ("d hh:mm:ss", "0 01:"), ("d.hh:mm:ss", "0.01:")])
def test_a_stated_fraction_is_kept(said: str, days: str, tmp_path: Path) -> None:
    mark = "." if days else ":"
    cells = [f"{days}{k // 120:02}:{k // 2 % 60:02}{mark}{k % 2 * 500:03}" for k in range(150)]
    assert read(_write_clock(tmp_path, said, cells)).time.tolist() == [k / 2 for k in range(150)]


@pytest.mark.parametrize("below", [True, False])
def test_minutes_and_seconds_beside_a_date_are_elapsed_times(below: bool, tmp_path: Path) -> None:
    cells = [f"{k // 12:02}:{5 * k % 60:02}" for k in range(150)]
    path = _write_clock(tmp_path, "mm:ss", cells, below=below, date="16.03.2026")
    assert read(path).time.tolist() == [5.0 * k for k in range(150)]
    mapping = check_content({"time": {"column": "Time" if below else "Time [mm:ss]", "date": "Date"}}, "m")
    with pytest.raises(InputError, match="cannot be read in the format"):
        read(path, mapping)


def test_minutes_and_seconds_that_pass_the_hour_beside_a_date_are_refused(tmp_path: Path) -> None:
    cells = [f"{k // 3 % 60:02}:{20 * k % 60:02}" for k in range(200)]
    with pytest.raises(InputError, match=r"time 00:00 is before 59:40"):
        read(_write_clock(tmp_path, "mm:ss", cells, date="16.03.2026"))


@pytest.mark.parametrize(
    ("said", "cell"),
    [
        *(("mm:ss:ff", "{m:02}:{s:02}:00"), ("mm:ss:00", "{m:02}:{s:02}:50"), ("mm:ss", "0:{m:02}:{s:02}")),
        *(("hh:mm:ff", "{h:02}:{m:02}:00"), ("h:ss", "0:{s:02}"), ("min:s:1/100", "{m:02}:{s:02}:00")),
        *(("yyyy-mm-dd mm:ss", "2026-03-16 {m:02}:{s:02}"), ("d:hh:mm", "{d} {h:02}.{m:02}")),
    ],
)
@pytest.mark.parametrize("below", [True, False])
def test_other_stated_formats_are_refused(said: str, cell: str, below: bool, tmp_path: Path) -> None:
    path = _write_clock(tmp_path, said, [cell.format(**_parts(20 * k)) for k in range(150)], below=below)
    with pytest.raises(InputError, match=r"column 'Time \[.*' cannot be read in the format .*\[time\] column"):
        read(path)
    assert run(["map", str(path), "--yes", "-o", str(tmp_path / "map.toml")]) == 2


def test_heading_and_row_of_units_that_state_different_clocks_are_refused(tmp_path: Path) -> None:
    body = "".join(f"{k // 60:02}:{k % 60:02},{20 + k / 80},{k / 4}\n" for k in range(150))
    with pytest.raises(InputError, match="cannot be read in the format"):
        read(write(tmp_path, f"Time [hh:mm],T1,Z\nmm:ss,degC,um\n{body}"))
    assert read(write(tmp_path, f"Time [s],T1,Z\nmm:ss,degC,um\n{body}")).time[-1] == 149


def test_the_format_of_a_spreadsheet_cell_does_not_leave_out_its_hours(tmp_path: Path) -> None:
    book = openpyxl.Workbook()
    assert book.active is not None
    for row in [("Time [mm:ss]", "T1_C", "Z_um"), *((time(0, k, 0), 20.0 + k, k / 4) for k in range(40))]:
        book.active.append(row)
    book.save(tmp_path / "logger.xlsx")
    assert read(tmp_path / "logger.xlsx").time[-1] == 39 * 60


@pytest.mark.parametrize(
    ("cells", "said"),
    [
        ([f"0:{k // 60:02}:{k % 60:02}:00" for k in range(150)], ""),
        ([f"00:00:{k // 6:02}:{10 * k % 60:02}" for k in range(150)], ""),
        ([f"00:00:{k // 5:02}:{5 * k % 25:02}" for k in range(150)], "hh:mm:ss:ff"),
    ],
)
def test_a_fourth_part_that_may_be_seconds_or_frames_is_asked_about(
    cells: list[str], said: str, tmp_path: Path
) -> None:
    path = _write_clock(tmp_path, said, cells)
    with pytest.raises(TwoReadingsError, match="seconds after days, hours and minutes, or a fraction or frames"):
        read(path)
    assert run(["map", str(path), "--yes", "-o", str(tmp_path / "map.toml")]) == 2


@pytest.mark.parametrize("last", ["{:02}", "{:03}"])
def test_a_fourth_part_that_can_only_be_a_fraction_is_read(last: str, tmp_path: Path) -> None:
    half = 50 if last == "{:02}" else 500
    cells = [f"08:{k // 120:02}:{k // 2 % 60:02}:{last.format(k % 2 * half)}" for k in range(150)]
    assert read(_write_clock(tmp_path, "", cells)).time.tolist() == [k / 2 for k in range(150)]
    path = _write_clock(tmp_path, "hh:mm:ss:ff", cells, date="16.03.2026")
    assert read(path).time.tolist() == [k / 2 for k in range(150)]


@pytest.mark.parametrize("brackets", ["[]", "[1]", "[ ]"])
def test_brackets_without_a_unit_are_no_unit(brackets: str, tmp_path: Path) -> None:
    body = "".join(f"00:{k:02}:00,{20 + k},{k}\n" for k in range(30))
    assert read(write(tmp_path, f"Time,{brackets} T1_C,Z_um\n{body}")).table.shape == (30, 2)


def test_a_time_of_day_beside_a_date_keeps_its_name(tmp_path: Path) -> None:
    path = write(tmp_path, "Date,Time,T1,Z\n-,hh:mm,degC,um\n" + rows("%d/%m/%Y,%H:%M"))
    with pytest.raises(TwoReadingsError, match=r'\[time\] column = "Time", date = "Date" and format'):
        read(path)


def test_a_sign_may_stand_apart_from_its_number(tmp_path: Path) -> None:
    cells = "".join(
        f"{t:%Y/%m/%d,%H:%M:%S},+   {a:.1f},-  {z:.1f}\n" for t, (a, z) in zip(INSTANTS, CELLS, strict=True)
    )
    found = read(write(tmp_path, f"Date,Time,T,Z\nUnit,,degC,um\n{cells}"))
    assert found.table["T_C"].to_numpy()[-1] == 27.4
    assert found.table["Z_um"].to_numpy()[-1] == -14.8
