"""The graph of a model does what the model does: run by onnxruntime, for every family."""

import json
import runpy
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any, Literal

import numpy as np
import onnx
import pytest
from driftmodels import ACCEPTED, growing, net, ticking
from families import CURVES, FAMILIES, HEAD, INPUTS, READINGS, SINGLES
from graphmodel import GraphModel
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from onnx import numpy_helper
from watchedmachine import watched_model

from thermocomp.core.additive import Additive
from thermocomp.core.correction import Limits
from thermocomp.core.curves import Curve
from thermocomp.core.inputs import Support
from thermocomp.core.joint import JointSupport
from thermocomp.core.model import ErrorModel
from thermocomp.core.polynomial import Polynomial
from thermocomp.core.position import PositionModel
from thermocomp.core.profile import coordinates
from thermocomp.core.terms import Variable
from thermocomp.core.zero import Zeroing
from thermocomp.export.facts import Facts
from thermocomp.export.onnx import nodes
from thermocomp.export.onnx.graph import translate
from thermocomp.export.onnx.package import NOT_INSIDE, write_package
from thermocomp.export.onnx.vectors import answer, make_readings
from thermocomp.export.scenarios import make_readings as make_faults
from thermocomp.export.vectors import replay
from thermocomp.files import modelfile, positionfile
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.program.tables import gather

FACTS = Facts("model.json", "0" * 64, "0.1", "2026-01-31")
SLOW: dict[str, Any] = {"max_examples": 10, "suppress_health_check": list(HealthCheck), "deadline": None}
ZERO = np.array([21.0, 20.0, 0.0])
UNPROVEN = replace(ACCEPTED, verdict="unproven", reason="one cycle is not enough")
JOINT = JointSupport((0, 1), (4.0, 3.0), ((0.0, 0.0), (1.0, -1.0), (2.5, 1.0)), 1.5, (2,), ((0.0, 2500.0),), (250.0,))


def accepted(model: ErrorModel, **changes: Any) -> ErrorModel:
    return replace(model, honest_error=ACCEPTED, **changes)


def column(*values: float) -> NDArray[np.float64]:
    return np.array(values)[:, None]


@pytest.mark.parametrize("family", FAMILIES)
@settings(**SLOW)
@given(data=st.data(), rows=READINGS, zero=st.floats(15.0, 25.0))
def test_the_graph_is_the_model(family: str, data: st.DataObject, rows: list[tuple[float, ...]], zero: float) -> None:
    model, table = GraphModel(data.draw(FAMILIES[family])), np.array(rows)
    for slower in (1.0, 40.0):  # long steps settle
        model.check(table[:, :3], slower * table[:, 3], np.array([zero, 20.0, 0.0]))


@pytest.mark.parametrize("joint", [None, JOINT, replace(JOINT, columns=(), scale=(), points=())])
@pytest.mark.parametrize("policy", ["clip", "hold", "fade"])
@settings(**SLOW)
@given(model=st.one_of(*FAMILIES.values()), over=st.sampled_from([0.1, 0.5, 2.0]), rows=READINGS)
def test_beyond_the_trained_range(
    policy: Literal["clip", "hold", "fade"],
    joint: JointSupport | None,
    model: ErrorModel,
    over: float,
    rows: list[Any],
) -> None:
    table = np.array(rows)
    GraphModel(replace(model, support=Support(policy, fade_over=over), joint=joint)).check(
        table[:, :3], table[:, 3], ZERO
    )


@settings(**SLOW)
@given(curve=CURVES, at=st.lists(st.floats(-4.0, 9.0), min_size=1, max_size=5))
def test_a_table_is_its_curve(curve: Curve, at: list[float]) -> None:
    model = Additive(**HEAD, variables=(SINGLES[1],), curves=(curve,))
    values = 20.0 + np.array([*at, *curve.x])  # at the breaks, too
    rows = np.column_stack([np.full(len(values), 21.0), values, np.zeros(len(values))])
    GraphModel(model).check(rows, np.ones(len(rows)), ZERO)


def test_steps_are_taken_at_their_breaks() -> None:
    curve = Curve((-1.0, 0.5, 2.0), (1.0, 2.0, 3.0, 4.0), "step")
    model = GraphModel(Additive(**HEAD, variables=(SINGLES[1],), curves=(curve,)))
    rows = np.array([[21.0, t, 0.0] for t in (18.5, 19.0, 20.0, 20.5, 21.0, 22.0, 23.0)])
    assert model.check(rows, np.ones(7), ZERO).tolist() == [1.0, 2.0, 2.0, 3.0, 3.0, 4.0, 4.0]


@pytest.mark.parametrize(
    ("policy", "wanted"),
    [
        ("clip", [0.0, 10.0, 15.0, 15.0, 8.0]),
        ("hold", [0.0, 10.0, 10.0, 10.0, 8.0]),
        ("fade", [0.0, 10.0, 15.0 * (1 - 3 / 9), 15.0 * (1 - 5 / 9), 8.0]),
    ],
)
def test_it_holds_and_fades_where_it_has_to(policy: Literal["clip", "hold", "fade"], wanted: list[float]) -> None:
    model = growing("z_um", 1.0)  # trained to 18 degC, the margin included
    trained = replace(model.inputs[0], low=-3.0, high=15.0)
    graph = GraphModel(replace(model, inputs=(trained,), support=Support(policy, margin=0.0)))
    rises = column(21.0, 31.0, 39.0, 41.0, 29.0)
    assert graph.check(rises, np.full(5, 10.0), ZERO[:1]) == pytest.approx(wanted)
    outside = [graph.step(v, ZERO[:1], 1.0, np.array([1.0, 7.0]))[1][0] for v in rises]
    assert outside == [False, False, True, True, False]


@pytest.mark.parametrize(("policy", "wanted"), [("hold", [0.0, 2.0, 2.0, 8.0]), ("fade", [0.0, 2.0, 5.52, 8.0])])
def test_inputs_together(policy: Literal["hold", "fade"], wanted: list[float]) -> None:
    line = Polynomial(**HEAD, variables=SINGLES, terms=((0,),), coefficients=(1.0,), support=Support(policy))
    rows = np.array([[21.0, 20.0, 0.0], [23.0, 20.0, 0.0], [27.0, 22.0, 2760.0], [29.0, 22.0, 2740.0]])
    said = GraphModel(replace(line, joint=replace(JOINT, limit=3.0))).check(rows, np.full(4, 10.0), ZERO)
    assert said == pytest.approx(wanted)  # 2760 is 1.04 of what is allowed


def test_an_input_that_did_not_move_in_training_is_inside_where_it_was() -> None:
    still = replace(growing("z_um", 0.0), intercept=3.0, support=Support("fade"))
    still = replace(still, inputs=(replace(INPUTS[0], low=0.0, high=0.0),))
    assert GraphModel(still).check(column(21.0, 21.5), np.ones(2), ZERO[:1]).tolist() == [3.0, 0.0]


@pytest.mark.parametrize("policy", ["clip", "hold", "fade"])
def test_a_constant(policy: Literal["clip", "hold", "fade"]) -> None:
    model = replace(growing("z_um", 1.0), inputs=(), variables=(), terms=(), coefficients=(), intercept=3.0)
    graph = GraphModel(replace(model, support=Support(policy)))
    assert graph.check(np.empty((2, 0)), np.ones(2), np.empty(0)).tolist() == [3.0, 3.0]


DEEP = replace(ticking(interval=15.0), a=(0.5, 0.2, -0.1), b=((1e-3, 2e-3, -5e-4, 7e-4),))


@pytest.mark.parametrize(
    "model", [DEEP, ticking(interval=15.0), net(interval=15.0), replace(ticking(), a=(0.6, 0.3999))]
)
def test_ticks_after_long_steps(model: ErrorModel) -> None:
    steps = np.array(
        [1.0, 14.99999, 15.00001, 15.0, 14.0, 0.001, 3600.0, 7.5, 7.5, 1e5, 1e-3, 44.999999, 45.0, 86400.0, 4.0]
    )
    rows = np.resize([0.0, 3000.0, 1500.0, 6000.0], (len(steps), 1))
    GraphModel(model).check(rows, steps, np.zeros(1))


def test_the_longest_gap_ends() -> None:
    graph = GraphModel(ticking(interval=1.0))
    said = graph.check(np.full((5, 1), 3000.0), np.array([1.0, 1e10, 1.0, 1e9, 1e12]), np.zeros(1))
    assert said[1:] == pytest.approx(3.0 / 0.15)


@pytest.mark.parametrize("policy", ["clip", "hold"])
@pytest.mark.parametrize("model", [growing("z_um", 2.0), watched_model("z_um"), net()])
def test_inputs_are_those_of_the_model(model: ErrorModel, policy: Literal["clip", "hold"]) -> None:
    graph, size = GraphModel(replace(model, support=Support(policy))), len(model.inputs)
    wanted = {"value": [size], "zero": [size]}
    if model.remembers or policy == "hold":
        memory = model.step(model.init(np.zeros(size)), np.zeros(size), 0.0)[0].memory
        assert memory is not None
        wanted |= {"state": [2 + len(memory)]}
    assert graph.shapes == wanted | ({"dt": [1]} if model.remembers else {})


WILD = st.one_of(st.floats(), st.sampled_from([np.nan, np.inf, -np.inf, 1e308, -0.0, 65535.0]), st.floats(19.0, 30.0))


@pytest.fixture(scope="module")
def graphs() -> list[GraphModel]:
    models: list[ErrorModel] = [watched_model("z_um"), ticking("a"), net("b"), growing("c", 2.0)]
    return [GraphModel(replace(m, support=Support(p))) for m in models for p in ("clip", "hold", "fade")]


@settings(**SLOW | {"max_examples": 40})
@given(data=st.data())
def test_what_the_model_rejects_changes_nothing(graphs: list[GraphModel], data: st.DataObject) -> None:
    for graph in graphs:
        n = len(graph.model.inputs)
        row = st.tuples(*[st.one_of(st.floats(20.0, 26.0), WILD)] * n, st.one_of(st.floats(0.0, 90.0), WILD))
        table = np.array(data.draw(st.lists(row, min_size=1, max_size=12)), dtype=np.float64)
        with np.errstate(over="ignore"):
            graph.check(table[:, :n], table[:, n], np.array([21.0 if i.rezero else 0.0 for i in graph.model.inputs]))


def test_the_zero_is_what_the_caller_says() -> None:
    graph, state = GraphModel(accepted(growing("x_um", 2.0))), np.empty(0)
    zeros = (21.0, 23.0, np.nan, np.inf)
    said = [graph.step(np.array([25.0]), np.array([z]), 1.0, state)[0] for z in zeros]
    assert said[:2] == [8.0, 4.0]
    assert np.isnan(said[2:]).all()
    fixed = GraphModel(replace(graph.model, inputs=(replace(graph.model.inputs[0], rezero=False),)))
    assert [fixed.step(np.array([25.0]), np.array([z]), 1.0, state)[0] for z in zeros] == [10.0] * 4


def package(
    folder: Path, sources: Sequence[ErrorModel | PositionModel], limits: Limits = Limits(), by: str | None = None
) -> Compensator:
    """Write model file and export into a folder; return the compensator."""
    whole = [m for m in sources if isinstance(m, ErrorModel)]
    along = [m for m in sources if isinstance(m, PositionModel)]
    modelfile.write(whole, folder / "model.json") if whole else positionfile.write(along, folder / "model.json")
    compensator = Compensator.of([m.taken(by) for m in sources], limits, watching=True)
    facts = replace(FACTS, sha256=sha256((folder / "model.json").read_bytes()).hexdigest())
    for name, text in write_package(compensator, "mill", facts).items():
        (folder / name).write_bytes(text)
    return compensator


def prove(folder: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(folder / "tc_mill_test.py")]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def check_runs(folder: Path, compensator: Compensator) -> Any:
    """Compare the graphs inside a compensator with the compensator, on readings with faults; return what it says."""
    tables = gather(compensator)
    readings = make_faults(tables)
    wanted = replay(compensator, tables, readings)
    said = replay(runpy.run_path(str(folder / "tc_mill_run.py"))["load"](folder / "model.json"), tables, readings)
    for name, found in said._asdict().items():
        assert np.allclose(found, getattr(wanted, name), rtol=1e-9, atol=1e-9, equal_nan=True), name
    return said


@pytest.mark.parametrize("policy", ["clip", "hold"])
def test_inside_a_compensator(tmp_path: Path, policy: Literal["clip", "hold"]) -> None:
    first = replace(watched_model("z_um"), support=Support(policy))
    shared: dict[str, Any] = {"zeroing": first.zeroing, "watch": first.watch}
    models: list[ErrorModel] = [first, replace(first, target="x_um"), accepted(ticking("t"), **shared)]
    models += [replace(growing("y_um", 2.0), honest_error=UNPROVEN, **shared)]
    said = check_runs(tmp_path, package(tmp_path, models, Limits(magnitude=15.0, rate=0.05, dead_band=0.2)))
    assert np.abs(said.correction[:, 0]).max() > 10.0
    assert np.abs(said.correction).max() <= 15.0
    assert (said.correction[:, 3] == 0.0).all()
    assert set(said.status[:, :3].ravel()) == {0, 1, 2, 3, 5}
    assert set(said.status[:, 3]) >= {0, 4}
    assert prove(tmp_path).returncode == 0


def test_an_approval_is_of_its_target(tmp_path: Path) -> None:
    unproven = replace(growing("y_um", 2.0), honest_error=UNPROVEN)
    taken = replace(growing("x_um", 2.0), honest_error=replace(UNPROVEN, taken="M. Weber, trial"))
    said = check_runs(tmp_path, package(tmp_path, [taken, unproven]))
    assert np.abs(said.correction).max(axis=0).tolist() == [pytest.approx(100.0, abs=60.0), 0.0]
    folder = tmp_path / "all"
    folder.mkdir()
    said = check_runs(folder, package(folder, [unproven], by="M. Weber, trial"))
    assert np.abs(said.correction).max() > 10.0


def test_another_model_file_is_rejected(tmp_path: Path) -> None:
    package(tmp_path, [growing("x_um", 2.0)])
    modelfile.write([growing("x_um", 3.0)], tmp_path / "model.json", overwrite=True)
    command = [sys.executable, str(tmp_path / "tc_mill_run.py"), str(tmp_path / "model.json")]
    done = subprocess.run(command, input="", capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "model.json is not the model from which the graphs were written" in done.stderr


def test_readings_become_corrections(tmp_path: Path) -> None:
    package(tmp_path, [growing("x_um", 2.0)], Limits(magnitude=12.0, rate=1.0))
    command = [sys.executable, str(tmp_path / "tc_mill_run.py"), str(tmp_path / "model.json")]
    rows = "time_s,t,note\n0,21,cold\n10,24,\n20,,lost\n30,24.5,\n60,40,\n"
    done = subprocess.run(command, input=rows, capture_output=True, text=True, check=True)
    assert [line.strip() for line in done.stdout.splitlines()] == [
        "0 s: x_um 0.000 um, 0.000 um/m",
        "10 s: x_um -6.000 um, 0.000 um/m",
        "20 s: x_um -6.000 um, 0.000 um/m (t = nan degC is not plausible)",
        "30 s: x_um -7.000 um, 0.000 um/m",
        "60 s: x_um -12.000 um, 0.000 um/m",
    ]


def test_an_error_along_an_axis(tmp_path: Path) -> None:
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
    said = check_runs(tmp_path, package(tmp_path, [source], Limits(magnitude=20.0, rate=0.3)))
    assert np.abs(said.slope).max() > 1.0
    assert prove(tmp_path).returncode == 0
    page = (tmp_path / "tc_mill.md").read_text()
    assert "Reference positions: EXX 100 mm." in page
    assert "| `tc_mill_EXX_3.onnx` | EXX [um/m^2] | `value[0]`: t [degC] |" in page
    graphs = [GraphModel(m) for m in source.models]
    k_0, k_1, k_2 = (g.step(np.array([25.0]), np.array([21.0]), 1.0, np.empty(0))[0] for g in graphs)
    at = coordinates(np.array([400.0, 0.0, 0.0]))
    assert k_0 + 0.3 * k_1 + 0.09 * k_2 == pytest.approx(source.value(at, [12.0, 16.0, -36.0]))


@pytest.mark.parametrize("model", [watched_model("z_um"), ticking(), net(), growing("x_um", 2.0)])
def test_the_test_vectors_show_all_that_it_does(model: ErrorModel) -> None:
    zero = np.array([i.reference + 0.25 * i.rezero for i in model.inputs])
    values, steps = make_readings(model, zero)
    deviations, outside = answer(model, values, steps, zero)
    GraphModel(model).check(values, steps, zero, 1e-12)
    assert np.array(outside).any(axis=0).all()
    assert not np.array(outside).all(axis=0).any()
    assert np.isnan(values).any(axis=0).all()
    assert np.isinf(values).any()
    assert np.isnan(deviations).sum() == len(model.inputs) + 1 + 2 * model.remembers
    assert len(set(deviations.tolist())) > 50


def test_the_file_says_what_it_is_and_is_the_same_each_time() -> None:
    unproven = replace(growing("y_um", 2.0), honest_error=UNPROVEN)
    compensator = Compensator.of([watched_model("z_um"), unproven], Limits(rate=0.2))
    files, again = (write_package(compensator, "mill 1", FACTS) for _ in range(2))
    assert files == again
    name = "tc_mill_1"
    rest = [f"{name}_vectors.json", f"{name}_test.py", f"{name}_run.py", f"{name}.md"]
    assert list(files) == [f"{name}_z_um.onnx", f"{name}_y_um.onnx", *rest]
    facts = FACTS.lines(compensator)
    assert facts[0] == "z_um: accepted on unseen cycles; SHADOW ONLY, y_um: corrections stay zero"
    assert files[f"{name}.md"].decode().splitlines()[: len(facts)] == [f"{line}  " for line in facts]
    assert json.loads(files[f"{name}_vectors.json"])["facts"][0] == facts[0]
    assert files[f"{name}_run.py"].decode().splitlines()[0] == f"# {facts[0]}"
    verdicts = []
    for file in list(files)[:2]:
        model = onnx.load_from_string(files[file])
        onnx.checker.check_model(model, full_check=True)
        said = {p.key: p.value for p in model.metadata_props}
        verdicts.append(said["verdict"])
        assert model.doc_string.splitlines()[0] == said["verdict"]
        assert model.doc_string.splitlines()[-1] == NOT_INSIDE
        assert (said["model"], said["sha256"], said["version"], said["date"]) == (
            "model.json",
            "0" * 64,
            "0.1",
            FACTS.date,
        )
        assert "0.2 um/s" in said["limits"]
        assert said["sign"].startswith("a correction [um] is added to the commanded position")
        assert said["units"].startswith("temperatures in degC")
        assert said["deviation"] == f"{file[len(name) + 1 : -5]} [um]"
        assert (said["target"], said["unit"]) == (file[len(name) + 1 : -5], "um")
        names = json.loads(said["inputs"])
        assert len(names) == model.graph.input[0].type.tensor_type.shape.dim[0].dim_value
        ports = {p.name: p.doc_string for p in (*model.graph.input, *model.graph.output)}
        assert [words.split(" [")[0] for words in ports["value"].split(", ")] == names
        assert ports["value"] == said["value"]
        assert ports["zero"] == said["zeros"]
        assert ports["deviation"] == f"{said['target']} [um], actual minus commanded"
        assert all(ports.values())
        assert {i.type.tensor_type.elem_type for i in model.graph.input} == {onnx.TensorProto.DOUBLE}
    assert verdicts == [
        "z_um: accepted on unseen cycles",
        "SHADOW ONLY, y_um: not proven on unseen cycles; all corrections stay zero",
    ]


def test_zeros_are_stated_and_names_are_those_of_the_sensors() -> None:
    plain = growing("z_um", 1.0)
    (heat,) = plain.inputs
    inputs = (replace(heat, name="\u4e3b\u8f74"), replace(heat, name="oil", rezero=False, reference=21.5))
    model = replace(plain, inputs=inputs, variables=(Variable.single("\u4e3b\u8f74", 0),))
    files = write_package(Compensator.of([model]), "mill", FACTS)
    said = {p.key: p.value for p in onnx.load_from_string(files["tc_mill_z_um.onnx"]).metadata_props}
    assert json.loads(said["inputs"]) == ["\u4e3b\u8f74", "oil"]
    assert said["zeros"] == "\u4e3b\u8f74: mean at the start, oil: 21.5 degC"


def test_no_lower_opset_has_its_operators(monkeypatch: pytest.MonkeyPatch) -> None:
    model = replace(watched_model("z_um"), support=Support("fade"), joint=JOINT)
    assert onnx.load_from_string(translate(model).serialize("m", ["facts"], {}, "0")).opset_import[0].version == 13
    monkeypatch.setattr(nodes, "OPSET", 12)
    with pytest.raises((onnx.checker.ValidationError, onnx.shape_inference.InferenceError)):
        translate(model).serialize("m", ["facts"], {}, "0")


def test_targets_with_like_names_have_files_of_their_own() -> None:
    compensator = Compensator.of([growing("a b", 1.0), growing("a_b", 2.0), growing("\u4e3b", 3.0)])
    graphs = [name for name in write_package(compensator, "mill", FACTS) if name.endswith(".onnx")]
    assert graphs == ["tc_mill_a_b.onnx", "tc_mill_a_b_.onnx", "tc_mill_\u4e3b.onnx"]


@pytest.mark.parametrize("model", [replace(watched_model("z_um"), support=Support("fade")), net("z_um")])
def test_a_mistake_in_a_graph_is_found(tmp_path: Path, model: ErrorModel) -> None:
    package(tmp_path, [accepted(model, watch=None)])
    good = prove(tmp_path)
    assert (good.returncode, ", 0 wrong; largest difference " in good.stdout) == (0, True), good.stdout + good.stderr
    file = tmp_path / "tc_mill_z_um.onnx"
    graph = onnx.load(file)
    ticks = 1e-6  # early by so little
    wild = (0.0, ticks, 1e10, 1e12, 1e5, sys.float_info.max)  # zeros, and bounds of what may come in
    numbers = [t for t in graph.graph.initializer if t.data_type == onnx.TensorProto.DOUBLE]
    changed = 0
    for k in np.linspace(0, len(numbers) - 1, 8).astype(int).tolist():
        table = numpy_helper.to_array(numbers[k])
        if set(table.ravel().tolist()) <= set(wild) or np.isnan(table).any():
            continue
        was = numbers[k].SerializeToString()
        numbers[k].CopyFrom(numpy_helper.from_array(table * 1.01 + 1e-6, numbers[k].name))
        onnx.save(graph, file)
        bad = prove(tmp_path)
        assert (bad.returncode, "call" in bad.stdout) == (1, True), table
        numbers[k].ParseFromString(was)
        changed += 1
    assert changed >= 3


def test_models_that_average_their_zero_in_different_ways(tmp_path: Path) -> None:
    package(tmp_path, [growing("x_um", 1.0), replace(growing("y_um", 1.0), zeroing=Zeroing(60.0, 20.0))])
    page = (tmp_path / "tc_mill.md").read_text()
    assert page.count("mean over the first 20 s, over 60 s while the spindle is stopped") == 1
    assert prove(tmp_path).returncode == 0
