"""ARX compared with statsmodels (fit) and SysIdentPy (free run): order 5, four inputs with five lags each, 10,000 rows.

Run with ``OMP_NUM_THREADS=1 python benchmarks/bench_arx.py``. Three tasks, timed alternately, medians: the coefficients
by one-step least squares (statsmodels gets the prepared lag matrix, ours starts from the recording), the free run
with the same coefficients, and the orders by FPE (statsmodels refits for each). Agreement is checked in the same run.
"""

import sys
import time
import warnings
from collections.abc import Callable

import numpy as np
import statsmodels.api as sm
from numpy.typing import NDArray
from sysidentpy.basis_function import Polynomial
from sysidentpy.model_structure_selection import FROLS
from sysidentpy.parameter_estimation import LeastSquares

from thermocomp.models.arx import ARX
from thermocomp.models.selection.orders import final_prediction_error

FloatArray = NDArray[np.float64]

N, K, LAGS, INPUTS = 10_000, 5, 5, 4
INTERVAL = 15.0


def machine(seed: int = 0) -> tuple[FloatArray, FloatArray]:
    """Simulate a displacement that follows four inputs through five real poles; 0.05 um of noise in the equation."""
    rng = np.random.default_rng(seed)
    inputs = np.column_stack([np.repeat(rng.uniform(0, 1, N // s + 1), s)[:N] for s in (40, 60, 100, 150)])
    inputs += 0.05 * rng.normal(size=inputs.shape)
    a = -np.poly([0.97, 0.9, 0.6, 0.4, 0.2])[1:]
    b = rng.normal(0, 0.1, (LAGS, INPUTS))
    z = np.zeros(N)
    for t in range(K, N):
        z[t] = a @ z[t - K : t][::-1] + np.sum(b * inputs[t - LAGS + 1 : t + 1][::-1]) + 0.05 * rng.normal()
    return inputs, z


def lag_matrix(inputs: FloatArray, z: FloatArray, k: int, lags: int) -> FloatArray:
    """Return [dz(t-1) .. dz(t-k), inputs(t), inputs(t-1) ..] at t = K .. N - 1."""
    columns = [z[K - i : N - i, None] for i in range(1, k + 1)]
    return np.hstack(columns + [inputs[K - i : N - i] for i in range(lags)])


def medians(
    ours: Callable[[], FloatArray], theirs: Callable[[], FloatArray], turns: int, per_turn: int
) -> tuple[float, float, float]:
    """Return both medians [s] and the largest relative difference."""
    ours()  # warm
    theirs()
    us, them, apart = [], [], 0.0
    for _ in range(turns):
        for _ in range(per_turn):
            start = time.perf_counter()
            a = ours()
            us.append(time.perf_counter() - start)
        start = time.perf_counter()
        b = theirs()
        them.append(time.perf_counter() - start)
        apart = max(apart, float(np.abs(a - b).max() / np.abs(b).max()))
    return float(np.median(us)), float(np.median(them)), apart


def free_run_of_sysidentpy(inputs: FloatArray, z: FloatArray, model: ARX) -> Callable[[], FloatArray]:
    """Return SysIdentPy's free run of our coefficients.

    It has no lag 0: its inputs are moved one row ahead. It takes its first rows from z, which are zero here.
    """
    ahead = np.vstack([inputs[1:], np.zeros((1, INPUTS))])
    peer = FROLS(
        order_selection=False,
        n_terms=K + LAGS * INPUTS + 1,  # and a constant
        ylag=K,
        xlag=[list(range(1, LAGS + 1))] * INPUTS,
        basis_function=Polynomial(degree=1),
        estimator=LeastSquares(),
        err_tol=None,
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        peer.fit(X=ahead[:500], y=z[:500, None])
    # code 1001 .. is y(k-1) .., 2001 .. the lags of the first input, 3001 .. of the second
    weights = []
    for code in peer.final_model[:, 0].tolist():
        of, lag = divmod(code, 1000)
        weights.append(0.0 if of == 0 else model.a_[lag - 1] if of == 1 else model.b_[lag - 1, of - 2])
    assert np.count_nonzero(weights) == K + LAGS * INPUTS, "SysIdentPy did not take all terms"
    peer.theta = np.array(weights)[:, None]
    start = np.zeros((K, 1))
    return lambda: np.asarray(peer.predict(X=ahead, y=start))[:, 0]


def main() -> int:
    inputs, z = machine()
    dt = np.full(N, INTERVAL)
    dt[0] = np.inf
    model = ARX(time="routed", interval=INTERVAL, k=K, m=LAGS - 1)
    X, y = lag_matrix(inputs, z, K, LAGS), z[K:]
    print(f"{'job, n = 10,000':<44} {'ours [ms]':>10} {'peer [ms]':>10} {'ratio':>8} {'goal':>6}  {'apart':>8}")
    reached = True

    def report(title: str, found: tuple[float, float, float], goal: float, allowed: float) -> None:
        nonlocal reached
        us, them, apart = found
        print(f"{title:<44} {us * 1e3:>10.3f} {them * 1e3:>10.1f} {them / us:>7.0f}x {goal:>5.0f}x  {apart:>8.1e}")
        if apart > allowed:
            raise SystemExit(f"{title}: the two sides disagree by {apart:.1e}, more than {allowed:.0e}")
        reached &= them / us >= goal

    def fit() -> FloatArray:
        model.fit(inputs, z, dt=dt)
        return np.concatenate([model.a_, model.b_.ravel()])

    report("fit (5, 4 x 5), statsmodels OLS", medians(fit, lambda: sm.OLS(y, X).fit().params, 9, 5), 5, 1e-8)

    # the free run from rest: no input in the first rows, so both start from zero
    quiet = inputs.copy()
    quiet[:K] = 0.0
    theirs = free_run_of_sysidentpy(quiet, z, model)
    report(
        "free run, SysIdentPy predict",
        medians(lambda: model.predict(quiet, dt=dt)[K:-1], lambda: theirs()[K:-1], 5, 20),
        400,
        1e-9,
    )

    def all_orders() -> FloatArray:
        found = ARX(time="routed", interval=INTERVAL, k_max=K, m_max=LAGS - 1).fit(inputs, z, dt=dt).orders_
        return np.array([o.fpe for o in found])

    def refits() -> FloatArray:
        errors = []
        for k in range(K + 1):
            for m in range(LAGS):
                table = lag_matrix(inputs, z, k, m + 1)
                errors.append(final_prediction_error(sm.OLS(y, table).fit().ssr, len(y), table.shape[1]))
        return np.array(errors)

    report("30 orders by FPE, statsmodels OLS of each", medians(all_orders, refits, 3, 5), 5, 1e-8)
    return 0 if reached else 1


if __name__ == "__main__":
    sys.exit(main())
