"""`partial-f`: temperature points by stepwise regression with fixed thresholds on partial F."""

from numpy.typing import ArrayLike

from thermocomp.core.terms import Variable
from thermocomp.models import steplog
from thermocomp.models.linear import TermRegressor
from thermocomp.models.numerics.leastsquares import solve, triangle
from thermocomp.models.numerics.stepwise import FThresholds, alpha_of_f, r_squared_of_f, stepwise


class PartialF(TermRegressor):
    """Linear model of the temperatures that partial F selects (stepwise2017, section 3; T-02 to T-06).

    The temperature with the greatest partial F enters if that is at least `f_enter`; then those inside are tested
    again and the worst is deleted while its F is below `f_delete`; until nothing enters and nothing leaves. If not
    even one temperature enters, the model is the mean (zero without intercept) and `selected_` is empty. A temperature
    of which those inside leave less than 1e-8 of its norm does not enter.

    Parameters
    ----------
    f_enter : float
        F_E (T-03).
    f_delete : float
        F_D, not above `f_enter` (E-T4).
    fit_intercept : bool
        False: the model gives zero in the reference state, and R2 is uncentred.

    Attributes
    ----------
    selected_ : tuple of int
        Features in the model, in rising order.
    terms_ : tuple of str
        Their names.
    coef_ : ndarray of shape (n_selected,)
        One for each of `terms_`.
    intercept_ : float
    log_ : tuple of Step
        Each entering and leaving, with the significance and the gain in R2 it corresponds to (E-T3).
    cycled_ : bool
        True if the selection was stopped because it went round in a circle.
    r_squared_, adjusted_r_squared_, standard_error_, n_effective_, condition_ : float
        See `thermocomp.models.linear.TermRegressor`.
    """

    def __init__(self, *, f_enter: float = 100.0, f_delete: float = 50.0, fit_intercept: bool = True) -> None:
        self.f_enter = f_enter
        self.f_delete = f_delete
        self.fit_intercept = fit_intercept

    def fit(self, X: ArrayLike, y: ArrayLike) -> "PartialF":
        """Select and fit.

        Parameters
        ----------
        X : array-like of shape (n_rows, n_features)
            Temperatures minus their reference.
        y : array-like of shape (n_rows,)
            Deviation.

        Returns
        -------
        PartialF

        Raises
        ------
        InputError
            Unless ``f_enter >= f_delete >= 0``.
        """
        rule = FThresholds(self.f_enter, self.f_delete)
        change, deviation, both = self._read(X, y)
        names = self._names()
        tri = triangle(both, intercept=self.fit_intercept)
        chosen = stepwise(tri, rule, names)
        self.selected_, self.log_, self.cycled_ = chosen.selected, chosen.steps, chosen.cycled
        found = solve(change, deviation, tri, columns=self.selected_)
        variables = [Variable.single(name, i) for i, name in enumerate(names)]
        self._keep(found, variables, [(i,) for i in self.selected_], tri.total, self.fit_intercept)
        return self

    def log_text(self, target: str = "Y") -> str:
        """Return the steps and the model as text, with what the thresholds amount to at this number of rows (E-T3).

        Parameters
        ----------
        target : str
            Name of what is predicted.

        Returns
        -------
        str
        """
        df = self.n_rows_ - int(self.fit_intercept) - 1
        alphas = [f"{alpha_of_f(f, df):.2g}" for f in (self.f_enter, self.f_delete)]
        least = r_squared_of_f(self.f_enter, df)
        rule = (
            f"{FThresholds(self.f_enter, self.f_delete)}\n"
            f"(AT N= {self.n_rows_}: ALPHAS {' AND '.join(alphas)}; A FIRST VARIABLE NEEDS RSQUARE= {least:.2f})"
        )
        return steplog.log_text(self, rule, target)
