"""``thermocomp revise`` refuses what it cannot do safely, and leaves nothing behind."""

from dataclasses import replace
from pathlib import Path

import pytest
from driftmodels import lags
from reviseruns import HONEST, PLATE, judged, revise, said, table, write_models

from thermocomp.core.model import ErrorModel

# -- refusals --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("program", "message"),
    [
        ("G90\nG0 X1\nM2\n", "part.ngc: line 2: X1 before G20 or G21: inches or millimetres?"),
        ("G90\nG0 X1\nM2\n", "state which unit the control starts with (--units)"),
        ("G21\nM3\nG0 X1\nM2\n", "part.ngc: line 2: M3 without a spindle speed"),
        (
            "G21\nG0 X1\nG1 X2 F100\nM2\n",
            "part.ngc: line 3: the program cuts, but has not set the spindle speed",
        ),
        ("G21 S100 M3\nG0 X1\nG77 X2\nM2\n", "part.ngc: line 3:"),  # unknown code
        ("G21 S100 M3\nG0 X1\nM123\nM2\n", "part.ngc: line 3:"),
        ("G21 S100 M3\no1 while [#1 LT 3]\no1 endwhile\nM2\n", "--expand lets the interpreter unroll"),
        ("0 BEGIN PGM T MM\n1 L X+1 R0 FMAX\n", "part.ngc: this is Heidenhain Klartext"),
        ("", "part.ngc: the file is empty"),
        ("(nothing)\n\0\n", "part.ngc: the file is binary"),
    ],
)
def test_programs_that_are_refused(
    job_folder: Path, program: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("part.ngc").write_bytes(program.encode("latin-1"))
    before = set(job_folder.iterdir())
    assert revise() == 2
    assert message in said(capsys)
    assert set(job_folder.iterdir()) == before


def test_what_the_program_does_not_say_can_be_given(job_folder: Path) -> None:
    Path("part.ngc").write_text("G0 X1 Z5\nM3\nG1 Z2 F100\nM5\nM2\n", encoding="ascii")
    assert revise() == 2
    assert revise("--units", "inch", "--speed", "3000 1/min", "--tolerance", "0.01 um") == 0
    assert {float(r["drift_z_um"]) > 0 for r in table()[2:3]} == {True}


def test_a_revised_program_is_not_revised_again(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert revise() == 0
    assert revise(program="out.ngc", out="twice.ngc") == 2
    assert "out.ngc: line 2: has been revised by thermocomp already" in said(capsys)
    assert not [p for p in job_folder.iterdir() if p.name.startswith(("twice", "."))]


@pytest.mark.parametrize("name", ["out.ngc", "out.ngc.diff", "out.ngc.csv", "out.ngc.job.json"])
def test_nothing_is_written_over(job_folder: Path, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path(name).write_text("precious", encoding="ascii")
    before = set(job_folder.iterdir())
    assert revise() == 2
    assert f"{name}: the file exists already" in said(capsys)
    assert Path(name).read_text(encoding="ascii") == "precious"
    assert set(job_folder.iterdir()) == before
    assert revise("--overwrite") == 0
    assert Path(name).read_text(encoding="latin-1") != "precious"


def test_the_program_is_never_written_over(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert revise("--overwrite", out="part.ngc") == 2
    assert "is also an input" in said(capsys)
    assert Path("part.ngc").read_text(encoding="ascii") == PLATE
    assert revise("--overwrite", program="gone.ngc") == 2
    assert "gone.ngc: no such file" in said(capsys)


@pytest.mark.parametrize("number", ["O2001 (PART)", ":12"])
def test_whose_a_program_with_a_number_is_has_to_be_said(
    job_folder: Path, capsys: pytest.CaptureFixture[str], number: str
) -> None:
    """A dwell of 3 s is one of 50 min otherwise."""
    program = f"%\n{number}\nG21 G90 G17 G94\nT1 M6\nS4000 M3\nG0 G54 X0. Y0. Z5.\nG4 P3000\nG1 Z-1. F300.\nM30\n%\n"
    Path("part.nc").write_text(program, encoding="ascii")
    assert revise(program="part.nc", out="out.nc", dialect=False) == 2
    assert f"line 2: '{number}' is the beginning of a Fanuc's or Haas's program: give --controller fanuc" in said(
        capsys
    )
    assert revise("--controller", "fanuc", program="part.nc", out="out.nc") in (0, 1)


def test_a_cut_with_a_standing_spindle_is_told(job_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("bad.ngc").write_text(PLATE.replace("S6000 M3", "S6000 M5"), encoding="ascii")
    assert revise(program="bad.ngc") == 0
    Path("bad.ngc").write_text(PLATE.replace("G1 Z-1", "M5\nG1 Z-1"), encoding="ascii")
    assert revise("--overwrite", program="bad.ngc") in (0, 1)
    assert "the spindle is stopped at line 9, but the tool moves at feed rate: check the program" in " ".join(
        capsys.readouterr().out.split()
    )


def test_a_refusal_leaves_an_earlier_run_as_it_was(job_folder: Path) -> None:
    assert revise() == 0
    first = {p.name: p.read_bytes() for p in job_folder.iterdir()}
    Path("bad.ngc").write_text(PLATE.replace("G80", "G77"), encoding="ascii")
    assert revise("--overwrite", program="bad.ngc") == 2
    Path("bad.ngc").unlink()
    assert {p.name: p.read_bytes() for p in job_folder.iterdir()} == first


@pytest.mark.parametrize(
    ("model", "options", "message"),
    [
        (replace(lags("z_um"), honest_error=replace(HONEST, verdict="refused", reason="harm")), [], "was refused"),
        (judged(lags("z_um", room=True)), [], "needs t3_C, a temperature: it is not driven by the speed alone"),
        (judged(lags("height_um")), [], "does not state which axis it is; give --axis height_um=Z, or --axis"),
        (judged(lags("y1_um")), [], 'give --axis y1_um=Y, or --axis "y1_um=Y at Z 200 mm"'),
        (judged(lags("X_probe")), [], "give --axis X_probe=X, or --axis"),
        (judged(lags("yaw")), [], "give --axis yaw=Z, or --axis"),
        (judged(lags("z_um")), ["--axis", "zz=Z"], "there is no model of 'zz'"),
        (judged(lags("z_um")), ["--constant", "t3=20degC"], "driven by the spindle speed alone"),
        (judged(lags("z_um")), ["--origin", "G60=1 mm, 2 mm, 3 mm"], "expected a work coordinate system"),
        (judged(lags("z_um")), ["--origin", "G54=1 mm, 2 mm"], "expected X, Y and Z"),
        (judged(lags("z_um")), ["--tool", "one=1 mm"], "expected the number of a tool"),
        (judged(lags("z_um")), ["--harmless", "M88"], "LinuxCNC has no such code; user-defined codes are M100 to M199"),
        (
            judged(lags("z_um")),
            ["--harmless", "M3"],
            "M3 is a known code (spindle on, clockwise), whose effect is taken",
        ),
        (judged(lags("z_um")), ["--tolerance", "0 um"], "must be positive"),
        (judged(lags("z_um")), ["--largest", "5 um"], "more than 5 um is not plausible as thermal drift"),
        (judged(lags("z_um")), ["--every", "10"], "write a value with its unit, such as"),
        (judged(lags("z_um")), ["--speed", "6 mm"], "--speed '6 mm': unit 'mm' measures"),
        (judged(lags("z_um")), ["--date", "today"], "write year-month-day"),
        (
            judged(lags("z_um")),
            ["--method", "offset"],
            "G52, which cancels a G92 or G52 that is in force when the program",
        ),
        (
            judged(lags("z_um")),
            ["--method", "offset"],
            "make sure that none is, and give --no-g92; or use --method coord",
        ),
        (judged(lags("z_um")), ["--rotation", "G54=12"], "--rotation 'G54=12': write an angle in degrees, such as"),
        (
            judged(lags("z_um")),
            ["--rotation", "none", "G54=1 deg"],
            "--rotation 'none': expected a work coordinate system",
        ),
        (
            judged(lags("z_um")),
            ["--rotation", "G60=1 deg"],
            "--rotation 'G60=1 deg': expected a work coordinate system",
        ),
        (judged(lags("z_um")), ["--controller", "fanuc", "--expand", "--diameter", "1=8 mm"], "are for LinuxCNC"),
        (judged(lags("z_um")), ["--machine", "gone.toml"], "gone.toml"),
    ],
)
def test_models_and_options_that_are_refused(
    job_folder: Path, model: ErrorModel, options: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    write_models([model], "other.json")
    before = set(job_folder.iterdir())
    assert revise("--model", "other.json", *options) == 2
    assert message in said(capsys)
    assert set(job_folder.iterdir()) == before
