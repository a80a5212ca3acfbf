"""The C code of a compensator does what the compensator does: compiled by a real compiler, for every family."""

import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from compiledblock import COMPILERS, FLAGS, OPTIMISED, SANITIZED, CompiledBlock, check_block, check_same
from driftmodels import ACCEPTED
from families import CURVES, FAMILIES, HEAD, INPUTS, READINGS, SINGLES
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from watchedmachine import failing, watched_model

from thermocomp.core.additive import Additive
from thermocomp.core.correction import Limits
from thermocomp.core.curves import Curve
from thermocomp.core.inputs import Input, Support
from thermocomp.core.model import ErrorModel
from thermocomp.core.polynomial import Polynomial
from thermocomp.core.terms import Variable
from thermocomp.export.c99.c99 import translate
from thermocomp.export.c99.package import write_package
from thermocomp.export.facts import Facts
from thermocomp.export.scenarios import make_readings
from thermocomp.export.vectors import Readings, replay
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.program.tables import gather

FloatArray = NDArray[np.float64]
FACTS = Facts("model.json", "", "0", "2026-01-31")
FREE = Limits(magnitude=1e9, rate=1e9)
SLOW: dict[str, Any] = {"max_examples": 10, "suppress_health_check": [HealthCheck.too_slow], "deadline": None}

pytestmark = pytest.mark.skipif(not COMPILERS, reason="there is no C compiler")


def accepted(model: ErrorModel, **changes: Any) -> ErrorModel:
    return replace(model, honest_error=ACCEPTED, **changes)


def test_a_name_that_would_end_a_comment_does_not() -> None:
    name = "a*/ #error /*b ??/ \u00b0"
    model = Polynomial(
        target="z 1*/",
        unit="um",
        inputs=(Input(name, "temperature", "degC", 20.0, True, -3.0, 15.0),),
        variables=(Variable.single(name, 0),),
        terms=((0,),),
        coefficients=(2.0,),
    )
    compensator = Compensator.of([accepted(model)], FREE)
    assert translate(gather(compensator), "z 1*/").name == "tc_z_1"
    said = check_block(compensator, np.array([[20.0], [23.0]]), np.ones(2))
    assert said.correction[-1].tolist() == [-6.0]


@settings(**SLOW)
@given(curve=CURVES, at=st.lists(st.floats(-4.0, 9.0), min_size=1, max_size=5))
def test_a_table_is_its_curve(curve: Curve, at: list[float]) -> None:
    model = accepted(Additive(**HEAD, variables=(SINGLES[1],), curves=(curve,)))
    values = 20.0 + np.array([*at, *curve.x])  # at the breaks, too
    rows = np.column_stack([np.full(len(values), 20.0), values, np.zeros(len(values))])
    check_block(Compensator.of([model], FREE), rows, np.ones(len(rows)))


@pytest.mark.parametrize("family", FAMILIES)
@settings(**SLOW | {"max_examples": 6})
@given(data=st.data(), rows=READINGS)
def test_in_single_precision_it_says_nearly_the_same(
    family: str, data: st.DataObject, rows: list[tuple[float, ...]]
) -> None:
    model: ErrorModel = accepted(data.draw(FAMILIES[family]))
    table = np.array(rows)
    compensator = Compensator.of([model], FREE)
    check_block(compensator, table[:, :3], table[:, 3], flags=(*SANITIZED, "-DTC_FLOAT"), within=1e-3)


@pytest.mark.parametrize("flags", [SANITIZED, (*SANITIZED, "-DTC_FLOAT")])
def test_an_input_that_did_not_move_in_training_is_inside_where_it_was(flags: tuple[str, ...]) -> None:
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
    said = check_block(Compensator.of([accepted(model)], FREE), np.array([[20.0], [20.5]]), np.ones(2), flags=flags)
    assert said.deviation.ravel().tolist() == [3.0, 0.0]


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("flags", [SANITIZED, OPTIMISED, ("-DTC_FLOAT", *SANITIZED)])
def test_the_readings_of_the_test_vectors_show_all_that_it_does(
    tmp_path: Path, flags: tuple[str, ...], compiler: str
) -> None:
    compensator = Compensator.of([watched_model("z_um")], Limits(fade=600.0))
    block = CompiledBlock(compensator, tmp_path, compiler, flags)
    readings = make_readings(block.tables)
    said = replay(compensator, block.tables, readings)
    check_same(said, block.run(readings), 1e-5 if "-DTC_FLOAT" in flags else 1e-12)
    assert set(said.status.ravel()) == {0, 1, 2, 3, 5}
    assert {0, 1, 2, 3, 6} <= set(said.fault.ravel())
    assert 0.1 < said.passed.mean() < 0.9
    assert np.abs(said.correction).max() > 10.0
    fading = np.abs(said.correction[said.status[:, 0] == 3])
    assert fading.min() < 0.2 * fading.max()


@pytest.fixture(scope="module")
def two_targets(tmp_path_factory: pytest.TempPathFactory) -> tuple[Compensator, CompiledBlock, CompiledBlock]:
    """Return a compensator, and its code in double and in single precision."""
    compensator = Compensator.of([watched_model("z_um"), watched_model("x_um")], Limits(dead_band=0.2))
    precisions = (SANITIZED, ("-DTC_FLOAT", *SANITIZED))
    double, single = (CompiledBlock(compensator, tmp_path_factory.mktemp("two"), flags=f) for f in precisions)
    return compensator, double, single


NOTHING: dict[str, tuple[float, float | None]] = {}


@pytest.mark.parametrize(
    ("cuts", "found"),
    [
        (NOTHING, [0, 0, 0]),
        ({"t1_C": (1.0, None)}, [1, 0, 0]),
        ({"t2_C": (1.0, 3.0)}, [0, 2, 0]),
        ({"t3_C": (1.0, None)}, [0, 0, 1]),
        ({"t1_C": (1.0, 6.0), "t2_C": (4.0, -6.0)}, [2, 2, 0]),
        ({"t1_C": (1.0, None), "t3_C": (2.0, None)}, [1, 0, 1]),
    ],
)
def test_sensors_that_fail(
    cuts: dict[str, Any], found: list[int], two_targets: tuple[Compensator, CompiledBlock, CompiledBlock]
) -> None:
    (compensator, double, single), day = two_targets, failing(**cuts)
    rows = day.table[[c.name for c in double.tables.channels]].to_numpy(dtype=np.float64)
    readings = Readings(rows, np.zeros(len(rows)), np.diff(day.time, prepend=day.time[0]))
    said = replay(compensator, double.tables, readings)
    check_same(said, double.run(readings))
    check_same(said, single.run(readings), 2e-4)
    assert said.fault.max(axis=0).tolist() == [*found, 0]  # the speed is right
    assert (said.status[-1] > 1).all() == (found[2] > 0)  # without t3_C it does harm: held, then faded


@pytest.mark.parametrize("rpm", [0.0, 1500.0])
@pytest.mark.parametrize("dt", [0.3, 1.0])
def test_the_zero_of_many_readings(dt: float, rpm: float) -> None:
    compensator, rng, n = Compensator.of([watched_model("z_um")]), np.random.default_rng(3), 1500
    rows = np.column_stack([20.0 + np.cumsum(rng.normal(0.0, 0.004, (n, 3)), axis=0), np.full(n, rpm)])
    rows[n // 2 :, 3] = 2500.0
    rows[rng.random(rows.shape) < 0.003] = np.nan
    said = check_block(compensator, np.round(rows, 3), dt * rng.choice([1.0, 1.5], n), age=rng.uniform(0.0, 0.2, n))
    if rpm == 0.0 and dt < 0.5:  # until the spindle starts, whatever the number of readings
        assert (said.status[:, 0] == 0).sum() == n // 2 - np.isnan(rows[: n // 2, 3]).sum()
    assert np.abs(said.correction).max() > 1.0


HOSTILE = st.one_of(
    st.floats(),
    st.sampled_from([np.nan, np.inf, -np.inf, 1e308, -0.0, 85.0, -127.0, 0.0, 65535.0]),
    st.floats(19.0, 30.0),
)


@pytest.fixture(scope="module")
def limited(tmp_path_factory: pytest.TempPathFactory) -> tuple[Compensator, CompiledBlock]:
    compensator = Compensator.of([watched_model("z_um")], Limits(magnitude=5.0, rate=0.05, hold=120.0, fade=60.0))
    return compensator, CompiledBlock(compensator, tmp_path_factory.mktemp("limited"))


@settings(**SLOW | {"max_examples": 400, "suppress_health_check": list(HealthCheck)})
@given(
    rows=st.lists(
        st.tuples(*[st.one_of(st.just(21.0), st.floats(20, 26), HOSTILE)] * 4, HOSTILE, HOSTILE),
        min_size=1,
        max_size=60,
    ),
    quiet=st.booleans(),
)
def test_nothing_that_comes_in_moves_it_beyond_its_limits(
    limited: tuple[Compensator, CompiledBlock], rows: list[tuple[float, ...]], quiet: bool
) -> None:
    compensator, block = limited
    table = np.array(rows, dtype=np.float64)
    age = np.abs(np.nan_to_num(table[:, 4], posinf=0, neginf=0)) % 5 if quiet else table[:, 4]
    dt = np.abs(np.nan_to_num(table[:, 5], posinf=0, neginf=0)) % 90 if quiet else table[:, 5]
    readings = Readings(table[:, :4], age, dt)
    said = block.run(readings)
    check_same(replay(compensator, block.tables, readings), said)
    moved = np.abs(np.diff(said.correction[:, 0], prepend=0.0))
    assert (np.abs(said.correction) <= 5.0).all()
    clock = 0.05 * np.spacing(1e10)  # a time since the first call of up to 300 years is not exact
    assert (moved <= 0.05 * np.clip(np.nan_to_num(dt), 0.0, 60.0) + clock + 1e-9).all()


@pytest.mark.parametrize("flags", [("-UTC_FLOAT",), ("-DTC_FLOAT",)])
def test_the_program_of_the_page_compiles_and_runs(tmp_path: Path, flags: tuple[str, ...]) -> None:
    """As it stands on the page, with all warnings; its loop ends here after three calls."""
    texts = write_package(Compensator.of([watched_model("z_um")]), "mill", FACTS)
    page = texts["tc_mill.md"].decode().partition("## Run it")[2].partition("\n## ")[0]
    lines = [line[4:] for line in page.splitlines() if line.startswith("    ") or not line]
    program = "\n".join(lines).replace("for (;;)", "for (int k = 0; k < 3; k++)")
    assert program.count("k++") == 1
    for file, text in {**texts, "main.c": program.encode()}.items():
        (tmp_path / file).write_bytes(text)
    command = [COMPILERS[0], *FLAGS, *flags, "tc_mill.c", "main.c", "-lm", "-o", "main"]
    subprocess.run(command, cwd=tmp_path, check=True)
    subprocess.run(["./main"], cwd=tmp_path, check=True)
