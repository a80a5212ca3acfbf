"""Sets of sensors that are as good as the best, against scipy and against all signs (W-10 to W-12)."""

from dataclasses import replace
from itertools import combinations, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy import stats

from thermocomp.models.selection.equivalents import SensorSet, equivalents, signed_rank_p
from thermocomp.models.selection.maximal_correlation import MaximalCorrelations

FloatArray = NDArray[np.float64]


def every_sign(d: FloatArray) -> float:
    """The two-sided p value by its definition: all ways to give signs to the ranks."""
    d = d[d != 0]
    ranks = stats.rankdata(np.abs(d))
    statistic = min(ranks[d > 0].sum(), ranks[d < 0].sum())
    sums = [sum(r for r, s in zip(ranks, signs, strict=True) if s) for signs in product((0, 1), repeat=len(d))]
    return min(1.0, 2 * float(np.mean(np.array(sums) <= statistic)))


@given(st.lists(st.integers(-4, 4), min_size=1, max_size=9))
@settings(max_examples=150, deadline=None)
def test_p_value_with_ties_and_zeros(steps: list[int]) -> None:
    d = np.array(steps) / 10
    assert signed_rank_p(d[None])[0] == pytest.approx(every_sign(d), rel=1e-12)


@pytest.mark.parametrize("n", [6, 23, 50])
def test_p_value_without_ties_is_scipys(n: int) -> None:
    d = np.random.default_rng(n).normal(0.2, 1, size=(40, n))
    expected = stats.wilcoxon(d, axis=1, method="exact").pvalue
    np.testing.assert_allclose(signed_rank_p(d), expected, rtol=1e-9)


def test_p_value_of_many_pairs_is_close_to_normal() -> None:
    d = np.round(np.random.default_rng(1).normal(0.1, 1, size=(20, 150)), 1)
    expected = stats.wilcoxon(d, axis=1, method="asymptotic").pvalue
    np.testing.assert_allclose(signed_rank_p(d), expected, atol=0.005)


def test_rounding_makes_no_difference() -> None:
    # 0.3 - 0.2 and 0.2 - 0.1 are the same step, though not the same float
    d = np.array([[0.3 - 0.2, 0.1 - 0.2, 0.5 - 0.5 + 1e-17, 0.7 - 0.5]])
    assert signed_rank_p(d)[0] == every_sign(np.array([1.0, -1.0, 0.0, 2.0]))


def study(seed: int = 0) -> tuple[list[FloatArray], list[tuple[int, ...]]]:
    """Psi like the paper's: 9 places, 23 data sets, 3 displacements, sets of up to 3 places; 1 and 7 matter (W-10)."""
    rng = np.random.default_rng(seed)
    subsets = [s for size in (1, 2, 3) for s in combinations(range(9), size)]
    psi = []
    for _ in range(3):
        good = np.array([0.9 + 0.05 * (1 in s) + 0.03 * (7 in s) + 0.012 * (len(s) > 2) for s in subsets])
        psi.append(np.minimum(good[:, None] + rng.normal(0, 0.002, (129, 23)) + rng.normal(0, 0.003, 23), 1.0))
    return psi, subsets


def test_sets_equivalent_for_all_displacements() -> None:
    # W-11
    psi, subsets = study()
    found = equivalents(psi, subsets)
    assert len(found.subsets) == 129
    assert found.notes == ()
    assert found.common
    assert all({1, 7} < set(s) and len(s) == 3 for s in found.common)
    for d, values in enumerate(psi):
        top = found.best[d]
        assert top == int(np.argmax(values.sum(axis=1)))
        assert found.equivalent[d, top]
        assert found.p_values[d, top] == 1.0
        for k in range(0, 129, 9):
            if k != top:
                p = stats.wilcoxon(values[k], values[top]).pvalue
                assert found.p_values[d, k] == pytest.approx(p, rel=1e-6)
                assert found.equivalent[d, k] == (p > 0.05)
    assert set(found.common) == {s for k, s in enumerate(subsets) if all(found.p_values[d, k] > 0.05 for d in range(3))}
    # whichever of two sets is the better one
    differences = np.random.default_rng(4).normal(0.4, 1.0, (6, 23))
    for sign in (1, -1):
        expected = [stats.wilcoxon(sign * d).pvalue for d in differences]
        np.testing.assert_allclose(signed_rank_p(sign * differences), expected, rtol=1e-9)


def test_table() -> None:
    psi, subsets = study(1)
    found = equivalents(psi, subsets)
    rows = found.table()
    assert sorted(r.subset for r in rows) == sorted(subsets)
    assert {r.subset for r in rows if len(r.equivalent) == 3} == set(found.common)
    keys = [(-len(r.equivalent), -sum(r.summed)) for r in rows]
    assert keys == sorted(keys)
    k = subsets.index(rows[5].subset)
    assert rows[5] == SensorSet(
        subsets[k],
        tuple(float(v[k].sum()) for v in psi),
        tuple(found.p_values[:, k].tolist()),
        tuple(d for d in range(3) if found.p_values[d, k] > 0.05),
    )


@pytest.mark.parametrize("seed", range(3))
def test_holm(seed: int) -> None:
    # E-W6
    rng = np.random.default_rng(seed)
    values = rng.normal(0, 1, size=(30, 14)) - np.linspace(0, 2, 30)[:, None]
    subsets = [(k,) for k in range(30)]
    plain, corrected = equivalents([values], subsets), equivalents([values], subsets, holm=True)
    others = np.delete(np.arange(30), plain.best[0])
    p = sorted(plain.p_values[0, others])
    rejected = 0
    while rejected < 29 and p[rejected] <= 0.05 / (29 - rejected):  # Holm 1979
        rejected += 1
    assert (~corrected.equivalent).sum() == rejected
    assert (plain.p_values[0, ~corrected.equivalent[0]] <= p[rejected - 1]).all()
    assert plain.equivalent.sum() < corrected.equivalent.sum() < 30
    assert (corrected.equivalent | ~plain.equivalent).all()


def test_too_few_data_sets() -> None:
    # with five pairs no p value is below 2/32
    rng = np.random.default_rng(2)
    values = rng.uniform(0, 0.1, size=(4, 6)) + np.array([0.9, 0.1, 0.2, 0.3])[:, None]
    subsets = [(0,), (1,), (2,), (0, 1)]
    five = equivalents([values[:, :5]], subsets)
    assert five.equivalent.all()
    assert five.common == tuple(subsets)
    assert "displacement 0: 5 data sets are too few: the smallest possible p value is 0.062" in five.notes[0]
    assert "every set counts as equivalent" in five.notes[0]
    six = equivalents([values], subsets)
    assert six.equivalent.tolist() == [[True, False, False, False]]
    assert six.notes == ()
    held = equivalents([values], subsets, holm=True)  # 2/64 against 0.05/3
    assert held.equivalent.all()
    assert "(Holm)" in held.notes[0]
    assert equivalents([values[:, :1]], subsets).equivalent.all()
    assert equivalents([values[:, :5]], subsets, level=2 / 32).notes == ()  # the smallest one, not above it
    assert equivalents([values[:, :5]], subsets, level=0.0624).notes != ()


def test_ties_and_one_set_alone() -> None:
    values = np.tile(np.array([[0.3], [0.1 + 0.2], [0.2]]), (1, 8))
    found = equivalents([values, values[:, :7]], [(0,), (1,), (2,)])
    assert found.best == (0, 0)  # equal but for rounding: the first
    assert found.common == ((0,), (1,))
    assert equivalents([values[:1]], [(4, 2)], holm=True).common == ((4, 2),)


def test_thousands_of_sets() -> None:
    # 2**12 sets, half of them with a tie
    rng = np.random.default_rng(3)
    values = np.round(rng.uniform(0.9, 1, size=(4095, 23)), 4)
    found = equivalents([values] * 2, [(k,) for k in range(4095)])
    for k in range(0, 4095, 1000):
        d = values[k] - values[found.best[0]]
        assert found.p_values[0, k] == pytest.approx(stats.wilcoxon(np.round(d, 4)).pvalue, abs=0.01)


def test_number_of_sensors_that_is_enough() -> None:
    # W-12: triples reach more than 0.99
    psi, subsets = study()
    found = MaximalCorrelations(np.array(psi), tuple(tuple(s) for s in subsets), ("",) * psi[0].shape[1], complete=True)
    assert found.least_size(0.99) == 3
    assert found.least_size(0.97) == 2
    assert replace(found, psi=np.full_like(found.psi, 0.75)).least_size(0.75) == 1  # at least so much
    assert replace(found, psi=np.array([*psi, psi[0] - 0.05])).least_size(0.99) is None


def test_common_sets_are_equivalent_for_every_displacement() -> None:
    psi = np.linspace(0.9, 0.98, 23)
    same, worse = np.stack([psi, psi, psi]), np.stack([psi, psi - 0.01, psi])
    for d in range(3):
        each = [worse if k == d else same for k in range(3)]
        assert equivalents(each, [(0,), (1,), (2,)]).common == ((0,), (2,))


def test_the_best_set_has_the_greatest_sum() -> None:
    psi = np.stack([np.repeat([0.90, 0.99], [12, 11]), np.full(23, 0.91)])
    assert equivalents([psi], [(0,), (1,)]).best == (0,)
