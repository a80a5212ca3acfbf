"""`lasso` and `elastic-net`: regressions with built-in input selection."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.linear_model import enet_path

from thermocomp.core.exceptions import InputError
from thermocomp.models.base import FloatArray
from thermocomp.models.shrinkage import PenalisedRegressor, sorted_strengths

#: regularization strengths to choose from, relative to that at which the last input is dropped
SHARES: tuple[float, ...] = tuple(float(10.0 ** (-k / 10)) for k in range(41))
_TOL, _SWEEPS = 1e-5, 5_000  # dual gap as a share of the sum of squares of y; changing either has no visible effect


@dataclass(kw_only=True, eq=False, repr=False)
class Lasso(PenalisedRegressor):
    """Lasso (Tibshirani 1996) on standardised inputs: selector and regression in one.

    Uses scikit-learn's coordinate descent along the whole path; the regularization strength is chosen by
    cross-validation over thermal cycles.

    Parameters
    ----------
    rule : {'one-standard-error', 'minimum'}
        Rule for the choice of the regularization strength.
    fit_intercept : bool
        False: the model returns zero in the reference state.
    strengths : sequence of float
        Regularization strengths to choose from, relative to that at which the last input is dropped.

    Attributes
    ----------
    strength_ : float
        Chosen regularization strength.
    selected_ : tuple of str
        Names of the inputs that were not dropped.
    cv_rms_, chosen_by_ : float, str
        See `thermocomp.models.shrinkage.ShrunkRegressor`.

    References
    ----------
    Tibshirani, R.: Regression shrinkage and selection via the lasso. Journal of the Royal Statistical Society B 58(1),
    1996, 267-288. doi:10.1111/j.2517-6161.1996.tb02080.x

    Breiman, L., Friedman, J. H., Olshen, R. A., Stone, C. J.: Classification and Regression Trees. Wadsworth, 1984
    (the one-standard-error rule).

    Examples
    --------
    >>> import numpy as np
    >>> from thermocomp import Lasso
    >>> rng = np.random.default_rng(0)
    >>> rises = rng.uniform(0, 10, (200, 6))  # of six temperatures, two of which matter [degC]
    >>> model = Lasso().fit(rises, 5 * rises[:, 1] - 3 * rises[:, 4] + rng.normal(size=200))
    >>> print(model.selected_, model.coef_.round(1)[[1, 4]].tolist())
    ('x1', 'x4') [4.9, -2.9]
    """

    strengths: Sequence[float] = SHARES

    def _ratios(self) -> tuple[float, ...]:
        """Return the shares of the absolute-value (L1) term in the penalty."""
        return (1.0,)

    def _paths(self, Z: FloatArray, y: FloatArray) -> FloatArray:
        shares, ratios = sorted_strengths(self.strengths), self._ratios()
        steepest = float(np.abs(y @ Z).max()) / len(y)
        paths = np.zeros((len(ratios), shares.size, Z.shape[1]))
        if steepest == 0:  # y is uncorrelated with all inputs
            return paths
        for path, ratio in zip(paths, ratios, strict=True):
            with warnings.catch_warnings():
                # a strength too small for convergence is assessed on the left-out cycles like any other
                warnings.simplefilter("ignore", ConvergenceWarning)
                path[:] = enet_path(
                    Z, y, l1_ratio=ratio, alphas=shares * (steepest / ratio), tol=_TOL, max_iter=_SWEEPS
                )[1].T
        return paths

    def _note(self, which: int, setting: int) -> None:
        super()._note(which, setting)
        self.l1_ratio_ = self._ratios()[which]

    @property
    def selected_(self) -> tuple[str, ...]:
        """Names of the inputs that were not dropped."""
        return tuple(name for name, c in zip(self.terms_, self.coef_, strict=True) if c != 0)


@dataclass(kw_only=True, eq=False, repr=False)
class ElasticNet(Lasso):
    """Elastic net (Zou and Hastie 2005): a lasso that keeps or drops collinear inputs together.

    Uses scikit-learn's coordinate descent along the whole path; the regularization strength and the L1 share are chosen
    by cross-validation over thermal cycles.

    Parameters
    ----------
    rule : {'one-standard-error', 'minimum'}
        Rule for the choice of the regularization strength, with the best L1 share.
    fit_intercept : bool
        False: the model returns zero in the reference state.
    strengths : sequence of float
        Regularization strengths to choose from, relative to that at which the last input is dropped.
    l1_ratios : sequence of float
        L1 shares of the penalty to choose from; the rest of the penalty is quadratic. 1 gives the lasso.

    Attributes
    ----------
    l1_ratio_ : float
        Chosen L1 share.
    strength_ : float
        Chosen regularization strength.
    selected_ : tuple of str
        Names of the inputs that were not dropped.
    cv_rms_, chosen_by_ : float, str
        See `thermocomp.models.shrinkage.ShrunkRegressor`.

    References
    ----------
    Zou, H., Hastie, T.: Regularization and variable selection via the elastic net. Journal of the Royal Statistical
    Society B 67(2), 2005, 301-320. doi:10.1111/j.1467-9868.2005.00503.x

    Breiman, L., Friedman, J. H., Olshen, R. A., Stone, C. J.: Classification and Regression Trees. Wadsworth, 1984
    (the one-standard-error rule).

    Examples
    --------
    >>> import numpy as np
    >>> from thermocomp import ElasticNet
    >>> rng = np.random.default_rng(0)
    >>> rises = rng.uniform(0, 10, (200, 3))[:, [0, 1, 1, 2]]  # two sensors at one place [degC]
    >>> model = ElasticNet(l1_ratios=(0.7,)).fit(rises, 5 * rises[:, 1] + rng.normal(size=200))
    >>> print(model.selected_, model.coef_.round(1)[[1, 2]].tolist())
    ('x1', 'x2') [2.4, 2.4]
    """

    l1_ratios: Sequence[float] = (0.1, 0.5, 0.9)

    def _ratios(self) -> tuple[float, ...]:
        ratios = tuple(float(r) for r in self.l1_ratios)
        if not ratios or not all(0 < r <= 1 for r in ratios):
            raise InputError(f"l1_ratios {self.l1_ratios}: expected numbers above 0 and up to 1")
        return ratios
