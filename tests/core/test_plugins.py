"""What another package brings is found by its entry points, used like our own, and skipped with a reason."""

import json
import os
import re
import subprocess
import sys
import textwrap
import tomllib
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from driftmodels import ACCEPTED, growing, lags
from reviseruns import judged, write_models
from smallmachine import small_machine

from thermocomp.files import modelfile
from thermocomp.recordings.readers import recordings

CODE = '''
"""A method, an export, a source and a command."""
from dataclasses import dataclass
from typing import Literal
from sklearn.linear_model import LinearRegression
from thermocomp.core.ports import LinkStatus
from thermocomp.core.reading import Reading
from thermocomp.export.target import Target
from thermocomp.models.method import Method
from thermocomp.models.ols import LeastSquares


class Halved(LeastSquares):
    """Least squares, halved: worse on purpose."""

    def fit(self, X, y):
        super().fit(X, y)
        self.coef_ = self.coef_ / 2
        return self


METHODS = (Method("halved", "least squares, halved", "tinyplug:Halved"),)


def write(compensator, name, facts):
    return {f"{name}.txt": "\\n".join(compensator.lines).encode(), "README.md": b"# A list of targets  \\nRead it.\\n"}


TARGET = Target(write=write)


class Counting:
    """A source that counts."""

    async def connect(self, timeout):
        pass

    async def readings(self):
        for k in range(3):
            yield Reading(float(k), {"t": 20.0 + k})

    def status(self):
        return LinkStatus("connected")

    async def close(self):
        pass


@dataclass(frozen=True, kw_only=True)
class CountingIn:
    """Its table."""

    kind: Literal["counting"]
    by: float = 1.0

    def open(self, folder, speed):
        return Counting()


def greet(who: str = "machine") -> int:
    """Greet somebody.

    Parameters
    ----------
    who : str
        Whom.
    """
    print(f"hello {who}")
    return 0
'''
ENTRIES = """
[thermocomp.commands]
greet = tinyplug:greet
absent = nowhere.at_all:run
fit = tinyplug:greet
[thermocomp.methods]
tiny = tinyplug:METHODS
broken = tinyplug:NOTHING
[thermocomp.exporters]
list = tinyplug:TARGET
broken = tinyplug:NOTHING
[thermocomp.sources]
counting = tinyplug:CountingIn
other = tinyplug:CountingIn
plain = tinyplug:Counting
broken = tinyplug:NOTHING
"""
CONFIG = 'models = ["model.json"]\nown_compensation = "off"\nshadow = true\n[[sources]]\nkind = "counting"\n{}\n'
READ = """
import asyncio
from thermocomp.live.build import build
from thermocomp.live.config import read_config
(source,) = build(read_config("live.toml")).sources
async def read():
    return [r.values["t"] async for r in source.readings()]
print(asyncio.run(read()))
"""
SERVE = """
import fastapi, joblib, matplotlib.figure, os, pandas, rich.console, scipy.stats, sklearn.linear_model, sys, json
for line in sys.stdin:
    folder, *words = json.loads(line)
    if not (pid := os.fork()):
        os.chdir(folder)
        for number, name in ((1, "stdout"), (2, "stderr")):
            os.dup2(os.open(name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
        sys.path.insert(0, sys.argv[1])
        if words[0] == "-c":
            exec(words[1])
            sys.exit()
        sys.argv = ["thermocomp", *words]
        from thermocomp.cli.app import main
        sys.exit(main())
    print(os.waitpid(pid, 0)[1], flush=True)
"""


def build(folder: Path, name: str, code: str, entries: str) -> Path:
    """Write the wheel of a package of one module."""
    wheel, info = folder / f"{name}-1.0-py3-none-any.whl", f"{name}-1.0.dist-info"
    with zipfile.ZipFile(wheel, "w") as file:
        file.writestr(f"{name}.py", code)
        file.writestr(f"{info}/METADATA", f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        file.writestr(
            f"{info}/WHEEL", "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
        )
        file.writestr(f"{info}/entry_points.txt", entries)
        file.writestr(f"{info}/RECORD", "")
    return wheel


def of_the_page(folder: Path) -> Path:
    """Build the package of the page on own targets, from its text alone."""
    page = (Path(__file__).resolve().parents[2] / "docs" / "own_target.rst").read_text(encoding="utf-8")
    code, toml = (
        textwrap.dedent(re.search(rf"   .. code-block:: {kind}\n\n((?:      .*\n|\n)+)", page)[1])  # type: ignore[index]
        for kind in ("python", "toml")
    )
    project = tomllib.loads(toml)["project"]
    entries = [
        f"[{group}]\n" + "".join(f"{name} = {value}\n" for name, value in those.items())
        for group, those in project["entry-points"].items()
    ]
    return build(folder, project["name"], code, "\n".join(entries))


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder into which pip has installed the packages."""
    folder = tmp_path_factory.mktemp("plugin")
    wheels = [str(build(folder, "tinyplug", CODE, ENTRIES)), str(of_the_page(folder))]
    site = folder / "site"
    words = ["-m", "pip", "install", "--quiet", "--no-index", "--no-deps", "--target", str(site), *wheels]
    subprocess.run([sys.executable, *words], check=True, capture_output=True)
    return site


@pytest.fixture(scope="module")
def orders(installed: Path) -> Iterator[subprocess.Popen[str]]:
    """Start a process that runs each command in a copy of itself: what others wrote is loaded once, ours each time."""
    words = [sys.executable, "-c", SERVE, str(installed)]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        yield process


Thermocomp = Callable[..., tuple[str, str]]


@pytest.fixture
def thermocomp(orders: subprocess.Popen[str], tmp_path: Path) -> Thermocomp:
    """Run a command, or -c and code, with the package on the path; return what it prints."""

    def ran(*words: str, code: int = 0) -> tuple[str, str]:
        assert orders.stdin
        assert orders.stdout
        print(json.dumps([str(tmp_path), *words]), file=orders.stdin, flush=True)
        ended = os.waitstatus_to_exitcode(int(orders.stdout.readline()))
        out, err = ((tmp_path / name).read_text(encoding="utf-8") for name in ("stdout", "stderr"))
        assert ended == code, err
        return out, " ".join(err.split())

    return ran


def test_a_command(thermocomp: Thermocomp) -> None:
    out, err = thermocomp("greet", "shop")
    assert out == "hello shop\n"
    assert (
        "plug-in absent (thermocomp.commands) of the package tinyplug is skipped: nowhere.at_all:run does not exist"
        in err
    )
    assert "plug-in fit (thermocomp.commands) of the package tinyplug is skipped: the name fit is already used" in err
    out, _ = thermocomp("--help")
    assert "Greet somebody." in out
    assert "Fit a model" in out


def test_a_method_and_an_export(thermocomp: Thermocomp, tmp_path: Path) -> None:
    recordings.write(small_machine(), tmp_path / "drift.csv")
    words = ["compare", "drift.csv", "--target", "z_um", "--models", "ols", "halved", "--json", "--jobs", "1"]
    out, err = thermocomp(*words)
    judged = {a["model"]: a["rms_um"] for a in json.loads(out)["results"] if a["block"] == "all unseen cycles"}
    assert judged["halved"] > 1.5 * judged["ols"]
    assert "plug-in broken (thermocomp.methods) of the package tinyplug cannot be loaded" in err
    thermocomp("fit", "drift.csv", "--target", "z_um", "--model", "ols", "-o", "model.json", "--jobs", "1")
    thermocomp("export", "model.json", "--to", "list", "-o", "out")
    assert (tmp_path / "out" / "thermal.txt").read_text() == "z_um"
    _, err = thermocomp("export", "model.json", "--to", "broken", "-o", "out2", code=2)
    assert "plug-in broken (thermocomp.exporters) of the package tinyplug cannot be loaded: AttributeError" in err


def test_the_targets_of_the_page(thermocomp: Thermocomp, tmp_path: Path) -> None:
    """The page on own targets is enough: its package exports a formula that is right, and the C code in a frame."""
    modelfile.write([growing("z_um", 3.0)], tmp_path / "line.json")
    thermocomp("export", "line.json", "--to", "panel", "-o", "out", "--date", "2026-01-31")
    assert (tmp_path / "out" / "tc_thermal.txt").read_text() == "Z = LIMIT(500.0, -0.0+-3.0*(t-20.0))\n"
    rows = (tmp_path / "out" / "tc_thermal_vectors.csv").read_text().splitlines()[1:]
    for axis, correction, heat in (row.split(",") for row in rows):
        assert axis == "Z"
        assert float(correction) == pytest.approx(-3.0 * (float(heat) - 20.0))
    assert (
        (tmp_path / "out" / "tc_thermal.md").read_text().startswith("z_um: accepted on unseen cycles; the full model")
    )
    write_models([judged(lags("z_um", 1.0))], str(tmp_path / "model.json"))
    recordings.write(small_machine(), tmp_path / "drift.csv")
    thermocomp("export", "model.json", "--to", "framed", "-o", "out2")
    assert (tmp_path / "out2" / "tc_thermal_send.c").read_text() == "send(0, state.correction[0]); /* z_um [um] */\n"
    assert "whole model" in thermocomp("export", "model.json", "drift.csv", "--to", "framed", "-o", "no", code=2)[1]
    _, err = thermocomp("export", "model.json", "--to", "panel", "-o", "no", code=2)
    assert "panel supports only a linear formula of up to 2 temperatures" in err
    lost = replace(growing("z_um", 3.0), honest_error=replace(ACCEPTED, verdict="unproven"))
    modelfile.write([lost], tmp_path / "line.json", overwrite=True)
    thermocomp("export", "line.json", "--to", "panel", "-o", "no", code=1)
    assert not (tmp_path / "no").exists()


def test_a_source(thermocomp: Thermocomp, tmp_path: Path) -> None:
    write_models([judged(lags("z_um", 1.0))], str(tmp_path / "model.json"))
    (tmp_path / "live.toml").write_text(CONFIG.format("by = 2.0"), encoding="utf-8")
    assert thermocomp("-c", READ)[0] == "[20.0, 21.0, 22.0]\n"
    thermocomp("serve", "live.toml", "--check")
    (tmp_path / "live.toml").write_text(CONFIG.format("to = 2.0"), encoding="utf-8")
    _, err = thermocomp("serve", "live.toml", "--check", code=2)
    assert "sources.1.to is not a known key" in err
    second = '[[sources]]\nkind = "counting"\nby = {}\n'
    (tmp_path / "live.toml").write_text(CONFIG.format("by = 2.0") + second.format(3.0), encoding="utf-8")
    thermocomp("serve", "live.toml", "--check")
    (tmp_path / "live.toml").write_text(CONFIG.format("by = 2.0") + second.format(2.0), encoding="utf-8")
    assert "2 sources with the same CountingIn(" in thermocomp("serve", "live.toml", "--check", code=2)[1]
    (tmp_path / "live.toml").write_text("speed = 60.0\n" + CONFIG.format(""), encoding="utf-8")
    assert "read by kind = 'counting' runs in real time" in thermocomp("serve", "live.toml", "--check", code=2)[1]
    for kind, why in (
        ("broken", "of the package tinyplug cannot be loaded"),
        ("plain", "tinyplug:Counting is not a dataclass with a method open"),
        ("other", "tinyplug:CountingIn needs a field kind: Literal['other']"),
    ):
        (tmp_path / "live.toml").write_text(CONFIG.format("").replace("counting", kind), encoding="utf-8")
        _, err = thermocomp("serve", "live.toml", "--check", code=2)
        assert f"plug-in {kind} (thermocomp.sources)" in err
        assert why in err
