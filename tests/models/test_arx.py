"""Autoregressive estimators: orders, coefficients, free run, freezing, bad input, measured data."""

import math
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray
from sklearn.utils.estimator_checks import parametrize_with_checks
from twin_arx import SYSTEMS, clock, series

from thermocomp.core.autoregressive import find_largest_root
from thermocomp.core.exceptions import FitError, InputError
from thermocomp.models.arx import ARX
from thermocomp.models.arx_net import NetARX
from thermocomp.models.base import ThermalRegressor
from thermocomp.models.numerics.leastsquares import join_columns, triangle
from thermocomp.models.selection import orders
from thermocomp.recordings.samples import Samples

FloatArray = NDArray[np.float64]

QUICK: dict[str, Any] = {"hidden": (2, 4), "epochs": 400}


@parametrize_with_checks(  # type: ignore[untyped-decorator]
    [
        ARX(time="none"),
        ARX(time="none", criterion="free-run", k_max=2, m_max=2),
        ARX(time="none", fit_intercept=True),
        NetARX(epochs=200, time="none"),
    ]
)
def test_contract_of_scikit_learn(estimator: ThermalRegressor, check: Callable[[ThermalRegressor], None]) -> None:
    check(estimator)


# -- series with known orders --


@pytest.mark.parametrize("order", SYSTEMS)
def test_orders_of_simulated_series(order: tuple[int, int]) -> None:
    """P-02. FPE never takes too few, and the true orders more often than any others; BIC takes them nearly always."""
    found: dict[str, list[tuple[int, int]]] = {"fpe": [], "aic": [], "bic": []}
    for seed in range(20):
        u, z = series(order, seed)
        for criterion, chosen in found.items():
            e = ARX(time="routed", criterion=criterion).fit(u, z, dt=clock(len(z)))  # type: ignore[arg-type]
            chosen.append((e.k_, e.m_))
    assert all(k >= order[0] and m >= order[1] for k, m in found["fpe"])
    assert Counter(found["fpe"]).most_common(1)[0][0] == order
    assert found["fpe"].count(order) >= 8
    assert found["bic"].count(order) >= 18
    assert found["aic"] == found["fpe"]  # equal to the second order in d / N


def test_fpe_by_hand() -> None:
    # N = 20, d = 4, SSE = 5: 0.25 * 24 / 16
    assert orders.final_prediction_error(5.0, 20, 4) == pytest.approx(0.375)
    assert orders.final_prediction_error(5.0, 4, 4) == math.inf


@pytest.mark.parametrize("intercept", [True, False])
def test_table_of_orders_equals_plain_fits(intercept: bool) -> None:
    """All orders from one triangle: the same SSE as a least-squares fit of each, on the same rows."""
    u, z = series((2, 1), 3, n=120)
    K, M = 4, 3
    e = ARX(time="routed", k_max=K, m_max=M, fit_intercept=intercept).fit(u, z + 1.0, dt=clock(len(z)))
    assert [(o.k, o.m) for o in e.orders_] == [(k, m) for k in range(K + 1) for m in range(M + 1)]
    y = (z + 1.0)[K:]
    for o in e.orders_:
        columns = [(z + 1.0)[K - i : len(z) - i] for i in range(1, o.k + 1)]
        columns += [u[K - i : len(z) - i, 0] for i in range(o.m + 1)] + [np.ones(len(y))] * intercept
        Z = np.column_stack(columns)
        w, *_ = np.linalg.lstsq(Z, y, rcond=None)
        sse = float(np.sum((y - Z @ w) ** 2))
        d = o.k + o.m + 1 + intercept
        assert (o.n_rows, o.n_parameters) == (len(y), d)
        assert o.sse == pytest.approx(sse, rel=1e-9)
        assert o.fpe == pytest.approx(sse / len(y) * (len(y) + d) / (len(y) - d))
        assert o.aic == pytest.approx(len(y) * np.log(sse / len(y)) + 2 * d)
        assert o.bic == pytest.approx(len(y) * np.log(sse / len(y)) + d * np.log(len(y)))
        assert o.largest_root == pytest.approx(find_largest_root(w[: o.k]), rel=1e-6, abs=1e-9)


def test_without_noise_the_smallest_exact_order_wins() -> None:
    u, z = series((2, 1), 0, equation=0.0)
    e = ARX(time="routed").fit(u, z, dt=clock(len(z)))
    assert (e.k_, e.m_) == (2, 1)
    np.testing.assert_allclose(e.a_, SYSTEMS[2, 1][0], rtol=1e-8)
    np.testing.assert_allclose(e.b_, SYSTEMS[2, 1][1], rtol=1e-8)
    np.testing.assert_allclose(e.predict(u, dt=clock(len(z))), z, atol=1e-7)


@pytest.mark.parametrize("order", SYSTEMS)
@pytest.mark.parametrize("criterion", ["fpe", "free-run"])
def test_coefficients_are_recovered(order: tuple[int, int], criterion: str) -> None:
    """Each with the noise it is made for: in the equation, or of the probe."""
    u, z = series(order, 1, n=4000, equation=0.02 if criterion == "fpe" else 0.0)
    if criterion == "free-run":
        z = z + np.random.default_rng(1).normal(0, 0.05, len(z))
    e = ARX(time="routed", k=order[0], m=order[1], criterion=criterion)  # type: ignore[arg-type]
    e.fit(u, z, dt=clock(len(z)))
    a, b = SYSTEMS[order]
    np.testing.assert_allclose(e.a_, a, atol=0.02 * np.abs(a).max())
    np.testing.assert_allclose(e.b_, b, atol=0.02 * np.abs(b).max())
    assert np.isnan(e.cv_rms_)  # nothing was chosen


def test_probe_noise_biases_one_step_errors_but_not_the_free_run() -> None:
    """E-P3: the probe's noise enters the past displacements; least squares on one step then decays too fast."""
    u, z = series((1, 0), 2, n=2000, equation=0.0)
    noisy = z + np.random.default_rng(0).normal(0, 4.0, len(z))
    one = ARX(time="routed", k=1, m=0).fit(u, noisy, dt=clock(len(z)))
    free = ARX(time="routed", k=1, m=0, criterion="free-run").fit(u, noisy, dt=clock(len(z)))
    assert one.a_[0] < 0.88
    assert free.a_[0] == pytest.approx(0.9, abs=0.002)
    assert free.free_run_rms_ < one.free_run_rms_
    clean = [np.sqrt(np.mean((e.predict(u, dt=clock(len(z))) - z) ** 2)) for e in (one, free)]
    assert clean[1] < 0.2 < clean[0]


def test_one_step_errors_are_trivially_small() -> None:
    """E-P3: in short steps, the last displacement is all one needs to look good; the free run tells."""
    u, z = series((1, 0), 4, equation=0.5)
    e = ARX(time="routed", k=1, m=0).fit(u, z, dt=clock(len(z)))
    both = e.one_step(u, z, dt=clock(len(z)))
    assert both.shape == (len(z) - 1, 2)
    np.testing.assert_allclose(both[:, 0], z[1:])
    np.testing.assert_allclose(both[:, 1], e.a_[0] * z[:-1] + e.b_[0, 0] * u[1:, 0])
    assert np.sqrt(np.mean((both[:, 0] - both[:, 1]) ** 2)) == pytest.approx(e.one_step_rms_)
    assert e.one_step_rms_ < 0.6 * e.free_run_rms_


# -- choices --


def test_intervals_and_orders_are_judged_on_cycles_left_out(samples: Samples) -> None:
    X, y, dt, cycle = samples.frame(), samples.deviations[:, 0], samples.dt(), samples.cycle
    e = ARX(
        time="routed",
        inputs=["spindle_rpm"],
        interval=(120.0, 600.0),
        criterion="free-run",
        k_max=2,
        m_max=1,
        fit_intercept=None,
    )
    e.fit(X, y, dt=dt, cycle=cycle)
    assert len(e.trials_) == 2 * 3 * 2 * 2
    best = min(e.trials_, key=lambda c: c.cv_rms)
    assert (e.interval_, e.k_, e.m_, e.intercept_ != 0) == (best.interval, best.k, best.m, best.intercept)
    assert e.cv_rms_ == best.cv_rms
    assert e.chosen_by_ == "4 thermal cycles, left out in turn"
    assert e.orders_ == ()
    # by hand: each cycle left out in turn, refitted, and judged in free run
    errors = []
    for k in range(4):
        left = np.where(cycle == k, -1, cycle)
        one = ARX(time="routed",
            inputs=["spindle_rpm"], interval=best.interval, k=best.k, m=best.m, criterion="free-run",
            fit_intercept=best.intercept,
        ).fit(X, y, dt=dt, cycle=left)  # fmt: skip
        errors.append(np.sqrt(np.mean((y - one.predict(X, dt=dt))[cycle == k] ** 2)))
    assert e.cv_rms_ == pytest.approx(np.mean(errors), rel=1e-6)
    assert "only inputs are spindle_rpm" in e.caution_
    assert "ambient" in e.caution_  # E-P6


def test_a_setting_that_cannot_be_fitted_without_a_cycle_is_not_chosen() -> None:
    u, z = series((1, 0), 3, n=120)
    dt, cycle = clock(120, 60.0), np.arange(120) // 60
    e = ARX(time="routed", interval=(60.0, 1200.0), k=3, m=3).fit(u, z, dt=dt, cycle=cycle)
    assert [math.isfinite(c.cv_rms) for c in e.trials_] == [True, False]
    assert e.interval_ == 60.0
    net = NetARX(time="routed", interval=1800.0, k=2, hidden=(2, 3), epochs=50).fit(u, z, dt=dt, cycle=cycle)
    assert [c.cv_rms for c in net.trials_] == [math.inf, math.inf]


def test_hidden_nodes_are_judged_on_cycles_left_out(samples: Samples) -> None:
    X, y, dt, cycle = samples.frame(), samples.deviations[:, 0], samples.dt(), samples.cycle
    e = NetARX(time="routed", inputs=["spindle_rpm"], **QUICK).fit(X, y, dt=dt, cycle=cycle)
    assert [c.hidden for c in e.trials_] == [2, 4]
    assert e.hidden_ == min(e.trials_, key=lambda c: c.cv_rms).hidden
    assert e.net_.shape == (2, e.hidden_, 1)
    again = NetARX(time="routed", inputs=["spindle_rpm"], **QUICK, jobs=1).fit(X, y, dt=dt, cycle=cycle)
    assert again.trials_ == e.trials_
    linear = ARX(time="routed", inputs=["spindle_rpm"]).fit(X, y, dt=dt, cycle=cycle)
    searched = NetARX(time="routed", inputs=["spindle_rpm"], k=None, m=None, **QUICK).fit(X, y, dt=dt, cycle=cycle)
    assert (searched.k_, searched.m_) == (linear.k_, linear.m_)  # E-P2: the same search
    # a net that has not seen the cycle on which it is judged
    for tried in e.trials_:
        left_out = []
        for fold in np.unique(cycle[cycle >= 0]):
            own: dict[str, Any] = {"time": "routed", "inputs": ["spindle_rpm"], "hidden": tried.hidden, "epochs": 400}
            without = NetARX(**own).fit(X, y, dt=dt, cycle=np.where(cycle == fold, -1, cycle))
            left_out.append(np.sqrt(np.mean((y - without.predict(X, dt=dt))[cycle == fold] ** 2)))
        assert tried.cv_rms == pytest.approx(np.mean(left_out), rel=1e-6)


def test_the_net_finds_the_drift_in_the_last_drift_and_the_speed() -> None:
    """P-03: on cycles that it has not seen, also where the drift is not linear in the speed."""
    rng, n = np.random.default_rng(4), 100
    speed = np.concatenate([np.repeat(rng.choice([0.0, 1000.0, 2000.0, 3000.0], n // 10), 10) for _ in range(8)])
    drift, cycle = np.zeros(8 * n), np.repeat(np.arange(8), n)
    for k in range(8 * n):
        drift[k] = (0.9 * drift[k - 1] if k % n else 0.0) + 4.0 * np.tanh(speed[k] / 1000.0)
    X, dt, seen = speed[:, None], np.tile(clock(n), 8), np.where(cycle < 6, cycle, -1)

    net = NetARX(time="routed", k=1, m=0, hidden=3, epochs=3000).fit(X, drift, dt=dt, cycle=seen)

    left = (drift - net.predict(X, dt=dt))[cycle >= 6]
    assert np.sqrt(np.mean(left**2)) < 0.15 * np.sqrt(np.mean(drift[cycle >= 6] ** 2))


def test_measured_data(shared_data: Path) -> None:
    """E-P6: from the speed alone, ch1 becomes better than without compensation on the unseen cycle and ch3 worse."""
    data = pd.read_csv(shared_data / "fl_thermal" / "recording.csv")
    X = data[["spindle_rpm"]]
    dt = clock(len(X), 15.0)
    cycle = np.searchsorted([1951, 3871, 5791], np.arange(len(X)), side="right")
    cycle[7711:] = -1
    for channel, better in (("ch1_um", True), ("ch3_um", False)):
        y = data[channel].to_numpy()
        none = np.sqrt(np.mean(y[7711:] ** 2))
        print(f"\n{channel}: none {none:.2f} um", end="")
        for estimator in (
            ARX(time="routed", inputs=["spindle_rpm"], k=1, m=0, interval=None),
            ARX(time="routed", inputs=["spindle_rpm"], k=1, m=0),
            ARX(time="routed", inputs=["spindle_rpm"]),
            ARX(time="routed", inputs=["spindle_rpm"], criterion="free-run", k_max=2, m_max=2),
            NetARX(time="routed", inputs=["spindle_rpm"], hidden=4),
        ):
            e = estimator.fit(X, y, dt=dt, cycle=cycle)
            rms = np.sqrt(np.mean((y - e.predict(X, dt=dt))[7711:] ** 2))
            print(f"; {type(e).__name__} {(e.k_, e.m_)} every {e.interval_:g} s {rms:.2f}", end="")
            assert (rms < none) == better


# -- bad input --


def test_no_spindle_speed() -> None:
    u, z = series((1, 0), 0, n=50)
    for estimator in (ARX(time="routed", inputs=()), NetARX(time="routed", inputs=())):
        with pytest.raises(FitError, match=r"no spindle speed to predict from.*Record the spindle speed"):
            estimator.fit(u, z, dt=clock(50))


@pytest.mark.parametrize(
    ("settings_", "message"),
    [
        ({"interval": 0.0}, "interval 0.0: expected positive"),
        ({"interval": ()}, "expected positive"),
        ({"interval": (60.0, np.nan)}, "expected positive"),
        ({"interval": 1e-6}, "use a longer interval"),
        ({"k": -1}, "order k: -1"),
        ({"m_max": -1}, "order m: -1"),
        ({"criterion": "r2"}, "criterion 'r2'"),
        ({"inputs": ["rpm"]}, "input 'rpm': no such column; the columns are x0"),
        ({"inputs": [0, 0]}, "given twice"),
        ({"inputs": [3]}, "beyond the 1 columns"),
    ],
)
def test_bad_settings(settings_: dict[str, Any], message: str) -> None:
    u, z = series((1, 0), 0, n=50)
    with pytest.raises(InputError, match=message):
        ARX(time="routed", **settings_).fit(u, z, dt=clock(50))


@pytest.mark.parametrize("settings_", [{"hidden": ()}, {"hidden": (0, 2)}, {"k": -2}, {"m": -2}, {"epochs": 0}])
def test_bad_settings_of_the_net(settings_: dict[str, Any]) -> None:
    u, z = series((1, 0), 0, n=50)
    with pytest.raises(InputError):
        NetARX(time="routed", **settings_).fit(u, z, dt=clock(50))


@pytest.mark.parametrize(
    "estimator",
    [
        ARX(time="routed", k=2, m=1),
        ARX(time="routed", k=2, m=1, criterion="free-run"),
        NetARX(time="routed", k=2, **QUICK),
    ],
    ids=str,
)
def test_bad_data(estimator: ARX | NetARX) -> None:
    u, z = series((1, 0), 0, n=50)
    with pytest.raises(FitError, match=r"only [012] time steps have all the earlier values"):
        estimator.fit(u[:3], z[:3], dt=clock(3))
    with pytest.raises(InputError, match="dt: expected 50 non-negative time steps"):
        estimator.fit(u, z, dt=[1.0])
    with pytest.raises(InputError, match="non-negative"):
        estimator.fit(u, z, dt=-clock(50))
    with pytest.raises(InputError, match="cycle: expected 50"):
        estimator.fit(u, z, dt=clock(50), cycle=[0])
    with pytest.raises(FitError, match="no training rows"):
        estimator.fit(u, z, dt=clock(50), cycle=np.full(50, -1))
    bad = u.copy()
    bad[7] = np.nan
    with pytest.raises(ValueError, match="NaN"):
        estimator.fit(bad, z, dt=clock(50))


def test_predict_checks_what_it_is_given() -> None:
    """Plain arrays take a short way in: the answers and the refusals are the same."""
    u, z = series((1, 0), 0, n=50)
    e = ARX(time="routed", k=1, m=0).fit(u, z, dt=clock(50))
    expected = e.predict(u, dt=clock(50))
    for same in (u.tolist(), np.asfortranarray(u), u.astype(object), np.repeat(u, 2, axis=1)[:, ::2]):
        assert np.array_equal(e.predict(same, dt=clock(50)), expected)
    for bad in (np.nan, np.inf, -np.inf):
        broken = u.copy()
        broken[7] = bad
        with pytest.raises(ValueError, match=r"infinity|NaN"):
            e.predict(broken, dt=clock(50))
    with pytest.raises(ValueError, match="2 features"):
        e.predict(np.hstack([u, u]), dt=clock(50))
    with pytest.raises(ValueError, match="0 sample"):
        e.predict(u[:0], dt=[])
    first = clock(50)
    first[0] = 7.0  # a part of a test, whose start was left out
    with pytest.raises(InputError, match=r"first row is 7 s after another row.*leave whole tests out"):
        e.predict(u, dt=first)
    named = ARX(time="routed", k=1, m=0).fit(pd.DataFrame({"n": u[:, 0]}), z, dt=clock(50))
    with pytest.warns(UserWarning, match="feature names"):
        named.predict(u, dt=clock(50))


def test_few_rows_shrink_the_search() -> None:
    u, z = series((1, 0), 0, n=9)
    e = ARX(time="routed").fit(u, z, dt=clock(9))
    assert max(o.k for o in e.orders_) < 5
    assert all(o.n_parameters < o.n_rows for o in e.orders_ if o.admissible)
    with pytest.raises(FitError, match="only 0 time steps"):
        ARX(time="none", k=1, m=0).fit(u, z)  # no row has a past


def test_constant_and_copied_inputs_and_a_dead_probe() -> None:
    u, z = series((1, 0), 0, n=300)
    X = np.hstack([u, u, np.zeros_like(u), np.full_like(u, 20.0)])
    alone = ARX(time="routed", k=1, m=0).fit(u, z, dt=clock(300))
    for e in (
        ARX(time="routed", k=1, m=0),
        ARX(time="routed", k_max=2, m_max=2),
        ARX(time="routed", criterion="free-run", k=1, m=0),
    ):
        e.fit(X, z, dt=clock(300))
        assert np.isfinite(e.b_).all()
        assert e.free_run_rms_ <= alone.free_run_rms_ * 1.05
    dead = ARX(time="routed").fit(u, np.zeros(300), dt=clock(300))
    assert not dead.predict(u, dt=clock(300)).any()
    still = ARX(time="routed", fit_intercept=True).fit(np.zeros_like(u), np.full(300, 5.0), dt=clock(300))
    assert np.isfinite(still.predict(u, dt=clock(300))).all()


def test_orders_of_a_table_that_is_too_short() -> None:
    rng = np.random.default_rng(0)
    tri = triangle(join_columns(rng.normal(size=(3, 4)), rng.normal(size=3)), intercept=False)
    found = orders.compute_orders(tri, 1, range(3), range(2), 1.0)
    assert [o.admissible for o in found if o.n_parameters >= 3] == [False] * 3
    assert orders.best([o for o in found if not o.admissible], "fpe") is None
