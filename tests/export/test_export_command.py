"""`thermocomp export`: what it writes compiles, proves itself, and says what may run."""

import json
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from driftmodels import ACCEPTED, growing
from watchedmachine import watched_model

import thermocomp as tc
from thermocomp.cli.app import run
from thermocomp.core.inputs import Input
from thermocomp.core.model import ErrorModel
from thermocomp.core.position import PositionModel
from thermocomp.core.provenance import HonestError
from thermocomp.files import modelfile, positionfile

UNPROVEN = replace(ACCEPTED, verdict="unproven", reason="one cycle is not enough")
REFUSED = replace(ACCEPTED, verdict="refused", reason="worse than nothing")
CC = shutil.which("gcc") or shutil.which("cc")
QUICK = shutil.which("clang") or CC or ""  #: where any will do
STRICT, CHECKED = ("-Wall", "-Wextra", "-Werror", "-pedantic"), ("-fsanitize=address,undefined",)
needs_compiler = pytest.mark.skipif(CC is None, reason="there is no C compiler")


def along_x() -> PositionModel:
    slope = replace(growing("EXX", 12.0, "um/m"), honest_error=ACCEPTED)
    return PositionModel(target="EXX", unit="um", axis="X", travel=(-200.0, 600.0), slopes=(slope,))


def test_of_an_error_along_an_axis(tmp_path: Path) -> None:
    positionfile.write([along_x()], tmp_path / "x.json")
    for target in ("c99", "st", "siemens", "beckhoff"):
        assert run(["export", str(tmp_path / "x.json"), "--to", target, "-o", str(tmp_path / target)]) == 0
    page = (tmp_path / "siemens" / "tc_thermal.md").read_text()
    assert "| 0 | X | EXX | 3 (bits 0, 1) |" in page
    assert "its profile stays a table" in page
    if CC:
        assert prove(tmp_path / "c99").returncode == 0


def test_an_axis_that_it_was_not_measured_along(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    positionfile.write([along_x()], tmp_path / "x.json")
    assert run(["export", str(tmp_path / "x.json"), "--to", "siemens", "--axes", "EXX=Y", "-o", str(tmp_path)]) == 2
    assert "--axes EXX=Y: EXX was measured along X" in " ".join(capsys.readouterr().err.split())


def test_a_refused_slope_is_left_out(tmp_path: Path) -> None:
    bad = replace(along_x(), slopes=(replace(along_x().slopes[0], honest_error=REFUSED),))
    positionfile.write([bad], tmp_path / "x.json")
    assert run(["export", str(tmp_path / "x.json"), "--to", "st", "-o", str(tmp_path / "out")]) == 1
    assert not (tmp_path / "out").exists()


def test_an_error_along_an_axis_is_not_reduced(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    positionfile.write([along_x()], tmp_path / "x.json")
    assert run(["export", str(tmp_path / "x.json"), "--to", "fanuc", "-o", str(tmp_path)]) == 2
    assert "fanuc supports position-independent corrections only, but EXX depends on position" in " ".join(
        capsys.readouterr().err.split()
    )


@pytest.mark.parametrize("dialect", ["codesys", "twincat", "scl", "iec"])
def test_structured_text_in_every_dialect(tmp_path: Path, dialect: str) -> None:
    model = written(tmp_path, watched_model("z_um"))
    command = ["export", str(model), "--to", "st", "--dialect", dialect, "--date", "2026-01-31", "-o"]
    for folder in ("one", "two"):
        assert run([*command, str(tmp_path / folder)]) == 0
    files = sorted(f.name for f in (tmp_path / "one").iterdir())
    assert {Path(f).suffix for f in files} == {
        "codesys": {".st", ".xml", ".md"},
        "iec": {".st", ".xml", ".md"},
        "twincat": {".TcPOU", ".TcDUT", ".md"},
        "scl": {".scl", ".md"},
    }[dialect]
    for file in files:
        assert (tmp_path / "one" / file).read_bytes() == (tmp_path / "two" / file).read_bytes()


def test_a_dialect_is_of_structured_text_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = written(tmp_path, watched_model("z_um"))
    assert run(["export", str(model), "--to", "c99", "--dialect", "scl", "-o", str(tmp_path)]) == 2
    assert "--dialect scl: c99 does not support it; --to st does" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--magnitude", "inf"], "--magnitude inf: c99 needs a finite number"),
        (["--hold", "inf"], "--hold inf: c99 needs a finite number"),
        (["--reading-age", "inf"], "--reading-age inf: c99 needs a finite number"),
        (["--magnitude", "1e300"], "--magnitude 1e+300: c99 accepts 1e-06 to 1e+09: give a number in this range"),
        (["--rate", "1e-50"], "--rate 1e-50: c99 accepts 1e-06 to 1e+09: give a number in this range"),
        (["--hold", "5e-324"], "--hold 4.94066e-324: c99 accepts 1e-06 to 1e+10: give a number in this range"),
        (["--reading-age", "1e-300"], "--reading-age 1e-300: c99 accepts 1e-06 to 1e+10: give a number in this range"),
        (["--name", "../x"], "--name '../x': expected letters, digits and _"),
        (["--name", ""], "--name '': expected letters"),
        (["--date", "2026-13-45"], "--date 2026-13-45: expected a date such as 2026-01-31"),
        (["--most-loss", "3"], "--most-loss: c99 does not support this option"),
        (["--axes", "z_um=Z"], "--axes: c99 does not support this option"),
    ],
)
def test_an_option_that_would_make_a_useless_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], said: str
) -> None:
    model = written(tmp_path, watched_model("z_um"))
    assert run(["export", str(model), "--to", "c99", "-o", str(tmp_path / "out"), *options]) == 2
    assert said in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "out").exists()


def test_each_target_has_its_own_verdict_and_what_is_left_out_is_said_in_the_files(tmp_path: Path) -> None:
    tilt = replace(growing("B0C", 2.0, "urad"), honest_error=ACCEPTED)
    model = written(tmp_path, judged("z_um", ACCEPTED), judged("y_um", UNPROVEN), judged("x_um", REFUSED), tilt)
    taken = ["--accept-unproven", "M. Weber, trial"]
    assert run(["export", str(model), "--to", "c99", "-o", str(tmp_path / "out"), *taken]) == 1
    for name in ("tc_thermal.h", "tc_thermal.md"):
        text = (tmp_path / "out" / name).read_text()
        assert text.split("\n")[0].strip("/* ") == (
            "z_um: accepted on unseen cycles; y_um: UNPROVEN, approved nevertheless"
        )
        assert "Left out: x_um: worse than nothing" in text
        assert "Left out: B0C: it predicts urad, but a correction is in um" in text


@needs_compiler
def test_files_compiled_in_another_precision_do_not_link(one_target: Path, tmp_path: Path) -> None:
    shutil.copytree(one_target, tmp_path, dirs_exist_ok=True)
    assert CC is not None
    subprocess.run([CC, "-c", "-DTC_FLOAT", "tc_mill.c"], cwd=tmp_path, check=True)
    link = [CC, "tc_mill.o", "tc_mill_test.c", "-lm", "-o", "t"]
    done = subprocess.run(link, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "undefined reference" in done.stderr


def written(folder: Path, *models: ErrorModel) -> Path:
    modelfile.write(models, folder / "model.json", overwrite=True)
    return folder / "model.json"


def judged(target: str, verdict: HonestError) -> ErrorModel:
    return replace(growing(target, 2.0), honest_error=verdict)


def prove(
    folder: Path, *flags: str, checks: tuple[str, ...] = CHECKED, compiler: str = QUICK
) -> subprocess.CompletedProcess[str]:
    """Compile and run as the page of the export says."""
    line = re.search(r"^    cc (.*) && \./(\S+)$", next(folder.glob("tc_*.md")).read_text(), re.M)
    assert line is not None
    subprocess.run([compiler, *STRICT, *checks, *flags, *line[1].split()], cwd=folder, check=True)
    return subprocess.run([folder / line[2]], capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def two_targets(tmp_path_factory: pytest.TempPathFactory) -> Path:
    model = written(tmp_path_factory.mktemp("two"), watched_model("z_um"), watched_model("x_um"))
    assert run(["export", str(model), "--to", "c99", "-o", str(model.parent / "out"), "--dead-band", "0.2"]) == 0
    return model.parent / "out"


@pytest.fixture(scope="module")
def one_target(tmp_path_factory: pytest.TempPathFactory) -> Path:
    model = written(tmp_path_factory.mktemp("one"), watched_model("z_um"))
    assert run(["export", str(model), "--to", "c99", "-o", str(model.parent / "out"), "--name", "mill"]) == 0
    return model.parent / "out"


@needs_compiler
@pytest.mark.parametrize("flags", [(), ("-O2",), ("-DTC_FLOAT",)])
def test_what_is_written_proves_itself(two_targets: Path, flags: tuple[str, ...]) -> None:
    checks = () if "-O2" in flags else CHECKED  # in optimised code they take seven seconds to compile
    done = prove(two_targets, *flags, checks=checks, compiler=CC or "")
    assert done.returncode == 0, done.stdout
    assert ", 0 wrong;" in done.stdout


@needs_compiler
@pytest.mark.parametrize(
    ("was", "becomes"),
    [
        (r"c_rate = TC_ROUNDED\(0.1, [\d.]+\)", "c_rate = TC(0.11)"),
        (r"s->clock \+ w->dt", "s->clock + w->dt + 1e-6"),
        (r"c_substitute_fade = 3600.0", "c_substitute_fade = 3700.0"),
        (r"c_hold = 1800.0", "c_hold = 1900.0"),
        (r"s->used\[i\] = w->x\[i\];", "s->used[i] = w->x[i] + TC(1e-6);"),
    ],
)
def test_a_mistake_in_the_code_is_found(one_target: Path, tmp_path: Path, was: str, becomes: str) -> None:
    shutil.copytree(one_target, tmp_path, dirs_exist_ok=True)
    code = tmp_path / "tc_mill.c"
    text, count = re.subn(was, becomes, code.read_text())
    assert count
    code.write_text(text)
    done = prove(tmp_path, checks=())
    assert (done.returncode, "call" in done.stdout) == (1, True)


def test_only_what_may_run_moves_anything(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    good, unproven, bad = judged("x_um", ACCEPTED), judged("y_um", UNPROVEN), judged("z_um", REFUSED)
    model = written(tmp_path, good, unproven, bad)
    assert run(["export", str(model), "--to", "c99", "-o", str(tmp_path / "out")]) == 1
    said = capsys.readouterr().out
    assert "z_um is left out: worse than nothing" in said
    first = (tmp_path / "out" / "tc_thermal.c").read_text().splitlines()[0]
    assert first == "/* x_um: accepted on unseen cycles; SHADOW ONLY, y_um: corrections stay zero */"
    for name in ("tc_thermal.h", "tc_thermal.md"):
        assert first.strip("/* ") in (tmp_path / "out" / name).read_text().splitlines()[0]
    if CC:
        assert prove(tmp_path / "out").returncode == 0

    (tmp_path / "alone").mkdir()
    alone = written(tmp_path / "alone", unproven)
    assert run(["export", str(alone), "--to", "c99", "-o", str(tmp_path / "shadow")]) == 0
    assert (tmp_path / "shadow" / "tc_thermal.md").read_text().startswith("SHADOW ONLY, y_um: not proven")
    line = ["export", str(alone), "--to", "c99", "-o", str(tmp_path / "taken"), "--accept-unproven", "M. Weber, trial"]
    assert run(line) == 0
    assert (tmp_path / "taken" / "tc_thermal.md").read_text().startswith("y_um: UNPROVEN, approved nevertheless")

    (tmp_path / "no").mkdir()
    capsys.readouterr()
    assert (
        run(["export", str(written(tmp_path / "no", bad)), "--to", "c99", "-o", str(tmp_path / "none"), "--json"]) == 1
    )
    found = json.loads(capsys.readouterr().out)
    assert (found["files"], found["refused"]) == ([], {"z_um": "worse than nothing"})
    assert not (tmp_path / "none").exists()


def test_the_same_model_gives_the_same_files_and_nothing_is_overwritten(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = written(tmp_path, watched_model("z_um"))
    folders = [tmp_path / "a", tmp_path / "b"]
    for folder in folders:
        assert run(["export", str(model), "--to", "c99", "-o", str(folder), "--date", "2026-01-31"]) == 0
    names = sorted(p.name for p in folders[0].iterdir())
    assert names == ["tc_thermal.c", "tc_thermal.h", "tc_thermal.md", "tc_thermal_test.c"]
    assert all((folders[0] / n).read_bytes() == (folders[1] / n).read_bytes() for n in names)
    capsys.readouterr()
    assert run(["export", str(model), "--to", "c99", "-o", str(folders[0])]) == 2
    assert "--overwrite" in capsys.readouterr().err
    written(tmp_path, judged("z_um", ACCEPTED))
    assert run(["export", str(model), "--to", "c99", "-o", str(folders[0]), "--overwrite"]) == 0


def test_models_that_average_their_zero_in_different_ways(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = replace(judged("y_um", ACCEPTED), zeroing=watched_model("z_um").zeroing)
    model = written(tmp_path, judged("x_um", ACCEPTED), other)
    assert run(["export", str(model), "--to", "c99", "-o", str(tmp_path / "out")]) == 2
    assert "export each model file separately" in capsys.readouterr().err


def prove_graph(folder: Path) -> subprocess.CompletedProcess[str]:
    """Run as the page of the export says."""
    line = re.search(r"^    python (\S+_test\.py)$", next(folder.glob("tc_*.md")).read_text(), re.M)
    assert line is not None
    return subprocess.run([sys.executable, line[1]], cwd=folder, capture_output=True, text=True, check=False)


def test_a_graph_that_is_written_proves_itself(tmp_path: Path) -> None:
    model = written(tmp_path, watched_model("z_um"), replace(watched_model("x_um"), honest_error=REFUSED))
    line = ["export", str(model), "--to", "onnx", "--dead-band", "0.2", "--date", "2026-01-31", "-o"]
    assert run([*line, str(tmp_path / "a"), "--name", "mill"]) == 1  # without x_um
    done = prove_graph(tmp_path / "a")
    assert done.returncode == 0, done.stdout + done.stderr
    assert ", 0 wrong; largest difference " in done.stdout
    page = re.search(r"^    python (tc_mill_run\.py) model\.json < ", (tmp_path / "a" / "tc_mill.md").read_text(), re.M)
    assert page is not None
    command, rows = [sys.executable, page[1], str(model)], "time_s,t1_C,t2_C,t3_C,spindle_rpm\n0,20,20,20,0\n"
    done = subprocess.run(command, input=rows, cwd=tmp_path / "a", capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.strip()) == (0, "0 s: z_um 0.000 um, 0.000 um/m"), done.stderr
    assert run([*line, str(tmp_path / "b"), "--name", "mill"]) == 1
    names = sorted(p.name for p in (tmp_path / "a").iterdir())
    assert names == ["tc_mill.md", "tc_mill_run.py", "tc_mill_test.py", "tc_mill_vectors.json", "tc_mill_z_um.onnx"]
    assert all((tmp_path / "a" / n).read_bytes() == (tmp_path / "b" / n).read_bytes() for n in names)


def test_a_graph_of_what_is_unproven_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = written(tmp_path, judged("x_um", ACCEPTED), judged("y_um", UNPROVEN))
    assert run(["export", str(model), "--to", "onnx", "-o", str(tmp_path / "out")]) == 0
    first = "x_um: accepted on unseen cycles; SHADOW ONLY, y_um: corrections stay zero"
    assert capsys.readouterr().out.splitlines()[0] == first
    assert (tmp_path / "out" / "tc_thermal.md").read_text().splitlines()[0].strip() == first
    assert prove_graph(tmp_path / "out").returncode == 0
    assert b"SHADOW ONLY, y_um: not proven" in (tmp_path / "out" / "tc_thermal_y_um.onnx").read_bytes()
    assert b"SHADOW ONLY" not in (tmp_path / "out" / "tc_thermal_x_um.onnx").read_bytes()


def test_without_onnx_it_says_what_to_install(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    model = written(tmp_path, judged("x_um", ACCEPTED))
    monkeypatch.setitem(sys.modules, "onnx", None)
    assert run(["export", str(model), "--to", "onnx", "-o", str(tmp_path / "out")]) == 2
    assert "pip install 'thermocomp[onnx]'" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
    assert run(["export", str(model), "--to", "c99", "-o", str(tmp_path / "out")]) == 0


def test_a_setting_that_there_is_not_is_named(tmp_path: Path) -> None:
    model = written(tmp_path, watched_model("z_um"))
    with pytest.raises(
        tc.ThermocompError, match="unexpected keyword argument 'loss'; the settings are most_loss, axes"
    ):
        tc.export(model, "klipper", loss=3.0)


def test_onnx_is_loaded_by_nothing_that_does_without() -> None:
    code = "import sys, thermocomp.export.commands.export, thermocomp.export.onnx.package; print('onnx' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_a_whole_model_wants_nothing_of_the_training_side(tmp_path: Path) -> None:
    model = written(tmp_path, watched_model("z_um"))
    code = (
        "import sys\n"
        "for name in ('pandas', 'sklearn', 'scipy', 'matplotlib', 'joblib', 'numba'): sys.modules[name] = None\n"
        "from thermocomp.cli.app import run\n"
        f"sys.exit(run(['export', {str(model)!r}, '--to', 'c99', '-o', {str(tmp_path / 'out')!r}]))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(("to", "most"), [("linuxcnc", "2e+07"), ("beckhoff", "2e+08")])
def test_a_correction_that_is_no_whole_number_of_32_bits(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], to: str, most: str
) -> None:
    command = ["export", str(written(tmp_path, watched_model("z_um"))), "--to", to, "-o", str(tmp_path / "out")]
    assert run([*command, "--magnitude", "9e8"]) == 2
    assert f"--magnitude 9e+08: {to} accepts 1e-06 to {most}: give" in " ".join(capsys.readouterr().err.split())
    assert run([*command, "--magnitude", most]) == 0


@needs_compiler
@pytest.mark.parametrize(
    "limits",
    [
        ["--hold", "1e-6", "--fade", "1e-6", "--reading-age", "1e-6"],
        ["--hold", "1e10", "--fade", "1e10", "--reading-age", "1e10"],
        ["--magnitude", "1e-6", "--rate", "1e-6"],
        ["--magnitude", "1e9", "--rate", "1e9"],
    ],
)
def test_limits_at_the_ends_of_what_they_may_be(tmp_path: Path, limits: list[str]) -> None:
    model = written(tmp_path, watched_model("z_um"))
    assert run(["export", str(model), "--to", "c99", "-o", str(tmp_path), *limits]) == 0
    for flags in ([], ["-DTC_FLOAT"]):
        done = prove(tmp_path, *flags)
        assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("to", ["c99", "st", "linuxcnc", "siemens", "beckhoff"])
def test_a_name_in_any_script_stands_as_it_is(tmp_path: Path, to: str) -> None:
    model = watched_model("z_um")
    assert model.watch is not None
    names = {"t1_C": "\u4e3b\u8f74_C", "t2_C": "\u00d6l_C"}

    def named(inputs: tuple[Input, ...]) -> tuple[Input, ...]:
        return tuple(replace(i, name=names.get(i.name, i.name)) for i in inputs)

    model = replace(model, inputs=named(model.inputs), watch=replace(model.watch, inputs=named(model.watch.inputs)))
    assert run(["export", str(written(tmp_path, model)), "--to", to, "-o", str(tmp_path / "out")]) == 0
    text = "".join(f.read_text(encoding="utf-8") for f in (tmp_path / "out").glob("tc_thermal*[!d]"))
    assert all(name in text for name in names.values())
    assert "\\u4e3b" not in text
    if CC and to == "c99":
        assert prove(tmp_path / "out").returncode == 0
    if to == "linuxcnc" and shutil.which("halcompile"):
        subprocess.run(["halcompile", "--compile", "tc_thermal_hal.comp"], cwd=tmp_path / "out", check=True)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"[machine]\nname = 'mill'\n", "it is TOML, such as a machine file or a mapping: it begins with '[machine]'"),
        (
            b"time_s,t1_C,z_um\n0,20,0\n",
            "it looks like a table, such as a recording: it begins with 'time_s,t1_C,z_um'",
        ),
        (b"", "it is empty"),
        (b"G0 X1\n", "it begins with 'G0 X1'"),
        (b"PK\x03\x04\xff\xfe", "it is not a text file"),
        (b'{"format": "other"}', 'it has no "format": "thermocomp-model", found \'other\'; name the file that'),
        (b"[1, 2]", 'it has no "format": "thermocomp-model", found none; name the file that'),
    ],
)
def test_a_file_that_is_no_model(tmp_path: Path, capsys: pytest.CaptureFixture[str], content: bytes, said: str) -> None:
    (tmp_path / "given").write_bytes(content)
    assert run(["export", str(tmp_path / "given"), "--to", "c99", "-o", str(tmp_path / "out")]) == 2
    error = " ".join(capsys.readouterr().err.split())
    assert str(tmp_path / "given") in error
    assert said in error
    assert "name the file that 'thermocomp fit' wrote" in error or "name a model file" in error


def test_a_machine_file_is_told_from_a_model_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    machine = Path(__file__).resolve().parents[2] / "docs" / "files" / "virtual.toml"
    assert run(["export", str(machine), "--to", "c99", "-o", str(tmp_path / "out")]) == 2
    error = " ".join(capsys.readouterr().err.split())
    assert "a machine file cannot be exported; name the model file in it" in error
