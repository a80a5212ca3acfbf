"""`partial-f`: temperature points by stepwise regression with fixed thresholds on partial F."""

from dataclasses import dataclass

from thermocomp.models.base import FloatArray
from thermocomp.models.numerics.leastsquares import join_columns, triangle
from thermocomp.models.numerics.stepwise import FThresholds, alpha_of_f, r_squared_of_f
from thermocomp.models.steplog import StepwiseRegressor


@dataclass(kw_only=True, eq=False, repr=False)
class PartialF(StepwiseRegressor):
    """Linear model of the temperatures that partial F selects (stepwise2017, section 3; T-02 to T-06).

    The temperature with the greatest partial F enters if its F is at least `f_enter`; then the temperatures in the
    model are tested again, and the worst is deleted while its F is below `f_delete`; this is repeated until none enters
    or leaves. If no temperature enters, the model is the mean (zero without intercept) and `selected_` is empty. A
    temperature whose remainder outside the span of the model is below 1e-8 of its norm does not enter. Raises
    `InputError` unless ``f_enter >= f_delete >= 0``.

    Parameters
    ----------
    f_enter : float
        F_E (T-03).
    f_delete : float
        F_D, at most `f_enter` (E-T4).
    fit_intercept : bool
        False: the model returns zero in the reference state, and R2 is uncentred.

    Attributes
    ----------
    selected_ : tuple of int
        Features in the model, in ascending order.
    terms_ : tuple of str
        Names of the features in the model.
    coef_ : ndarray of shape (n_selected,)
        One coefficient for each of `terms_`.
    intercept_ : float
    log_ : tuple of Step
        Each entry and deletion, with the corresponding significance and change of R2 (E-T3).
    cycled_ : bool
        True if the selection stopped because a model occurred for the second time.
    r_squared_, adjusted_r_squared_, standard_error_, n_effective_, condition_ : float
        See `thermocomp.models.linear.TermRegressor`.

    References
    ----------
    The Open Mechanical Engineering Journal 11, 2017: the study of temperature measurement points by stepwise regression
    that is called stepwise2017 here.

    Examples
    --------
    >>> import numpy as np
    >>> from thermocomp import PartialF
    >>> rng = np.random.default_rng(0)
    >>> rises = rng.uniform(0, 10, (200, 6))  # of six temperatures, two of which matter [degC]
    >>> model = PartialF().fit(rises, 5 * rises[:, 1] - 3 * rises[:, 4] + rng.normal(size=200))
    >>> print(model.terms_, round(model.standard_error_, 2), "um")
    ('x1', 'x4') 1.05 um
    """

    f_enter: float = 100.0
    f_delete: float = 50.0
    fit_intercept: bool = True

    def _fit(self, change: FloatArray, deviation: FloatArray) -> None:
        tri = triangle(join_columns(change, deviation), intercept=self.fit_intercept)
        self._regress(change, deviation, self._select(tri, self._names()), tri)

    def _rule(self) -> FThresholds:
        return FThresholds(self.f_enter, self.f_delete)

    def _rule_text(self) -> str:
        """Return the thresholds as text, with their equivalents for this number of rows (E-T3)."""
        df = self.n_rows_ - int(self.fit_intercept) - 1
        alphas = " AND ".join(f"{alpha_of_f(f, df):.2g}" for f in (self.f_enter, self.f_delete))
        least = r_squared_of_f(self.f_enter, df)
        return f"{self._rule()}\n(AT N= {self.n_rows_}: ALPHAS {alphas}; A FIRST VARIABLE NEEDS RSQUARE= {least:.2f})"
