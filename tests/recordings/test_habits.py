"""Recordings as loggers, spreadsheets and people write them: all are the same test."""

import zipfile
from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np
import pandas as pd
import pytest

from thermocomp.core.exceptions import InputError, RecordingError
from thermocomp.recordings.readers.mapping import ColumnMap, Mapping, ReadOptions, TimeColumn
from thermocomp.recordings.readers.recordings import read
from thermocomp.recordings.recording import Recording

BEGIN = datetime(2024, 5, 6, 8)
#: time [s], speed [1/min], two temperatures [degC], displacement [um]
ROWS = [(10.0 * k, 3000.0 * (k > 2), 20.1 + 0.3 * k, 20.0 + 0.1 * k, 0.5 * k) for k in range(12)]
QUANTITIES = ["spindle_speed", "temperature", "temperature", "displacement"]


def text(rows: list[tuple[object, ...]], delimiter: str = ";", decimal: str = ",") -> str:
    return "".join(delimiter.join(str(c).replace(".", decimal) for c in row) + "\n" for row in rows)


def numbers(*, stamp: str = "", factor: float = 1.0) -> list[tuple[object, ...]]:
    """Return the rows, the displacement in another unit, and the time as dates in a format."""
    found: list[tuple[object, ...]] = []
    for t, n, a, b, z in ROWS:
        time = (BEGIN + timedelta(seconds=t)).strftime(stamp) if stamp else t
        found.append((time, n, round(a, 6), round(b, 6), round(z * factor, 9)))
    return found


def stamped(stamp: str, delimiter: str = ";", decimal: str = ",") -> str:
    """Return the rows with dates, whose points stay."""
    rows = numbers(stamp=stamp)
    return "".join(f"{row[0]}{delimiter}{text([row[1:]], delimiter, decimal)}" for row in rows)


def same(recording: Recording) -> None:
    assert recording.time.tolist() == [row[0] for row in ROWS]
    assert [c.quantity for c in recording.channels] == QUANTITIES
    np.testing.assert_allclose(recording.table.to_numpy(), np.array(ROWS)[:, 1:], rtol=0, atol=1e-9)


HEAD = "Zeit [s];Drehzahl [U/min];T1 [°C];T2 [°C];Verlagerung Z [µm]\n"
HABITS = {
    "German spreadsheet": "sep=;\n" + HEAD + text(numbers()),
    "English spreadsheet": "Time (s),Spindle (rpm),T1 (°C),T2 (°C),Drift Z (µm)\n" + text(numbers(), ",", "."),
    "preamble and a row of units": "Logger XY 12;Serial 4711\nKanal;Bemerkung\n\n"
    "Zeit;Drehzahl;T1;T2;Weg Z\ns;1/min;°C;°C;µm\n" + text(numbers()),
    "units in brackets below": "Time\tSpeed spindle\tT1\tT2\tWeg Z\n[s]\t[min-1]\t[degC]\t[degC]\t[mm]\n"
    + text(numbers(factor=1e-3), "\t", "."),
    "DIN 1313": "Zeit / s;Drehzahl / min⁻¹;T1 / °C;T2 / °C;Weg / µm\n" + text(numbers()),
    "units behind the names": "Zeit in s;Spindel U/min;T1 Grad C;T2 °C;Weg Z 0,001 mm\n" + text(numbers()),
    "date and time of day": "Datum;Uhrzeit;Drehzahl [U/min];T1 [°C];T2 [°C];Z [µm]\n" + stamped("%d.%m.%Y;%H:%M:%S"),
    "French": "Date/Heure;Broche [tr/min];T1 [°C];T2 [°C];Z [µm]\n" + stamped("%Y-%m-%d %H:%M:%S"),
    "a time stamp of a logger": "Zeitstempel,n 1/min,T1 degC,T2 degC,Z um\n"
    + stamped("%Y-%m-%dT%H:%M:%S.%f", ",", "."),
    "UTC": "timestamp;spindle_rpm;t1_C;t2_C;z_um\n" + stamped("%Y-%m-%d %H:%M:%SZ"),
    "old Windows": HEAD + text(numbers()).replace("\n", "\r\n"),
    "ends its rows with a delimiter": HEAD + text(numbers()).replace("\n", ";\n"),
    "a Fahrenheit-free American": "Elapsed Time (sec),Spindle Speed (RPM),T1 (Celsius),T2 (Celsius),Z (microns)\n"
    + text(numbers(), ",", "."),
}


@pytest.mark.parametrize("name", HABITS)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252"])
def test_it_is_the_same_recording(name: str, encoding: str, tmp_path: Path) -> None:
    if encoding == "cp1252" and "⁻" in HABITS[name]:
        pytest.skip("cp1252 has no such sign")
    path = tmp_path / "habit.csv"
    path.write_bytes(HABITS[name].encode(encoding))
    same(read(path))


def test_what_was_passed_over_is_told(tmp_path: Path) -> None:
    path = tmp_path / "habit.csv"
    path.write_text(HABITS["preamble and a row of units"], encoding="utf-8")
    assert read(path).notes[:2] == ("lines 1 to 2 above the headings are skipped", "line 5 holds the units")


def test_the_line_of_the_headings_can_be_stated(tmp_path: Path) -> None:
    path = tmp_path / "habit.csv"
    names = "time_s;n_rpm;t1_C;t2_C;z_um\n"
    path.write_text("a;b;c;d;e\n1;2;3;4;5\n" + names + text(numbers()), encoding="utf-8")
    with pytest.raises(RecordingError, match="no time column"):
        read(path)
    same(read(path, Mapping(read=ReadOptions(heading=3))))
    rows: list[list[object]] = [["a", "b"], [1.0, 2.0], [*names.strip().split(";")], *map(list, numbers())]
    xlsx(path.with_suffix(".xlsx"), {"data": rows})
    same(read(path.with_suffix(".xlsx"), Mapping(read=ReadOptions(heading=3))))


def test_a_wrong_row_is_told_behind_a_preamble_too(tmp_path: Path) -> None:
    path = tmp_path / "habit.csv"
    path.write_text(HABITS["preamble and a row of units"].replace("20,4;", "2O,4;"), encoding="utf-8")
    with pytest.raises(RecordingError, match=r"line 7, column 'T1 \[°C\]': '2O,4' is not a number"):
        read(path)


def test_columns_of_one_name_are_told_apart_by_number(tmp_path: Path) -> None:
    path = tmp_path / "twins.csv"
    path.write_text(HEAD.replace("T2", "T1") + text(numbers()), encoding="utf-8")
    with pytest.raises(
        RecordingError, match=r"columns 3 and 4 are both named 'T1 \[°C\]'.*\[columns.NAME\] column = 4"
    ):
        read(path)
    both = Mapping(columns={"front_C": ColumnMap(3), "rear_C": ColumnMap(4)})
    same(read(path, both))
    with pytest.raises(RecordingError, match=r"\[columns.side_C\]: the file has 5 columns, but no column number 6"):
        read(path, Mapping(columns={**both.columns, "side_C": ColumnMap(6)}))


def test_dates_that_can_be_read_in_two_ways_are_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "american.csv"
    path.write_text("Day;Clock;n_rpm;T1_C;T2_C;z_um\n" + stamped("%m/%d/%Y;%H:%M:%S"), encoding="utf-8")
    with pytest.raises(RecordingError, match="state how it is written in a mapping"):
        read(path)
    same(read(path, Mapping(TimeColumn("Clock", format="%m/%d/%Y %H:%M:%S", date="Day"))))


def test_what_a_channel_cannot_have_is_missing_and_listed(tmp_path: Path) -> None:
    path = tmp_path / "outliers.csv"
    rows = numbers()
    rows[4] = (*rows[4][:4], 2500.0)
    rows[5] = (*rows[5][:4], -1200.0)
    path.write_text(HEAD + text(rows), encoding="utf-8")
    valid = Mapping(columns={"z_um": ColumnMap(5, "um", valid=(-500.0, 500.0))})
    recording = read(path, valid)
    assert np.flatnonzero(recording.table["z_um"].isna()).tolist() == [4, 5]
    (note,) = (n for n in recording.notes if n.startswith("z_um"))
    assert note == "z_um: not within -500 to 500 um, taken as missing, in 2 of 12 cells: line 6, line 7"
    with pytest.raises(InputError, match=r"\[columns.z_um\]: valid = \[5.0, 5.0\]: the first must be below the second"):
        Mapping(columns={"z_um": ColumnMap(5, "um", valid=(5.0, 5.0))})


# -- workbooks -----------------------------------------------------------------------------------------------------


def xlsx(path: Path, sheets: dict[str, list[list[object]]]) -> None:
    with pd.ExcelWriter(path) as book:
        for name, rows in sheets.items():
            even = [[*row, *[None] * (max(map(len, rows)) - len(row))] for row in rows]
            pd.DataFrame(even).to_excel(book, sheet_name=name, header=False, index=False)


def ods(path: Path, sheets: dict[str, list[list[object]]]) -> None:
    """Write as LibreOffice does, with the empty rest of each sheet."""
    body = ""
    for name, rows in sheets.items():
        body += f'<table:table table:name="{escape(name)}">'
        for row in rows:
            body += "<table:table-row>"
            for cell in row:
                if cell is None:
                    body += '<table:table-cell table:number-columns-repeated="1"/>'
                elif isinstance(cell, datetime):
                    body += f'<table:table-cell office:value-type="date" office:date-value="{cell.isoformat()}"/>'
                elif isinstance(cell, str):
                    words = f"<text:p>{escape(cell)}</text:p>"
                    body += f'<table:table-cell office:value-type="string">{words}</table:table-cell>'
                else:
                    body += f'<table:table-cell office:value-type="float" office:value="{cell}"/>'
            body += '<table:table-cell table:number-columns-repeated="16000"/></table:table-row>'
        body += (
            '<table:table-row table:number-rows-repeated="1048000"><table:table-cell/></table:table-row></table:table>'
        )
    spaces = " ".join(f'xmlns:{n}="urn:oasis:names:tc:opendocument:xmlns:{n}:1.0"' for n in ("office", "table", "text"))
    with zipfile.ZipFile(path, "w") as parts:
        parts.writestr("content.xml", f"<office:document-content {spaces}>{body}</office:document-content>")


SHEET: list[list[object]] = [
    ["Prüfprotokoll", None, None, None, None],
    ["Zeit", "Drehzahl", "T1", "T2", "Weg Z"],
    ["s", "U/min", "°C", "°C", "µm"],
    *([*row] for row in numbers()),
]
NOTES: list[list[object]] = [["machine 7"], ["operator", "M. Weber"]]
Writer = Callable[[Path, dict[str, list[list[object]]]], None]


@pytest.mark.parametrize(("writer", "ending"), [(xlsx, "xlsx"), (ods, "ods")])
def test_the_sheet_with_the_table_is_read(writer: Writer, ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"book.{ending}"
    writer(path, {"notes": NOTES, "data": SHEET})
    recording = read(path)
    same(recording)
    assert recording.notes[:3] == (
        "sheet 'data' of 'notes', 'data' is read",
        "row 1 above the headings is skipped",
        "row 3 holds the units",
    )
    writer(path, {"warm": SHEET, "cold": SHEET})
    with pytest.raises(
        RecordingError, match=r"the sheets 'warm', 'cold' all hold a table; .*\[read\] sheet = \"warm\""
    ):
        read(path)
    same(read(path, Mapping(read=ReadOptions(sheet="cold"))))
    with pytest.raises(RecordingError, match="no sheet 'hot'; there are 'warm', 'cold'"):
        read(path, Mapping(read=ReadOptions(sheet="hot")))


def test_dates_of_a_sheet(tmp_path: Path) -> None:
    rows = [["Datum/Uhrzeit", *SHEET[1][1:]], [None, *SHEET[2][1:]]]
    rows += [[BEGIN + timedelta(seconds=row[0]), *row[1:]] for row in ROWS]
    for writer, ending in ((xlsx, "xlsx"), (ods, "ods")):
        path = tmp_path / f"dates.{ending}"
        writer(path, {"data": rows})
        same(read(path))
        assert read(path).start == "2024-05-06T08:00:00"


@pytest.mark.parametrize(("writer", "ending"), [(xlsx, "xlsx"), (ods, "ods")])
def test_a_sheet_is_bounded(writer: Writer, ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"wide.{ending}"
    writer(path, {"data": [*SHEET, [None] * 11_000 + [1.0]]})
    with pytest.raises(RecordingError, match=r"sheet 'data', row 16: over 10,000 columns, .*\[limits\] columns"):
        read(path)


@pytest.mark.parametrize(
    ("head", "units", "said"),
    [
        ("time_s,T1_C,z_um", "min,°C,um", "column 1: the heading 'time_s' specifies s, row 2 below it 'min'"),
        ("time [h],T1_C,z_um", "[s],[°C],[um]", "column 1: the heading 'time [h]' specifies h, row 2 below it 's'"),
        ("Zeit (s),T1,z", "min,°C,um", "column 1: the heading 'Zeit (s)' specifies s, row 2 below it 'min'"),
        ("time,T1 [°C],z", "s,°F,um", "column 2: the heading 'T1 [°C]' specifies degC, row 2 below it '°F'"),
        ("time,T1,z [um]", "s,°C,mm", "column 3: the heading 'z [um]' specifies um, row 2 below it 'mm'"),
    ],
)
def test_a_row_of_units_that_contradicts_the_headings_is_refused(
    head: str, units: str, said: str, tmp_path: Path
) -> None:
    path = tmp_path / "log.csv"
    path.write_text(
        f"{head}\n{units}\n" + "".join(f"{k},{20 + k / 60},{k / 10}\n" for k in range(60)), encoding="utf-8"
    )
    with pytest.raises(RecordingError) as refused:
        read(path)
    assert said in str(refused.value)


def test_a_row_of_units_that_is_wrong_is_skipped_and_one_that_agrees_is_read(tmp_path: Path) -> None:
    path, rows = tmp_path / "log.csv", "".join(f"{k},{20 + k / 60},{k / 10}\n" for k in range(60))
    path.write_text(f"time_s,T1_C,z_um\nmin,°C,um\n{rows}", encoding="utf-8")
    assert read(path, Mapping(read=ReadOptions(skip=(2,)))).time[-1] == 59.0
    path.write_text(f"time_s,T1_C,z_um\nsec,degC,µm\n{rows}", encoding="utf-8")
    assert read(path).time[-1] == 59.0
