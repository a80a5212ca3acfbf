"""`ridge`: ridge regression on all inputs."""

from collections.abc import Sequence

import numpy as np
from sklearn.linear_model import ridge_regression

from thermocomp.models.base import FloatArray
from thermocomp.models.dynamic import STRENGTHS
from thermocomp.models.shrinkage import PenalisedRegressor, Rule, sorted_strengths


class Ridge(PenalisedRegressor):
    """Ridge regression (Hoerl and Kennard 1970) on standardised inputs: what `dynamic` is without its memory.

    scikit-learn's `ridge_regression` by singular values; the strength is chosen by leaving thermal cycles out.

    Parameters
    ----------
    strengths : sequence of float
        To choose from, per row and in units of each input's variance.
    rule : {'one-standard-error', 'minimum'}
        How the strength is chosen.
    fit_intercept : bool
        False: the model gives zero in the reference state.

    Attributes
    ----------
    strength_ : float
        Chosen strength.
    cv_rms_, chosen_by_ : float, str
        See `thermocomp.models.shrinkage.ShrunkRegressor`.
    """

    def __init__(
        self,
        *,
        strengths: Sequence[float] = STRENGTHS,
        rule: Rule = "one-standard-error",
        fit_intercept: bool = True,
    ) -> None:
        self.strengths = strengths
        self.rule = rule
        self.fit_intercept = fit_intercept

    def _paths(self, Z: FloatArray, y: FloatArray) -> FloatArray:
        strengths = sorted_strengths(self.strengths)
        copies = np.repeat(y[:, None], strengths.size, axis=1)
        weights: FloatArray = ridge_regression(Z, copies, alpha=len(y) * strengths, solver="svd")
        return weights.reshape(1, strengths.size, -1)
