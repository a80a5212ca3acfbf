"""A machine file whose errors can be told by hand, for the small machine's recording."""

from pathlib import Path

from smallmachine import small_machine

from thermocomp.core.inputs import Input
from thermocomp.core.polynomial import Polynomial
from thermocomp.core.position import PositionModel
from thermocomp.core.profile import SplineProfile
from thermocomp.core.terms import Variable
from thermocomp.files import modelfile, positionfile
from thermocomp.recordings.readers import recordings

#: um/m per degC, um per degC, urad
SLOPE, DRIFT, SQUARENESS = 2.0, 3.0, 10.0

TOML = f"""
name = "Mill [7]"
structure = "w X' b Z Y (C1) t"
tool = ["0 mm", "0 mm", "-100 mm"]

[axes.X]
travel = ["0 mm", "600 mm"]
[axes.Y]
travel = ["-200 mm", "200 mm"]
reference_position = "0 mm"
[axes.Z]
travel = ["0 mm", "500 mm"]

[spindle]
measured_tool = ["0 mm", "0 mm", "-100 mm"]

[components]
EXX = {{model = "exx.json"}}
Z0C = {{model = "drift.json"}}
C0Y = "{SQUARENESS} urad"
B0C = "5 urad"
"""


def warmed(target: str, unit: str, factor: float) -> Polynomial:
    """Return a model that is proportional to the change of t1_C."""
    return Polynomial(
        target=target,
        unit=unit,
        inputs=(Input("t1_C", "temperature", "degC", 20.0, True, -50.0, 50.0),),
        variables=(Variable.single("t1_C", 0),),
        terms=((0,),),
        coefficients=(factor,),
    )


def write_mill(folder: Path) -> tuple[Path, Path]:
    """Write a machine file with its models and a recording; return their paths.

    With T the change of t1_C: dx = SLOPE T x + a profile of at most 1 um - SQUARENESS y, dz = DRIFT T.
    """
    profile = SplineProfile(axis="X", knots=(0.0, 300.0, 600.0), pieces=((0.0, 1.0, 0.0, 0.0), (1.0, -1.0, 0.0, 0.0)))
    slope = warmed("k_1", "um/m", SLOPE)
    exx = PositionModel(target="EXX", unit="um", axis="X", travel=(0.0, 600.0), profile=profile, slopes=(slope,))
    positionfile.write([exx], folder / "exx.json")
    modelfile.write([warmed("z_um", "um", DRIFT)], folder / "drift.json")
    machine, recording = folder / "mill.toml", folder / "rec.csv"
    machine.write_text(TOML, encoding="utf-8")
    recordings.write(small_machine(), recording)
    return machine, recording
