"""`ols`: least squares on all inputs."""

from dataclasses import dataclass

from thermocomp.models.base import FloatArray, StaticRegressor
from thermocomp.models.linear import TermRegressor


@dataclass(kw_only=True, eq=False, repr=False)
class LeastSquares(StaticRegressor, TermRegressor):
    """Linear least squares on all inputs: the reference for other methods (T-08).

    Inputs that depend linearly on others get the coefficient 0 and are listed in ``dependent_``; see
    `thermocomp.models.numerics.leastsquares.lstsq` for the criterion.

    Parameters
    ----------
    fit_intercept : bool
        False: the model returns zero in the reference state.

    Attributes
    ----------
    coef_ : ndarray of shape (n_features,)
    intercept_ : float
    dependent_ : tuple of str
        Names of the inputs that were left out.
    r_squared_, adjusted_r_squared_, standard_error_, n_effective_, condition_ : float
        See `thermocomp.models.linear.TermRegressor`.

    References
    ----------
    Golub, G. H., Van Loan, C. F.: Matrix Computations. 4th edition, Johns Hopkins University Press, 2013, section 5.3.

    Examples
    --------
    >>> import numpy as np
    >>> from thermocomp import LeastSquares
    >>> rises = np.random.default_rng(0).uniform(0, 10, (50, 3))  # of three temperatures [degC]
    >>> model = LeastSquares().fit(rises, 2 + 5 * rises[:, 0] - 3 * rises[:, 2])
    >>> print(round(model.intercept_, 3), (model.coef_.round(3) + 0.0).tolist())
    2.0 [5.0, 0.0, -3.0]
    """

    fit_intercept: bool = True

    def _fit(self, change: FloatArray, deviation: FloatArray) -> None:
        self._regress(change, deviation, range(self.n_features_in_))
