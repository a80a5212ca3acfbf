"""The C code of a model says what the model says: compiled by a real compiler, for every family."""

import ctypes
import shutil
import subprocess
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from families import CURVES, FAMILIES, HEAD, INPUTS, READINGS, SINGLES
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from thermocomp.core.additive import Additive, Curve
from thermocomp.core.inputs import Input, Support
from thermocomp.core.joint import JointSupport
from thermocomp.core.model import ErrorModel
from thermocomp.core.polynomial import Polynomial
from thermocomp.core.terms import Variable
from thermocomp.exporters.c99 import Sources, translate

FLAGS = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O2", "-fsanitize=undefined", "-fno-sanitize-recover"]
COMPILERS = [c for c in ("gcc", "clang") if shutil.which(c)]

pytestmark = pytest.mark.skipif(not COMPILERS, reason="there is no C compiler")


class Compiled:
    """A model's C code that runs in this process."""

    def __init__(self, sources: Sources, n_inputs: int, folder: Path, compiler: str, *, single: bool = False) -> None:
        (folder / f"{sources.name}.h").write_text(sources.header, encoding="ascii")
        code, library = folder / f"{sources.name}.c", folder / "model.so"
        code.write_text(sources.source, encoding="ascii")
        flags = [*FLAGS, *(["-DTC_FLOAT"] if single else [])]
        subprocess.run([compiler, *flags, "-shared", "-fPIC", str(code), "-o", str(library), "-lm"], check=True)
        kind: Any = ctypes.c_float if single else ctypes.c_double
        found = ctypes.CDLL(str(library))
        self._start, self._step = (getattr(found, f"{sources.name}_{verb}") for verb in ("start", "step"))
        self._step.restype, self._kind = kind, kind
        self._step.argtypes = [ctypes.c_void_p, kind * n_inputs, kind]
        self._inputs, self._state = kind * n_inputs, ctypes.create_string_buffer(100_000)

    def start(self, zero: list[float]) -> None:
        self._start(self._state, self._inputs(*zero))

    def step(self, values: list[float], dt: float) -> float:
        return float(self._step(self._state, self._inputs(*values), dt))


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("family", FAMILIES)
@settings(max_examples=12, suppress_health_check=[HealthCheck.too_slow], deadline=None)
@given(data=st.data(), rows=READINGS)
def test_the_code_is_the_model(family: str, compiler: str, data: st.DataObject, rows: list[tuple[float, ...]]) -> None:
    model: ErrorModel = data.draw(FAMILIES[family])
    with tempfile.TemporaryDirectory() as folder:
        code = Compiled(translate(model), 3, Path(folder), compiler)
        for repeat in (1, 40):  # a second run begins anew; long ones settle
            code.start([rows[0][0], 20.0, 0.0])
            state = model.init()
            for *values, dt in rows:
                state, expected = model.step(state, np.array(values), dt * repeat)
                assert code.step(values, dt * repeat) == pytest.approx(float(expected), rel=1e-12, abs=1e-12)


def test_a_name_that_would_end_a_comment_does_not(tmp_path: Path) -> None:
    inputs = (Input("a*/ #error /*b", "temperature", "degC", 20.0, True, -3.0, 15.0),)
    model = Polynomial(
        target="z 1*/",
        unit="um",
        inputs=inputs,
        variables=(Variable.single(inputs[0].name, 0),),
        terms=((0,),),
        coefficients=(2.0,),
    )
    sources = translate(model)
    assert sources.name == "tc_z_1"
    code = Compiled(sources, 1, tmp_path, COMPILERS[0])
    code.start([20.0])
    assert code.step([23.0], 0.0) == 6.0


@settings(max_examples=15, suppress_health_check=[HealthCheck.too_slow], deadline=None)
@given(curve=CURVES, at=st.lists(st.floats(-12, 12), min_size=1, max_size=5))
def test_a_table_is_its_curve(curve: Curve, at: list[float]) -> None:
    model = Additive(**HEAD, variables=(SINGLES[1],), curves=(curve,))
    with tempfile.TemporaryDirectory() as folder:
        code = Compiled(translate(model), 3, Path(folder), COMPILERS[0])
        code.start([20.0, 0.0, 0.0])
        for value in (*at, *curve.x):  # at the breaks, too
            _, expected = model.step(model.init((20.0, 0.0, 0.0)), np.array([20.0, value, 0.0]), 0.0)
            assert code.step([20.0, value, 0.0], 0.0) == pytest.approx(float(expected), rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("family", FAMILIES)
@settings(max_examples=6, suppress_health_check=[HealthCheck.too_slow], deadline=None)
@given(data=st.data(), rows=READINGS)
def test_in_single_precision_it_says_nearly_the_same(
    family: str, data: st.DataObject, rows: list[tuple[float, ...]]
) -> None:
    model: ErrorModel = data.draw(FAMILIES[family])
    with tempfile.TemporaryDirectory() as folder:
        code = Compiled(translate(model), 3, Path(folder), COMPILERS[0], single=True)
        code.start([rows[0][0], 20.0, 0.0])
        state = model.init()
        for *values, dt in rows:
            state, expected = model.step(state, np.array(values), dt)
            assert code.step(values, dt) == pytest.approx(float(expected), rel=1e-3, abs=0.05)


JOINT = JointSupport((0, 1), (4.0, 3.0), ((0.0, 0.0), (1.0, -1.0), (2.5, 1.0)), 1.5, (2,), ((0.0, 2500.0),), (250.0,))


@pytest.mark.parametrize("joint", [None, JOINT, replace(JOINT, columns=(), scale=(), points=())])
@pytest.mark.parametrize("policy", ["hold", "fade"])
@settings(max_examples=8, suppress_health_check=[HealthCheck.too_slow], deadline=None)
@given(model=st.one_of(*FAMILIES.values()), over=st.sampled_from([0.1, 0.5, 2.0]), rows=READINGS)
def test_beyond_the_trained_range(
    policy: Literal["hold", "fade"], joint: JointSupport | None, model: ErrorModel, over: float, rows: list[Any]
) -> None:
    model = replace(model, support=Support(policy, fade_over=over), joint=joint)
    with tempfile.TemporaryDirectory() as folder:
        code = Compiled(translate(model), 3, Path(folder), COMPILERS[0])
        code.start([rows[0][0], 20.0, 0.0])
        state = model.init()
        for *values, dt in rows:
            state, expected = model.step(state, np.array(values), dt)
            assert code.step(values, dt) == pytest.approx(float(expected), rel=1e-12, abs=1e-12)


def test_an_input_that_did_not_move_in_training_is_inside_where_it_was() -> None:
    still = replace(INPUTS[0], low=0.0, high=0.0)
    model = Polynomial(
        target="z_um",
        unit="um",
        inputs=(still,),
        variables=(SINGLES[0],),
        terms=(),
        coefficients=(),
        intercept=3.0,
        support=Support("fade"),
    )
    for single in (False, True):
        with tempfile.TemporaryDirectory() as folder:
            code = Compiled(translate(model), 1, Path(folder), COMPILERS[0], single=single)
            code.start([20.0])
            assert [code.step([20.0], 0.0), code.step([20.5], 1.0)] == [3.0, 0.0]
