"""`thermocomp export` to controllers that hold less than a model: what is written, and what is refused."""

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest
from driftmodels import ACCEPTED, growing, lags
from poorcontroller import DATE, exported, growing_machine, noisy_machine
from smallmachine import small_machine

from thermocomp.cli.app import run
from thermocomp.core.exceptions import InputError
from thermocomp.core.model import ErrorModel
from thermocomp.files import modelfile
from thermocomp.recordings.readers import recordings

NAMES = ["tc_thermal.md", "tc_thermal_check.py", "tc_thermal_reduced.svg", "tc_thermal_vectors.csv"]
MAIN = {"klipper": "tc_thermal.cfg", "heidenhain": "tc_thermal.txt", "fanuc": "tc_thermal.nc"}
MAIN |= {"haas": "tc_thermal.nc", "okuma": "tc_thermal.SSB"}


def written(folder: Path, *models: ErrorModel) -> str:
    modelfile.write(models, folder / "model.json", overwrite=True)
    return str(folder / "model.json")


@pytest.mark.parametrize("to", MAIN)
def test_the_same_inputs_give_the_same_files(to: str, tmp_path: Path) -> None:
    assert exported(tmp_path, growing_machine(6.0), to, method="dynamic") == 0
    first = {p.name: p.read_bytes() for p in (tmp_path / "out").iterdir()}
    assert sorted(first) == sorted([*NAMES, MAIN[to]])
    line = ["export", str(tmp_path / "model.json"), str(tmp_path / "drift.csv"), "--to", to, *DATE]
    assert run([*line, "-o", str(tmp_path / "again")]) == 0
    assert {p.name: p.read_bytes() for p in (tmp_path / "again").iterdir()} == first
    assert run([*line, "-o", str(tmp_path / "again")]) == 2
    page = first["tc_thermal.md"].decode()
    assert page.startswith("z_um: accepted on unseen cycles; reduced to a form that the controller supports")
    for words in (
        "SHA-256 ",
        "thermocomp 0.",
        "on 2026-01-31",
        "Sign: ",
        "Units: ",
        "**loss**",
        "tc_thermal_reduced.svg",
    ):
        assert words in page
    for title in ("Residual error", "What is lost", "Install", "Check", "Switch off"):
        assert f"## {title}\n" in page
    figure = first["tc_thermal_reduced.svg"].decode()
    assert all(f"{words}: RMS " in figure for words in ("without compensation", "full model", "reduced model"))


def test_a_loss_beyond_the_limit_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert exported(tmp_path, small_machine(), "klipper", targets="z_um x_um", method="dynamic") == 1
    said = capsys.readouterr().out
    assert "refused z_um is left out: loses too much accuracy: RMS 3.54 um on unseen cycles" in said
    assert "x_um is left out: its axis is X, but klipper corrects Z only" in said
    assert not (tmp_path / "out").exists()
    line = ["export", str(tmp_path / "model.json"), str(tmp_path / "drift.csv"), "--to", "klipper", *DATE, "--json"]
    assert run([*line, "-o", str(tmp_path / "out"), "--most-loss", "10"]) == 0  # x_um was not judged badly
    found = json.loads(capsys.readouterr().out)
    assert (len(found["files"]), list(found["refused"])) == (5, ["x_um"])
    assert "8.04 times" in (tmp_path / "out" / "tc_thermal.cfg").read_text()


def test_noise_is_not_exported(tmp_path: Path) -> None:
    assert exported(tmp_path, noisy_machine(0), "klipper") in (1, 2)
    model = written(tmp_path, replace(lags("z_um", room=True), honest_error=ACCEPTED))
    line = ["export", model, str(tmp_path / "drift.csv"), "--to", "klipper", "-o", str(tmp_path / "out"), *DATE]
    assert run([*line, "--most-loss", "1000"]) == 1
    assert not (tmp_path / "out").exists()


def test_what_is_unproven_wants_somebody_who_takes_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    whole = growing_machine(6.0)
    end = whole.cycles[1].stop
    two = replace(whole, table=whole.table[:end], time=whole.time[:end], cycles=whole.cycles[:2])
    assert exported(tmp_path, two, "klipper") == 1
    assert "refused z_um is left out: unproven: " in " ".join(capsys.readouterr().out.split())
    line = ["export", str(tmp_path / "model.json"), str(tmp_path / "drift.csv"), "--to", "klipper", *DATE]
    assert run([*line, "-o", str(tmp_path / "out"), "--accept-unproven", "M. Weber, trial"]) == 0
    lines = (tmp_path / "out" / "tc_thermal.cfg").read_text().splitlines()
    assert lines[0] == "# z_um: UNPROVEN, approved nevertheless; reduced to a form that the controller supports"
    assert lines[1] == "# z_um: unproven, approved by M. Weber, trial"


@pytest.mark.parametrize("to", MAIN)
def test_what_has_the_shape_already_wants_no_recording(to: str, tmp_path: Path) -> None:
    model = written(tmp_path, growing("z_um", 3.0))
    assert run(["export", model, "--to", to, "-o", str(tmp_path / "out"), *DATE]) == 0
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == sorted({*NAMES, MAIN[to]} - {NAMES[2]})
    assert run(["export", model, "--to", to, "-o", str(tmp_path / "other"), "--sensors", "t9_C"]) == 2
    assert "1.00 times" in (tmp_path / "out" / "tc_thermal.md").read_text()
    unproven = replace(growing("z_um", 3.0), honest_error=replace(ACCEPTED, verdict="unproven"))
    assert run(["export", written(tmp_path, unproven), "--to", to, "-o", str(tmp_path / "no"), *DATE]) == 1
    assert not (tmp_path / "no").exists()


def test_recordings_where_they_are_needed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recordings.write(small_machine(), tmp_path / "drift.csv")
    drift, out = str(tmp_path / "drift.csv"), str(tmp_path / "out")
    model = written(tmp_path, replace(lags("z_um"), honest_error=ACCEPTED))

    def told(*words: str) -> str:
        assert run(["export", model, *words, "-o", out]) == 2
        return " ".join(capsys.readouterr().err.split())

    assert "name recordings for its reduction" in told("--to", "klipper")
    assert "c99 exports the whole model and accepts no recordings" in told(drift, "--to", "c99")
    assert "no such temperature" in told(drift, "--to", "klipper", "--sensors", "t9_C")
    assert "--program 0: expected a program number from 1 to 9999" in told(drift, "--to", "haas", "--program", "0")
    assert "--program: klipper does not support this option" in told(drift, "--to", "klipper", "--program", "812")
    assert "--axes z_um: expected a target and X, Y or Z" in told(drift, "--to", "klipper", "--axes", "z_um")
    assert "no such target" in told(drift, "--to", "klipper", "--axes", "ch5_um=Z")


def test_axes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = written(tmp_path, growing("ch1_um", 1.0), growing("ch5_um", 3.0), growing("tilt", 1.0, "urad"))
    line = ["export", model, "--to", "heidenhain", "-o", str(tmp_path / "out"), *DATE]
    assert run(line) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "nothing to write: ch1_um: its axis is not known" in said
    assert "tilt: it predicts urad" in said
    assert not (tmp_path / "out").exists()
    assert run([*line, "--axes", "ch5_um=z"]) == 0
    text = (tmp_path / "out" / "tc_thermal.txt").read_text()
    assert "\nZ formula: <L>+0.003*(W<t>-20)" in text
    assert "ch1_um" not in text
    assert run([*line, "--axes", "ch5_um=z", "ch1_um=Z", "--overwrite"]) == 2
    assert "are all for axis Z: name one target for each axis, such as --axes " in capsys.readouterr().err


def test_a_limit_that_would_be_run_into(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ("klipper", "--magnitude", "60")
    assert exported(tmp_path, growing_machine(6.0), *words, method="dynamic") == 2
    assert "would stop at 60 um: give --magnitude" in " ".join(capsys.readouterr().err.split())


def test_a_recording_without_the_target(tmp_path: Path) -> None:
    model = written(tmp_path, replace(lags("y_um"), honest_error=ACCEPTED))
    recordings.write(small_machine(), tmp_path / "drift.csv")
    line = ["export", model, str(tmp_path / "drift.csv"), "--to", "fanuc", "-o", str(tmp_path / "out")]
    assert run(line) == 2
    with pytest.raises(InputError):
        small_machine().channel("y_um")


@pytest.mark.long
def test_measured_machines(shared_data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A spindle: one sensor is refused, three are unproven. A printer: a night proves nothing, and may be taken."""
    drift, model = str(shared_data / "fl_thermal" / "recording.csv"), str(tmp_path / "fl.json")
    assert run(["fit", drift, "--target", "ch1_um", "--model", "dynamic", "-o", model]) == 0
    line = ["export", model, drift, "--axes", "ch1_um=Z", "--date", "2026-01-31", "-o", str(tmp_path / "fl")]
    assert run([*line, "--to", "klipper"]) == 1
    assert "does harm in 1 (1250 1/min)" in capsys.readouterr().out
    assert run([*line, "--to", "heidenhain"]) == 1
    assert "not shown to be better than no compensation (slow changes removed" in capsys.readouterr().out
    assert run([*line, "--to", "heidenhain", "--accept-unproven", "M. Weber, trial"]) == 0
    assert "1.75 times" in (tmp_path / "fl" / "tc_thermal.txt").read_text()

    mapping = ["--mapping", str(Path(__file__).parents[1] / "recordings" / "voron.toml")]
    night = str(shared_data / "voron_frame" / "frame_exp_quant_v3_2021-06-13_05-41-53.csv")
    model = str(tmp_path / "voron.json")
    assert run(["fit", night, "--target", "z", "--model", "ols", "--split", "0.6/0.4", "-o", model, *mapping]) in (0, 1)
    line = ["export", model, night, *mapping, "--to", "klipper", "--sensors", "frame_t", "--magnitude", "2000"]
    line += ["--date", "2026-01-31", "-o", str(tmp_path / "voron")]
    assert run(line) == 1
    assert run([*line, "--accept-unproven", "M. Weber, trial"]) == 0
    (found,) = re.findall(r"^temp_coeff: (.*)$", (tmp_path / "voron" / "tc_thermal.cfg").read_text(), re.MULTILINE)
    assert float(found) == pytest.approx(-0.01637, rel=1e-3)
