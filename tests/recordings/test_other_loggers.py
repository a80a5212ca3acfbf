"""Files of loggers, controllers and databases are read at once, with the names, units and times that they state."""

from collections.abc import Callable
from pathlib import Path

import loggerfiles
import numpy as np
import pytest
from loggerfiles import FILES, PROBE, SPINDLE, STEP, N

from thermocomp.core.exceptions import RecordingError, TwoReadingsError
from thermocomp.recordings.checks.quality import check
from thermocomp.recordings.readers.mapping import read_mapping
from thermocomp.recordings.readers.mending import mend, read_or_offer, take_best
from thermocomp.recordings.readers.recordings import read
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.starts import find_starts, find_zeroing

BEGIN = "2024-03-05T08:00:00"
#: files with another begin, or other names; the names of the others are Spindle_C and Probe_um
BEGINS = {
    **dict.fromkeys(("keysight.csv", "padded.csv", "continued.csv"), "2024-03-13T08:00:00.010000"),
    "twincat.csv": f"{BEGIN}+00:00",
    "history.csv": "2024-03-05T08:00:00.700000+00:00",
    "influx.csv": f"{BEGIN}+00:00",
    "series.csv": f"{BEGIN}+01:00",
    "samples.xml": f"{BEGIN}+00:00",
}
NAMES = {
    "twincat.csv": ["MAIN.fSpindle_C", "MAIN.fProbe_um"],
    "history.csv": ["spindle_C", "probe_um"],
    "influx.csv": ["value_C", "value_um"],
}


def written(folder: Path, name: str, text: str | None = None) -> Path:
    path = folder / name
    path.write_text(FILES[name]() if text is None else text, encoding="utf-8")
    return path


def values(recording: Recording) -> list[np.ndarray]:
    return [recording.table[c.name].to_numpy() for c in recording.channels]


@pytest.mark.parametrize("name", FILES)
def test_it_is_read_at_once_with_names_units_and_times(tmp_path: Path, name: str) -> None:
    recording = read(written(tmp_path, name))
    assert [c.name for c in recording.channels] == NAMES.get(name, ["Spindle_C", "Probe_um"])
    assert recording.start == BEGINS.get(name, BEGIN)
    assert np.allclose(recording.time, STEP * np.arange(N))
    assert any("different times" in note for note in recording.notes) is (name in ("twincat.csv", "history.csv"))
    spindle, probe = values(recording)
    good = np.isfinite(spindle)
    assert np.allclose(spindle[good], np.array(SPINDLE)[good])
    assert np.flatnonzero(~good).tolist() == ([7, 9, 30] if name == "words.csv" else [])
    # a channel that was read half as often holds its value until the next one
    read_at = np.arange(N) // 2 * 2 if name == "twincat.csv" else np.arange(N)
    assert np.allclose(probe, np.array(PROBE)[read_at])


def test_tests_whose_times_start_again_are_read_one_at_a_time(tmp_path: Path) -> None:
    rows = "".join(f"{k * STEP},{t},{z}\n" for k, t, z in loggerfiles.ROWS)
    plain = f"time_s,Spindle_C,Probe_um\n{rows}" * 2
    for name, text in (("a.csv", plain), ("a.lvm", loggerfiles.labview(starts=("08", "08")))):
        path = written(tmp_path, name, text)
        with pytest.raises(TwoReadingsError, match="holds 2 tests") as caught:
            read_or_offer(path)
        (offer,) = caught.value.__notes__
        ways = [line.removeprefix("# ") for line in offer.splitlines() if "skip =" in line]
        assert len(ways) == 2
        found = []
        for way in ways:
            mapping = tmp_path / "m.toml"
            mapping.write_text(f"[read]\n{way}\n", encoding="utf-8")
            found.append(values(read(path, read_mapping(mapping)))[0])
        n = N if name == "a.csv" else N // 2
        assert found[0].tolist() == SPINDLE[:n]
        assert found[1].tolist() == SPINDLE[N - n :]


def test_segments_with_their_own_dates_are_one_recording(tmp_path: Path) -> None:
    recording = read(written(tmp_path, "a.lvm", loggerfiles.labview(starts=("08", "09"))))
    assert values(recording)[0].tolist() == SPINDLE
    assert recording.time[N // 2] == 3600.0


def test_a_word_in_many_cells_is_asked_for_and_then_missing(tmp_path: Path) -> None:
    rows = "".join(f"{loggerfiles.stamp(k)},{'Defekt' if k % 4 == 1 else t},{z}\n" for k, t, z in loggerfiles.ROWS)
    path = written(tmp_path, "a.csv", f"time,Spindle_C,Probe_um\n{rows}")
    with pytest.raises(RecordingError, match="'Defekt' is not a number") as caught:
        read_or_offer(path)
    assert 'missing = ["Defekt"]' in caught.value.__notes__[0]
    mended = mend(path, "", take_best)
    assert np.flatnonzero(np.isnan(values(mended.recording)[0])).tolist() == list(range(1, N, 4))


@pytest.mark.parametrize("cell", ["2O.5", "0x10", "12..5"])
def test_a_mistyped_number_is_not_a_missing_one(tmp_path: Path, cell: str) -> None:
    rows = "".join(f"{k},{cell if k == 7 else t}\n" for k, t, _ in loggerfiles.ROWS)
    with pytest.raises(RecordingError, match="is not a number"):
        read(written(tmp_path, "a.csv", f"time_s,Spindle_C\n{rows}"))


def test_units_of_another_quantity_in_a_cell_are_refused(tmp_path: Path) -> None:
    text = FILES["grafana.csv"]().replace(f"{SPINDLE[5]} °C", f"{SPINDLE[5]} µm")
    with pytest.raises(RecordingError, match="is not a number"):
        read(written(tmp_path, "a.csv", text))


@pytest.mark.parametrize(
    ("headings", "cells", "begin"),
    [
        ("Time,last_changed", lambda k: f"{k},{loggerfiles.stamp(k)}", BEGIN),
        ("_start,_stop,received", lambda k: f"{BEGIN},{BEGIN},{loggerfiles.stamp(k)}", BEGIN),
        ("created,modified", lambda k: f"{loggerfiles.stamp(k - k % 3)},{loggerfiles.stamp(k)}", BEGIN),
        ("Duration,Begin,End", lambda k: f"0:00:10,{loggerfiles.stamp(k)},{loggerfiles.stamp(k + 1)}", BEGIN),
        ("ts", lambda k: str(1_709_625_600 + STEP * k), f"{BEGIN}+00:00"),
        ("ms,Fecha y hora", lambda k: f"0,{loggerfiles.stamp(k)}", BEGIN),
    ],
)  # fmt: skip
def test_the_time_is_the_column_whose_cells_are_times(
    tmp_path: Path, headings: str, cells: Callable[[int], str], begin: str
) -> None:
    rows = "".join(f"{cells(k)},{t},{z}\n" for k, t, z in loggerfiles.ROWS)
    recording = read(written(tmp_path, "a.csv", f"{headings},Spindle_C,Probe_um\n{rows}"))
    assert recording.start == begin
    assert recording.time[-1] == STEP * (N - 1)


def test_rows_may_end_before_empty_cells_of_remarks_only(tmp_path: Path) -> None:
    rows = "".join(f"{k},{t},{z}{',start' * (k == 0)}\n" for k, t, z in loggerfiles.ROWS)
    assert len(read(written(tmp_path, "a.csv", f"time_s,Spindle_C,Probe_um,Remark\n{rows}"))) == N
    with pytest.raises(RecordingError, match="line 3 has 3 cells"):
        read(written(tmp_path, "b.csv", f"time_s,Spindle_C,Probe_um,bed_C\n{rows}"))
    with pytest.raises(RecordingError, match="line 9 has 2 cells"):
        read(
            written(
                tmp_path,
                "c.csv",
                f"time_s,Spindle_C,Probe_um,Remark\n{rows}".replace(f"7,{SPINDLE[7]},{PROBE[7]}", "7,1"),
            )
        )


def test_the_error_of_a_position_is_a_displacement(tmp_path: Path) -> None:
    text = "time_s,position_error_um,pos_err_um,x_pos_mm,measured_position_mm,position_deviation_mm\n"
    recording = read(written(tmp_path, "a.csv", text + "0,1,2,3,4,5\n1,1,2,3,4,6\n"))
    quantities = [c.quantity for c in recording.channels]
    assert quantities == ["displacement", "displacement", "position", "position", "displacement"]


def test_volts_are_left_out_with_the_keys_of_their_sensitivity(tmp_path: Path) -> None:
    rows = "".join(f"{k},{t},{z / 100:.5f},{3.0 - k % 2}\n" for k, t, z in loggerfiles.ROWS)
    path = written(tmp_path, "a.csv", f"time_s,Spindle_C,Probe [V],Tacho [V]\n{rows}")
    (first, _) = [f.text for f in check(read(path)) if f.kind == "left out"]
    assert "'Probe [V]' is in V: state its sensitivity" in first
    mended = mend(path, "", take_best)
    assert [c.name for c in mended.recording.channels] == ["Spindle_C"]
    assert "scale = the um per V" in mended.text
    mapping = tmp_path / "m.toml"
    mapping.write_text('[columns.z_um]\ncolumn = "Probe [V]"\nrole = "displacement"\nscale = 100\n', encoding="utf-8")
    assert np.allclose(read(path, read_mapping(mapping)).table["z_um"], PROBE)


@pytest.mark.parametrize(("first", "far"), [(0.0, False), (6.0, False), (12.0, True)])
def test_check_and_fit_judge_the_start_alike(tmp_path: Path, first: float, far: bool) -> None:
    z = first + 106 * (1 - np.exp(-np.arange(N) / 20))
    rows = "".join(f"{k * STEP},{SPINDLE[k]},8000,{z[k]}\n" for k in range(N))
    recording = read(written(tmp_path, "a.csv", f"time_s,Spindle_C,spindle_rpm,z_um\n{rows}"))
    kinds = {f.kind: f.severity for f in check(recording)}
    assert ("not zeroed" in kinds) is far
    assert kinds["turning start"] == ("warning" if first > 3 else "info")
    if far:
        with pytest.raises(Exception, match="not zeroed at the start"):
            find_starts([recording], [recording.channel("z_um")], zeroing=find_zeroing(recording))
    else:
        (start,) = find_starts([recording], [recording.channel("z_um")], zeroing=find_zeroing(recording))
        assert "although the spindle turns in the first row" in start.why
