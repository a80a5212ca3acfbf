"""Common part of linear regressions chosen from a path of increasing complexity by cross-validation."""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg

from thermocomp.core.exceptions import InputError
from thermocomp.models.base import CycledRegressor, FloatArray, IntArray
from thermocomp.models.linear import TermRegressor
from thermocomp.models.numerics.leastsquares import Solution, join_columns, triangle

Rule = Literal["one-standard-error", "minimum"]


def scaling(X: FloatArray, *, centred: bool = True) -> tuple[FloatArray, FloatArray]:
    """Return the offset and the scale of each column for a mean square of 1.

    Parameters
    ----------
    X : ndarray of shape (n_rows, n_features)

    Returns
    -------
    centre : ndarray of shape (n_features,)
    scale : ndarray of shape (n_features,)
        inf for a constant column, so that it has no effect after the division.
    """
    centre = X.mean(axis=0) if centred else np.zeros(X.shape[1])
    scale = np.sqrt(np.mean((X - centre) ** 2, axis=0))
    scale[scale <= 1e-12 * np.abs(X).max(axis=0)] = np.inf
    return centre, scale


def choose(rms: FloatArray, rule: Rule) -> tuple[int, int]:
    """Choose a setting by the errors on the left-out folds.

    Parameters
    ----------
    rms : ndarray of shape (n_sets, n_settings, n_folds)
        In each set ordered from the simplest to the most complex setting.
    rule : {'one-standard-error', 'minimum'}
        The smallest mean, or the simplest setting of the same set whose mean is within one standard error of it
        (Breiman et al. 1984).
    """
    if rule not in ("one-standard-error", "minimum"):
        raise InputError(f"rule {rule!r}: expected 'one-standard-error' or 'minimum'")
    mean = rms.mean(axis=2)
    i, j = (int(k) for k in np.unravel_index(np.argmin(mean), mean.shape))
    if rule == "one-standard-error":
        limit = mean[i, j] + rms[i, j].std(ddof=1) / np.sqrt(rms.shape[2])
        j = int(np.argmax(mean[i] <= limit))
    return i, j


@dataclass(kw_only=True, eq=False, repr=False)
class ShrunkRegressor(CycledRegressor, TermRegressor):
    """Linear regression on standardised inputs whose complexity is chosen by cross-validation over thermal cycles.

    Each thermal cycle among the training rows is left out in turn; the whole path of models is fitted to the others and
    predicts the left-out cycle. Constant inputs get the coefficient 0.

    Parameters
    ----------
    rule : {'one-standard-error', 'minimum'}
        Rule for the choice of the complexity.
    fit_intercept : bool
        False: the model returns zero in the reference state.

    Attributes
    ----------
    cv_rms_ : float
        Mean of the RMS values of the left-out cycles with the chosen settings [unit of y].
    chosen_by_ : str
        Description of the cross-validation folds.
    r_squared_, adjusted_r_squared_, standard_error_, n_effective_, condition_ : float
        See `thermocomp.models.linear.TermRegressor`; each non-zero coefficient counts as a parameter.
    dependent_ : tuple of str
        Names of the constant inputs.
    """

    rule: Rule = "one-standard-error"
    fit_intercept: bool = True

    def _fit(self, change: FloatArray, deviation: FloatArray, folds: IntArray) -> None:
        errors = []
        for k in range(int(folds.max()) + 1):
            left_out = folds == k
            weights, intercepts = self._fitted(change[~left_out], deviation[~left_out])
            # residuals are as long in the rows of the triangular factor, of which there are few
            n = int(left_out.sum())
            rows = join_columns(np.column_stack([change[left_out], np.ones(n)]), deviation[left_out])
            *short, ones, measured = triangle(rows, intercept=False).factor.T
            residual = weights @ np.array(short) + intercepts[..., None] * ones - measured
            errors.append(np.sqrt(np.sum(residual**2, axis=2) / n))
        rms = np.stack(errors, axis=-1)
        which, setting = self._choose(rms)
        self.cv_rms_ = float(rms[which, setting].mean())
        weights, intercepts = self._fitted(change, deviation)
        self._note(which, setting)
        self._conclude(change, deviation, weights[which, setting], float(intercepts[which, setting]))

    def _choose(self, rms: FloatArray) -> tuple[int, int]:
        """Return the set and the setting chosen by the errors on the left-out folds; see `choose`."""
        return choose(rms, self.rule)

    @abstractmethod
    def _paths(self, Z: FloatArray, y: FloatArray) -> FloatArray:
        """Return the weights for standardised inputs, (n_sets, n_settings, n_features): see `choose`.

        The numbers of sets and settings must not depend on the rows.
        """

    @abstractmethod
    def _note(self, which: int, setting: int) -> None:
        """Store the chosen settings as attributes."""

    def _fitted(self, X: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return weights (n_sets, n_settings, n_features) and intercepts (n_sets, n_settings) for unscaled inputs."""
        centre, scale = scaling(X, centred=self.fit_intercept)
        mean = float(y.mean()) if self.fit_intercept else 0.0
        weights = self._paths((X - centre) / scale, y - mean) / scale
        return weights, mean - weights @ centre

    def _conclude(self, X: FloatArray, y: FloatArray, weights: FloatArray, intercept: float) -> None:
        centre, scale = scaling(X, centred=self.fit_intercept)
        changing = np.isfinite(scale)
        values = linalg.svdvals((X[:, changing] - centre[changing]) / scale[changing])
        least = float(values.min(initial=np.inf))
        residual = y - X @ weights - intercept
        found = Solution(
            coefficients=weights,
            intercept=intercept,
            dependent=tuple(np.flatnonzero(~changing).tolist()),
            rank=int(np.count_nonzero(weights)),
            condition=float(values.max(initial=0.0)) / least if least > 0 else np.inf,
            residual=residual,
            rss=float(residual @ residual),
        )
        total = float(np.sum((y - (y.mean() if self.fit_intercept else 0.0)) ** 2))
        self._keep(found, self._inputs_alone(), [(i,) for i in range(len(weights))], total)


class PenalisedRegressor(ShrunkRegressor):
    """Linear regression with a penalty on the coefficients; its strength is chosen by cross-validation.

    Attributes
    ----------
    strength_ : float
        Chosen regularization strength.
    """

    strengths: Sequence[float]

    def _note(self, which: int, setting: int) -> None:  # noqa: ARG002 - all sets have the same strengths
        self.strength_ = float(sorted_strengths(self.strengths)[setting])


@dataclass(kw_only=True, eq=False, repr=False)
class ComponentRegressor(ShrunkRegressor):
    """Linear regression on the first components of the inputs, whose number is chosen by cross-validation.

    Parameters
    ----------
    rule : {'one-standard-error', 'minimum'}
        Rule for the choice of the number of components.
    fit_intercept : bool
        False: the model returns zero in the reference state, and the components are computed about zero.
    components : int, optional
        Fixed number of components, or the largest possible number if smaller. Default: chosen by `rule`.
    max_components : int, optional
        Largest number to choose from; default: the number of inputs.

    Attributes
    ----------
    n_components_ : int
        Chosen number.
    """

    components: int | None = None
    max_components: int | None = None

    @abstractmethod
    def _path(self, Z: FloatArray, y: FloatArray, most: int) -> FloatArray:
        """Return the weights for standardised inputs with 1, 2, ... components, (most, n_features)."""

    def _paths(self, Z: FloatArray, y: FloatArray) -> FloatArray:
        path = self._path(Z, y, most_components(self.components or self.max_components, Z.shape[1]))
        return path[None] if self.components is None else path[None, -1:]

    def _note(self, which: int, setting: int) -> None:  # noqa: ARG002 - there is only one set
        self.n_components_ = (
            setting + 1 if self.components is None else most_components(self.components, self.n_features_in_)
        )


def sorted_strengths(strengths: ArrayLike) -> FloatArray:
    """Return regularization strengths in descending order, that is, from the simplest model to the most complex."""
    values = np.atleast_1d(np.asarray(strengths, dtype=np.float64))
    if values.size == 0 or not (values > 0).all() or not np.isfinite(values).all():
        raise InputError(f"strengths {strengths!r}: expected positive numbers")
    return np.sort(values)[::-1]


def most_components(max_components: int | None, n_features: int) -> int:
    """Return the number of components of the most complex model."""
    if max_components is not None and max_components < 1:
        raise InputError(f"max_components {max_components}: expected at least 1, or None for the number of inputs")
    return n_features if max_components is None else min(max_components, n_features)
