"""Common part of the regressions on terms: fit of chosen terms, its accuracy, and `freeze`."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from thermocomp.core.inputs import Input
from thermocomp.core.polynomial import Polynomial
from thermocomp.core.terms import Term, TermTable, Variable
from thermocomp.models.base import FloatArray, MemorylessRegressor
from thermocomp.models.numerics.leastsquares import (
    Solution,
    Triangle,
    effective_sample_size,
    join_columns,
    solve,
    triangle,
)


class TermRegressor(MemorylessRegressor):
    """Linear combination of terms of the inputs.

    Attributes
    ----------
    coef_ : ndarray of shape (n_terms,)
        One coefficient for each of `terms_`.
    intercept_ : float
        Deviation in the reference state.
    terms_ : tuple of str
        Names of the terms.
    dependent_ : tuple of str
        Terms that depend linearly on others (or on the constant); their coefficient is 0.
    condition_ : float
        Condition number of the design matrix, with its columns centred (if there is an intercept) and scaled.
    r_squared_, adjusted_r_squared_ : float
        On the training data; nan where undefined.
    r_squared_kind_ : {'centred', 'uncentred'}
        Whether the total sum of squares is about the mean or, without intercept, about zero (E-C10).
    standard_error_ : float
        Standard error of estimate, with the rows treated as independent [unit of y].
    n_effective_ : float
        Effective sample size of the training rows, from the autocorrelation of the residual (E-C12).
    data_min_, data_max_ : ndarray of shape (n_features,)
        Trained range.
    """

    fit_intercept: bool

    def _predict(self, change: FloatArray) -> FloatArray:
        return np.asarray(self._table.evaluate(change) @ self.coef_ + self.intercept_)

    def _frozen(self, inputs: Sequence[Input], header: dict[str, Any]) -> Polynomial:
        active = [(term, c) for term, c in zip(self._table.terms, self.coef_.tolist(), strict=True) if c != 0]
        variables = sorted({v for term, _ in active for v in term})
        sensors = sorted({i for v in variables for i, _ in self._table.variables[v].weights})
        kept = []
        for v in variables:
            weights = tuple((sensors.index(i), factor) for i, factor in self._table.variables[v].weights)
            kept.append(Variable("-".join(inputs[sensors[i]].name for i, _ in weights), weights))
        return Polynomial(
            **header,
            inputs=tuple(inputs[i] for i in sensors),
            variables=tuple(kept),
            terms=tuple(tuple(variables.index(v) for v in term) for term, _ in active),
            coefficients=tuple(c for _, c in active),
            intercept=self.intercept_,
        )

    # -- for the methods ---------------------------------------------------------------------------------------------

    def _regress(
        self, change: FloatArray, deviation: FloatArray, columns: Sequence[int], tri: Triangle | None = None
    ) -> None:
        """Store the least-squares fit on some of the inputs; `tri`, if available, is the triangular factor of all."""
        tri = tri or triangle(join_columns(change, deviation), intercept=self.fit_intercept)
        found = solve(change, deviation, tri, columns=columns)
        self._keep(found, self._inputs_alone(), [(i,) for i in columns], tri.total)

    def _inputs_alone(self) -> list[Variable]:
        """Return one variable per input."""
        return [Variable.single(name, i) for i, name in enumerate(self._names())]

    def _keep(self, found: Solution, variables: Sequence[Variable], terms: Sequence[Term], total: float) -> None:
        """Store the coefficients of `terms` and their goodness of fit; `total` is the sum of squares of y."""
        one = int(self.fit_intercept)
        self._table = TermTable(self.n_features_in_, tuple(variables), tuple(terms))
        n_rows = len(found.residual)
        self.coef_, self.intercept_ = found.coefficients, found.intercept
        self.terms_ = self._table.names()
        self.dependent_ = tuple(self.terms_[k] for k in found.dependent)
        self.condition_ = found.condition
        self.n_rows_ = n_rows
        self.r_squared_kind_ = "centred" if one else "uncentred"
        left = n_rows - found.rank - one
        self.r_squared_ = 1 - found.rss / total if total > 0 else float("nan")
        per_row = (n_rows - one) / left if left > 0 else float("nan")
        self.adjusted_r_squared_ = 1 - (1 - self.r_squared_) * per_row
        self.standard_error_ = float(np.sqrt(found.rss / left)) if left > 0 else float("nan")
        self.n_effective_ = effective_sample_size(found.residual)

    def _coefficient_lines(self, title: str = "", beside: Sequence[str] = ()) -> list[str]:
        """Return a text table of the coefficients, constant first; `beside` is an additional column."""
        wide = max(len(name) for name in ("VARIABLE", *self.terms_))
        lines = [f"{'VARIABLE':<{wide}}  {'COEFFICIENT':>14}{title}"]
        if self.fit_intercept:
            lines.append(f"{'CONSTANT':<{wide}}  {self.intercept_:14.6g}")
        rows = zip(self.terms_, self.coef_, beside or [""] * len(self.terms_), strict=True)
        return [*lines, *(f"{name:<{wide}}  {value:14.6g}{more}" for name, value, more in rows)]
