"""Chen's 9-20-3 network, 810 patterns, 5,000 epochs with an update after every pattern, compared with two peers.

Run with ``OMP_NUM_THREADS=1 python benchmarks/bench_net.py``. Peers are scikit-learn's ``MLPRegressor`` with
``solver="sgd", batch_size=1`` (its output is linear, so it can be compared in speed only) and the same algorithm in
plain numpy, whose weights must be the same. Both would take minutes, so a few epochs are timed and extrapolated.
"""

import sys
import time
import warnings
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from sklearn.exceptions import ConvergenceWarning
from sklearn.neural_network import MLPRegressor

from thermocomp.core.network import Perceptron
from thermocomp.models.numerics.backprop import learning_rates, scaling_in, train_net

FloatArray = NDArray[np.float64]

N_ROWS, SHAPE, N_EPOCHS = 810, (9, 20, 3), 5000
GOAL_SECONDS, GOAL_RATIO = 1.2, 400.0
TURNS, FEW = 5, 4


def patterns() -> tuple[FloatArray, FloatArray]:
    """Return nine scaled temperatures and three scaled drifts, which are nonlinear functions of them."""
    rng = np.random.default_rng(0)
    hours = np.linspace(0, 80, N_ROWS)[:, None]
    rises = 10 * rng.uniform(0.3, 1, 9) * (1 - np.cos(2 * np.pi * (hours / 16 - rng.uniform(0, 0.2, 9))))
    T = rises + 0.1 * rng.normal(size=rises.shape)
    drifts = T @ rng.normal(size=(9, 3)) + 0.05 * (T[:, :3] - T[:, 3:6]) * T[:, 6:] + rng.normal(size=(N_ROWS, 3))
    x, y = (scaling_in(a.min(axis=0), a.max(axis=0))(a) for a in (T, drifts))
    return x, y


def plain(net: Perceptron, x: FloatArray, t: FloatArray, rates: FloatArray) -> list[FloatArray]:
    """Train a copy of `net` with plain numpy; return its weights and thresholds."""
    W, a = np.array(net.hidden_weights), np.array(net.hidden_thresholds)
    V, b = np.array(net.output_weights), np.array(net.output_thresholds)
    for rate in rates:
        for inputs, target in zip(x, t, strict=True):
            h = 1 / (1 + np.exp(-(W @ inputs + a)))
            o = 1 / (1 + np.exp(-(V @ h + b)))
            delta = rate * (target - o) * o * (1 - o)
            slope = (delta @ V) * h * (1 - h)
            V += np.outer(delta, h)
            b += delta
            W += np.outer(slope, inputs)
            a += slope
    return [W, a, V, b]


def numbers(net: Perceptron) -> list[FloatArray]:
    return [np.array(w) for w in (net.hidden_weights, net.hidden_thresholds, net.output_weights, net.output_thresholds)]


def seconds(job: Callable[[], object]) -> float:
    """Return the processor time of `job`: everything runs in one thread, while other programs may run."""
    start = time.process_time()
    job()
    return time.process_time() - start


def main() -> int:
    x, t = patterns()
    rates = learning_rates(N_EPOCHS, 0.5, 0.01, "geometric")

    def ours(rates: FloatArray = rates, order: str = "shuffled") -> Perceptron:
        trained = train_net(x, t, SHAPE[1], rng=np.random.default_rng(1), rates=rates, order=order)  # type: ignore[arg-type]
        return trained.net

    def theirs(n_epochs: int) -> None:
        peer = MLPRegressor(
            hidden_layer_sizes=(SHAPE[1],),
            activation="logistic",
            solver="sgd",
            batch_size=1,
            momentum=0.0,
            alpha=0.0,
            learning_rate_init=0.05,
            max_iter=n_epochs,
            n_iter_no_change=n_epochs,
            random_state=0,
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)
            peer.fit(x, t)

    start = ours(np.array([1e-300]), "fixed")  # the initial weights; compiles, too
    agreed = max(
        float(np.abs(mine - other).max())
        for mine, other in zip(numbers(ours(rates[:3], "fixed")), plain(start, x, t, rates[:3]), strict=True)
    )
    theirs(1)
    times: dict[str, list[float]] = {"ours": [], "scikit-learn": [], "numpy": []}
    for _ in range(TURNS):
        times["ours"].append(seconds(ours))
        # the difference excludes what is done only once
        per_epoch = (seconds(lambda: theirs(1 + FEW)) - seconds(lambda: theirs(1))) / FEW
        times["scikit-learn"].append(per_epoch * N_EPOCHS)
        times["numpy"].append(seconds(lambda: plain(start, x, t, rates[:1])) * N_EPOCHS)
    us = float(np.median(times["ours"]))
    print(f"{'-'.join(map(str, SHAPE))} net, {N_ROWS} patterns x {N_EPOCHS} epochs, update after every pattern")
    print(f"{'':<14} {'median [s]':>11} {'least [s]':>10} {'ratio':>7}")
    for name, found in times.items():
        median = float(np.median(found))
        print(f"{name:<14} {median:>11.2f} {min(found):>10.2f} {median / us:>6.0f}x")
    print(
        f"per pattern: {us / N_ROWS / N_EPOCHS * 1e9:.0f} ns; goals: {GOAL_SECONDS} s, {GOAL_RATIO:.0f}x scikit-learn"
    )
    error = float(np.abs(ours().evaluate(x) - t).mean())
    print(f"mean absolute error after training: {error:.4f} of scaled range; weights agree with numpy to {agreed:.0e}")
    if not agreed < 1e-10:
        raise SystemExit("the weights do not agree with those of the plain algorithm")
    return 0 if us <= GOAL_SECONDS and float(np.median(times["scikit-learn"])) / us >= GOAL_RATIO else 1


if __name__ == "__main__":
    sys.exit(main())
