"""`pcr`: regression on the first principal components of the inputs."""

import numpy as np
from scipy import linalg

from thermocomp.models.base import FloatArray
from thermocomp.models.shrinkage import Rule, ShrunkRegressor, most_components


class PrincipalComponents(ShrunkRegressor):
    """Principal component regression, which Miao et al. use against collinear temperatures (T-10).

    Least squares on the first principal components of the standardised inputs, in the order of their variance; how
    many, is chosen by leaving thermal cycles out. One decomposition serves all numbers of components.

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
        Chosen number; components without variance (dependent inputs) add nothing.
    cv_rms_, chosen_by_ : float, str
        See `thermocomp.models.shrinkage.ShrunkRegressor`.
    """

    def __init__(
        self,
        *,
        components: int | None = None,
        max_components: int | None = None,
        rule: Rule = "one-standard-error",
        fit_intercept: bool = True,
    ) -> None:
        self.components = components
        self.max_components = max_components
        self.rule = rule
        self.fit_intercept = fit_intercept

    def _paths(self, Z: FloatArray, y: FloatArray) -> FloatArray:
        most = most_components(self.components or self.max_components, Z.shape[1])
        left, values, right = linalg.svd(Z, full_matrices=False, lapack_driver="gesvd")  # whatever the input, it ends
        steps = np.zeros((most, Z.shape[1]))
        for k in np.flatnonzero(values[:most] > 1e-10 * values.max(initial=0.0)):
            steps[k] = right[k] * ((left[:, k] @ y) / values[k])
        paths = np.cumsum(steps, axis=0)
        return paths[None] if self.components is None else paths[None, -1:]

    def _note(self, which: int, setting: int) -> None:  # noqa: ARG002 - there is one set
        self.n_components_ = (
            setting + 1 if self.components is None else most_components(self.components, self.n_features_in_)
        )
