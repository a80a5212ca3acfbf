"""Collinearity of variables, their correlation with the error (Hwang, section 3.2.3), and screening by both (Chen)."""

from dataclasses import dataclass

import numpy as np

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.exceptions import FitError

#: a channel that varies by no more than this share of its magnitude is constant: rounding may cause such a variation
ROUNDING = 64 * float(np.finfo(np.float64).eps)


@dataclass(frozen=True)
class Spectrum:
    """Eigenvalues of X'X with unmodified columns, neither centred nor scaled.

    Hwang's Eq. 7 has p + 1 of them, but Table 3 only p: Hwang omitted the column of ones, as is done here (E-H6).

    Parameters
    ----------
    eigenvalues : tuple of float
        Eigenvalues in descending order [degC^2]; 0 if indistinguishable from 0.
    """

    eigenvalues: tuple[float, ...]

    @property
    def smallest(self) -> float:
        """Smallest eigenvalue [degC^2]; nan if there are none."""
        return self.eigenvalues[-1] if self.eigenvalues else float("nan")

    @property
    def sum_inverse(self) -> float:
        """Sum of 1/eigenvalue [1/degC^2]; multiplied by sigma^2: sum of the coefficient variances (Eq. 7, H-14)."""
        return sum(1 / v if v > 0 else float("inf") for v in self.eigenvalues)

    @property
    def condition_number(self) -> float:
        """Ratio of the largest to the smallest eigenvalue (H-16); nan if there are none."""
        if not self.eigenvalues:
            return float("nan")
        return self.eigenvalues[0] / self.smallest if self.smallest > 0 else float("inf")


def spectrum(X: FloatArray) -> Spectrum:
    """Return the eigenvalues of X'X.

    They are squared singular values, not computed from X'X itself, which would lose half the digits.

    Parameters
    ----------
    X : ndarray of shape (n_rows, n_columns)
        Table, or any matrix with the same X'X, such as a triangular factor.
    """
    if X.shape[1] == 0:
        return Spectrum(())
    singular = np.linalg.svd(X, compute_uv=False)
    singular = np.append(singular, np.zeros(X.shape[1] - len(singular)))
    singular[singular <= ROUNDING * singular[0]] = 0.0
    return Spectrum(tuple((singular**2).tolist()))


def find_varying(X: FloatArray, size: FloatArray | None = None) -> BoolArray:
    """Return a mask of the columns that are not constant.

    Parameters
    ----------
    X : ndarray of shape (n_rows, n_columns)
    size : ndarray of shape (n_columns,), optional
        Greatest magnitude of the numbers from which X was computed; default: that of X itself.

    Returns
    -------
    ndarray of bool of shape (n_columns,)
    """
    largest = np.abs(X).max(axis=0) if size is None else size
    return np.asarray(np.ptp(X, axis=0) > ROUNDING * largest)


def correlation(X: FloatArray) -> FloatArray:
    """Return the correlation coefficients of the columns (Hwang, Eq. 1; H-02).

    C_ij = Z_i' Z_j, where Z is the column minus its mean, scaled to length 1, so C is Pearson's r. It is rounded to 12
    decimals so that equal channels have equal coefficients, regardless of the order of summation.

    Parameters
    ----------
    X : ndarray of shape (n_rows, n_columns)

    Returns
    -------
    ndarray of shape (n_columns, n_columns)
        Symmetric, with ones on the diagonal.
    """
    constant = np.flatnonzero(~find_varying(X))
    if constant.size:
        raise FitError(f"column {constant[0]} is constant and has no correlation with the others: leave it out")
    Z = X - X.mean(axis=0)
    Z /= np.linalg.norm(Z, axis=0)
    C = np.clip(np.round(Z.T @ Z, 12), -1.0, 1.0)
    C = np.triu(C, 1)
    return np.asarray(C + C.T + np.eye(X.shape[1]))


def contributions(X: FloatArray, y: FloatArray) -> FloatArray:
    """Return the correlation of each column with the error (Hwang, Eq. 9; H-17).

    Parameters
    ----------
    X : ndarray of shape (n_rows, n_columns)
    y : ndarray of shape (n_rows,)

    Returns
    -------
    ndarray of shape (n_columns,)
        nan for a constant column, and for all columns if y is constant.
    """
    both = np.column_stack([X, y])
    moves = find_varying(both)
    found = np.full(X.shape[1], np.nan)
    if moves[-1]:
        found[moves[:-1]] = correlation(both[:, moves])[-1, :-1]
    return found


@dataclass(frozen=True, eq=False)
class Screening:
    """Result of `screen`.

    Parameters
    ----------
    relevance : ndarray of shape (n_columns, n_errors)
        Correlation of each column with each error; nan if one of them is constant.
    likeness : ndarray of shape (n_columns, n_columns)
        Correlations of the columns with each other; 0 for a constant column, except with itself.
    kept : tuple of int
        Columns in the order in which they were kept.
    """

    relevance: FloatArray
    likeness: FloatArray
    kept: tuple[int, ...]

    @property
    def strongest(self) -> tuple[int, ...]:
        """Columns by their largest correlation with an error, in descending order of its magnitude."""
        largest = np.abs(np.nan_to_num(self.relevance)).max(axis=1)
        return tuple(np.argsort(-largest, kind="stable").tolist())

    @property
    def order(self) -> tuple[int, ...]:
        """Columns kept, in this order, then the others by their correlation with the errors."""
        return (*self.kept, *(j for j in self.strongest if j not in self.kept))

    def nearest(self, column: int) -> int | None:
        """Return the column most correlated with a column, among those kept (before it); None if there are none."""
        before = self.kept[: self.kept.index(column)] if column in self.kept else self.kept
        return max(before, key=lambda i: abs(float(self.likeness[i, column])), default=None)


def screen(X: FloatArray, Y: FloatArray, number: int) -> Screening:
    """Screen variables by their correlation with the errors and with each other (Chen, section 3.1; C-11).

    Chen's rule is not known: the variables left "had strong correlations" with the errors, and "highly intercorrelated"
    ones are said to cause round-off. Here each step keeps the variable with the largest r^2 (1 - s^2), where r is its
    strongest correlation with any of the errors, and s that with any variable kept before: the share of an error that
    it explains, times the share of its variance that is new. Of equal ones, the first is kept.

    Parameters
    ----------
    X : ndarray of shape (n_rows, n_columns)
    Y : ndarray of shape (n_rows, n_errors)
    number : int
        Number of variables to keep. Fewer are kept if all others are constant, uncorrelated with every error, or copies
        of those kept.
    """
    relevance = np.column_stack([contributions(X, y) for y in Y.T])
    moves = np.flatnonzero(find_varying(X))
    likeness = np.eye(X.shape[1])
    if moves.size:
        likeness[np.ix_(moves, moves)] = correlation(X[:, moves])
    explained = np.nan_to_num(relevance**2).max(axis=1)
    new = np.ones(X.shape[1])
    kept: list[int] = []
    while len(kept) < number and (gain := explained * new).max() > 0:
        kept.append(int(np.argmax(gain)))
        new = np.minimum(new, 1 - likeness[kept[-1]] ** 2)
    return Screening(relevance, likeness, tuple(kept))
