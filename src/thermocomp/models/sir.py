"""`sir`: least squares on the first directions of sliced inverse regression."""

from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from thermocomp.core.exceptions import InputError
from thermocomp.models.base import FloatArray, StaticRegressor
from thermocomp.models.linear import TermRegressor
from thermocomp.models.numerics.leastsquares import lstsq
from thermocomp.models.shrinkage import scaling

#: share of the largest variance below which a principal direction of the temperatures is noise
NOISE_SHARE = 1e-4


@dataclass(kw_only=True, eq=False, repr=False)
class SlicedInverse(StaticRegressor, TermRegressor):
    """Least squares on the first directions of sliced inverse regression, the method of Zhang et al. (T-10).

    Rows are sorted by deviation and divided into slices; the deviation depends on the directions in which the whitened
    mean temperatures of the slices differ most. Principal directions that consist of noise (`NOISE_SHARE`) are removed
    first, because whitening would scale them up to the size of the others. Constant inputs get the coefficient 0.

    Parameters
    ----------
    slices : int
        Number of slices, or the number of rows if smaller.
    directions : int
        Number of directions, or the largest possible number if smaller. Default: as many as Zhang et al. kept sensors.
    fit_intercept : bool
        False: the model returns zero in the reference state; the directions are those about the mean all the same.

    Attributes
    ----------
    n_directions_ : int
        Number of directions in the model.
    coef_ : ndarray of shape (n_features,)
    intercept_ : float
    dependent_ : tuple of str
        Names of the constant inputs.
    r_squared_, adjusted_r_squared_, standard_error_, n_effective_, condition_ : float
        See `thermocomp.models.linear.TermRegressor`; `condition_` is that of the directions, and each direction counts
        as a parameter.

    Raises
    ------
    InputError
        Fewer than two slices, or no direction.

    References
    ----------
    Li, K.-C.: Sliced inverse regression for dimension reduction. Journal of the American Statistical Association
    86(414), 1991, 316-327. doi:10.1080/01621459.1991.10475035

    The Open Mechanical Engineering Journal 11, 2017: the study of temperature measurement points by stepwise regression
    that is called stepwise2017 here, which cites Zhang et al. for it.

    Examples
    --------
    >>> import numpy as np
    >>> from thermocomp import SlicedInverse
    >>> rng = np.random.default_rng(0)
    >>> heat = rng.normal(size=(200, 2)).cumsum(axis=0)  # two sources, six sensors [degC]
    >>> rises = heat @ rng.uniform(size=(2, 6)) + 0.01 * rng.normal(size=(200, 6))
    >>> model = SlicedInverse().fit(rises, 3 * heat[:, 0] - heat[:, 1] + rng.normal(size=200))
    >>> print(model.n_directions_, round(model.r_squared_, 3))
    2 0.998
    """

    slices: int = 10
    directions: int = 5
    fit_intercept: bool = True

    def _fit(self, change: FloatArray, deviation: FloatArray) -> None:
        if self.slices < 2 or self.directions < 1:
            raise InputError(f"slices {self.slices}, directions {self.directions}: expected at least 2 and 1")
        onto = self._directions(change, deviation)
        found = lstsq(change @ onto, deviation, intercept=self.fit_intercept)
        constant = np.isinf(scaling(change)[1])
        weights = np.where(constant, 0.0, onto @ found.coefficients)
        dependent = tuple(np.flatnonzero(constant).tolist())
        total = float(np.sum((deviation - (deviation.mean() if self.fit_intercept else 0.0)) ** 2))
        self.n_directions_ = found.rank
        terms = [(i,) for i in range(len(weights))]
        self._keep(replace(found, coefficients=weights, dependent=dependent), self._inputs_alone(), terms, total)

    def _directions(self, X: FloatArray, y: FloatArray) -> FloatArray:
        """Return the first directions, (n_features, n_directions); fewer if the others consist of noise."""
        centred = X - X.mean(axis=0)
        _, size, axes = linalg.svd(centred, full_matrices=False, lapack_driver="gesvd")  # gesvd always converges
        kept = size**2 > NOISE_SHARE * size[0] ** 2
        whitening = axes[kept].T / size[kept] * np.sqrt(len(y))
        white = centred @ whitening
        slices = np.array_split(np.argsort(y, kind="stable"), min(self.slices, len(y)))
        means = np.array([np.sqrt(len(s) / len(y)) * white[s].mean(axis=0) for s in slices])
        _, found = linalg.eigh(means.T @ means)
        return np.asarray(whitening @ found[:, ::-1][:, : self.directions])
