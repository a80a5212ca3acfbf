"""Columns that are called after components, one or all of them from the same files."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from thermocomp.core.exceptions import RecordingError, UnitError
from thermocomp.recordings.profiles import ProfileOptions
from thermocomp.recordings.readers import codecolumns
from thermocomp.recordings.readers.profiles import NOT_TAKEN, from_recording, read, read_components
from thermocomp.recordings.readers.recordings import read as read_recording

N = 12


def table(*names: str) -> pd.DataFrame:
    """Return a table of a temperature and columns whose values are 1, 2, 3 ..."""
    made = {"time_s": 60.0 * np.arange(N), "t_nut_C": 20.0 + np.arange(N)}
    return pd.DataFrame(made | {name: np.full(N, k + 1.0) for k, name in enumerate(names)})


def written(path: Path, *names: str) -> Path:
    table(*names).to_csv(path, index=False)
    return path


X = tuple(f"EXX_{p}_um" for p in (0, 100, 200))
ROLL = tuple(f"EAX_{p}_urad" for p in (-50, 0, 50.5))
ASIDE = tuple(f"EXX_z600_{p}_um" for p in (0, 100, 200))


def test_codes_in_the_order_of_the_house(tmp_path: Path) -> None:
    recording = read_recording(written(tmp_path / "a.csv", *ROLL, *X, "C0Y_urad", "x_laser_0_um", "EXX_um"))
    assert codecolumns.codes(recording) == ("EXX", "EAX")
    found, elsewhere = codecolumns.columns_of(recording, "EAX")
    assert found == {"EAX_-50_urad": -50.0, "EAX_0_urad": 0.0, "EAX_50.5_urad": 50.5}
    assert elsewhere == ()
    assert codecolumns.columns_of(recording, "EYY") == ({}, ())
    assert [codecolumns.is_code_column(c) for c in recording.channels[:2]] == [False, True]


def test_several_components_from_one_reading(tmp_path: Path) -> None:
    paths = [written(tmp_path / f"{k}.csv", *X, *ROLL, "nest_um") for k in "ab"]
    found = read_components(paths)
    assert list(found) == ["EXX", "EAX"]
    assert [len(tests) for tests in found.values()] == [2, 2]
    exx, eax = found["EXX"][0], found["EAX"][1]
    assert exx.position.tolist() == [0.0, 100.0, 200.0]
    assert exx.values[0].tolist() == [1.0, 2.0, 3.0]
    assert (eax.unit, eax.axis, eax.position.tolist()) == ("urad", "X", [-50.0, 0.0, 50.5])
    # profiles of others are no channels of the states
    assert [c.name for c in exx.states.channels] == [c.name for c in eax.states.channels] == ["t_nut_C", "nest_um"]
    assert list(read_components(paths, ["EAX"])) == ["EAX"]


def test_one_component_needs_no_columns_named(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", *X, *ROLL, *(f"x_laser_{p}_um" for p in (0, 1, 2)))
    assert read(path, "EXX").values[0].tolist() == [1.0, 2.0, 3.0]
    named = read(path, ProfileOptions(target="EXX", columns="x_laser_*"))
    assert named.position.tolist() == [0.0, 1.0, 2.0]


def test_columns_with_another_axis_elsewhere_are_told_and_left_out(tmp_path: Path) -> None:
    recording = read_recording(written(tmp_path / "a.csv", *X, *ASIDE))
    assert codecolumns.columns_of(recording, "EXX")[1] == ASIDE
    exx = from_recording(recording, "EXX")
    assert exx.position.tolist() == [0.0, 100.0, 200.0]
    (note,) = (n for n in exx.states.notes if n.startswith(NOT_TAKEN))
    assert "EXX_z600_0_um to EXX_z600_200_um" in note
    alone = read_recording(written(tmp_path / "b.csv", *ASIDE))
    assert codecolumns.codes(alone) == ()


def test_what_is_missing_or_wrong_is_said_with_the_file(tmp_path: Path) -> None:
    both, one = written(tmp_path / "both.csv", *X, *ROLL), written(tmp_path / "one.csv", *X)
    with pytest.raises(RecordingError, match=r"one\.csv: no column is named after EAX, such as EAX_250_urad"):
        read_components([both, one])
    with pytest.raises(RecordingError, match=r"one\.csv: no column is named after E9, such as"):
        read_components([one], ["E9"])
    none = written(tmp_path / "none.csv", "x_laser_0_um", "x_laser_1_um", "x_laser_2_um")
    with pytest.raises(
        RecordingError, match=r"none\.csv: no column is named after an error component, such as EXX_250_um"
    ):
        read_components([none])
    wrong = written(tmp_path / "wrong.csv", *X[:2], "EXX_200_urad")
    with pytest.raises(UnitError, match=r"'EXX_200_urad' measures angle in urad among displacements"):
        read_components([wrong], ["EXX"])
    with pytest.raises(RecordingError, match="2 positions along X"):
        read_components([written(tmp_path / "few.csv", *X[:2])])
