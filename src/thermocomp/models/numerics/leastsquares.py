"""Least squares by QR, centred and scaled; and the effective sample size of a time series."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import fft, linalg
from scipy.linalg import lapack

from thermocomp.core.arrays import FloatArray, IntArray

_EPS = float(np.finfo(np.float64).eps)
#: condition number above which a solution is refined
ILL = 1e8


@dataclass(frozen=True)
class Triangle:
    """Triangular factor of the centred table [X y], sufficient for least squares on any subset of the columns.

    Parameters
    ----------
    factor : ndarray of shape (min(n_rows, n_columns + 1), n_columns + 1)
        R of the QR factorisation; the last column belongs to y.
    centre : ndarray of shape (n_columns + 1,)
        Offsets subtracted from the columns: their means, or zeros without an intercept.
    """

    factor: FloatArray
    centre: FloatArray
    n_rows: int
    intercept: bool

    def part(self, columns: Sequence[int]) -> "Triangle":
        """Return the factor of [X[:, columns] y]; it is no longer triangular, but equivalent."""
        which = [*columns, -1]
        return Triangle(self.factor[:, which], self.centre[which], self.n_rows, self.intercept)

    @property
    def norms(self) -> FloatArray:
        """Norms of the centred columns, shape (n_columns + 1,)."""
        return np.asarray(np.linalg.norm(self.factor, axis=0))

    @property
    def total(self) -> float:
        """Sum of squares of y, about its mean if there is an intercept."""
        return float(self.factor[:, -1] @ self.factor[:, -1])

    @property
    def last_place(self) -> FloatArray:
        """Norm of one unit in the last place of each column before centring, shape (n_columns + 1,)."""
        return np.asarray(_EPS * np.hypot(self.norms, np.sqrt(self.n_rows) * self.centre))

    @property
    def noise(self) -> FloatArray:
        """Residual that rounding alone may cause in each column, shape (n_columns + 1,).

        64 units in the last place, plus one for each column. A column depends on the columns before it if its remainder
        does not exceed this.
        """
        return np.asarray((64 + self.factor.shape[1]) * self.last_place)

    def find_independent(self) -> IntArray:
        """Return the indices of linearly independent columns before the last, in ascending order."""
        norms, noise = self.norms[:-1], self.noise[:-1]
        alive = np.flatnonzero(norms > noise)
        if alive.size == 0:
            return alive
        R, order = linalg.qr(self.factor[:, alive] / norms[alive], mode="r", pivoting=True)
        order = alive[order[: min(R.shape)]]
        return np.sort(order[np.abs(np.diag(R)) > noise[order] / norms[order]])


def join_columns(X: FloatArray, y: FloatArray) -> FloatArray:
    """Return [X y] in Fortran order, the workspace of `triangle`."""
    out = np.empty((X.shape[0], X.shape[1] + 1), order="F")
    out[:, :-1] = X
    out[:, -1] = y
    return out


def triangle(work: FloatArray, *, intercept: bool) -> Triangle:
    """Factorise [X y] by Householder's QR.

    Parameters
    ----------
    work : ndarray of shape (n_rows, n_columns + 1), Fortran order
        Table from `join_columns`; overwritten.
    """
    n_rows, width = work.shape
    centre = np.zeros(width)
    if intercept:
        centre = work.mean(axis=0)
        work -= centre
    small = min(n_rows, width)
    block = min(max(width // 8, 4), 32, small)  # columns per block; found fastest in tests from 10 to 325 columns
    factor = lapack.dgeqrt(block, work, overwrite_a=1)[0][:small]
    return Triangle(np.triu(factor), centre, n_rows, intercept)


@dataclass(frozen=True)
class Solution:
    """Result of `lstsq`.

    Parameters
    ----------
    coefficients : ndarray of shape (n_columns,)
        Zero for dependent columns.
    dependent : tuple of int
        Columns left out because they depend linearly on the constant and on the others.
    rank : int
        Number of columns kept.
    condition : float
        Condition number of the kept columns, centred and scaled to equal norms; 1 if there are none.
    residual : ndarray of shape (n_rows,)
    rss : float
        Residual sum of squares.
    """

    coefficients: FloatArray
    intercept: float
    dependent: tuple[int, ...]
    rank: int
    condition: float
    residual: FloatArray
    rss: float


def lstsq(X: FloatArray, y: FloatArray, *, intercept: bool = True) -> Solution:
    """Solve min ||y - intercept - X b|| with the full accuracy of the data.

    QR of the centred and scaled columns (Golub and Van Loan, Matrix Computations, 5.3): 13 correct digits for Longley's
    problem, 9 for Wampler's first three and 7 for Filippelli's (NIST StRD), as accurate as QR in statsmodels. An
    ill-conditioned problem is solved again for its residual; otherwise the last digit would depend on the processor.

    Rule for a numerically rank-deficient X: QR with column pivoting orders the columns by their contribution; a column
    whose remainder does not exceed rounding (`Triangle.noise`) is dependent, has the coefficient 0 and is listed in
    `Solution.dependent`. A constant column depends on the intercept.

    Parameters
    ----------
    X : ndarray of shape (n_rows, n_columns)
        The number of columns may exceed the number of rows.
    y : ndarray of shape (n_rows,)
    """
    found = solve(X, y, triangle(join_columns(X, y), intercept=intercept))
    if found.condition < ILL:
        return found
    more = solve(X, found.residual, triangle(join_columns(X, found.residual), intercept=intercept))
    return replace(
        found,
        coefficients=found.coefficients + more.coefficients,
        intercept=found.intercept + more.intercept,
        residual=more.residual,
        rss=more.rss,
    )


def solve(X: FloatArray, y: FloatArray, tri: Triangle, *, columns: Sequence[int] | None = None) -> Solution:
    """Solve as `lstsq` does, with an existing triangular factor.

    Parameters
    ----------
    X : ndarray of shape (n_rows, n_columns)
    y : ndarray of shape (n_rows,)
    tri : Triangle
        Triangular factor of [X y].
    """
    if columns is not None:
        tri = tri.part(columns)
    places = np.arange(X.shape[1]) if columns is None else np.array(columns, dtype=np.intp)
    kept = tri.find_independent()
    scale = tri.norms[kept]
    both = tri.factor[:, [*kept, -1]]
    both[:, :-1] /= scale
    both = np.asarray(np.linalg.qr(both, mode="r"))
    R, head = both[: kept.size, :-1], both[: kept.size, -1]
    coefficients = np.zeros(len(places))
    if kept.size:
        coefficients[kept] = linalg.solve_triangular(R, head) / scale
    constant = float(tri.centre[-1] - tri.centre[:-1] @ coefficients)
    residual = y - X[:, places] @ coefficients - constant
    return Solution(
        coefficients=coefficients,
        intercept=constant,
        dependent=tuple(sorted(set(range(len(places))) - set(kept.tolist()))),
        rank=int(kept.size),
        condition=float(np.linalg.cond(R)) if kept.size else 1.0,
        residual=residual,
        rss=float(residual @ residual),
    )


def effective_sample_size(residual: FloatArray) -> float:
    """Return the effective sample size of a time series: the equivalent number of independent rows (E-C12).

    n / (1 + 2 sum of the autocorrelations), summed over the lags before the first autocorrelation that is not positive;
    at least 1 and at most n. Boundaries between consecutive tests are ignored.

    Parameters
    ----------
    residual : ndarray of shape (n_rows,)
        Residual in chronological order.
    """
    n_rows = len(residual)
    centred = residual - residual.mean()
    size = fft.next_fast_len(2 * n_rows, real=True)
    covariance = fft.irfft(np.abs(fft.rfft(centred, size)) ** 2, size)[:n_rows]
    if not covariance[0] > 0:
        return float(n_rows)
    ended = np.flatnonzero(covariance <= 0)
    until = int(ended[0]) if ended.size else n_rows
    share = float(covariance[1:until].sum() / covariance[0])
    return max(1.0, n_rows / (1 + 2 * share))
