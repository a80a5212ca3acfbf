"""`ridge`: ridge regression on all inputs."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from sklearn.linear_model import ridge_regression

from thermocomp.models.base import FloatArray
from thermocomp.models.dynamic import STRENGTHS
from thermocomp.models.shrinkage import PenalisedRegressor, sorted_strengths


@dataclass(kw_only=True, eq=False, repr=False)
class Ridge(PenalisedRegressor):
    """Ridge regression (Hoerl and Kennard 1970) on standardised inputs: `dynamic` without memory.

    Uses scikit-learn's `ridge_regression` by singular values; the regularization strength is chosen by cross-validation
    over thermal cycles.

    Parameters
    ----------
    rule : {'one-standard-error', 'minimum'}
        Rule for the choice of the regularization strength.
    fit_intercept : bool
        False: the model returns zero in the reference state.
    strengths : sequence of float
        Regularization strengths to choose from, per row and relative to each input's variance.

    Attributes
    ----------
    strength_ : float
        Chosen regularization strength.
    cv_rms_, chosen_by_ : float, str
        See `thermocomp.models.shrinkage.ShrunkRegressor`.

    References
    ----------
    Hoerl, A. E., Kennard, R. W.: Ridge regression: biased estimation for nonorthogonal problems. Technometrics 12(1),
    1970, 55-67. doi:10.1080/00401706.1970.10488634

    Breiman, L., Friedman, J. H., Olshen, R. A., Stone, C. J.: Classification and Regression Trees. Wadsworth, 1984
    (the one-standard-error rule).

    Liu, H., Miao, E. M., Wei, X. Y., et al.: Robust modeling method for thermal error of CNC machine tools based on
    ridge regression algorithm. International Journal of Machine Tools and Manufacture 113, 2017, 35-48.

    Examples
    --------
    >>> import numpy as np
    >>> from thermocomp import Ridge
    >>> rng = np.random.default_rng(0)
    >>> rise = rng.uniform(0, 10, 200)
    >>> rises = rise[:, None] + 0.01 * rng.normal(size=(200, 2))  # two sensors at one place [degC]
    >>> model = Ridge().fit(rises, 4 * rise + rng.normal(size=200))
    >>> print(model.coef_.round(1).tolist(), f"{model.cv_rms_:.1f} um")
    [2.0, 2.0] 1.0 um
    """

    strengths: Sequence[float] = STRENGTHS

    def _paths(self, Z: FloatArray, y: FloatArray) -> FloatArray:
        strengths = sorted_strengths(self.strengths)
        copies = np.repeat(y[:, None], strengths.size, axis=1)
        weights: FloatArray = ridge_regression(Z, copies, alpha=len(y) * strengths, solver="svd")
        return weights.reshape(1, strengths.size, -1)
