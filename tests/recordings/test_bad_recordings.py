"""Files that cannot be used, and the one sentence each of them earns."""

import os
import tempfile
from contextlib import suppress
from pathlib import Path

import pandas as pd
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from thermocomp.core.exceptions import InputError, RecordingError, UnitError
from thermocomp.recordings.readers.mapping import ColumnMap, CycleRule, Mapping, ReadOptions, TimeColumn
from thermocomp.recordings.readers.recordings import read

GOOD = "time_s,t1_C,drift_um\n0,20.5,0\n15,20.6,1\n"


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("", ["the file is empty"]),
        ('time_s,t1_C,note\n0,20,"a\n1,21,b"\n', ["2 lines give 1 rows", "quotation mark"]),
        ("time_s,t1_C\n" + "0,20\n" * 20_000 + "1,2\r1\n", ["line 20002", "carriage return"]),
        ("\n \n# only a remark\n", ["the file is empty"]),
        ("time_s,t1_C\n", ["no rows below", "empty"]),
        ("time_s\n0\n1\n", ["only one column, 'time_s'", "delimiter"]),
        ("time_s:t1_C\n0:20\n", ["only one column", "[read] delimiter"]),
        ("0,20\n15,21\n", ["first row holds numbers", "time_s,t1_C"]),
        ("time_s,t1_C\n0,20\n15,warm\n", ["line 3", "'t1_C'", "'warm' is not a number"]),
        ("# remark\n\ntime_s,t1_C\n0,20\n# remark\n\n15,warm\n", ["line 7", "'t1_C'", "'warm'"]),
        ("time_s;t1_C\n0;20,5\n15;2O,5\n", ["line 3", "'t1_C'", "'2O,5'"]),
        ("time_s;t1_C\n0;20,5\n5;20,4\n15;20.5\n", ["line 4", "'t1_C'", "'20.5'"]),
        ("time_s;t1_C\n0;20\n15;warm\n", ["line 3", "'t1_C'", "'warm'"]),
        ("time_s,t1_C\n0,20\nlater,21\n", ["line 3", "'time_s'", "'later'"]),
        ("time_s,t1_C\n0,20\n15,21\n15,22\n15,22\n", ["line 4", "15.0 occurs twice", "line 3", "2 rows"]),
        ("time_s,t1_C\n0,20\n\n15,21\n14,22\n", ["line 5", "14.0 is before 15.0", "line 4", "split the file"]),
        ("time_s,t1_C\n0,20\n,21\n", ["line 3", "'time_s'", "time is missing"]),
        ("time,t1_C\n2024-01-01T00:00:00,20\n2023-12-31T00:00:00,21\n", ["line 3", "2023-12-31", "is before"]),
        ("time,t1_C\n2024-01-01T00:00:00,20\nnoon,21\n", ["line 3", "'noon'", "not a timestamp like '2024"]),
        ("time,t1_C\n2024-01-01T00:00:00,20\n,21\n", ["line 3", "time is missing"]),
        ("time,t1_C\n06/07/2024 10:00,20\n", ["line 2", "'06/07/2024 10:00'", "format ="]),
        ("t1_C,drift_um\n20,0\n21,1\n", ["no time column", "t1_C, drift_um", "time_s", "[time]"]),
        ("time_s,t1,t2\n0,20,21\n", ["none of the columns time_s, t1, t2", "t1_C", "[columns.NAME]"]),
        ("time_s,t1_C,t1_C\n0,20,21\n", ["columns 2 and 3", "both named 't1_C'"]),
        ("time_s,t1_C,t1_K\n0,20,293\n", ["'t1_C' and 't1_K'", "both become channel 't1_C'"]),
        ("time_s,t1_C,t2_C\n0,20,21\n15,20\n30,20,21\n", ["line 3 has 2 cells", "heading has 3", "'15,20'"]),
        ("time_s,t1_C,t2_C\n0,20,21\n15,20,21,22\n", ["line 3 has 4 cells", "decimal commas"]),
        ("time_s,t1_C,t2_C\n0,20,21\n15,20", ["line 3 has 2 cells", "last line", "cut off"]),
        ("time_s,t1_C\n0,20,5\n15,21,5\n", ["line 2 has 3 cells", "decimal commas", "';'"]),
        ("time_s,t1_C,cycle\n0,20,a\n15,21,b\n30,22,a\n", ["cycle 'a' appears again"]),
        ("time_s,t1_C,cycle\n0,20,a\n15,21,\n", ["line 3", "'cycle'", "label"]),
    ],
)
def test_bad_text_is_told_with_file_line_and_column(tmp_path: Path, text: str, parts: list[str]) -> None:
    path = tmp_path / "bad.csv"
    path.write_text(text, encoding="utf-8")

    with pytest.raises(RecordingError) as caught:
        read(path)

    for part in ["bad.csv", *parts]:
        assert part in str(caught.value)


@pytest.mark.parametrize(
    ("heading", "parts"),
    [
        ("t1 [degX]", ["'t1 [degX]'", "column 2", "'degX'", "did you mean deg", 'role = "ignore"']),
        ("drift (micrrons)", ["'micrrons'", "did you mean um"]),
    ],
)
def test_a_mistyped_unit_is_told_with_the_nearest(tmp_path: Path, heading: str, parts: list[str]) -> None:
    path = _csv(tmp_path, f"time_s,{heading},t2_C\n0,20,21\n")

    with pytest.raises(UnitError) as caught:
        read(path)

    for part in ["bad.csv", *parts]:
        assert part in str(caught.value)
    ignoring = Mapping(columns={heading: ColumnMap(role="ignore")})
    assert [c.name for c in read(path, ignoring).channels] == ["t2_C"]


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"PK\x03\x04\x14\x00", "a workbook or zip file"),
        (b"PAR1\x15\x04", "a Parquet file"),
        (b"\x1f\x8b\x08", "a gzip file"),
        (b"\x89PNG\r\n\x1a\n\x00\x00\x00", "not text but binary"),
        (GOOD.encode("utf-16")[:64] + b"\x00\xd8,\x00", "written in UTF-16, but damaged"),
    ],
)
def test_a_binary_file_named_csv_is_told_as_what_it_is(tmp_path: Path, content: bytes, says: str) -> None:
    path = tmp_path / "bad.csv"
    path.write_bytes(content)

    with pytest.raises(RecordingError, match=rf"bad\.csv: the file is .*{says}"):
        read(path)


@pytest.mark.parametrize("ending", ["xlsx", "parquet"])
def test_a_damaged_workbook_or_parquet_file_is_told(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"bad.{ending}"
    path.write_text(GOOD)

    with pytest.raises(RecordingError, match=rf"bad\.{ending}: this is not a"):
        read(path)


def test_a_missing_file_is_told_with_the_nearest_name(tmp_path: Path) -> None:
    _csv(tmp_path, GOOD)

    with pytest.raises(RecordingError, match=r"bat\.csv: no such file; did you mean bad\.csv\?"):
        read(tmp_path / "bat.csv")
    with pytest.raises(RecordingError, match=r"bad\.csv: no such file$"):
        read(tmp_path / "nowhere" / "bad.csv")


def test_a_folder_is_no_file(tmp_path: Path) -> None:
    (tmp_path / "folder.csv").mkdir()

    with pytest.raises(RecordingError, match=r"folder\.csv: the file cannot be read: Is a directory"):
        read(tmp_path / "folder.csv")


def test_a_pipe_is_no_file(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.csv")
    with pytest.raises(RecordingError, match=r"pipe\.csv: this is a pipe or a device, not a file"):
        read(tmp_path / "pipe.csv")


def test_a_line_has_bounds(tmp_path: Path) -> None:
    path = _csv(tmp_path, "time_s,t1_C\n0,20\n10," + "1" * 5_000_000 + "\n")
    with pytest.raises(RecordingError, match=r"line 3: over 4,000,000 bytes .*\[limits\] line_bytes = 8000002"):
        read(path)
    for cell in ("1" * 200_000, '"' + "1" * 200_000 + '"'):
        with pytest.raises(RecordingError, match=r"line 3: over 32,767 .*\[limits\] cell_characters = "):
            read(_csv(tmp_path, f"time_s,t1_C\n0,20\n10,{cell}x\n"))
    with pytest.raises(InputError):
        read(_csv(tmp_path, f'time_s,"{"a" * 200_000}"\n0,20\n'))


@pytest.mark.parametrize("name", ["rec.xls", "rec", "rec.csv.gz"])
def test_another_ending_is_told_with_those_that_are_read(tmp_path: Path, name: str) -> None:
    with pytest.raises(RecordingError, match=r"cannot be read; save it as one of \.csv, .*\.xlsx, \.ods, \.parquet"):
        read(tmp_path / name)


@pytest.mark.parametrize(
    ("mapping", "parts"),
    [
        (Mapping(TimeColumn("tme_s")), ["[time]", "no column 'tme_s'", "nearest are time_s"]),
        (Mapping(columns={"z": ColumnMap("drift")}), ["[columns.z]", "no column 'drift'", "drift_um"]),
        (Mapping(cycles=CycleRule("zzz")), ["[cycles]", "no column 'zzz'", "there are time_s, t1_C, drift_um"]),
        (Mapping(columns={"t1_C": ColumnMap("drift_um")}), ["'drift_um' and 't1_C'", "both become channel 't1_C'"]),
        (
            Mapping(columns={"a": ColumnMap("t1_C"), "b": ColumnMap("t1_C", role="cycle")}),
            ["[columns.a] and [columns.b]", "the column 't1_C'", "delete one"],
        ),
        (Mapping(read=ReadOptions(only_mapped=True)), ["none of the columns"]),
        (Mapping(read=ReadOptions(delimiter=";")), ["only one column"]),
        (Mapping(TimeColumn("time_s", unit="timestamp")), ["line 2", "'time_s'", "not an ISO timestamp"]),
        (Mapping(TimeColumn("time_s", format="%H:%M")), ["line 2", "'time_s'", "does not fit the format '%H:%M'"]),
    ],
)
def test_a_mapping_that_does_not_fit_the_file_is_told(tmp_path: Path, mapping: Mapping, parts: list[str]) -> None:
    path = _csv(tmp_path, GOOD)

    with pytest.raises(RecordingError) as caught:
        read(path, mapping)

    for part in ["bad.csv", *parts]:
        assert part in str(caught.value)


@pytest.mark.parametrize(
    ("mapping", "parts"),
    [
        (
            Mapping(columns={"fake_C": ColumnMap("drift_um", "degC", "temperature")}),
            ["[columns.fake_C]", "a temperature in degC", "'drift_um' specifies um, a unit of displacement", "correct"],
        ),
        (Mapping(columns={"fake": ColumnMap("drift_um", unit="rpm", scale=2.0)}), ["[columns.fake]", "in 1/min"]),
        (Mapping(columns={"fake": ColumnMap("drift_um", role="dimensionless")}), ["[columns.fake]", "specifies um"]),
        (Mapping(columns={"a": ColumnMap("drift_um", unit="urad")}), ["[columns.a]", "in urad", "specifies um"]),
        (Mapping(columns={"z": ColumnMap("t1_C", unit="um")}), ["a displacement in um", "'t1_C' specifies degC"]),
        (Mapping(columns={"z": ColumnMap("time_s", unit="mm")}), ["a displacement in mm", "'time_s' specifies s"]),
        (Mapping(TimeColumn("t1_C", unit="min")), ["[time]", "'t1_C' specifies degC", "not min"]),
    ],
)
def test_a_mapping_that_contradicts_the_unit_of_the_heading_is_refused(
    tmp_path: Path, mapping: Mapping, parts: list[str]
) -> None:
    path = _csv(tmp_path, GOOD)

    with pytest.raises(UnitError) as caught:
        read(path, mapping)

    for part in ["bad.csv", *parts]:
        assert part in str(caught.value)


@pytest.mark.parametrize("ending", ["", "Z"])
@pytest.mark.parametrize(("interval", "back"), [(15, 3585), (600, 3000), (15, 1800)])
def test_a_clock_that_was_set_back_is_hinted_at(tmp_path: Path, ending: str, interval: int, back: int) -> None:
    before = [pd.Timestamp("2024-10-27T02:30") + pd.Timedelta(seconds=interval * k) for k in range(3)]
    times = [*before, *(t - pd.Timedelta(seconds=back - 2 * interval) for t in before)]
    path = _csv(tmp_path, "time,t1_C\n" + "".join(f"{t.isoformat()}{ending},20\n" for t in times))

    with pytest.raises(RecordingError, match="line 5") as caught:
        read(path)

    assert ("daylight saving): use UTC or timestamps with an offset" in str(caught.value)) == (
        back + interval == 3600 and not ending
    )


def test_a_mapped_column_needs_a_unit_or_a_role(tmp_path: Path) -> None:
    path = _csv(tmp_path, "time_s,count\n0,1\n")

    with pytest.raises(RecordingError, match=r"\[columns\.z\]: specify a unit or a role; 'count' has none"):
        read(path, Mapping(columns={"z": ColumnMap("count")}))


def test_a_wrong_encoding_is_told(tmp_path: Path) -> None:
    path = tmp_path / "bad.csv"
    path.write_bytes("time_s,t1 (°C)\n0,20\n".encode("latin-1"))

    with pytest.raises(RecordingError, match=r"bad\.csv: the heading line is not written in utf-8"):
        read(path, Mapping(read=ReadOptions(encoding="utf-8")))
    path.write_bytes("time_s,t1_C,cycle\n0,20,früh\n".encode("latin-1"))
    with pytest.raises(RecordingError, match=r"bad\.csv: the file is not written in utf-8"):
        read(path, Mapping(read=ReadOptions(encoding="utf-8")))


def test_a_damaged_description_of_its_own_is_noted(tmp_path: Path) -> None:
    recording = read(_csv(tmp_path, '# thermocomp: {"columns":\n' + GOOD))

    assert [c.name for c in recording.channels] == ["t1_C", "drift_um"]
    assert "thermocomp's own description of the columns is damaged" in recording.notes[0]


@pytest.mark.parametrize(
    ("rows", "parts"),
    [
        ([], ["is empty"]),
        ([["time_s", "t1_C"]], ["no rows below"]),
        ([["time_s", "t1_C"], [0, 20], [15, "warm"]], ["row 3", "'t1_C'", "'warm'"]),
        ([["# remark", None], ["time_s", "t1_C"], [0, 20], [0, 21]], ["row 4", "0.0 occurs twice", "row 3"]),
    ],
)
def test_a_bad_sheet_is_told_with_its_row(tmp_path: Path, rows: list[list[object]], parts: list[str]) -> None:
    path = tmp_path / "bad.xlsx"
    pd.DataFrame(rows).to_excel(path, header=False, index=False)

    with pytest.raises(RecordingError) as caught:
        read(path)

    for part in ["bad.xlsx", *parts]:
        assert part in str(caught.value)


def test_text_in_a_parquet_column_is_told_with_its_row(tmp_path: Path) -> None:
    path = tmp_path / "bad.parquet"
    pd.DataFrame({"time_s": [0.0, 15.0], "t1_C": ["20", "warm"]}).to_parquet(path)

    with pytest.raises(RecordingError, match=r"bad\.parquet: row 2, column 't1_C': 'warm' is not a number"):
        read(path)


@settings(deadline=None, max_examples=200)
@given(
    content=st.one_of(
        st.binary(max_size=60),
        st.text(alphabet='01.,;\t |"#\n\r-eE:é', max_size=60).map(str.encode),
        st.text(alphabet='01.,;"#\n\r-e:', max_size=60).map(lambda t: f"time_s,t1_C,cycle\n{t}".encode()),
        st.text(alphabet='01.,;"#\n\r-eTZ:+ ', max_size=60).map(lambda t: f"time;t1_C\n{t}".encode()),
    )
)
@example(content=b'"\t\x01\r\x01\t0')
def test_whatever_stands_in_a_file_it_is_read_or_refused(content: bytes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "any.csv"
        path.write_bytes(content)
        with suppress(InputError):
            assert len(read(path)) >= 1


def _csv(folder: Path, text: str) -> Path:
    path = folder / "bad.csv"
    path.write_text(text, encoding="utf-8")
    return path
