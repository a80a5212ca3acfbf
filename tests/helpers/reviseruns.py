"""What the tests of ``thermocomp revise`` share: a program, models, and the command on them."""

import csv
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from thermocomp.cli.app import run
from thermocomp.core.model import ErrorModel
from thermocomp.core.provenance import RULES, HonestError
from thermocomp.files import modelfile
from thermocomp.nc.rewrite.header import MARK

HONEST = HonestError(
    "leave one thermal cycle out", 0.8, 1.0, 2.0, 9.0, 11.0, {"a": 1.0}, "accepted", "fine", 2, rules=RULES
)
PLATE = """%
(a plate)
G21 G90 G17 G54
T1 M6
S4000 M3
G0 X0 Y0 Z50
Z2
G1 Z-1 F300
X100 F50
Y20
X0
G0 Z50
G4 P1800
T2 M6
S6000 M3
G0 X10 Y10 Z5
G81 X10 Y10 Z-5 R2 F40
X20
G80
G0 Z50
M5
M2
%
"""


def judged(model: ErrorModel) -> ErrorModel:
    return replace(model, honest_error=HONEST)


def write_models(models: Sequence[ErrorModel], path: str) -> None:
    modelfile.write(models, path)


def revise(
    *options: str,
    program: str = "part.ngc",
    out: str = "out.ngc",
    start: str = "--cold",
    proved: bool = False,
    dialect: bool = True,
) -> int:
    """Run the command, for LinuxCNC unless said; unless asked for no interpreter starts, which takes its time."""
    given = ["--model", "model.json"] if "--model" not in options else []
    begun = [start] if start else []
    proof = [] if proved else ["--unproved"]
    whose = [] if "--controller" in options or not dialect else ["--controller", "linuxcnc"]
    return run(["revise", program, *given, *begun, *proof, *whose, *options, "-o", out, "--details"])


def table(path: str = "out.ngc.csv") -> list[dict[str, str]]:
    with Path(path).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def said(capsys: pytest.CaptureFixture[str]) -> str:
    return " ".join(capsys.readouterr().err.split())


def without_header(path: str) -> bytes:
    return b"".join(line for line in Path(path).read_bytes().splitlines(keepends=True) if MARK.encode() not in line)
