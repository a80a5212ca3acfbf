"""Numbers at their bounds get into C: in single precision they keep to them, or it says that it does not do."""

import re
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from compiledblock import COMPILERS, FLAGS, CompiledBlock
from driftmodels import ACCEPTED, ROOM, SPEED, growing
from families import HEAD, SINGLES
from hypothesis import given, settings
from hypothesis import strategies as st
from watchedmachine import watched_model

from thermocomp.cli.app import run
from thermocomp.core.additive import Additive
from thermocomp.core.autoregressive import Autoregressive
from thermocomp.core.bounds import COEFFICIENT, LEAST, round_single
from thermocomp.core.correction import Limits
from thermocomp.core.curves import Curve
from thermocomp.core.inputs import Input
from thermocomp.core.joint import JointSupport
from thermocomp.core.lineardynamic import LinearDynamic
from thermocomp.core.model import ErrorModel
from thermocomp.core.polynomial import Polynomial
from thermocomp.core.terms import Variable
from thermocomp.core.watch import Watch, Watched
from thermocomp.core.zero import Zeroing
from thermocomp.export.c99 import package as cpackage
from thermocomp.export.facts import Facts
from thermocomp.export.onnx import package as onnxpackage
from thermocomp.export.scenarios import make_readings
from thermocomp.export.st import package as stpackage
from thermocomp.export.vectors import Readings, round_all
from thermocomp.files import modelfile
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.program.tables import gather

FACTS = Facts("model.json", "0" * 64, "1.0", "2026-01-31")
needs_compiler = pytest.mark.skipif(not COMPILERS, reason="there is no C compiler")


WORDS = {"refused": "does not compile", "loss": "changes corrections by"}


def prove(folder: Path, texts: dict[str, bytes], switch: str) -> str:
    """Compile and run the test of an export; return what it says, or why it does not compile."""
    for file, text in texts.items():
        (folder / file).write_bytes(text)
    command = [COMPILERS[0], *FLAGS, switch, "tc_x.c", "tc_x_test.c", "-lm", "-o", "prove"]
    built = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if built.returncode:
        return built.stderr
    return subprocess.run(["./prove"], cwd=folder, capture_output=True, text=True, check=False).stdout


def at_the_bounds() -> ErrorModel:
    """Return a watched model whose scales, limits and time constants are as small as they may be."""
    model = watched_model("z_um")
    assert model.watch is not None
    tiny: dict[str, Any] = {"off": LEAST, "jump": LEAST, "moved": LEAST, "still": LEAST}
    states = tuple((i, power, LEAST, LEAST) for i, power, *_ in model.watch.states)
    watch = replace(
        model.watch,
        top_speed=LEAST,
        time_constants=(LEAST,) * len(model.watch.time_constants),
        states=states,
        sensors=tuple(replace(s, **tiny) for s in model.watch.sensors),
        pace=LEAST,
    )
    joint = JointSupport((0, 1), (LEAST, LEAST), ((0.0, COEFFICIENT),), LEAST, (3,), ((0.0,),), (LEAST,))
    joint = replace(joint, speeds=(), levels=(), tolerances=()) if len(model.inputs) < 4 else joint
    return replace(model, watch=watch, joint=joint)


def test_numbers_at_their_bounds_stay_within_them() -> None:
    model = at_the_bounds()
    rounded = round_all(model, round_single)
    assert rounded.watch.top_speed >= LEAST
    assert rounded.watch.top_speed == np.float32(rounded.watch.top_speed)
    texts = cpackage.write_package(Compensator.of([model]), "x", FACTS)
    assert "tc_x.c" in texts


@settings(max_examples=40)
@given(
    st.lists(st.tuples(st.floats(LEAST, 1e10), st.floats(LEAST, 8.0), st.floats(LEAST, 1e10)), min_size=1, max_size=4),
    st.floats(LEAST, 1e9),
    st.one_of(st.just(LEAST), st.floats(LEAST, 1e12)),
)
def test_a_watch_of_any_numbers_can_be_rounded(states: list[Any], top: float, limit: float) -> None:
    known = watched_model("z_um").watch
    assert known is not None
    (speed,) = known.speeds.tolist()
    sensors = tuple(
        replace(s, off=limit, jump=limit, moved=limit, weights=(*s.weights[: -len(known.states)], *[0.5] * len(states)))
        for s in known.sensors
    )
    watch: Watch = replace(
        known,
        states=tuple((speed, power, slow, fast) for slow, power, fast in states),
        top_speed=top,
        sensors=sensors,
    )
    round_all(watch, round_single)  # refuses what is beyond its bounds


def test_what_was_judged_is_not_rounded() -> None:
    judged = replace(ACCEPTED, none_rms=5.1, lost={"t1_C": 5.1})
    model = replace(watched_model("z_um"), honest_error=judged)
    assert model.may_lose(["t1_C"])
    rounded = round_all(model, round_single)
    assert rounded.honest_error == judged
    assert rounded.may_lose(["t1_C"])


@needs_compiler
def test_the_mean_over_a_cycle_of_a_millisecond(tmp_path: Path) -> None:
    """300,000 readings: a mean in single precision would not follow the last half of them."""
    model = replace(growing("z_um", 2.0), zeroing=Zeroing(300.0, 300.0))
    rows = 20.0 + np.minimum(np.arange(301_000) / 300_000.0, 1.0)
    readings = Readings(rows[:, None], np.zeros(len(rows)), np.full(len(rows), 0.001))
    compensator, offsets = Compensator.of([model], Limits(rate=1e6)), list[float]()
    for flags in (("-UTC_FLOAT",), ("-DTC_FLOAT",)):
        folder = tmp_path / flags[0]
        folder.mkdir()
        said = CompiledBlock(compensator, folder, flags=flags).run(readings)
        assert 299_990 < (said.status[:, 0] == 0).sum() <= 300_001
        offsets.append(float(said.correction[-1, 0]))
    assert offsets[0] == pytest.approx(-2.0 * (21.0 - 20.5), abs=1e-5)
    assert offsets[1] == pytest.approx(offsets[0], abs=1e-5)


def sixteen() -> Compensator:
    """Return five targets of 16 temperatures and the speed with a watch, like the model of the demo."""
    heat = [replace(ROOM, name=f"t{k}_C") for k in range(16)]
    zeroing, taus = Zeroing(300.0, 10.0, SPEED.name), tuple(60.0 * 2.0**k for k in range(10))
    parts = 16 * (1 + len(taus)) + 10
    sensors = [
        Watched(k, tuple(0.01 * (j % 16 != k) for j in range(parts - 10)) + (0.1,) * 10, 9.0, 9.0, 9.0, 7200.0, 0.2)
        for k in range(16)
    ]
    states = tuple((16, 1.0 + 0.1 * k, 1200.0, 600.0) for k in range(10))
    watch = Watch((*heat, SPEED), zeroing, taus, 6000.0, states, tuple(sensors))
    model = LinearDynamic(
        target="z_um",
        unit="um",
        inputs=(*heat, SPEED),
        signals=tuple((k,) for k in range(17)),
        direct=(0.1,) * 16 + (1e-4,),
        lag_signals=tuple(k for k in range(17) for _ in taus),
        time_constants=taus * 17,
        lagged=((0.01,) * 16 + (1e-5,)) * len(taus),
        zeroing=zeroing,
        watch=watch,
        honest_error=ACCEPTED,
    )
    return Compensator.of([replace(model, target=t) for t in ("x1_um", "x2_um", "y1_um", "y2_um", "z_um")])


@needs_compiler
def test_the_state_of_sixteen_sensors_with_a_watch_takes_20_kilobytes(tmp_path: Path) -> None:
    """No readings are stored: it fits into a small controller."""
    texts, sizes = cpackage.write_package(sixteen(), "x", FACTS), list[int]()
    for switch in ("-UTC_FLOAT", "-DTC_FLOAT"):
        said = prove(tmp_path, texts, switch)
        assert " 0 wrong" in said
        sizes += [int(found) for found in re.findall(r"state: (\d+) bytes", said)]
    assert 1_000 < sizes[1] < sizes[0] <= 20_000
    (page,) = (
        text for name, text in stpackage.write_package(sixteen(), "x", FACTS, "scl").items() if name[-3:] == ".md"
    )
    assert int(re.findall(rb"(\d+) kB per instance", page)[0]) >= sizes[0] // 1000


@needs_compiler
@pytest.mark.parametrize("most", [0.3, 0.7, 1.1])
def test_no_correction_is_larger_than_its_limit(tmp_path: Path, most: float) -> None:
    compensator = Compensator.of([watched_model("z_um")], Limits(magnitude=most, rate=0.1))
    block = CompiledBlock(compensator, tmp_path, flags=("-DTC_FLOAT",))
    readings = make_readings(gather(compensator))
    said = np.abs(block.run(readings).correction)
    assert 0.99 * most < said.max() <= most


@needs_compiler
def test_steps_that_readings_are_beside(tmp_path: Path) -> None:
    edges = np.arange(-1.0, 3.0, 0.0005)
    curve = Curve(tuple(edges.tolist()), tuple((0.01 * np.arange(len(edges) + 1)).tolist()), "step")
    model = Additive(**HEAD, variables=(SINGLES[0],), curves=(curve,), honest_error=ACCEPTED)
    texts = cpackage.write_package(Compensator.of([model]), "x", FACTS)
    for switch in ("-UTC_FLOAT", "-DTC_FLOAT"):
        assert " 0 wrong" in prove(tmp_path, texts, switch)


@needs_compiler
def test_points_of_a_curve_that_single_precision_does_not_tell_apart(tmp_path: Path) -> None:
    x = [-2.0, 1.0]
    x += [float(np.nextafter(x[-1], 2.0)), 1.0 + 1e-9, 3.0]
    model = Additive(**HEAD, variables=(SINGLES[0],), curves=(Curve(tuple(x), (0.0, 3.0, 3.0, 3.0, 9.0)),))
    texts = cpackage.write_package(Compensator.of([replace(model, honest_error=ACCEPTED)]), "x", FACTS)
    for switch in ("-UTC_FLOAT", "-DTC_FLOAT"):
        assert " 0 wrong" in prove(tmp_path, texts, switch)


@needs_compiler
@pytest.mark.parametrize("factor", [100.0, 1500.0, 2e4])
def test_large_coefficients_make_more_of_the_last_digit(
    tmp_path: Path, factor: float, capsys: pytest.CaptureFixture[str]
) -> None:
    """Temperatures that hardly move: thousands of micrometres per kelvin, which cancel."""
    names = [f"t{k}_C" for k in range(3)]
    model = Polynomial(
        target="z_um",
        unit="um",
        inputs=tuple(Input(n, "temperature", "degC", 20.0, True, -10.0 / factor, 10.0 / factor) for n in names),
        variables=tuple(Variable.single(n, k) for k, n in enumerate(names)),
        terms=((0,), (1,), (2,)),
        coefficients=(3.0 * factor, 2.0 * factor, -4.0 * factor),
    )
    model = replace(model, honest_error=ACCEPTED)
    texts = cpackage.write_package(Compensator.of([model]), "x", FACTS)
    assert " 0 wrong" in prove(tmp_path, texts, "-UTC_FLOAT")
    modelfile.write([model], tmp_path / "model.json")
    assert run(["export", str(tmp_path / "model.json"), "--to", "c99", "-o", str(tmp_path / "out")]) == 0
    assert ("\nSingle precision (-DTC_FLOAT) " in capsys.readouterr().out) == (factor > 100.0)
    single, page = prove(tmp_path, texts, "-DTC_FLOAT"), texts["tc_x.md"].decode()
    stated = {name: "\nSingle precision (-DTC_FLOAT) " + words in page for name, words in WORDS.items()}
    if factor == 2e4:
        assert "single precision is too coarse" in single  # by up to 0.92 um
        assert stated == {"refused": True, "loss": False}
    else:
        assert " 0 wrong" in single
        assert stated == {"refused": False, "loss": factor > 100.0}
        if factor > 100.0:
            assert 0.05 < float(re.findall(r"corrections by up to ([\d.]+) um", page)[0]) < 0.5


def slow(*poles: float) -> Autoregressive:
    a = (-np.poly(poles)[1:]).tolist()
    speed = Input("n", "spindle_speed", "1/min", 0.0, False, 0.0, 3000.0)
    gain = 0.01 * (1.0 - sum(a))
    return Autoregressive(
        target="z_um", unit="um", inputs=(speed,), a=tuple(a), b=((gain,),), interval=15.0, honest_error=ACCEPTED
    )


@needs_compiler
@pytest.mark.parametrize("poles", [(0.9972, 0.9972), (0.999, 0.999), (0.9999, 0.9999), (0.9999,), (0.99, 0.98, 0.5)])
def test_a_free_run_that_decays_slowly(tmp_path: Path, poles: tuple[float, ...]) -> None:
    texts = cpackage.write_package(Compensator.of([slow(*poles)]), "x", FACTS)
    assert " 0 wrong" in prove(tmp_path, texts, "-UTC_FLOAT")
    single, refused = prove(tmp_path, texts, "-DTC_FLOAT"), b"too coarse for this model" in texts["tc_x.md"]
    assert ("single precision is too coarse for this model" in single) == refused
    assert refused or " 0 wrong" in single
    assert refused == (poles in ((0.999, 0.999), (0.9999, 0.9999)))


def test_the_other_proofs_of_it_allow_as_much() -> None:
    compensator = Compensator.of([slow(0.9999, 0.9999)])
    text = stpackage.write_package(compensator, "x", FACTS)["tc_x_test.st"].decode()
    assert re.search(r"apart <= 0\.002\d* *\)", text)
    quick = stpackage.write_package(Compensator.of([slow(0.9)]), "x", FACTS)["tc_x_test.st"].decode()
    assert "apart <= 1.0E-09" in quick
    pytest.importorskip("onnx")
    vectors = onnxpackage.write_package(compensator, "x", FACTS)["tc_x_vectors.json"].decode()
    assert '"tolerance": 0.002' in vectors
