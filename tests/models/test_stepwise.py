"""The stepwise engine against a literal transcription of the papers' equations, and its safeguards."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import stats

from thermocomp.core.exceptions import InputError
from thermocomp.models.numerics.leastsquares import join_columns, triangle
from thermocomp.models.numerics.stepwise import (
    AlphaThresholds,
    FThresholds,
    Rule,
    StepwiseSelection,
    _Tableau,
    alpha_of_f,
    f_of_alpha,
    r_squared_of_f,
    stepwise,
)

FloatArray = NDArray[np.float64]
Threshold = Callable[[int], float]


def run(X: FloatArray, y: FloatArray, rule: Rule, *, intercept: bool = True, **options: object) -> StepwiseSelection:
    names = [f"x{i}" for i in range(X.shape[1])]
    return stepwise(triangle(join_columns(X, y), intercept=intercept), rule, names, **options)  # type: ignore[arg-type]


def sse(X: FloatArray, y: FloatArray, columns: list[int], intercept: bool) -> float:
    design = np.column_stack([np.ones(len(y))] * intercept + [X[:, columns]])
    if design.shape[1] == 0:
        return float(y @ y)
    residual = y - design @ np.linalg.lstsq(design, y)[0]
    return float(residual @ residual)


def transcribed(
    X: FloatArray, y: FloatArray, enter: Threshold, delete: Threshold, intercept: bool
) -> list[tuple[str, int, float]]:
    """T-02 to T-06 word by word: every F from two fits."""
    n, p = X.shape
    inside: list[int] = []
    log: list[tuple[str, int, float]] = []

    def partial_f(k: int, others: list[int]) -> tuple[float, int]:
        df = n - len(others) - 1 - intercept
        with_k = sse(X, y, [*others, k], intercept)
        return (sse(X, y, others, intercept) - with_k) / (with_k / df), df

    while True:
        outside = [k for k in range(p) if k not in inside]
        if not outside or n - len(inside) - 1 - intercept < 1:
            return log
        f, k = max((partial_f(k, inside)[0], k) for k in outside)
        if f < enter(partial_f(k, inside)[1]):
            return log
        inside.append(k)
        log.append(("enter", k, f))
        while True:
            tests = [(*partial_f(k, [j for j in inside if j != k]), k) for k in inside]
            f, df, k = min(tests)
            if f >= delete(df):
                break
            inside.remove(k)
            log.append(("remove", k, f))


@st.composite
def problems(draw: st.DrawFn) -> tuple[FloatArray, FloatArray]:
    """Temperatures that share a few sources, so that they are collinear and terms enter and leave."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n, p, sources = draw(st.integers(8, 60)), draw(st.integers(1, 8)), draw(st.integers(1, 3))
    own = 10.0 ** draw(st.floats(-4, 0))
    hidden = rng.normal(size=(n, sources))
    X = hidden @ rng.normal(size=(sources, p)) + own * rng.normal(size=(n, p)) + draw(st.sampled_from([0.0, 20.0]))
    y = hidden.sum(axis=1) + X @ rng.normal(size=p) * draw(st.floats(0, 1))
    return X, y + draw(st.floats(0.01, 1)) * rng.normal(size=n)


def same(found: StepwiseSelection, expected: list[tuple[str, int, float]]) -> None:
    assert [(s.action, s.index) for s in found.steps] == [(a, k) for a, k, _ in expected]
    # the transcription subtracts two sums of squares, so that its own smallest F have few digits
    np.testing.assert_allclose([s.f for s in found.steps], [f for *_, f in expected], rtol=1e-6, atol=1e-9)
    assert not found.cycled


@given(problems(), st.sampled_from([(100.0, 50.0), (10.0, 10.0), (4.0, 3.0), (2.0, 1.9)]), st.booleans())
@settings(max_examples=250, deadline=None)
def test_f_rule_follows_the_equations(
    problem: tuple[FloatArray, FloatArray], thresholds: tuple[float, float], intercept: bool
) -> None:
    X, y = problem
    enter, delete = thresholds
    expected = transcribed(X, y, lambda _: enter, lambda _: delete, intercept)
    found = run(X, y, FThresholds(enter, delete), intercept=intercept)
    same(found, expected)
    inside: list[int] = []
    r_squared = 0.0
    for number, s in enumerate(found.steps, start=1):
        before, n_before = r_squared, len(inside)
        inside = [*inside, s.index] if s.action == "enter" else [k for k in inside if k != s.index]
        r_squared = 1 - sse(X, y, inside, intercept) / sse(X, y, [], intercept)
        assert (s.number, s.df) == (number, len(y) - intercept - max(n_before, len(inside)))
        assert (s.r_squared, s.r_squared_step) == pytest.approx((r_squared, r_squared - before), abs=1e-9)


@given(problems(), st.sampled_from([(0.001, 0.015), (0.05, 0.1), (0.15, 0.15)]), st.booleans())
@settings(max_examples=250, deadline=None)
def test_alpha_rule_follows_the_equations(
    problem: tuple[FloatArray, FloatArray], alphas: tuple[float, float], intercept: bool
) -> None:
    X, y = problem
    expected = transcribed(
        X, y, lambda df: stats.f.isf(alphas[0], 1, df), lambda df: stats.f.isf(alphas[1], 1, df), intercept
    )
    same(run(X, y, AlphaThresholds(*alphas), intercept=intercept), expected)


def test_a_term_enters_and_leaves(shared_data: Path) -> None:
    # C-17, on Hald's cement: textbooks agree that at alpha .15 x4 enters first and has to go after x1 and x2
    data = pd.read_csv(shared_data / "reference" / "hald_cement.csv")
    found = run(data.filter(like="x").to_numpy(), data["y"].to_numpy(), AlphaThresholds(0.15, 0.15))
    assert [(s.action, s.term) for s in found.steps] == [
        ("enter", "x3"),
        ("enter", "x0"),
        ("enter", "x1"),
        ("remove", "x3"),
    ]
    assert found.selected == (0, 1)
    f = [s.f for s in found.steps]
    np.testing.assert_allclose(f, [22.80, 108.22, 5.03, 1.86], atol=0.005)
    assert found.steps[-1].r_squared == pytest.approx(0.979, abs=5e-4)


def test_log_tells_significance_and_gain() -> None:
    rng = np.random.default_rng(8)
    X = rng.normal(size=(100, 5))
    y = X @ [3, 0, 2, 0, 1] + rng.normal(size=100)
    steps = run(X, y, AlphaThresholds()).steps
    assert [s.number for s in steps] == [1, 2, 3]
    before = 0.0
    for s in steps:
        assert s.alpha == pytest.approx(stats.f.sf(s.f, 1, s.df), rel=1e-9)
        assert s.r_squared_step == pytest.approx(s.r_squared - before)
        assert s.r == pytest.approx(np.sqrt(s.r_squared))
        before = s.r_squared
    total = np.sum((y - y.mean()) ** 2)
    assert before == pytest.approx(1 - sse(X, y, [0, 2, 4], True) / total, rel=1e-12)


def test_r_squared_is_uncentred_without_intercept() -> None:
    # E-C10
    rng = np.random.default_rng(9)
    X = 5 + rng.normal(size=(60, 2))
    y = X[:, 0] + rng.normal(size=60)
    (step, *_) = run(X, y, AlphaThresholds(), intercept=False).steps
    assert step.r_squared == pytest.approx(1 - sse(X, y, [step.index], False) / (y @ y), rel=1e-12)


def test_chens_thresholds_at_810_rows() -> None:
    # C-15
    assert f_of_alpha(0.001, 808) == pytest.approx(10.91, abs=0.005)
    assert f_of_alpha(0.015, 808) == pytest.approx(5.94, abs=0.005)


@given(st.floats(1e-30, 0.999), st.integers(1, 100_000))
def test_f_of_alpha_is_the_quantile(alpha: float, df: int) -> None:
    f = f_of_alpha(alpha, df)
    assert alpha_of_f(f, df) == pytest.approx(alpha, rel=1e-6)
    assert stats.f.sf(f, 1, df) == pytest.approx(alpha, rel=1e-6)


def test_what_fixed_thresholds_mean_depends_on_the_rows() -> None:
    # E-T3
    table_of_the_paper = {13: 0.90, 51: 0.67, 199: 0.34, 386: 0.21, 810: 0.11}
    for n, r_squared in table_of_the_paper.items():
        assert r_squared_of_f(100.0, n - 2) == pytest.approx(r_squared, abs=0.005)
    # and so the engine: the same R2 of .5 enters at 199 rows but not at 51
    for n, enters in ((51, False), (199, True)):
        x = np.tile([1.0, -1.0], n // 2 + 1)[:n]
        x -= x.mean()
        rest = np.random.default_rng(n).normal(size=n)
        rest -= rest.mean() + x * (rest @ x) / (x @ x)
        y = x + rest * np.sqrt((x @ x) / (rest @ rest))
        found = run(x[:, None], y, FThresholds())
        assert bool(found.steps) is enters
        assert r_squared_of_f(n - 2.0, n - 2) == 0.5


@pytest.mark.parametrize("thresholds", [(50.0, 100.0), (1.0, -1.0), (np.nan, 1.0)])
def test_f_to_enter_below_f_to_delete_is_refused(thresholds: tuple[float, float]) -> None:
    # E-T4
    with pytest.raises(InputError, match="endlessly"):
        FThresholds(*thresholds)


@pytest.mark.parametrize("alphas", [(0.05, 0.01), (0.0, 0.1), (0.1, 1.5), (np.nan, 0.1)])
def test_alpha_to_enter_above_alpha_to_remove_is_refused(alphas: tuple[float, float]) -> None:
    with pytest.raises(InputError, match="endlessly"):
        AlphaThresholds(*alphas)


def test_a_term_whose_f_is_the_threshold_stays() -> None:
    """T-06: deleted are terms whose F is below the threshold, as the first one when both of its parts have entered."""
    rng = np.random.default_rng(16)
    parts = rng.normal(size=(300, 2))
    X = np.column_stack([parts.sum(axis=1) + 0.5 * rng.normal(size=300), parts])
    y = parts.sum(axis=1) + 0.3 * rng.normal(size=300)
    found = run(X, y, FThresholds(10.0, 9.0))
    assert [(s.action, s.index) for s in found.steps[:1] + found.steps[-1:]] == [("enter", 0), ("remove", 0)]
    assert run(X, y, FThresholds(10.0, found.steps[-1].f)).selected == (0, 1, 2)
    assert run(X, y, FThresholds(found.steps[0].f, 1.0)).steps[0].index == 0  # enters at the threshold, too


@pytest.mark.parametrize("seed", range(8))
def test_of_equal_candidates_the_first_enters(seed: int) -> None:
    """C-17, T-04: whatever the rounding."""
    a, b = np.random.default_rng(seed).normal(size=(2, 60))
    for copies in ([a, a / 3.0, 0.7 * a], [0.7 * a, a, a / 3.0], [a / 3.0, 0.7 * a, a]):
        assert run(np.column_stack([b, *copies]), a + 0.1 * b, FThresholds()).steps[0].index == 1


def test_whatever_the_threshold_a_degree_of_freedom_is_left() -> None:
    """T-02, T-04: of six columns and five rows three enter, and never one that is zero."""
    X = np.random.default_rng(17).normal(size=(5, 6))
    X[:, 0] = 0.0
    y = np.array([0.0, 1.0, 4.0, 9.0, 20.0])
    found = run(X, y, FThresholds(0.0, 0.0))
    assert len(found.selected) == 3
    assert 0 not in found.selected
    assert [s.df for s in found.steps] == [3, 2, 1]
    assert run(X[:, :1], y, FThresholds(0.0, 0.0)).steps == ()


def test_the_rotated_triangle_is_that_of_the_same_table() -> None:
    """C-17, T-05: its product with itself does not change when columns enter and leave in any order."""
    rng = np.random.default_rng(18)
    work = _Tableau(triangle(join_columns(rng.normal(size=(40, 6)), rng.normal(size=40)), intercept=True), 1e-8)
    product = work._rows.T @ work._rows
    for action, index in [
        *(("enter", k) for k in (4, 1, 5, 0)),
        ("remove", 4),
        ("enter", 2),
        ("remove", 5),
        ("remove", 0),
    ]:
        (work.enter if action == "enter" else work.remove)(index)
        np.testing.assert_allclose(work._rows.T @ work._rows, product, atol=1e-12)
        np.testing.assert_array_equal(np.tril(work._rows[:, work.active], -1), 0.0)
        left = 1 - product[work.active, -1] @ np.linalg.solve(
            product[np.ix_(work.active, work.active)], product[work.active, -1]
        )
        assert work.sse == pytest.approx(left, rel=1e-9)
        assert work.df == 39 - len(work.active)
        np.testing.assert_array_equal(np.flatnonzero(np.isinf(work._now)), sorted(work.active))
    assert work.active == [1, 2]


def test_a_rule_that_goes_round_is_stopped() -> None:
    class Fickle(FThresholds):
        def enter_f(self, df: int) -> float:
            return 5.0

        def delete_f(self, df: int) -> float:
            return 1e9

    rng = np.random.default_rng(10)
    X = rng.normal(size=(50, 2))
    found = run(X, X[:, 0] + rng.normal(size=50), Fickle())
    assert found.cycled
    assert found.selected == ()
    assert len(found.steps) == 2


def test_chooses_by_f_where_p_has_underflowed() -> None:
    rng = np.random.default_rng(11)
    X = rng.normal(size=(20_000, 4))
    y = X @ [1.0, 1.1, 1.3, 1.2] * 100 + rng.normal(size=20_000)
    steps = run(X, y, AlphaThresholds()).steps
    assert steps[0].alpha == steps[1].alpha == 0.0
    assert [s.index for s in steps] == [2, 3, 1, 0]


def test_collinear_candidates_stay_outside() -> None:
    rng = np.random.default_rng(12)
    a, b = rng.normal(size=(2, 80)) + 20
    noise = rng.normal(size=80)
    X = np.column_stack([a, a, np.full(80, 7.0), b, a + b, a * (1 + 1e-12 * noise)])
    y = a + b + 1e-3 * noise
    found = run(X, y, AlphaThresholds())
    assert found.selected == (4,)
    found = run(X[:, :4], y, AlphaThresholds())
    assert found.selected == (0, 3)
    # a tolerance of one half lets nothing enter that shares three quarters of its square with the model
    b = a + 0.3 * noise
    found = run(np.column_stack([a, b]), a + 5 * noise, AlphaThresholds(), tolerance=0.9)
    assert len(found.selected) == 1


def test_an_exact_fit_ends_it() -> None:
    rng = np.random.default_rng(13)
    X = rng.normal(size=(300, 40))
    found = run(X, 2 * X[:, 5] - X[:, 9] + 3, AlphaThresholds(0.05, 0.1))
    assert found.selected == (5, 9)
    assert found.steps[-1].r_squared == 1.0
    assert run(X, np.full(300, 2.5), AlphaThresholds(0.5, 0.5)).steps == ()


def test_a_small_remainder_is_no_exact_fit() -> None:
    """T-04: F decides whatever is left of y, unless it is rounding."""
    X = np.random.default_rng(15).normal(size=(200, 3))
    found = run(X, X[:, 0] + 1e-9 * X[:, 2], FThresholds(100.0, 50.0))
    assert found.selected == (0, 2)


def test_more_candidates_than_rows() -> None:
    rng = np.random.default_rng(14)
    X = rng.normal(size=(20, 60))
    y = 5 * X[:, 7] - 4 * X[:, 50] + 0.1 * rng.normal(size=20)
    found = run(X, y, AlphaThresholds())
    assert {7, 50} <= set(found.selected)
    same(found, transcribed(X, y, AlphaThresholds().enter_f, AlphaThresholds().delete_f, True))
    # even a rule that lets everything in leaves a degree of freedom
    assert len(run(X, y, FThresholds(0.0, 0.0)).selected) <= 18
    assert run(X[:2], y[:2], FThresholds(0.0, 0.0)).selected == ()


def test_factors_first_if_wanted() -> None:
    # C-21: free, the product enters alone; with hierarchy after its factors, which it then holds though they are idle
    rng = np.random.default_rng(15)
    a, b = rng.normal(size=(2, 400)) + 5
    X = np.column_stack([a, b, a * b])
    y = a * b + 0.1 * rng.normal(size=400)
    assert run(X, y, FThresholds()).selected == (2,)
    held = run(X, y, FThresholds(), needs=[frozenset(), frozenset(), frozenset({0, 1})])
    assert [(s.action, s.index) for s in held.steps[:2]] in ([("enter", 0), ("enter", 1)], [("enter", 1), ("enter", 0)])
    assert [(s.action, s.index) for s in held.steps[2:]] == [("enter", 2)]
    assert held.selected == (0, 1, 2)
    left = sse(X, y, [0, 1, 2], True)
    assert (sse(X, y, [1, 2], True) - left) / (left / 396) < 50


def test_long_runs_stay_exact() -> None:
    # many enterings and leavings among 90 collinear terms; the last triangle must still tell the truth
    rng = np.random.default_rng(16)
    # twelve sensors that follow two heat sources, each with its own time constant
    source = np.repeat(rng.uniform(size=(12, 2)), 50, axis=0)
    T = np.zeros((600, 12))
    for k in range(1, 600):
        T[k] = T[k - 1] + (10 * source[k, [0, 1] * 6] - T[k - 1]) / np.geomspace(2, 100, 12)
    T += 0.02 * rng.normal(size=T.shape)
    pairs = [(i, j) for i in range(12) for j in range(i, 12)]
    X = np.column_stack([T, *(T[:, i] * T[:, j] for i, j in pairs)])
    y = T.sum(axis=1) + 0.1 * (T[:, 3] - T[:, 8]) ** 2 + 0.2 * rng.normal(size=600)
    found = run(X, y, AlphaThresholds(0.05, 0.06), intercept=False)
    assert sum(s.action == "remove" for s in found.steps) >= 5
    left = sse(X, y, list(found.selected), False)
    assert found.steps[-1].r_squared == pytest.approx(1 - left / (y @ y), abs=1e-12)
    # all inside hold, and no one outside would: the rule's own words for the end
    df = len(y) - len(found.selected)
    for k in found.selected:
        others = [j for j in found.selected if j != k]
        assert (sse(X, y, others, False) - left) / (left / df) >= f_of_alpha(0.06, df)
    for k in set(range(90)) - set(found.selected):
        more = sse(X, y, [*found.selected, k], False)
        assert (left - more) / (more / (df - 1)) < f_of_alpha(0.05, df - 1)
