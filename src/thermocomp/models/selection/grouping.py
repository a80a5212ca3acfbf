"""Sensor selection by correlation grouping and successive regression (Hwang, Lee, Yang; H-01 to H-07).

Fig. 1 of the paper: groups of similar temperatures -> one representative of each group -> groups that participate in
the model -> best member of each. Columns are identified by their indices.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.exceptions import FitError, InputError
from thermocomp.models.numerics.leastsquares import Triangle
from thermocomp.models.selection.collinearity import Spectrum, correlation, spectrum
from thermocomp.models.selection.exhaustive import LIMIT, SAME, Search, search_members, search_subsets

Groups = tuple[tuple[int, ...], ...]


# -- groups (H-03) -----------------------------------------------------------------------------------------------------


def group(correlation: FloatArray, threshold: float, *, absolute: bool = False) -> Groups:
    """Group variables by their correlation (Hwang, section 2.1; H-03).

    The two variables with the smallest correlation are the seeds of two groups; each other variable joins a seed if its
    correlation with the seed is above the threshold. This is repeated with the remaining variables until none remain.
    Rules for cases that the paper leaves open:

    - above the threshold for both seeds: the larger correlation decides (E-H3); if equal, the first seed;
    - seeds whose own correlation is above the threshold: then all remaining pairs are, and all remaining variables form
      one group. (Two groups as close as these would contradict the threshold, and no threshold would yield one group.)
    - one remaining variable: a separate group;
    - several pairs with the smallest correlation: the first by the lower index, then by the higher.

    Groups are ordered by their seeds, in pairs as in the paper's Table 1; the paper does not define the order within a
    pair: here the lower index is first. Within a group the seed is first (both seeds if all variables form one group),
    followed by the others in ascending order.

    Parameters
    ----------
    correlation : ndarray of shape (n_variables, n_variables)
        Symmetric matrix.
    """
    close = _checked(correlation, absolute)
    if not -1 <= threshold <= 1:
        raise InputError(f"threshold {threshold}: expected a correlation, from -1 to 1")
    groups: list[tuple[int, ...]] = []
    left = np.arange(len(close))
    while left.size > 1:
        among = close[np.ix_(left, left)]
        rows, columns = np.triu_indices(left.size, 1)
        smallest = int(np.argmin(among[rows, columns]))
        a, b = rows[smallest], columns[smallest]
        others = np.delete(np.arange(left.size), [a, b])
        if among[a, b] > threshold:
            groups.append(tuple(left[[a, b, *others]].tolist()))
            break
        joins_a = (among[a] > threshold) & (among[a] >= among[b])
        joins_b = (among[b] > threshold) & (among[b] > among[a])
        for seed, joins in ((a, joins_a), (b, joins_b)):
            groups.append((int(left[seed]), *left[others[joins[others]]].tolist()))
        left = left[others[~(joins_a | joins_b)[others]]]
    else:
        groups += [(k,) for k in left.tolist()]
    return tuple(groups)


@dataclass(frozen=True)
class Interval:
    """Range of thresholds that give the same groups.

    Parameters
    ----------
    low, high : float
        low <= threshold < high; the last interval includes its upper end, 1.
    """

    low: float
    high: float
    groups: Groups


def intervals(correlation: FloatArray, *, absolute: bool = False) -> tuple[Interval, ...]:
    """Return all possible groupings, with the corresponding thresholds (E-H1).

    Thresholds are only compared with correlations, so the groups change at correlations only, and the intervals are
    exact.

    Parameters
    ----------
    correlation : ndarray of shape (n_variables, n_variables)
    """
    close = _checked(correlation, absolute)
    start = 0.0 if absolute else -1.0
    breaks = np.unique(np.append(close[np.triu_indices(len(close), 1)], start)).tolist()
    found: list[Interval] = []
    for low, high in zip(breaks, [*breaks[1:], 1.0], strict=True):
        groups = group(close, low)
        if found and found[-1].groups == groups:
            found[-1] = Interval(found[-1].low, high, groups)
        else:
            found.append(Interval(low, high, groups))
    return tuple(found)


def interval_of(groups: Sequence[Sequence[int]], found: Sequence[Interval]) -> Interval | None:
    """Return the interval of thresholds for the given groups, in any order; None if there is none."""
    wanted = {frozenset(g) for g in groups}
    return next((i for i in found if {frozenset(g) for g in i.groups} == wanted), None)


def _checked(correlation: FloatArray, absolute: bool) -> FloatArray:
    C = np.asarray(correlation, dtype=np.float64)
    if C.ndim != 2 or C.shape[0] != C.shape[1] or not np.isfinite(C).all() or not np.array_equal(C, C.T):
        raise InputError(
            f"correlation: expected a square, symmetric, finite matrix; found the shape {C.shape}, or values that "
            "are asymmetric or not finite"
        )
    return np.abs(C) if absolute else C


# -- representatives (H-04) --------------------------------------------------------------------------------------------


def representatives(tri: Triangle, groups: Groups) -> tuple[int, ...]:
    """Choose one variable of each group by successive regression (Hwang, Eq. 2; H-04).

    The variable that explains most of the error represents its group; then, of the other groups, the variable that
    explains most of the residual; and so on. As printed in the paper, only the first regression has a constant (E-H9);
    none has one if `tri` has no intercept. Of equally good variables the first is chosen.

    Parameters
    ----------
    tri : Triangle
        Triangular factor of [X y].
    """
    images = uncentre(tri)
    rounding = float(tri.noise[-1]) ** 2
    home = {column: number for number, members in enumerate(groups) for column in members}
    residual = images[:, -1].copy()
    residual[0] = 0.0  # part explained by the constant of the first regression
    found: list[int] = []
    open_groups = set(range(len(groups)))
    while open_groups:
        columns = sorted(c for c, number in home.items() if number in open_groups)
        basis = images[:, columns]
        if not found:
            basis[0] = 0.0
        squares = np.einsum("ij,ij->j", basis, basis)
        slopes = np.divide(residual @ basis, squares, out=np.zeros(len(columns)), where=squares > 0)
        gains = slopes**2 * squares
        best = int(np.argmax(np.minimum(gains, gains.max() * (1 - SAME) - rounding)))
        residual -= slopes[best] * basis[:, best]
        found.append(columns[best])
        open_groups.remove(home[columns[best]])
    return tuple(found)


def uncentre(tri: Triangle) -> FloatArray:
    """Return a small matrix with the same cross products as the uncentred [X y]; row 0 contains the means."""
    return np.vstack([np.sqrt(tri.n_rows) * tri.centre, tri.factor])


# -- complete method ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Grouped:
    """Result of Hwang's method.

    Parameters
    ----------
    representatives : tuple of int
        In the order of the successive regression.
    subsets : Search
        Search among the representatives.
    participating : tuple of int
        Groups that participate in the model, as indices of `groups`, in ascending order.
    members : Search
        Search among the combinations of members of these groups.
    """

    groups: Groups
    representatives: tuple[int, ...]
    subsets: Search
    participating: tuple[int, ...]
    members: Search

    @property
    def selected(self) -> tuple[int, ...]:
        """Columns in the model, in ascending order."""
        return tuple(sorted(self.members.best.columns))


def choose(tri: Triangle, groups: Groups, *, limit: int = LIMIT) -> Grouped:
    """Select the best variables from groups (Hwang, Fig. 1; H-04 to H-06).

    Parameters
    ----------
    tri : Triangle
        Triangular factor of [X y].
    """
    chosen = representatives(tri, groups)
    subsets = search_subsets(tri, chosen, limit=limit)
    participating = tuple(k for k, g in enumerate(groups) if set(g) & set(subsets.best.columns))
    members = search_members(tri, [groups[k] for k in participating], limit=limit)
    return Grouped(groups=groups, representatives=chosen, subsets=subsets, participating=participating, members=members)


@dataclass(frozen=True)
class Swept:
    """Result for an interval of thresholds.

    Parameters
    ----------
    choice : Grouped or None
        None if no set could be chosen.
    spectrum : Spectrum or None
        Spectrum of the chosen variables.
    failure : str
        Reason why no set could be chosen, such as too large a search; otherwise empty.
    """

    interval: Interval
    choice: Grouped | None
    spectrum: Spectrum | None
    failure: str = ""


def sweep(temperatures: FloatArray, tri: Triangle, *, absolute: bool = False, limit: int = 2**14) -> tuple[Swept, ...]:
    """Apply the method for all possible thresholds (E-H1).

    Parameters
    ----------
    temperatures : ndarray of shape (n_rows, n_columns)
        Temperatures to group; none may be constant.
    tri : Triangle
        Triangular factor of [X y], where X are the regressors: the temperatures, or their differences from a reference.
    """
    images = uncentre(tri)
    found = []
    for interval in intervals(correlation(temperatures), absolute=absolute):
        try:
            choice = choose(tri, interval.groups, limit=limit)
        except FitError as e:
            found.append(Swept(interval, None, None, str(e)))
        else:
            found.append(Swept(interval, choice, spectrum(images[:, choice.selected])))
    return tuple(found)
