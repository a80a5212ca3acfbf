"""The kernel of the nets against its twin and finite differences."""

from typing import Any

import numpy as np
import pytest
import twin_backprop as twin
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from thermocomp.core.network import Perceptron
from thermocomp.models.kernels import backprop
from thermocomp.models.numerics.backprop import learning_rates, train_net

FloatArray = NDArray[np.float64]


def problem(shape: tuple[int, int, int], n: int = 30, seed: int = 0) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return weights, inputs, targets."""
    i, h, o = shape
    rng = np.random.default_rng(seed)
    return (
        rng.uniform(-0.3, 0.3, (i + 1) * h + o * (h + 1)),
        rng.uniform(0.1, 0.9, (n, i)),
        rng.uniform(0.1, 0.9, (n, o)),
    )


def test_sigmoid_of_the_kernel() -> None:
    x = np.concatenate([np.linspace(-699, 699, 10_007), np.linspace(-1, 1, 1001), [0.0, -1e300, 1e300]])
    y = x.copy()
    backprop.sigmoid(y)
    with np.errstate(over="ignore"):
        np.testing.assert_allclose(y[:-3], twin.sigmoid(x[:-3]), rtol=1e-15)
    assert (y[-3], y[-1]) == (0.5, 1.0)
    assert y[-2] < 1e-300


@settings(max_examples=40, deadline=None)
@given(
    shape=st.tuples(st.integers(1, 10), st.integers(1, 35), st.integers(1, 4)),
    momentum=st.sampled_from([0.0, 0.7]),
    batch=st.booleans(),
    shuffled=st.booleans(),
    seed=st.integers(0, 2**64 - 1),
)
def test_kernel_is_its_twin(
    shape: tuple[int, int, int], momentum: float, batch: bool, shuffled: bool, seed: int
) -> None:
    # C-30: pattern and batch update
    weights, x, t = problem(shape)
    rates = np.linspace(0.5, 0.2, 6)
    expected, losses = twin.train(weights, shape[1], x, t, rates, momentum, batch, shuffled, seed, 0.0)
    found = backprop.train(weights, shape[1], x, t, rates, momentum, batch, shuffled, np.uint64(seed), 0.0)
    np.testing.assert_allclose(weights, expected, rtol=0, atol=1e-13)
    np.testing.assert_allclose(found, losses, rtol=1e-12)


@pytest.mark.parametrize("shape", [(9, 20, 3), (5, 8, 1)])
def test_a_batch_step_is_the_gradient_by_finite_differences(shape: tuple[int, int, int]) -> None:
    weights, x, t = problem(shape)
    after, rate, step = weights.copy(), 0.5, 1e-6
    backprop.train(after, shape[1], x, t, np.array([rate]), 0.0, True, False, np.uint64(0), 0.0)
    differences = np.empty_like(weights)
    for m in range(weights.size):
        ends = [weights.copy(), weights.copy()]
        ends[0][m] -= step
        ends[1][m] += step
        low, high = (twin.loss(w, shape[1], x, t) for w in ends)
        differences[m] = (high - low) / (2 * step)
    np.testing.assert_allclose((weights - after) / rate * len(x), differences, atol=1e-7 * np.abs(differences).max())


def test_pattern_order() -> None:
    _, x, t = problem((4, 5, 1))
    rates = np.full(3, 0.5)

    def trained(order: Any, x: FloatArray, t: FloatArray, seed: int = 0, **update: Any) -> Perceptron:
        return train_net(x, t, 5, rng=np.random.default_rng(seed), rates=rates, order=order, **update).net

    assert trained("shuffled", x, t) == trained("shuffled", x, t)
    assert trained("shuffled", x, t) != trained("shuffled", x, t, seed=1)
    assert trained("fixed", x, t) != trained("fixed", x[::-1], t[::-1])
    # the sum over all patterns has no order, the default (C-30) has
    batch: dict[str, Any] = {"update": "batch"}
    for update, same in ((batch, True), ({}, False)):
        one, other = (np.ravel(trained("fixed", x[::k], t[::k], **update).hidden_weights) for k in (1, -1))
        assert np.allclose(one, other, rtol=1e-9) is same
    # 'fixed' is the order as given
    start = np.random.default_rng(0).uniform(-0.3, 0.3, 5 * 5 + 6)
    given, _ = twin.train(start, 5, x, t, rates, 0.0, batch=False, shuffled=False, seed=0, goal=0.0)
    assert np.allclose(trained("fixed", x, t).hidden_weights, given[5:25].reshape(4, 5).T, rtol=1e-9)


def test_shuffle_is_fair() -> None:
    # each pattern comes first equally often; 4 standard deviations
    order, state, first = list(range(5)), 7, np.zeros(5)
    for _ in range(2000):
        state = twin.shuffle(order, state)
        assert sorted(order) == [0, 1, 2, 3, 4]
        first[order[0]] += 1
    assert np.abs(first - 400).max() < 4 * np.sqrt(2000 * 0.2 * 0.8)


def test_goal_ends_the_training() -> None:
    _, x, t = problem((4, 5, 1))
    rng = np.random.default_rng
    full = train_net(x, t, 5, rng=rng(0), rates=np.full(50, 0.5)).losses
    goal = float(full[:20].min())  # reached exactly
    short = train_net(x, t, 5, rng=rng(0), rates=np.full(50, 0.5), goal=goal).losses
    assert len(full) == 50
    assert len(short) == int(np.flatnonzero(full <= goal)[0]) + 1
    np.testing.assert_array_equal(short, full[: len(short)])


def test_initial_weights() -> None:
    # C-29
    _, x, t = problem((9, 20, 3))
    net = train_net(x, t, 20, rng=np.random.default_rng(0), rates=np.array([1e-300])).net
    numbers = np.concatenate([np.ravel(net.hidden_weights), net.hidden_thresholds, np.ravel(net.output_weights)])
    assert -0.3 <= numbers.min() < -0.28
    assert 0.28 < numbers.max() <= 0.3
    assert abs(numbers.mean()) < 0.05
    # which place each of them has: the loss of the first epoch is that of the net that is returned
    trained = train_net(x, t, 20, rng=np.random.default_rng(0), rates=np.full(3, 1e-300))
    assert trained.losses == pytest.approx([np.mean((t - net.evaluate(x)) ** 2)] * 3, rel=1e-12)


def test_the_shuffling_has_a_seed_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """C-29: 64 random bits, drawn after the weights."""
    _, x, t = problem((4, 5, 1))
    seeds = []
    monkeypatch.setattr(backprop, "train", lambda *given: seeds.append(int(given[8])) or np.zeros(1))  # type: ignore[func-returns-value]
    for k in range(20):
        train_net(x, t, 5, rng=np.random.default_rng(k), rates=np.ones(1))
    assert len({*seeds}) == 20
    assert min(seeds) < 2**63 < max(seeds) < 2**64
    assert max(s & 0xFFFFFFFF for s in seeds) > 2**31


@pytest.mark.parametrize("schedule", ["geometric", "harmonic"])
def test_learning_rate_falls_all_the_time(schedule: str) -> None:
    # C-29
    rates = learning_rates(100, 0.5, 0.01, schedule)
    assert rates[0] == 0.5
    assert rates[-1] == pytest.approx(0.01)
    assert (np.diff(rates) < 0).all()
    assert (learning_rates(7, 0.5, 0.5, schedule) == 0.5).all()
    assert learning_rates(1, 0.5, 0.01, schedule).tolist() == [0.5]


# -- scaling -----------------------------------------------------------------------------------------------------------
