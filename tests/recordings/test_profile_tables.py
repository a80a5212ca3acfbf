"""Profiles from wide and long tables, and what is wrong with them, told by file, line and column."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from profilemachine import profiles

from thermocomp.core.exceptions import InputError, RecordingError, ThermocompError, UnitError
from thermocomp.recordings.profiles import ProfileOptions, Profiles
from thermocomp.recordings.readers.mapping import ColumnMap, Mapping
from thermocomp.recordings.readers.profiles import from_recording, read, read_places


def made() -> Profiles:
    """Return a few states with figures that a text file holds exactly."""
    found = profiles(n_cycles=1)
    table = found.states.table.round(2)
    return replace(found, values=found.values.round(3), states=replace(found.states, table=table))


def wide(found: Profiles) -> pd.DataFrame:
    table = found.states.table.copy()
    table.insert(0, "time_s", found.states.time)
    return table.assign(**{f"y_laser_{p:g}_um": v for p, v in zip(found.position, found.values.T, strict=True)})


def long(found: Profiles) -> pd.DataFrame:
    table = wide(found).drop(columns=[c for c in wide(found) if str(c).startswith("y_laser")])
    rows = table.loc[table.index.repeat(len(found.points))].reset_index(drop=True)
    return rows.assign(y_mm=np.tile(found.position, len(found)), error_um=found.values.ravel())


def same(a: Profiles, b: Profiles) -> None:
    assert (a.target, a.unit, a.axis) == (b.target, b.unit, b.axis)
    np.testing.assert_array_equal(a.points, b.points)
    np.testing.assert_array_equal(a.values, b.values)
    np.testing.assert_array_equal(a.states.time, b.states.time)
    pd.testing.assert_frame_equal(a.states.table, b.states.table)
    assert a.states.channels == b.states.channels


def test_wide_and_long_tables_of_the_same_test_are_the_same(tmp_path: Path) -> None:
    found = made()
    values = found.values.copy()
    values[3, 0] = values[3, 5] = values[7, 11] = np.nan
    found = replace(found, values=values)
    wide(found).to_csv(tmp_path / "wide.csv", index=False)
    long(found).to_csv(tmp_path / "long.csv", index=False)
    long(found).dropna().to_csv(tmp_path / "gaps.csv", index=False)
    for name in ("wide", "long", "gaps"):
        same(read(tmp_path / f"{name}.csv", "EYY"), found)
    assert read(tmp_path / "wide.csv", "EYY").fingerprint == read(tmp_path / "long.csv", "EYY").fingerprint


def test_units_of_columns_may_differ_if_each_tells_its_own(tmp_path: Path) -> None:
    found = made()
    table = wide(found).rename(columns={"y_laser_50_um": "y_laser_50_mm"})
    table["y_laser_50_mm"] /= 1000
    table.to_csv(tmp_path / "mixed.csv", index=False)
    np.testing.assert_allclose(read(tmp_path / "mixed.csv", "EYY").values, found.values, rtol=1e-12)
    in_metres = long(found).rename(columns={"y_mm": "position [m]", "error_um": "error_nm"})
    in_metres["position [m]"] /= 1000
    in_metres["error_nm"] *= 1000
    in_metres.to_csv(tmp_path / "metres.csv", index=False)
    np.testing.assert_allclose(read(tmp_path / "metres.csv", "EYY").values, found.values, rtol=1e-12)


def test_states_by_a_column_by_time_or_by_positions_that_come_again(tmp_path: Path) -> None:
    found = made()
    n = len(found.points)
    table = long(found)
    number = np.repeat(np.arange(len(found)), n)
    table["time_s"] += 10.0 * (np.arange(len(table)) % n)  # each point has its own time
    table.to_csv(tmp_path / "restart.csv", index=False)
    again = read(tmp_path / "restart.csv", "EYY")
    np.testing.assert_array_equal(again.values, found.values)
    np.testing.assert_array_equal(again.states.time, found.states.time)
    labelled = table.assign(state=[f"s{k}" for k in number])
    labelled.to_csv(tmp_path / "labelled.csv", index=False)
    same(read(tmp_path / "labelled.csv", "EYY"), again)
    labelled.rename(columns={"state": "run no"}).to_csv(tmp_path / "named.csv", index=False)
    same(read(tmp_path / "named.csv", ProfileOptions(target="EYY", state="run no"), layout="long"), again)
    with pytest.raises(InputError, match="there is no column 'other' for the states"):
        read(tmp_path / "named.csv", ProfileOptions(target="EYY", state="other"), layout="long")
    back = pd.concat([labelled, labelled.iloc[:n].assign(time_s=1e6)])
    back.to_csv(tmp_path / "back.csv", index=False)
    with pytest.raises(RecordingError, match=r"back\.csv: line \d+: state 's0' appears again after another state"):
        read(tmp_path / "back.csv", "EYY")


def test_positions_that_were_measured_and_not_commanded(tmp_path: Path) -> None:
    found = made()
    table = long(found).assign(state=np.repeat(range(len(found)), 12))
    table["y_mm"] += 1e-3 * np.random.default_rng(0).normal(size=len(table))
    table.to_csv(tmp_path / "long.csv", index=False)
    with pytest.raises(
        RecordingError, match="288 different positions in all, but at most 12 in one thermal state: give"
    ):
        read(tmp_path / "long.csv", "EYY")


def test_other_coordinates(tmp_path: Path) -> None:
    found = made()
    table = pd.concat([long(found).assign(x_mm=x, state=lambda t: t["time_s"]) for x in (0.0, 300.0)])
    table = table.sort_values(["time_s", "x_mm", "y_mm"])
    table.loc[table["x_mm"] == 300.0, "error_um"] += 1.0
    table.to_csv(tmp_path / "two.csv", index=False)
    again = read(tmp_path / "two.csv", "EYY")
    assert again.varying == "YX"
    np.testing.assert_array_equal(again.points[:, 0], np.repeat([0.0, 300.0], 12))
    np.testing.assert_allclose(again.values, np.concatenate([found.values, found.values + 1.0], axis=1))


def test_cycles_are_those_of_the_states(tmp_path: Path) -> None:
    found = made()
    labels = ["first"] * 10 + ["second"] * (len(found) - 10)
    wide(found).assign(cycle=labels).to_csv(tmp_path / "wide.csv", index=False)
    long(found).assign(cycle=np.repeat(labels, 12)).to_csv(tmp_path / "long.csv", index=False)
    for name in ("wide", "long"):
        cycles = read(tmp_path / f"{name}.csv", "EYY").states.cycles
        assert [(c.name, c.start, c.stop) for c in cycles] == [("first", 0, 10), ("second", 10, 24)]


def test_columns_by_pattern_by_places_and_by_name(tmp_path: Path) -> None:
    found = made()
    table = wide(found)
    table = table.assign(**{c.replace("y_laser", "z_laser"): 0.0 for c in map(str, table) if c.startswith("y_laser")})
    table.to_csv(tmp_path / "both.csv", index=False)
    with pytest.raises(RecordingError, match=r"profiles y_laser_\*, z_laser_\*; state which .*'y_laser_"):
        read(tmp_path / "both.csv", "EYY")
    for pattern in ("y_laser_*", "y_laser_*_um"):
        same(read(tmp_path / "both.csv", ProfileOptions(target="EYY", columns=pattern)), _with_zeros(found))
    with pytest.raises(
        RecordingError, match=r"no column is called 'x_\*'; state which .* The columns are y_laser_0_um"
    ):
        read(tmp_path / "both.csv", ProfileOptions(target="EYY", columns="x_*"))
    with pytest.raises(InputError, match="put \\* where the position is"):
        read(tmp_path / "both.csv", ProfileOptions(target="EYY", columns="y_laser"))
    toml = tmp_path / "places.toml"
    keys = "".join(f'y_laser_{p:g}_um = {{ y = "{p / 10:g} m", x = "0.3 m" }}\n' for p in found.position)
    toml.write_text("[positions]\n" + keys.replace(" m", " mm").replace("0.3 mm", "0.3 m"), encoding="utf-8")
    placed = read(tmp_path / "both.csv", ProfileOptions(target="EYY", places=read_places(toml)))
    np.testing.assert_allclose(placed.points[:, 1], found.position / 10)
    assert set(placed.points[:, 0]) == {300.0}


def _with_zeros(found: Profiles) -> Profiles:
    """Return the profiles with the other columns of the file as channels of the states."""
    table = found.states.table.assign(**{f"z_laser_{p:g}_um": 0.0 for p in found.position})
    channels = [
        replace(found.states.channels[0], name=f"z_laser_{p:g}_um", quantity="displacement", unit="um")
        for p in found.position
    ]
    return replace(found, states=replace(found.states, table=table, channels=(*found.states.channels, *channels)))


def test_columns_that_nobody_named_must_suit_the_component(tmp_path: Path) -> None:
    wide(made()).to_csv(tmp_path / "wide.csv", index=False)
    with pytest.raises(RecordingError, match="columns like 'y_laser_0_um' seem to contain Y, not EXX; if they are"):
        read(tmp_path / "wide.csv", "EXX")
    assert read(tmp_path / "wide.csv", ProfileOptions(target="EXX", columns="y_laser_*")).axis == "X"
    assert read(tmp_path / "wide.csv", "EXY").target == "EXY"
    with pytest.raises(RecordingError, match=r"no column is like y_laser_250_urad"):
        read(tmp_path / "wide.csv", "EAY")
    with pytest.raises(InputError, match="X0C: spindle drift in X does not depend on a position; give an"):
        read(tmp_path / "wide.csv", "X0C")
    with pytest.raises(InputError, match="laser: it is not the name of an error component"):
        read(tmp_path / "wide.csv", "laser")
    own = ProfileOptions(target="laser", axis="Y", unit="um")
    assert read(tmp_path / "wide.csv", own).target == "laser"
    with pytest.raises(InputError, match="state whether it is in um or urad"):
        read(tmp_path / "wide.csv", ProfileOptions(target="laser", axis="Y"))


def test_an_angle_among_displacements_is_refused(tmp_path: Path) -> None:
    wide(made()).rename(columns={"y_laser_50_um": "y_laser_50_urad"}).to_csv(tmp_path / "mixed.csv", index=False)
    said = "column 'y_laser_50_urad' measures angle in urad among displacements in um: leave it out, or"
    with pytest.raises(UnitError, match=said):
        read(tmp_path / "mixed.csv", ProfileOptions(target="EYY", columns="y_laser_*"))
    with pytest.raises(UnitError, match=said):
        read(tmp_path / "mixed.csv", "EYY")
    rest = read(tmp_path / "mixed.csv", ProfileOptions(target="EYY", columns="y_laser_*_um"))
    assert len(rest.points) == len(made().points) - 1
    swapped = {f"y_laser_{p}_um": f"y_laser_{p}_urad" for p in (50, 100)}
    wide(made()).rename(columns=swapped).to_csv(tmp_path / "two.csv", index=False)
    said = "each of the columns 'y_laser_50_urad', 'y_laser_100_urad' measures angle in urad among displacements in um:"
    with pytest.raises(UnitError, match=said):
        read(tmp_path / "two.csv", "EYY")
    long(made()).to_csv(tmp_path / "long.csv", index=False)
    with pytest.raises(UnitError, match="column 'error_um' measures displacement, not angle in urad"):
        read(tmp_path / "long.csv", ProfileOptions(target="EAY", columns="error_um"))


def test_two_profiles_of_one_name_are_told_apart_by_their_units(tmp_path: Path) -> None:
    found = made()
    table = wide(found)
    twins = {c.replace("_um", "_urad"): 0.5 for c in map(str, table) if c.startswith("y_laser")}
    table.assign(**twins).to_csv(tmp_path / "both.csv", index=False)
    np.testing.assert_array_equal(read(tmp_path / "both.csv", "EYY").values, found.values)
    assert (read(tmp_path / "both.csv", "EAY").values == 0.5).all()
    long(found).assign(error_urad=0.5).to_csv(tmp_path / "long.csv", index=False)
    np.testing.assert_array_equal(read(tmp_path / "long.csv", "EYY").values, found.values)


def test_a_long_profile_in_two_units_is_refused(tmp_path: Path) -> None:
    table = long(made())
    there = table["y_mm"] == 50.0
    table["error_urad"] = table["error_um"].where(there)
    table["error_um"] = table["error_um"].where(~there)
    table.to_csv(tmp_path / "mixed.csv", index=False)
    line = int(np.flatnonzero(there)[0]) + 2
    with pytest.raises(UnitError, match=f"line {line}: there is a value in 'error_urad' and none in 'error_um': corr"):
        read(tmp_path / "mixed.csv", "EYY")
    meant = read(tmp_path / "mixed.csv", ProfileOptions(target="EYY", columns="error_um"))
    assert np.isnan(meant.values[:, meant.position == 50.0]).all()


def test_columns_out_of_order_and_too_few(tmp_path: Path) -> None:
    found = made()
    table = wide(found)
    first = ["time_s", "t1_C", "y_laser_0_um", "y_laser_100_um"]
    table[[*first, "y_laser_50_um"]].to_csv(tmp_path / "a.csv", index=False)
    with pytest.raises(RecordingError, match=r"a\.csv: profiles of EYY: positions along Y must increase, but 50 mm"):
        read(tmp_path / "a.csv", "EYY")
    table[first].to_csv(tmp_path / "b.csv", index=False)
    with pytest.raises(RecordingError, match=r"b\.csv: profiles of EYY: 2 positions along Y \(0, 100 mm\); a"):
        read(tmp_path / "b.csv", "EYY")


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("0,20,0,1\n0,20,100,1\n0,20,50,1", r"line 4, column 'y_mm': 50 mm follows 100 mm in one thermal state"),
        ("0,20,0,1\n0,20,50,1\n0,20,50,2", r"line 4, column 'y_mm': 50 mm occurs twice in one thermal state, but"),
        ("0,20,0,1\n0,20,,1\n0,20,50,2", r"line 3, column 'y_mm': the position is missing"),
        ("0,20,0,1\n0,20,50,1\n9,20,0,2\n9,20,50,2", r"2 positions along Y \(0, 50 mm\)"),
        ("0,20,0,1\n0,20,fifty,1\n0,20,100,2", r"line 3, column 'y_mm': 'fifty' is not a number"),
        ("5,20,0,1\n5,20,50,1\n0,20,0,2", r"line 4, column 'time_s': time 0.0 is before 5.0"),
    ],
)
def test_bad_rows_of_a_long_table(rows: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.csv"
    path.write_text(f"time_s,t1_C,y_mm,error_um\n{rows}\n", encoding="utf-8")
    with pytest.raises(RecordingError, match=message) as failure:
        read(path, "EYY")
    assert str(failure.value).startswith(str(path))


def test_columns_of_a_long_table(tmp_path: Path) -> None:
    found = made()
    table = long(found)
    path = tmp_path / "long.csv"
    table.assign(other_um=1.0).to_csv(path, index=False)
    with pytest.raises(RecordingError, match="one column of displacements; there are error_um, other_um: specify"):
        read(path, "EYY")
    assert "other_um" in [c.name for c in read(path, ProfileOptions(target="EYY", columns="error_um")).states.channels]
    with pytest.raises(InputError, match="no column is called 'errors'; there are t1_C"):
        read(path, ProfileOptions(target="EYY", columns="errors"))
    table.drop(columns="error_um").to_csv(path, index=False)
    with pytest.raises(
        RecordingError, match="expected one column of displacements; there is none: name one like error_um"
    ):
        read(path, "EYY")
    table.rename(columns={"y_mm": "x_mm"}).to_csv(path, index=False)
    with pytest.raises(RecordingError, match=r"no column of positions is called position_mm or pos_mm or y_mm.*: x_mm"):
        read(path, "EYY")
    table.rename(columns={"y_mm": "travel", "error_um": "e"}).to_csv(path, index=False)
    roles = {"y_mm": ColumnMap("travel", "mm", "position"), "error": ColumnMap("e", "um", "displacement")}
    np.testing.assert_array_equal(read(path, "EYY", Mapping(columns=roles)).values, found.values)
    named = {**roles, "at": replace(roles["y_mm"])}
    del named["y_mm"]
    options = ProfileOptions(target="EYY", position="at")
    np.testing.assert_array_equal(read(path, options, Mapping(columns=named)).values, found.values)
    labelled = table.assign(state=np.repeat(range(len(found)), 12), time_s=0.0)
    labelled.to_csv(path, index=False)
    with pytest.raises(RecordingError, match="line 14: a new state begins at the same time as the previous one"):
        read(path, "EYY")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected one table \\[positions\\]"),
        ("[positions]\n[more]\na = 1", "expected one table \\[positions\\]"),
        ("[positions]\na = 250", r"\[positions\] a = 250: write the axes' positions"),
        ("[positions]\na = { q = '1 mm' }", r"write the axes' positions"),
        ("[positions]\na = { y = 250 }", r'a\.y = 250: write a position with its unit, such as "250 mm"'),
        ("[positions]\na = { y = '250' }", r"a\.y = '250': write a position with its unit"),
        ("[positions]\na = { y = '250 degC' }", r"a\.y = '250 degC': unit 'degC' measures temperature, not position"),
        ("[positions", "not valid TOML"),
    ],
)
def test_bad_files_of_positions(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "positions.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=message) as failure:
        read_places(path)
    assert str(failure.value).startswith(str(path))


def test_places_must_tell_the_own_position_and_be_there(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.toml: no such file of positions"):
        read_places(tmp_path / "none.toml")
    found = made()
    wide(found).to_csv(tmp_path / "wide.csv", index=False)
    places = {f"y_laser_{p:g}_um": {"X": p} for p in found.position}
    with pytest.raises(
        InputError, match=r"column 'y_laser_0_um': its entry in .positions. does not give the position of Y"
    ):
        read(tmp_path / "wide.csv", ProfileOptions(target="EYY", places=places))
    with pytest.raises(ThermocompError, match="no channel is named 'lost'"):
        read(tmp_path / "wide.csv", ProfileOptions(target="EYY", places={"lost": {"Y": 1.0}}))


def test_negative_positions_in_names() -> None:
    found = made()
    table = found.states.table.assign(
        **{f"y_laser_{p - 550:g}_um": v for p, v in zip(found.position, found.values.T, strict=True)}
    )
    channel = replace(found.states.channels[0], quantity="displacement", unit="um")
    channels = [replace(channel, name=f"y_laser_{p - 550:g}_um") for p in found.position]
    states = replace(found.states, table=table, channels=(*found.states.channels, *channels))
    np.testing.assert_array_equal(from_recording(states, "EYY").position, found.position - 550)
