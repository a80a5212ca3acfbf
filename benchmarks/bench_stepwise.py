"""Stepwise regression compared with a loop over statsmodels that refits OLS for every candidate.

Run with ``OMP_NUM_THREADS=1 python benchmarks/bench_stepwise.py [--quick]``; ``--quick`` omits the 324 terms.
Both use the same thresholds and must select the same terms; ours is the whole ``fit`` of the estimator.
"""

import sys
import time
from collections.abc import Callable, Sequence

import numpy as np
import pandas as pd
import statsmodels.api as sm
from numpy.typing import NDArray

from thermocomp.models.numerics.stepwise import AlphaThresholds, FThresholds, Rule, alpha_of_f
from thermocomp.models.partial_f import PartialF
from thermocomp.models.second_order import SecondOrderRegression

FloatArray = NDArray[np.float64]

N_ROWS = 10_000
N_TEMPERATURES = 24


def network(n_rows: int, n_nodes: int, seed: int, bending: float) -> tuple[FloatArray, FloatArray]:
    """Simulate a chain of lumped masses that a spindle heats at one end and two axes further on.

    Parameters
    ----------
    n_rows, n_nodes, seed : int
    bending : float
        Drift per squared gradient between two of the masses [um/K^2].

    Returns
    -------
    temperatures : ndarray of shape (n_rows, n_nodes)
        Rises, with 0.02 K of sensor noise [K].
    drift : ndarray of shape (n_rows,)
        Expansion of the chain, its bending, and 0.1 um of noise of the probe [um].
    """
    rng = np.random.default_rng(seed)
    dt = 10.0
    capacity = rng.uniform(2e3, 2e4, n_nodes)
    conductance = rng.uniform(5.0, 30.0, n_nodes - 1)
    loss = rng.uniform(0.2, 2.0, n_nodes)
    exchange = np.diag(loss)
    for i, g in enumerate(conductance):
        exchange[i : i + 2, i : i + 2] += g * np.array([[1, -1], [-1, 1]])
    transition = np.linalg.inv(np.eye(n_nodes) + dt * exchange / capacity[:, None])
    heated = [0, n_nodes // 3, 2 * n_nodes // 3]
    power = np.repeat(rng.uniform(0, 1, (n_rows // 200 + 1, 3)) ** 2 * [300, 150, 100], 200, axis=0)
    rises = np.zeros((n_rows, n_nodes))
    state = np.zeros(n_nodes)
    for k in range(n_rows):
        heat = np.zeros(n_nodes)
        heat[heated] = power[k]
        state = transition @ (state + dt * heat / capacity)
        rises[k] = state
    length = rng.uniform(0.2, 2.0, n_nodes)
    drift = rises @ length + bending * (rises[:, 0] - rises[:, 5]) ** 2 + rng.normal(0, 0.1, n_rows)
    return rises + rng.normal(0, 0.02, rises.shape), drift


def recipe(frame: pd.DataFrame, y: FloatArray, rule: Rule, intercept: bool) -> list[str]:
    """Select columns with statsmodels alone."""

    def fit(names: list[str]) -> "sm.regression.linear_model.RegressionResultsWrapper":
        return sm.OLS(y, sm.add_constant(frame[names]) if intercept else frame[names]).fit()

    chosen: list[str] = []
    while True:
        f = {}
        for name in frame.columns.drop(chosen):
            result = fit([*chosen, name])
            f[name] = result.tvalues[name] ** 2
        best = max(f, key=lambda name: f[name])
        if f[best] < rule.enter_f(len(y) - intercept - len(chosen) - 1):
            return chosen
        chosen.append(best)
        while True:
            result = fit(chosen)
            squares = result.tvalues[chosen] ** 2
            if squares.min() >= rule.delete_f(int(result.df_resid)):
                break
            chosen.remove(squares.idxmin())


def timed(job: Callable[[], Sequence[str]]) -> tuple[float, Sequence[str]]:
    start = time.perf_counter()
    found = job()
    return time.perf_counter() - start, found


def compare(
    title: str,
    ours: Callable[[], Sequence[str]],
    theirs: Callable[[], Sequence[str]],
    goal: float,
    repeats: tuple[int, int],
) -> bool:
    """Time both sides in turn, print medians and ratio, and state whether the goal is reached."""
    ours()  # warm
    our_times, their_times = [], []
    per_turn = repeats[0] // repeats[1]
    for _ in range(repeats[1]):
        for _ in range(per_turn):
            seconds, mine = timed(ours)
            our_times.append(seconds)
        seconds, other = timed(theirs)
        their_times.append(seconds)
        if set(mine) != set(other):
            raise SystemExit(f"{title}: not the same terms\n  ours   {sorted(mine)}\n  theirs {sorted(other)}")
    us, them = float(np.median(our_times)), float(np.median(their_times))
    print(f"{title:<34} {len(mine):>5} {us * 1e3:>10.2f} {them * 1e3:>12.1f} {them / us:>8.0f}x {goal:>6.0f}x")
    return them / us >= goal


def main() -> int:
    X, y = network(N_ROWS, N_TEMPERATURES, seed=20, bending=0.0)
    names = [f"T{i + 1}" for i in range(N_TEMPERATURES)]
    frame = pd.DataFrame(X, columns=names)
    print(f"condition number of the {N_TEMPERATURES} temperatures, scaled: {np.linalg.cond(X / X.std(axis=0)):.0f}")
    print(f"{'job, n = 10,000':<34} {'terms':>5} {'ours [ms]':>10} {'recipe [ms]':>12} {'ratio':>9} {'goal':>7}")
    model = PartialF()
    reached = compare(
        "partial-f, 24 temperatures",
        lambda: model.fit(frame, y).terms_,
        lambda: recipe(frame, y, FThresholds(), intercept=True),
        goal=300,
        repeats=(50, 5),
    )
    if "--quick" not in sys.argv:
        y = network(N_ROWS, N_TEMPERATURES, seed=20, bending=0.05)[1]
        alphas = alpha_of_f(100.0, N_ROWS - 20), alpha_of_f(50.0, N_ROWS - 20)
        mra = SecondOrderRegression(alpha_enter=alphas[0], alpha_remove=alphas[1]).fit(frame, y)
        products = {name: frame[[*name.split("*")]].prod(axis=1) for name in mra.candidates_}
        terms = pd.DataFrame(products)
        reached &= compare(
            f"mra, {len(terms.columns)} second-order terms",
            lambda: mra.fit(frame, y).terms_,
            lambda: recipe(terms, y, AlphaThresholds(*alphas), intercept=False),
            goal=150,
            repeats=(9, 1),
        )
    return 0 if reached else 1


if __name__ == "__main__":
    sys.exit(main())
