"""thermocomp's own files after other programs had them: the same recording, its channels called the same."""

import csv
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from smallmachine import small_machine

import thermocomp as tc
from thermocomp.api.results import FittedModels
from thermocomp.core.machine import Channel
from thermocomp.recordings.cycles import Cycle
from thermocomp.recordings.readers.recordings import read, write
from thermocomp.recordings.recording import Recording

#: one of each kind: with feed rates, angles, no spindle, days of milling, many channels, several cycles
KINDS = ("chen1996-slope", "chen1996-new", "wessel-sets", "wessel-milling", "iso230-axis", "stepwise2017")


simulated = cache(tc.simulate)


def _csv_pandas(own: Path, there: Path) -> None:
    pd.read_csv(own, comment="#").to_csv(there)


def _csv_twice(own: Path, there: Path) -> None:
    _csv_pandas(own, there)
    pd.read_csv(there).to_csv(there, index=False)


def _csv_spreadsheet(own: Path, there: Path) -> None:
    """Save as a German spreadsheet does: every line has as many cells as the widest, the first one in quotes."""
    first, _, rest = own.read_text().partition("\n")
    table = pd.read_csv(own, comment="#")
    with there.open("w", encoding="utf-8-sig", newline="") as file:
        if first.startswith("#"):
            csv.writer(file, delimiter=";").writerow([first, *[""] * (len(table.columns) - 1)])
        else:
            assert rest
        table.to_csv(file, sep=";", decimal=",", index=False)


def _csv_torn(own: Path, there: Path) -> None:
    """Save a file whose first line was taken apart at its commas."""
    with own.open() as file, there.open("w", newline="") as out:
        csv.writer(out, delimiter=";", quoting=csv.QUOTE_ALL).writerows(csv.reader(file))


WAYS: dict[str, tuple[str, str, Callable[[Path, Path], object]]] = {
    "CSV by pandas": (".csv", ".csv", _csv_pandas),
    "CSV twice by pandas": (".csv", ".csv", _csv_twice),
    "CSV by a spreadsheet": (".csv", ".csv", _csv_spreadsheet),
    "CSV torn": (".csv", ".csv", _csv_torn),
    "CSV to Parquet": (".csv", ".parquet", lambda own, there: pd.read_csv(own, comment="#").to_parquet(there)),
    "CSV to XLSX": (".csv", ".xlsx", lambda own, there: pd.read_csv(own, comment="#").to_excel(there)),
    "Parquet to CSV": (".parquet", ".csv", lambda own, there: pd.read_parquet(own).to_csv(there)),
    "Parquet to XLSX": (".parquet", ".xlsx", lambda own, there: pd.read_parquet(own).to_excel(there)),
    "Parquet by pandas": (".parquet", ".parquet", lambda own, there: pd.read_parquet(own).to_parquet(there)),
    "Parquet shuffled": (
        ".parquet",
        ".parquet",
        lambda own, there: pd.read_parquet(own).sample(frac=1, random_state=1).sort_values("time_s").to_parquet(there),
    ),
    "Parquet without metadata": (
        ".parquet",
        ".parquet",
        lambda own, there: pq.write_table(pq.read_table(own).replace_schema_metadata(None), there),
    ),
}


def _round_trip(recording: Recording, way: str, folder: Path) -> Recording:
    before, after, change = WAYS[way]
    own, there = folder / f"own{before}", folder / f"there{after}"
    write(recording, own, overwrite=True)
    change(own, there)
    return read(there)


@pytest.mark.parametrize("way", WAYS)
def test_own_files_are_the_same_after_other_programs(tmp_path: Path, way: str) -> None:
    for kind in KINDS:
        for recording in simulated(kind)[-1:]:
            again = _round_trip(recording, way, tmp_path)

            assert [replace(c, place="") for c in again.channels] == [replace(c, place="") for c in recording.channels]
            if way in ("Parquet by pandas", "CSV by a spreadsheet"):
                assert again.channels == recording.channels
            assert again.cycles == recording.cycles
            np.testing.assert_allclose(again.time, recording.time, rtol=1e-12)
            np.testing.assert_allclose(again.table.to_numpy(), recording.table.to_numpy(), rtol=1e-12)
            assert not [note for note in again.notes if note.startswith("left out")]


@pytest.fixture(scope="module")
def fitted() -> FittedModels:
    *days, _ = simulated("wessel-milling")
    return tc.fit(days, "s1_um", "ols", leave_one="file")


@pytest.mark.parametrize("way", WAYS)
def test_a_model_fitted_before_assesses_after(tmp_path: Path, way: str, fitted: FittedModels) -> None:
    *_, new = simulated("wessel-milling")

    found = tc.assess(fitted, _round_trip(new, way, tmp_path)).to_frame()

    assert found["rms"].to_list() == pytest.approx(tc.assess(fitted, new).to_frame()["rms"].to_list(), rel=1e-9)


@pytest.fixture(scope="module")
def renamed() -> Recording:
    plain = small_machine(dt=200.0)
    names = {"t1_C": "spindle front", "z_um": "Z", "t2_C": "t2_degC"}
    channels = tuple(replace(c, name=names.get(c.name, c.name)) for c in plain.channels)
    return replace(plain, channels=channels, table=plain.table.rename(columns=names))


@pytest.fixture(scope="module")
def model_and_rms(renamed: Recording) -> tuple[FittedModels, list[float]]:
    model = tc.fit(renamed, "Z", "ols", inputs=["spindle front", "t3_C", "t2_degC"])
    return model, tc.assess(model, renamed).to_frame()["rms"].to_list()


@pytest.mark.parametrize("way", WAYS)
def test_a_channel_without_a_unit_in_its_name_is_found_by_that_name(
    tmp_path: Path, way: str, renamed: Recording, model_and_rms: tuple[FittedModels, list[float]]
) -> None:
    model, rms = model_and_rms

    again = _round_trip(renamed, way, tmp_path)

    assert [again.channel(c.name).unit for c in renamed.channels] == [c.unit for c in renamed.channels]
    assert tc.assess(model, again).to_frame()["rms"].to_list() == pytest.approx(rms, rel=1e-9)


def test_own_files_name_what_has_its_unit_as_it_is(tmp_path: Path) -> None:
    (recording,) = simulated("chen1996-slope")
    assert all(c.place for c in recording.channels)

    write(recording, tmp_path / "own.parquet")

    assert pq.read_schema(tmp_path / "own.parquet").names == ["time_s", *recording.table.columns, "cycle"]


def test_files_of_older_versions_keep_their_names(tmp_path: Path) -> None:
    headings = ["time_s", "x1_um [um]", "t1_C [degC]", "x_mm [mm]", "n_rpm [1/min]", "f_mm_min [mm/min]", "a_C [degF]"]
    pd.DataFrame([[0, 1, 2, 3, 4, 5, 50], [1, 1, 2, 3, 4, 5, 50]], columns=headings).to_csv(tmp_path / "old.csv")

    recording = read(tmp_path / "old.csv")

    assert [(c.name, c.quantity) for c in recording.channels] == [
        ("x1_um", "displacement"),
        ("t1_C", "temperature"),
        ("x_mm", "position"),
        ("n_rpm", "spindle_speed"),
        ("f_mm_min", "feed"),
        ("a_C_C", "temperature"),
    ]


NAMES = (
    "=cmd|' /C calc'!A0",
    "+t1_C",
    "-t1_C",
    "@x_um",
    "\tt1_C",
    "\rt1_C",
    "'=x_um",
    "''-x_um",
    "'quoted_C",
    "plain_C",
)


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
@pytest.mark.parametrize("name", NAMES)
def test_what_a_spreadsheet_would_calculate_is_defused_and_reads_the_same(
    tmp_path: Path, name: str, ending: str
) -> None:
    table = pd.DataFrame({name: [1.0, 2.0], "t9_C": [-3.0, -4.0]})
    unit = ("displacement", "um") if name.endswith("um") else ("temperature", "degC")
    channels = (Channel(name, *unit), Channel("t9_C", "temperature", "degC"))
    recording = Recording("r", np.array([0.0, 1.0]), table, channels, (Cycle(name, 0, 1), Cycle("=b", 1, 2)))

    write(recording, tmp_path / f"own{ending}")

    again = read(tmp_path / f"own{ending}")
    assert (again.channels, again.cycles) == (channels, recording.cycles)
    if ending == ".csv":
        cells = list(csv.reader((tmp_path / "own.csv").read_text().splitlines()))
        texts = [*cells[-3], cells[-2][-1], cells[-1][-1]]
        assert not [text for text in texts if text.startswith(("=", "+", "-", "@", "\t", "\r"))]
        if name.endswith(("um", "C")) and name == name.strip():  # without thermocomp's own line, too
            lines = (tmp_path / "own.csv").read_text().splitlines()
            (tmp_path / "bare.csv").write_text("\n".join(line for line in lines if not line.startswith("#")))
            assert read(tmp_path / "bare.csv").channels == channels
