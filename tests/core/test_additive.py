"""Additive family: curves, cropping, batches, file."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thermocomp.core.additive import Additive
from thermocomp.core.curves import Curve
from thermocomp.core.exceptions import InputError
from thermocomp.core.inputs import Input, Support
from thermocomp.core.terms import Variable
from thermocomp.files import modelfile

LINE = Curve((0.0, 1.0, 3.0), (1.0, 2.0, -2.0))
STEP = Curve((0.0, 2.0), (5.0, 7.0, 6.0), "step")
FLAT = Curve((), (4.0,), "step")


def model(**change: Any) -> Additive:
    """Three inputs; the third only has a constant curve."""
    given_ = {
        "target": "z",
        "unit": "um",
        "inputs": tuple(Input(f"t{i}", "temperature", "degC", 20.0, True, -1.0, 4.0) for i in range(3)),
        "variables": (Variable.single("t0", 0), Variable("t0-t1", ((0, 1.0), (1, -0.7))), Variable.single("t2", 2)),
        "curves": (LINE, STEP, FLAT),
        "response": Curve((0.0, 20.0), (0.0, 10.0)),
        "intercept": 0.5,
    }
    return Additive(**{**given_, **change})


def test_linear_is_interpolation_and_cropped() -> None:
    v = np.linspace(-2, 5, 71)
    np.testing.assert_allclose(LINE(v), np.interp(v, LINE.x, LINE.y), atol=1e-15)
    assert LINE(np.array([-9.0, 99.0])).tolist() == [1.0, -2.0]  # W-07
    assert Curve((1.0,), (3.0,))(np.array([0.0, 1.0, 2.0])).tolist() == [3.0, 3.0, 3.0]


def test_step_holds_from_its_break_on() -> None:
    assert STEP(np.array([-1.0, 0.0, 1.9, 2.0, 50.0])).tolist() == [5.0, 7.0, 7.0, 6.0, 6.0]
    assert FLAT(np.array([3.0])).tolist() == [4.0]


def test_the_sum_through_the_response() -> None:
    m = model()
    _, d = m.step(m.init([20.0] * 3), np.array([20.5, 20.0, 22.0]), 0.0)
    assert d == pytest.approx(0.5 + (1.5 + 7.0 + 4.0) / 2)
    m = model(response=None)
    _, d = m.step(m.init([20.0] * 3), np.array([20.5, 20.0, 22.0]), 0.0)
    assert d == pytest.approx(0.5 + 1.5 + 7.0 + 4.0)


@given(st.integers(0, 2**32 - 1), st.integers(1, 40))
def test_a_batch_is_many_single_readings_to_the_last_bit(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    inputs = tuple(Input(f"t{i}", "temperature", "degC", 0.0, False, -3.0, 3.0) for i in range(11))
    x = tuple(np.sort(rng.normal(size=25)).tolist())
    mixed = tuple(Variable(f"v{k}", tuple((i, float(rng.normal())) for i in range(11))) for k in range(3))
    curves = (
        Curve(x, tuple(rng.normal(size=25).tolist())),
        Curve(x, tuple(rng.normal(size=26).tolist()), "step"),
        Curve(x, tuple(rng.normal(size=25).tolist())),
    )
    m = model(inputs=inputs, variables=mixed, curves=curves)
    rows = np.asfortranarray(rng.normal(size=(n, 2, 11)))
    together = m.step(m.init(), rows, 1.0)[1]
    alone = [[float(m.step(m.init(), rows[i, j].copy(), 1.0)[1]) for j in range(2)] for i in range(n)]
    assert together.tolist() == alone


def test_outside_is_flagged_and_cropped() -> None:
    # W-07, with the guard of the trained range
    m = model(support=Support(margin=0.0), variables=(Variable.single("t0", 0),), curves=(LINE,))
    reference = m.init([20.0] * 3)
    peak, top = np.array([30.0, 20.0, 20.0]), np.array([24.0, 20.0, 20.0])
    state, cropped = m.step(reference, peak, 0.0)
    inside, edge = m.step(reference, top, 0.0)
    assert (state.outside.tolist(), inside.outside.tolist()) == ([True, False, False], [False] * 3)
    assert cropped == edge


def test_sensors_and_words() -> None:
    m = model()
    assert m.sensors == ("t0", "t1")
    assert m.formula() == "0.5 + theta^-1(phi1(t0) + phi2(t0-t1) + phi3(t2))"
    assert model(response=None, intercept=0.0).formula() == "phi1(t0) + phi2(t0-t1) + phi3(t2)"
    assert m.coefficients_by_name() == {"phi1(t0)": 4.0, "phi2(t0-t1)": 2.0, "phi3(t2)": 0.0}
    assert model(response=Curve((1.0,), (3.0,))).sensors == ()
    nothing = model(inputs=(), variables=(), curves=(), response=None)
    assert (nothing.formula(), nothing.sensors) == ("0.5 + 0", ())
    assert nothing.step(nothing.init(), np.empty((4, 0)), 0.0)[1].tolist() == [0.5] * 4


def test_file_round_trip_is_bit_exact() -> None:
    m = model(curves=(Curve((0.1, 1 / 3, 2.0), (np.pi, 1e-300, -7.0)), STEP, FLAT))
    text = modelfile.dumps([m, model(response=None)])
    again = modelfile.loads(text)
    assert again == (m, model(response=None))
    assert modelfile.dumps(again) == text


@pytest.mark.parametrize(
    ("x", "y", "kind", "message"),
    [
        ((0.0, 0.0), (1.0, 2.0), "linear", "must increase strictly, but 0 follows 0"),
        ((0.0, np.nan), (1.0, 2.0), "linear", "must be finite"),
        ((0.0, 1.0), (1.0, np.inf), "linear", "must be finite"),
        ((0.0, 1.0), (1.0,), "linear", "as many as x values"),
        ((0.0, 1.0), (1.0, 2.0), "step", "one more than x values"),
        ((), (), "linear", "at least one y value"),
        ((0.0, 5e-324), (0.0, 1.0), "linear", "too close"),
    ],
)
def test_bad_curves_are_refused(x: Any, y: Any, kind: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Curve(x, y, kind)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"curves": (LINE,)}, "3 variables but 1 curves"),
        ({"intercept": float("nan")}, "must be finite"),
        ({"variables": (Variable.single("t9", 9),), "curves": (LINE,)}, "t9: input index 9: expected 0 to 2"),
    ],
)
def test_numbers_that_do_not_fit_are_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        model(**change)


@pytest.mark.parametrize(
    ("name", "weights", "message"),
    [
        ("a", ((0, float("inf")),), "variable a: weights must be finite"),
        ("none", (), "variable none has no input"),
        ("two\nlines", ((0, 1.0),), r"variable: 'two\\nlines' is not a valid name"),
    ],
)
def test_what_is_no_variable_is_refused(name: str, weights: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Variable(name, weights)
