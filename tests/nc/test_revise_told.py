"""``thermocomp revise`` is told what stands at the controller, and tells the same everywhere."""

import json
from pathlib import Path
from typing import Any

import pytest
from driftmodels import lags
from matplotlib.figure import Figure
from reviseruns import PLATE, judged, revise, said, write_models

from thermocomp.nc.report import revision as pictures
from thermocomp.nc.revision import job as jobs
from thermocomp.nc.rewrite.header import MARK
from thermocomp.nc.rewrite.revise import Revision

MILL = 'structure = "{}"\n' + "".join(f"[axes.{name}]\ntravel = ['-500 mm', '500 mm']\n" for name in "XYZ")
TURNED = PLATE.replace("G0 X0 Y0 Z50\n", "G0 X0 Y0 Z50 A90\n")


@pytest.mark.parametrize(
    ("structure", "message"),
    [
        ("w A' X' b Z Y (C1) t", ""),
        ("w X' b Z Y A (C1) t", "line 6: A is at 90 deg: it is in the head"),
        ("w X' b Z Y (C1) t", "line 6: A is at 90 deg: state whether it turns the spindle or the workpiece"),
    ],
)
def test_the_machine_file_tells_where_rotary_axes_are(
    job_folder: Path, structure: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("part.ngc").write_text(TURNED, encoding="ascii")
    Path("mill.toml").write_text(MILL.format(structure), encoding="ascii")
    assert revise("--machine", "mill.toml") == (2 if message else 0)
    assert message in said(capsys)


@pytest.mark.parametrize(
    ("options", "code"),
    [
        ([], 2),
        (["--rotation", "none"], 0),
        (["--rotation", "G54=0 deg"], 0),
        (["--rotation", "G54=12.5 deg"], 0),
        (["--rotation", "G55=1 deg"], 2),
    ],
)
def test_a_stored_rotation_has_to_be_told_if_x_is_corrected(
    job_folder: Path, options: list[str], code: int, capsys: pytest.CaptureFixture[str]
) -> None:
    write_models([judged(lags("x_um"))], "x.json")
    assert revise("--model", "x.json", *options) == code
    assert ("(--rotation none) or the angle (--rotation 'G54=12 deg')" in said(capsys)) == (code == 2)


def test_where_no_system_is_named_each_may_be_in_force(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_models([judged(lags("x_um"))], "x.json")
    Path("part.ngc").write_text(PLATE.replace(" G54", ""), encoding="ascii")
    assert revise("--model", "x.json", "--rotation", "G54=12.5 deg") == 2
    assert (
        "(--rotation none) or write G54 before the first move, and state the angle (--rotation 'G54=12 deg')"
        in said(capsys)
    )
    assert revise("--model", "x.json", "--rotation", "none", proved=True) == 0
    assert "G92 (in half of them), G98/G99, system in force, origins" in capsys.readouterr().out


def test_table_picture_and_message_tell_one_figure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The drift is uneven along a long line, and arcs hold the correction: most is left within a line."""
    monkeypatch.chdir(tmp_path)
    write_models([judged(lags("z_um", 4.0))], "model.json")
    head, arcs = "G21 G90 G17 G54 G94\nS4000 M3\nG0 X0 Y0 Z5\nG1 Z-1 F50\n", "G2 X0 Y0 I20\nG2 X0 Y0 I90\n"
    Path("part.ngc").write_text(f"{head}{arcs}G1 X900\nX0 F2000\n{arcs}G0 Z5\nM2\n", encoding="ascii")
    drawn: list[Figure] = []
    draw = pictures.draw

    def keep(*given: Any) -> Figure:
        drawn.append(draw(*given))
        return drawn[-1]

    monkeypatch.setattr(pictures, "draw", keep)
    assert revise("--json") == 0
    told = json.loads(capsys.readouterr().out)
    (axis,) = told["axes"]
    left, line = axis["left_um"], axis["left_line"]
    assert left > 1.5
    title = drawn[0].axes[0].get_title("left")
    assert title == (
        f"Z: the tool drifts by up to {axis['drift_high_um']:.1f} um; residual in the cuts at most {left:.1f} um; "
        f"bound {left + 2:.1f} um"
    )
    gaps = [w for w in told["warnings"] if "could not follow" in w]
    assert any(w.endswith(f": {left:.1f} um at line {line}") for w in gaps), gaps
    header = [text for text in Path("out.ngc").read_text(encoding="ascii").splitlines() if MARK in text]
    assert f"({MARK} bound, as assumed: Z {left + 2:.1f} um)" in header
    assert revise("--overwrite") == 0
    row = next(text for text in capsys.readouterr().out.splitlines() if "│ Z" in text)
    assert row.replace("│", " ").split()[4:6] == [f"{left:.2f}", str(line)]


def test_what_another_offset_would_cost_is_told(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_models([judged(lags("z_at_0_um")), judged(lags("z_at_600_um", 0.5))], "along.json")
    options = ["--model", "along.json", "--origin", "G54=0 mm, 0 mm, 300 mm", "--tool", "1=120 mm", "--json"]
    assert revise(*options) == 0
    told = json.loads(capsys.readouterr().out)
    most = told["other_offset_um"]["z"]
    # half of the drift is gone at 600 mm: a sixth of that in 100 mm; at Z 300 three quarters are there
    assert most == pytest.approx(told["axes"][0]["without_um"] / 0.75 * 0.5 / 6, rel=0.05)
    assert told["other_offset_um"]["x"] == 0.0
    sentence = f"100 mm offset change: error up to Z {most:.1f} um"
    assert f"the correction is made for G54 X0 Y0 Z300, T1 120 mm; {sentence}" in told["notes"]
    header = Path("out.ngc").read_text(encoding="ascii").splitlines()
    assert f"({MARK} valid for G54 X0 Y0 Z300, T1 120 mm)" in header
    assert f"({MARK} {sentence})" in header
    Path("part.ngc").write_text(PLATE.replace(" G54", ""), encoding="ascii")
    assert revise(*options, "--overwrite") == 0
    note = f"the correction is made for G54 X0 Y0 Z300, T1 120 mm, G54 in force at the start; {sentence}"
    assert note in json.loads(capsys.readouterr().out)["notes"]


def test_a_refusal_in_a_long_program_comes_before_the_work(
    job_folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("part.ngc").write_text(PLATE.replace("M5\n", "G77\nM5\n"), encoding="ascii")
    monkeypatch.setattr(jobs, "LONG", 100)
    monkeypatch.setattr(Revision, "revise", None)  # whoever gets there fails
    before = set(job_folder.iterdir())
    assert revise() == 2
    assert "part.ngc: line 21: G77 is not a known code" in said(capsys)
    assert set(job_folder.iterdir()) == before


def test_a_long_program_comes_out_as_a_short_one(job_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert revise("--date", "2026-01-31") == 0
    short = Path("out.ngc").read_bytes()
    monkeypatch.setattr(jobs, "LONG", 100)
    assert revise("--date", "2026-01-31", "--overwrite") == 0
    assert Path("out.ngc").read_bytes() == short
