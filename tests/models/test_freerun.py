"""Free run of the autoregressive estimators: the clock, freezing, output error, stability."""

from typing import Any

import numpy as np
import pandas as pd
import pytest
import twin_arx
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from twin_arx import SYSTEMS, clock, series

from thermocomp.core.autoregressive import find_largest_root
from thermocomp.core.exceptions import FitError
from thermocomp.core.model import ErrorModel
from thermocomp.files import modelfile
from thermocomp.models.arx import ARX
from thermocomp.models.arx_net import NetARX
from thermocomp.models.clocked import Clocked
from thermocomp.models.numerics import freerun, ticks

FloatArray = NDArray[np.float64]

QUICK: dict[str, Any] = {"hidden": (2, 4), "epochs": 400}


# -- free run and freezing --


def uneven(seed: int, n: int = 160) -> FloatArray:
    """Two tests with jitter, gaps and a double stamp."""
    rng = np.random.default_rng(seed)
    dt = np.where(rng.random(n) < 0.05, 700.0, rng.choice([60.0, 59.3, 61.2, 30.0, 0.0], n))
    dt[0] = dt[n // 2] = np.inf
    return dt


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 1000), st.sampled_from([20.0, 60.0, 600.0]), st.integers(0, 3), st.integers(0, 3))
def test_free_run_equals_the_twin(seed: int, interval: float, k: int, m: int) -> None:
    rng = np.random.default_rng(seed)
    dt = uneven(seed)
    u = rng.normal(size=(len(dt), 2))
    a = freerun.polynomial(rng.uniform(0, 0.97, k))
    c = freerun.Coefficients(a, rng.normal(size=(m + 1, 2)), 0.3)
    half = len(dt) // 2
    expected = []
    for rows in (slice(0, half), slice(half, None)):
        time = np.cumsum(np.r_[0.0, dt[rows][1:]])
        expected.append(twin_arx.free_run(time, u[rows], interval, twin_arx.linear(c.a, c.b, 0.3)))
    got = np.concatenate([c.at_rows(r) for r in ticks.put_on_clock(u, dt, interval)])
    np.testing.assert_allclose(got, np.concatenate(expected), rtol=1e-9, atol=1e-9)


def stepped(model: ErrorModel, X: FloatArray, dt: FloatArray) -> FloatArray:
    out = np.empty(len(X))
    state = model.init()
    for k in range(len(X)):
        if np.isinf(dt[k]):
            state = model.init()
        state, out[k] = model.step(state, X[k], 0.0 if np.isinf(dt[k]) else float(dt[k]))
    return out


ESTIMATORS = [
    ARX(time="routed", inputs=["n", "t"], k=2, m=1, interval=60.0),
    ARX(time="routed", inputs=["n"], interval=60.0, fit_intercept=True),
    ARX(time="routed", inputs=[1], interval=60.0, criterion="free-run", k_max=1, m_max=1),
    ARX(time="routed", inputs=["n"], k=0, m=0, interval=60.0),
    NetARX(time="routed", inputs=["n"], interval=60.0, **QUICK),
    NetARX(time="routed", inputs=["t", "n"], k=2, m=2, interval=180.0, hidden=3, epochs=400),
]


@pytest.mark.parametrize("estimator", ESTIMATORS, ids=str)
def test_frozen_is_the_estimator(estimator: ARX | NetARX) -> None:
    u, z = series((1, 0), 5, n=240)
    t = np.cumsum(np.random.default_rng(5).normal(0, 0.1, len(z)))
    X = pd.DataFrame({"t": t, "n": u[:, 0], "unused": 1.0})
    grid = clock(len(z), 60.0)
    grid[120] = np.inf
    cycle = np.arange(len(z)) // 60
    model = estimator.fit(X, z, dt=grid, cycle=cycle).freeze(target="z")
    assert "unused" not in [i.name for i in model.inputs]
    columns = X[[i.name for i in model.inputs]].to_numpy()
    jitter = grid + np.where(np.isfinite(grid), np.random.default_rng(6).uniform(-0.5, 0.5, len(grid)), 0.0)
    for dt in (grid, jitter, uneven(1, len(z))):
        np.testing.assert_allclose(stepped(model, columns, dt), estimator.predict(X, dt=dt), rtol=1e-10, atol=1e-10)
    assert estimator.predict(X, dt=grid)[[0, 120]].tolist() == [0.0, 0.0]  # cold start of each test
    # close, not equal: a reading that is 0.5 s late sees the speed change 0.5 s later
    assert np.abs(estimator.predict(X, dt=jitter) - estimator.predict(X, dt=grid)).max() < 0.1 * np.ptp(z)
    (again,) = modelfile.loads(modelfile.dumps([model]))
    assert again == model


@pytest.mark.parametrize("estimator", ESTIMATORS, ids=str)
def test_at_rest_is_where_it_settles(estimator: ARX | NetARX) -> None:
    u, z = series((1, 0), 5, n=240)
    X = pd.DataFrame({"t": np.sin(np.arange(len(z))), "n": u[:, 0]})
    grid = clock(len(z), 60.0)
    estimator.fit(X, z, dt=grid)
    some = X.iloc[[0, 17, 200]]
    at_rest = estimator._recursion.settled(some.to_numpy()[:, estimator._columns])  # what time="none" predicts
    for row, settled in zip(range(3), at_rest, strict=True):
        long = pd.concat([some.iloc[[row]]] * 2)
        assert estimator.predict(long, dt=[np.inf, 1e6])[1] == pytest.approx(settled, rel=1e-6, abs=1e-6)


def test_each_test_starts_cold_and_rows_not_learned_from_drive() -> None:
    u, z = series((2, 1), 6, n=400, equation=0.001)
    cycle = np.arange(400) // 100
    cycle[100:200] = -1
    models = []
    for value in (0.0, 1e6):
        y = np.where(cycle < 0, value, z)
        e = ARX(time="routed", k=2, m=1).fit(u, y, dt=clock(400), cycle=cycle)
        models.append(e.freeze(target="z"))
        np.testing.assert_allclose(e.a_, SYSTEMS[2, 1][0], rtol=1e-2)
        assert np.abs(e.predict(u, dt=clock(400)) - z).max() < 0.1  # through the cycle it has not learned from
    assert models[0] == models[1]


def test_averaged_onto_a_coarser_clock() -> None:
    """Rows every 15 s, a clock of 300 s: exact for a first-order lag when the speed changes with the ticks."""
    tau, n = 3600.0, 4000
    rng = np.random.default_rng(7)
    speed = np.repeat(rng.uniform(0, 5000, n // 80 + 1), 80)[: n + 1]
    speed = np.r_[0.0, speed[:n]]
    z = np.zeros(n + 1)
    for t in range(1, n + 1):
        z[t] = z[t - 1] * np.exp(-15 / tau) + 0.01 * speed[t] * (1 - np.exp(-15 / tau))
    dt = clock(n + 1, 15.0)
    e = ARX(time="routed", k=1, m=0, interval=300.0).fit(speed[:, None], z, dt=dt)
    assert e.a_[0] == pytest.approx(np.exp(-300 / tau), rel=1e-9)
    assert e.b_[0, 0] == pytest.approx(0.01 * (1 - np.exp(-300 / tau)), rel=1e-9)
    free = e.predict(speed[:, None], dt=dt)
    np.testing.assert_allclose(free[::20], z[::20], atol=1e-9)
    assert np.abs(free - z).max() < 0.5  # straight lines between the ticks
    assert ARX(time="routed", interval=None, k=1, m=0).fit(speed[:, None], z, dt=dt).interval_ == 15.0


def test_a_double_stamp_and_a_gap_are_not_a_grid() -> None:
    """As many rows as ticks, and every row on a tick: still not one row per tick."""
    dt, u = np.array([np.inf, 0.0, 120.0]), np.array([[1.0], [5.0], [3.0]])
    (run,) = ticks.put_on_clock(u, dt, 60.0)
    assert run.count.tolist() == [0, 0, 2]
    assert run.drive[:, 0].tolist() == [1.0, 3.0, 3.0]
    c = freerun.Coefficients(np.array([0.5]), np.array([[1.0]]))
    assert c.at_rows(run).tolist() == [0.0, 0.0, 4.5]  # 3, then 1.5 + 3


def test_rounding_of_a_clock_is_no_jitter() -> None:
    u: FloatArray = np.linspace(0.0, 5.0, 6)[:, None]
    (exact,) = ticks.put_on_clock(u, clock(6, 0.1), 0.1)
    for factor in (1 - 1e-9, 1 + 1e-9):
        (rounded,) = ticks.put_on_clock(u, clock(6, 0.1 * factor), 0.1)
        assert rounded.row_by_row
        assert np.array_equal(rounded.drive, exact.drive)


def test_before_the_start_there_was_no_drift() -> None:
    """P-05: the first displacement counts as the past of the next ticks; what was before it is zero."""
    own, drive = np.array([1.0, 2.0, 3.0]), np.array([[10.0], [20.0], [30.0]])
    found = ticks.regressors(own, drive, np.array([0, 1, 2]), 2, 0, drive)
    np.testing.assert_array_equal(found, [[0.0, 0.0, 10.0], [1.0, 0.0, 20.0], [2.0, 1.0, 30.0]])


def test_displacements_are_not_interpolated_over_gaps() -> None:
    dt = np.array([np.inf, 60.0, 60.0, 600.0, 60.0, 60.0, 30.0, 60.0])
    y: FloatArray = np.linspace(0.0, 7.0, 8)
    known = np.ones(8, dtype=np.bool_)
    known[5] = False
    (run,) = runs = ticks.put_on_clock(np.ones((8, 1)), dt, 60.0)
    (found,) = ticks.displacements(runs, y, dt, known, 60.0)
    nan = np.nan
    #                      0 1 2  the gap: nine ticks are not known   12   13 14 15: row 5, then half way from 6 to 7
    np.testing.assert_array_equal(found, [0, 1, 2, *[nan] * 9, 3, 4, nan, 6.5])
    assert run.count.tolist() == [0, 1, 2, 12, 13, 14, 14, 15]
    np.testing.assert_allclose(run.phase, [0, 0, 0, 0, 0, 0, 0.5, 0.5])


def test_a_gap_of_one_and_a_half_steps_is_none() -> None:
    """P-05: between rows 90 s apart a displacement is interpolated, between those 95 s apart it is not."""
    dt = np.array([np.inf, 60.0, 60.0, 60.0, 90.0, 60.0, 60.0, 95.0, 60.0])
    y: FloatArray = np.arange(9.0)
    runs = ticks.put_on_clock(np.ones((9, 1)), dt, 60.0)
    (found,) = ticks.displacements(runs, y, dt, np.ones(9, dtype=np.bool_), 60.0)
    np.testing.assert_allclose(found, [0, 1, 2, 3, 3 + 2 / 3, 4.5, 5.5, np.nan, np.nan, 7 + 55 / 60])


# -- output error --


@pytest.mark.parametrize("by_poles", [True, False])
@pytest.mark.parametrize("intercept", [True, False])
def test_gradient_of_the_free_run(intercept: bool, by_poles: bool) -> None:
    rng = np.random.default_rng(8)
    dt = clock(60)
    dt[25] = np.inf
    runs = ticks.put_on_clock(rng.normal(size=(60, 2)), dt, 600.0)
    targets = [np.where(rng.random(len(r.drive)) < 0.8, rng.normal(size=len(r.drive)), np.nan) for r in runs]
    problem = freerun._Problem(runs, targets, 2, 2, intercept, 0.99, by_poles=by_poles)
    theta = rng.normal(size=problem.size)
    theta[:2] = (0.9, 0.4) if by_poles else (1.3, -0.36)
    J = problem.jacobian(theta)
    for i in range(problem.size):
        step = 1e-6 * np.eye(problem.size)[i]
        numeric = (problem._error(theta - step) - problem._error(theta + step)) / 2e-6
        np.testing.assert_allclose(J[:, i], numeric, rtol=1e-6, atol=1e-7)


def test_output_error_is_a_minimum() -> None:
    u, z = series((2, 1), 9, n=300)
    noisy = z + np.random.default_rng(9).normal(0, 1.0, len(z))
    dt = clock(len(z))
    data = Clocked(600.0, ticks.put_on_clock(u, dt, 600.0), noisy, dt, np.zeros(len(z), dtype=np.intp))
    best = freerun.output_error(data.runs, data.targets(), 2, 1, intercept=False, largest_root=0.999)
    assert best is not None

    def squares(c: freerun.Coefficients) -> float:
        return float(np.sum((noisy - c.ticked(data.runs[0]))[1:] ** 2))

    least = squares(best)
    truth = freerun.Coefficients(*SYSTEMS[2, 1])
    assert least <= squares(truth)
    rng = np.random.default_rng(10)
    for _ in range(30):
        near = freerun.Coefficients(
            best.a + 1e-4 * rng.normal(size=2), best.b * (1 + 1e-3 * rng.normal(size=(2, 1))), 0.0
        )
        assert squares(near) >= least


def test_heat_flow_does_not_oscillate() -> None:
    """A resonance would fit better; the poles stay real all the same."""
    rng = np.random.default_rng(11)
    u = np.repeat(rng.uniform(0, 5000, 60), 10)[:, None]
    a, z = np.array([1.8, -0.9]), np.zeros(600)
    for t in range(2, 600):
        z[t] = a[0] * z[t - 1] + a[1] * z[t - 2] + 0.001 * u[t, 0]
    e = ARX(time="routed", k=2, m=1, criterion="free-run").fit(u, z, dt=clock(600))
    assert np.isreal(np.roots([1, *-e.a_])).all() or np.abs(np.roots([1, *-e.a_]).imag).max() < 1e-6
    start = ARX(time="routed", k=1, m=1, criterion="free-run").fit(u, z, dt=clock(600))
    assert e.free_run_rms_ <= start.free_run_rms_ * (1 + 1e-6)


# -- stability --


def growing(n: int = 200) -> tuple[FloatArray, FloatArray]:
    return np.full((n, 1), 1000.0), np.expm1(0.02 * np.arange(n))


def test_a_free_run_never_runs_away() -> None:
    u, z = growing()
    dt = clock(len(z))
    with pytest.raises(FitError, match=r"largest root is 1\.0.* does not decay"):
        ARX(time="routed", k=1, m=0).fit(u, z, dt=dt)
    chosen = ARX(time="routed").fit(u, z, dt=dt)
    assert [o.admissible for o in chosen.orders_ if o.k == 1] == [False] * 6
    assert find_largest_root(chosen.a_) < 1
    free = ARX(time="routed", k=2, m=1, criterion="free-run").fit(u, z, dt=dt)
    assert find_largest_root(free.a_) < np.exp(-1 / len(z))
    net = NetARX(time="routed", **QUICK).fit(u, z, dt=dt)
    far = net.predict(np.full((3, 1), 1000.0), dt=[np.inf, 1e5, 1e7])
    assert (np.abs(far) <= 1.25 * z.max()).all()
    for e in (chosen, free, net):
        assert np.isfinite(e.freeze(target="z").step(e.freeze(target="z").begin_at(1e3), np.array([1e3]), 1e9)[1])  # type: ignore[attr-defined]


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from(["fpe", "bic", "free-run"]))
def test_whatever_the_data_the_polynomial_decays(seed: int, criterion: str) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(12, 80))
    z = np.cumsum(rng.normal(size=n)) * rng.choice([1.0, 1e-6, 1e6]) + rng.normal() * np.arange(n)
    u = np.repeat(rng.choice([0.0, 1000.0, 3000.0], n // 6 + 1), 6)[:n, None]
    fixed: dict[str, Any] = {"k": 2, "m": 1} if criterion == "free-run" else {}
    e = ARX(time="routed", criterion=criterion, **fixed)  # type: ignore[arg-type]
    e.fit(u, z, dt=clock(n))
    assert find_largest_root(e.a_) < 1
    assert np.isfinite(e.predict(u, dt=clock(n))).all()
    e.freeze(target="z")
