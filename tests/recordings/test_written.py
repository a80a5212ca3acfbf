"""Writing recordings: what is written is read again, and other files are left alone."""

import tempfile
from pathlib import Path
from typing import IO

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thermocomp.core.exceptions import InputError
from thermocomp.core.machine import Channel
from thermocomp.recordings.cycles import Cycle, make_single_cycle
from thermocomp.recordings.readers.recordings import read, write
from thermocomp.recordings.recording import Recording

#: 9.9E37 is SCPI's infinity
NUMBERS = st.floats(allow_nan=True, allow_infinity=False).filter(lambda x: not abs(x) >= 9.9e37)


@settings(deadline=None)
@given(
    rows=st.lists(st.tuples(NUMBERS, NUMBERS), min_size=2, max_size=12),
    ending=st.sampled_from([".csv", ".parquet"]),
    names=st.sampled_from([("t1_C", "drift_um"), ("x_um", "z_um"), ("Käfig", 'a, "b"'), ("t1", "t1_C")]),
    kinds=st.sampled_from([("temperature", "displacement"), ("position", "angle"), ("dimensionless", "feed")]),
    place=st.sampled_from(["", "front bearing"]),
    start=st.sampled_from(["", "2024-05-01T10:00:00+02:00"]),
    label=st.sampled_from(["whole test", "1", "1.0", "2 (100 1/min)", "NA"]),
)
def test_what_is_written_is_read_again(
    rows: list[tuple[float, float]],
    ending: str,
    names: tuple[str, str],
    kinds: tuple[str, str],
    place: str,
    start: str,
    label: str,
) -> None:
    units = {"temperature": "degC", "displacement": "um", "position": "mm", "angle": "urad", "dimensionless": "1"}
    channels = tuple(Channel(n, q, units.get(q, "mm/min"), place) for n, q in zip(names, kinds, strict=True))
    time = np.cumsum(np.full(len(rows), 0.1)) - 0.1
    cycles = (Cycle(label, 0, 1), Cycle("last", 1, len(rows)))
    recording = Recording("r", time, pd.DataFrame(rows, columns=list(names)), channels, cycles, start=start)

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"r{ending}"
        write(recording, path)
        again = read(path)

    np.testing.assert_array_equal(again.time, time)
    np.testing.assert_array_equal(again.table.to_numpy(), recording.table.to_numpy())
    assert (again.channels, again.cycles, again.start) == (channels, cycles, start)


def test_writing_keeps_what_is_there_unless_told(tmp_path: Path) -> None:
    path = _csv(tmp_path, "time_s,t1_C\n0,1\n")
    recording = read(path)

    with pytest.raises(InputError, match=r"rec\.csv: the file exists already"):
        write(recording, path)
    write(recording, path, overwrite=True)
    assert path.read_text() == "time_s,t1_C,cycle\n0.0,1.0,whole test\n"
    with pytest.raises(InputError, match=r"written as \.csv or \.parquet"):
        write(recording, tmp_path / "rec.xlsx")
    with pytest.raises(InputError, match="there is no folder"):
        write(recording, tmp_path / "no" / "rec.csv")
    named = Recording(
        "r",
        recording.time,
        recording.table.set_axis(["cycle"], axis=1),
        (Channel("cycle", "angle", "urad"),),
        make_single_cycle(1),
    )
    write(named, tmp_path / "odd.csv")
    assert read(tmp_path / "odd.csv").channels == named.channels


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_writing_leaves_other_files_alone(tmp_path: Path, ending: str, monkeypatch: pytest.MonkeyPatch) -> None:
    recording = read(_csv(tmp_path, "time_s,t1_C\n0,1\n"))
    path = tmp_path / f"out.{ending}"
    (tmp_path / f"{path.name}.part").write_text("mine")
    there = {p.name for p in tmp_path.iterdir()}

    write(recording, path)

    assert {p.name for p in tmp_path.iterdir()} == there | {path.name}
    assert (tmp_path / f"{path.name}.part").read_text() == "mine"
    assert path.stat().st_mode == (tmp_path / "rec.csv").stat().st_mode  # readable for others, as any new file
    whole_one = path.read_bytes()

    def fail(_: pd.DataFrame, target: Path | IO[str], **__: object) -> None:
        if isinstance(target, Path):
            target.write_text("half")
        else:
            target.write("half")
        raise OSError("the disk is full")

    monkeypatch.setattr(pd.DataFrame, f"to_{ending}", fail)
    with pytest.raises(InputError, match=r"out\.(csv|parquet): the file cannot be written: the disk is full"):
        write(recording, path, overwrite=True)
    assert {p.name for p in tmp_path.iterdir()} == there | {path.name}
    assert path.read_bytes() == whole_one


def test_cycles_of_one_name_are_numbered_when_written(tmp_path: Path) -> None:
    recording = read(_csv(tmp_path, "time_s,t1_C\n0,1\n1,2\n")).with_cycles([Cycle("a", 0, 1), Cycle("a", 1, 2)])

    write(recording, tmp_path / "out.csv")

    assert read(tmp_path / "out.csv").cycles == (Cycle("1: a", 0, 1), Cycle("2: a", 1, 2))


def _csv(folder: Path, text: str, name: str = "rec.csv") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path
