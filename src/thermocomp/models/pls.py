"""`pls`: partial least squares."""

import warnings

import numpy as np
from sklearn.cross_decomposition import PLSRegression

from thermocomp.models.base import FloatArray
from thermocomp.models.shrinkage import ComponentRegressor


class PartialLeastSquares(ComponentRegressor):
    """Partial least squares (Wold): components chosen by covariance with the deviation, not by input variance alone.

    Uses scikit-learn's `PLSRegression` on standardised inputs. Its components are computed sequentially, so one fit
    serves all numbers of components; the number is chosen by cross-validation over thermal cycles.

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
        Chosen number; components beyond the rank of the inputs contribute nothing.
    cv_rms_, chosen_by_ : float, str
        See `thermocomp.models.shrinkage.ShrunkRegressor`.

    References
    ----------
    Wold, S., Ruhe, A., Wold, H., Dunn, W. J.: The collinearity problem in linear regression. The partial least squares
    (PLS) approach to generalized inverses. SIAM Journal on Scientific and Statistical Computing 5(3), 1984, 735-743.
    doi:10.1137/0905052

    Examples
    --------
    >>> import numpy as np
    >>> from thermocomp import PartialLeastSquares
    >>> rng = np.random.default_rng(0)
    >>> heat = rng.normal(size=(200, 2)).cumsum(axis=0)  # two sources, six sensors [degC]
    >>> rises = heat @ rng.uniform(size=(2, 6)) + 0.01 * rng.normal(size=(200, 6))
    >>> model = PartialLeastSquares().fit(rises, 3 * heat[:, 0] - heat[:, 1] + rng.normal(size=200))
    >>> print(model.n_components_, round(model.r_squared_, 3))
    2 0.998
    """

    def _path(self, Z: FloatArray, y: FloatArray, most: int) -> FloatArray:
        paths = np.zeros((most, Z.shape[1]))
        # components beyond the rank would consist of rounding errors
        used = min(most, int(np.linalg.matrix_rank(Z, rtol=1e-8)))
        if used and y.any():
            model = PLSRegression(n_components=used, scale=False)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # harmless: y is explained before the last component
                # PLSRegression subtracts means; mirrored rows make them zero, since `fit_intercept` handles centring
                model.fit(np.vstack([Z, -Z]), np.concatenate([y, -y]))
            paths[:used] = np.cumsum(model.x_rotations_ * model.y_loadings_[0], axis=1).T
            paths[used:] = paths[used - 1]
        return paths
