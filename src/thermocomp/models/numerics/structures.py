"""Ridge regressions on random selections of features, and their average, weighted by errors on left-out parts."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from thermocomp.core.arrays import FloatArray, IntArray

#: weight of a regression in the average: its RMS error (geometric mean over left-out parts) to minus this power
TRUST = 3.0


@dataclass(frozen=True)
class LagStructure:
    """One selection of features with their ridge penalties.

    Parameters
    ----------
    columns : ndarray of int of shape (n_chosen,)
    strengths : ndarray of shape (n_chosen,)
        Ridge penalties relative to each feature's mean square.
    """

    columns: IntArray
    strengths: FloatArray


@dataclass(frozen=True)
class Moments:
    """Moments of the rows for ridge regressions and their errors.

    Parameters
    ----------
    gram : ndarray of shape (n_parts, n_features, n_features)
        Sums of products of the features with each other, for each part that is left out as a whole.
    cross : ndarray of shape (n_parts, n_features, n_targets)
        Sums of products of the features with the targets.
    power : ndarray of shape (n_parts, n_targets)
        Sums of squares of the targets.
    rows : ndarray of shape (n_parts,)
    noise : ndarray of shape (n_features, n_features)
        Covariance of the features due to noise of the sensors in use.
    """

    gram: FloatArray
    cross: FloatArray
    power: FloatArray
    rows: FloatArray
    noise: FloatArray

    def error(self, part: int, weights: FloatArray) -> FloatArray:
        """Return the mean square error, (..., n_targets), of weights (..., n_features, n_targets) on a part."""
        squares = ((self.gram[part] @ weights - 2 * self.cross[part]) * weights).sum(axis=-2) + self.power[part]
        return np.asarray(np.maximum(squares, 0.0) / self.rows[part])


def average(moments: Moments, structures: Sequence[LagStructure]) -> tuple[FloatArray, FloatArray]:
    """Return the weights of the features, averaged over regressions, and the error of the average on left-out parts.

    Returns
    -------
    weights : ndarray of shape (n_features, n_targets)
    errors : ndarray of shape (n_parts, n_targets)
        Root mean square error on each left-out part; nan if there is only one part.
    """
    shares, errors = share_out(moments, structures)
    return (shares[:, None] * fit_each(moments, structures, range(len(moments.rows)))).sum(axis=0), errors


def fit_each(moments: Moments, structures: Sequence[LagStructure], parts: Iterable[int]) -> FloatArray:
    """Return the weights of the features in each regression, fitted to the given parts.

    Parameters
    ----------
    parts : iterable of int
        Without any part, the weights are nan.

    Returns
    -------
    ndarray of shape (n_structures, n_features, n_targets)
    """
    weights: FloatArray = _fit_all(moments, structures, [list(parts)])[0]
    return weights


def _fit_all(moments: Moments, structures: Sequence[LagStructure], groups: Sequence[Sequence[int]]) -> FloatArray:
    """Return the weights fitted to each group of parts, (n_groups, n_structures, n_features, n_targets)."""
    weights = np.full((len(groups), len(structures), *moments.cross.shape[1:]), np.nan)
    filled = [k for k, group in enumerate(groups) if group]
    if not filled:
        return weights
    weights[filled] = 0.0
    n = [moments.rows[groups[k]].sum() for k in filled]
    gram = np.array([moments.gram[groups[k]].sum(axis=0) / m for k, m in zip(filled, n, strict=True)])
    cross = np.array([moments.cross[groups[k]].sum(axis=0) / m for k, m in zip(filled, n, strict=True)])
    noisy, own = (gram + moments.noise).reshape(len(filled), -1), gram.diagonal(axis1=1, axis2=2)
    of_size: dict[int, list[int]] = {}
    for k, structure in enumerate(structures):
        of_size.setdefault(len(structure.columns), []).append(k)
    for size, places in of_size.items():  # as many small systems at once as there are of a size
        columns, every = np.array([structures[k].columns for k in places]), np.arange(size)
        systems = noisy.take(columns[:, :, None] * gram.shape[1] + columns[:, None, :], axis=1)
        squares = own[:, columns]
        # a feature that is zero in all rows keeps the weight zero
        strengths = np.array([structures[k].strengths for k in places])
        systems[..., every, every] += np.where(squares > 0, strengths * squares, 1.0)
        scale = 1.0 / np.sqrt(systems[..., every, every])  # powers of a speed may be of another size altogether
        systems *= scale[..., :, None] * scale[..., None, :]
        solved = np.linalg.solve(systems, scale[..., None] * cross[:, columns])
        weights[np.array(filled)[:, None, None], np.array(places)[:, None], columns] = scale[..., None] * solved
    return weights


def share_out(moments: Moments, structures: Sequence[LagStructure]) -> tuple[FloatArray, FloatArray]:
    """Return the shares of regressions in their average, (n_structures, n_targets), and the errors as `average` does.

    Each part is left out in turn. The share of a regression decreases with its error on left-out parts, see `TRUST`.
    """
    n_parts, n_targets = len(moments.rows), moments.cross.shape[2]
    shares = np.full((len(structures), n_targets), 1 / len(structures))
    if n_parts == 1:
        return shares, np.full((1, n_targets), np.nan)
    fitted = _fit_all(moments, structures, [[p for p in range(n_parts) if p != k] for k in range(n_parts)])
    own = np.array([moments.error(k, weights) for k, weights in enumerate(fitted)])
    own = np.log(np.maximum(own, np.finfo(np.float64).tiny)).mean(axis=0)
    shares = np.exp(TRUST / 2 * (own.min(axis=0) - own))
    shares /= shares.sum(axis=0)
    means = (shares[:, None] * fitted).sum(axis=1)
    return shares, np.sqrt([moments.error(k, weights) for k, weights in enumerate(means)])
