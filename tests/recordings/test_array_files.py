"""TDMS, HDF5 and MAT files: names, units and times that they state, in the layouts in which programs write them."""

import builtins
import random
import subprocess
import sys
import warnings
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import pytest
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter
from scipy.io import savemat

from thermocomp.core.exceptions import InputError, MissingExtraError, RecordingError, TwoReadingsError
from thermocomp.recordings.readers.mapping import ColumnMap, Mapping, ReadOptions, TimeColumn
from thermocomp.recordings.readers.recordings import read

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # it sets a deprecated option of pandas
    from matio import load_from_mat, save_to_mat

N, STEP = 40, 60.0
TIME = STEP * np.arange(N)
SPINDLE, PROBE = 20 + 5 * (1 - np.exp(-TIME / 900)), 12 * (1 - np.exp(-TIME / 1200))
BEGIN = np.datetime64("2024-03-05T08:00:00", "ns")
STAMPS = BEGIN + (TIME * 1e9).astype("m8[ns]")
DATENUM = 739_316 + 8 / 24 + TIME / 86_400  # datenum(2024, 3, 5, 8, 0, 0) in MATLAB


def tdms(path: Path, *channels: ChannelObject) -> None:
    with TdmsWriter(path) as writer:
        writer.write_segment([RootObject({"Operator": "x"}), GroupObject("Log"), *channels])


def wave(name: str, values: Any, unit: str, step: float = STEP, group: str = "Log", **more: Any) -> ChannelObject:
    said = {"unit_string": unit, "wf_increment": step, "wf_start_offset": 0.0, "wf_start_time": BEGIN, **more}
    return ChannelObject(group, name, values, said)


def waveforms(path: Path) -> None:
    tdms(path, wave("Spindle", SPINDLE, "Deg C"), wave("Probe", PROBE / 1e3, "mm"))


def two_rates(path: Path) -> None:
    tdms(path, wave("Spindle", SPINDLE, "°C"), wave("Probe", PROBE[::2], "um", 2 * STEP, "Probes"))


def tdms_stamps(path: Path) -> None:
    channels = [ChannelObject("Log", "Timestamp", STAMPS.astype("M8[us]"))]
    channels.append(ChannelObject("Log", "Spindle", SPINDLE.astype("f4"), {"unit_string": "°C"}))
    tdms(path, *channels, ChannelObject("Log", "Probe_um", PROBE), ChannelObject("Log", "Events", ["start", "stop"]))


def tdms_seconds(path: Path) -> None:
    """Seconds since 1904, as LabVIEW writes a time as a number."""
    seconds = TIME + (BEGIN - np.datetime64("1904-01-01")) / np.timedelta64(1, "s")
    tdms(path, ChannelObject("Log", "Time", seconds), ChannelObject("Log", "Spindle (degC)", SPINDLE),
         ChannelObject("Log", "Probe", PROBE, {"unit_string": "[µm]"}))  # fmt: skip


def datasets(path: Path) -> None:
    with h5py.File(path, "w") as f:
        log = f.create_group("log")
        log.create_dataset("time", data=TIME).attrs["units"] = "s"
        log.create_dataset("Spindle", data=SPINDLE, compression="gzip").attrs["units"] = "degC"
        log.create_dataset("Probe", data=PROBE).attrs["unit"] = np.bytes_("um")
        log["rate"] = 1 / STEP
        f["about/remarks"] = ["first test"]


def matrix(path: Path) -> None:
    with h5py.File(path, "w") as f:
        f["timestamp"] = [str(t)[:19] for t in STAMPS]
        f["values"] = np.stack([SPINDLE, PROBE])  # as MATLAB writes an N x 2 matrix
        f["values"].attrs["columns"] = ["Spindle", "Probe"]
        f["values"].attrs["units"] = ["degC", "um"]


def compound(path: Path) -> None:
    parts = [("time_s", "f8"), ("Spindle_C", "f8"), ("Probe_um", "f8")]
    rows = np.array(list(zip(TIME, SPINDLE, PROBE, strict=True)), dtype=parts)
    with h5py.File(path, "w") as f:
        f["run/table"] = rows


def pandas_fixed(path: Path) -> None:
    with h5py.File(path, "w") as f:
        frame = f.create_group("frame")
        frame.attrs["pandas_type"] = np.bytes_("frame")
        frame["axis0"] = frame["block0_items"] = np.array([b"Spindle_C", b"Probe_um"])
        frame.create_dataset("axis1", data=STAMPS.view(np.int64)).attrs["kind"] = np.bytes_("datetime64[ns]")
        frame["block0_values"] = np.stack([SPINDLE, PROBE], axis=1)


def hdf5_waveforms(path: Path) -> None:
    with h5py.File(path, "w") as f:
        for name, values, unit in (("Spindle", SPINDLE, "degC"), ("Probe", PROBE, "um")):
            said = {"wf_increment": STEP, "wf_start_time": "2024-03-05T08:00:00.000000Z", "unit_string": unit}
            f.create_dataset(f"Log/{name}", data=values).attrs.update(said)


def timetable(path: Path, version: str = "v7.3") -> None:
    """A timetable with ``Properties.VariableUnits``, which the library writes only from its raw properties."""
    frame = pd.DataFrame({"Spindle": SPINDLE, "Probe": PROBE}, index=pd.DatetimeIndex(STAMPS, name="Time"))
    save_to_mat(path, {"log": frame}, version=version)
    raw = load_from_mat(path, raw_data=True)["log"]
    units = np.empty((1, 2), dtype=object)
    units[0] = [np.array(["degC"]), np.array(["um"])]
    raw.properties["any"][0, 0]["varUnits"] = units
    save_to_mat(path, {"log": raw}, version=version)


def durations(path: Path) -> None:
    index = pd.TimedeltaIndex(TIME.astype("m8[s]"), name="Time")
    save_to_mat(path, {"log": pd.DataFrame({"Spindle_C": SPINDLE, "Probe_um": PROBE}, index=index)}, version="v7")


def struct(path: Path) -> None:
    savemat(path, {"log": {"time_s": TIME, "Spindle_C": SPINDLE, "Probe_um": PROBE, "operator": "x", "rate": 1.0}})


def variables(path: Path) -> None:
    values = np.stack([SPINDLE, PROBE], axis=1)
    names = np.array(["Spindle_C", "Probe_um"], dtype=object)
    savemat(path, {"time": DATENUM, "values": values, "values_names": names}, do_compression=True)


def channels(path: Path) -> None:
    """The layout of dSPACE: X is the time, Y(k) a channel."""
    parts = [("Spindle", SPINDLE, "degC"), ("Probe", PROBE, "um")]
    y = np.array([(n, v[None], u) for n, v, u in parts], dtype=[("Name", "O"), ("Data", "O"), ("Unit", "O")])
    savemat(path, {"run": {"X": {"Name": "time", "Data": TIME, "Unit": "s"}, "Y": y}})


def modern_struct(path: Path) -> None:
    save_to_mat(path, {"log": {"when": STAMPS, "Spindle_C": SPINDLE, "Probe_um": PROBE}}, version="v7.3")


DATED: dict[str, Callable[[Path], None]] = {
    "waveforms.tdms": waveforms,
    "two_rates.tdms": two_rates,
    "stamps.tdms": tdms_stamps,
    "seconds.tdms": tdms_seconds,
    "matrix.h5": matrix,
    "pandas.h5": pandas_fixed,
    "wave.hdf5": hdf5_waveforms,
    "timetable.mat": timetable,
    "timetable7.mat": lambda path: timetable(path, "v7"),
    "variables.mat": variables,
    "modern.mat": modern_struct,
}
FILES = {
    **DATED,
    "datasets.h5": datasets,
    "compound.hdf": compound,
    "durations.mat": durations,
    "struct.mat": struct,
    "channels.mat": channels,
}


@pytest.mark.parametrize("name", FILES)
def test_it_is_read_at_once_with_names_units_and_times(tmp_path: Path, name: str) -> None:
    FILES[name](tmp_path / name)
    recording = read(tmp_path / name)
    assert {c.name for c in recording.channels} == {"Spindle_C", "Probe_um"}
    assert recording.start.removesuffix("+00:00") == (str(BEGIN)[:19] if name in DATED else "")
    assert np.allclose(recording.time, TIME, atol=1e-3)
    held = np.arange(N) // 2 * 2 if name == "two_rates.tdms" else np.arange(N)
    assert np.allclose(recording.table["Spindle_C"], SPINDLE, atol=1e-5)
    assert np.allclose(recording.table["Probe_um"], PROBE[held])


@pytest.mark.parametrize("ending", ["tdms", "h5", "mat"])
def test_of_several_tables_one_is_asked_for(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"two.{ending}"
    if ending == "tdms":
        tdms(
            path, *(wave(n, v, u, group=g) for g in ("a", "b") for n, v, u in (("T", SPINDLE, "C"), ("z", PROBE, "um")))
        )
    elif ending == "h5":
        with h5py.File(path, "w") as f:
            for g in ("a", "b"):
                f[f"{g}/time_s"], f[f"{g}/T_C"], f[f"{g}/z_um"] = TIME, SPINDLE, PROBE
    else:
        savemat(path, {g: {"time_s": TIME, "T_C": SPINDLE, "z_um": PROBE} for g in ("a", "b")})
    with pytest.raises(RecordingError, match="all hold a table; state which in a mapping") as e:
        read(path)
    said = [remedy["read"]["sheet"] for remedy in e.value.remedies]
    assert [s.strip("/") for s in said] == ["a", "b"]
    assert len(read(path, Mapping(read=ReadOptions(sheet=said[1])))) == N
    with pytest.raises(RecordingError, match="there is no group 'c'; there are"):
        read(path, Mapping(read=ReadOptions(sheet="c")))


def test_columns_without_names_and_units_are_asked_for(tmp_path: Path) -> None:
    savemat(tmp_path / "bare.mat", {"t": TIME, "T": SPINDLE, "z": PROBE})
    with pytest.raises(TwoReadingsError, match="no time column found among t, T, z") as e:
        read(tmp_path / "bare.mat")
    assert e.value.remedies[0]["time"] == {"column": "t", "unit": "s"}
    savemat(tmp_path / "one.mat", {"data": np.stack([TIME, SPINDLE, PROBE], axis=1)})
    mapping = Mapping(TimeColumn("data1", "s"), {"t1_C": ColumnMap("data2", "degC", "temperature")})
    assert np.allclose(read(tmp_path / "one.mat", mapping).table["t1_C"], SPINDLE)


def test_values_without_times_are_refused_with_what_was_found(tmp_path: Path) -> None:
    savemat(tmp_path / "bare.mat", {"a": {"spindle": SPINDLE}, "b": {"probe": PROBE}})
    with pytest.raises(
        RecordingError, match="no times beside the values: found 'spindle', 'probe'; export it with a vector"
    ):
        read(tmp_path / "bare.mat")
    with h5py.File(tmp_path / "empty.h5", "w") as f:
        f["rate"] = 1.0
    with pytest.raises(RecordingError, match="there are no vectors"):
        read(tmp_path / "empty.h5")


def test_small_files_that_become_large_are_refused(tmp_path: Path) -> None:
    """A compressed or empty dataset, references that lead to the same data again and again, or to themselves."""
    with h5py.File(tmp_path / "empty.h5", "w") as f:
        for heading in ("time_s", "x_C"):
            f.create_dataset(heading, (90_000_000,), "f8", chunks=(1_000_000,))
    reused = tmp_path / "reused.mat"
    with h5py.File(reused, "w", userblock_size=512) as f:
        f["#refs#/a"] = np.zeros(1_000_000)
        f["cell"] = np.array([f["#refs#/a"].ref] * 2_000, dtype=h5py.ref_dtype)
    loop = tmp_path / "loop.mat"
    with h5py.File(loop, "w", userblock_size=512) as f:
        cell = f.create_dataset("cell", (1,), dtype=h5py.ref_dtype)
        cell[0] = cell.ref
    texts = tmp_path / "texts.h5"
    with h5py.File(texts, "w") as f:
        f["time_s"] = np.arange(100_000.0)
        f.create_dataset("when", (100_000,), h5py.string_dtype(), fillvalue="2024" * 2_000, chunks=(100_000,))
    bomb = bytearray(b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM")
    packed = zlib.compress(bytes(100 << 20))
    (tmp_path / "bomb.mat").write_bytes(bomb + (15).to_bytes(4, "little") + len(packed).to_bytes(4, "little") + packed)
    for name in ("empty.h5", "reused.mat", "bomb.mat", "texts.h5"):
        with pytest.raises(RecordingError, match="times its size when it is unpacked, which is the limit"):
            read(tmp_path / name)
    with pytest.raises(RecordingError, match="/cell refers to itself; the file is damaged"):
        read(loop)


def test_links_to_other_files_are_not_followed(tmp_path: Path) -> None:
    compound(tmp_path / "other.h5")
    datasets(tmp_path / "own.h5")
    with h5py.File(tmp_path / "own.h5", "a") as f:
        f["log/secret"] = h5py.ExternalLink("other.h5", "/run/table")
    assert len(read(tmp_path / "own.h5").channels) == 2
    (tmp_path / "own.h5").rename(tmp_path / "own.mat")
    with pytest.raises(RecordingError, match="/log is linked to another place; export all data to one file"):
        read(tmp_path / "own.mat")


@pytest.mark.parametrize("name", ["stamps.tdms", "datasets.h5", "struct.mat"])
def test_damaged_files_are_refused_in_words(tmp_path: Path, name: str) -> None:
    """Cut off, or with bytes that are not what was written: read, or an error that names the file."""
    FILES[name](tmp_path / name)
    whole = (tmp_path / name).read_bytes()
    rng = random.Random(name)
    damaged = [whole[: len(whole) * k // 8] for k in range(8)]
    for _ in range(60):
        part = bytearray(whole)
        for _ in range(rng.choice((1, 4, 30))):
            part[rng.randrange(len(part))] = rng.randrange(256)
        damaged.append(bytes(part))
    path = tmp_path / f"damaged_{name}"
    told = []
    for content in damaged:
        path.write_bytes(content)
        try:
            read(path)
        except InputError as e:
            told.append(str(e))
    assert len(told) >= 8
    assert all(str(path) in text for text in told)


@pytest.mark.parametrize("ending", ["h5", "mat"])
def test_a_heap_of_texts_without_an_end_is_refused_before_the_library_reads_it(tmp_path: Path, ending: str) -> None:
    """HDF5 reads an object of no size again and again, and cannot be interrupted: hence in a process of its own."""
    path = tmp_path / f"damaged.{ending}"
    matrix(path)
    whole = path.read_bytes()
    heap = whole.index(b"GCOL")
    told = "import sys, thermocomp as tc\ntry: tc.read(sys.argv[1])\nexcept tc.ThermocompError as e: print(e)"
    for place, zeros in ((heap + 16, 16), (heap + 24 + 40 * 5, 64)):
        path.write_bytes(whole[:place] + bytes(zeros) + whole[place + zeros :])
        run = subprocess.run([sys.executable, "-c", told, path], timeout=60, check=True, capture_output=True, text=True)
        assert f"{path}: the file is damaged (at byte" in run.stdout


@pytest.mark.parametrize("ending", ["tdms", "h5", "mat"])
def test_without_the_extra_it_is_named(tmp_path: Path, ending: str, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / f"x.{ending}"
    path.write_bytes(b"x")
    found = builtins.__import__

    def missing(name: str, *args: Any, **kwargs: Any) -> Any:
        if name.partition(".")[0] in ("nptdms", "h5py", "matio"):
            raise ImportError(name=name)
        return found(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", missing)
    with pytest.raises(MissingExtraError, match=r"pip install 'thermocomp\[files\]'"):
        read(path)
