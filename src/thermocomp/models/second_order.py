"""`mra`: second-order regression with stepwise selection of terms (Chen, Yuan, Ni 1996)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from thermocomp.core.exceptions import InputError
from thermocomp.core.terms import Term, TermTable, Variable, second_order_terms
from thermocomp.models.base import FloatArray
from thermocomp.models.numerics.leastsquares import solve, triangle
from thermocomp.models.numerics.stepwise import AlphaThresholds
from thermocomp.models.steplog import StepwiseRegressor


@dataclass(kw_only=True, eq=False, repr=False)
class SecondOrderRegression(StepwiseRegressor):
    """Chen's multiple regression analysis: linear terms, squares and products, selected by significance.

    The form is ``A1' dT + dT' A2 dT`` without constant (Chen 1996, Eq. 4; C-09), with variables that are inputs or
    differences of inputs (C-12). SYSTAT's stepwise rule selects among its n + n(n+1)/2 terms (C-10): one action per
    step, removal before entry, by default with alpha-to-enter .001 and alpha-to-remove .015 (C-15). The significances
    treat the rows as independent, which the rows of a time series are not: see `n_effective_` (E-C12). A term whose
    remainder outside the span of the model is below 1e-8 of its norm does not enter. Invalid significance levels and
    unknown variables raise `InputError`.

    Parameters
    ----------
    alpha_enter, alpha_remove : float
        Significance levels, ``0 < alpha_enter <= alpha_remove <= 1``.
    fit_intercept : bool
        True: a constant is added, and R2 is centred (E-C10).
    differences : sequence of (str, str)
        Pairs of feature names; ``("T6", "T7")`` defines the variable ``T6-T7``. Features of a table without names are
        called ``x0``, ``x1``, ...
    subset : sequence of str, optional
        Variables to use, features and differences, such as ``("T1", "T2", "T3", "T6-T7", "T8-T9")`` (C-13). Default:
        all features and all differences.
    second_order : bool
        False: linear terms only, as for Chen's slope (C-23).
    hierarchy : bool
        True: a square or product enters only if its factors are in the model, and these stay as long as it does. Chen's
        models do not have this restriction (C-21).

    Attributes
    ----------
    variables_ : tuple of str
        Names of the variables.
    candidates_ : tuple of str
        Names of all terms.
    selected_ : tuple of int
        Terms in the model, as indices of `candidates_`, in ascending order.
    terms_ : tuple of str
        Names of the terms in the model.
    coef_ : ndarray of shape (n_selected,)
        One coefficient for each of `terms_`.
    intercept_ : float
    log_ : tuple of Step
        Each entry and deletion.
    cycled_ : bool
        True if the selection stopped because a model occurred for the second time.
    r_squared_, adjusted_r_squared_, standard_error_, n_effective_, condition_ : float
        See `thermocomp.models.linear.TermRegressor`.

    References
    ----------
    Chen, J. S., Yuan, J., Ni, J.: Thermal Error Modelling for Real-Time Error Compensation. The International Journal
    of Advanced Manufacturing Technology 12, 1996.

    Examples
    --------
    >>> import numpy as np
    >>> from thermocomp import SecondOrderRegression
    >>> rng = np.random.default_rng(0)
    >>> rises = rng.uniform(0, 10, (200, 3))  # [degC]
    >>> y = 2 * rises[:, 0] + 0.5 * rises[:, 0] * rises[:, 2] + 0.1 * rng.normal(size=200)
    >>> model = SecondOrderRegression().fit(rises, y)
    >>> print(model.terms_, model.coef_.round(2).tolist())
    ('x0', 'x0*x2') [2.0, 0.5]
    """

    alpha_enter: float = 0.001
    alpha_remove: float = 0.015
    fit_intercept: bool = False
    differences: Sequence[tuple[str, str]] = ()
    subset: Sequence[str] | None = None
    second_order: bool = True
    hierarchy: bool = False

    def _fit(self, change: FloatArray, deviation: FloatArray) -> None:
        variables = self._variables()
        self.variables_ = tuple(v.name for v in variables)
        terms = second_order_terms(len(variables)) if self.second_order else tuple((i,) for i in range(len(variables)))
        self.candidates_ = TermTable(self.n_features_in_, variables, terms).names()
        values = _values(change, variables)
        tri = triangle(_columns(values, terms, deviation), intercept=self.fit_intercept)
        chosen = self._select(tri, self.candidates_, _factors(terms) if self.hierarchy else None)
        inside = [terms[k] for k in chosen]
        columns = _columns(values, inside, deviation)[:, :-1]
        self._keep(solve(columns, deviation, tri.part(chosen)), variables, inside, tri.total)

    def _rule(self) -> AlphaThresholds:
        return AlphaThresholds(self.alpha_enter, self.alpha_remove)

    def _variables(self) -> tuple[Variable, ...]:
        names = self._names()
        known = {name: Variable.single(name, i) for i, name in enumerate(names)}
        for plus, minus in self.differences:
            known.setdefault(f"{plus}-{minus}", Variable.difference(names, plus, minus))
        if self.subset is None:
            return tuple(known.values())
        for name in self.subset:
            if name not in known:
                raise InputError(f"subset: no variable is named {name!r}; the variables are {', '.join(known)}")
        return tuple(known[name] for name in dict.fromkeys(self.subset))


def _values(X: FloatArray, variables: Sequence[Variable]) -> FloatArray:
    """Return the values of the variables, shape (n_rows, n_variables), in Fortran order."""
    singles = tuple((i,) for i in range(len(variables)))
    return np.asfortranarray(TermTable(X.shape[1], tuple(variables), singles).evaluate(X))


def _columns(values: FloatArray, terms: Sequence[Term], y: FloatArray) -> FloatArray:
    """Return the table [terms y] in Fortran order; column by column is seven times as fast as `TermTable` by rows."""
    out = np.empty((len(values), len(terms) + 1), order="F")
    for k, (first, *others) in enumerate(terms):
        out[:, k] = values[:, first]
        for i in others:
            out[:, k] *= values[:, i]
    out[:, -1] = y
    return out


def _factors(terms: Sequence[Term]) -> list[frozenset[int]]:
    """Return, for each square or product, the linear terms of its factors; an empty set for other terms."""
    return [frozenset(terms.index((i,)) for i in t) if len(t) > 1 else frozenset() for t in terms]
