"""Ridge regressions on random choices of features, and the average of them that errs least on what was left out."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


@dataclass(frozen=True)
class Structure:
    """One choice of features, and how strongly each is shrunk.

    Parameters
    ----------
    columns : ndarray of int of shape (n_chosen,)
    strengths : ndarray of shape (n_chosen,)
        In units of each feature's mean square.
    """

    columns: IntArray
    strengths: FloatArray


@dataclass(frozen=True)
class Moments:
    """All that ridge regressions and their errors need to know of the rows.

    Parameters
    ----------
    products : ndarray of shape (n_parts, n_features + 1, n_features + 1)
        Sums of products of [features, y], by the part that is left out together.
    rows : ndarray of shape (n_parts,)
    noise : ndarray of shape (n_features, n_features)
        Covariance of the features by the noise of the sensors in use.
    """

    products: FloatArray
    rows: FloatArray
    noise: FloatArray

    def solve(self, structure: Structure, parts: Sequence[int]) -> FloatArray:
        """Return the weights of a structure's features, fitted to some of the parts."""
        columns, n = structure.columns, self.rows[parts].sum()
        total = self.products[parts].sum(axis=0)
        gram = total[np.ix_(columns, columns)] / n
        squares = np.diag(gram).copy()
        gram += self.noise[np.ix_(columns, columns)]
        # a feature that is zero in all rows keeps the weight zero
        gram[np.diag_indices(len(columns))] += np.where(squares > 0, structure.strengths * squares, 1.0)
        return np.linalg.solve(gram, total[columns, -1] / n)


def average(moments: Moments, structures: Sequence[Structure], evenness: float) -> tuple[FloatArray, float]:
    """Return the weights of the features, averaged over structures, and the error on what was left out.

    Each part is left out in turn. The shares of the structures are not negative and sum to one; among such shares those
    are taken that have the smallest mean square error on the left-out parts, pulled towards equal shares (stacking,
    Breiman 1996; the pull is that of a ridge).

    Parameters
    ----------
    moments : Moments
    structures : sequence of Structure
    evenness : float
        How strong the pull is, in units of the error of equal shares.

    Returns
    -------
    weights : ndarray of shape (n_features,)
    error : float
        Root of the mean over the parts of their mean square error; nan if there is one part.
    """
    n_parts, count = len(moments.rows), len(structures)
    everything = list(range(n_parts))
    shares, error = np.full(count, 1 / count), float("nan")
    if n_parts > 1:
        square, cross, power = _left_out(moments, structures)
        pull = evenness**2 * max(shares @ square @ shares - 2 * cross @ shares + power, 0.0)
        # the sum is one: a heavy row of ones
        heavy = 1e3 * max(float(np.trace(square)) / count, np.finfo(np.float64).tiny)
        normal = square + heavy + (count * pull + 1e-12 * np.trace(square) / count + heavy * 1e-12) * np.eye(count)
        root = np.linalg.cholesky(normal)
        shares, _ = nnls(root.T, np.linalg.solve(root, cross + pull + heavy), maxiter=50 * count)
        shares /= shares.sum()
        error = float(np.sqrt(max(shares @ square @ shares - 2 * cross @ shares + power, 0.0)))
    weights = np.zeros(moments.products.shape[1] - 1)
    for structure, share in zip(structures, shares.tolist(), strict=True):
        if share > 0:
            weights[structure.columns] += share * moments.solve(structure, everything)
    return weights, error


def _left_out(moments: Moments, structures: Sequence[Structure]) -> tuple[FloatArray, FloatArray, float]:
    """Return the mean products of left-out predictions with each other, with y, and of y with itself."""
    n_parts, count = len(moments.rows), len(structures)
    square, cross, power = np.zeros((count, count)), np.zeros(count), 0.0
    for k in range(n_parts):
        rest = [p for p in range(n_parts) if p != k]
        fitted = np.zeros((count, moments.products.shape[1] - 1))
        for row, structure in zip(fitted, structures, strict=True):
            row[structure.columns] = moments.solve(structure, rest)
        own = moments.products[k] / moments.rows[k] / n_parts
        square += fitted @ own[:-1, :-1] @ fitted.T
        cross += fitted @ own[:-1, -1]
        power += float(own[-1, -1])
    return square, cross, power
