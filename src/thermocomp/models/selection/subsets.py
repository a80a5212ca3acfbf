"""Exact best subset regression: the best set of every size, with a certificate of optimality or "not proven"."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.exceptions import FitError, InputError
from thermocomp.models.numerics.leastsquares import Triangle, join_columns, solve, triangle
from thermocomp.models.selection.subsetrun import Route, Stop, run
from thermocomp.models.selection.subsetsearch import Problem

_SAME = 1e-12  # relative difference of two sums of squares due to rounding alone, in addition to the noise of y


@dataclass(frozen=True)
class Subset:
    """A set of columns and its goodness of fit.

    Parameters
    ----------
    columns : tuple of int
        In ascending order.
    rss : float
        Residual sum of squares from a new QR of the original data [unit of y squared].
    proven : bool
        True: no other set of this size (except those ranked before it) has such a small sum, considering rounding.
    bound : float
        Lower bound of the sums of all other sets of this size (except those ranked before it); less than `rss` if not
        proven.
    """

    columns: tuple[int, ...]
    rss: float
    proven: bool
    bound: float


@dataclass(frozen=True)
class Subsets:
    """Result of `best_subsets`.

    Parameters
    ----------
    ranked : tuple of tuple of Subset
        Sets for each size from 1, the best first; empty if none was found before the search was stopped.
    left_out : tuple of int
        Columns not searched: constant columns, and copies of an earlier column (up to a factor and an offset).
    rank : int
        Rank of the other columns; no larger sets exist.
    total : float
        Sum of squares of y, about its mean if there is an intercept.
    full_rss : float
        Residual sum of squares on all columns.
    route : {'dropping', 'adding'}
        Search method.
    nodes : int
        Number of sets examined.
    possible : float
        Number of possible sets of the requested sizes.
    stopped : {'', 'nodes', 'seconds', 'interrupted'}
        Reason why the search ended early.
    """

    ranked: tuple[tuple[Subset, ...], ...]
    left_out: tuple[int, ...]
    rank: int
    total: float
    full_rss: float
    n_rows: int
    intercept: bool
    route: Route
    nodes: int
    possible: float
    stopped: Stop

    @property
    def best(self) -> tuple[Subset, ...]:
        """Best set of every size for which one was found, in ascending order of size."""
        return tuple(sets[0] for sets in self.ranked if sets)

    @property
    def proven(self) -> bool:
        """True if all sets in `best` are proven to be the best of their size."""
        return all(s.proven for s in self.best)

    @property
    def dof(self) -> int:
        """Degrees of freedom of y about its mean, or about zero."""
        return self.n_rows - int(self.intercept)


def best_subsets(
    X: FloatArray,
    y: FloatArray,
    *,
    intercept: bool = True,
    max_size: int | None = None,
    n_best: int = 1,
    jobs: int = 1,
    nodes: int | None = None,
    seconds: float | None = None,
    route: Route | None = None,
    progress: Callable[[str], None] | None = None,
) -> Subsets:
    """Find the best set of columns of every size, by residual sum of squares.

    There are two search methods. *Dropping*, for all sizes: branch and bound over the sets that remain when columns are
    removed from the full set (Furnival and Wilson 1974; Gatu and Kontoghiorghes 2006); the most costly columns are kept
    first, and branches are pruned by the best known sum for each size. *Adding*, for small sizes of many columns: all
    sets, with the last two columns entering in closed form. The cheaper method is chosen.

    Rounding: the searches prune with a margin, the maximum change of a residual norm by rounding, both in the search
    and in the factorisation: the sum over the columns of their rounding remainder (`Triangle.noise`) times the
    coefficient in the full model plus its maximum difference in a set as good as the best. All sets within the margin
    are kept and refitted by a new QR of the original data, in extended precision where necessary; this decides. A set
    is proven if the search was completed, no set within the margin was lost, and a change of one unit in the last place
    of every number cannot make another set as good.

    Constant columns and copies of an earlier column (up to a factor and an offset, within rounding) are left out.
    Unless such a copy is identical to the last bit, nothing is proven, since it might have been better. If the
    remaining columns are still dependent, as is always the case with more columns than rows, only *adding* is possible,
    sets with dependent columns do not count as sets of their size, and `max_size` must be given unless there are few
    columns.

    Parameters
    ----------
    X : ndarray of shape (n_rows, n_columns)
    y : ndarray of shape (n_rows,)
    seconds : float, optional
        Time limit, approximate [s].
    route : {'dropping', 'adding'}, optional
        Search method; default: the cheaper one.
    """
    if n_best < 1 or jobs < 1 or (max_size is not None and max_size < 1):
        raise InputError(f"n_best {n_best}, jobs {jobs}, max_size {max_size}: expected at least 1")
    tri = triangle(join_columns(X, y), intercept=intercept)
    kept, same = _distinct(X, tri)
    if not kept:
        raise FitError("best subsets: every column is constant; there is nothing to select from")
    problem = Problem.of(tri, kept)
    p = len(kept)
    most = min(max_size or problem.rank, problem.rank)
    possible = sum(math.comb(p, s) for s in range(1, most + 1))
    adding = possible * 1.5e-9  # [s], as in the next line; both found by measurement
    way: Route = route or ("adding" if problem.rank < p or adding < 2.5e-7 * 2 ** (0.47 * p) else "dropping")
    if problem.rank < p and (way == "dropping" or (max_size is None and adding > 10)):
        raise InputError(
            f"best subsets: {p} columns of rank {problem.rank} are linearly dependent, so the search cannot start "
            "from all of them; give a small max_size, or leave dependent columns out"
        )
    search = run(problem, way, most, n_best, jobs, nodes, seconds, progress)
    ranked = []
    for size in range(1, most + 1):
        fitted = []
        for columns in search.sets(size):
            where = tuple(sorted(kept[i] for i in columns))
            some = X[:, where]
            fresh = triangle(join_columns(some, y), intercept=intercept)
            found = solve(some, y, fresh)
            # effect on the residual of one unit in the last place of every number
            blur = float(fresh.last_place[:-1] @ np.abs(found.coefficients)) + problem.y_noise
            fitted.append((found.rss, where, blur))
        beyond, complete = search.safe(size) if len(fitted) < math.comb(p, size) else (math.inf, True)
        ranked.append(_certified(sorted(fitted), n_best, beyond, complete and same))
    return Subsets(
        ranked=tuple(ranked),
        left_out=tuple(sorted(set(range(X.shape[1])) - set(kept))),
        rank=problem.rank,
        total=tri.total,
        full_rss=problem.full_rss,
        n_rows=len(y),
        intercept=intercept,
        route=way,
        nodes=search.looked,
        possible=float(possible),
        stopped=search.stopped,
    )


def _certified(
    fitted: Sequence[tuple[float, tuple[int, ...], float]], n_best: int, beyond: float, complete: bool
) -> tuple[Subset, ...]:
    """Rank the refitted sets; other sets have sums of at least `beyond`, which is reliable if the list is `complete`.

    The data are exact only to their last place, so sums whose order this could change are not distinguished.
    """
    found = []
    for i, (rss, columns, blur) in enumerate(fitted[:n_best]):
        apart = beyond - rss > _SAME * rss + _moved(rss, blur)
        for other, _, theirs in fitted[i + 1 :]:
            apart = apart and other - rss > _SAME * rss + _moved(rss, blur) + _moved(other, theirs)
        others = min(beyond, fitted[i + 1][0]) if i + 1 < len(fitted) else beyond
        proven = bool(complete and apart)
        bound = rss if proven else max(min(rss, others) - _moved(rss, blur), 0.0)
        found.append(Subset(columns, rss, proven, float(bound)))
    # a rank is only proven if all earlier ranks are
    return tuple(replace(s, proven=all(t.proven for t in found[: i + 1])) for i, s in enumerate(found))


def _moved(rss: float, blur: float) -> float:
    """Return the maximum change of a residual sum of squares if the residual changes by a vector of norm `blur`."""
    return 2 * blur * math.sqrt(rss) + blur**2


def _distinct(X: FloatArray, tri: Triangle) -> tuple[list[int], bool]:
    """Return the columns that are neither constant nor a copy of an earlier one, and whether all copies are exact."""
    norms, noise = tri.norms[:-1], tri.noise[:-1]
    alive = np.flatnonzero(norms > noise)
    unit = tri.factor[:, alive] / norms[alive]
    share = noise[alive] / norms[alive]
    near = np.abs(np.triu(unit.T @ unit, 1)) > 1 - 1e-9
    copies = set()
    same = True
    for i, j in zip(*np.nonzero(near), strict=True):
        other = np.copysign(1.0, unit[:, i] @ unit[:, j]) * unit[:, i]
        if i not in copies and np.linalg.norm(unit[:, j] - other) <= share[i] + share[j]:
            copies.add(j)
            same = same and np.array_equal(X[:, alive[i]], X[:, alive[j]])
    return [int(k) for i, k in enumerate(alive) if i not in copies], same
