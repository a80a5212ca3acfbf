"""What is read at most: every limit is said with its name, and a mapping raises it."""

import os
import socket
from dataclasses import fields
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hostile_files import HOSTILE

from thermocomp.core.exceptions import InputError, RecordingError
from thermocomp.recordings.readers.limits import FileLimits
from thermocomp.recordings.readers.mapping import ColumnMap, Mapping, ReadOptions, read_mapping
from thermocomp.recordings.readers.parquet import open_parquet
from thermocomp.recordings.readers.recordings import read

TEXT = "time_s,t1_C,drift_um,cycle\n# remark\n0,20.5,0,a\n\n15,20.6,1,b\n30,20.6,1,c\n"


@pytest.mark.parametrize(
    ("limit", "most", "place"),
    [
        ("file_bytes", 60, ""),
        ("line_bytes", 20, "line 1: "),
        ("cell_characters", 3, "line 3: "),
        ("heading_characters", 7, ""),
        ("columns", 3, ""),
        ("rows", 2, ""),
        ("cells", 11, ""),
        ("skipped_lines", 1, ""),
        ("cycles", 2, ""),
    ],
)
def test_a_text_over_a_limit_says_which_and_how_to_raise_it(tmp_path: Path, limit: str, most: int, place: str) -> None:
    path = tmp_path / "rec.csv"
    path.write_text(TEXT)

    with pytest.raises(
        RecordingError, match=rf"rec\.csv: {place}over {most:,} .*mapping file: \[limits\] {limit} = \d+$"
    ):
        read(path, Mapping(limits=FileLimits(**{limit: most})))

    toml = tmp_path / "m.toml"
    toml.write_text(f"[limits]\n{limit} = 1000")
    assert len(read(path, read_mapping(toml))) == 3


@pytest.mark.parametrize(
    ("limit", "most", "place"),
    [
        ("sheets", 1, ""),
        ("sheet_rows", 3, "sheet 'a': "),
        ("columns", 1, "sheet 'a', row 1: "),
        ("cells", 7, "sheet 'a': "),
        ("row_elements", 2, ".xml: "),
        ("line_bytes", 100, ".xml: "),
    ],
)
def test_a_workbook_over_a_limit_says_which(tmp_path: Path, limit: str, most: int, place: str) -> None:
    path = tmp_path / "rec.xlsx"
    with pd.ExcelWriter(path) as book:
        pd.DataFrame({"time_s": [0, 1, 2], "t1_C": [20, 21, 22]}).to_excel(book, sheet_name="a", index=False)
        pd.DataFrame().to_excel(book, sheet_name="b")

    with pytest.raises(RecordingError, match=rf"rec\.xlsx: .*over {most:,} .*\[limits\] {limit} = \d+$") as caught:
        read(path, Mapping(limits=FileLimits(**{limit: most})))
    assert place in str(caught.value)


@pytest.mark.parametrize("name", ["ods wide", "parquet rows"])
def test_what_grows_too_much_may_grow_by_a_mapping(tmp_path: Path, name: str) -> None:
    ending, make = HOSTILE[name]
    path = tmp_path / f"rec.{ending}"
    path.write_bytes(make())

    with pytest.raises(RecordingError, match=rf"rec\.{ending}: over 100 times its size .*\[limits\] growth = \d+"):
        read(path)
    with pytest.raises(RecordingError, match=r"over 50,000 cells"):  # the next limit
        read(path, Mapping(limits=FileLimits(growth=10**9, cells=50_000)))


def test_a_parquet_file_is_refused_by_what_it_says_of_itself(tmp_path: Path) -> None:
    path = tmp_path / "rec.parquet"
    path.write_bytes(HOSTILE["parquet rows"][1]())

    with pytest.raises(RecordingError, match=r"over 100 times its size"):
        open_parquet(path, ReadOptions(), FileLimits())  # nothing of it is loaded


def test_a_file_does_not_raise_its_own_limits(tmp_path: Path) -> None:
    path = tmp_path / "rec.csv"
    path.write_text('# thermocomp: {"limits":{"cycles":3,"rows":9},"columns":{"t1_C":{"place":"front"}}}\n' + TEXT)

    assert read(path).channels[0].place == "front"
    with pytest.raises(RecordingError, match="over 2 thermal cycles"):
        read(path, Mapping(limits=FileLimits(cycles=2)))


def test_a_limit_is_a_whole_number_that_is_known(tmp_path: Path) -> None:
    assert all(f.metadata["counts"] for f in fields(FileLimits))
    for text, message in (
        ("rows = 0", r"\[limits\]: rows = 0: must be at least 1"),
        ("row = 5", "unknown key 'row'; did you mean 'rows'"),
        ("rows = 1.5", r"table \[limits\]: key 'rows' = 1.5"),
    ):
        (tmp_path / "m.toml").write_text(f"[limits]\n{text}")
        with pytest.raises(InputError, match=message):
            read_mapping(tmp_path / "m.toml")


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.csv")
    (tmp_path / "zeros.csv").symlink_to("/dev/zero")
    (tmp_path / "zeros.parquet").symlink_to("/dev/zero")
    (tmp_path / "round.csv").symlink_to("round.csv")
    (tmp_path / "folder.xlsx").mkdir()
    with socket.socket(socket.AF_UNIX) as s:
        s.bind(str(tmp_path / "socket.csv"))
        for name, message in (
            ("pipe.csv", "is a pipe or a device"),
            ("zeros.csv", "is a pipe or a device"),
            ("zeros.parquet", "is a pipe or a device"),
            ("socket.csv", "is a pipe or a device"),
            ("round.csv", "cannot be read"),
            ("folder.xlsx", "cannot be read: Is a directory"),
            (f"{'x' * 300}.csv", "cannot be read"),
            ("a\0b.csv", "cannot be read"),
        ):
            with pytest.raises(RecordingError, match=message):
                read(tmp_path / name)


def test_many_labels_and_columns_are_read(tmp_path: Path) -> None:
    path = tmp_path / "rec.csv"
    path.write_text("time_s,t1_C,cycle\n" + "".join(f"{k},20,c{k}\n" for k in range(200_000)))
    assert len(read(path, Mapping(limits=FileLimits(cycles=200_000))).cycles) == 200_000

    wide = pd.DataFrame({"time_s": [0.0, 1.0], "t_C": 20.0, **{f"sensor {k} of no unit": 1.0 for k in range(9_000)}})
    for ending in ("csv", "xlsx", "parquet"):
        getattr(wide, {"csv": "to_csv", "xlsx": "to_excel"}.get(ending, "to_parquet"))(tmp_path / f"wide.{ending}")
        notes = read(tmp_path / f"wide.{ending}").notes
        assert sum(map(len, notes)) < 50_000
        assert notes[-1] == "left out or replaced: 8,900 more columns"


def test_no_value_is_infinite(tmp_path: Path) -> None:
    path = tmp_path / "rec.csv"
    path.write_text("time_s,t1_C,x_in,t2_C\n0,3,1.7e308,1e999\n1,0.5,1,-1e999\n")

    recording = read(path, Mapping(columns={"t1_C": ColumnMap(scale=1e308)}))

    np.testing.assert_array_equal(recording.table["t1_C"], [np.nan, 5e307])
    assert not np.isinf(recording.table.to_numpy()).any()
    assert "t1_C: infinite by its scale or unit, taken as missing, in 1 cells" in recording.notes
    assert "t2_C: infinite, taken as missing, in 2 of 2 cells" in recording.notes


def test_a_whole_number_beyond_the_floats_is_missing(tmp_path: Path) -> None:
    ending, make = HOSTILE["digits alone"]
    path = tmp_path / f"rec.{ending}"
    path.write_bytes(make())

    recording = read(path)

    np.testing.assert_array_equal(recording.table["t1_C"], [np.nan, 1.0])
    assert "t1_C: infinite, taken as missing, in 1 of 2 cells" in recording.notes


def test_times_that_no_clock_has_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "rec.csv"
    for text, message in (
        ('# thermocomp: {"time":{"column":"t","format":"%"}}\nt,t1_C\n1,20\n', r"column 't': .*\[time\] format"),
        ("time_s,t1_C\n-1.7e308,20\n1.7e308,20\n", "'time_s': the times are too far apart"),
        ("time,t1_C\n2024-01-01T00:00:00,20\n999999-01-01T00:00:00,20\n", "'999999-01-01T00:00:00' is not a timestamp"),
    ):
        path.write_text(text)
        with pytest.raises(RecordingError, match=message):
            read(path)
