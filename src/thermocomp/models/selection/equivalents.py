"""Sets of sensors that are equivalent to the best set (Wessel et al. 2004, Appendix B; W-11, W-12).

Input: the maximal correlation psi of every set of sensors on every data set. Result: the sets that are best for every
displacement, or not significantly different from the best by the Wilcoxon test for paired samples.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import rankdata

from thermocomp.core.arrays import BoolArray, FloatArray, IntArray
from thermocomp.core.exceptions import InputError

_DECIMALS = 12  # decimals of psi differences that are compared; further digits are rounding errors


@dataclass(frozen=True, eq=False)
class Equivalents:
    """Result of the comparison of sensor sets.

    Parameters
    ----------
    subsets : tuple of tuple of int
        Sets of sensors, as indices.
    summed : ndarray of shape (n_displacements, n_subsets)
        Psi summed over the data sets.
    best : tuple of int
        Set with the greatest sum for each displacement, as index of `subsets`.
    p_values : ndarray of shape (n_displacements, n_subsets)
        P-values of the Wilcoxon test against the best set.
    equivalent : ndarray of bool of shape (n_displacements, n_subsets)
        Sets that the test cannot distinguish from the best.
    notes : tuple of str
        Limitations of the test with these data.
    """

    subsets: tuple[tuple[int, ...], ...]
    summed: FloatArray
    best: tuple[int, ...]
    p_values: FloatArray
    equivalent: BoolArray
    notes: tuple[str, ...]

    @property
    def common(self) -> tuple[tuple[int, ...], ...]:
        """Sets equivalent to the best for every displacement, from which the user may choose (W-11)."""
        return tuple(self.subsets[k] for k in np.flatnonzero(self.equivalent.all(axis=0)))

    def table(self) -> tuple["SensorSet", ...]:
        """Return one row per set, sorted by the number of displacements with equivalence to the best, then by psi."""
        total = self.summed.sum(axis=0)
        order = np.lexsort((-total, -self.equivalent.sum(axis=0)))
        return tuple(
            SensorSet(
                subset=self.subsets[k],
                summed=tuple(self.summed[:, k].tolist()),
                p_values=tuple(self.p_values[:, k].tolist()),
                equivalent=tuple(np.flatnonzero(self.equivalent[:, k]).tolist()),
            )
            for k in order
        )


@dataclass(frozen=True)
class SensorSet:
    """One set of sensors, compared with the best sets.

    Parameters
    ----------
    summed, p_values : tuple of float
        One value per displacement.
    equivalent : tuple of int
        Displacements for which the set is equivalent to the best.
    """

    subset: tuple[int, ...]
    summed: tuple[float, ...]
    p_values: tuple[float, ...]
    equivalent: tuple[int, ...]


def equivalents(
    psi: Sequence[ArrayLike], subsets: Sequence[Sequence[int]], *, level: float = 0.05, holm: bool = False
) -> Equivalents:
    """Find the sets of sensors that are equivalent to the best, for every displacement (W-11).

    For each displacement the best set has the greatest psi summed over the data sets; if several are equal, the first.
    Another set is equivalent if the two-sided Wilcoxon signed-rank test does not distinguish its psi from that of the
    best. A non-significant difference does not prove equality: with few data sets no difference is ever significant,
    which a note then states.

    Parameters
    ----------
    psi : sequence of array-like of shape (n_subsets, n_tests)
        One array per displacement; the numbers of data sets may differ.
    """
    sets = tuple(tuple(s) for s in subsets)
    if not 0 < level < 1:
        raise InputError(f"level {level}: expected a significance between 0 and 1, such as 0.05")
    if not psi or not sets:
        raise InputError("psi: expected at least one displacement and one set of sensors")
    summed, p_values = np.empty((2, len(psi), len(sets)))
    equivalent = np.empty((len(psi), len(sets)), dtype=np.bool_)
    best, notes = [], []
    for d, given in enumerate(psi):
        values = np.asarray(given, dtype=np.float64)
        if values.ndim != 2 or len(values) != len(sets) or values.shape[1] == 0:
            raise InputError(
                f"psi of displacement {d}: expected a table of {len(sets)} sets by data sets, found the shape "
                f"{values.shape}"
            )
        if not np.isfinite(values).all():
            k, test = np.argwhere(~np.isfinite(values))[0]
            raise InputError(
                f"psi of displacement {d}, set {sets[k]}, data set {test}: {values[k, test]} is not a number"
            )
        summed[d] = values.sum(axis=1)
        top = int(np.argmax(np.round(summed[d], _DECIMALS)))
        best.append(top)
        p_values[d] = signed_rank_p(values - values[top])
        others = np.delete(np.arange(len(sets)), top)
        rejected = np.zeros(len(sets), dtype=np.bool_)
        rejected[others] = _rejected(p_values[d, others], level, holm)
        equivalent[d] = ~rejected
        n_tests = values.shape[1]
        least, wanted = 2.0 ** (1 - n_tests), level / max(others.size, 1) if holm else level
        if least > wanted:
            notes.append(
                f"displacement {d}: {n_tests} data sets are too few: the smallest possible p value is {least:.2g}, "
                f"above {wanted:.2g}{' (Holm)' if holm else ''}, so that every set counts as equivalent"
            )
    return Equivalents(
        subsets=sets, summed=summed, best=tuple(best), p_values=p_values, equivalent=equivalent, notes=tuple(notes)
    )


def signed_rank_p(differences: FloatArray) -> FloatArray:
    """Return the two-sided p values of Wilcoxon's signed-rank test, one per row.

    The p values are exact even with ties: under the null hypothesis every sign is equally likely for any ranks, and the
    distribution of the sum of positive ranks is built by adding one pair at a time. `scipy.stats.wilcoxon` does the
    same without ties; with ties it draws signs at random or uses the normal approximation, which for five pairs gives
    0.04 although no p below 0.0625 exists. Zero differences are removed before ranking (Wilcoxon's original rule); if
    none remain, p = 1.

    Parameters
    ----------
    differences : ndarray of shape (n_rows, n_pairs)
        Paired differences; they are rounded to 12 decimals before comparison.

    Returns
    -------
    ndarray of shape (n_rows,)
    """
    rounded = np.round(differences, _DECIMALS)
    size, zero = np.abs(rounded), rounded == 0
    # zeros have the lowest ranks, so their number is subtracted from the other ranks; doubled because of half ranks
    ranks = 2 * np.asarray(rankdata(size, axis=1)) - 2 * zero.sum(axis=1, keepdims=True)
    doubled = np.where(zero, 0, np.rint(ranks)).astype(np.intp)
    positive = (doubled * (rounded > 0)).sum(axis=1)
    smaller = np.minimum(positive, doubled.sum(axis=1) - positive)
    p = np.empty(len(rounded))
    kinds, which = np.unique(np.sort(doubled, axis=1), axis=0, return_inverse=True)
    for k, kind in enumerate(kinds):
        those = which == k
        p[those] = np.minimum(1.0, 2 * _below(kind)[smaller[those]])
    return p


def _below(ranks: IntArray) -> FloatArray:
    """Return the probability that the sum of the positive ranks is at most 0, 1, 2, ..."""
    chance = np.zeros(int(ranks.sum()) + 1)
    chance[0] = 1.0
    for r in ranks[ranks > 0]:
        moved = np.zeros_like(chance)
        moved[r:] = chance[: len(chance) - r]
        chance = 0.5 * (chance + moved)
    return np.asarray(np.cumsum(chance))


def _rejected(p: FloatArray, level: float, holm: bool) -> BoolArray:
    """Return a mask of the rejected hypotheses, with or without Holm's step-down rule."""
    if not holm:
        return np.asarray(p <= level)
    order = np.argsort(p, kind="stable")
    holds = p[order] <= level / np.arange(len(p), 0, -1)
    rejected = np.zeros(len(p), dtype=np.bool_)
    rejected[order[: int(np.argmin(np.append(holds, False)))]] = True
    return rejected
