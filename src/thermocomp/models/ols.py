"""`ols`: least squares on all inputs."""

from numpy.typing import ArrayLike

from thermocomp.core.terms import Variable
from thermocomp.models.linear import TermRegressor
from thermocomp.models.numerics.leastsquares import solve, triangle


class LeastSquares(TermRegressor):
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

    def fit(self, X: ArrayLike, y: ArrayLike) -> "LeastSquares":
        """Fit.

        Parameters
        ----------
        X : array-like of shape (n_rows, n_features)
            Inputs minus their reference.
        y : array-like of shape (n_rows,)
            Deviation.

        Returns
        -------
        LeastSquares
        """
        change, deviation, both = self._read(X, y)
        tri = triangle(both, intercept=self.fit_intercept)
        found = solve(change, deviation, tri)
        variables = [Variable.single(name, i) for i, name in enumerate(self._names())]
        self._keep(found, variables, [(i,) for i in range(len(variables))], tri.total, self.fit_intercept)
        return self
