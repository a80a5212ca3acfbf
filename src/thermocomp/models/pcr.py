"""`pcr`: regression on the first principal components of the inputs."""

import numpy as np
from scipy import linalg

from thermocomp.models.base import FloatArray
from thermocomp.models.shrinkage import ComponentRegressor


class PrincipalComponents(ComponentRegressor):
    """Principal component regression, used by Miao et al. for collinear temperatures (T-10).

    Least squares on the first principal components of the standardised inputs, in order of variance; their number is
    chosen by cross-validation over thermal cycles. A single decomposition serves all numbers of components.

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
        Chosen number; components without variance (dependent inputs) contribute nothing.
    cv_rms_, chosen_by_ : float, str
        See `thermocomp.models.shrinkage.ShrunkRegressor`.

    References
    ----------
    Massy, W. F.: Principal components regression in exploratory statistical research. Journal of the American
    Statistical Association 60(309), 1965, 234-256.

    The Open Mechanical Engineering Journal 11, 2017: the study of temperature measurement points by stepwise regression
    that is called stepwise2017 here.

    Examples
    --------
    >>> import numpy as np
    >>> from thermocomp import PrincipalComponents
    >>> rng = np.random.default_rng(0)
    >>> heat = rng.normal(size=(200, 2)).cumsum(axis=0)  # two sources, six sensors [degC]
    >>> rises = heat @ rng.uniform(size=(2, 6)) + 0.01 * rng.normal(size=(200, 6))
    >>> model = PrincipalComponents().fit(rises, 3 * heat[:, 0] - heat[:, 1] + rng.normal(size=200))
    >>> print(model.n_components_, round(model.r_squared_, 3))
    2 0.998
    """

    def _path(self, Z: FloatArray, y: FloatArray, most: int) -> FloatArray:
        left, values, right = linalg.svd(Z, full_matrices=False, lapack_driver="gesvd")  # gesvd always converges
        steps = np.zeros((most, Z.shape[1]))
        for k in np.flatnonzero(values[:most] > 1e-10 * values.max(initial=0.0)):
            steps[k] = right[k] * ((left[:, k] @ y) / values[k])
        return np.asarray(np.cumsum(steps, axis=0))
