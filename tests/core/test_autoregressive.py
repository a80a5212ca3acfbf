"""Autoregressive families: the clock, the free run, carry-over, boundedness, files."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import twin_arx
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from thermocomp.core import expression
from thermocomp.core.autoregressive import Autoregressive, AutoregressiveNet, Ticking, find_largest_root
from thermocomp.core.exceptions import InputError, ReadingError
from thermocomp.core.inputs import Input
from thermocomp.core.model import ErrorModel
from thermocomp.core.network import Affine, Perceptron
from thermocomp.files import modelfile

FloatArray = NDArray[np.float64]

H = 15.0
SPEED = Input("n", "spindle_speed", "1/min", 0.0, False, 0.0, 5000.0)
OIL = Input("oil", "temperature", "degC", 20.0, True, -5.0, 10.0)
A = (1.2, -0.25)
B = ((0.001, -0.0004, 0.0002), (0.05, 0.0, -0.01))


def linear(a: tuple[float, ...] = A, b: tuple[tuple[float, ...], ...] = B, intercept: float = 0.01) -> Autoregressive:
    inputs = (SPEED, OIL)[: len(b)]
    return Autoregressive(target="z", unit="um", inputs=inputs, interval=H, a=a, b=b, intercept=intercept)


def network(k: int = 2, m: int = 1, scale: float = 2.0, seed: int = 0) -> AutoregressiveNet:
    rng = np.random.default_rng(seed)
    width = k + 2 * (m + 1)
    net = Perceptron.of(
        rng.normal(size=(3, width)) * scale, rng.normal(size=3), rng.normal(size=(1, 3)) * scale, rng.normal(size=1)
    )
    gains = (*[0.02] * k, *[1 / 5000, 0.1] * (m + 1))
    return AutoregressiveNet(
        target="z",
        unit="um",
        inputs=(SPEED, OIL),
        interval=H,
        k=k,
        m=m,
        net=net,
        input_scaling=Affine(gains, (0.1,) * width),
        output_scaling=Affine((60.0,), (-10.0,)),
        intercept=0.5,
    )


def drive(n: int, seed: int = 0) -> FloatArray:
    rng = np.random.default_rng(seed)
    speed = np.repeat(rng.uniform(0, 5000, n // 7 + 1), 7)[:n]
    return np.column_stack([speed, 20 + np.cumsum(rng.normal(0, 0.1, n)).clip(-4, 9)])


def run(model: ErrorModel, time: NDArray[np.floating[Any]], values: FloatArray) -> FloatArray:
    state, last, out = model.init(), time[0], np.empty(len(time))
    for k, (t, v) in enumerate(zip(time, values, strict=True)):
        state, deviation = model.step(state, v, float(t - last))
        out[k], last = deviation, t
    return out


def twin(model: Ticking, time: FloatArray, values: FloatArray) -> FloatArray:
    change = values - np.where([i.rezero for i in model.inputs], values[0], 0.0)
    if isinstance(model, Autoregressive):
        tick = twin_arx.linear(np.array(model.a), np.array(model.b).T, model.intercept)
    else:
        assert isinstance(model, AutoregressiveNet)
        net = model

        def tick(own: list[float], driven: list[FloatArray]) -> float:
            cold = [np.zeros(2)] * (net.m + 1)
            x = np.concatenate([[*own, *[0.0] * net.k][: net.k], *[*driven, *cold][: net.m + 1]])
            return float(net.output_scaling(net.net.evaluate(net.input_scaling(x)))[0] + net.intercept)

    return twin_arx.free_run(time, change, model.interval, tick)


MODELS = [
    linear(),
    linear(a=(), b=((0.002,), (0.3,))),
    linear(a=(0.9,), b=((0.001,), (0.0,)), intercept=0.0),
    network(),
    network(k=0, m=0),
    network(k=3, m=2, seed=4),
]
IDS = ["2-2", "0-0", "1-0", "net 2-1", "net 0-0", "net 3-2"]


@pytest.mark.parametrize("model", MODELS, ids=IDS)
@settings(max_examples=25, deadline=None)
@given(st.lists(st.sampled_from([15.0, 14.9, 15.1, 1.0, 4.7, 40.0, 0.0, 300.0]), min_size=1, max_size=25))
def test_every_sampling_is_the_twin(model: Ticking, steps: list[float]) -> None:
    time = np.cumsum([100.0, *steps])
    values = drive(len(time))
    expected = twin(model, time, values)
    np.testing.assert_allclose(run(model, time, values), expected, rtol=1e-9, atol=1e-9)


def test_on_the_grid_it_is_the_equation() -> None:
    """P-01, with the cold start: no deviation at the first reading."""
    values = drive(40)
    time = H * np.arange(40)
    model = linear()
    got = run(model, time, values)
    u = values - [0.0, values[0, 1]]
    z = np.zeros(42)  # two ticks of rest in front
    u = np.vstack([np.zeros((2, 2)), u])
    for t in range(3, 42):
        z[t] = 0.01 + A[0] * z[t - 1] + A[1] * z[t - 2] + sum(B[j][i] * u[t - i, j] for j in range(2) for i in range(3))
    np.testing.assert_allclose(got, z[2:], rtol=1e-12, atol=1e-12)
    assert got[0] == 0.0


def test_orders_are_those_of_the_equation() -> None:
    """P-01: two past drifts, and three values of the speed, which are two past ones and the present."""
    assert linear(A, B[:1]).orders == (2, 2)
    assert linear((0.5,), B).orders == (1, 2)
    speed, oil = expression.Input(0, "n"), expression.Input(1, "oil")
    past = [expression.Past(1), expression.Past(2)]
    driven = [expression.Mean(x, i) for i in (0, 1, 2) for x in (speed, oil)]
    assert linear()._regressors([speed, oil]) == past + driven
    assert linear()._weights.tolist() == [*A, B[0][0], B[1][0], B[0][1], B[1][1], B[0][2], B[1][2]]


def test_jitter_does_not_matter() -> None:
    """Readings at 14.9 s and 15.1 s: the ticks come on time, and no tick is lost or made twice."""
    time = H * np.arange(400)
    # a heat-up: steps of speed are the only place where a reading that is 0.1 s late can be seen
    values = np.column_stack([np.full(400, 3000.0), np.full(400, 21.0)])
    jitter = np.where(np.arange(400) % 2 == 1, -0.1, 0.1)
    jitter[0] = 0.0
    exact, disturbed = run(linear(), time, values), run(linear(), time + jitter, values)
    assert np.abs(np.diff(exact)).max() > 2.0
    slope = np.abs(np.diff(exact)).max() / H
    assert np.abs(disturbed - exact).max() <= 1.01 * slope * 0.1
    assert abs(disturbed[-1] - exact[-1]) < 1e-9
    clock = time * (1 + 1e-9)  # rounding of a clock
    assert np.abs(run(linear(), clock, drive(400)) - run(linear(), time, drive(400))).max() < 1e-5


@pytest.mark.parametrize("model", MODELS[:4], ids=IDS[:4])
def test_it_is_continuous_in_time(model: Ticking) -> None:
    """A second more or less never makes a jump, the inputs staying as they are: no stairs at the controller."""
    time = np.arange(0.0, 200.0, 0.25)
    values = np.tile([3000.0, 21.0], (len(time), 1))
    fine = run(model, time, values)
    ticks = fine[:: int(H / 0.25)]
    assert np.abs(np.diff(fine)).max() <= np.abs(np.diff(ticks)).max() * 0.25 / H * (1 + 1e-9)


@pytest.mark.parametrize("model", MODELS, ids=IDS)
def test_one_long_gap_is_many_ticks(model: Ticking) -> None:
    few, many = [0.0, 15.0, 40 * H + 7.0], [0.0, *(15.0 * np.arange(1, 41)), 40 * H + 7.0]
    value = drive(3)
    assert run(model, np.array(few), value)[-1] == pytest.approx(
        run(model, np.array(many), np.vstack([value[:2], np.tile(value[2], (40, 1))]))[-1], rel=1e-10
    )


def test_work_over_a_gap_is_bounded() -> None:
    model = linear()
    state, _ = model.step(model.init(), np.array([4000.0, 20.0]), 0.0)
    settled = (0.01 + sum(B[0]) * 4000.0) / (1 - sum(A))
    for gap in (1e6, 1e12, 1e300):
        assert model.step(state, np.array([4000.0, 20.0]), gap)[1] == pytest.approx(settled, rel=1e-12)
    net = network()
    state, _ = net.step(net.init(), np.array([4000.0, 20.0]), 0.0)
    far = [float(net.step(state, np.array([4000.0, 20.0]), gap)[1]) for gap in (1e5, 1e12)]
    assert far[0] == pytest.approx(far[1], abs=1e-9)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.1, 50.0))
def test_a_net_cannot_run_away(seed: int, scale: float) -> None:
    model = network(scale=scale, seed=seed)
    values = drive(60, seed)
    got = run(model, 20.0 * np.arange(60), values)
    assert (got >= -9.5 - 1e-9).all()
    assert (got <= 50.5 + 1e-9).all()


@pytest.mark.parametrize("a", [(1.0,), (1.01,), (-1.2,), (2.0, -0.99), (0.0, 0.0, 1.1)])
def test_a_polynomial_that_runs_away_is_refused(a: tuple[float, ...]) -> None:
    assert find_largest_root(a) >= 1
    with pytest.raises(InputError, match="does not decay"):
        linear(a=a)


def test_roots() -> None:
    assert find_largest_root(()) == 0.0
    assert find_largest_root((0.9,)) == pytest.approx(0.9)
    assert find_largest_root((1.7, -0.72)) == pytest.approx(0.9)  # (z - 0.9) (z - 0.8)
    assert find_largest_root((0.0, -0.81)) == pytest.approx(0.9)


@pytest.mark.parametrize("model", MODELS, ids=IDS)
def test_a_batch_is_many_single_runs(model: Ticking) -> None:
    readings = np.stack([drive(20, seed) for seed in range(5)])
    steps = np.array([0.0, 15.0, 14.8, 7.0, 100.0] * 4)
    state = model.init()
    together = np.empty((5, 20))
    for k in range(20):
        state, together[:, k] = model.step(state, readings[:, k], float(steps[k]))
    for one in range(5):
        alone = run(model, np.cumsum(steps), readings[one])
        np.testing.assert_allclose(together[one], alone, rtol=1e-12, atol=1e-12)


def test_state_in_state_out() -> None:
    model = linear()
    start, _ = model.step(model.init(), np.array([3000.0, 20.0]), 0.0)
    before = [np.array(x) for x in start if x is not None]
    assert model.step(start, np.array([25.0, 21.0]), 40.0)[1] == model.step(start, np.array([25.0, 21.0]), 40.0)[1]
    assert all(np.array_equal(a, b) for a, b in zip(before, [x for x in start if x is not None], strict=True))


def test_the_first_time_step_has_no_meaning() -> None:
    model = linear()
    assert model.step(model.init(), np.array([3000.0, 20.0]), 1e4)[1] == 0.0
    courses: list[list[float]] = []
    for first in (0.0, 1.0, 1e4):
        state, _ = model.step(model.init(), np.array([3000.0, 20.0]), first)
        courses.append([])
        for reading in ([3000.0, 20.5], [1000.0, 21.0]):
            state, deviation = model.step(state, np.array(reading), H - 0.5)
            courses[-1].append(float(deviation))
    assert courses[0] == courses[1] == courses[2]
    assert courses[0][-1] != 0.0


def test_carry_over_from_the_last_job() -> None:
    """E-P5: going on with the state is exact; a deviation alone is taken to have been there for a while."""
    model = linear(a=(0.95,), b=((0.001,), (0.0,)), intercept=0.0)
    time, values = H * np.arange(30), drive(30)
    whole = run(model, time, values)
    state = model.init()
    for k in range(20):
        state, _ = model.step(state, values[k], H if k else 0.0)
    carried = model.begin_at(whole[19])
    for k in range(20, 30):
        state, a = model.step(state, values[k], H)
        carried, b = model.step(carried, values[k], H)
        assert a == pytest.approx(whole[k], rel=1e-12)
        assert b == pytest.approx(whole[k], rel=1e-12)  # k = 1, m = 0 remembers nothing else


def test_a_known_start_decays_as_it_should() -> None:
    model = linear(intercept=0.0)
    state = model.begin_at(30.0)
    assert state.deviation == 30.0
    values = []
    for _ in range(60):
        state, deviation = model.step(state, np.array([0.0, 20.0]), H)
        values.append(float(deviation))
    assert values[0] == pytest.approx(30.0 * sum(A))
    assert values[1] == pytest.approx(A[0] * values[0] + A[1] * 30.0)
    assert 0 < values[-1] < 1.0
    # at rest in a settled state it stays there
    settled = sum(B[0]) * 2000.0 / (1 - sum(A))
    state = model.begin_at(settled, inputs=[2000.0, 20.0])
    for dt in (15.0, 3.0, 1000.0):
        state, deviation = model.step(state, np.array([2000.0, 20.0]), dt)
        assert deviation == pytest.approx(settled, rel=1e-12)


def test_a_batch_of_known_starts() -> None:
    model = linear()
    state = model.begin_at([0.0, 10.0, 30.0], reference=[0.0, 22.0])
    _, together = model.step(state, np.array([3000.0, 23.0]), 20.0)
    for deviation, got in zip((0.0, 10.0, 30.0), together, strict=True):
        alone = model.step(model.begin_at(deviation, reference=[0.0, 22.0]), np.array([3000.0, 23.0]), 20.0)[1]
        assert got == pytest.approx(alone, rel=1e-13)
    one = model.begin_at(10.0, reference=[0.0, 22.0])  # one start, a batch of readings
    _, spread = model.step(one, np.array([[3000.0, 23.0], [0.0, 22.0]]), 20.0)
    assert spread[0] == pytest.approx(together[1], rel=1e-13)
    assert spread[1] < spread[0]


@pytest.mark.parametrize(
    ("start", "message"),
    [
        ({"deviation": np.nan}, "must be finite"),
        ({"deviation": 1.0, "inputs": [1.0]}, "expected 2 inputs"),
        ({"deviation": 1.0, "inputs": [1.0, np.inf]}, "must be finite"),
        ({"deviation": 1.0, "reference": [1.0, 2.0, 3.0]}, "expected 2 inputs"),
    ],
)
def test_a_start_that_is_none(start: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        linear().begin_at(**start)  # type: ignore[arg-type]


def test_runs_of_a_batch_share_their_clock() -> None:
    model = linear()
    state = model.begin_at([0.0, 10.0])
    assert state.memory is not None
    state.memory[1, 0] = 3.0
    with pytest.raises(InputError, match="same time"):
        model.step(state, np.array([3000.0, 23.0]), 20.0)


def test_numbers_that_are_none() -> None:
    model = linear()
    state, _ = model.step(model.init(), np.array([0.0, 20.0]), 0.0)
    for bad, dt in (([np.nan, 20.0], 1.0), ([0.0, 20.0], -1.0), ([0.0, 20.0], np.inf)):
        with pytest.raises(ReadingError):
            model.step(state, np.array(bad), dt)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"interval": 0.0}, "interval must be from 0.001 to"),
        ({"interval": np.inf}, "interval must be from 0.001 to"),
        ({"b": ((1.0,),)}, "for each of 2 inputs, at least one and the same number for each"),
        ({"b": ((1.0,), (1.0, 2.0))}, "the same number"),
        ({"b": ((), ())}, "the same number"),
        ({"inputs": (), "b": ()}, "at least one"),
        ({"a": (np.nan,)}, "must be finite"),
        ({"b": ((1.0,), (np.inf,))}, "must be finite"),
    ],
)
def test_linear_numbers_that_do_not_fit(change: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        replace(linear(), **change)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"k": 1}, "need a net of 5 inputs; found 6"),
        ({"interval": -1.0}, "interval must be from 0.001 to"),
        ({"input_scaling": Affine((1.0,), (0.0,))}, "scaling for 1"),
        ({"output_scaling": Affine((1.0, 1.0), (0.0, 0.0))}, "expected one output"),
        ({"net": replace(network().net, output="identity")}, "not bounded"),
    ],
)
def test_net_numbers_that_do_not_fit(change: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        replace(network(), **change)  # type: ignore[arg-type]


@pytest.mark.parametrize("model", MODELS, ids=IDS)
def test_round_trip_keeps_every_bit(model: Ticking) -> None:
    (again,) = modelfile.loads(modelfile.dumps([model]))
    assert again == model
    values, time = drive(20), 11.0 * np.arange(20)
    assert np.array_equal(run(again, time, values), run(model, time, values))


def test_text() -> None:
    assert linear(a=(0.5,), b=((0.001, 0.0), (0.0, -2.0))).formula() == (
        "0.01 + 0.5 dz(t-1) + 0.001 n(t) - 2 oil(t-1); t in steps of 15 s"
    )
    assert linear(a=(0.5,), b=((0.001, 0.0), (0.0, 0.0))).sensors == ("n",)
    net = network(k=1, m=0)
    assert net.formula() == "0.5 + sigmoid net 3-3-1 of dz(t-1), n(t), oil(t); t in steps of 15 s"
    assert net.sensors == ("n", "oil")
    assert len(net.coefficients_by_name()) == net.net.n_parameters
    deaf = replace(net, input_scaling=Affine((0.02, 0.1, 0.0), (0.0, 0.0, 0.0)))
    assert deaf.sensors == ("n",)
