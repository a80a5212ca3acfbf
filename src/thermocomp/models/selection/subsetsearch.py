"""The two searches of `best_subsets`: search problem, margins for rounding, and the part of one thread."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg
from scipy.linalg import lapack

from thermocomp.core.arrays import FloatArray
from thermocomp.models.numerics.leastsquares import Triangle

_SPARE = 7  # additional sets kept per size: those that rounding could make the best
_MOST = 0.05  # larger margins, as a share of a sum of squares, are cut and nothing is proven: bounds the work
_SEARCH = 1e-9  # relative error of a sum of squares due to the searches themselves: see GUARD and LEFT
_LANES = 8  # SIMD width


@dataclass(frozen=True)
class Problem:
    """Search problem.

    Parameters
    ----------
    triangle : ndarray of shape (n, p + 1)
        Triangular factor of the columns, scaled to norm 1, and of y.
    least : ndarray of shape (p,)
        Norm of the remainder of each column that rounding alone may cause.
    full_rss : float
        Residual sum of squares on all columns.
    margin : ndarray of shape (4,)
        For a residual norm: a constant; a factor of the root of (rss - full_rss); `full_rss`; the maximum share.
    y_noise : float
        Norm of the remainder of y that rounding alone may cause.
    """

    triangle: FloatArray
    least: FloatArray
    rank: int
    full_rss: float
    margin: FloatArray
    y_noise: float

    @classmethod
    def of(cls, tri: Triangle, columns: Sequence[int]) -> "Problem":
        """Create the problem for selected columns of a triangular factor."""
        p = len(columns)
        which = [*columns, -1]
        norms, noise = tri.norms[which], tri.noise[which]
        both = tri.factor[:, which]
        both[:, :-1] /= norms[:-1]
        if p + 1 < len(tri.centre):
            both = np.asarray(np.linalg.qr(both, mode="r"))
        least, y_noise = noise[:-1] / norms[:-1], float(noise[-1])
        if not norms[-1] > y_noise:
            both[:, -1] = 0.0  # y is constant
        pivoted, order = linalg.qr(both[:, :-1], mode="r", pivoting=True)
        small = min(pivoted.shape)
        rank = int(np.sum(np.abs(np.diag(pivoted)) > least[order[:small]]))
        size = float(np.linalg.norm(both[:, -1]))
        if rank == p:
            inverse = lapack.dtrtri(both[:p, :p])[0]
            b = linalg.solve_triangular(both[:p, :p], both[:p, -1])
            full = float(np.sum(both[p:, -1] ** 2))
            constant = y_noise + float(least @ np.abs(b))
            slope = float(least @ np.linalg.norm(inverse, axis=1))
        else:
            some = both[:, order[:rank]]
            head = np.linalg.qr(some)[0].T @ both[:, -1]
            full = max(float(both[:, -1] @ both[:, -1] - head @ head), 0.0)
            # sets without QR have column remainders of at least the root of LEFT: coefficients up to its inverse
            constant, slope = y_noise + float(least.max()) * 1e4 * size, 0.0
        margin = np.array([constant + 1e-12 * size, slope + _SEARCH, full, _MOST])
        return cls(both, least, rank, full, margin, y_noise)

    def error(self, rss: float) -> float:
        """Return the maximum effect of rounding on the residual norm of a set as good as `rss`."""
        return float(self.margin[0] + self.margin[1] * np.sqrt(max(rss - self.full_rss, 0.0)))


class Search:
    """One thread's part of a search: its working data, and the best sets it found; initially without branches.

    Parameters
    ----------
    sizes : int
        Largest size searched.
    n_best : int
        Number of sets requested of each size.
    limit : ndarray of shape (p + 1,)
        Sum of squares above which a set is of no interest, per size; shared by all threads, decreasing.
    bound : ndarray of shape (p + 1,)
        The same limit for whole branches.
    """

    chunk = 200_000  # sets between two checks of the clock: well below 0.1 s

    def __init__(self, problem: Problem, sizes: int, n_best: int, limit: FloatArray, bound: FloatArray) -> None:
        self.problem = problem
        p = problem.triangle.shape[1] - 1
        keep = n_best + _SPARE
        self.inside = np.ones(p, dtype=np.uint8)
        self.values = np.full((p + 1, keep), np.inf)
        self.contents = np.zeros((p + 1, keep, p), dtype=np.uint8)
        self.lost = np.full(p + 1, np.inf)
        wanted = np.ones(p + 1, dtype=np.int64)
        ways = 1.0
        for size in range(sizes + 1):
            wanted[size] = min(n_best, int(min(ways, n_best)))
            ways = ways * (p - size) / (size + 1)
        self.lists = (self.values, self.contents, self.lost, limit, bound, wanted, problem.margin)
        self.tasks = 0

    def start(self, first: int, last: int) -> None:
        """Set the branches of the root to search, from `first` up to but excluding `last`."""

    def go_on(self, budget: int) -> int:  # noqa: ARG002
        """Examine about `budget` sets and return their number; 0 if there are no more."""
        return 0

    def open_from(self) -> FloatArray:
        """Return a lower bound of the sums of squares of the unexamined sets of each size, shape (p + 1,)."""
        return np.full(len(self.inside) + 1, np.inf)

    def columns(self, flags: NDArray[np.uint8]) -> tuple[int, ...]:
        """Return the indices of the columns of a set."""
        return tuple(np.flatnonzero(flags).tolist())


class Swapping(Search):
    """Fast search for good initial sets by exchanging columns, without branches."""

    def __init__(self, problem: Problem, sizes: int, n_best: int, limit: FloatArray, bound: FloatArray) -> None:
        super().__init__(problem, sizes, n_best, limit, bound)
        from thermocomp.models.kernels.dropping import list_good_sets

        list_good_sets(problem.triangle, problem.least, self.lists, self.inside, sizes)


class Dropping(Search):
    """Branch and bound over the sets that remain when columns are removed from the full set."""

    def __init__(self, problem: Problem, sizes: int, n_best: int, limit: FloatArray, bound: FloatArray) -> None:
        super().__init__(problem, sizes, n_best, limit, bound)
        from thermocomp.models.kernels import dropping

        p = len(self.inside)
        width = -(-p // _LANES) * _LANES
        self._orders = np.zeros((3, p + 1, width), dtype=np.int64)
        self._numbers = np.zeros((8, p + 1), dtype=np.int64)
        self._work, self._rss = np.zeros((6, p + 1, width)), np.zeros(p + 1)
        moments, triangles = np.empty((p + 1, width, width)), np.empty((p + 1, p + 1, p))
        self._state = (self._work, moments, triangles, self._orders, self._numbers, self._rss)
        self._drop = dropping.drop
        dropping.begin(problem.triangle[:p], self._state, self.lists, self.inside, problem.full_rss)
        self.tasks = p - 1

    def start(self, first: int, last: int) -> None:
        """Set the branches of the root to search, from `first` up to but excluding `last`."""
        self._orders[1, 0, : last - first] = range(first, last)
        self._numbers[2, 0] = last - first

    def go_on(self, budget: int) -> int:
        """Examine about `budget` sets and return their number; 0 if there are no more."""
        return int(self._drop(self._state, self.lists, self.inside, budget))

    def open_from(self) -> FloatArray:
        """Return a lower bound of the sums of squares of the unexamined sets of each size."""
        least = np.full(len(self.inside) + 1, np.inf)
        many, sizes, left = self._numbers[:3]
        for d in range(int(self._numbers[5, 0]) + 1):
            for j in self._orders[1, d, : left[d]]:
                high = int(sizes[d]) - 1  # of the branch; its own set has been examined
                low = max(high - (int(many[d]) - 1 - int(j)), 1)
                least[low:high] = np.minimum(least[low:high], self._rss[d] + self._work[4, d, j])
        return least


class Adding(Search):
    """Enumeration of all sets up to a given size."""

    chunk = 4_000_000

    def __init__(self, problem: Problem, sizes: int, n_best: int, limit: FloatArray, bound: FloatArray) -> None:
        super().__init__(problem, sizes, n_best, limit, bound)
        from thermocomp.models.kernels.adding import add

        p = len(self.inside)
        self._order = _promising(problem, sizes)
        self._columns = np.ascontiguousarray(problem.triangle[:, [*self._order, -1]].T)
        # if all columns together are independent, the columns of every set are
        self._least = problem.least[self._order] if problem.rank < p else np.zeros(p)
        levels = max(sizes - 1, 1)
        self._numbers = np.zeros((3, levels), dtype=np.int64)
        G, D, h, sums = np.zeros((levels, p, p)), np.ones((levels, p)), np.zeros((levels, p)), np.zeros((3, levels))
        G[0], h[0] = self._columns[:p] @ self._columns[:p].T, self._columns[:p] @ self._columns[p]
        sums[:2, 0] = self._columns[p] @ self._columns[p]
        self._state = (G, D, h, sums, np.zeros(sizes, dtype=np.int64), self._numbers)
        self._sizes = sizes
        self._add = add
        self.tasks = p

    def start(self, first: int, last: int) -> None:
        """Set the branches of the root to search, from `first` up to but excluding `last`."""
        self._numbers[1:, 0] = first, last - 1

    def go_on(self, budget: int) -> int:
        """Examine about `budget` sets and return their number; 0 if there are no more."""
        return int(self._add(self._columns, self._least, self._state, self.lists, self.inside, self._sizes, budget))

    def open_from(self) -> FloatArray:
        """Return a lower bound of the sums of squares of the unexamined sets of each size."""
        over = self._numbers[0, 0] == 0 and self._numbers[1, 0] > self._numbers[2, 0]
        return np.full(len(self.inside) + 1, np.inf if over else self.problem.full_rss)

    def columns(self, flags: NDArray[np.uint8]) -> tuple[int, ...]:
        """Return the indices of the columns of a set."""
        return tuple(sorted(self._order[i] for i in np.flatnonzero(flags)))


def _promising(problem: Problem, sizes: int) -> list[int]:
    """Return the columns in the order of forward selection, to find good sets early, but nearly equal columns first.

    Of two nearly equal columns, the second has almost no remainder once the first is in the set; this must not occur
    among the last two columns, which enter in closed form.
    """
    rest = problem.triangle[:, :-1].copy()
    y = problem.triangle[:, -1].copy()
    near = np.abs(np.triu(rest.T @ rest, 1)) > 1 - 1e-7
    front = [int(k) for k in np.flatnonzero(near.any(axis=0) | near.any(axis=1))]
    order: list[int] = []
    for _ in range(sizes):
        squares = np.einsum("ij,ij->j", rest, rest)
        gains = np.where(squares > 1e-8, (y @ rest) ** 2 / np.maximum(squares, 1e-8), -1.0)
        gains[order] = -np.inf
        k = int(gains.argmax())
        q = rest[:, k] / max(np.sqrt(squares[k]), 1e-4)
        order.append(k)
        rest -= np.outer(q, q @ rest)
        y -= q * (q @ y)
    order += [k for k in range(rest.shape[1]) if k not in order]
    return front + [k for k in order if k not in front]
