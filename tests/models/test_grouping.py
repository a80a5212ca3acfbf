"""Correlation grouping against a literal transcription of the paper (H-01 to H-08, H-10, H-14 to H-17)."""

from itertools import pairwise

import numpy as np
import pytest
import twin_grouping as twin
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from thermocomp.core.exceptions import FitError, InputError
from thermocomp.models.grouping import CorrelationGrouping
from thermocomp.models.numerics.leastsquares import Triangle, join_columns, lstsq, triangle
from thermocomp.models.selection import exhaustive, grouping
from thermocomp.models.selection.collinearity import contributions, correlation, spectrum

FloatArray = NDArray[np.float64]

#: Table 1, the sensors counted from 0
TABLE_1 = ((6,), (8, 9, 10, 11), (12,), (7, 3), (4,), (1,), (0, 5), (2,))


def tri(X: FloatArray, y: FloatArray, intercept: bool = True) -> Triangle:
    return triangle(join_columns(X, y), intercept=intercept)


def warm(rng: np.random.Generator, n: int, p: int, sources: int, own: float) -> tuple[FloatArray, FloatArray]:
    """Temperatures that share a few sources, and an error of them."""
    hidden = np.cumsum(rng.normal(size=(n, sources)), axis=0)
    mixing = rng.uniform(0.2, 1, size=(sources, p)) * (rng.random((sources, p)) < 0.7)
    X = hidden @ mixing + own * rng.normal(size=(n, p))
    return X, 5 * X @ rng.normal(size=p) + rng.normal(size=n)


# -- groups ------------------------------------------------------------------------------------------------------------


@st.composite
def correlations(draw: st.DrawFn) -> FloatArray:
    """Correlation matrices; half of them coarse, so that there are ties."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    p, sources = draw(st.integers(1, 14)), draw(st.integers(1, 4))
    X = rng.normal(size=(30, sources)) @ rng.normal(size=(sources, p)) + draw(st.floats(0.01, 1)) * rng.normal(
        size=(30, p)
    )
    return np.round(correlation(X), draw(st.sampled_from([1, 12])))


@given(correlations(), st.floats(-1, 1), st.booleans())
@settings(max_examples=300, deadline=None)
def test_groups_follow_the_paper(C: FloatArray, threshold: float, absolute: bool) -> None:
    # H-03, E-H2, E-H3
    found = grouping.group(C, threshold, absolute=absolute)
    assert [list(g) for g in found] == twin.grouped(C, threshold, absolute)
    assert sorted(k for g in found for k in g) == list(range(len(C)))
    assert absolute or found == grouping.group(C, threshold)
    for seed, *others in found:
        assert all((abs(C[seed, k]) if absolute else C[seed, k]) > threshold for k in others)


@given(correlations(), st.booleans())
@settings(max_examples=60, deadline=None)
def test_intervals_are_exact_and_without_gaps(C: FloatArray, absolute: bool) -> None:
    # E-H1
    found = grouping.intervals(C, absolute=absolute)
    assert (found[0].low, found[-1].high) == (0.0 if absolute else -1.0, 1.0)
    for before, after in pairwise(found):
        assert before.high == after.low
        assert before.groups != after.groups
    for i in found:
        just_below = 1.0 if i == found[-1] else np.nextafter(i.high, -1)
        for threshold in (i.low, (i.low + i.high) / 2, just_below):
            if i.low <= threshold <= just_below:
                assert grouping.group(C, threshold, absolute=absolute) == i.groups
        assert grouping.interval_of([g[::-1] for g in reversed(i.groups)], found) == i
    assert grouping.interval_of([[0, 99]], found) is None


def matrix(pairs: dict[tuple[int, int], float], p: int, rest: float) -> FloatArray:
    C = np.full((p, p), rest)
    for (i, j), value in pairs.items():
        C[i, j] = C[j, i] = value
    np.fill_diagonal(C, 1.0)
    return C


def test_rules_for_what_the_paper_leaves_open() -> None:
    # both seeds above the threshold: the larger coefficient (E-H3), the first seed if equal
    C = matrix({(0, 1): 0.1, (0, 2): 0.95, (1, 2): 0.97, (0, 3): 0.95, (1, 3): 0.95}, 4, 0.92)
    assert grouping.group(C, 0.9) == ((0, 3), (1, 2))
    # a single variable that is left is a group
    assert grouping.group(matrix({(0, 2): 0.1}, 3, 0.5), 0.9) == ((0,), (2,), (1,))
    # seeds closer than the threshold: one group of all that is left
    assert grouping.group(matrix({(1, 2): 0.91}, 4, 0.95), 0.9) == ((1, 2, 0, 3),)
    assert grouping.group(matrix({}, 2, 0.95), 0.9) == ((0, 1),)
    # "greater than", not "at least"
    assert grouping.group(matrix({(0, 1): 0.1}, 3, 0.9), 0.9) == ((0,), (1,), (2,))
    assert grouping.group(matrix({(0, 1): 0.1, (0, 2): 0.5}, 3, 0.9), 0.9) == ((0,), (1,), (2,))
    # ties for the smallest: the first pair
    assert grouping.group(matrix({}, 4, 0.0), 0.9) == ((0,), (1,), (2,), (3,))
    # E-H2: sensors that move against each other are the farthest, or the closest
    against = matrix({(0, 1): -0.99, (0, 2): 0.0, (1, 2): 0.1}, 3, 0.0)
    assert grouping.group(against, 0.9) == ((0,), (1,), (2,))
    assert grouping.group(against, 0.9, absolute=True) == ((0, 1), (2,))
    assert grouping.group(np.ones((1, 1)), 0.9) == ((0,),)


def test_order_of_table_1() -> None:
    # H-10: a matrix with the paper's groups inside and seeds in the order of Table 1 gives Table 1, two groups a round
    C = np.full((13, 13), 0.8)
    for rank, (a, b) in enumerate([(6, 8), (7, 12), (1, 4), (0, 2)]):
        C[a, b] = C[b, a] = 0.1 + 0.1 * rank
    for g in TABLE_1:
        C[np.ix_(g, g)] = 0.97
    np.fill_diagonal(C, 1.0)
    found = grouping.group(C, 0.9)
    # within a pair the paper's order is not known
    assert [set(g) for g in found] == [set(TABLE_1[k]) for k in (0, 1, 3, 2, 5, 4, 6, 7)]
    interval = grouping.interval_of(TABLE_1, grouping.intervals(C))
    assert interval is not None
    assert (interval.low, interval.high) == (0.8, 0.97)


def test_correlation_is_pearsons() -> None:
    # H-02
    rng = np.random.default_rng(0)
    X, _ = warm(rng, 40, 5, 2, 0.3)
    np.testing.assert_allclose(correlation(X), twin.correlation(X), atol=1e-12)
    np.testing.assert_allclose(correlation(X), np.corrcoef(X.T), atol=1e-12)
    copied = correlation(X[:, [0, 0, 1, 2, 0]])
    assert copied[0, 1] == copied[0, 4] == 1.0
    assert np.array_equal(copied[0, 2:4], copied[4, 2:4])
    # to twelve decimals
    C, exact = correlation(X), np.corrcoef(X.T)
    np.testing.assert_array_equal(C, np.round(C, 12))
    assert np.abs(C - exact).max() < 6e-13
    X[:, 3] = 20.1
    with pytest.raises(FitError, match="column 3 is constant"):
        correlation(X)


@pytest.mark.parametrize("threshold", [1.5, -2.0, np.nan])
def test_no_threshold_of_a_correlation(threshold: float) -> None:
    with pytest.raises(InputError, match="from -1 to 1"):
        grouping.group(np.eye(2), threshold)


@pytest.mark.parametrize("C", [np.ones((2, 3)), np.array([[1, 0.5], [0.4, 1]]), np.full((2, 2), np.nan)])
def test_no_correlation_matrix(C: FloatArray) -> None:
    with pytest.raises(InputError, match="square, symmetric, finite"):
        grouping.group(C, 0.9)


# -- search ------------------------------------------------------------------------------------------------------------


def test_numbers_of_searches() -> None:
    # H-07: 8191 subsets of 13 variables; with Table 1's groups 255 and, groups 1, 4, 6, 7 taking part, 4
    rng = np.random.default_rng(1)
    X = rng.normal(size=(32, 13))
    y = X[:, [6, 7, 1, 0]] @ [6.5, 4.3, -10.4, 6.7] - 46.2
    factor = tri(X, y)
    assert exhaustive.search_subsets(factor, range(13)).count == 8191
    found = grouping.choose(factor, TABLE_1)
    assert found.subsets.count == 255
    assert [p for p, s in enumerate(found.subsets.curve, start=1) if s == found.subsets.best] == [4]
    assert found.participating == (0, 3, 5, 6)  # groups 1, 4, 6, 7
    assert found.members.count == 4
    assert found.selected == (0, 1, 6, 7)


@pytest.mark.parametrize("intercept", [True, False])
@pytest.mark.parametrize("seed", range(12))
def test_the_whole_way_follows_the_paper(seed: int, intercept: bool) -> None:
    # H-04 to H-06
    rng = np.random.default_rng(seed)
    n = int(rng.choice([7, 15, 40]))
    X, y = warm(rng, n, 9, 3, rng.choice([0.05, 0.5]))
    X += rng.choice([0.0, 20.0])
    y += rng.choice([0.0, 30.0])
    groups = grouping.group(correlation(X), 0.8)
    found = grouping.choose(tri(X, y, intercept), groups)
    lists = [list(g) for g in groups]
    expected = twin.represented(X, y, lists, intercept)
    assert list(found.representatives) == expected
    curve = twin.curve(X, y, expected, intercept)
    assert [s.columns for s in found.subsets.curve] == [s for _, s in curve]
    np.testing.assert_allclose([s.mse for s in found.subsets.curve], [m for m, _ in curve], rtol=1e-8)
    _, taking_part = min(curve)
    assert {k for k, g in enumerate(groups) if set(g) & set(taking_part)} == set(found.participating)
    best, members = twin.optimum(X, y, lists, taking_part, intercept)
    assert found.selected == tuple(sorted(members))
    assert found.members.best.mse == pytest.approx(best, rel=1e-8)


@pytest.mark.parametrize("seed", range(6))
def test_rounding_is_told_from_a_small_remainder(seed: int) -> None:
    # H-04, H-05: what is left after the first regression is nothing, or small; of equally good variables the first is
    # chosen; a constant one explains nothing
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(32, 5)) * [1.0, 1e-6, 1.0, 1.0, 0.0] + 5
    y, groups = 1e6 * X[:, 0], ((0, 1), (2, 3), (4,))
    assert grouping.representatives(tri(X, y), groups) == (0, 2, 4)
    assert grouping.representatives(tri(X, y + 1e-5 * X[:, 3]), groups) == (0, 3, 4)
    almost = X[:, 0] + 3e-6 * X[:, 2]  # explains more, by a share of 1e-11
    assert grouping.representatives(tri(np.column_stack([X[:, 0], almost]), almost), ((0, 1),)) == (0,)
    found = exhaustive.search_subsets(tri(X[:, :4], y), range(4))
    assert (found.best.columns, found.best.mse) == ((0,), 0.0)
    # a column of zeros explains nothing, with or without a constant
    X[:, 4] = 0.0
    for intercept in (True, False):
        whole = exhaustive.search_subsets(tri(X, X[:, 2] + 0.1 * X[:, 3] ** 2, intercept), range(5))
        assert 4 not in whole.best.columns


def test_sensors_that_almost_repeat_each_other() -> None:
    # the sums of squares must be those of extended precision, where normal equations would have no digit left
    rng = np.random.default_rng(3)
    a, b = rng.normal(size=(2, 60))
    X = np.column_stack([a, b, a + 1e-7 * rng.normal(size=60), a + b + 1e-9 * rng.normal(size=60), a, 20 + 0 * a]) + 20
    y = 3 * a - b + 2e7 * (X[:, 2] - X[:, 0]) + 0.1 * rng.normal(size=60)
    found = exhaustive.search_subsets(tri(X, y), range(6))
    assert np.isfinite([s.mse for s in found.curve]).all()
    for s in found.curve[:4]:
        exact = lstsq(X[:, s.columns], y)
        assert s.mse == pytest.approx(exact.rss / (60 - 1 - len(s.columns)), rel=1e-5)
    assert 2 in found.best.columns
    assert len({0, 4} & set(found.best.columns)) == 1  # the sensor or its copy
    assert 5 not in found.best.columns  # the constant one
    assert found.curve[5].mse * (60 - 7) == pytest.approx(found.curve[3].mse * (60 - 5), rel=1e-3)


def test_large_searches_are_cut_into_batches(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(4)
    X, y = warm(rng, 50, 10, 4, 0.3)
    whole = exhaustive.search_subsets(tri(X, y), range(10))
    groups = [(0, 1, 2), (3, 4), (5,), (6, 7, 8, 9)]
    members = exhaustive.search_members(tri(X, y), groups)
    monkeypatch.setattr(exhaustive, "_BATCH", 8)
    cut = exhaustive.search_subsets(tri(X, y), range(10))
    assert [s.columns for s in cut.curve] == [s.columns for s in whole.curve]
    np.testing.assert_allclose([s.mse for s in cut.curve], [s.mse for s in whole.curve], rtol=1e-12)
    assert exhaustive.search_members(tri(X, y), groups).best.columns == members.best.columns
    assert members.count == 24


@pytest.mark.parametrize(("intercept", "most"), [(True, 3), (False, 4)])
def test_fewer_rows_than_variables(intercept: bool, most: int) -> None:
    # a degree of freedom must be left
    X, y = np.random.default_rng(11).normal(size=(5, 8)), np.array([0.0, 1.0, 4.0, 9.0, 16.0])
    found = exhaustive.search_subsets(tri(X, y, intercept), range(8))
    assert [len(s.columns) for s in found.curve] == list(range(1, most + 1))
    np.testing.assert_allclose(
        [s.mse for s in found.curve], [m for m, _ in twin.curve(X, y, list(range(8)), intercept)], rtol=1e-8
    )
    # one degree of freedom is enough for one variable
    rng = np.random.default_rng(8)
    rows = 2 + int(intercept)
    assert (
        len(
            exhaustive.search_subsets(
                tri(rng.normal(size=(rows, 3)), np.arange(float(rows)), intercept), range(3)
            ).curve
        )
        == 1
    )


def test_too_much_to_search() -> None:
    rng = np.random.default_rng(5)
    X, y = rng.normal(size=(60, 24)), rng.normal(size=60)
    with pytest.raises(FitError, match=r"24 representatives have 16777215 subsets.* lower the threshold"):
        CorrelationGrouping(threshold=0.99).fit(X, y)
    with pytest.raises(FitError, match=r"6 combinations of members, more than 5: raise the threshold"):
        exhaustive.search_members(tri(X, y), [(0, 1, 2), (3, 4)], limit=5)
    with pytest.raises(FitError, match="2 rows are too few for 1 variables: expected at least 3"):
        CorrelationGrouping().fit(X[:2], y[:2])
    with pytest.raises(FitError, match="60 rows are too few for 60"):
        exhaustive.search_members(tri(X, y), [(0,)] * 60)


def test_sweep() -> None:
    # E-H1
    rng = np.random.default_rng(6)
    X, y = warm(rng, 60, 8, 3, 0.3)
    factor = tri(X, y)
    found = grouping.sweep(X, factor)
    assert [s.interval for s in found] == list(grouping.intervals(correlation(X)))
    for s in found:
        assert s.choice == grouping.choose(factor, s.interval.groups)
        assert s.choice is not None
        assert s.spectrum is not None
        chosen = X[:, s.choice.selected]
        np.testing.assert_allclose(s.spectrum.eigenvalues, np.linalg.eigvalsh(chosen.T @ chosen)[::-1], rtol=1e-7)
        fitted = CorrelationGrouping(threshold=s.interval.low).fit(X, y)
        assert fitted.selected_ == s.choice.selected
        assert fitted.mse_ == s.choice.members.best.mse
    assert len(found[0].interval.groups) == 1
    assert len(found[-1].interval.groups) == 8
    cut = grouping.sweep(X, factor, limit=7)
    assert [s.choice is None for s in cut] == [
        len(s.interval.groups) > 3 or s.choice is None or s.choice.members.count > 7 for s in found
    ]
    assert all(bool(s.failure) == (s.choice is None) for s in cut)


# -- collinearity ------------------------------------------------------------------------------------------------------


def test_spectrum() -> None:
    # H-14, E-H6
    rng = np.random.default_rng(9)
    X = rng.normal(size=(30, 4)) + 5
    found = spectrum(X)
    assert found.sum_inverse == pytest.approx(np.trace(np.linalg.inv(X.T @ X)))
    assert found.condition_number == pytest.approx(np.linalg.cond(X) ** 2)
    copied = spectrum(X[:, [0, 1, 0]])
    assert (copied.smallest, copied.sum_inverse, copied.condition_number) == (0.0, np.inf, np.inf)
    assert spectrum(X[:2]).eigenvalues[2:] == (0.0, 0.0)
    # nothing is what is small beside the greatest, not beside the next
    assert spectrum(np.diag([1.0, 1e-10, 1e-15])).eigenvalues == pytest.approx((1.0, 1e-20, 0.0), rel=1e-9, abs=0.0)
    two = spectrum(np.diag([1.0, 0.5]))
    assert (two.smallest, two.sum_inverse, two.condition_number) == pytest.approx((0.25, 5.0, 4.0))
    none = spectrum(X[:, :0])
    assert none.eigenvalues == ()
    assert none.sum_inverse == 0
    assert np.isnan([none.smallest, none.condition_number]).all()


def test_contributions() -> None:
    # H-17
    rng = np.random.default_rng(10)
    X = np.column_stack([rng.normal(size=(50, 2)), np.full(50, 3.0)])
    y = X[:, 0] - 2 * X[:, 1] + rng.normal(size=50)
    found = contributions(X, y)
    np.testing.assert_allclose(found[:2], [np.corrcoef(X[:, k], y)[0, 1] for k in (0, 1)], atol=1e-11)
    assert np.isnan(found[2])
    assert np.isnan(contributions(X, np.ones(50))).all()  # nothing contributes to what does not change


@pytest.mark.parametrize("absolute", [False, True])
@pytest.mark.parametrize("threshold", [0.2, 0.6, 0.9])
def test_temperatures_are_grouped_and_differences_represent(threshold: float, absolute: bool) -> None:
    X, y = warm(np.random.default_rng(8), 40, 8, 3, 0.4)
    X[:, 2] *= -1.0
    m = CorrelationGrouping(threshold=threshold, absolute=absolute, reference=7).fit(X, y)
    groups = twin.grouped(np.round(twin.correlation(X[:, :7]), 12), threshold, absolute)
    assert [list(g) for g in m.groups_] == groups
    assert list(m.representatives_) == twin.represented(X[:, :7] - X[:, 7:], y, groups, True)
