"""`thermocomp iso230`: tables for people, JSON for programs, a page, clear refusals, and the page of the docs."""

import json
import re
from pathlib import Path

import pandas as pd
import pytest

from thermocomp.cli.app import run
from thermocomp.core.exceptions import InputError
from thermocomp.iso230.verbs import length

DOCS = Path(__file__).resolve().parents[2] / "docs"
POSITIONING = DOCS / "files" / "positioning.csv"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("iso230")
    for experiment, name in (("iso230-spindle", "spindle.csv"), ("iso230-axis", "axis.csv"), ("etve", "etve.csv")):
        assert run(["simulate", experiment, "-o", str(path / name)]) == 0
    return path


def test_a_spindle_test_for_people_and_programs(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = ["iso230", str(folder / "spindle-1.csv"), "--distance", "100 mm"]
    page = folder / "spindle.html"
    assert run([*line, "-o", str(page), "--details"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "Thermal distortion caused by the rotating spindle" in said
    assert "spindle at 2600 1/min; 4 h, cool-down 2 h; surroundings (t_air_C)" in said
    assert "y1_um and y2_um 100 mm apart" in said
    assert page.name in said
    assert run([*line, "-o", str(page)]) == 2  # not overwritten without being asked
    assert "exists already" in capsys.readouterr().err
    assert run([*line, "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    (test,) = content["thermal"]
    assert (test["test"], test["running_s"], test["duration_s"]) == ("spindle", 14400, 21600)
    curves = {c["name"]: c for c in test["curves"]}
    assert list(curves) == ["x1_um", "x2_um", "y1_um", "y2_um", "z_um", "A", "B"]
    assert f"{curves['z_um']['range_60']:.2f}" in said
    assert [(p["tilt"], p["distance"]) for p in test["pairs"]] == [("A", 100), ("B", 100)]
    assert {c["phase"] for c in content["time_constants"][0]["channels"]} == {"warm-up", "cool-down"}


def test_the_kind_of_test_is_found_out_or_told(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = [str(folder / name) for name in ("spindle-2.csv", "axis-3.csv", "etve.csv")]
    assert run(["iso230", *files, "--json"]) == 0
    assert [t["test"] for t in json.loads(capsys.readouterr().out)["thermal"]] == ["spindle", "axis", "etve"]
    assert run(["iso230", files[0], "--test", "etve", "--ambient", "t_coolant_C", "--json"]) == 0
    (test,) = json.loads(capsys.readouterr().out)["thermal"]
    assert test["test"] == "etve"
    assert test["ambient"]["channel"] == "t_coolant_C"
    assert any("moves" in note for note in test["notes"])


def test_stations_of_profiles_are_counted_not_listed(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As in the recordings of thermocomp simulate volumetric: 18 errors at a dozen stations each."""
    recorded = pd.read_csv(folder / "spindle-1.csv", comment="#")
    z = next(c for c in recorded.columns if c.startswith("z_um"))
    for code in ("EXX", "EYX", "EZX"):
        for p in range(0, 700, 50):
            recorded[f"{code}_{p}_um"] = recorded[z]
    path = folder / "stations.csv"
    recorded.to_csv(path, index=False)
    assert run(["iso230", str(path), "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    (test,) = content["thermal"]
    assert any(note.startswith("42 channels are stations of error profiles (EXX, EYX, EZX)") for note in test["notes"])
    told = {c["name"] for c in test["curves"]} | {c["channel"] for c in content["time_constants"][0]["channels"]}
    assert any(name.startswith("z_um") for name in told)
    assert not [name for name in told if name.startswith("E")]


def test_pairs_of_other_names(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = ["iso230", str(folder / "etve.csv"), "--json"]
    assert run([*line, "--pairs", "y1:y2:0.1m"]) == 0
    named = json.loads(capsys.readouterr().out)["thermal"][0]
    assert named["pairs"] == [{"tip": "y1_um", "spindle": "y2_um", "distance": 100.0, "tilt": "A"}]
    assert run([*line, "--distance", "100mm"]) == 0
    by_distance = json.loads(capsys.readouterr().out)["thermal"][0]
    tilts = [next(c for c in t["curves"] if c["name"] == "A") for t in (named, by_distance)]
    assert tilts[0] == tilts[1]


def test_with_a_model(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = folder / "model.json"
    fitted = ["fit", str(folder / "spindle-1.csv"), "--target", "z_um", "--split", "0.6/0.4", "--model", "mra"]
    assert run([*fitted, "-o", str(model), "--jobs", "1"]) in (0, 1)
    capsys.readouterr()
    assert run(["iso230", str(folder / "spindle-2.csv"), "--model", str(model), "--json"]) == 0
    curves = json.loads(capsys.readouterr().out)["thermal"][0]["curves"]
    (z,) = [c for c in curves if c["with_model"]]
    assert z["name"] == "z_um"
    assert z["with_model"]["range_run"] < 0.6 * z["range_run"]
    assert run(["iso230", str(folder / "spindle-1.csv"), "--model", str(model), "--details"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "z_um, with model" in said
    assert "fitted to this recording" in said


def test_positioning(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / "positioning.html"
    assert run(["iso230", "--positioning", str(POSITIONING), "-o", str(page), "--details"]) == 0
    said = capsys.readouterr().out
    assert "Axis Y: accuracy, repeatability, reversal [um]" in said
    assert page.exists()
    assert run(["iso230", "--positioning", str(POSITIONING), "--json"]) == 0
    cold, warm = json.loads(capsys.readouterr().out)["positioning"]
    assert (cold["state"], warm["state"]) == ("cold", "after 4 h")
    assert cold["runs"] == {"+": 5, "-": 5}
    assert f"{warm['values']['A']:.4g}" in said


def test_refusals(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    spindle, axis = str(folder / "spindle-1.csv"), str(folder / "axis-1.csv")
    model = tmp_path / "no.json"
    for arguments, told in (
        ([], "no input given"),
        (["--positioning", str(POSITIONING), "--distance", "100 mm"], "--distance applies to recordings"),
        ([spindle, "--distance", "100"], "--distance '100': write a number and its unit, such as \"100 mm\""),
        ([spindle, "--distance", "100 kg"], "--distance '100 kg': unknown unit"),
        ([spindle, "--distance", "0 mm"], "must be positive"),
        ([spindle, "--distance", "9 mm", "--pairs", "x1:x2:9mm"], "--pairs specifies its own distances"),
        ([axis, "--distance", "9 mm"], "has no probes named x1 and x2, or y1 and y2"),
        ([spindle, "--pairs", "x1:x2"], "write the probe at the tip"),
        ([spindle, "--pairs", "x1:x9:9mm"], "no channel is named 'x9'"),
        ([spindle, "--pairs", "x1:y2:9mm"], "whose names begin with that letter"),
        ([spindle, "--ambient", "t_moon_C"], "no channel is named 't_moon_C'"),
        ([spindle, "--model", str(model)], "no such model file"),
        (["--positioning", spindle], "no column 'deviation'"),
        ([str(tmp_path / "none.csv")], "no such file"),
        ([spindle, "-o", spindle], "is also an input"),
    ):
        assert run(["iso230", *arguments]) == 2, arguments
        assert told in " ".join(capsys.readouterr().err.split()), arguments


@pytest.mark.parametrize(("text", "mm"), [("100 mm", 100), ("0.1m", 100), (" 4 in ", 101.6), (".5 mm", 0.5)])
def test_lengths(text: str, mm: float) -> None:
    assert length(text, "--distance") == pytest.approx(mm)


@pytest.mark.parametrize("text", ["", "mm", "-5 mm", "1e3", "5 degC", "1 2 mm"])
def test_no_lengths(text: str) -> None:
    with pytest.raises(InputError, match="--distance"):
        length(text, "--distance")


def numbers(text: str) -> list[float]:
    return [float(n) for n in re.findall(r"-?\d+\.\d+|(?<![\w.])-?\d+(?![\w.])", text)]


@pytest.mark.parametrize("title", ["Displacements [um]", "Axis X: expansion [um/m]", "Axis Y: accuracy"])
def test_the_documentation_shows_what_is_printed(title: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """If this fails, the virtual machine has changed: paste the new output into docs/iso230.rst."""
    shown = (DOCS / "iso230.rst").read_text(encoding="utf-8")
    command = {
        "Displacements [um]": [str(folder / "spindle-1.csv"), "--distance", "100 mm"],
        "Axis X: expansion [um/m]": [str(folder / "axis-1.csv")],
        "Axis Y: accuracy": ["--positioning", str(POSITIONING)],
    }[title]
    assert run(["iso230", *command, "--details"]) == 0
    printed = capsys.readouterr().out
    there, here = (text.split(title)[1].split("└")[0] for text in (shown, printed))
    assert re.sub(r"[-\d.\s]", "", there) == re.sub(r"[-\d.\s]", "", here)
    assert numbers(there) == pytest.approx(numbers(here), abs=0.5)


def test_what_does_not_go_with_the_test_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = tmp_path / "pos.csv"
    table.write_text("y_mm,deviation_um,direction,run\n0,1,+,1\n", encoding="utf-8")
    assert run(["iso230", str(table)]) == 2
    assert "--positioning" in capsys.readouterr().err
    rest = tmp_path / "rest.csv"
    lines = [f"{60 * k},{20 + 0.01 * k},{0.1 * k}" for k in range(120)]
    rest.write_text("time_s,t_air_C,z_um\n" + "\n".join(lines) + "\n", encoding="utf-8")
    assert run(["iso230", str(rest), "--details"]) == 0
    assert "neither a spindle speed nor a feed was recorded" in " ".join(capsys.readouterr().out.split())
    assert run(["iso230", str(rest), "--test", "spindle", "--details"]) == 0
    assert "the recording shows no turning spindle" in " ".join(capsys.readouterr().out.split())


def test_a_page_has_the_name_of_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["iso230", str(tmp_path / "rest.csv"), "-o", str(tmp_path / "x.txt")]) == 2
    assert "name it" in capsys.readouterr().err
