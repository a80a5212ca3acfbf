"""What can be read in two ways is asked for; what is certain is read, and the notes say why it is."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from thermocomp.core.exceptions import InputError, RecordingError
from thermocomp.recordings.readers.mapping import Mapping, ReadOptions, TimeColumn
from thermocomp.recordings.readers.numbers import Notation, Signs
from thermocomp.recordings.readers.recordings import read
from thermocomp.recordings.recording import Recording

TEMPERATURES = [20.0 + k / 8 for k in range(400)]


def table(folder: Path, heading: str, times: list[str], cells: list[str] | None = None, delimiter: str = ";") -> Path:
    """Write a column of times beside one of temperatures."""
    path = folder / "table.csv"
    values = cells or [f"{t:.3f}".rstrip("0") + "0" for t in TEMPERATURES[: len(times)]]
    rows = "".join(f"{t}{delimiter}{v}\n" for t, v in zip(times, values, strict=True))
    path.write_text(f"{heading}{delimiter}T1 [C]\n{rows}", encoding="utf-8")
    return path


def told(recording: Recording, part: str) -> bool:
    return any(part in note for note in recording.notes)


# -- dates ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("heading", "stamps", "start", "seconds", "note"),
    [
        ("Date", ["05/27/24 08:00", "05/27/24 08:01"], "2024-05-27T08:00:00", 60, "month/day/year: '05/27/24 08:00'"),
        (
            "Date",
            ["03/05/2024 08:00", "14/05/2024 08:00"],
            "2024-05-03T08:00:00",
            950400,
            "day/month/year: '14/05/2024",
        ),
        (
            "Date",
            ["01/12/2024 8:00", "02/01/2024 8:00"],
            "2024-01-12T08:00:00",
            1728000,
            "otherwise time would not increase",
        ),
        (
            "Date (DD-MM-YYYY)",
            ["03-04-2024 08:00:00", "03-04-2024 08:00:09"],
            "2024-04-03T08:00:00",
            9,
            "heading specifies",
        ),
        (
            "Datum [TT/MM/JJJJ]",
            ["03/04/2024 08:00", "03/04/2024 08:01"],
            "2024-04-03T08:00:00",
            60,
            "heading specifies",
        ),
        ("Datum", ["06.05.24 08:00:00", "06.05.24 08:00:10"], "2024-05-06T08:00:00", 10, ""),
        ("Datum", ["27. Mai 2024 08:00", "27. Mai 2024 08:01"], "2024-05-27T08:00:00", 60, ""),
        ("Datum", ["27.Okt.2024 08:00:00", "27.Okt.2024 08:00:10"], "2024-10-27T08:00:00", 10, ""),
        ("Date", ["May 27, 2024 11:59:50 AM", "May 27, 2024 12:00:00 PM"], "2024-05-27T11:59:50", 10, ""),
        ("Date", ["2024-05-27 08:00:00,500", "2024-05-27 08:00:01,000"], "2024-05-27T08:00:00.500000", 0.5, ""),
        ("Date", ["27.05.2024 08:00:00", "27.05.2024 08:00:01.250"], "2024-05-27T08:00:00", 1.25, ""),
        ("Zeit", ["27.10.2024 02:59:50 CEST", "27.10.2024 02:00:00 CET"], "2024-10-27T02:59:50+02:00", 10, "CEST is"),
        ("Zeit", ["27.10.2024 02:59 +0200", "27.10.2024 02:00 +0100"], "2024-10-27T02:59:00+02:00", 60, ""),
        ("time", ["1716796800", "1716796810.5"], "2024-05-27T08:00:00+00:00", 10.5, "seconds since 1970"),
        ("time", ["1716796800000000", "1716796800250000"], "2024-05-27T08:00:00+00:00", 0.25, "microseconds since"),
        ("Time [ms]", ["1716796800000", "1716796800125"], "2024-05-27T08:00:00+00:00", 0.125, "counts from 1970"),
        ("Datum", ["45439.3333333333", "45439.3334490741"], "2024-05-27T08:00:00", 10, "days since 1899-12-30"),
    ],
)
def test_what_only_one_reading_fits_is_read(
    tmp_path: Path, heading: str, stamps: list[str], start: str, seconds: float, note: str
) -> None:
    recording = read(table(tmp_path, heading, stamps))
    assert (recording.start, recording.time.tolist()) == (start, [0.0, seconds])
    assert not note or told(recording, note), recording.notes


@pytest.mark.parametrize(
    ("heading", "stamps", "asks"),
    [
        ("Date", ["24/05/06 08:00", "24/05/06 08:01"], "day/month/year or year/month/day.*%d/%m/%y %H:%M.*%y/%m/%d"),
        ("Date", ["03-04-2024 08:00", "04-04-2024 08:00"], "day/month/year or month/day/year"),
        ("Date", ["03/04/2024 8:00:00 PM", "03/04/2024 8:00:10 PM"], "%d/%m/%Y %I:%M:%S %p"),
        ("Zeit", ["00:10", "00:20"], "hours and minutes or as minutes and seconds.*%H:%M.*%M:%S"),
        ("Zeit", ["2024-05-27 08:00:00 EST", "2024-05-27 08:00:10 EST"], "state how it is written"),
        ("Time", ["45439.3333333333", "45439.3334490741"], "holds numbers from 45439.333333333 .* has no unit"),
        ("Time [m]", ["0", "1"], "'m' denotes metres; write min for minutes"),
        ("T", ["0", "1"], "no time column"),
        ("Zeit", ["23:59:40", "23:59:50", "05:00:00"], "05:00:00 is before 23:59:50"),
    ],
)
def test_what_two_readings_fit_is_asked_for(tmp_path: Path, heading: str, stamps: list[str], asks: str) -> None:
    with pytest.raises(InputError, match=asks):
        read(table(tmp_path, heading, stamps))


def test_an_hour_that_is_missing_at_the_change_to_summer_time_is_asked_for(tmp_path: Path) -> None:
    def night(day: str) -> list[str]:
        return [f"{day} {clock}" for clock in ("01:59:40", "01:59:50", "03:00:00", "03:00:10")]

    with pytest.raises(InputError, match=r"line 4.*an hour is missing.*daylight saving.*offset"):
        read(table(tmp_path, "Time", night("2024-03-31")))
    # nothing is doubtful on a Wednesday, or with an offset
    assert read(table(tmp_path, "Time", night("2024-03-27"))).time.tolist() == [0, 10, 3620, 3630]
    stamps = [f"{s}+0{1 + (k > 1)}:00" for k, s in enumerate(night("2024-03-31"))]
    assert read(table(tmp_path, "Time", stamps)).time.tolist() == [0, 10, 20, 30]


@pytest.mark.parametrize(
    "clocks",
    [
        ["23:59:40", "23:59:50", "00:00:00", "00:00:10"],
        ["11:59:40 PM", "11:59:50 PM", "12:00:00 AM", "12:00:10 a.m."],
    ],
)
def test_a_time_of_day_goes_over_midnight(tmp_path: Path, clocks: list[str]) -> None:
    recording = read(table(tmp_path, "Zeit", clocks))
    assert recording.time.tolist() == [0, 10, 20, 30]
    assert told(recording, "the time of day passes midnight in line 4")


@pytest.mark.parametrize(
    "passed",
    [
        ["23:59:50", "24:00:00", "24:00:10.5"],
        ["0 days 23:59:50", "1 days 00:00:00", "1 days 00:00:10.5"],
        ["0.23:59:50", "1.00:00:00", "1.00:00:10,5"],
        ["99:59:50", "100:00:00", "100:00:10.5"],
    ],
)
def test_a_time_that_passed_goes_beyond_a_day(tmp_path: Path, passed: list[str]) -> None:
    assert read(table(tmp_path, "Laufzeit", passed)).time.tolist() == [0, 10, 20.5]


def test_milliseconds_may_stand_in_a_column_of_their_own(tmp_path: Path) -> None:
    path = tmp_path / "ms.csv"
    rows = "".join(f"2024-05-27 08:00:0{k // 2},{500 * (k % 2) + 125},2{k}\n" for k in range(4))
    path.write_text(f"Date&Time,ms,t1_C\n{rows}", encoding="utf-8")
    recording = read(path)
    assert recording.time.tolist() == [0, 0.5, 1, 1.5]
    assert told(recording, "'ms' is added to the time")


def test_channels_sampled_at_different_times_are_no_recording(tmp_path: Path) -> None:
    path = tmp_path / "pairs.csv"
    path.write_text("Time [s];A [°C];Time [s];B [°C]\n0;1;0;2\n10;1;10,5;3\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"columns 1 and 3 .*'Time \[s\]'.* 10.0 and 10.5 in line 3"):
        read(path)


# -- numbers -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("cells", "values", "notation"),
    [
        (["1.234,5", "999", "1.234"], [1234.5, 999, 1234], Notation(",", ".")),
        (["1,234.5", "999", "1,234"], [1234.5, 999, 1234], Notation(".", ",")),
        (["1'234.5", "999"], [1234.5, 999], Notation(".", "'")),
        (["1 234,5", "999"], [1234.5, 999], Notation(",", " ")),
        (["1\u202f234,5", "1\u00a0234"], [1234.5, 1234], Notation(",", "\u00a0\u202f")),
        (["1,234,567", "1.5"], [1234567, 1.5], Notation(".", ",")),
        (["0,123", "21,456"], [0.123, 21.456], Notation(",")),
        (["1234,567", "21,456"], [1234.567, 21.456], Notation(",")),
        (["-1,5e3", "+ 2,5"], [-1500, 2.5], Notation(",")),
    ],
)
def test_signs_that_are_proven(cells: list[str], values: list[float], notation: Notation) -> None:
    signs = Signs()
    signs.add(cells)
    found = signs.decide("", ";")
    assert found == notation
    assert [found.read(cell) for cell in cells] == values


@pytest.mark.parametrize(
    "cell", ["12.5.3", "1.23.456", "1,2,3", "12,34.5", "0.123.456", "1 23", "1'23", "--1", "1e", "x"]
)
def test_what_is_no_number_is_none(cell: str) -> None:
    assert Notation(".", ",'").read(cell) is None
    assert Notation(",", ".'").read(cell) is None


@pytest.mark.parametrize(
    ("delimiter", "cells"),
    [(";", ["20,512", "21,456"]), (";", ["20.512", "21.456"]), ("\t", ["1,234"]), (",", ['"1,234"', '"1,235"'])],
)
def test_three_digits_behind_a_sign_are_asked_for(tmp_path: Path, delimiter: str, cells: list[str]) -> None:
    path = table(tmp_path, "time_s", [str(k) for k in range(len(cells))], cells, delimiter)
    with pytest.raises(InputError, match=r"can be read as \d+ or as .*\[read\] decimal"):
        read(path)
    sign = "." if "." in cells[0] else ","
    value = float(cells[0].strip('"').replace(sign, "."))
    assert read(path, Mapping(read=ReadOptions(decimal=sign))).table.iloc[0, 0] == value  # type: ignore[arg-type]
    other = "," if sign == "." else "."
    assert read(path, Mapping(read=ReadOptions(decimal=other))).table.iloc[0, 0] == value * 1000  # type: ignore[arg-type]


def test_the_sign_may_be_proven_late_and_doubted_late(tmp_path: Path) -> None:
    times = [str(k) for k in range(300)]
    assert read(table(tmp_path, "time_s", times, ["20,512"] * 299 + ["20,5"])).table.iloc[0, 0] == 20.512
    with pytest.raises(InputError, match=r"'20,512' can be read as 20512 or as 20\.512"):
        read(table(tmp_path, "time_s", times, ["20"] * 299 + ["20,512"]))


def test_a_point_is_the_decimal_sign_where_commas_separate_columns(tmp_path: Path) -> None:
    assert read(table(tmp_path, "time_s", ["1", "2"], ["20.512", "21.456"], ",")).table.iloc[0, 0] == 20.512


def test_thousands_with_and_without_separator_in_one_column_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"line 2 has '20.512' with a thousands separator, line 3 has '1234,5'"):
        read(table(tmp_path, "time_s", ["0", "1"], ["20.512", "1234,5"]))


@pytest.mark.parametrize(
    "word", ["OL", "over", "----", "#NV", "NaN(IND)", "-1.#IND", "Fehler", "Err:502", "*****", "+OL"]
)
def test_a_word_for_no_number_is_missing_and_told(tmp_path: Path, word: str) -> None:
    recording = read(table(tmp_path, "time_s", ["0", "1", "2"], ["20.5", word, "21.5"]))
    assert np.array_equal(recording.table.iloc[:, 0], [20.5, np.nan, 21.5], equal_nan=True)
    assert told(recording, f"T1 [C]: {word!r}, taken as missing, in 1 of 3 cells: line 3")
    with pytest.raises(InputError, match=r"line 3, column 'T1 \[C\]': 'warm' is not a number"):
        read(table(tmp_path, "time_s", ["0", "1", "2"], ["20.5", "warm", word]))


@pytest.mark.parametrize("cells", [["True", "False"], ["20.5", "True"], ["0x10", "20.5"], ["1_0", "20.5"]])
def test_what_python_would_take_for_a_number_is_none(tmp_path: Path, cells: list[str]) -> None:
    with pytest.raises(InputError, match=r"column 'T1 \[C\]': '(True|0x10|1_0)' is not a number"):
        read(table(tmp_path, "time_s", ["0", "1"], cells))


def test_every_digit_counts_whatever_stands_beside_it(tmp_path: Path) -> None:
    values = np.random.default_rng(7).normal(20, 1, 390)
    cells = [repr(float(v)).replace(".", ",") for v in values]
    words = [*cells, "OL", "1.234,5"]
    recording = read(table(tmp_path, "time_s", [str(k) for k in range(392)], words))
    assert np.array_equal(recording.table["T1_C"], [*values, np.nan, 1234.5], equal_nan=True)


def test_infinity_of_instruments_is_missing(tmp_path: Path) -> None:
    recording = read(table(tmp_path, "time_s", ["0", "1"], ["20.5", "+9.90000000E+37"]))
    assert recording.table["T1_C"].isna().tolist() == [False, True]
    assert told(recording, "T1_C: infinite, taken as missing, in 1 of 2 cells")


# -- units, names, rows --------------------------------------------------------------------------------------------


def test_kelvins_that_are_differences_are_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "kelvin.csv"
    path.write_text("time_s,T1 [K]\n0,0.5\n1,0.7\n", encoding="utf-8")
    with pytest.raises(
        InputError, match=r"'T1 \[K\]': values about 0.6 K cannot be temperatures: they are differences"
    ):
        read(path)
    path.write_text("time_s,dT1 [K],T2 [K],Charge [C]\n0,1,293.15,1\n1,1,294.15,1\n", encoding="utf-8")
    assert read(path).table.columns.tolist() == ["T2_C"]


@pytest.mark.parametrize(
    ("name", "asks"),
    [
        ("temp_front", "degC, K or degF"),
        ("Temperatur 1", "degC, K or degF"),
        ("T3", "degC, K or degF"),
        ("spindle_speed", "rpm or Hz"),
        ("Drehzahl", "rpm or Hz"),
        ("Drift Z", "um, mm or nm"),
    ],
)
def test_a_name_that_lacks_only_its_unit_is_asked_for(tmp_path: Path, name: str, asks: str) -> None:
    path = tmp_path / "names.csv"
    path.write_text(f"time_s,{name},t1_C\n0,1,20\n1,2,21\n", encoding="utf-8")
    with pytest.raises(InputError, match=rf"column '{name}' has no unit: .* in {asks}"):
        read(path)


def test_the_surface_is_no_time(tmp_path: Path) -> None:
    path = tmp_path / "surface.csv"
    path.write_text("timestamp,T_s,t1_C\n2024-05-27T08:00:00,20,21\n2024-05-27T08:00:10,21,22\n", encoding="utf-8")
    recording = read(path)
    assert (recording.time.tolist(), recording.table.columns.tolist()) == ([0, 10], ["t1_C"])
    assert told(recording, "left out: 'T_s': the time is taken from another column")


@pytest.mark.parametrize(
    ("end", "left_out"),
    [
        ("End of data\n", 1),
        ("\nMin;20;20\nMax;22;23\nMittelwert:;21;21\n", 3),
        ("Dauer;00:10:00\n", 1),
        ("Duration 10 s\nend\n", 2),
    ],
)
def test_rows_at_the_end_that_are_none_are_left_out(tmp_path: Path, end: str, left_out: int) -> None:
    path = tmp_path / "end.csv"
    path.write_text("time_s;t1_C;t2_C\n0;20;21\n10;21;22\n" + end, encoding="utf-8")
    recording = read(path)
    assert len(recording) == 2
    assert told(recording, "at the end " + ("is not part" if left_out == 1 else "are not part"))


@pytest.mark.parametrize(
    ("end", "refused"),
    [
        ("20;2", "perhaps cut off"),
        ("later;20;21\n", "line 4, column 'time_s': 'later'"),
        (";20;21\n", "line 4, column 'time_s': the time is missing"),
        ("20;warm;21\n", "line 4, column 't1_C': 'warm'"),
        ("End of data\n20;22;23\n", "line 4 has 1 cells"),
    ],
)
def test_a_row_at_the_end_that_is_one_is_not_left_out(tmp_path: Path, end: str, refused: str) -> None:
    path = tmp_path / "end.csv"
    path.write_text("time_s;t1_C;t2_C\n0;20;21\n10;21;22\n" + end, encoding="utf-8")
    with pytest.raises(InputError, match=refused):
        read(path)


def test_a_first_row_with_a_wrong_cell_is_not_passed_over(tmp_path: Path) -> None:
    for rows, wrong in (
        ("0;warm;5\n1;20;5\n2;21;5\n", "'t1_C': 'warm'"),
        ("0;warm;5\n1;hot;5\n2;21;5\n3;22;5\n", "'t1_C': 'warm'"),
        ("0E;20;5\n1;20;5\n2;21;5\n", "'time_s': '0E'"),
        ("later;20;5\n1;20;5\n2;21;5\n", "'time_s': 'later'"),
    ):
        path = tmp_path / "first.csv"
        path.write_text("time_s;t1_C;t2_C\n" + rows, encoding="utf-8")
        with pytest.raises(InputError, match=f"line 2, column {wrong}"):
            read(path)


def test_rows_of_labels_between_headings_and_table_are_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "labels.csv"
    path.write_text("Zeit;T1;T2\n1;2;3\ns;°C;°C\n;front;rear\n0;20;21\n1;21;22\n", encoding="utf-8")
    recording = read(path)
    assert recording.table.to_numpy().tolist() == [[20, 21], [21, 22]]
    assert recording.notes[:2] == (
        "between the headings and the table lines 2, 4 are skipped",
        "line 3 holds the units",
    )


def test_rows_at_the_end_of_a_sheet_are_left_out(tmp_path: Path) -> None:
    path = tmp_path / "end.xlsx"
    rows = [
        ["time_s", "t1_C", "t2_C"],
        [0, 20, 21],
        [10, 21, None],
        ["Max", 21, 21],
        ["checked by M. Weber", None, None],
    ]
    pd.DataFrame(rows).to_excel(path, header=False, index=False)
    recording = read(path)
    assert (len(recording), told(recording, "rows 4 to 5 at the end are not part")) == (2, True)


def test_headings_that_come_again_are_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "again.csv"
    path.write_text("time_s,t1_C\n0,20\n10,21\ntime_s,t1_C\n20,22\n30,warm\n", encoding="utf-8")
    with pytest.raises(InputError, match="line 6, column 't1_C': 'warm'"):
        read(path)
    path.write_text(path.read_text(encoding="utf-8").replace("warm", "23"), encoding="utf-8")
    recording = read(path)
    assert recording.table["t1_C"].tolist() == [20, 21, 22, 23]
    assert told(recording, "the headings are repeated in line 4; skipped")


@pytest.mark.parametrize(
    ("encoding", "note"),
    [
        ("cp850", "written in cp850, not in UTF-8"),
        ("mac-roman", "written in mac-roman, not in UTF-8"),
        ("cp1252", "written in cp1252, not in UTF-8"),
        ("utf-16-le", "written in UTF-16-LE"),
        ("utf-16-be", "written in UTF-16-BE"),
        ("utf-8", ""),
    ],
)
def test_encodings_are_told_apart_by_what_headings_hold(tmp_path: Path, encoding: str, note: str) -> None:
    path = tmp_path / "odd.csv"
    path.write_bytes("Zeit [s];Lager [°C];Überlauf [µm]\n0;20,5;1\n10;21,5;2\n".encode(encoding))
    recording = read(path)
    assert recording.table.columns.tolist() == ["Lager_C", "Überlauf_um"]
    assert not note or told(recording, note)


def stamps(path: Path, *texts: str) -> Path:
    path.write_text("timestamp,t1_C\n" + "".join(f"{t},{20 + k / 10}\n" for k, t in enumerate(texts)), "utf-8")
    return path


def test_a_clock_that_is_set_needs_its_zone(tmp_path: Path) -> None:
    spring = stamps(
        tmp_path / "spring.csv",
        "2024-03-31 01:57:00",
        "2024-03-31 01:58:00",
        "2024-03-31 01:59:00",
        "2024-03-31 03:00:00",
    )
    autumn = stamps(
        tmp_path / "autumn.csv",
        "2024-10-27 02:58:00",
        "2024-10-27 02:59:00",
        "2024-10-27 02:00:00",
        "2024-10-27 02:01:00",
    )
    berlin, utc = (Mapping(TimeColumn(zone=zone)) for zone in ("Europe/Berlin", "UTC"))
    for path in (spring, autumn):
        with pytest.raises(RecordingError, match=r"name the zone in a mapping, \[time\] zone = "):
            read(path)
    summer = read(spring, berlin)
    assert (summer.time.tolist(), summer.start) == ([0.0, 60.0, 120.0, 180.0], "2024-03-31T01:57:00+01:00")
    assert "'timestamp' is taken as the time in Europe/Berlin" in summer.notes
    assert read(spring, utc).time.tolist() == [0.0, 60.0, 120.0, 3780.0]
    winter = read(autumn, berlin)
    assert (winter.time.tolist(), winter.start) == ([0.0, 60.0, 120.0, 180.0], "2024-10-27T02:58:00+02:00")
    with pytest.raises(RecordingError, match="02:00:00 is before 2024-10-27 02:59:00"):
        read(autumn, utc)
    missing = stamps(tmp_path / "missing.csv", "2024-03-31 01:58:00", "2024-03-31 02:30:00")
    with pytest.raises(RecordingError, match=r"these cannot be times in Europe/Berlin: .*02:30:00"):
        read(missing, berlin)
    with pytest.raises(InputError, match=r"\[time\]: zone = 'Europe/Berln' is not known"):
        Mapping(TimeColumn(zone="Europe/Berln"))


def test_names_of_groups_above_the_headings_are_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "groups.csv"
    path.write_text(
        "Zeit;Temperatur;;Weg\n[s];Spindel [°C];Luft [°C];Weg Z [mm]\n"
        + "".join(f"{10 * k};{20 + k / 8:.3f};20,125;{k / 16:.4f}\n".replace(".", ",") for k in range(12)),
        encoding="utf-8",
    )
    with pytest.raises(RecordingError, match=r"no time column found among \[s\], Spindel"):
        read(path)
    recording = read(path, Mapping(TimeColumn(1, "s")))
    assert [c.name for c in recording.channels] == ["Spindel_C", "Luft_C", "Weg_Z_um"]
