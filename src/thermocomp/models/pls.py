"""`pls`: partial least squares."""

import warnings

import numpy as np
from sklearn.cross_decomposition import PLSRegression

from thermocomp.models.base import FloatArray
from thermocomp.models.shrinkage import ComponentRegressor


class PartialLeastSquares(ComponentRegressor):
    """Partial least squares (Wold): components that follow the deviation, not only the inputs' own variance.

    scikit-learn's `PLSRegression` on standardised inputs. Its components come one after the other, so one fit serves
    all numbers of components; the number is chosen by leaving thermal cycles out.

    Parameters
    ----------
    components : int, optional
        Do not choose: so many components, or as many as can be.
    max_components : int, optional
        Most to choose from; as many as inputs if not given.
    rule : {'one-standard-error', 'minimum'}
        How the number of components is chosen.
    fit_intercept : bool
        False: the model gives zero in the reference state, and the components are those about zero.

    Attributes
    ----------
    n_components_ : int
        Chosen number; beyond the rank of the inputs further ones add nothing.
    cv_rms_, chosen_by_ : float, str
        See `thermocomp.models.shrinkage.ShrunkRegressor`.
    """

    def _path(self, Z: FloatArray, y: FloatArray, most: int) -> FloatArray:
        paths = np.zeros((most, Z.shape[1]))
        # beyond the rank, components would be made of rounding errors
        used = min(most, int(np.linalg.matrix_rank(Z, rtol=1e-8)))
        if used and y.any():
            model = PLSRegression(n_components=used, scale=False)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # the deviation is explained before the last component: no harm
                # it takes the means out: with each row's mirror image these are zero, as `fit_intercept` wants them
                model.fit(np.vstack([Z, -Z]), np.concatenate([y, -y]))
            paths[:used] = np.cumsum(model.x_rotations_ * model.y_loadings_[0], axis=1).T
            paths[used:] = paths[used - 1]
        return paths
