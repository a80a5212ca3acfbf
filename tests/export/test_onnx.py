"""The graph of a compensator does what the compensator does: run by onnxruntime, for every family."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import onnx
import pytest
from driftmodels import ACCEPTED, growing, net, ticking
from families import CURVES, FAMILIES, HEAD, INPUTS, READINGS, SINGLES
from graphblock import GraphBlock, Said
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from onnx import numpy_helper
from watchedmachine import watched_model

from thermocomp.core.additive import Additive
from thermocomp.core.correction import Limits
from thermocomp.core.curves import Curve
from thermocomp.core.exceptions import InputError
from thermocomp.core.inputs import Input, Support
from thermocomp.core.joint import JointSupport
from thermocomp.core.model import ErrorModel
from thermocomp.core.polynomial import Polynomial
from thermocomp.core.position import PositionModel
from thermocomp.core.zero import Zeroing
from thermocomp.export.facts import Facts
from thermocomp.export.onnx.package import write_package
from thermocomp.export.onnx.vectors import answer, pick_readings, pick_zero
from thermocomp.export.vectors import Readings
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.gate import explain_implausible, find_plausible_range

FloatArray = NDArray[np.float64]
FREE = Limits(magnitude=1e9, rate=1e9)
FACTS = Facts("model.json", "0" * 64, "0.1", "2026-01-31")
SLOW: dict[str, Any] = {"max_examples": 10, "suppress_health_check": list(HealthCheck), "deadline": None}
ZERO = np.array([21.0, 20.0, 0.0])


def accepted(model: ErrorModel, **changes: Any) -> ErrorModel:
    return replace(model, honest_error=ACCEPTED, **changes)


def check_near(found: FloatArray, wanted: FloatArray, within: float = 1e-9) -> None:
    assert np.isfinite(found).all()
    assert (np.abs(found - wanted) <= within * np.maximum(1.0, np.abs(wanted))).all()


def check_graph(
    compensator: Compensator, rows: FloatArray, dt: FloatArray, zero: FloatArray = ZERO, within: float = 1e-9
) -> Said:
    """Run a compensator and its graph over the same rows; return what they said."""
    block, readings = GraphBlock(compensator), Readings(rows, np.zeros(len(rows)), dt)
    wanted, said = answer(block.inside, block.tables, readings, zero), block.run(readings, zero)
    assert (said.status == wanted.status).all()
    for name in ("correction", "slope", "deviation"):
        check_near(getattr(said, name), getattr(wanted, name), within)
    return said


@pytest.mark.parametrize("family", FAMILIES)
@settings(**SLOW)
@given(data=st.data(), rows=READINGS, zero=st.floats(15.0, 25.0))
def test_the_graph_is_the_model(family: str, data: st.DataObject, rows: list[tuple[float, ...]], zero: float) -> None:
    model: ErrorModel = accepted(data.draw(FAMILIES[family]))
    begin, block = np.array([zero, 20.0, 0.0]), GraphBlock(Compensator.of([model], FREE))
    for slower in (1.0, 40.0):  # long steps settle
        table = np.array(rows)
        steps = slower * table[:, 3]
        said = block.run(Readings(table[:, :3], np.zeros(len(table)), steps), begin)
        state, since, deviation = model.init(begin), 0.0, 0.0
        for k, (values, dt) in enumerate(zip(table[:, :3], steps.tolist(), strict=True)):
            since += dt
            if good := not explain_implausible(model, values.tolist(), begin.tolist()):
                state, told = model.step(state, values, since)
                since, deviation = 0.0, float(told)
            assert said.status[k, 0] == (1 if good else 2)
            check_near(said.deviation[k], np.array([deviation]))


@pytest.mark.parametrize("policy", ["clip", "hold"])
@settings(**SLOW | {"max_examples": 40})
@given(
    models=st.lists(st.one_of(*FAMILIES.values()), min_size=2, max_size=3),
    waiting=st.lists(st.booleans(), min_size=3, max_size=3),
    rows=READINGS,
    faults=st.lists(st.tuples(st.integers(0, 11), st.integers(0, 3), st.sampled_from([np.nan, np.inf, -np.inf, -1.0]))),
    limits=st.builds(Limits, st.floats(1, 30), st.floats(0.01, 3), st.sampled_from([0.0, 0.5]), st.floats(10, 90)),
    idle=st.sampled_from([(1800.0, 3600.0), (20.0, 40.0)]),
)
def test_several_targets_with_limits_and_faults(
    policy: Literal["clip", "hold"],
    models: list[ErrorModel],
    waiting: list[bool],
    rows: list[Any],
    faults: list[tuple[int, int, float]],
    limits: Limits,
    idle: tuple[float, float],
) -> None:
    absolute = (replace(INPUTS[0], rezero=False), *INPUTS[1:])
    models = [
        accepted(m, target=f"t{k}", inputs=INPUTS if w else absolute, support=Support(policy))
        for k, (m, w) in enumerate(zip(models, waiting, strict=False))
    ]
    table = np.array(rows)
    for k, c, wild in faults:
        table[k % len(table), c] = wild
    limits = replace(limits, hold=idle[0], fade=idle[1])
    check_graph(Compensator.of(models, limits), table[:, :3], table[:, 3])


@settings(**SLOW)
@given(curve=CURVES, at=st.lists(st.floats(-4.0, 9.0), min_size=1, max_size=5))
def test_a_table_is_its_curve(curve: Curve, at: list[float]) -> None:
    model = accepted(Additive(**HEAD, variables=(SINGLES[1],), curves=(curve,)))
    values = 20.0 + np.array([*at, *curve.x])  # at the breaks, too
    rows = np.column_stack([np.full(len(values), 21.0), values, np.zeros(len(values))])
    check_graph(Compensator.of([model], FREE), rows, np.ones(len(rows)))


def test_steps_are_taken_at_their_breaks() -> None:
    curve = Curve((-1.0, 0.5, 2.0), (1.0, 2.0, 3.0, 4.0), "step")
    model = accepted(Additive(**HEAD, variables=(SINGLES[1],), curves=(curve,)))
    rows = np.array([[21.0, t, 0.0] for t in (18.5, 19.0, 20.0, 20.5, 21.0, 22.0, 23.0)])
    said = check_graph(Compensator.of([model], FREE), rows, np.ones(7))
    assert said.deviation.ravel().tolist() == [1.0, 2.0, 2.0, 3.0, 3.0, 4.0, 4.0]


JOINT = JointSupport((0, 1), (4.0, 3.0), ((0.0, 0.0), (1.0, -1.0), (2.5, 1.0)), 1.5, (2,), ((0.0, 2500.0),), (250.0,))


@pytest.mark.parametrize("joint", [None, JOINT, replace(JOINT, columns=(), scale=(), points=())])
@pytest.mark.parametrize("policy", ["hold", "fade"])
@settings(**SLOW)
@given(model=st.one_of(*FAMILIES.values()), over=st.sampled_from([0.1, 0.5, 2.0]), rows=READINGS)
def test_beyond_the_trained_range(
    policy: Literal["hold", "fade"], joint: JointSupport | None, model: ErrorModel, over: float, rows: list[Any]
) -> None:
    table = np.array(rows)
    model = accepted(model, support=Support(policy, fade_over=over), joint=joint)
    check_graph(Compensator.of([model], FREE), table[:, :3], table[:, 3])


def test_it_holds_and_fades_where_it_has_to() -> None:
    rises = np.array([[21.0], [31.0], [39.0], [41.0], [29.0]])  # trained to 18 degC, the margin included
    said = {}
    for support in (Support("hold", margin=0.0), Support("fade", margin=0.0)):
        model = replace(growing("z_um", 1.0), support=support)
        model = replace(model, inputs=(replace(model.inputs[0], low=-3.0, high=15.0),))
        said[support.policy] = check_graph(Compensator.of([model], FREE), rises, np.full(5, 10.0), ZERO[:1])
    assert said["hold"].deviation.ravel().tolist() == [0.0, 10.0, 10.0, 10.0, 8.0]
    assert said["fade"].deviation.ravel() == pytest.approx([0.0, 10.0, 15.0 * (1 - 3 / 9), 15.0 * (1 - 5 / 9), 8.0])


@pytest.mark.parametrize(("policy", "wanted"), [("hold", [0.0, 2.0, 2.0, 8.0]), ("fade", [0.0, 2.0, 5.52, 8.0])])
def test_inputs_together(policy: Literal["hold", "fade"], wanted: list[float]) -> None:
    line = Polynomial(**HEAD, variables=SINGLES, terms=((0,),), coefficients=(1.0,), support=Support(policy))
    rows = np.array([[21.0, 20.0, 0.0], [23.0, 20.0, 0.0], [27.0, 22.0, 2760.0], [29.0, 22.0, 2740.0]])
    model = accepted(line, joint=replace(JOINT, limit=3.0))
    said = check_graph(Compensator.of([model], FREE), rows, np.full(4, 10.0))  # 2760 is 1.04 of what is allowed
    assert said.deviation.ravel() == pytest.approx(wanted)


def test_an_input_that_did_not_move_in_training_is_inside_where_it_was() -> None:
    model = Polynomial(
        target="z_um",
        unit="um",
        inputs=(replace(INPUTS[0], low=0.0, high=0.0),),
        variables=(SINGLES[0],),
        terms=(),
        coefficients=(),
        intercept=3.0,
        support=Support("fade"),
    )
    said = check_graph(Compensator.of([accepted(model)], FREE), np.array([[21.0], [21.5]]), np.ones(2), ZERO[:1])
    assert said.deviation.ravel().tolist() == [3.0, 0.0]


DEEP = replace(ticking(interval=15.0), a=(0.5, 0.2, -0.1), b=((1e-3, 2e-3, -5e-4, 7e-4),))


@pytest.mark.parametrize(
    "model", [DEEP, ticking(interval=15.0), net(interval=15.0), replace(ticking(), a=(0.6, 0.3999))]
)
def test_ticks_after_long_steps(model: ErrorModel) -> None:
    steps = np.array(
        [1.0, 14.99999, 15.00001, 15.0, 14.0, 0.001, 3600.0, 7.5, 7.5, 1e5, 1e-3, 44.999999, 45.0, 86400.0, 4.0]
    )
    rows = np.resize([0.0, 3000.0, 1500.0, 6000.0], (len(steps), 1))
    check_graph(Compensator.of([accepted(model)], FREE), rows, steps, np.zeros(1))


def test_the_longest_gap_ends() -> None:
    rows = np.full((4, 1), 3000.0)
    said = check_graph(
        Compensator.of([accepted(ticking(interval=1.0))], FREE), rows, np.array([1.0, 1e10, 1.0, 1e9]), np.zeros(1)
    )
    assert said.deviation[1:, 0] == pytest.approx(3.0 / 0.15)


def test_slopes_and_what_bends(tmp_path: Path) -> None:
    units = ("um/m", "um/m^2")
    source = PositionModel(
        target="EXX",
        unit="um",
        axis="X",
        travel=(-200.0, 600.0),
        reference_position=100.0,
        offset=growing("EXX", 3.0),
        slopes=tuple(growing("EXX", k, unit) for unit, k in zip(units, (4.0, -9.0), strict=True)),
    )
    limits = Limits(magnitude=20.0, rate=0.3, dead_band=0.2, hold=60.0, fade=50.0)
    compensator = Compensator.of([source, growing("z_um", -2.0)], limits)
    rises = np.concatenate([np.linspace(20.5, 35.0, 30), [20.5] * 20, [np.nan] * 20, [22.0, np.nan, 20.5]])
    said = check_graph(compensator, rises[:, None], np.resize([5.0, 20.0, 1.0], len(rises)), np.array([20.5]))
    ends = said.correction[:, :1] + said.slope[:, :1] * 1e-3 * np.array([-300.0, 500.0])
    assert np.abs(ends).max() <= 20.0 + 1e-9
    assert np.abs(said.slope[:, 0]).max() > 1.0
    assert (said.slope[:, 1] == 0.0).all()
    assert set(said.status.ravel()) == {1, 2, 3}
    for name, text in write_package(compensator, "mill", FACTS).items():
        (tmp_path / name).write_bytes(text)
    assert prove(tmp_path, "mill").returncode == 0
    assert "by the distance from 100 mm" in (tmp_path / "tc_mill.md").read_text()


def test_what_is_unproven_stays_zero() -> None:
    unproven = replace(growing("y_um", 2.0), honest_error=replace(ACCEPTED, verdict="unproven"))
    rows = np.array([[21.0], [25.0], [np.nan], [26.0]])
    said = check_graph(Compensator.of([growing("x_um", 2.0), unproven], FREE), rows, np.full(4, 10.0), ZERO[:1])
    assert said.correction.tolist()[1:] == [[-8.0, 0.0], [-8.0, 0.0], [-10.0, 0.0]]
    assert said.status.tolist() == [[1, 4], [1, 4], [2, 4], [1, 4]]


def test_the_zero_is_what_the_caller_says() -> None:
    block = GraphBlock(Compensator.of([growing("x_um", 2.0)], FREE))
    rows, zero = np.full((5, 1), 25.0), np.array([[21.0], [21.0], [np.nan], [np.inf], [23.0]])
    said = block.run(Readings(rows, np.zeros(5), np.full(5, 10.0)), zero)
    assert said.correction.ravel().tolist() == [0.0, -8.0, -8.0, -8.0, -4.0]
    assert said.status.ravel().tolist() == [1, 1, 2, 2, 1]


@pytest.mark.parametrize(
    ("quantity", "unit"),
    [("temperature", "degC"), ("spindle_speed", "1/min"), ("displacement", "um")],
)
@pytest.mark.parametrize(("low", "high", "rezero"), [(-3.0, 15.0, True), (-3.1, 0.7, False), (-30.0, 120.0, True)])
def test_what_is_plausible(quantity: str, unit: str, low: float, high: float, rezero: bool) -> None:
    line = growing("x_um", 1.0)
    channel = Input("t", quantity, unit, 20.0, rezero, low, high)
    block, zero = GraphBlock(Compensator.of([replace(line, inputs=(channel,))], FREE)), np.array([20.3])
    bounds = find_plausible_range(channel, 20.3 if rezero else 20.0)
    values = [*bounds, np.nextafter(bounds[0], -np.inf), np.nextafter(bounds[1], np.inf)]
    said = block.run(Readings(np.array(values)[:, None], np.zeros(4), np.full(4, 5.0)), zero)
    assert said.status.ravel().tolist() == [1, 1, 2, 2]


def test_a_time_that_is_none_moves_nothing() -> None:
    steps = np.array([np.nan, 1.0, 1e10, np.nextafter(1e10, np.inf), -1e-9, 0.0, np.inf, 5.0])
    rows = np.array([21.0, 21.0, 22.0, 23.0, 24.0, 25.0, 26.0, 27.0])[:, None]
    said = check_graph(Compensator.of([growing("x_um", 2.0)], FREE), rows, steps, ZERO[:1])
    assert said.status.ravel().tolist() == [2, 1, 1, 2, 2, 2, 2, 1]
    assert said.correction.ravel().tolist() == [0.0, 0.0, -2.0, -2.0, -2.0, -2.0, -2.0, -12.0]


HOSTILE = st.one_of(
    st.floats(),
    st.sampled_from([np.nan, np.inf, -np.inf, 1e308, -0.0, 85.0, -127.0, 0.0, 65535.0]),
    st.floats(19.0, 30.0),
)


@pytest.fixture(scope="module")
def limited() -> GraphBlock:
    limits = Limits(magnitude=5.0, rate=0.05, hold=120.0, fade=60.0)
    models = [watched_model("z_um"), accepted(ticking("a")), accepted(net("b"))]
    return GraphBlock(Compensator.of(models, limits))


@settings(**SLOW | {"max_examples": 300})
@given(
    rows=st.lists(
        st.tuples(
            *[st.one_of(st.just(21.0), st.floats(20, 26), HOSTILE)] * 4,
            *[st.one_of(st.just(21.0), st.just(21.0), HOSTILE)] * 4,
            st.one_of(st.floats(0.0, 90.0), HOSTILE),
        ),
        min_size=1,
        max_size=40,
    ),
    quiet=st.booleans(),
)
def test_nothing_that_comes_in_moves_it_beyond_its_limits(
    limited: GraphBlock, rows: list[tuple[float, ...]], quiet: bool
) -> None:
    table = np.array(rows, dtype=np.float64)
    values, zeros, dt = table[:, :4], np.full((len(table), 4), 21.0) if quiet else table[:, 4:8], table[:, 8]
    with np.errstate(over="ignore"):
        said = limited.run(Readings(values, np.zeros(len(table)), dt), zeros)
    assert all(np.isfinite(a).all() for a in said)
    good = (dt >= 0.0) & (dt <= 1e10)
    moved = np.abs(np.diff(said.correction, prepend=0.0, axis=0))
    assert (np.abs(said.correction) <= 5.0).all()
    assert (moved <= 0.05 * np.clip(np.where(good, dt, 0.0), 0.0, 60.0)[:, None] + 1e-9).all()
    if quiet:
        wanted = answer(limited.inside, limited.tables, Readings(values, np.zeros(len(table)), dt), np.full(4, 21.0))
        assert (said.status == wanted.status).all()
        check_near(said.correction, wanted.correction)


@settings(**SLOW | {"max_examples": 100})
@given(data=st.data())
def test_a_damaged_state_is_one_of_a_start(limited: GraphBlock, data: st.DataObject) -> None:
    state = np.zeros(limited.block.size)
    for k in data.draw(st.lists(st.integers(0, len(state) - 1), min_size=1, max_size=4)):
        state[k] = data.draw(HOSTILE)
    for _ in range(3):
        correction, slope, _, state = limited.step(np.full(4, 21.5), np.full(4, 21.0), 1.0, state)
        assert np.isfinite(state).all()
        assert (np.abs(correction) <= 5.0 + 1e-8).all()
        assert (slope == 0.0).all()


def test_the_test_vectors_show_all_that_it_does() -> None:
    compensator = Compensator.of([watched_model("z_um"), accepted(ticking("t"), zeroing=watched_model("z_um").zeroing)])
    block = GraphBlock(compensator)
    readings, zero = pick_readings(block.tables), pick_zero(block.tables)
    said = check_graph(compensator, readings.values, readings.dt, zero, 1e-12)
    assert set(said.status.ravel()) == {1, 2, 3}
    assert np.abs(said.correction).max() > 10.0
    assert np.isinf(readings.values).any()
    assert np.isnan(readings.values).any(axis=0).all()
    assert ((zero != [c.reference for c in block.tables.channels]) == [c.rezero for c in block.tables.channels]).all()


def prove(folder: Path, name: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(folder / f"tc_{name}_test.py")]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_the_file_says_what_it_is_and_is_the_same_each_time() -> None:
    compensator = Compensator.of([watched_model("z_um"), watched_model("x_um")], Limits(rate=0.2))
    files, again = (write_package(compensator, "mill 1", FACTS) for _ in range(2))
    assert files == again
    assert list(files) == ["tc_mill_1.onnx", "tc_mill_1_vectors.json", "tc_mill_1_test.py", "tc_mill_1.md"]
    model = onnx.load_from_string(files["tc_mill_1.onnx"])
    onnx.checker.check_model(model, full_check=True)
    facts = FACTS.lines(compensator)
    assert model.doc_string.splitlines()[: len(facts)] == facts
    assert files["tc_mill_1.md"].decode().splitlines()[0] == f"{facts[0]}  "
    assert json.loads(files["tc_mill_1_vectors.json"])["facts"][0] == facts[0]
    said = {p.key: p.value for p in model.metadata_props}
    assert (said["verdict"], said["sha256"], said["date"]) == (facts[0], FACTS.sha256, FACTS.date)
    assert "0.2 um/s" in said["limits"]
    assert said["sign"].startswith("a correction [um] is added to the commanded position")
    assert {i.type.tensor_type.elem_type for i in model.graph.input} == {onnx.TensorProto.DOUBLE}


@pytest.mark.parametrize(
    ("was", "becomes"), [(0.1, 0.11), (3600.0, 3700.0), (1800.0, 1900.0), (60.0, 61.0), (1e10, 1e3), (0.5, 0.51)]
)
def test_a_mistake_in_the_graph_is_found(tmp_path: Path, was: float, becomes: float) -> None:
    files = write_package(Compensator.of([watched_model("z_um")]), "mill", FACTS)
    for name, text in files.items():
        (tmp_path / name).write_bytes(text)
    good = prove(tmp_path, "mill")
    assert (good.returncode, ", 0 wrong; largest difference " in good.stdout) == (0, True), good.stdout + good.stderr
    model = onnx.load_from_string(files["tc_mill.onnx"])
    hit = [t for t in model.graph.initializer if numpy_helper.to_array(t).tolist() == [was]]
    assert hit
    for t in hit:
        t.CopyFrom(numpy_helper.from_array(np.array([becomes]), t.name))
    (tmp_path / "tc_mill.onnx").write_bytes(model.SerializeToString())
    bad = prove(tmp_path, "mill")
    assert (bad.returncode, "call" in bad.stdout) == (1, True)


def test_models_that_average_their_zero_in_different_ways() -> None:
    models = [growing("x_um", 1.0), replace(growing("y_um", 1.0), zeroing=Zeroing(60.0, 20.0))]
    with pytest.raises(InputError, match="export each file separately"):
        write_package(Compensator.of(models), "mill", FACTS)
