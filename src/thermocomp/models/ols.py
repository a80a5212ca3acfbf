"""`ols`: least squares on all inputs."""

from thermocomp.models.base import FloatArray, StaticRegressor
from thermocomp.models.linear import TermRegressor


class LeastSquares(StaticRegressor, TermRegressor):
    """Linear least squares on all inputs: the method others are compared with (T-08).

    Inputs that depend on others get the coefficient 0 and are told in ``dependent_``; how this is decided says
    `thermocomp.models.numerics.leastsquares.lstsq`.

    Parameters
    ----------
    fit_intercept : bool
        False: the model gives zero in the reference state.

    Attributes
    ----------
    coef_ : ndarray of shape (n_features,)
    intercept_ : float
    dependent_ : tuple of str
        Names of the inputs that were left out.
    r_squared_, adjusted_r_squared_, standard_error_, n_effective_, condition_ : float
        See `thermocomp.models.linear.TermRegressor`.
    """

    def __init__(self, *, fit_intercept: bool = True) -> None:
        self.fit_intercept = fit_intercept

    def _fit(self, change: FloatArray, deviation: FloatArray) -> None:
        self._regress(change, deviation, range(self.n_features_in_))
