"""All that becomes a file, of every kind, in two versions: what the tests of the one writer write."""

import atexit
import io
import shutil
import tempfile
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import NamedTuple
from unittest import mock

from driftmodels import lags
from linuxcncmill import write_linuxcnc_mill
from reviseruns import PLATE, judged
from smallmachine import small_machine

from thermocomp.api import testprogram
from thermocomp.api.check import CheckedRecordings
from thermocomp.api.results import Assessed, Compared
from thermocomp.api.select import Selected
from thermocomp.cli.app import run
from thermocomp.core.exceptions import InputError
from thermocomp.core.model import ErrorModel
from thermocomp.core.position import PositionModel
from thermocomp.core.profile import SplineProfile
from thermocomp.files import modelfile, positionfile
from thermocomp.iso230.report import iso230 as iso230pages
from thermocomp.iso230.verbs import Evaluated
from thermocomp.judging.planning.trial import Trial
from thermocomp.live.adapters.linuxcnc import halsetup
from thermocomp.live.adapters.linuxcnc.halsetup import COMPONENT_NAME, HAL_NAME, HalSettings
from thermocomp.papers.report import papers as paperpages
from thermocomp.recordings.readers import recordings
from thermocomp.report import assessed, checks, html
from thermocomp.volumetric.report import volumetric as volumetricpages
from thermocomp.volumetric.verbs import VolumetricErrors

_FANUC = (
    "%\nO1234\nG21 G90 G17 G94\nT1 M6\nS4000 M3\nG0 G54 X0. Y0. Z50.\nG1 Z0. F30.\nM98 P100 L2\nX100.\n"
    "G90 G0 Z50.\nM30\nO100\nG91 Z-1.\nG90 X100.\nM99\n%\n"
)
#: as long as a page with some figures
_PAGE = "<p>0123456789</p>\n" * 10_000


class Writer(NamedTuple):
    """One kind."""

    write: Callable[[Path, int], None]  #: into a folder, a version
    names: tuple[str, ...]  #: of its files
    last: str  #: the one that an error names


def _page(module: object, name: str, write: Callable[[Path], object]) -> Writer:
    """A page, whose making takes long: its text is there already."""

    def go(folder: Path, version: int) -> None:
        with mock.patch.object(module, name, return_value=f"{_PAGE}{version}"):
            write(folder / "page.html")

    return Writer(go, ("page.html",), "page.html")


def _model(version: int) -> ErrorModel:
    return judged(replace(lags("z_um"), intercept=float(version)))


def _position_model(version: int) -> PositionModel:
    profile = SplineProfile(axis="Y", knots=(0.0, 550.0), pieces=((0.0, 1.0, float(version), 0.2),))
    return PositionModel(
        target="EYY", unit="um", axis="Y", travel=(0.0, 550.0), reference_position=0.0, profile=profile, offset=None
    )


def _recording(ending: str) -> Writer:
    tests = [small_machine(seed=k) for k in (0, 1)]
    name = f"drift.{ending}"
    return Writer(lambda f, v: recordings.write(tests[v], f / name, overwrite=True), (name,), name)


@cache
def _inputs(program: str, version: int) -> Path:
    """A folder with a program and a model."""
    inputs = Path(tempfile.mkdtemp())
    atexit.register(shutil.rmtree, inputs)
    modelfile.write([_model(version)], inputs / "model.json")
    (inputs / "part.ngc").write_text(program.replace("X100", f"X10{version}"), encoding="ascii")
    return inputs


def _revise(controller: str) -> Writer:
    """A program with all that stands beside it; a Fanuc's is written out first."""
    options = {"linuxcnc": ["--controller", "linuxcnc"], "fanuc": ["--controller", "fanuc", "--expand"]}
    ends = ["", ".diff", ".csv", ".job.json", ".png", *([".expanded"] if controller == "fanuc" else [])]
    program = PLATE if controller == "linuxcnc" else _FANUC

    def go(folder: Path, version: int) -> None:
        inputs = _inputs(program, version)
        words = ["revise", str(inputs / "part.ngc"), "--model", str(inputs / "model.json"), "--cold", "--unproved"]
        more = [*options[controller], "--date", "2026-01-31", "--overwrite", "-o", str(folder / "out.ngc")]
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()) as told:
            code = run([*words, *more])
        if code:
            raise InputError(told.getvalue())

    return Writer(go, tuple(f"out.ngc{end}" for end in ends), "out.ngc")


def _mapping(folder: Path, version: int) -> None:
    """A mapping for a file that `_inputs` has beside the program."""
    raw = _inputs(PLATE, version) / "raw.csv"
    raw.write_text(f"time_s,T{version},Z\n0,20,0\n10,21,1\n20,21,2\n", encoding="ascii")
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()) as told:
        code = run(["map", str(raw), "--yes", "--overwrite", "-o", str(folder / "raw.toml")])
    if code:
        raise InputError(told.getvalue())


def _linuxcnc(folder: Path, version: int) -> None:
    """The HAL of a mill that `_inputs` has beside the program."""
    ini = write_linuxcnc_mill(_inputs(PLATE, version))

    def prepare(path: Path, folder: Path, settings: HalSettings) -> halsetup.HalSetup:
        names = (folder / COMPONENT_NAME, folder / HAL_NAME)
        return found(path, Path("/tmp"), settings)._replace(files=names)  # it names its folder

    found = halsetup.prepare
    with mock.patch.object(halsetup, "prepare", prepare):
        halsetup.set_up(ini, folder, HalSettings(rate=1.0 + version), overwrite=True)


def _export(folder: Path, version: int) -> None:
    model = _inputs(PLATE, version) / "model.json"
    line = ["export", str(model), "--to", "c99", "-o", str(folder), "--date", "2026-01-31", "--overwrite"]
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()) as told:
        code = run(line)
    if code:
        raise InputError(told.getvalue())


def _test(folder: Path, version: int) -> None:
    speed = 1000.0 + version
    trial = Trial("run", speed, ((0.0, 900.0), (speed, 7200.0)))
    picture = b"picture %d" % version
    testprogram.write_test(trial, folder / "test.ngc", small_machine().channels, picture=picture, overwrite=True)


#: by the name of the kind
WRITERS: dict[str, Writer] = {
    "model": Writer(
        lambda f, v: modelfile.write([_model(v)], f / "model.json", overwrite=True), ("model.json",), "model.json"
    ),
    "position model": Writer(
        lambda f, v: positionfile.write([_position_model(v)], f / "position.json", overwrite=True),
        ("position.json",),
        "position.json",
    ),
    "linuxcnc": Writer(
        _linuxcnc,
        (COMPONENT_NAME, HAL_NAME),
        HAL_NAME,
    ),
    "mapping": Writer(_mapping, ("raw.toml",), "raw.toml"),
    "csv": _recording("csv"),
    "parquet": _recording("parquet"),
    "check page": _page(checks, "render", lambda p: CheckedRecordings((), ()).report(p, overwrite=True)),
    "report": _page(html, "render", lambda p: Compared(None, ()).report(p, overwrite=True)),  # type: ignore[arg-type]
    "page of assess": _page(assessed, "render", lambda p: Assessed(None, ()).report(p, overwrite=True)),  # type: ignore[arg-type]
    "selection page": _page(html, "render_choices", lambda p: Selected(()).report(p, overwrite=True)),
    "iso230 page": _page(iso230pages, "render", lambda p: Evaluated((), (), ()).report(p, overwrite=True)),
    "papers page": _page(paperpages, "render", lambda p: paperpages.write([], p, seed=0, overwrite=True)),
    "volumetric page": _page(
        volumetricpages,
        "render",
        lambda p: VolumetricErrors(None, point=True, volume=True).report(p, overwrite=True),  # type: ignore[arg-type]
    ),
    "program": _revise("linuxcnc"),
    "program written out": _revise("fanuc"),
    "export": Writer(_export, ("tc_thermal.c", "tc_thermal.h", "tc_thermal.md", "tc_thermal_test.c"), "tc_thermal.md"),
    "thermal test": Writer(_test, ("test.csv", "test.ngc", "test.png"), "test.ngc"),
}
