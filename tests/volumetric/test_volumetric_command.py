"""``thermocomp volumetric``: errors told by hand, tables for people, numbers for programs, clear refusals."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from smallmachine import small_machine
from smallmill import DRIFT, SLOPE, SQUARENESS, write_mill

from thermocomp.cli.app import run

HEAT = small_machine().table["t1_C"].to_numpy()
HEAT = HEAT - HEAT[0]


@pytest.fixture
def mill(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[str, str]:
    monkeypatch.setenv("COLUMNS", "80")
    machine, recording = write_mill(tmp_path)
    return str(machine), str(recording)


def asked(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, Any]:
    assert run(["volumetric", *arguments, "--json"]) == 0
    content: dict[str, Any] = json.loads(capsys.readouterr().out)
    return content


def test_the_error_at_a_point_is_what_the_models_say(mill: tuple[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    machine, recording = mill
    found = asked(capsys, machine, "--recording", recording, "--at", "450", "-100", "50")
    x = SLOPE * HEAT * 0.45 + 0.5 + SQUARENESS * 0.1
    error = np.array(found["course"]["error_um"])
    np.testing.assert_allclose(error, np.column_stack([x, 0 * HEAT, DRIFT * HEAT]), atol=1e-9)
    np.testing.assert_allclose(found["course"]["tilt_urad"], np.tile([0.0, 5.0, 0.0], (len(HEAT), 1)), atol=1e-12)
    largest = int(np.argmax(np.linalg.norm(error, axis=1)))
    assert [s["state"] for s in found["states"]] == ["start", "largest", "end"]
    assert found["states"][1]["time_h"] == pytest.approx(largest / 60)
    first, second, third = found["states"][1]["contributions"][:3]
    assert (first["code"], second["code"], third["code"]) == ("Z0C", "EXX", "C0Y")
    assert first["adds_um"] == pytest.approx([0.0, 0.0, DRIFT * HEAT[largest]])
    assert second["adds_um"] == pytest.approx([SLOPE * HEAT[largest] * 0.45 + 0.5, 0.0, 0.0])
    # Z0C is the same everywhere, EXX depends on X alone: 0, 150, 300, 450, 600 mm by default
    assert first["volume_rms_um"] == pytest.approx(DRIFT * abs(HEAT[largest]))
    exx = SLOPE * HEAT[largest] * np.linspace(0.0, 0.6, 5) + [0.0, 0.5, 1.0, 0.5, 0.0]
    assert second["volume_rms_um"] == pytest.approx(np.sqrt(np.mean(exx**2)))
    assert third["volume_rms_um"] == pytest.approx(SQUARENESS * 0.2 * np.sqrt(0.5))
    total = np.sum([c["adds_um"] for c in found["states"][1]["contributions"]], axis=0)
    np.testing.assert_allclose(total, error[largest], atol=1e-9)
    assert [len(s["contributions"]) for s in found["states"]] == [32] * 3


def test_the_straight_lines_and_what_they_leave(mill: tuple[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    machine, recording = mill
    found = asked(capsys, machine, "--recording", recording, "--grid", "3", "--time", "10", "1.5")
    assert [(s["state"], s["time_h"]) for s in found["states"]] == [("1.50 h", 1.5), ("10.00 h", 10.0)]
    for state, row in zip(found["states"], (90, 600), strict=True):
        x, y, z = state["straight_lines"]
        assert (x["axis"], y["axis"], z["axis"]) == ("X", "Y", "Z")
        assert x["slope_um_per_m"] == pytest.approx(-SLOPE * HEAT[row], abs=1e-6)
        assert x["offset_um"] == pytest.approx(-0.5, abs=0.02)  # the mean of the profile
        assert z["offset_um"] == pytest.approx(-DRIFT * HEAT[row], abs=1e-6)
        assert z["slope_um_per_m"] == pytest.approx(0.0, abs=1e-6)
        assert abs(y["offset_um"]) + abs(y["slope_um_per_m"]) < 1e-3
        # half a um of the profile and what is out of square over +-200 mm
        assert x["left_along_max_um"] == pytest.approx(0.5, abs=0.02)
        assert x["left_volume_max_um"] == pytest.approx(SQUARENESS * 0.2 + 0.5, abs=0.02)
        volume = state["volume"]
        assert {v["points"] for v in volume.values()} == {27}
        dx = SLOPE * HEAT[row] * np.array([0.0, 0.3, 0.6]) + [0.0, 1.0, 0.0]
        before = np.hypot(np.add.outer(dx, SQUARENESS * np.array([-0.2, 0.0, 0.2])), DRIFT * HEAT[row])
        assert volume["nothing"]["max_um"] == pytest.approx(before.max(), rel=1e-3)
        assert volume["nothing"]["rms_um"] == pytest.approx(np.sqrt(np.mean(before**2)), rel=1e-3)
        assert volume["straight lines"]["max_um"] == pytest.approx(SQUARENESS * 0.2 + 0.5, abs=0.02)
        assert volume["everything"]["max_um"] < 0.01
        assert 0 < volume["straight lines"]["rms_um"] < volume["nothing"]["rms_um"]


def test_without_a_recording_constants_and_profiles_are_left(
    mill: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    found = asked(capsys, mill[0], "--at", "300", "100", "0", "--tool-length", "250")
    (state,) = found["states"]
    assert (found["recording"], state["state"]) == (None, "reference state")
    assert found["tool_mm"] == [0.0, 0.0, -250.0]
    # profile, squareness, and the tilt of the spindle by 150 mm more of tool
    assert state["error_um"] == pytest.approx([1.0 - SQUARENESS * 0.1 - 5 * 0.15, 0.0, 0.0])
    told = {c["code"]: c["source"] for c in found["components"]}
    assert len(told) == 32
    assert {c: s for c, s in told.items() if s != "nothing"} == {
        "EXX": "model: profile + k1",
        "Z0C": "model: polynomial",
        "C0Y": "constant",
        "B0C": "constant",
    }
    assert found["never_judged"] == ["EXX", "Z0C"]


def test_for_people(mill: tuple[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    machine, recording = mill
    assert run(["volumetric", machine, "--recording", recording, "--details"]) == 0
    said = capsys.readouterr().out
    assert "Mill [7], w X' b Z Y (C1) t: " in said
    assert "4 of 32 components are known; assumed to be zero: EYX, EZX, EAX" in said
    assert "At X 300, Y 0, Z 250 mm, tool tip at X 0, Y 0, Z -100 mm from the gauge point" in said
    assert "spindle drift in Z" in said
    assert "straight lines" in said
    assert "length of the error at 125 points over the work volume" in said
    assert "never judged on unseen cycles: EXX, Z0C" in said
    assert "Largest error in the work volume" in said
    assert "-0.00" not in said
    tables = [line for line in said.splitlines() if line.startswith(("┃", "│"))]
    assert len(tables) > 30
    assert max(map(len, tables)) <= 80
    assert "…" not in said  # nothing is cut


def test_a_point_alone_or_the_volume_alone(mill: tuple[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["volumetric", mill[0], "--at", "0", "0", "0", "--details"]) == 0
    said = capsys.readouterr().out
    assert "At X 0, Y 0, Z 0 mm" in said
    assert "over the work volume" not in said
    assert run(["volumetric", mill[0], "--grid", "2", "--details"]) == 0
    said = capsys.readouterr().out
    assert "At X" not in said
    assert "volume: RMS in the work volume" in " ".join(said.split())
    assert "at 8 points over the work volume" in said


def test_a_missing_number_holds_the_state(mill: tuple[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    machine, recording = mill
    lines = Path(recording).read_text(encoding="utf-8").splitlines()
    head = next(k for k, line in enumerate(lines) if line.startswith("time_s"))
    cells = lines[head + 301].split(",")
    cells[lines[head].split(",").index("t1_C")] = ""
    lines[head + 301] = ",".join(cells)
    Path(recording).write_text("\n".join(lines) + "\n", encoding="utf-8")
    found = asked(capsys, machine, "--recording", recording, "--at", "0", "0", "0")
    assert found["rows_missing_an_input"] == 1
    error = found["course"]["error_um"]
    assert error[300] == error[299] != error[301]
    assert run(["volumetric", machine, "--recording", recording, "--details"]) == 0
    assert "an input is missing in 1 rows" in capsys.readouterr().out


def test_notes_on_the_machine(mill: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert asked(capsys, mill[0])["notes"] == []
    text, place = Path(mill[0]).read_text(encoding="utf-8"), '["0 mm", "0 mm", "0 mm"]'
    text = text.replace("[axes.X]\n", f"[axes.X]\nmeasured_at = {place}\nmeasured_tool = {place}\n")
    text += 'ECX = "20 urad"\nEYX = {profile = [["0 mm", "0 um"], ["300 mm", "1 um"]]}\n'
    Path(mill[0]).write_text(text, encoding="utf-8")
    twice, held = asked(capsys, mill[0])["notes"]
    assert twice.startswith(
        "ECX is 20 urad at X 0 mm, its position while Y was measured: over the travel of Y it moves"
    )
    assert held.startswith("EYX: its profile is known for X = 0 to 300 mm, but the axis travels from 0 to 600 mm")
    page = tmp_path / "noted.html"
    assert run(["volumetric", mill[0], "-o", str(page), "--details"]) == 0
    said, written = capsys.readouterr().out, page.read_text(encoding="utf-8")
    for note in (twice, held):
        assert f"note {note}" in said
        assert f"<li>{note}.</li>" in written


def test_a_page(mill: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / "page.html"
    assert run(["volumetric", mill[0], "-o", str(page)]) == 0
    assert "Written: " in capsys.readouterr().out
    assert "Volumetric error of Mill [7]" in page.read_text(encoding="utf-8")
    assert run(["volumetric", mill[0], "-o", str(page)]) == 2
    assert "exists already" in capsys.readouterr().err
    assert run(["volumetric", mill[0], "-o", mill[0], "--overwrite"]) == 2
    assert "is also an input" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--at", "0", "201", "0"], "Y 201 mm: outside the travel of Y, -200 to 200 mm"),
        (["--at", "nan", "0", "0"], "X nan mm: outside the travel of X"),
        (["--grid", "1"], "a grid of 1 points along an axis has no extent: expected at least 2"),
        (["--tool-length", "-1"], "--tool-length -1: must not be negative"),
        (["--time", "1"], "the times refer to a recording, but none is given"),
        (["--mapping", "a.toml"], "--mapping applies to a recording"),
        (["--recording", "RECORDING", "--time", "14"], "14 h: outside the recording, 0 to 13.32 h"),
        (["--recording", "no.csv"], "no.csv: no such file"),
    ],
)
def test_what_cannot_be_done_is_said(
    arguments: list[str], message: str, mill: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["volumetric", mill[0], *(mill[1] if a == "RECORDING" else a for a in arguments)]) == 2
    assert message in capsys.readouterr().err


def test_a_recording_that_does_not_fit(mill: tuple[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    machine, recording = mill
    text = Path(recording).read_text(encoding="utf-8")
    for new, message in (
        ("t9_C", "no channel is named 't1_C'; the nearest are t9_C"),
        ("t1_C [um]", "channel 't1_C' is a displacement; the models of Mill [7] need a temperature"),
    ):
        Path(recording).write_text(text.replace("t1_C", new, 1), encoding="utf-8")
        assert run(["volumetric", machine, "--recording", recording]) == 2
        assert message in capsys.readouterr().err
