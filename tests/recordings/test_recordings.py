"""Reading recordings: dialects, headings, units, time, cycles, and two measured files."""

import hashlib
import tempfile
from datetime import datetime, time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thermocomp.core.exceptions import RecordingError, UnitError
from thermocomp.recordings.checks.quality import check
from thermocomp.recordings.cycles import Cycle, make_single_cycle
from thermocomp.recordings.headings import understand
from thermocomp.recordings.readers.mapping import ColumnMap, CycleRule, Mapping, ReadOptions, TimeColumn, read_mapping
from thermocomp.recordings.readers.recordings import read

VORON = Path(__file__).parent / "voron.toml"
#: 9.9E37 is SCPI's infinity
NUMBERS = st.floats(allow_nan=True, allow_infinity=False).filter(lambda x: not abs(x) >= 9.9e37)
DELIMITERS = {",": ".", ";": ".,", "\t": ".,", "|": ".,", "   ": ".,"}


@settings(deadline=None)
@given(
    rows=st.lists(st.tuples(NUMBERS, NUMBERS), min_size=1, max_size=12),
    dialect=st.sampled_from([(d, decimal) for d, decimals in DELIMITERS.items() for decimal in decimals]),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "latin-1"]),
    newline=st.sampled_from(["\n", "\r\n"]),
    remarks=st.lists(st.sampled_from(["", "# ein Käfer", "  # 1;2,3\t4"]), max_size=4),
    missing=st.sampled_from(["nan", "NaN", "NAN", "NA", "null"]),
)
def test_any_dialect_gives_the_same_table(
    rows: list[tuple[float, float]],
    dialect: tuple[str, str],
    encoding: str,
    newline: str,
    remarks: list[str],
    missing: str,
) -> None:
    delimiter, decimal = dialect
    sensor = "Lager_vorn" if delimiter == "   " else "Lager vörn"

    def cell(value: float) -> str:
        return missing if np.isnan(value) else repr(value).replace(".", decimal)

    lines = [*remarks[:2], delimiter.join(["time_s", f"{sensor}_C", "drift_um"])]
    for k, (a, b) in enumerate(rows):
        lines += [*remarks[2:], delimiter.join([cell(0.5 * k), cell(a), cell(b)])]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "any.csv"
        path.write_bytes((newline.join(lines) + newline).encode(encoding))
        recording = read(path)

    np.testing.assert_array_equal(recording.table.to_numpy(), np.array(rows))
    np.testing.assert_array_equal(recording.time, 0.5 * np.arange(len(rows)))
    assert recording.channel(sensor).quantity == "temperature"


@pytest.mark.parametrize(
    ("heading", "name", "quantity", "scale"),
    [
        ("t5_C", "t5_C", "temperature", 1.0),
        ("t5_degC", "t5_C", "temperature", 1.0),
        ("t5_K", "t5_C", "temperature", 1.0),
        ("t5_F", "t5_C", "temperature", 5 / 9),
        ("T1 [degC]", "T1_C", "temperature", 1.0),
        ("Temp 1 (°C)", "Temp_1_C", "temperature", 1.0),
        ("ch1_um", "ch1_um", "displacement", 1.0),
        ("ch1_µm", "ch1_um", "displacement", 1.0),
        ("drift_mm", "drift_um", "displacement", 1e3),
        ("drift [in]", "drift_um", "displacement", 25400.0),
        ("x_drift_mm", "x_drift_um", "displacement", 1e3),
        ("x_mm", "x_mm", "position", 1.0),
        ("X1 [mm]", "X1_mm", "position", 1.0),
        ("pos_z_mm", "pos_z_mm", "position", 1.0),
        ("x_pos_um", "x_pos_mm", "position", 1e-3),
        ("x_um", "x_um", "displacement", 1.0),
        ("spindle_rpm", "spindle_rpm", "spindle_speed", 1.0),
        ("S [1/min]", "S_rpm", "spindle_speed", 1.0),
        ("spindle [Hz]", "spindle_rpm", "spindle_speed", 60.0),
        ("Main Speed (1/s)", "Main_Speed_rpm", "spindle_speed", 60.0),
        ("yaw_arcsec", "yaw_urad", "angle", 4.84813681109536),
        ("feed_mm_min", "feed_mm_min", "feed", 1.0),
    ],
)
def test_a_heading_is_understood_by_its_unit(heading: str, name: str, quantity: str, scale: float) -> None:
    meaning = understand(heading)

    assert meaning is not None
    assert (meaning.name, meaning.unit.quantity, meaning.unit.scale) == (name, quantity, scale)


@pytest.mark.parametrize(
    "heading", ["frame_t", "coolant_in", "mains [Hz]", "P (kW)", "front (left)", "n_1", "_C", "C", ""]
)
def test_a_heading_without_a_known_unit_is_not_guessed_at(heading: str) -> None:
    assert understand(heading) is None


def test_units_become_house_units_and_old_names_stay_valid(tmp_path: Path) -> None:
    path = _csv(tmp_path, "time_min,t1_K,drift_mm,z_mm,note\n0,293.15,0.001,5,cold\n1,294.15,0.002,6,warm\n")

    recording = read(path)

    assert [(c.name, c.unit) for c in recording.channels] == [("t1_C", "degC"), ("drift_um", "um"), ("z_mm", "mm")]
    assert recording.time.tolist() == [0.0, 60.0]
    np.testing.assert_allclose(recording.table, [[20, 1, 5], [21, 2, 6]], rtol=1e-12)
    assert recording.channel("drift_mm") == recording.channel("drift") == recording.channel("drift_um")
    assert recording.notes == ("not read, holding no numbers: note",)
    assert recording.name == "rec"
    assert recording.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.mark.parametrize(
    ("heading", "parts"),
    [
        ("t1 [furlong]", ["'furlong' is not a known unit", "known units are degC, um", 'role = "ignore"']),
        ("t1_furlong", ["'furlong' is not a known unit", 'column = "t1_furlong"']),
        ("t1_mym", ["'mym' is not a known unit", "the nearest are", "um"]),
        ("mains [Hz]", ["spindle_speed only with a mapping", 'role = "spindle_speed" and unit = "Hz"']),
        ("coolant_in", ["displacement only with a mapping", 'role = "displacement" and unit = "in"']),
        ("load", ["has no unit", "append it to the name"]),
    ],
)
def test_a_column_of_numbers_that_is_left_out_is_warned_of(tmp_path: Path, heading: str, parts: list[str]) -> None:
    rows = "".join(f"{15 * k};{20 + k};{k},5;a;\n" for k in range(12))
    path = _csv(tmp_path, f"time_s;t0_C;{heading};remark;empty\n{rows}")

    recording = read(path)
    found = [f for f in check(recording) if f.kind == "left out"]

    assert [(f.severity, f.text[:10]) for f in found] == [("warning", "left out: ")]
    for part in [repr(heading), "[columns.NAME]", *parts]:
        assert part in found[0].text
    assert recording.notes == (found[0].text, "not read, holding no numbers: remark, empty")
    ignoring = read(path, Mapping(columns={heading: ColumnMap(role="ignore")}))
    assert not [f for f in check(ignoring) if f.kind == "left out"]


def test_another_unit_of_the_same_quantity_in_the_mapping_is_obeyed_and_told(tmp_path: Path) -> None:
    path = _csv(tmp_path, "time_s,t [degF],z_um,r_mm,n_rpm\n0,20,1,2,3\n1,21,2,4,3\n")
    columns = {
        "t": ColumnMap("t [degF]", unit="degC"),
        "z": ColumnMap("z_um", unit="µm"),
        "pitch": ColumnMap("r_mm", unit="urad", scale=5.0),  # a lever turns one into the other
        "n": ColumnMap("n_rpm", role="spindle_speed"),
    }

    recording = read(path, Mapping(TimeColumn("time_s", "min"), columns))

    assert recording.notes == (
        "t: the heading 't [degF]' specifies degF, the mapping degC; the mapping applies",
        "time: the heading 'time_s' specifies s, the mapping min; the mapping applies",
    )
    assert recording.time.tolist() == [0.0, 60.0]
    assert recording.table["t"].tolist() == [20.0, 21.0]
    assert recording.table["pitch"].tolist() == [10.0, 20.0]


def test_a_name_without_unit_that_two_columns_share_is_no_alias(tmp_path: Path) -> None:
    recording = read(_csv(tmp_path, "time_s,z_um,z_mm\n0,1,2\n"))

    assert "z" not in recording.aliases


@pytest.mark.parametrize(
    ("text", "seconds", "start"),
    [
        ("timestamp,t1_C\n2024-05-01T10:00:00,1\n2024-05-01 10:00:01.5,2\n", 1.5, "2024-05-01T10:00:00"),
        ("time,t1_C\n2024-05-01T10:00:00Z,1\n2024-05-01T12:00:30+02:00,2\n", 30.0, "2024-05-01T10:00:00+00:00"),
        # the clock goes back: 02:59:30 summer time, then 02:00:30 winter time
        ("time,t1_C\n2024-10-27T02:59:30+02:00,1\n2024-10-27T02:00:30+01:00,2\n", 60.0, "2024-10-27T02:59:30+02:00"),
        ("datetime;t1_C\n01.05.2024 10:00:00;1,5\n01.05.2024 10:01:00;2\n", 60.0, "2024-05-01T10:00:00"),
        ("date,time,t1_C\n2024-05-01,23:59:59,1\n2024-05-02,00:00:01,2\n", 2.0, "2024-05-01T23:59:59"),
        ("time,t1_C\n10:00:00,1\n10:00:15,2\n", 15.0, ""),
        ("t_s,t1_C\n3,1\n18,2\n", 15.0, ""),
        ("Time (min),t1_C\n3,1\n18,2\n", 900.0, ""),
        ("run_h,t1_C\n0,1\n1,2\n", 3600.0, ""),
    ],
)
def test_the_time_is_found_and_counted_from_the_first_row(
    tmp_path: Path, text: str, seconds: float, start: str
) -> None:
    recording = read(_csv(tmp_path, text))

    assert recording.time.tolist() == [0.0, seconds]
    assert recording.start == start


def test_a_long_file_is_read_in_parts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("thermocomp.recordings.readers.textfile._CHUNK", 3)
    monkeypatch.setattr("thermocomp.recordings.readers.stamps._CHUNK", 2)
    rows = [f"2024-05-01T10:00:{k:02d},{k}.5,{k // 4}" for k in range(8)]

    recording = read(_csv(tmp_path, "\n".join(["time,t1_C,cycle", *rows])))

    assert recording.time.tolist() == list(range(8))
    assert recording.table["t1_C"].tolist() == [k + 0.5 for k in range(8)]
    assert recording.cycles == (Cycle("0", 0, 4), Cycle("1", 4, 8))
    rows[7] = rows[7].replace(".5", "?")
    with pytest.raises(RecordingError, match=r"line 9, column 't1_C': '7\?' is not a number"):
        read(_csv(tmp_path, "\n".join(["time,t1_C,cycle", *rows])))


def test_numbers_without_a_unit_of_time_are_asked_for(tmp_path: Path) -> None:
    path = _csv(tmp_path, "time,t1_C\n0,1\n1,2\n")
    with pytest.raises(
        RecordingError, match=r"'time' holds numbers from 0 to 1 and has no unit.*time \[s\].*unit = \"s\""
    ):
        read(path)
    assert read(path, Mapping(TimeColumn("time", unit="min"))).time.tolist() == [0.0, 60.0]


def test_a_delimiter_at_the_end_of_each_row_is_no_column(tmp_path: Path) -> None:
    for text in ("time_s;t1_C;\n0;20,5;\n1;21;\n", "time_s;t1_C\n0;20,5;\n1;21;\n;;\n"):
        assert read(_csv(tmp_path, text)).table["t1_C"].tolist() == [20.5, 21.0]


def test_a_decimal_comma_may_come_late(tmp_path: Path) -> None:
    rows = "".join(f"{k};{20 + k}\n" for k in range(300))

    assert read(_csv(tmp_path, f"time_s;t1_C\n{rows}300;20,25\n")).table["t1_C"].iloc[-1] == 20.25


def test_quoted_cells_may_hold_the_delimiter(tmp_path: Path) -> None:
    recording = read(_csv(tmp_path, '"time_s","bearing, front_C",note\n0,"20.5","a, b"\n1,21,\n'))

    assert recording.table["bearing,_front_C"].tolist() == [20.5, 21.0]


def test_a_mapping_scales_zeroes_and_masks_before_the_unit(tmp_path: Path) -> None:
    path = _csv(tmp_path, "time_s,count,bed,gap\n0,-180,-180,7\n1,100,25,inf\n2,104,-1,9\n")
    mapping = Mapping(
        columns={
            "z": ColumnMap("count", unit="mm", scale=0.0025, zero="first", missing=(-180.0,), place="spindle nose"),
            "bed": ColumnMap(role="temperature", missing=(-1.0,)),
            "gap_um": ColumnMap("gap", unit="um", zero=7.0),
        },
        read=ReadOptions(missing=(-180.0,)),
    )

    recording = read(path, mapping)

    np.testing.assert_allclose(recording.table["z"], [np.nan, 0.0, 10.0])
    np.testing.assert_array_equal(recording.table["bed"], [np.nan, 25.0, np.nan])
    np.testing.assert_array_equal(recording.table["gap_um"], [0.0, np.nan, 2.0])
    assert recording.channel("z").place == "spindle nose"
    assert recording.channel("count").name == "z"
    assert recording.notes == (
        "z: missing-value code -180 in 1 of 3 cells",
        "bed: missing-value code -180, -1 in 2 of 3 cells",
        "gap_um: infinite, taken as missing, in 1 of 3 cells",
    )


def test_what_a_mapping_does_not_speak_of_is_understood_by_its_heading(tmp_path: Path) -> None:
    path = _csv(tmp_path, "time_s,a,t1_C,t2_C\n0,1,2,3\n")
    some = {"a_um": ColumnMap("a", unit="um"), "ignored": ColumnMap("t2_C", role="ignore")}

    assert [c.name for c in read(path, Mapping(columns=some)).channels] == ["a_um", "t1_C"]
    only = Mapping(columns=some, read=ReadOptions(only_mapped=True))
    assert [c.name for c in read(path, only).channels] == ["a_um"]


def test_cycles_come_from_a_column_or_the_speed_or_are_one(tmp_path: Path) -> None:
    rows = [(600 * k, 1000 * (k % 4 < 2), "a" if k < 3 else "b") for k in range(8)]
    path = _csv(tmp_path, "time_s,s_rpm,cycle,part\n" + "".join(f"{t},{s},{c},{t < 600}\n" for t, s, c in rows))
    plain = _csv(tmp_path, "time_s,t1_C\n0,1\n1,2\n", "plain.csv")

    assert read(path).cycles == (Cycle("a", 0, 3), Cycle("b", 3, 8))
    assert read(path, Mapping(cycles=CycleRule("part"))).cycles == (Cycle("True", 0, 1), Cycle("False", 1, 8))
    by_role = Mapping(columns={"c": ColumnMap("part", role="cycle")})
    assert len(read(path, by_role).cycles[0]) == 1
    ignoring = Mapping(columns={"cycle": ColumnMap(role="ignore")})
    assert [c.start for c in read(path, ignoring).cycles] == [0, 4]
    long_stops = Mapping(columns={"cycle": ColumnMap(role="ignore")}, cycles=CycleRule(min_stop_s=2000.0))
    assert len(read(path, long_stops).cycles) == 1
    assert read(plain).cycles == make_single_cycle(2)


def test_a_workbook_reads_like_a_text_file(tmp_path: Path) -> None:
    path = tmp_path / "rec.xlsx"
    rows = [["# logger 7", None, None], ["date", "time", "t1_C"], [datetime(2024, 5, 1), time(10, 0), 20.5]]
    rows += [[None, None, None], [datetime(2024, 5, 1), time(10, 1), None]]
    with pd.ExcelWriter(path) as book:
        pd.DataFrame(rows).to_excel(book, sheet_name="test", header=False, index=False)
        pd.DataFrame([[1]]).to_excel(book, sheet_name="more")

    recording = read(path)

    assert recording.time.tolist() == [0.0, 60.0]
    np.testing.assert_array_equal(recording.table["t1_C"], [20.5, np.nan])
    assert recording.start == "2024-05-01T10:00:00"
    assert recording.notes == ("sheet 'test' of 'test', 'more' is read",)


def test_a_parquet_file_may_have_its_timestamps_as_index(tmp_path: Path) -> None:
    path = tmp_path / "rec.parquet"
    index = pd.date_range("2024-05-01T10:00", periods=3, freq="15s", name="timestamp", tz="Europe/Berlin")
    pd.DataFrame({"t1_C": [1, 2, 3]}, index=index).to_parquet(path)

    recording = read(path)

    assert recording.time.tolist() == [0.0, 15.0, 30.0]
    assert recording.start == "2024-05-01T10:00:00+02:00"
    assert recording.table["t1_C"].tolist() == [1.0, 2.0, 3.0]


def test_the_measured_spindle_test(shared_data: Path) -> None:
    recording = read(shared_data / "fl_thermal" / "recording.csv")

    assert len(recording) == 8892
    assert [c.start for c in recording.cycles] == [0, 1951, 3871, 5791, 7711]
    assert [c.name for c in recording.cycles] == [
        f"{k} ({n} 1/min)" for k, n in enumerate((1250, 2500, 3750, 5000, 3500), start=1)
    ]
    assert (len(recording.temperatures), len(recording.displacements)) == (16, 5)
    assert recording.table["t16_C"].iloc[0] == 26.4743629292737
    findings = check(recording)
    assert [(f.severity, f.channel, f.kind) for f in findings] == [("warning", "t16_C", "spike")]


def test_the_measured_printer_gives_the_published_regression(shared_data: Path) -> None:
    name = "frame_exp_quant_v3_2021-06-13_05-41-53.csv"

    recording = read(shared_data / "voron_frame" / name, read_mapping(VORON))

    z = recording.table["z"].to_numpy() / 1000  # [mm]
    inputs = np.column_stack([np.ones(len(recording)), recording.table["bed_t"], recording.table["frame_t"]])
    found, rest, *_ = np.linalg.lstsq(inputs, z)
    assert len(recording) == 1203
    np.testing.assert_allclose(found, [0.695263, 0.00200320, -0.0333537], rtol=2e-6)
    assert 1 - rest[0] / np.sum((z - z.mean()) ** 2) == pytest.approx(0.996351, abs=5e-7)
    assert recording.start == "2021-06-13T05:42:16"


def test_the_measured_absent_sensor_is_told_and_can_be_marked(shared_data: Path) -> None:
    path = shared_data / "voron_frame" / "frame_exp_quant_v3_2021-06-12_12-54-36-mvieleers_V2.1253.csv"
    time = TimeColumn("time", format="%Y/%m/%d-%H:%M:%S")
    sensors = {k: ColumnMap(role="temperature") for k in ("frame_t", "chamber_t", "bed_t")}

    trouble = [f for f in check(read(path, Mapping(time, sensors))) if f.severity == "trouble"]
    marked = read(path, Mapping(time, sensors, ReadOptions(missing=(-180.0,))))

    assert [(f.channel, f.kind) for f in trouble] == [("chamber_t", "missing-value code")]
    assert "-180" in trouble[0].text
    assert "no sensor is connected" in trouble[0].text
    assert marked.table["chamber_t"].isna().all()
    assert marked.table["frame_t"].notna().all()


def _csv(folder: Path, text: str, name: str = "rec.csv") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_a_role_without_a_unit_takes_the_unit_of_the_heading(tmp_path: Path) -> None:
    path = tmp_path / "units.csv"
    path.write_text("time_s,T2 [degF],z_mm,frame\n0,68,0.5,20\n1,77,0.6,21\n", encoding="utf-8")
    columns = {
        "t2": ColumnMap("T2 [degF]", role="temperature"),
        "z": ColumnMap("z_mm", role="displacement"),
        "frame": ColumnMap(role="temperature"),
    }
    table = read(path, Mapping(columns=columns)).table
    assert table["t2"].tolist() == pytest.approx([20.0, 25.0])
    assert table["z"].tolist() == pytest.approx([500.0, 600.0])
    assert table["frame"].tolist() == [20.0, 21.0]
    with pytest.raises(UnitError, match=r"a displacement in um, but the heading 'T2 \[degF\]' specifies degF"):
        read(path, Mapping(columns={"t2": ColumnMap("T2 [degF]", role="displacement")}))
