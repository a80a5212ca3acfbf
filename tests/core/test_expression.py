"""The tree of a model says what the model says: for every family, in any run of readings."""

import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from expressions import Running
from families import CURVES, FAMILIES, HEAD, INPUTS, MIXED, READINGS, SINGLES
from hypothesis import given
from hypothesis import strategies as st

from thermocomp.core.additive import Additive
from thermocomp.core.curves import Curve
from thermocomp.core.exceptions import InputError
from thermocomp.core.inputs import Support
from thermocomp.core.model import ErrorModel
from thermocomp.core.polynomial import Polynomial
from thermocomp.core.state import State
from thermocomp.models.unfrozen import EstimatorModel


def test_every_family_is_here() -> None:
    def below(kind: type[Any]) -> set[str]:
        own = {kind.family} if "family" in vars(kind) else set()
        return own.union(*(below(k) for k in kind.__subclasses__()))

    assert below(ErrorModel) - {EstimatorModel.family} == set(FAMILIES)


@pytest.mark.parametrize("family", FAMILIES)
@given(data=st.data(), rows=READINGS)
def test_the_tree_is_the_model(family: str, data: st.DataObject, rows: list[tuple[float, ...]]) -> None:
    model: ErrorModel = data.draw(FAMILIES[family])
    zero = (rows[0][0], 20.0, 0.0)
    state, tree = model.init(), Running(model.expression(), zero)
    for *values, dt in rows:
        state, expected = model.step(state, np.array(values), dt)
        found = tree.step(values, dt)
        assert found == pytest.approx(float(expected), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("family", FAMILIES)
@given(
    data=st.data(),
    rows=READINGS,
    policy=st.sampled_from(["clip", "hold", "fade"]),
    margin=st.floats(0.0, 0.3),
    cut=st.integers(1, 8),
    variants=st.integers(0, 3),
    block=st.integers(1, 200),
)
def test_a_run_is_its_steps(
    family: str,
    data: st.DataObject,
    rows: list[tuple[float, ...]],
    policy: Any,
    margin: float,
    cut: int,
    variants: int,
    block: int,
) -> None:
    """In one run or in two, of one reading at a time or of several variants, in blocks of any size."""
    model: ErrorModel = data.draw(FAMILIES[family])
    model = replace(model, support=Support(policy, margin, 0.5))
    table, steps = np.array([r[:-1] for r in rows]), np.array([r[-1] for r in rows])
    if variants:
        table = table[:, None] + 0.3 * np.arange(variants)[:, None]
    state, expected = model.init(), list[State]()
    for values, dt in zip(table, steps.tolist(), strict=True):
        state, _ = model.step(state, values, dt)
        expected.append(state)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("thermocomp.core.layers.BLOCK", block)
        runs = [model.run(model.init(), table[:cut], steps[:cut])]
        if len(rows) > cut:
            runs.append(model.run(runs[0].state, table[cut:], steps[cut:]))
    np.testing.assert_allclose(
        np.concatenate([r.deviation for r in runs]), [s.deviation for s in expected], rtol=1e-9, atol=1e-9
    )
    np.testing.assert_array_equal(np.concatenate([r.outside for r in runs]), [s.outside for s in expected])
    assert state.memory is not None
    assert runs[-1].state.memory is not None
    np.testing.assert_allclose(runs[-1].state.memory, state.memory, rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(runs[-1].state.reference, state.reference)


@pytest.mark.parametrize("family", FAMILIES)
@given(data=st.data())
def test_a_model_that_has_run_can_be_sent_to_another_process(family: str, data: st.DataObject) -> None:
    model: ErrorModel = data.draw(FAMILIES[family])
    reading = np.array([25.0, 22.0, 2500.0])
    state, _ = model.step(model.init(np.zeros(3)), reading, 0.0)
    sent = pickle.loads(pickle.dumps(model))
    assert sent == model
    assert sent.step(state, reading, 10.0)[1] == model.step(state, reading, 10.0)[1]


@given(curve=CURVES, at=st.floats(-12, 12))
def test_a_table_is_its_curve(curve: Curve, at: float) -> None:
    model = Additive(**HEAD, variables=(SINGLES[1],), curves=(curve,))
    _, expected = model.step(model.init(), np.array([20.0, 20.0 + at, 0.0]), 0.0)
    found = Running(model.expression(), (20.0, 20.0, 0.0)).step((20.0, 20.0 + at, 0.0), 0.0)
    assert found == pytest.approx(float(expected), rel=1e-12, abs=1e-12)


def test_beyond_the_trained_range_the_inputs_are_clipped() -> None:
    model = Polynomial(**HEAD, variables=SINGLES, terms=((0,),), coefficients=(2.0,))
    assert Running(model.expression(), (20.0, 20.0, 0.0)).step((60.0, 20.0, 0.0), 0.0) == 2.0 * (15.0 + 0.25 * 18.0)


def test_what_cannot_be_frozen_is_no_expression() -> None:
    from thermocomp.models.gp import GaussianProcess

    X = np.random.default_rng(0).normal(size=(20, 3))
    fitted = GaussianProcess().fit(X, X[:, 0]).unfrozen(target="z_um", inputs=INPUTS)
    assert "no formula" in fitted.formula()
    with pytest.raises(InputError, match="cannot be exported"):
        fitted.expression()


def test_a_product_brackets_a_difference() -> None:
    model = Polynomial(**HEAD, variables=MIXED, terms=((2,), (0, 2), (2, 2)), coefficients=(1.0, -2.5, 3.0))
    assert model.formula() == "1 (T1-T2) - 2.5 T1*(T1-T2) + 3 (T1-T2)*(T1-T2)"
    assert replace(model, coefficients=(0.0, 0.0, 0.0)).formula() == "0"
