"""`thermocomp export --to linuxcnc`: which axes it moves, what may run, and the same bytes each time."""

from dataclasses import replace
from pathlib import Path

import pytest
from driftmodels import ACCEPTED, growing
from test_export_command import needs_compiler, prove

from thermocomp.cli.app import run
from thermocomp.core.model import ErrorModel
from thermocomp.core.position import PositionModel
from thermocomp.files import modelfile, positionfile

FILES = ["tc_thermal.c", "tc_thermal.h", "tc_thermal.hal", "tc_thermal.md", "tc_thermal_hal.comp", "tc_thermal_test.c"]


def exported(folder: Path, *words: str, models: tuple[ErrorModel, ...]) -> int:
    folder.mkdir(exist_ok=True)
    modelfile.write(models, folder / "model.json")
    line = ["export", str(folder / "model.json"), "--to", "linuxcnc", "-o", str(folder / "out")]
    return run([*line, "--date", "2026-01-31", *words])


@needs_compiler
def test_targets_go_along_axes_and_others_are_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    models = (growing("z_um", 2.0), growing("bed_um", 3.0), replace(growing("x_um", 1.0), honest_error=None))
    assert exported(tmp_path, models=models) == 0
    said = capsys.readouterr().out
    assert "bed_um is left out: its axis is not known: give it with --axes bed_um=X, =Y or =Z" in said
    first = "z_um: accepted on unseen cycles; SHADOW ONLY, x_um: corrections stay zero"
    assert first in said
    out = tmp_path / "out"
    assert sorted(p.name for p in out.iterdir()) == FILES
    assert all(first in (out / name).read_text().splitlines()[0] for name in FILES if "test" not in name)
    hal = (out / "tc_thermal.hal").read_text()
    assert "=> axis.z.eoffset-counts" in hal
    assert "=> axis.x.eoffset-counts" in hal
    assert "bed" not in hal
    assert prove(out).returncode == 0

    assert exported(tmp_path / "named", "--axes", "bed_um=y", models=models) == 0
    hal = (tmp_path / "named" / "out" / "tc_thermal.hal").read_text()
    assert "=> axis.y.eoffset-counts" in hal
    assert "axis.z" not in hal


def test_what_no_axis_takes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert exported(tmp_path, models=(growing("bed_um", 3.0),)) == 2
    assert "nothing to write: bed_um: its axis is not known" in capsys.readouterr().err
    assert exported(tmp_path / "two", models=(growing("z_um", 3.0), growing("z2_um", 3.0))) == 2
    assert (
        "z_um, z2_um are all for axis Z: name one target for each axis, such as --axes z_um=Z"
        in capsys.readouterr().err
    )
    assert exported(tmp_path / "long", "--name", "a" * 40, models=(growing("z_um", 3.0),)) == 2
    assert "15 characters too long" in capsys.readouterr().err


def test_the_same_model_gives_the_same_bytes_and_a_refused_one_none(tmp_path: Path) -> None:
    refused = replace(growing("x_um", 1.0), honest_error=replace(ACCEPTED, verdict="refused", reason="worse"))
    for name in "ab":
        assert exported(tmp_path / name, models=(growing("z_um", 2.0), refused)) == 1
    for file in FILES:
        text = (tmp_path / "a" / "out" / file).read_bytes()
        assert text == (tmp_path / "b" / "out" / file).read_bytes()
        assert text.replace(b"Left out: x_um: worse", b"").count(b"x_um") == 0


def test_a_model_along_an_axis_knows_where_that_is(tmp_path: Path) -> None:
    slope = replace(growing("EXX_1", 40.0), unit="um/m")
    model = PositionModel(target="EXX", unit="um", axis="X", travel=(-200.0, 600.0), slopes=(slope,))
    positionfile.write([model], tmp_path / "x.json")
    line = ["export", str(tmp_path / "x.json"), "--to", "linuxcnc", "-o", str(tmp_path / "out"), "--json"]
    assert run(line) == 0
    assert "axis.x.pos-cmd => tc-thermal-hal.x-position" in (tmp_path / "out" / "tc_thermal.hal").read_text()
    assert run([*line, "--overwrite", "--axes", "EXX=Y"]) == 2  # it is of X
