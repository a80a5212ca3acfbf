"""ACE: the kernel against its twin, both estimators, freezing, bad input."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import twin_ace
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from sklearn.utils.estimator_checks import parametrize_with_checks

from thermocomp.core.exceptions import InputError
from thermocomp.core.inputs import Input, Support
from thermocomp.files import modelfile
from thermocomp.models.ace import ACE, SampledFunction, TransformRegressor, half_window, nearest
from thermocomp.models.ace_monotone import MonotoneACE
from thermocomp.models.base import ThermalRegressor
from thermocomp.models.ols import LeastSquares
from thermocomp.virtual.datasets import record

FloatArray = NDArray[np.float64]

BOTH = [ACE(), MonotoneACE()]


@parametrize_with_checks([*BOTH, ACE(window_share=0.05, neighbours=5, converged=True, tolerance=1e-3)])  # type: ignore[untyped-decorator]
def test_contract_of_scikit_learn(estimator: ThermalRegressor, check: Callable[[ThermalRegressor], None]) -> None:
    check(estimator)


def bent(seed: int = 0, n: int = 400, noise: float = 0.05) -> tuple[pd.DataFrame, FloatArray]:
    """An additive truth behind a bent response: exp(y / 20) = 1 + T1^2 / 30 + |T2| (W-01)."""
    rng = np.random.default_rng(seed)
    T = pd.DataFrame({"T1": rng.uniform(-8, 12, n), "T2": rng.uniform(-3, 3, n), "dead": np.full(n, 20.0)})
    y = 20 * np.log(1 + T["T1"] ** 2 / 30 + T["T2"].abs())
    return T, np.asarray(y) + noise * rng.normal(size=n)


def kernel_fit(
    T: FloatArray, S: FloatArray, half: int, tolerance: float, max_sweeps: int
) -> tuple[FloatArray, FloatArray, float, FloatArray]:
    from thermocomp.models.kernels import ace as kernel
    from thermocomp.models.kernels import ranks

    order, bounds, groups, start = ranks.rank(np.ascontiguousarray(np.vstack([T.T, S])))
    by_rank, phi_by_rank, psi, errors = kernel.solve(order, bounds, groups, start, half, tolerance, max_sweeps, False)
    theta, phi = np.empty(len(S)), np.empty(T.T.shape)
    theta[order[-1]] = by_rank
    for j in range(T.shape[1]):
        phi[j, order[-1][order[j]]] = phi_by_rank[j]
    return theta, phi, psi, errors


# -- the kernel (W-03, W-04, E-W3, E-W4) -----------------------------------------------------------------------------


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(3, 90), st.integers(1, 5), st.integers(1, 12), st.booleans())
def test_kernel_is_the_paper_literally(seed: int, n: int, p: int, half: int, ties: bool) -> None:
    rng = np.random.default_rng(seed)
    T = np.cumsum(rng.normal(size=(n, p)), axis=0)
    S = T[:, 0] ** 2 / 5 + T[:, -1] + rng.normal(size=n)
    if ties:
        T, S = np.round(T), np.round(S)
    expected = twin_ace.fit(T, S, half, 1e-9, 20) if np.ptp(S) > 0 else None
    theta, phi, psi, errors = kernel_fit(T, S, half, 1e-9, 20)
    if expected is None:
        assert psi == 0
        return
    # a step of the stop rule may hang on the last bit of the errors: compare where both took equally many sweeps
    assert len(errors) == len(expected.errors)
    np.testing.assert_allclose(errors, expected.errors, atol=1e-12)
    np.testing.assert_allclose(theta, expected.theta, atol=1e-12)
    np.testing.assert_allclose(phi, expected.phi, atol=1e-12 * max(1, np.abs(expected.phi).max()))
    assert psi == pytest.approx(expected.psi, abs=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_the_first_variable_that_tells_something_begins(seed: int) -> None:
    """W-03: one that does not change is passed over; where nothing changes there is nothing to transform."""
    rng = np.random.default_rng(seed)
    T = np.cumsum(rng.normal(size=(40, 3)), axis=0)
    S = T[:, 1] ** 2 + T[:, 2]
    T[:, 0] = 7.0
    expected = twin_ace.fit(T, S, 5, 1e-9, 20)
    theta, phi, psi, errors = kernel_fit(T, S, 5, 1e-9, 20)
    np.testing.assert_allclose(errors, expected.errors, atol=1e-12)
    np.testing.assert_allclose(theta, expected.theta, atol=1e-12)
    np.testing.assert_allclose(phi, expected.phi, atol=1e-12)
    assert psi == pytest.approx(expected.psi, abs=1e-12)
    for nothing in (T, np.full((40, 3), 7.0)):
        theta, phi, psi, errors = kernel_fit(nothing, S if nothing is not T else np.full(40, 3.0), 5, 1e-9, 20)
        assert (psi, len(errors)) == (0.0, 0)
        assert not theta.any()
        assert not phi.any()


@pytest.mark.parametrize("n", [2, 5, 63, 64, 300, 9000])
@pytest.mark.parametrize("kind", ["plain", "quantised", "outlier", "constant", "huge"])
def test_ranks_are_those_of_a_stable_sort(n: int, kind: str) -> None:
    from thermocomp.models.kernels import ranks

    rng = np.random.default_rng(n)
    x = {
        "plain": rng.normal(size=n),
        "quantised": np.round(rng.normal(size=n), 1),
        "outlier": np.append(rng.normal(size=n - 1), 1e12),
        "constant": np.full(n, 3.7),
        "huge": rng.choice([-1.0, 1.0], n) * rng.uniform(1e308, 1.7e308, n),
    }[kind]
    S = np.arange(n, dtype=np.float64)
    order, bounds, groups, _ = ranks.rank(np.vstack([x, S]))
    assert order[0].tolist() == np.argsort(x, kind="stable").tolist()
    assert groups[0] == len(np.unique(x))
    assert bounds[0, : groups[0] + 1].tolist() == [*np.searchsorted(np.sort(x), np.unique(x)).tolist(), n]


def test_functions_have_the_stated_moments() -> None:
    # E-W3: norm of theta is 1, all have zero mean; psi does not depend on it
    T, y = bent()
    m = ACE(max_sweeps=50).fit(T, y)
    assert np.mean(m.theta_.y) == pytest.approx(0, abs=1e-12)
    assert np.mean(m.theta_.y**2) == pytest.approx(1, abs=1e-12)
    for phi in m.phi_:
        assert np.mean(phi.y) == pytest.approx(0, abs=1e-12)
        assert (np.diff(phi.x) >= 0).all()
    assert m.psi_ == pytest.approx(abs(np.corrcoef(m.sum_phi_.x, m.sum_phi_.y)[0, 1]), abs=1e-12)


@given(st.floats(0.01, 100), st.floats(-50, 50))
@settings(max_examples=20, deadline=None)
def test_psi_does_not_change_under_invertible_transformations(scale: float, shift: float) -> None:
    # W-02 and Appendix A: everything lives in ranks; only the start knows the values of y
    T, y = bent(1, 120)
    a = ACE(tolerance=1e-8).fit(T, y)
    b = ACE(tolerance=1e-8).fit(scale * T + shift, scale * y - shift)
    c = ACE(tolerance=1e-8).fit(np.exp(T / 5), y)
    assert b.psi_ == pytest.approx(a.psi_, abs=1e-10)
    assert c.psi_ == pytest.approx(a.psi_, abs=1e-12)
    assert np.exp(T["T1"] / 5).nunique() == T["T1"].nunique()


@pytest.mark.long
@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(3, 60), st.integers(1, 4), st.integers(1, 12), st.booleans())
def test_converged_kernel_is_the_limit_of_its_twin(seed: int, n: int, p: int, half: int, ties: bool) -> None:
    from thermocomp.models.kernels import ace as kernel
    from thermocomp.models.kernels import ranks

    half = min(half, max(1, (n - 1) // 4))
    rng = np.random.default_rng(seed)
    T = np.cumsum(rng.normal(size=(n, p)), axis=0)
    S = T[:, 0] + 0.3 * rng.normal(size=n)
    if ties:
        T = np.round(T)
    ranked = ranks.rank(np.ascontiguousarray(np.vstack([T.T, S])))
    one = twin_ace.fit(T, S, half, 0.0, 1, twice=True)  # not accelerated yet
    theta, _, psi, errors = kernel.solve(*ranked, half, 0.0, 1, True)
    np.testing.assert_allclose(theta, one.theta[np.argsort(S)], atol=1e-12)
    assert psi == pytest.approx(one.psi, abs=1e-12)
    assert errors == pytest.approx(one.errors, abs=1e-12)
    _, _, psi, errors = kernel.solve(*ranked, half, 1e-9, 50_000, True)
    again = twin_ace.fit(T, S, half, -1.0, 300, twice=True)
    assert psi >= again.psi - 1e-6
    assert errors[-1] <= again.errors[-1] + 1e-6 if again.errors else psi == 0


@pytest.mark.parametrize("seed", range(6))
def test_sweeps_are_accelerated_as_by_the_twin(seed: int) -> None:
    """W-03: the momentum grows with the sweeps since a change was larger than the one before it."""
    from thermocomp.models.kernels import ace as kernel
    from thermocomp.models.kernels import ranks

    rng = np.random.default_rng(seed)
    T = np.cumsum(rng.normal(size=(50, 3)), axis=0)
    S = T[:, 0] ** 2 / 5 + T[:, 1] + rng.normal(size=50)
    ranked = ranks.rank(np.ascontiguousarray(np.vstack([T.T, S])))
    *_, errors = kernel.solve(*ranked, 4, 0.0, 25, True)
    twin = twin_ace.fit(T, S, 4, -np.inf, 25, twice=True, momentum=0.95)
    assert len(errors) == 25
    np.testing.assert_allclose(errors, twin.errors, rtol=0, atol=1e-9)


def test_correlation_of_the_kernel() -> None:
    """W-02: Pearson's of what has no mean, whatever its size; none with what does not vary."""
    from thermocomp.models.kernels.ace import _correlation

    x, y = np.random.default_rng(0).normal(size=(2, 30))
    x, y = x - x.mean(), y - y.mean()
    for scale in (1.0, -1e-4):
        assert _correlation(scale * x, y) == pytest.approx(abs(np.corrcoef(x, y)[0, 1]), rel=1e-12)
    assert _correlation(np.zeros(30), y) == 0.0


def test_stop_rules() -> None:
    T, y = bent()
    paper = ACE(max_sweeps=2000).fit(T, y)
    assert (np.diff(paper.errors_)[:-1] < 0).all()
    assert np.diff(paper.errors_)[-1] >= 0
    early = ACE(tolerance=0.01).fit(T, y)
    assert len(early.errors_) < len(paper.errors_)
    assert early.psi_ < paper.psi_
    assert len(ACE(max_sweeps=3).fit(T, y).errors_) == 3
    limit = ACE(converged=True, tolerance=1e-7, max_sweeps=5000).fit(T, y)
    assert ACE(converged=True, tolerance=1e-4).fit(T, y).psi_ == pytest.approx(limit.psi_, abs=1e-5)
    assert len(limit.errors_) < 30  # of sweeps that are not accelerated; of those of the opposite sign, 54


@pytest.mark.parametrize("k", [1, 2, 3, 10])
def test_step_curve_is_the_nearest_neighbours(k: int) -> None:
    # W-05
    rng = np.random.default_rng(k)
    x, y = np.sort(rng.normal(size=40)), rng.normal(size=40)
    at = rng.uniform(-4, 4, 500)
    np.testing.assert_allclose(
        nearest(SampledFunction(x, y), k)(at), twin_ace.neighbours(at, x.tolist(), y.tolist(), k)
    )
    tied = np.round(x, 1)
    level = np.array([y[tied == v].mean() for v in tied])
    np.testing.assert_allclose(
        nearest(SampledFunction(tied, y), k)(at), twin_ace.neighbours(at, tied.tolist(), level.tolist(), k), atol=1e-12
    )
    assert nearest(SampledFunction(x, y), 99)(at).tolist() == [y.mean()] * 500


# -- the estimators --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "estimator", [ACE(), ACE(window_share=0.02, neighbours=4), MonotoneACE(smoothing=1e-6)], ids=str
)
def test_additive_truth_is_found(estimator: TransformRegressor) -> None:
    T, y = bent(0, 1500)
    m: TransformRegressor = estimator.fit(T, y)
    assert m.psi_ > 0.99
    unseen, truth = bent(1, 500, noise=0.0)
    assert np.sqrt(np.mean((m.predict(unseen) - truth) ** 2)) < 0.05 * truth.std()
    linear = LeastSquares().fit(T, y)
    assert np.sqrt(np.mean((linear.predict(unseen) - truth) ** 2)) > 0.8 * truth.std()
    for (x, phi), true in zip([(t.x, t.y) for t in m.phi_[:2]], [np.square, np.abs], strict=True):
        assert np.corrcoef(phi, true(x))[0, 1] > 0.99
    assert np.corrcoef(m.theta_.y, np.exp(m.theta_.x / 20))[0, 1] > 0.995
    assert not m.phi_[2].y.any()


def test_number_of_neighbours_makes_little_difference() -> None:
    # W-05: "only slight differences" for k = 1 ... 10
    T, y = bent(2, 800)
    unseen, truth = bent(3, 300, noise=0.0)
    rms = [np.sqrt(np.mean((ACE(neighbours=k).fit(T, y).predict(unseen) - truth) ** 2)) for k in range(1, 11)]
    assert max(rms) < 0.1 * truth.std()
    assert max(rms) - min(rms) < 0.05 * truth.std()


@pytest.mark.parametrize("estimator", BOTH, ids=str)
def test_frozen_replay_is_the_prediction_and_survives_the_file(estimator: TransformRegressor) -> None:
    T, y = bent(4, 250)
    m = estimator.fit(T, y)
    model = m.freeze(target="z")
    assert model.family == "additive"
    assert model.sensors == tuple(i.name for i in model.inputs) == ("T1", "T2")
    assert model.formula() == "theta^-1(phi1(T1) + phi2(T2))"
    text = modelfile.dumps([model])
    (again,) = modelfile.loads(text)
    assert again == model
    assert modelfile.dumps([again]) == text
    state, replayed = again.init(), []
    for row in T[["T1", "T2"]].to_numpy():
        state, deviation = again.step(state, row, 10.0)
        replayed.append(float(deviation))
    np.testing.assert_allclose(replayed, m.predict(T), rtol=0, atol=1e-10)
    _, together = model.step(model.init(), T[["T1", "T2"]].to_numpy(), 0.0)
    assert together.tolist() == replayed


def test_peaks_outside_the_range_are_cropped_and_flagged() -> None:
    # W-07
    T, y = bent(5, 300)
    m = ACE().fit(T, y)
    peak = pd.DataFrame({"T1": [100.0, 12.0, -50.0], "T2": [0.0, 0.0, 50.0], "dead": 20.0})
    edge = peak.clip(m.data_min_, m.data_max_, axis=1)
    assert m.predict(peak).tolist() == m.predict(edge).tolist()
    assert m.outside(peak).tolist() == [[True, False, False], [True, False, False], [True, True, False]]
    assert not m.outside(edge).any()
    inputs = [
        Input(n, "temperature", "degC", 0.0, False, float(a), float(b))
        for n, a, b in zip(T.columns, m.data_min_, m.data_max_, strict=True)
    ]
    model = m.freeze(target="z", inputs=inputs, support=Support(margin=0.0))
    state, deviation = model.step(model.init(), peak[["T1", "T2"]].to_numpy(), 0.0)
    assert state.outside.tolist() == m.outside(peak)[:, :2].tolist()
    assert deviation.tolist() == m.predict(edge).tolist()


def test_monotone_goes_on_straight_and_then_stops() -> None:
    x = np.linspace(0, 10, 200)[:, None]
    m = MonotoneACE(extend=0.2).fit(x, 3 * x[:, 0])
    at = np.array([[-1.0], [11.0], [12.0], [13.0], [99.0]])
    np.testing.assert_allclose(m.predict(at), [-3, 33, 36, 36, 36], rtol=1e-2)
    assert m.predict(at)[2] == m.predict(at)[4]
    cropped = MonotoneACE(extend=0.0).fit(x, 3 * x[:, 0])
    np.testing.assert_allclose(cropped.predict(at), [0, 30, 30, 30, 30], atol=0.2)


def test_theta_that_is_not_monotone_is_told_and_cured() -> None:
    # E-W5
    T, y = bent(6, 300, noise=2.0)
    assert 0 < ACE().fit(T, y).falling_theta_ < 1
    tied = ACE().fit(T, np.round(4 * y) / 4)
    distinct, first = np.unique(tied.theta_.x, return_index=True)
    assert len(distinct) < len(y)
    assert tied.falling_theta_ == np.mean(np.diff(tied.theta_.y[first]) < 0) > 0
    still = ACE().fit(T, np.full(len(y), 7.0))  # nothing rises or falls, and nothing is needed to predict it
    assert (still.falling_theta_, still.psi_, still.freeze(target="z").inputs) == (0.0, 0.0, ())
    m = MonotoneACE().fit(T, y)
    assert m.falling_theta_ == 0
    assert (np.diff(m.theta_.y) >= 0).all()
    # what goes through theta comes back
    inverse = m.freeze(target="z").response  # type: ignore[attr-defined]
    assert (np.diff(inverse.x) > 0).all()
    assert (np.diff(inverse.y) > 0).all()
    np.testing.assert_allclose(inverse(m.theta_.y), m.theta_.x, atol=0.05 * y.std())


def test_monotone_converges() -> None:
    T, y = bent(7, 500)
    m = MonotoneACE().fit(T, y)
    assert len(m.errors_) < 200
    assert MonotoneACE(tolerance=1e-9, max_sweeps=5000).fit(T, y).psi_ == pytest.approx(m.psi_, abs=1e-6)


def test_unseen_tests_of_the_virtual_machine() -> None:
    # W-06: three temperatures, 199 rows a test; fitted to the first, judged on the second
    first, second = record("wessel-fem")
    names = [c.name for c in first.temperatures]
    T, unseen = (r.table[names] - r.table[names].iloc[0] for r in (first, second))
    y, truth = first.table["s4_um"].to_numpy(), second.table["s4_um"].to_numpy()
    assert T.shape == (199, 3)

    def rms(m: Any) -> float:
        return float(np.sqrt(np.mean((m.fit(T, y).predict(unseen) - truth) ** 2)))

    assert ACE().fit(T, y).psi_ > 0.99
    # the test goes beyond what was learned: the monotone curves continue, the paper's are cropped (W-07)
    assert rms(MonotoneACE()) < 0.6 * rms(ACE())
    assert rms(MonotoneACE()) < 0.03 * np.ptp(truth)
    assert rms(ACE()) < 0.3 * np.sqrt(np.mean(truth**2))


def test_psi_beside_acepack(shared_data: Path) -> None:
    # acepack's R2 on these 330 rows is 0.832, with a smoother of its own that is wider than ten ranks: psi^2 grows from
    # 0.80 to 0.89 as the window shrinks from 66 ranks on either side to 10. At 40 it must be acepack's, +- 0.01.
    ours = pd.read_csv(shared_data / "reference" / "ozone1_breiman_friedman.csv")
    theirs = pd.read_csv(shared_data / "reference" / "ace_ozone1_acepack_output.csv")
    target = next(c for c in ours if np.array_equal(ours[c], theirs["y"]))
    X, y = ours.drop(columns=target), ours[target]
    m = ACE(half_window=40, tolerance=0.01).fit(X, y)
    assert m.psi_**2 == pytest.approx(0.832, abs=0.01)
    assert ACE(tolerance=0.01).fit(X, y).psi_ > m.psi_ > ACE(half_window=66, tolerance=0.01).fit(X, y).psi_
    assert MonotoneACE().fit(X, y).psi_ ** 2 == pytest.approx(0.832, abs=0.02)
    both = np.corrcoef(np.interp(theirs["y"], m.theta_.x, m.theta_.y), theirs["ty"])[0, 1]
    assert both > 0.985


@pytest.mark.parametrize("estimator", BOTH, ids=str)
def test_measured_series_stay_finite(estimator: TransformRegressor, shared_data: Path) -> None:
    data = pd.read_csv(shared_data / "fl_thermal" / "recording.csv")
    T = data.filter(regex=r"^t\d+_C$").iloc[::4]  # 16 near-duplicates in steps of 0.1 degC
    m = estimator.fit(T, data["ch3_um"].iloc[::4])
    assert np.isfinite(m.predict(T)).all()
    assert m.psi_ > 0.98


# -- bad input -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("estimator", BOTH, ids=str)
def test_bad_but_possible_input(estimator: TransformRegressor) -> None:
    rng = np.random.default_rng(8)
    a = rng.normal(size=(60, 1))
    X = np.hstack([a, a, np.full((60, 1), 20.0), np.round(a, 1), a + 1e-13])
    y = 4 * a[:, 0] + 0.01 * rng.normal(size=60)
    m = estimator.fit(X, y)  # duplicates, a constant, ties
    assert np.abs(m.predict(X) - y)[np.abs(y) < 4].max() < 3
    wide = rng.normal(size=(12, 30))  # more inputs than rows, fewer rows than the boxcar
    assert np.isfinite(estimator.fit(wide, wide[:, 3] * 5).predict(wide)).all()
    constant = estimator.fit(X, np.full(60, 5.0))
    assert constant.psi_ == 0
    assert constant.predict(X).tolist() == [5.0] * 60
    model = constant.freeze(target="z")
    assert model.sensors == ()
    nothing = estimator.fit(np.full((60, 2), 3.0), y)
    assert nothing.psi_ == 0
    np.testing.assert_allclose(nothing.predict(X[:5, :2]), y.mean())
    two = estimator.fit([[1.0], [2.0]], [0.0, 1.0])
    assert np.isfinite(two.predict([[1.5]])).all()
    with pytest.raises(ValueError, match="NaN"):
        estimator.fit(np.where(X > 1, np.nan, X), y)
    with pytest.raises(ValueError, match="1 sample"):
        estimator.fit(X[:1], y[:1])


def test_long_recordings_are_averaged() -> None:
    T, y = bent(9, 3000)
    order = np.argsort(T["T1"].to_numpy())
    m = MonotoneACE(max_rows=1100).fit(T.iloc[order], y[order])
    assert len(m.theta_.x) == 1000
    assert m.data_max_.tolist() == T.max().tolist()


def test_half_window() -> None:
    # E-W8
    assert [half_window(n, 10, None) for n in (199, 41, 40, 9, 3)] == [10, 10, 9, 2, 1]
    assert half_window(10_000, 10, 0.05) == 500
    assert ACE(window_share=0.05).fit(*bent()).half_window_ == 20


@pytest.mark.parametrize(
    ("estimator", "message"),
    [
        (ACE(half_window=0), "half_window 0: expected at least 1"),
        (ACE(window_share=0.4), "window_share 0.4: expected more than 0 and at most 0.25"),
        (ACE(neighbours=0), "neighbours >= 1"),
        (ACE(tolerance=float("nan")), "tolerance >= 0"),
        (MonotoneACE(points=2), "points >= 3"),
        (MonotoneACE(smoothing=0), "smoothing > 0"),
    ],
    ids=str,
)
def test_bad_settings_are_refused(estimator: TransformRegressor, message: str) -> None:
    with pytest.raises(InputError, match=message):
        estimator.fit(*bent())


def test_the_estimator_smooths_over_2n_plus_1_ranks() -> None:
    T, y = bent(n=60)
    X = T.to_numpy()[:, :2]
    m = ACE(half_window=10, max_sweeps=4).fit(X, y)
    theta, _, psi, errors = kernel_fit(X, y, 10, 0.0, 4)
    np.testing.assert_allclose(m.theta_.y, theta[np.argsort(y)], atol=1e-12)
    np.testing.assert_allclose(m.errors_, errors)
    assert m.psi_ == pytest.approx(psi)
