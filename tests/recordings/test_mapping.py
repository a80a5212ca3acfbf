"""The mapping TOML: what it says, and what it says when it is wrong."""

from pathlib import Path

import pytest

from thermocomp.core.exceptions import InputError, UnitError
from thermocomp.recordings.readers.mapping import ColumnMap, CycleRule, Mapping, ReadOptions, TimeColumn, read_mapping

VORON = Path(__file__).parent / "voron.toml"


def test_a_mapping_becomes_the_dataclasses() -> None:
    mapping = read_mapping(VORON)

    assert mapping.read.only_mapped
    assert mapping.time == TimeColumn(column="time", format="%Y/%m/%d-%H:%M:%S")
    assert mapping.columns["z"] == ColumnMap("mcu_pos_z", "mm", "displacement", 0.0025, "first", place="Z home switch")
    assert list(mapping.columns) == ["z", "bed_t", "frame_t", "chamber_t"]
    assert mapping.cycles == CycleRule()


def test_an_empty_mapping_is_all_defaults(tmp_path: Path) -> None:
    assert read_mapping(_toml(tmp_path, "")) == Mapping()


def test_numbers_may_be_written_without_a_point(tmp_path: Path) -> None:
    mapping = read_mapping(_toml(tmp_path, "[columns.t1_C]\nmissing = [-180]\nzero = 20\n[cycles]\nmin_run_s = 60\n"))

    assert mapping.columns["t1_C"].missing == (-180.0,)
    assert mapping.columns["t1_C"].zero == 20.0
    assert mapping.cycles.min_run_s == 60.0


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("[columns.z]\ncolum = 'a'\n", ["table [columns.z]", "'colum'", "did you mean 'column'"]),
        ("[column.z]\ncolumn = 'a'\n", ["top level", "'column'", "did you mean 'columns'"]),
        ("[read]\ndelimeter = ';'\n", ["table [read]", "'delimeter'", "did you mean 'delimiter'"]),
        ('[time]\nstart = "1.3.2024 08:00"\n', ["[time]: start = '1.3.2024 08:00'", '"2024-03-01T08:00:00"']),
        ("[time]\nstart = 2024-03-01T08:00:00\n", ["table [time]", "'start'", "valid string"]),
        ("[time]\nzzzzz = 1\n", ["table [time]", "'zzzzz'", "known keys: column, unit, format, start, date"]),
        ("[columns.z]\nscale = 'two'\n", ["table [columns.z]", "'scale' = 'two'", "valid number"]),
        ("[columns.z]\nzero = 'last'\n", ["table [columns.z]", "'zero' = 'last'", "first"]),
        ("[columns.z]\nrole = 'temprature'\n", ["table [columns.z]", "'role'", "'temperature'"]),
        ("[columns.z]\nscale = 0\n", ["[columns.z]", "scale = 0", "other than 0"]),
        ("[columns.z]\nscale = nan\n", ["table [columns.z]", "'scale'", "finite"]),
        ("[read]\ndecimal = ';'\n", ["table [read]", "'decimal'"]),
        ("[read]\ndelimiter = ';;'\n", ["[read]", "one character"]),
        ("[read]\nencoding = 'utf-17'\n", ["[read]", "'utf-17'", "utf-8"]),
        ("[read]\nencoding = 'utf-16-le'\n", ["[read]", "'utf-16-le'"]),
        ("[cycles]\nmin_stop_s = -1\n", ["[cycles]", "min_stop_s = -1"]),
        ("[columns.z\n", ["not valid TOML", "line 1"]),
        ("columns = 3\n", ["'columns' = 3"]),
    ],
)
def test_a_wrong_mapping_is_told_by_file_table_and_key(tmp_path: Path, text: str, parts: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        read_mapping(_toml(tmp_path, text))

    for part in ["map.toml", *parts]:
        assert part in str(caught.value)


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("[columns.z]\nunit = 'degcc'\n", ["[columns.z]", "'degcc'", "degC"]),
        ("[columns.z]\nunit = 'mm'\nrole = 'temperature'\n", ["[columns.z]", "not temperature", "degC"]),
        ("[time]\nunit = 'sekk'\n", ["[time]", "'sekk'", " s"]),
        ("[time]\nunit = 'mm'\n", ["[time]", "not time"]),
    ],
)
def test_a_wrong_unit_is_told_with_the_nearest(tmp_path: Path, text: str, parts: list[str]) -> None:
    with pytest.raises(UnitError) as caught:
        read_mapping(_toml(tmp_path, text))

    for part in ["map.toml", *parts]:
        assert part in str(caught.value)


def test_a_mapping_that_is_not_there_or_not_text_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.toml: no such mapping file"):
        read_mapping(tmp_path / "none.toml")
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match=r"binary\.toml: the file cannot be read as a mapping"):
        read_mapping(binary)


def test_the_conversion_comes_from_unit_and_role() -> None:
    def symbol(column: ColumnMap) -> tuple[str, str] | None:
        meant = column.conversion
        return None if meant is None else (meant.symbol, meant.quantity)

    assert symbol(ColumnMap(unit="mm")) == ("mm", "displacement")
    assert symbol(ColumnMap(unit="mm", role="position")) == ("mm", "position")
    assert symbol(ColumnMap(role="temperature")) == ("degC", "temperature")
    assert symbol(ColumnMap()) is None
    assert symbol(ColumnMap(role="ignore")) is None


def test_one_mapping_over_another_keeps_what_only_the_other_says() -> None:
    below = Mapping(TimeColumn("t"), {"a": ColumnMap("A"), "b": ColumnMap("B")})
    above = Mapping(columns={"b": ColumnMap("C")}, read=ReadOptions(missing=(-1.0,)))

    both = above.over(below)

    assert both.time == TimeColumn("t")
    assert {k: c.column for k, c in both.columns.items()} == {"a": "A", "b": "C"}
    assert both.read.missing == (-1.0,)


def test_one_mapping_over_another_takes_a_column_under_another_name() -> None:
    both = Mapping(columns={"mine": ColumnMap("A")}).over(Mapping(columns={"a": ColumnMap("A"), "A": ColumnMap()}))

    assert both.columns == {"mine": ColumnMap("A")}


def _toml(folder: Path, text: str) -> Path:
    path = folder / "map.toml"
    path.write_text(text, encoding="utf-8")
    return path
