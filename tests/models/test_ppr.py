"""`ppr`: projection pursuit regression (T-08)."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from sklearn.utils.estimator_checks import parametrize_with_checks

from thermocomp.core.additive import Additive
from thermocomp.core.exceptions import FitError, InputError
from thermocomp.files import modelfile
from thermocomp.judging import splits
from thermocomp.judging.compare import compare
from thermocomp.models import ppr
from thermocomp.models.method import Method
from thermocomp.models.methods import METHODS
from thermocomp.models.ppr import ProjectionPursuit
from thermocomp.recordings.samples import Samples

FloatArray = NDArray[np.float64]


@parametrize_with_checks([ProjectionPursuit(max_terms=2)])  # type: ignore[untyped-decorator]
def test_contract_of_scikit_learn(estimator: ProjectionPursuit, check: Callable[[ProjectionPursuit], None]) -> None:
    check(estimator)


A, B = np.array([3.0, -1.0, 0.0, 2.0]) / np.sqrt(14), np.array([0.0, 1.0, 1.0, 0.0]) / np.sqrt(2)


def ridges(seed: int = 0, n: int = 600) -> tuple[pd.DataFrame, FloatArray, NDArray[np.intp]]:
    """Two ridge functions of four inputs, one that rises and one that only bends; 0.05 of noise; four cycles."""
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(n, 4))
    y = 3 * np.tanh(X @ A) + (X @ B) ** 2 + 0.05 * rng.normal(size=n)
    return pd.DataFrame(X, columns=["T1", "T2", "T3", "T4"]), y, np.arange(n) * 4 // n


def test_frozen_replay_is_the_prediction() -> None:
    X, y, cycle = ridges()
    X["dead"] = 21.5
    X["speed"] = 3000 * X["T1"] + 2500  # another unit, another zero
    estimator = ProjectionPursuit(max_terms=3).fit(X, y, cycle=cycle)
    model = estimator.freeze(target="dx")
    assert isinstance(model, Additive)
    assert "dead" not in [i.name for i in model.inputs]
    assert len(model.curves) == estimator.n_terms_
    state, found = model.init(), np.empty(len(X))
    for k, row in enumerate(X[[i.name for i in model.inputs]].to_numpy()):
        state, found[k] = model.step(state, row, 10.0)
    np.testing.assert_allclose(found, estimator.predict(X), rtol=0, atol=1e-10)
    (again,) = modelfile.loads(modelfile.dumps([model]))
    assert again == model
    assert "T1" in model.formula()


def test_finds_the_projections() -> None:
    X, y, cycle = ridges(1, 2000)
    estimator = ProjectionPursuit(rule="minimum").fit(X, y, cycle=cycle)
    unit = estimator.directions_ / np.linalg.norm(estimator.directions_, axis=1, keepdims=True)
    for truth in (A, B):
        assert np.abs(unit @ truth).max() > 0.99
    fresh = np.random.default_rng(2).uniform(-1.5, 1.5, size=(500, 4))
    truth = 3 * np.tanh(fresh @ A) + (fresh @ B) ** 2
    assert np.sqrt(np.mean((estimator.predict(pd.DataFrame(fresh, columns=X.columns)) - truth) ** 2)) < 0.15
    assert estimator.r_squared_ > 0.99


def test_finds_what_only_bends() -> None:
    """No input correlates with it, so there is no steepest rise to start from."""
    X = np.random.default_rng(3).normal(size=(800, 6))
    estimator = ProjectionPursuit(max_terms=1, degrees=(6.0,)).fit(X, (X[:, 1] - X[:, 4]) ** 2)
    assert estimator.r_squared_ > 0.98


def test_chosen_by_plain_refits_without_each_cycle() -> None:
    X, y, cycle = ridges(4, 400)
    rms = np.empty((2, 2, 4))
    for i, degrees in enumerate((3.0, 6.0)):
        for j in range(2):
            for k in range(4):
                rows = cycle != k
                found = ppr._path(X[rows].to_numpy(), y[rows], j + 1, degrees)
                assert len(found) == j + 1
                rms[i, j, k] = np.sqrt(np.mean((y - found[j].predict(X.to_numpy()))[~rows] ** 2))
    i, j = np.unravel_index(rms.mean(axis=2).argmin(), (2, 2))
    estimator = ProjectionPursuit(max_terms=2, rule="minimum").fit(X, y, cycle=cycle)
    assert (estimator.degrees_, estimator.n_terms_) == ((3.0, 6.0)[i], j + 1)
    assert estimator.cv_rms_ == pytest.approx(rms.mean(axis=2).min())
    r_squared = 1 - np.sum((y - estimator.predict(X)) ** 2) / np.sum((y - y.mean()) ** 2)
    assert estimator.r_squared_ == pytest.approx(r_squared)
    small = ProjectionPursuit(max_terms=2, rule="minimum").fit(X, 1e-6 * y, cycle=cycle)
    assert small.r_squared_ == pytest.approx(r_squared)
    assert estimator.chosen_by_ == "4 thermal cycles, left out in turn"
    order = np.random.default_rng(0).permutation(len(y))
    other = ProjectionPursuit(max_terms=2, rule="minimum").fit(X.iloc[order], y[order], cycle=cycle[order])
    assert other.predict(X) == pytest.approx(estimator.predict(X), abs=1e-2)


def test_rows_without_a_cycle_are_not_learned_from() -> None:
    X, y, cycle = ridges(5, 200)
    y[cycle == 1] = 1e9
    unseen = ProjectionPursuit().fit(X, y, cycle=np.where(cycle == 1, -1, cycle)).freeze(target="dx")
    without = ProjectionPursuit().fit(X[cycle != 1], y[cycle != 1], cycle=cycle[cycle != 1]).freeze(target="dx")
    assert unseen == without


def test_constant_beyond_the_trained_projection() -> None:
    X = np.linspace(0, 10, 200)[:, None]
    estimator = ProjectionPursuit(max_terms=1).fit(X, 2 * X[:, 0])
    assert estimator.predict([[-5.0], [0.0], [10.0], [25.0]]) == pytest.approx([0.0, 0.0, 20.0, 20.0], abs=1e-2)


def test_nothing_to_explain() -> None:
    X = np.linspace(0, 10, 200)[:, None]
    assert np.isnan(ProjectionPursuit(max_terms=1).fit(X, np.zeros(200)).r_squared_)


# -- smoother: against the same smoother in plain matrices -------------------------------------------------------------


def hats(u: FloatArray) -> FloatArray:
    """Table of the hat functions over evenly spaced knots, one by one."""
    knots = np.linspace(u.min(), u.max(), ppr._KNOTS)
    return np.column_stack([np.interp(u, knots, unit) for unit in np.eye(ppr._KNOTS)])


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 1000), st.integers(30, 200), st.sampled_from([2.5, 4.0, 8.0]), st.booleans())
def test_smoother_is_penalised_least_squares(seed: int, n: int, degrees: float, ties: bool) -> None:
    rng = np.random.default_rng(seed)
    u = np.round(rng.gamma(2.0, size=n), 1) if ties else rng.gamma(2.0, size=n)  # steps of 0.1 degC, empty stretches
    r = np.sin(u) + 0.1 * rng.normal(size=n)
    penalty = ppr._penalty(u, degrees)
    H = hats(u)
    normal = H.T @ H / n + 1e-9 / ppr._KNOTS * np.eye(ppr._KNOTS) + penalty * ppr._BENDING
    hat_matrix = H @ np.linalg.solve(normal, H.T) / n
    found = ppr._smooth(u, r, penalty)
    expected = hat_matrix @ r
    assert found.values == pytest.approx(expected - expected.mean(), abs=1e-6)
    assert np.trace(hat_matrix) == pytest.approx(degrees, abs=0.1)
    assert found.values == pytest.approx(np.interp(u, np.linspace(u.min(), u.max(), ppr._KNOTS), found.knots))


def test_a_straight_line_is_kept() -> None:
    u = np.linspace(-3, 5, 100)
    found = ppr._smooth(u, 2 * u - 2, ppr._penalty(u, 3.0))
    assert found.values == pytest.approx(2 * u - 2, abs=1e-5)
    assert found.slopes == pytest.approx(2.0, abs=1e-5)


# -- bad input, and the whole way --------------------------------------------------------------------------------------


def test_bad_but_possible_input() -> None:
    rng = np.random.default_rng(6)
    a = np.round(rng.normal(size=(80, 1)) * 2, 1)
    X = np.hstack([a, a, np.full((80, 1), 20.0), np.zeros((80, 1)), rng.normal(size=(80, 1))])
    y = np.sin(a[:, 0])
    assert np.abs(ProjectionPursuit(rule="minimum").fit(X, y).predict(X) - y).max() < 0.3
    wide = rng.normal(size=(12, 30))
    assert np.isfinite(ProjectionPursuit().fit(wide, wide[:, 3]).predict(wide)).all()
    flat = ProjectionPursuit().fit(X, np.full(80, 5.0))
    assert (flat.predict(X) == 5.0).all()
    assert flat.n_terms_ == 0
    assert flat.freeze(target="dx").sensors == ()
    assert np.isnan(flat.r_squared_)
    dead = ProjectionPursuit().fit(np.ones((10, 2)), np.arange(10.0))
    assert dead.predict(np.ones((1, 2))) == pytest.approx(4.5)
    for n in (2, 3, 7):  # fewer rows than parameters
        assert np.isfinite(ProjectionPursuit().fit(X[:n], y[:n]).predict(X)).all()


def test_bad_input_is_refused() -> None:
    X, y, _ = ridges(7, 40)
    spoiled = X.copy()
    spoiled.iloc[3, 1] = np.nan
    with pytest.raises(ValueError, match="NaN"):
        ProjectionPursuit().fit(spoiled, y)
    with pytest.raises(ValueError, match="1 sample"):
        ProjectionPursuit().fit(X[:1], y[:1])
    with pytest.raises(FitError, match="only one training row"):
        ProjectionPursuit().fit(X, y, cycle=np.where(np.arange(40) == 5, 0, -1))
    with pytest.raises(InputError, match="max_terms 0: expected at least 1"):
        ProjectionPursuit(max_terms=0).fit(X, y)
    for degrees in ((), (2.0,), (99.0,)):
        with pytest.raises(InputError, match=r"degrees .*: expected degrees of freedom above 2 and below 25"):
            ProjectionPursuit(degrees=degrees).fit(X, y)
    with pytest.raises(InputError, match="rule 'best'"):
        ProjectionPursuit(rule="best").fit(X, y)  # type: ignore[arg-type]


def test_judged_beside_the_others(samples: Samples, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(
        METHODS, "ppr", Method("ppr", "projection pursuit", "thermocomp.models.ppr:ProjectionPursuit", takes=("cycle",))
    )
    result = compare(samples, ["ppr"], splits.parse("0.75/0.25", samples))
    for a in result.overall():
        assert a.failure == ""
        assert a.metric("rms") < 0.5 * a.none_metric("rms")


def test_residual_of_the_comparison(shared_data: Path) -> None:
    """T-08: on measured temperatures it follows the training rows closely, and loses more than that on unseen ones."""
    table = pd.read_csv(shared_data / "fl_thermal" / "recording.csv")[::4]
    X = table.filter(regex=r"^t\d+_C$")
    X = X - X.iloc[0]
    y = table["ch3_um"].to_numpy()
    cycle = np.searchsorted([1951, 3871, 5791, 7711], table.index, side="right")
    cycle[table.index >= 6669] = -1
    estimator = ProjectionPursuit(rule="minimum").fit(X, y, cycle=cycle)
    assert estimator.chosen_by_ == "4 thermal cycles, left out in turn"
    assert estimator.r_squared_ > 0.995
    seen, unseen = cycle >= 0, cycle < 0
    error = y - estimator.predict(X)
    assert np.sqrt(np.mean(error[seen] ** 2)) < 5.0
    assert np.sqrt(np.mean(error[seen] ** 2)) < np.sqrt(np.mean(error[unseen] ** 2)) < np.sqrt(np.mean(y[unseen] ** 2))
