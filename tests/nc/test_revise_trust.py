"""``thermocomp revise`` tells how far to trust it, and the interpreter proves it."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from driftmodels import lags, static
from reviseruns import HONEST, PLATE, judged, revise, said, table, write_models

from thermocomp.core.polynomial import Polynomial
from thermocomp.core.validity import Validity
from thermocomp.nc.linuxcnc.verification.verify import Proof, prove
from thermocomp.nc.rewrite.header import MARK

# -- how far to trust it ---------------------------------------------------------------------------------------------


def bound(options: Sequence[str], capsys: pytest.CaptureFixture[str]) -> tuple[dict[str, Any], list[str]]:
    capsys.readouterr()
    assert revise(*options, "--json", "--overwrite") == 0
    told = json.loads(capsys.readouterr().out)
    (axis,) = told["axes"]
    return axis, told["warnings"]


def test_a_speed_outside_the_trained_range_widens_the_bound(
    job_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    inside, warnings = bound([], capsys)
    assert not any("outside its range" in w for w in warnings)
    Path("part.ngc").write_text(PLATE.replace("S6000", "S12000"), encoding="ascii")
    outside, warnings = bound([], capsys)
    (warning,) = [w for w in warnings if "outside its range" in w]
    assert "spindle_rpm reached 12000 1/min, and a model was trained from 0 to 6000 1/min" in warning
    assert outside["model_um"] > inside["model_um"] + 5


def test_a_model_that_was_never_judged_does_not_run(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_models([lags("z_um")], "unjudged.json")
    assert revise("--model", "unjudged.json") == 2
    assert "model of z_um was never judged on unseen cycles and will not run" in said(capsys)
    assert not Path("out.ngc").exists()


def test_a_model_that_is_worse_than_the_drift_is_told(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    small = replace(lags("z_um", 0.1), honest_error=replace(HONEST, max_abs=9.6))
    write_models([small], "small.json")
    axis, warnings = bound(["--model", "small.json", "--tolerance", "0.1 um"], capsys)
    said = f"may be wrong by 9.6 um, and the drift in the cuts is {axis['without_um']:.1f} um: revising may not help"
    assert any(said in w for w in warnings)
    _, warnings = bound([], capsys)
    assert not any("may not help" in w or "nothing was corrected" in w for w in warnings)


def test_one_measurement_for_several_places(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_models([judged(lags("z_at_0_um")), judged(lags("z_at_600_um", 0.5))], "along.json")
    options = ["--model", "along.json", "--origin", "G54=0 mm, 0 mm, 0 mm", "--json", "--overwrite"]
    for given, first in [("z=12um", 16.0), ("z_at_600_um=6um", 12.0)]:
        assert revise(*options, "--measured", given, start="") == 0
        assert any("Z was measured once" in w for w in json.loads(capsys.readouterr().out)["warnings"])
        assert float(table()[0]["drift_z_um"]) == pytest.approx(first, abs=1e-3)


def test_temperatures_can_be_given(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    heated = judged(lags("z_um", room=True))
    write_models([heated], "room.json")
    assert revise("--model", "room.json", "--constant", "t3=20degC", "--overwrite") == 2
    assert "will not stay constant while this program runs" in said(capsys)
    known = Validity(4, 4, 0.5, (), (10.0, 30.0), "t3_C", None, 1, 9.0)
    Path("room.json").unlink()
    write_models([replace(heated, validity=known)], "room.json")
    still, warnings = bound(["--model", "room.json", "--constant", "t3=20degC"], capsys)
    assert not any("speed alone" in w for w in warnings)
    Path("room.csv").write_text("time_min,t3_C,other_C\n0,20,1\n10,23,1\n", encoding="ascii")
    assert revise("--model", "room.json", "--forecast", "room.csv", "--json", "--overwrite") == 0
    told = json.loads(capsys.readouterr().out)
    assert told["axes"][0]["drift_high_um"] > still["drift_high_um"] + 1
    assert any("the forecast of t3_C ends before the program" in w for w in told["warnings"])
    assert "room.csv: other_C is no input of the models" in told["notes"]
    given = ["--model", "room.json", "--forecast", "room.csv", "--constant", "t3=20degC"]
    assert revise(*given, "--overwrite") == 2
    assert "t3_C is also given by --constant" in said(capsys)


def test_who_takes_an_unproven_model_stands_in_the_program(
    job_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    honest = replace(HONEST, verdict="unproven", reason="judged on 2 units", harm_margin=20.0)
    write_models([replace(judged(lags("z_um")), honest_error=honest)], "trial.json")
    given = ["--model", "trial.json", "--overwrite"]
    assert revise(*given) == 2
    assert "is unproven and runs in shadow only: judged on 2 units" in said(capsys)
    assert not Path("out.ngc").exists()
    assert revise(*given, "--accept-unproven", "") == 2
    assert "expected a name and a reason" in said(capsys)
    assert revise(*given, "--accept-unproven", "M. Weber, trial on machine 7", "--json") == 0
    assert f"({MARK} unproven, approved by M. Weber, trial on machine 7)" in Path("out.ngc").read_text(encoding="ascii")
    warnings = json.loads(capsys.readouterr().out)["warnings"]
    assert any("Approved by M. Weber, trial on machine 7" in w for w in warnings)
    assert "the model of Z was judged with a harm margin set by the user, 20 um" in warnings


def test_models_along_an_axis(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_models([judged(lags("a_um")), judged(lags("b_um", 2.0))], "along.json")
    along = ["--model", "along.json", "--axis", "a=Z at Z 0 mm", "b=Z at Z 40 mm", "--origin", "G54=0 mm, 0 mm, 0 mm"]
    axis, warnings = bound(along, capsys)
    assert axis["axis"] == "Z"
    assert any("Z was corrected at up to 10.0 mm beyond its outermost station" in w for w in warnings)
    rows = table()
    assert float(rows[11]["drift_z_um"]) > 1.5 * float(rows[10]["drift_z_um"])


def test_a_machine_file_tells_the_times(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    head = 'structure = "w X\' b Z Y (C1) t"\n'
    slow = 'travel = ["-500 mm", "500 mm"]\nrapid = "1 m/min"\nacceleration = "0.5 m/s2"\n'
    text = head + "".join(f"[axes.{name}]\n{slow}" for name in "XYZ")
    Path("mill.toml").write_text(text, encoding="ascii")
    assert revise("--json") == 0
    fast = json.loads(capsys.readouterr().out)
    assert revise("--machine", "mill.toml", "--tool-change", "30 s", "--json", "--overwrite") == 0
    told = json.loads(capsys.readouterr().out)
    assert told["run_time_s"] > fast["run_time_s"] + 2 * 22
    assert told["notes"] == []
    Path("mill.toml").write_text(text.replace('acceleration = "0.5 m/s2"\n', "", 1), encoding="ascii")
    assert revise("--machine", "mill.toml", "--json", "--overwrite") == 0
    (note,) = json.loads(capsys.readouterr().out)["notes"]
    assert "no acceleration of X: assumed to be 3 m/s2" in note
    assert "rapid" not in note
    bare = "".join(f"[axes.{name}]\ntravel = ['-500 mm', '500 mm']\n" for name in "YXZ")
    Path("mill.toml").write_text(head + bare.replace("[axes.Y]", "[axes.Y]\nrapid = '9 m/min'"), encoding="ascii")
    assert revise("--machine", "mill.toml", "--json", "--overwrite") == 0
    rapid, acceleration = json.loads(capsys.readouterr().out)["notes"]
    assert "no rapid of X, Z: assumed to be 30 m/min" in rapid
    assert "no acceleration of X, Y, Z: assumed to be 3 m/s2" in acceleration


def test_a_cut_outside_the_travel_is_told(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    head = 'structure = "w X\' b Z Y (C1) t"\n'
    text = head + "".join(f"[axes.{name}]\ntravel = ['-500 mm', '500 mm']\n" for name in "XYZ")
    Path("mill.toml").write_text(text, encoding="ascii")

    def outside(*options: str) -> list[str]:
        _, warnings = bound(["--machine", "mill.toml", *options], capsys)
        return [w for w in warnings if "outside its travel" in w]

    assert outside("--origin", "G54=0 mm, 0 mm, -480 mm") == []
    assert outside("--origin", "G54=400.5 mm, 0 mm, 0 mm") == []  # by half a millimetre
    (said,) = outside("--origin", "G54=450 mm, 0 mm, 0 mm")
    assert "X goes to 550 mm at line 9, in machine coordinates: outside its travel, -500 to 500 mm; check" in said
    Path("part.ngc").write_text(PLATE.replace("G1 Z-1 F300", "G1 Z-200000 F300"), encoding="ascii")
    assert outside() == []  # nobody knows where G54 begins
    assert outside("--origin", "G55=0 mm, 0 mm, 0 mm") == []
    (said,) = outside("--origin", "G54=0 mm, 0 mm, 0 mm")
    assert "Z goes to -200000 mm at line 8" in said
    Path("part.ngc").write_text(PLATE.replace("Z2\nG1 Z-1", "G43 H1 Z2\nG1 Z-501.5"), encoding="ascii")
    assert outside("--origin", "G54=0 mm, 0 mm, 0 mm") == []  # nor how long the tool is
    (said,) = outside("--origin", "G54=0 mm, 0 mm, 0 mm", "--tool", "1=0 mm")
    assert "Z goes to -501.5 mm" in said


def test_a_fanuc_program(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    program = (
        "%\nO1234\nG21 G90 G17 G94\nT1 M6\nS4000 M3\nG0 G54 X0. Y0. Z50.\nG1 Z-1. F300.\nX100. F50.\nG0 Z50.\nM30\n%\n"
    )
    Path("50%.nc").write_bytes(program.replace("\n", "\r\n").encode("ascii"))
    Path("odd.nc").write_text(
        program.replace("G0 Z50.\nM30", "G92 Z50.\nG92.1 X0 Y0 Z0\nG52 Z0\nM30"), encoding="ascii"
    )
    before = set(job_folder.iterdir())
    assert revise("--controller", "fanuc", program="odd.nc", out="out.nc", proved=True) == 2
    assert "line 11 cannot be translated for LinuxCNC: G92 with G52" in said(capsys)
    assert set(job_folder.iterdir()) == before
    assert revise("--controller", "fanuc", program="50%.nc", out="out.nc") == 0
    assert "but no interpreter has verified it (--unproved)" in " ".join(capsys.readouterr().out.split())
    lines = Path("out.nc").read_bytes().decode("ascii").split("\r\n")
    assert lines[:2] == ["%", "O1234"]
    header = [line for line in lines if MARK in line]
    assert lines[2 : 2 + len(header)] == header
    assert all(line.startswith(f"({MARK} ") and line == line.upper() and "%" not in line for line in header)
    assert f"({MARK} UNPROVED: NO INTERPRETER HAS VERIFIED IT)" in header
    words = [w for line in lines[2 + len(header) :] for w in line.split() if w.startswith("Z-")]
    assert words
    assert all(len(w.partition(".")[2]) <= 3 for w in words)


@pytest.mark.usefixtures("interpreter")
def test_a_fanuc_program_is_proved(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    program = (
        "%\nO1234\nG21 G90 G17 G94\nG0 G91 G28 Z0.\nT1 M6\nS4000 M3\nG90 G0 G54 X0. Y0.\nG43 H1 Z50.\nG1 Z0. F30.\n"
        "M98 P100 L2\nG90 G0 Z50.\nM30\nO100\nG91 Z-1.\nG90 X100.\nX0.\nM99\n%\n"
    )
    Path("part.nc").write_text(program, encoding="ascii")
    assert revise("--controller", "fanuc", "--expand", program="part.nc", out="out.nc", proved=True) == 0
    assert "in 8 controller states" in " ".join(capsys.readouterr().out.split())
    assert "UNPROVED" not in Path("out.nc").read_text("ascii")
    assert "IN 8 CONTROLLER STATES" in Path("out.nc").read_text("ascii")


def test_a_fanuc_program_is_written_out(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    program = (
        "%\nO1234\nG21 G90 G17 G94\nT1 M6\nS4000 M3\nG0 G54 X0. Y0. Z50.\nG1 Z0. F30.\nM98 P100 L2\n/X0.\n"
        "G90 G0 Z50.\nM30\nO100\nG91 Z-1.\nG90 X{}\nM99\n%\n"
    )
    Path("part.nc").write_text(program.format("100."), encoding="ascii")
    assert revise("--controller", "fanuc", program="part.nc", out="out.nc") == 2
    assert "line 8: M98 (subprogram call): subprograms are not supported; --expand writes it" in said(capsys)
    assert revise("--controller", "fanuc", "--expand", program="part.nc", out="out.nc") == 0
    plain = Path("out.nc.expanded").read_text("ascii").splitlines()
    assert plain[6:13] == ["G1 Z0. F30.", "G91 Z-1.", "G90 X100.", "G91 Z-1.", "G90 X100.", "/X0.", "G90 G0 Z50."]
    assert "M98" not in Path("out.nc").read_text("ascii")
    assert Path("out.nc").read_text("ascii").count("\nG91 Z-1.") == 2
    Path("part.nc").write_text(program.format("#500"), encoding="ascii")
    assert revise("--controller", "fanuc", "--expand", "--overwrite", program="part.nc", out="out.nc") == 2
    assert "line 14: the value of X: " in said(capsys)


def test_a_model_without_memory_follows_the_speed(job_folder: Path) -> None:
    model = judged(static("z_um"))
    assert isinstance(model, Polynomial)
    write_models([model], "static.json")
    assert revise("--model", "static.json", "--tolerance", "0.5 um") == 0
    assert {round(float(r["drift_z_um"]), 1) for r in table()} >= {0.0, 4.0, 6.0}


# -- the interpreter -------------------------------------------------------------------------------------------------

interpreter = pytest.mark.usefixtures("interpreter")


@interpreter
@pytest.mark.parametrize("method", ["coordinates", "offset"])
def test_the_interpreter_proves_it(job_folder: Path, method: str, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--no-g92", "--safe-z", "20 mm"] if method == "offset" else []
    assert revise("--method", method, *options, "--json", proved=True) == 0
    proof = json.loads(capsys.readouterr().out)["proof"]
    assert proof["moves"] > 12
    assert proof["largest_um"] < 1e-3


@interpreter
def test_what_the_interpreter_does_not_run_is_told(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("part.ngc").write_text(PLATE.replace("T2 M6", "T99999 M6"), encoding="ascii")
    before = set(job_folder.iterdir())
    assert revise(proved=True) == 2
    message = said(capsys)
    assert (
        "part.ngc: the revised program cannot be proved: LinuxCNC's interpreter does not run the original: line 14: "
        in message
    )
    assert message.endswith("; --unproved writes it anyway, and its header states this")
    assert set(job_folder.iterdir()) == before


@interpreter
def test_a_wrong_move_is_found_and_nothing_is_written(
    job_folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The last line of defence: a program that was spoilt behind all other checks."""
    asked = prove

    def spoil(original: Path, revised: Path, *others: Any) -> Proof:
        revised.write_bytes(revised.read_bytes().replace(b"\nX20", b"\nX21"))
        return asked(original, revised, *others)

    monkeypatch.setattr("thermocomp.nc.revision.job.prove", spoil)
    before = set(job_folder.iterdir())
    assert revise(proved=True) == 2
    assert "part.ngc: line 18: LinuxCNC's interpreter disagrees: it moves X by 1000.00 um instead of 0.00 um" in said(
        capsys
    )
    assert set(job_folder.iterdir()) == before


@interpreter
def test_loops_are_unrolled_where_asked(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    loop = (
        "G21 G90 G17 G54 G94\nS4000 M3\nG0 X0 Y0 Z5\n#1=0\no1 while [#1 LT 3]\nG1 Z-1 F100\nX[10+#1] F50\nG0 Z5\n"
        "#1=[#1+1]\no1 endwhile\nM5\nM2\n"
    )
    Path("part.ngc").write_text(loop, encoding="ascii")
    assert revise() == 2
    assert revise("--expand", "--json", proved=True) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["proof"]["moves"] >= 10
    assert told["files"]["expanded"] == "out.ngc.expanded"
    assert "X12" in Path("out.ngc.expanded").read_text(encoding="ascii")
    assert any("Z-1.0" in line for line in Path("out.ngc").read_text(encoding="ascii").splitlines())
