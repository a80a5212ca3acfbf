"""What ``thermocomp linuxcnc setup`` writes and tells, and what it refuses."""

import ast
import json
import sys
from pathlib import Path

import pytest
from linuxcncmill import write_linuxcnc_mill

from thermocomp.cli.app import run
from thermocomp.core.exceptions import InputError, SettingError
from thermocomp.live.adapters.linuxcnc.halsetup import COMPONENT_NAME, HAL_NAME, HalSettings, prepare


def test_it_is_written_beside_the_ini_and_what_is_to_do_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ini = write_linuxcnc_mill(tmp_path)
    before = {p.name: p.read_bytes() for p in tmp_path.iterdir()}
    assert run(["linuxcnc", "setup", str(ini), "--axes", "XZ", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert {Path(f).name for f in said["files"]} == {HAL_NAME, COMPONENT_NAME}
    assert "HALFILE = thermocomp.hal" in said["todo"][0]
    # LinuxCNC loads a module once: names go into the lines that are there
    assert "line 4 already loads sum2" in said["todo"][2]
    assert "names=sum2.0,sum2.1,tc.x.away" in said["todo"][2]
    assert "names=a,b,tc.x.from0" in said["todo"][1]
    text = (tmp_path / HAL_NAME).read_text(encoding="ascii")
    assert "loadrt sum2" not in text
    assert "net enabled motion.motion-enabled => tc.on.in-0" in text  # the machine's own signal
    assert "setp tc.z.away.offset 50.0" in text
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir() if p.name in before} == before
    assert run(["linuxcnc", "setup", str(ini)]) == 2
    assert "exists already" in capsys.readouterr().err
    assert run(["linuxcnc", "setup", str(ini), "--overwrite"]) == 0
    assert "1. " in capsys.readouterr().out


def test_what_is_done_already_is_not_told_again(tmp_path: Path) -> None:
    names = "tc.z.away,tc.z.line,tc.z.error,tc.z.counts"
    ini = write_linuxcnc_mill(tmp_path, "[HAL]\nHALFILE = thermocomp.hal\n")
    text = (tmp_path / "mill.hal").read_text().replace("sum2 count=2", f"sum2 names={names}")
    (tmp_path / "mill.hal").write_text(text.replace("names=a,b", "names=a,tc.z.from0,tc.z.from1"))
    assert prepare(ini, tmp_path, HalSettings()).todo == ()


def test_on_the_drive_side_it_goes_between_planner_and_drive(tmp_path: Path) -> None:
    text = prepare(write_linuxcnc_mill(tmp_path), tmp_path, HalSettings(pattern="drive", axes="ZX")).hal
    assert "unlinkp board.2.command\nunlinkp joint.2.motor-pos-fb\n" in text
    assert "net tc-z-drive tc.z.drive.out => board.2.command" in text
    assert "net z-fb => tc.z.drive.fb-in" in text
    assert "net tc-x-drive => tc.x.drive.fb-in" in text  # a loop without a drive
    # the thread, as LinuxCNC puts it together
    thread = ["board.read", "motion-command-handler", "motion-controller", "board.write"]
    for line in text.splitlines():
        if line.startswith("addf "):
            _, name, _, *place = line.split()
            thread.insert(int(place[0]) - 1 if place else len(thread), name)
    for axis in "zx":
        at = {n: thread.index(f"tc.{axis}.{n}") for n in ("drive.update-feedback", "smooth", "drive.update-output")}
        assert thread.index("board.read") < at["drive.update-feedback"] < thread.index("motion-command-handler")
        assert thread.index("motion-controller") < at["smooth"] < at["drive.update-output"]
        assert at["drive.update-output"] < thread.index("board.write")


def test_inches(tmp_path: Path) -> None:
    ini = write_linuxcnc_mill(tmp_path)
    ini.write_text(ini.read_text().replace("LINEAR_UNITS = mm", "LINEAR_UNITS = inch"))
    text = prepare(ini, tmp_path, HalSettings(magnitude=254.0)).hal
    assert "--unit inch" in text
    (clip,) = [float(line.split()[2]) for line in text.splitlines() if line.startswith("setp tc.z.clip.max")]
    assert clip == pytest.approx(0.01)
    (scale,) = [float(line.split()[2]) for line in text.splitlines() if "eoffset-scale" in line]
    assert scale == pytest.approx(1e-5 / 25.4)


def test_more_joints_than_a_table_takes(tmp_path: Path) -> None:
    ini = write_linuxcnc_mill(tmp_path)
    ini.write_text(ini.read_text().replace("JOINTS = 3", "JOINTS = 6"))
    text = prepare(ini, tmp_path, HalSettings()).hal
    assert "net tc-homed-0 => tc.homed-1.in-4" in text
    assert "net tc-joint-5-homed joint.5.homed => tc.homed-1.in-1" in text
    assert "net tc-homed => tc.on.in-3" in text


@pytest.mark.parametrize(
    ("old", "new", "settings", "told"),
    [
        ("OFFSET_AV_RATIO = 0.1\n", "", HalSettings(), "add OFFSET_AV_RATIO = 0.1 to"),
        ("OFFSET_AV_RATIO = 0.1\n", "OFFSET_AV_RATIO = 1.5\n", HalSettings(), "add OFFSET_AV_RATIO = 0.1 to"),
        ("OFFSET_AV_RATIO = 0.1\n", "OFFSET_AV_RATIO = nan\n", HalSettings(), "expected a number"),
        ("MAX_LIMIT = 100", "MAX_LIMIT = -300", HalSettings(), "must be below"),
        ("MAX_LIMIT = 100", "MAX_LIMIT = much", HalSettings(), "expected a number"),
        ("MAX_LIMIT = 100\n", "", HalSettings(), "there is no MAX_LIMIT"),
        ("[AXIS_", "[", HalSettings(), "there is no [AXIS_Z]; there are no axes"),
        ("MAX_LIMIT = 100", "MAX_LIMIT = \\\n -300", HalSettings(), "MAX_LIMIT = -300"),
        ("trivkins", "5axiskins", HalSettings(pattern="drive"), "must be a joint"),
        ("coordinates=XYZ", "coordinates=XZZ", HalSettings(pattern="drive"), "has 2 joints"),
        ("HALFILE = mill.hal", "HALFILE = mill.tcl", HalSettings(pattern="drive"), "cannot be analysed"),
        ("HALFILE = mill.hal", "HALFILE = none.hal", HalSettings(), "cannot be read"),
        ("[AXIS_Z]", "nonsense", HalSettings(), "there is no [AXIS_Z]; there are AXIS_X, AXIS_Y"),
    ],
)
def test_refused(tmp_path: Path, old: str, new: str, settings: HalSettings, told: str) -> None:
    ini = write_linuxcnc_mill(tmp_path)
    ini.write_text(ini.read_text().replace(old, new))
    with pytest.raises(InputError) as error:
        prepare(ini, tmp_path, settings)
    assert told in str(error.value)


@pytest.mark.parametrize(
    ("hal", "settings", "told"),
    [
        ("net other => axis.z.eoffset-counts\n", HalSettings(), "is used already (signal other)"),
        ("", HalSettings(pattern="drive", axes="Y"), "no HAL file nets joint.1.motor-pos-cmd"),
        ("linksp a b\n", HalSettings(pattern="drive"), "cannot be analysed"),
    ],
)
def test_refused_for_its_hal(tmp_path: Path, hal: str, settings: HalSettings, told: str) -> None:
    with pytest.raises(InputError) as error:
        prepare(write_linuxcnc_mill(tmp_path, hal=hal), tmp_path, settings)
    assert told in str(error.value)


def test_a_folder_that_hal_cannot_name(tmp_path: Path) -> None:
    for name in ("a folder", "x" * 120):
        with pytest.raises(InputError, match="choose another folder"):
            prepare(write_linuxcnc_mill(tmp_path / name), tmp_path / name, HalSettings())


@pytest.mark.parametrize(
    "wrong",
    [{"rate": 0.0}, {"hold": float("nan")}, {"axes": "XA"}, {"axes": "XX"}, {"axes": ""}, {"group": "nobody-x"}],
)
def test_settings_that_cannot_be(wrong: dict[str, float | str]) -> None:
    with pytest.raises(SettingError):
        HalSettings(**wrong)  # type: ignore[arg-type]


def test_the_component_is_the_standard_library_and_hal(tmp_path: Path) -> None:
    tree = ast.parse(prepare(write_linuxcnc_mill(tmp_path), tmp_path, HalSettings()).component)
    names = {a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names}
    names |= {str(n.module) for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)}
    assert {n.partition(".")[0] for n in names} - sys.stdlib_module_names == {"hal"}
