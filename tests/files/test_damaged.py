"""Damaged files are refused in words, or what they hold never gives a number that is none."""

import random
import resource
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from damage import spoil_json, spoil_toml
from driftmodels import ACCEPTED, ROOM, SPEED, lags, net, static, ticking

from thermocomp.core.additive import Additive
from thermocomp.core.curves import Curve
from thermocomp.core.exceptions import ThermocompError
from thermocomp.core.fingerprints import Prints, Runs, pack_marks
from thermocomp.core.inputs import Support
from thermocomp.core.joint import JointSupport
from thermocomp.core.learned import Learned
from thermocomp.core.model import ErrorModel
from thermocomp.core.network import Affine, Network, Perceptron
from thermocomp.core.position import PositionModel
from thermocomp.core.profile import PolynomialProfile, SplineProfile
from thermocomp.core.provenance import Provenance
from thermocomp.core.terms import Variable
from thermocomp.core.validity import Validity
from thermocomp.core.zero import Zeroing
from thermocomp.files import modelfile, positionfile
from thermocomp.files.machines import read_machine
from thermocomp.nc.revision import jobstate
from thermocomp.nc.thermal import start
from thermocomp.nc.thermal.drift import Drift
from thermocomp.nc.thermal.stations import Station
from thermocomp.recordings.readers.mapping import read_mapping
from thermocomp.runtime.geometry.volumetric import VolumetricModel

MARKS = pack_marks(np.array([1, 5], dtype=np.uint32))
JOINT = JointSupport((1,), (0.5,), ((0.0,), (3.0,)), 1.5, (0,), ((0.0, 3000.0),), (60.0,))
VALIDITY = Validity(3, 2, 0.5, (3000.0,), (19.0, 23.0), "t3_C", (20.0, 21.0), 2, 12.5)
PROVENANCE = Provenance(
    "dynamic",
    {"copies": "2"},
    ("ab12",),
    ("1",),
    810,
    "0.1.0",
    "",
    Learned(1.0, 2.0, 0.1, 9.0),
    Prints(15.0, ((0, 800),), {"z_um": 0.3, "t": 0.1}, (Runs(2, MARKS, MARKS, {"z_um": MARKS, "t": MARKS}),)),
    ("cold",),
)
INPUTS = (SPEED, ROOM)
CURVES = (Curve((0.0, 3000.0), (0.0, 4.0)), Curve((-1.0, 2.0), (-0.5, 0.0, 0.4), "step"))


def whole(model: ErrorModel, policy: Literal["hold", "fade"] = "fade") -> ErrorModel:
    """Return a model with all that a file can say of it."""
    return replace(
        model,
        support=Support(policy, 0.1, 0.5),
        provenance=PROVENANCE,
        honest_error=ACCEPTED,
        validity=VALIDITY,
        joint=JOINT if len(model.inputs) > 1 else None,
        zeroing=Zeroing(300.0, 10.0, "spindle_rpm"),
    )


PERCEPTRON = Perceptron(((0.5, -1.0), (1.0, 0.2)), (0.1, 0.2), ((1.0, -1.0),), (0.3,), "tanh", "identity")
MODELS = (
    whole(lags(room=True)),
    whole(static(), "hold"),
    whole(ticking()),
    whole(net(), "hold"),
    whole(
        Additive(
            target="z_um",
            unit="um",
            inputs=INPUTS,
            variables=(Variable.single("n", 0), Variable("d", ((0, 1.0), (1, -0.5)))),
            curves=CURVES,
        )
    ),
    whole(
        Network(
            target="z_um",
            unit="um",
            inputs=INPUTS,
            net=PERCEPTRON,
            input_scaling=Affine((1e-3, 0.1), (0.0, 0.5)),
            output_scaling=Affine((5.0,), (1.0,)),
        )
    ),
)
DRIFT = replace(MODELS[0], target="Z0C")


def along(profile: PolynomialProfile | SplineProfile) -> PositionModel:
    return PositionModel(
        target="EYY",
        unit="um",
        axis="Y",
        travel=(0.0, 400.0),
        reference_position=10.0,
        profile=profile,
        offset=MODELS[0],
        slopes=(replace(MODELS[1], unit="um/m"), replace(MODELS[0], unit="um/m^2")),
        provenance=PROVENANCE,
    )


CUBIC = SplineProfile(axis="Y", knots=(0.0, 100.0, 400.0), pieces=((0.0, 1.0, 0.5, 0.2), (1.7, 0.0, 0.0, 1.0)))
POWERS = PolynomialProfile(
    exponents=((0, 0, 0), (1, 2, 0)),
    coefficients=(0.3, -2.5),
    centre=(0.0, 200.0, 0.0),
    scale=(1.0, 200.0, 1.0),
    low=(0.0, 0.0, -1.0),
    high=(600.0, 400.0, 1.0),
)
STATIONS = [
    Station("X", net("x_um"), shadow=True),
    Station("Y", ticking("y_um"), shadow=True),
    Station("Z", lags(), shadow=True),
]
MILL = """name = "mill"
structure = "w X' b Z Y (C1) t"
tool = ["0 mm", "0 mm", "-150 mm"]
reference_temperature = "20 degC"
[axes.X]
travel = ["0 mm", "600 mm"]
reference_position = "0 mm"
measured_at = ["0 mm", "0 mm", "0 mm"]
measured_tool = ["0 mm", "0 mm", "0 mm"]
[axes.Y]
travel = ["0 mm", "400 mm"]
rapid = "30 m/min"
acceleration = "3 m/s2"
[axes.Z]
travel = ["-0.5 m", "0 m"]
[spindle]
measured_tool = ["0 mm", "0 mm", "0 mm"]
[components]
EAX = "12 urad"
EXX = {profile = [["0 mm", "0 um"], ["300 mm", "1.5 um"], ["600 mm", "2 um"]]}
EYY = {model = "eyy.json"}
Z0C = {model = "drift.json", target = "Z0C"}
"""
MAPPING = """[time]
column = "time"
unit = "s"
start = "2024-03-01T08:00:00"
[columns.z]
column = "mcu_pos_z"
role = "displacement"
unit = "mm"
scale = 0.0025
zero = "first"
valid = [-10.0, 10.0]
[columns.chamber]
column = 3
role = "temperature"
missing = [-180.0, 850]
[read]
delimiter = ";"
decimal = ","
only_mapped = true
heading = 2
[cycles]
column = "cycle"
min_run_s = 300
"""


def run(model: ErrorModel, lot: random.Random) -> None:
    """Step a model with finite readings of any size: what it says is a number."""
    ends = [(i.reference + i.low, i.reference + i.high) for i in model.inputs]
    state = model.init()
    for k in range(6):
        row = [lot.choice((lot.uniform(a, b), lot.uniform(a, b), lot.choice((0.0, 1e300, -1.7e308)))) for a, b in ends]
        state, deviation = model.step(state, np.array(row), lot.choice((0.0, 1.0, 15.0, 1e5, 1e300)) if k else 0.0)
        assert np.isfinite(deviation).all(), model
        assert state.memory is not None
        assert np.isfinite(state.memory).all(), model
        assert not np.isnan(model.distance(state, np.array(row)))
    with suppress(ThermocompError):
        model.check_may_run()


def run_position(model: PositionModel, lot: random.Random) -> None:
    for part in model.models:
        run(part, lot)
    if len(model.models) == 3:
        ends = np.array([[-1e6, 0.0, 0.0], [0.0, 10.0, 1e6], [1.0, 399.0, -3.0]])
        assert np.isfinite(model.at(ends, np.array([1.0, 1e9, -1e9]))).all()


def read_models(path: Path, lot: random.Random) -> None:
    for model in modelfile.read(path):
        run(model, lot)


def read_positions(path: Path, lot: random.Random) -> None:
    for model in positionfile.read(path):
        run_position(model, lot)


def read_state(path: Path, lot: random.Random) -> None:
    begun = start.carry_over(STATIONS, jobstate.read(path).state)
    drift = Drift(STATIONS, begun)
    drift.advance(lot.choice((1.0, 1e5)), 3000.0)
    assert np.isfinite(drift.deviation((0.0, 0.0, 0.0))).all()


def read_mill(path: Path, lot: random.Random) -> None:
    model = VolumetricModel(read_machine(path))
    state = model.init()
    for dt in (0.0, 600.0):
        state, field = model.step(state, dict.fromkeys(model.inputs, lot.choice((25.0, 3000.0))), dt)
        assert np.isfinite(field.error(np.array([[0.0, 0.0, 0.0], [300.0, 200.0, -200.0]]))).all()


def read_rules(path: Path, lot: random.Random) -> None:
    read_mapping(path)


@pytest.fixture(scope="module")
def originals(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Path, str]]:
    """By kind of file, where a damaged one is written to, and a whole one."""
    folder = tmp_path_factory.mktemp("damaged")
    modelfile.write([DRIFT], folder / "drift.json")
    positionfile.write([along(CUBIC)], folder / "eyy.json")
    drift = Drift(STATIONS, start.begin_cold(STATIONS, {}))
    drift.advance(1234.5, 3210.0)
    written = datetime(2026, 11, 21, 12, tzinfo=UTC)
    return {
        **{f"model {k}": (folder / "m.json", modelfile.dumps([m])) for k, m in enumerate(MODELS)},
        "models": (folder / "m.json", modelfile.dumps(MODELS[:3])),
        "position": (folder / "p.json", positionfile.dumps([along(CUBIC), along(POWERS)])),
        "state": (folder / "s.json", jobstate.dumps(drift.state(), written)),
        "machine": (folder / "mill.toml", MILL),
        "mapping": (folder / "map.toml", MAPPING),
    }


KINDS: dict[str, Callable[[Path, random.Random], None]] = {
    **{f"model {k}": read_models for k in range(len(MODELS))},
    "models": read_models,
    "position": read_positions,
    "state": read_state,
    "machine": read_mill,
    "mapping": read_rules,
}


def damage(originals: dict[str, tuple[Path, str]], kind: str, seeds: range) -> dict[str, int]:
    """Read as many damaged files; return how many were refused and how many were used."""
    path, text = originals[kind]
    count = {"refused": 0, "used": 0}
    for seed in seeds:
        lot = random.Random(f"{kind} {seed}")
        path.write_bytes((spoil_toml if path.suffix == ".toml" else spoil_json)(text, lot))
        begun, said = time.monotonic(), ""
        try:
            KINDS[kind](path, lot)
            count["used"] += 1
        except ThermocompError as e:
            count["refused"] += 1
            said = str(e)
        except BaseException as e:
            e.add_note(f"{kind}, seed {seed}")
            raise
        assert time.monotonic() - begun < 10, (kind, seed)
        assert len(said) < 20_000, (kind, seed)
        assert "\x1b" not in said, (kind, seed)
    return count


@pytest.mark.parametrize("kind", KINDS)
def test_a_whole_file_is_used(originals: dict[str, tuple[Path, str]], kind: str) -> None:
    path, text = originals[kind]
    path.write_text(text, encoding="utf-8")
    KINDS[kind](path, random.Random(0))


@pytest.mark.parametrize("kind", KINDS)
def test_damaged_files(originals: dict[str, tuple[Path, str]], kind: str) -> None:
    count = damage(originals, kind, range(60))
    assert count["refused"] > 20


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_thousands_of_damaged_files(originals: dict[str, tuple[Path, str]], kind: str) -> None:
    """30,000 in all."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    count = damage(originals, kind, range(1000, 3728))
    assert count["refused"] > 1000
    assert count["used"] > 0
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 1_000_000  # kB
