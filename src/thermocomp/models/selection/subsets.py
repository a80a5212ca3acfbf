"""Exact best subset regression: the best set of every size, with a certificate, or "not proven"."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.exceptions import FitError, InputError
from thermocomp.models.numerics.leastsquares import Triangle, join_columns, solve, triangle
from thermocomp.models.selection.subsetrun import Route, Stop, run
from thermocomp.models.selection.subsetsearch import Problem

FloatArray = NDArray[np.float64]

_SAME = 1e-12  # relative difference of two sums of squares that is nothing but rounding, beside the noise of y


@dataclass(frozen=True)
class Subset:
    """A set of columns and how well it fits.

    Parameters
    ----------
    columns : tuple of int
        In rising order.
    rss : float
        Residual sum of squares, by a fresh QR of the original data [unit of y squared].
    proven : bool
        True: no other set of this size (but those ranked before it) has so small a sum, rounding considered.
    bound : float
        No other set of this size (but those ranked before it) can have a smaller sum than this, which is below `rss`
        where nothing is proven.
    """

    columns: tuple[int, ...]
    rss: float
    proven: bool
    bound: float


@dataclass(frozen=True)
class Subsets:
    """Answer of `best_subsets`.

    Parameters
    ----------
    ranked : tuple of tuple of Subset
        Per size from 1 on, the best first; empty if none was found before the search was stopped.
    n_columns : int
        Number of columns of X.
    left_out : tuple of int
        Columns that were not searched: constant ones, and copies of a column before (up to a factor and a shift).
    rank : int
        Rank of the others; there are no larger sets.
    total : float
        Sum of squares of y, about its mean if there is an intercept.
    full_rss : float
        Residual sum of squares on all columns.
    n_rows : int
    intercept : bool
    route : {'dropping', 'adding'}
        Search method.
    nodes : int
        Sets looked at.
    possible : float
        Sets there are, of the sizes asked for.
    stopped : {'', 'nodes', 'seconds', 'interrupted'}
        Reason why the search ended early.
    """

    ranked: tuple[tuple[Subset, ...], ...]
    n_columns: int
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
        """The best set of every size that was found, in rising order of size."""
        return tuple(sets[0] for sets in self.ranked if sets)

    @property
    def proven(self) -> bool:
        """True if all of `best` are proven."""
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

    Two routes. *Dropping*, for all sizes: branch and bound over the sets that are left when columns leave the full one
    (Furnival and Wilson 1974; Gatu and Kontoghiorghes 2006), the dearest kept first, pruned by the best sum known for
    each size. *Adding*, for small sizes of many columns: all sets, the last two columns entering in closed form. The
    cheaper one is taken.

    Rounding: the searches prune with a margin, the most by which rounding can have moved a residual norm, in the search
    and in the factorisation: for each column what rounding leaves of it (`Triangle.noise`) times its coefficient in the
    full model and the most by which this can differ in a set as good as the best. All sets within the margin are kept
    and refitted by a fresh QR of the original data, in extended precision where that matters; that decides. A set is
    proven if the search came to its end, no set within the margin was lost, and one unit in the last place of every
    number cannot make another as good.

    Constant columns are left out, and so are columns that are a copy of one before (up to a factor and a shift) as far
    as rounding lets see. Unless such a copy is equal to the last bit, nothing is proven: it might have been better.
    Where the others still depend on each other, as they do if there are more than rows, only *adding* is possible, sets
    whose columns depend are no sets of their size, and `max_size` must be given unless there are few.

    Parameters
    ----------
    X : ndarray of shape (n_rows, n_columns)
    y : ndarray of shape (n_rows,)
    intercept : bool
    max_size : int, optional
        Up to this size only.
    n_best : int
        Number of sets of every size.
    jobs : int
        Threads.
    nodes : int, optional
        Stop after about this number of sets.
    seconds : float, optional
        Time limit, approximate [s].
    route : {'dropping', 'adding'}, optional
        Do not choose.
    progress : callable, optional
        Called about once a second with a line of text.

    Returns
    -------
    Subsets
        After a stop (also by KeyboardInterrupt): the best sets so far, and what is proven of them.

    Raises
    ------
    FitError
        No column is left to search.
    InputError
        A setting makes no sense, or the sets cannot be searched that way.
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
    adding = possible * 1.5e-9  # [s], as is the next line; both by trial
    way: Route = route or ("adding" if problem.rank < p or adding < 2.5e-7 * 2 ** (0.47 * p) else "dropping")
    if problem.rank < p and (way == "dropping" or (max_size is None and adding > 10)):
        raise InputError(
            f"best subsets: {p} columns of rank {problem.rank} cannot be searched by dropping; give a small max_size"
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
            # what one unit in the last place of every number can do to the residual
            blur = float(fresh.last_place[:-1] @ np.abs(found.coefficients)) + problem.y_noise
            fitted.append((found.rss, where, blur))
        beyond, complete = search.safe(size) if len(fitted) < math.comb(p, size) else (math.inf, True)
        ranked.append(_certified(sorted(fitted), n_best, beyond, complete and same))
    return Subsets(
        ranked=tuple(ranked),
        n_columns=X.shape[1],
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
    """Rank the refitted sets; the others have a sum of at least `beyond`, which is firm if the list is `complete`.

    The data are known to their last place only, so sums that this can move past each other are not told apart.
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
    # a later rank is only known if the ones before are
    return tuple(replace(s, proven=all(t.proven for t in found[: i + 1])) for i, s in enumerate(found))


def _moved(rss: float, blur: float) -> float:
    """Return the most by which a change of the residual of norm `blur` moves a residual sum of squares."""
    return 2 * blur * math.sqrt(rss) + blur**2


def _distinct(X: FloatArray, tri: Triangle) -> tuple[list[int], bool]:
    """Return the columns that are neither constant nor a copy of one before, and whether all copies are exact."""
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
