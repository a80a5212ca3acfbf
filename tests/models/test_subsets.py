"""Best subset regression: right sets against every set by itself and against R's leaps, honest certificates."""

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import twin_subsets
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from sklearn.utils.estimator_checks import parametrize_with_checks

from thermocomp.core.exceptions import FitError, InputError
from thermocomp.files import modelfile
from thermocomp.models.selection import subsetsearch
from thermocomp.models.selection.subsetrun import Route
from thermocomp.models.selection.subsets import best_subsets
from thermocomp.models.subsets import BestSubset, scores

FloatArray = NDArray[np.float64]

ROUTES: tuple[Route, ...] = ("dropping", "adding")


@parametrize_with_checks([BestSubset(), BestSubset(criterion="cycles", fit_intercept=False)])  # type: ignore[untyped-decorator]
def test_contract_of_scikit_learn(estimator: BestSubset, check: Callable[[BestSubset], None]) -> None:
    check(estimator)


def chain(n: int, p: int, seed: int) -> tuple[FloatArray, FloatArray]:
    """Temperatures along a rod heated at one end, quantised, and the drift of some of them."""
    rng = np.random.default_rng(seed)
    heat = np.repeat(rng.uniform(0, 1, n // 20 + 1), 20)[:n]
    T = np.zeros((n, p))
    for k in range(1, n):
        before = np.concatenate(([T[k - 1, 0] + heat[k]], T[k - 1], [0.0]))
        T[k] = T[k - 1] + 0.3 * (before[:-2] - 2 * before[1:-1] + before[2:]) - 0.01 * T[k - 1]
    T = np.round(10 * (T + 0.02 * rng.normal(size=T.shape)), 1)
    return T, T[:, ::2] @ rng.uniform(0.5, 2, (p + 1) // 2) + 0.5 * rng.normal(size=n)


@given(seed=st.integers(0, 10_000), p=st.integers(1, 6), intercept=st.booleans(), kind=st.integers(0, 4))
@settings(max_examples=60, deadline=None)
def test_both_routes_find_the_best_of_every_size(seed: int, p: int, intercept: bool, kind: int) -> None:
    rng = np.random.default_rng(seed)
    X, y = chain(60, p, seed)
    if kind == 1:
        X, y = rng.normal(size=(p + 4, p)), rng.normal(size=p + 4)
    elif kind == 2 and p > 1:  # nearly the same, and their difference matters or not
        width = 10.0 ** rng.uniform(-9, -2)
        X[:, 0] = X[:, 1] + width * rng.normal(size=60)
        y = y + (seed % 2) * (X[:, 0] - X[:, 1]) / width
    elif kind == 3:  # scales far apart, a nearly perfect fit
        X *= 10.0 ** rng.uniform(-5, 5, size=p)
        y = X @ rng.normal(size=p) + 10.0 ** rng.uniform(-6, 0) * rng.normal(size=60)
    elif kind == 4:  # far from zero
        X += 10.0 ** rng.uniform(2, 5)
        y = y + 1e4
    every = twin_subsets.every_set(X, y, p, intercept)
    for route in ROUTES:
        found = best_subsets(X, y, intercept=intercept, n_best=3, route=route)
        assert found.left_out == ()
        for truth, ranked in zip(every, found.ranked, strict=True):
            assert len(ranked) == min(3, len(truth))
            for (rss, columns), subset in zip(truth, ranked, strict=False):
                assert subset.columns == columns or not subset.proven
                assert subset.rss == pytest.approx(rss, rel=1e-4 if kind in {2, 3} else 1e-9)
                assert subset.bound <= subset.rss
        assert found.proven or kind in {2, 3}


@pytest.mark.parametrize("route", ROUTES)
def test_many_of_every_size(route: Route) -> None:
    # one column matters most: the 18th best of 5 has done without it and is worse than the 18th best of 4
    rng = np.random.default_rng(1)
    X = rng.normal(size=(40, 7))
    y = X @ [30.0, 1, 1, 1, 1, 1, 1] + rng.normal(size=40)
    every = twin_subsets.every_set(X, y, 7)
    assert every[4][17][0] > 10 * every[3][17][0]
    found = best_subsets(X, y, n_best=18, route=route)
    for truth, ranked in zip(every, found.ranked, strict=True):
        assert [s.columns for s in ranked] == [c for _, c in truth[:18]]
        assert all(s.proven for s in ranked)


@pytest.mark.parametrize("condition", [1e7, 1e9])
@pytest.mark.parametrize("route", ROUTES)
def test_nearly_the_same_channels(condition: float, route: Route) -> None:
    # where updates of the inverse of X'X name a wrong set
    proven = 0
    for seed in range(4):
        rng = np.random.default_rng(seed)
        X, y = chain(80, 8, seed)
        X[:, 5] = X[:, 2] + X[:, 2].std() / condition * rng.normal(size=80)
        if seed % 2:
            y = y + 0.5 * condition * (X[:, 5] - X[:, 2]) / X[:, 2].std()
        scaled = (X - X.mean(axis=0)) / X.std(axis=0)
        assert np.linalg.cond(scaled) > condition / 2
        every = twin_subsets.every_set(X, y, 8)
        found = best_subsets(X, y, route=route)
        for truth, subset in zip(every, found.best, strict=True):
            assert subset.rss == pytest.approx(truth[0][0], rel=1e-6)
            assert subset.columns == truth[0][1] or not subset.proven
            proven += subset.proven
    assert proven >= 28  # of 32: it does not take refuge in "not proven"


@pytest.mark.parametrize("route", ROUTES)
def test_nearly_the_same_channels_and_a_nearly_perfect_fit(route: Route) -> None:
    # what leaves costs 1e-11 beside pairs of condition 1e9: the inverse of the triangle must be good row by row
    proven = 0
    for seed in range(8):
        rng = np.random.default_rng(seed)
        X = rng.normal(size=(60, 8))
        X[:, 1] = X[:, 0] + 3e-10 * rng.normal(size=60)
        X[:, 3] = X[:, 2] + 1e-8 * rng.normal(size=60)
        y = X[:, 4:6] @ [3.0, -2.0] + 1e-5 * rng.normal(size=60)
        every = twin_subsets.every_set(X, y, 8)
        found = best_subsets(X, y, route=route)
        for truth, subset in zip(every, found.best, strict=True):
            assert subset.rss == pytest.approx(truth[0][0], rel=1e-5)
            assert subset.columns == truth[0][1] or not subset.proven
            proven += subset.proven
    assert proven >= 32  # of 64: which one of a pair it takes makes no difference


@pytest.mark.parametrize("route", ROUTES)
def test_three_nearly_the_same_channels(route: Route) -> None:
    X, y = chain(40, 4, 2)
    X[:, 1:3] = X[:, [0]] + 1e-9 * np.random.default_rng(3).normal(size=(40, 2))
    found = best_subsets(X, y, route=route)
    every = twin_subsets.every_set(X, y, 4)
    assert [s.rss for s in found.best] == pytest.approx([t[0][0] for t in every], rel=1e-6)
    assert all(s.columns == t[0][1] or not s.proven for s, t in zip(found.best, every, strict=True))
    alone = best_subsets(X[:, :3], y, route=route)
    assert alone.best[2].columns == (0, 1, 2)


def test_what_rounding_cannot_tell_is_not_proven() -> None:
    X, y = chain(80, 6, 1)
    X[:, 4] = X[:, 1] * (1 + 1e-13 * np.random.default_rng(0).normal(size=80))
    X[:, 4] += 3e-11 * X[:, 0]
    found = best_subsets(X, y)
    with_one = [s for s in found.best if (1 in s.columns) != (4 in s.columns)]
    assert found.left_out == ()
    assert with_one
    assert not any(s.proven for s in with_one)
    assert all(s.bound <= s.rss for s in found.best)
    symmetric = np.vstack([np.eye(4), -np.eye(4)])
    tied = best_subsets(symmetric, symmetric.sum(axis=1), n_best=2)
    assert [s.proven for s in tied.best] == [False, False, False, True]


@pytest.mark.parametrize("name", ["hald", "swiss", "longley", "attitude", "ozone1", "mtcars"])
def test_agrees_with_leaps(shared_data: Path, name: str) -> None:
    files = {"hald": "hald_cement", "longley": "longley_R", "ozone1": "ozone1_breiman_friedman"}
    responses = {
        "hald": "y",
        "swiss": "Fertility",
        "longley": "Employed",
        "attitude": "rating",
        "ozone1": "O3",
        "mtcars": "mpg",
    }
    folder = shared_data / "reference"
    table = pd.read_csv(folder / f"{files.get(name, name)}.csv")
    want = pd.read_csv(folder / "leaps_exhaustive_reference.csv").query("dataset == @name")
    X = table.drop(columns=responses[name])
    y = table[responses[name]].to_numpy(dtype=float)
    for route in ROUTES:
        found = best_subsets(X.to_numpy(dtype=float), y, route=route)
        assert found.proven
        assert ["+".join(X.columns[[*s.columns]]) for s in found.best] == want["vars"].tolist()
        np.testing.assert_allclose([s.rss for s in found.best], want["rss"], rtol=1e-11)
        ours = scores(found)
        np.testing.assert_allclose(1 - np.array([s.rss for s in found.best]) / found.total, want["rsq"], rtol=1e-12)
        for mine, theirs in (("adjr2", "adjr2"), ("cp", "cp"), ("bic", "bic")):
            np.testing.assert_allclose(ours[mine], want[theirs], rtol=1e-9, atol=1e-9)


def test_mean_square_error_is_that_of_the_paper() -> None:
    # H-05: SSE / (n - p - 1)
    X, y = chain(50, 5, 3)
    found = best_subsets(X, y)
    want = [s.rss / (50 - len(s.columns) - 1) for s in found.best]
    np.testing.assert_allclose(scores(found)["mse"], want, rtol=1e-13)
    best = BestSubset(criterion="mse").fit(X, y)
    assert len(best.selected_) == np.argmin(want) + 1
    assert BestSubset(criterion="adjr2").fit(X, y).selected_ == best.selected_


@pytest.mark.parametrize("route", ROUTES)
def test_two_threads_and_chunks_find_the_same(route: Route, monkeypatch: pytest.MonkeyPatch) -> None:
    X, y = chain(200, 16, 5)
    alone = best_subsets(X, y, n_best=2, route=route)
    assert best_subsets(X, y, n_best=2, route=route, jobs=2).ranked == alone.ranked
    monkeypatch.setattr(subsetsearch.Dropping, "chunk", 7)
    monkeypatch.setattr(subsetsearch.Adding, "chunk", 999)
    again = best_subsets(X, y, n_best=2, route=route)
    assert again.ranked == alone.ranked
    assert again.nodes == alone.nodes <= alone.possible
    assert alone.possible == 2**16 - 1


@pytest.mark.parametrize("route", ROUTES)
def test_a_budget_leaves_true_bounds(route: Route) -> None:
    X, y = chain(200, 14, 6)
    truth = best_subsets(X, y).best
    for nodes in (3, 30, 100):
        some = best_subsets(X, y, nodes=nodes, route=route)
        assert some.stopped == "nodes"
        for subset in some.best:
            best = truth[len(subset.columns) - 1]
            assert subset.bound <= best.rss * (1 + 1e-9)
            assert best.rss <= subset.rss * (1 + 1e-9)
            assert subset.columns == best.columns or not subset.proven
    # the large sizes are settled early
    early = best_subsets(X, y, nodes=100, route="dropping")
    assert early.best[-2].proven
    assert not early.proven
    assert best_subsets(X, y, seconds=1e-9, nodes=None, route="dropping").stopped in {"", "seconds"}


def test_it_can_be_interrupted_and_tells_how_far_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    X, y = chain(200, 14, 6)
    monkeypatch.setattr(subsetsearch.Dropping, "chunk", 20)
    heard: list[str] = []

    def stop(message: str) -> None:
        heard.append(message)
        raise KeyboardInterrupt

    ticks = iter(np.arange(0, 1e6, 2.0).tolist())
    monkeypatch.setattr("time.monotonic", lambda: next(ticks))
    found = best_subsets(X, y, progress=stop, route="dropping")
    assert found.stopped == "interrupted"
    assert len(heard) == 1
    assert heard[0].startswith("best subsets: 20 sets examined in")
    assert len(found.best) == 14
    assert not found.proven
    kept = BestSubset(criterion="cycles", progress=stop).fit(X, y)
    assert (kept.criterion_, kept.chosen_by_, kept.subsets_.stopped) == ("bic", "", "interrupted")
    assert len(heard) == 2  # stopped once is stopped: no search for each cycle after that


def test_constant_and_copied_columns_are_left_out() -> None:
    X, y = chain(60, 4, 7)
    wide = np.column_stack([np.full(60, 20.0), X[:, 0], X, 3 - 2 * X[:, 2], np.zeros(60)])
    found = best_subsets(wide, y)
    assert found.left_out == (0, 2, 6, 7)
    assert found.rank == 4
    assert [s.rss for s in found.best] == pytest.approx([s.rss for s in best_subsets(X, y).best], rel=1e-10)
    with pytest.raises(FitError, match="every column is constant"):
        best_subsets(wide[:, [0, 7]], y)
    m = BestSubset().fit(wide[:, [0, 7]], y)
    assert (m.selected_, m.criterion_) == ((), "none")
    np.testing.assert_allclose(m.predict(wide[:, [0, 7]]), y.mean())


def test_dependent_columns_are_searched_by_adding() -> None:
    X, y = chain(40, 5, 8)
    X = np.column_stack([X, X[:, 0] + X[:, 1], X[:, 1] - X[:, 2]])
    found = best_subsets(X, y)
    every = twin_subsets.every_set(X, y, 5)
    assert (found.route, found.rank, found.left_out) == ("adding", 5, ())
    assert [s.columns for s in found.best][:4] == [t[0][1] for t in every][:4]
    assert not found.best[4].proven  # several sets span the same: all columns
    rng = np.random.default_rng(0)
    wide, drift = rng.normal(size=(9, 14)), rng.normal(size=9)
    few = best_subsets(wide, drift, max_size=4)
    assert [s.columns for s in few.best] == [t[0][1] for t in twin_subsets.every_set(wide, drift, 4)]
    assert few.proven
    assert len(best_subsets(wide, drift).best) == 8
    with pytest.raises(
        InputError, match=r"60 columns of rank 29 .* so the search cannot start from all of them; give a small max_size"
    ):
        best_subsets(rng.normal(size=(30, 60)), rng.normal(size=30))


def drift(seed: int = 0) -> tuple[pd.DataFrame, FloatArray, NDArray[np.int64]]:
    X, y = chain(400, 8, seed)
    slow = np.cumsum(np.random.default_rng(seed).normal(size=400)) * 0.3
    return pd.DataFrame(X, columns=[f"T{i}" for i in range(8)]), y + slow, np.arange(400) // 80


def test_cycles_left_out_are_unseen_by_the_search() -> None:
    X, y, cycle = drift()
    m = BestSubset().fit(X, y, cycle=cycle)
    assert m.criterion_ == "cycles"
    assert m.chosen_by_ == "5 thermal cycles, left out in turn"
    change = X.to_numpy()
    squares = np.zeros(8)
    for k in range(5):
        out = cycle == k
        for size, sets in enumerate(twin_subsets.every_set(change[~out], y[~out], 8)):
            A = np.column_stack([np.ones(320), change[~out][:, sets[0][1]]])
            b = np.linalg.lstsq(A, y[~out])[0]
            missed = y[out] - b[0] - change[out][:, sets[0][1]] @ b[1:]
            squares[size] += missed @ missed
    np.testing.assert_allclose(m.scores_["cycles"], np.sqrt(squares / 400), rtol=1e-9)
    assert len(m.selected_) == np.argmin(squares) + 1
    assert m.proven_
    sparing = BestSubset(rule="one-standard-error").fit(X, y, cycle=cycle)
    assert len(sparing.selected_) <= len(m.selected_)
    assert BestSubset().fit(X, y).criterion_ == "bic"


def test_rows_outside_the_cycles_are_not_learned_from() -> None:
    X, y, cycle = drift()
    cycle[:80] = -1
    m = BestSubset(size=3).fit(X, y, cycle=cycle)
    same = BestSubset(size=3).fit(X[80:], y[80:])
    assert m.selected_ == same.selected_
    np.testing.assert_array_equal(m.coef_, same.coef_)
    np.testing.assert_array_equal(m.data_max_, X[80:].max())
    assert len(m.selected_) == 3
    assert m.criterion_ == "size"
    assert BestSubset(size=99).fit(X, y).selected_ == tuple(range(8))


def test_correlated_rows_make_bic_take_too_many() -> None:
    # E-C12
    X, y, _ = drift(1)
    m = BestSubset(criterion="bic").fit(X, y)
    assert m.n_effective_ < 0.2 * len(y)
    n, effective = len(y), m.n_effective_
    rss = np.array([s.rss for s in m.subsets_.best])
    honest = effective * np.log(rss / m.subsets_.total) + np.arange(2, 10) * np.log(effective)
    assert len(m.selected_) == np.argmin(n * np.log(rss / m.subsets_.total) + np.arange(2, 10) * np.log(n)) + 1
    assert len(m.selected_) > np.argmin(honest) + 1


def test_frozen_replay_is_the_prediction() -> None:
    X, y, cycle = drift()
    m = BestSubset(size=3).fit(X, y, cycle=cycle)
    model = m.freeze(target="dz")
    assert model.sensors == tuple(f"T{k}" for k in m.selected_)
    state, replayed = model.init(), np.empty(len(X))
    for k, row in enumerate(X[list(model.sensors)].to_numpy()):
        state, replayed[k] = model.step(state, row, 10.0)
    np.testing.assert_allclose(replayed, m.predict(X), rtol=1e-12, atol=1e-10)
    assert modelfile.loads(modelfile.dumps([model])) == (model,)


def test_odd_data() -> None:
    X, _ = chain(60, 5, 9)
    constant = BestSubset().fit(X, np.full(60, 5.0))
    np.testing.assert_allclose(constant.predict(X), 5.0)
    exact = BestSubset(size=2).fit(X, 2 * X[:, 1] - 3 * X[:, 4])
    assert exact.selected_ == (1, 4)
    np.testing.assert_allclose(exact.predict(X), 2 * X[:, 1] - 3 * X[:, 4], atol=1e-9)
    short = BestSubset(criterion="mse").fit(X[:4], np.array([1.0, 2.0, 4.0, 3.0]))
    assert np.isfinite(short.predict(X)).all()
    X[3, 1] = np.nan
    with pytest.raises(ValueError, match="NaN"):
        BestSubset().fit(X, np.arange(60.0))


def test_bad_settings_are_refused() -> None:
    X, y = chain(60, 5, 9)
    with pytest.raises(InputError, match="criterion 'aic'"):
        BestSubset(criterion="aic").fit(X, y)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="size 0"):
        BestSubset(size=0).fit(X, y)
    with pytest.raises(InputError, match="jobs 0"):
        BestSubset(jobs=0).fit(X, y)
    with pytest.raises(InputError, match="max_size 0"):
        best_subsets(X, y, max_size=0)


def test_sums_fall_with_the_size() -> None:
    X, y = chain(500, 20, 10)
    found = best_subsets(X, y)
    assert found.proven
    assert found.nodes < 0.1 * found.possible
    assert all(a.rss > b.rss for a, b in pairwise(found.best))
