"""Network family: the net itself, its scaling, step, files, and numbers that do not fit."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from thermocomp.core.bounds import COEFFICIENT
from thermocomp.core.exceptions import InputError
from thermocomp.core.inputs import Input
from thermocomp.core.network import Affine, Network, Perceptron, sigmoid
from thermocomp.files import modelfile


def net(n_inputs: int, n_hidden: int, n_outputs: int, **functions: Any) -> Perceptron:
    rng = np.random.default_rng(1)
    sizes: list[Any] = [(n_hidden, n_inputs), n_hidden, (n_outputs, n_hidden), n_outputs]
    return Perceptron.of(*(rng.normal(size=s) for s in sizes), **functions)


def model(**change: Any) -> Network:
    good: dict[str, Any] = {
        "target": "z_um",
        "unit": "um",
        "inputs": tuple(Input(f"T{i}", "temperature", "degC", 20.0, True, -5.0, 20.0) for i in range(1, 10)),
        "net": net(9, 20, 1),
        "input_scaling": Affine((0.032,) * 9, (0.26,) * 9),
        "output_scaling": Affine((100.0,), (-30.0,)),
    }
    return Network(**{**good, **change})


@given(st.floats(-1e6, 1e6))
def test_sigmoid(x: float) -> None:
    # C-25; warnings are errors, so nothing overflows
    y = float(sigmoid(np.array(x)))
    assert 0 <= y <= 1
    assert y == pytest.approx(1 / (1 + math.exp(-x)) if x > -700 else 0.0, rel=1e-12, abs=1e-15)


@pytest.mark.parametrize("hidden", ["sigmoid", "tanh", "identity"])
@pytest.mark.parametrize("output", ["sigmoid", "tanh", "identity"])
def test_evaluate_is_the_sum_written_out(hidden: str, output: str) -> None:
    n = net(3, 4, 2, hidden=hidden, output=output)
    functions: dict[str, Callable[[float], float]] = {
        "sigmoid": lambda z: 1 / (1 + math.exp(-z)),
        "tanh": math.tanh,
        "identity": lambda z: z,
    }
    x = [0.3, -1.2, 2.0]
    h = [
        functions[hidden](sum(w * v for w, v in zip(weights, x, strict=True)) + th)
        for weights, th in zip(n.hidden_weights, n.hidden_thresholds, strict=True)
    ]
    out = [
        functions[output](sum(w * v for w, v in zip(weights, h, strict=True)) + th)
        for weights, th in zip(n.output_weights, n.output_thresholds, strict=True)
    ]
    assert n.evaluate(np.array(x)).tolist() == pytest.approx(out, rel=1e-13)
    # in a frozen model, between the two scalings
    m = model(net=net(9, 4, 1, hidden=hidden, output=output))
    change = np.linspace(-4.0, 18.0, 9)
    deviation = m.step(m.init([20.0] * 9), 20.0 + change, 0.0)[1]
    assert deviation == pytest.approx(100.0 * m.net.evaluate(0.032 * change + 0.26)[0] - 30.0, rel=1e-12)


@pytest.mark.parametrize(("shape", "parameters"), [((9, 20, 3), 263), ((5, 8, 1), 57)])
def test_number_of_parameters(shape: tuple[int, int, int], parameters: int) -> None:
    # C-26 and C-27
    n = net(*shape)
    assert n.shape == shape
    assert n.n_parameters == parameters
    held = sum(len(w) for w in (*n.hidden_weights, *n.output_weights))
    assert held + len(n.hidden_thresholds) + len(n.output_thresholds) == parameters


def test_a_batch_is_many_single_runs() -> None:
    m = model(intercept=1.5)
    readings = np.random.default_rng(2).uniform(18, 35, (5, 7, 9))
    together = m.step(m.init([20.0] * 9), readings, 0.0)[1]
    alone = [[float(m.step(m.init([20.0] * 9), r, 0.0)[1]) for r in run] for run in readings]
    assert together.shape == (5, 7)
    np.testing.assert_allclose(together, alone, rtol=1e-13)
    scaled = m.net.evaluate(0.032 * (readings - 20.0) + 0.26)[..., 0]
    np.testing.assert_allclose(together, 100 * scaled - 30 + 1.5, rtol=1e-12)


def test_the_output_saturates() -> None:
    m = model(net=replace(net(9, 20, 1), output_thresholds=(1e4,)))
    assert m.step(m.init([20.0] * 9), np.full(9, 30.0), 0.0)[1] == 70.0
    m = model(net=replace(net(9, 20, 1), output_thresholds=(-1e4,)))
    assert m.step(m.init([20.0] * 9), np.full(9, 30.0), 0.0)[1] == -30.0


@given(st.floats(-COEFFICIENT, COEFFICIENT))
def test_round_trip_keeps_every_bit(value: float) -> None:
    m = model(input_scaling=Affine((value, *[1 / 3] * 8), (value,) * 9))
    assert modelfile.loads(modelfile.dumps([m])) == (m,)


def test_sensors_are_the_inputs_that_have_a_way_out() -> None:
    weights = np.ones((2, 4))
    weights[:, 1] = 0.0  # T2 has no weight
    weights[0, 2] = 0.0  # T3 leads to the second node only, which has no way out
    n = Perceptron.of(weights, np.zeros(2), np.array([[1.0, 0.0]]), np.zeros(1))
    m = model(inputs=model().inputs[:4], net=n, input_scaling=Affine((1.0, 1.0, 1.0, 0.0), (0.0,) * 4))
    assert m.sensors == ("T1",)
    assert replace(m, output_scaling=Affine((0.0,), (1.0,))).sensors == ()
    assert model().sensors == tuple(f"T{i}" for i in range(1, 10))


def test_formula_and_coefficients() -> None:
    m = model()
    assert m.formula() == "sigmoid net 9-20-1 of T1 .. T9"
    assert model(intercept=2.5).formula() == "2.5 + sigmoid net 9-20-1 of T1 .. T9"
    small = model(
        inputs=m.inputs[:2], net=net(2, 3, 1, hidden="tanh", output="identity"), input_scaling=Affine((1, 1), (0, 0))
    )
    assert small.formula() == "tanh-identity net 2-3-1 of T1, T2"
    named = small.coefficients_by_name()
    assert len(named) == small.net.n_parameters == 13
    assert named["w(T2, h3)"] == small.net.hidden_weights[2][1]
    assert named["th(h1)"] == small.net.hidden_thresholds[0]
    assert named["w(h2, out)"] == small.net.output_weights[0][1]
    assert named["th(out)"] == small.net.output_thresholds[0]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"hidden_weights": ((1.0, 2.0),)}, "weights of 1 hidden nodes and 1 outputs, but thresholds of 2 and 1"),
        ({"hidden_weights": ((1.0, 2.0), (1.0,))}, "expected 2 weights per hidden node"),
        ({"output_weights": ((1.0,),)}, "expected 2 weights for each of 1 outputs"),
        ({"output_weights": ((1.0, float("nan")),)}, "must be finite"),
        ({"output_thresholds": (float("inf"),)}, "must be finite"),
        ({"output_thresholds": ()}, "both layers need at least one node"),
        ({"hidden": "relu"}, "unknown activation function 'relu'; expected one of sigmoid, tanh, identity"),
    ],
)
def test_a_net_refuses_numbers_that_do_not_fit(change: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        replace(net(2, 2, 1), **change)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"net": net(8, 20, 1)}, "9 inputs, scaling for 9 and a net for 8"),
        ({"input_scaling": Affine((1.0,), (0.0,))}, "9 inputs, scaling for 1 and a net for 9"),
        ({"net": net(9, 20, 3)}, "a net of 3 outputs with scaling of 1: expected 1"),
        ({"intercept": float("nan")}, "intercept must be finite"),
    ],
)
def test_a_model_refuses_numbers_that_do_not_fit(change: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        model(**change)


def test_scaling_refuses_numbers_that_do_not_fit() -> None:
    with pytest.raises(InputError, match="2 gains but 1 offsets"):
        Affine((1.0, 2.0), (0.0,))
    with pytest.raises(InputError, match="gain must be finite"):
        Affine((float("inf"),), (0.0,))
