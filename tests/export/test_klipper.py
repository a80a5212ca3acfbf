"""Klipper's section: its sign by an independent reckoning, its error by a replay of what is printed."""

import csv
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from driftmodels import growing
from poorcontroller import exported, growing_machine, klipper, left, left_out_cycles, page_numbers, temperatures

from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError
from thermocomp.export.facts import Facts
from thermocomp.export.klipper.package import write_klipper
from thermocomp.export.reduction.reduced import as_it_is
from thermocomp.recordings.recording import Recording

FACTS = Facts("model.json", "0" * 64, "1.0", "2026-01-31")


def check(folder: Path, recording: Recording) -> None:
    """The printed errors are those of a replay of what is printed."""
    text, page = (folder / "out" / "tc_thermal.cfg").read_text(), (folder / "out" / "tc_thermal.md").read_text()
    sensor = re.search(r"the recording calls (\S+)", text)
    assert sensor is not None
    warm, zero = temperatures(recording)
    found = left(recording, klipper(text)(warm[sensor[1]], zero[sensor[1]]))
    printed = page_numbers(page)
    assert printed["written"] == pytest.approx(found, abs=5.1e-4)
    squares, rows = 0.0, 0
    for cycle, (factors, (_, _, reduced)) in zip(recording.cycles, left_out_cycles(page), strict=True):
        ((name, factor),) = factors.items()
        rms, _ = left(recording, -factor * (warm[name] - zero[name]), slice(cycle.start, cycle.stop))
        assert reduced == pytest.approx(rms, abs=5.1e-4)
        squares, rows = squares + rms**2 * (cycle.stop - cycle.start), rows + cycle.stop - cycle.start
    assert printed["RMS"][2] == pytest.approx(np.sqrt(squares / rows), abs=5.1e-4)


def test_a_machine_that_grows_is_lowered(tmp_path: Path) -> None:
    recording = growing_machine(12.0)  # the tool goes up by 12 um per kelvin
    assert exported(tmp_path, recording, "klipper") == 0
    text = (tmp_path / "out" / "tc_thermal.cfg").read_text()
    coefficient = float(re.findall(r"^temp_coeff: (.*)$", text, re.M)[0])
    assert coefficient == pytest.approx(0.012, rel=0.01)
    assert klipper(text)(np.array([30.0]), 20.0) == pytest.approx(-120.0, rel=0.01)
    assert text.startswith(
        "# z_um: accepted on unseen cycles; reduced to a form that the controller supports\n# z_um: RMS 0."
    )
    for words in (
        "max_z_adjustment: 0.5\n",
        "sensor_type: FILL_IN",
        "sensor_pin: FILL_IN",
        "smooth_time:",
        "2026-01-31",
    ):
        assert words in text
    check(tmp_path, recording)


def test_a_machine_that_shrinks_is_raised(tmp_path: Path) -> None:
    recording = growing_machine(-4.0, t3_C=0.5)
    assert exported(tmp_path, recording, "klipper", "--most-loss", "10") == 0
    assert re.search(r"^temp_coeff: -0\.00[34]", (tmp_path / "out" / "tc_thermal.cfg").read_text(), re.M)
    assert "up (away from the bed)" in " ".join((tmp_path / "out" / "tc_thermal.md").read_text().split())
    check(tmp_path, recording)


def test_the_vectors_hold_and_find_a_mistake(tmp_path: Path) -> None:
    texts = write_klipper([as_it_is(growing("z_um", 12.0), "Z")], Limits(), "tc", FACTS)
    for name, text in texts.items():
        (tmp_path / name).write_bytes(text)
    with (tmp_path / "tc_vectors.csv").open(newline="") as file:
        rows = [{k: float(v) for k, v in row.items()} for row in csv.DictReader(file)]
    adjust = klipper(texts["tc.cfg"].decode())
    for row in rows:
        assert adjust(np.array(row["now_degC"]), row["homing_degC"]) == pytest.approx(row["adjustment_um"], abs=0.01)
    now = [r["now_degC"] for r in rows]
    assert min(now) < -30 < 70 < max(now)  # trained from -30 to 70 degC
    assert {abs(r["adjustment_um"]) for r in rows} >= {500.0, 0.0}
    line = [sys.executable, str(tmp_path / "tc_check.py")]
    assert subprocess.run(line, check=True, capture_output=True, text=True).stdout.startswith(
        f"{len(rows)} vectors, 0 wr"
    )
    other = tmp_path / "printer.cfg"
    other.write_text(texts["tc.cfg"].decode().replace("temp_coeff: 0.012", "temp_coeff: -0.012"))
    assert subprocess.run([*line, str(other)], check=False, capture_output=True).returncode == 1


def test_what_klipper_does_not_take() -> None:
    with pytest.raises(InputError, match=r"one .z_thermal_adjust., but there are z_um, z2_um"):
        write_klipper([as_it_is(growing(t, 1.0), "Z") for t in ("z_um", "z2_um")], Limits(), "tc", FACTS)
    with pytest.raises(InputError, match="at most 1 mm/K"):
        write_klipper([as_it_is(growing("z_um", 1200.0), "Z")], Limits(), "tc", FACTS)


def test_a_sensor_of_the_cold_has_limits_that_klipper_takes() -> None:
    model = growing("z_um", 2.0)
    cold = replace(model, inputs=(replace(model.inputs[0], reference=-260.0, low=0.0, high=10.0),))
    text = write_klipper([as_it_is(cold, "Z")], Limits(), "tc", FACTS)["tc.cfg"].decode()
    assert "min_temp: -273\n" in text  # Klipper: at least -273.15
