"""`grouping`: sensor selection by correlation grouping and successive regression (Hwang, Lee, Yang)."""

from dataclasses import dataclass

import numpy as np

from thermocomp.core.exceptions import FitError, InputError
from thermocomp.core.terms import Variable
from thermocomp.models.base import FloatArray, StaticRegressor
from thermocomp.models.linear import TermRegressor
from thermocomp.models.numerics.leastsquares import join_columns, solve, triangle
from thermocomp.models.selection.collinearity import contributions, correlation, find_varying, spectrum
from thermocomp.models.selection.exhaustive import Subset
from thermocomp.models.selection.grouping import choose, group, interval_of, intervals


@dataclass(kw_only=True, eq=False, repr=False)
class CorrelationGrouping(StaticRegressor, TermRegressor):
    """Linear model of the temperatures chosen by correlation grouping and successive regression (H-01).

    Temperatures are grouped by their correlation. Successive regression selects one representative of each group. The
    subset of representatives with the smallest residual mean square determines the participating groups. The model is
    the combination of members of these groups with the smallest residual mean square. See
    `thermocomp.models.selection.grouping.group` for rules that the paper leaves open. The mean square treats the rows
    as independent, which the rows of a time series are not: see `n_effective_`.

    Grouping reduces collinearity but does not remove it (E-H10): inspect `spectrum_` and `condition_`.

    With a `reference`, the other temperatures are grouped, and their differences from the reference are the regressors
    (section 3.2.1; H-08). A temperature that is constant, or differs from the reference by a constant, is left out.

    A threshold outside -1 to 1 and a non-existent reference raise `InputError`. `FitError` is raised if no temperature
    varies, if there are fewer than three rows (two without intercept), or if the search would be too large.

    Parameters
    ----------
    threshold : float
        Correlation above which a temperature joins a group, from -1 to 1. The paper's value is not known (E-H1);
        `thermocomp.models.selection.grouping.sweep` shows the results of other values.
    absolute : bool
        Group by the magnitude of the correlation (E-H2).
    reference : str or int, optional
        Name (or index) of the temperature that is subtracted from the others, such as that of the bed.
    fit_intercept : bool
        False: the model returns zero in the reference state.

    Attributes
    ----------
    correlation_ : ndarray of shape (n_candidates, n_candidates)
        Correlations of `candidates_`.
    candidates_ : tuple of int
        Features that were grouped.
    left_out_ : tuple of int
        Features that were not grouped because they are constant.
    groups_ : tuple of tuple of int
        Features of each group, in the order in which the groups were found.
    representatives_ : tuple of int
        One feature of each group, in the order of the successive regression.
    curve_ : tuple of Subset
        Best subset of 1, 2, ... representatives and its MSE_p (Fig. 4).
    participating_ : tuple of int
        Participating groups, as indices of `groups_`.
    selected_ : tuple of int
        Features in the model, in ascending order, without the reference.
    mse_ : float
        MSE_p of the model.
    searched_ : tuple of (int, int)
        Number of subsets and of combinations that were examined (H-07).
    terms_ : tuple of str
        Names of the selected variables.
    coef_ : ndarray of shape (n_selected,)
        One coefficient for each of `terms_`.
    intercept_ : float
    contributions_ : ndarray of shape (n_selected,)
        Correlation of each selected variable with the error (Eq. 9; H-17).
    spectrum_ : Spectrum
        Eigenvalues of X'X of the selected variables, as in Table 3 (H-16).
    r_squared_, adjusted_r_squared_, standard_error_, n_effective_, condition_ : float
        See `thermocomp.models.linear.TermRegressor`.

    References
    ----------
    Hwang, S.-H., Lee, J.-H., Yang, S.-H.: Optimal Variable Selection in a Thermal Error Model for Real Time Error
    Compensation (in Korean). From a study that was funded in 1997.

    Examples
    --------
    >>> import numpy as np
    >>> from thermocomp import CorrelationGrouping
    >>> rng = np.random.default_rng(0)
    >>> places = rng.normal(size=(100, 2)).cumsum(axis=0)  # two places, two sensors at each [degC]
    >>> rises = places[:, [0, 0, 1, 1]] + 0.1 * rng.normal(size=(100, 4))
    >>> model = CorrelationGrouping(threshold=0.95).fit(rises, 4 * rises[:, 0] - 2 * rises[:, 3])
    >>> print(model.groups_, model.selected_, model.coef_.round(3).tolist())
    ((1, 0), (3, 2)) (0, 3) [4.0, -2.0]
    """

    threshold: float = 0.9
    absolute: bool = False
    reference: str | int | None = None
    fit_intercept: bool = True

    def _fit(self, change: FloatArray, deviation: FloatArray) -> None:
        names = self._names()
        zero = self._reference_index(names)
        values = change if zero is None else change - change[:, [zero]]
        size = np.abs(change).max(axis=0)
        moving = find_varying(change)
        if zero is not None:
            moving &= find_varying(values, np.maximum(size, size[zero]))
        others = [i for i in range(len(names)) if i != zero]
        self.candidates_ = tuple(i for i in others if moving[i])
        self.left_out_ = tuple(i for i in others if not moving[i])
        if not self.candidates_:
            raise FitError(
                f"none of the {len(others)} temperatures varies, so there is nothing to group; use recordings in which "
                "they change"
            )
        self.correlation_ = correlation(change[:, self.candidates_])
        tri = triangle(join_columns(values[:, self.candidates_], deviation), intercept=self.fit_intercept)
        choice = choose(tri, group(self.correlation_, self.threshold, absolute=self.absolute))

        def features(columns: tuple[int, ...]) -> tuple[int, ...]:
            return tuple(self.candidates_[k] for k in columns)

        self.groups_ = tuple(features(g) for g in choice.groups)
        self.representatives_ = features(choice.representatives)
        self.curve_ = tuple(Subset(features(s.columns), s.mse) for s in choice.subsets.curve)
        self.participating_ = choice.participating
        self.selected_ = features(choice.selected)
        self.mse_ = choice.members.best.mse
        self.searched_ = (choice.subsets.count, choice.members.count)
        chosen = values[:, self.selected_]
        self.contributions_, self.spectrum_ = contributions(chosen, deviation), spectrum(chosen)
        variables = [
            Variable.single(names[i], i) if zero is None else Variable.difference(names, names[i], names[zero])
            for i in self.selected_
        ]
        found = solve(values[:, self.candidates_], deviation, tri, columns=choice.selected)
        self._keep(found, variables, [(k,) for k in range(len(variables))], tri.total)

    def log_text(self, target: str = "Y") -> str:
        """Return a text with the groups, the curve of MSE_p, the model and the collinearity of its variables.

        Parameters
        ----------
        target : str
            Name of the predicted quantity.

        Returns
        -------
        str
        """
        names = self._names()

        def called(features: tuple[int, ...]) -> str:
            return ", ".join(names[i] for i in features)

        local = [[self.candidates_.index(i) for i in g] for g in self.groups_]
        same = interval_of(local, intervals(self.correlation_, absolute=self.absolute))
        lines = [f"CORRELATION GROUPING OF {len(self.candidates_)} TEMPERATURES ABOVE {self.threshold:g}"]
        if same is not None:
            lines.append(f"(THE SAME GROUPS FROM {same.low:.6f} TO BELOW {same.high:.6f})")
        if self.left_out_:
            lines.append(f"LEFT OUT BECAUSE CONSTANT: {called(self.left_out_)}")
        lines += ["", "GROUP  REPRESENTATIVE IN STEP  USED        MEMBERS, REPRESENTATIVE MARKED *"]
        for k, g in enumerate(self.groups_):
            (own,) = set(g) & set(self.representatives_)
            step = self.representatives_.index(own) + 1
            members = ", ".join(names[i] + "*" * (i == own) for i in g)
            lines.append(f"{k + 1:5d}  {step:22d}  {'YES' if k in self.participating_ else 'NO':>10}  {members}")
        lines += ["", "VARIABLES           MSE  BEST REPRESENTATIVES"]
        lines += [f"{p:9d}  {s.mse:12.6g}  {called(s.columns)}" for p, s in enumerate(self.curve_, start=1)]
        lines += [
            "",
            f"EXAMINED: {self.searched_[0]} SUBSETS OF REPRESENTATIVES, {self.searched_[1]} COMBINATIONS OF MEMBERS",
            f"DEP VAR: {target}   N: {self.n_rows_}   SQUARED MULTIPLE R: {self.r_squared_:.4f}"
            f" ({self.r_squared_kind_.upper()})   STANDARD ERROR OF ESTIMATE: {self.standard_error_:.3f}",
            f"EFFECTIVE SAMPLE SIZE: {self.n_effective_:.1f}",
            "",
        ]
        lines += self._coefficient_lines("  CONTRIBUTION", [f"  {share:12.4f}" for share in self.contributions_])
        s = self.spectrum_
        lines += [
            "",
            f"EIGENVALUES OF X'X: {', '.join(f'{v:.4g}' for v in s.eigenvalues)}   SUM OF INVERSES: {s.sum_inverse:.4g}"
            f"   CONDITION NUMBER: {s.condition_number:.3g}",
        ]
        return "\n".join(lines) + "\n"

    def _reference_index(self, names: tuple[str, ...]) -> int | None:
        if self.reference is None:
            return None
        if isinstance(self.reference, str):
            if self.reference not in names:
                raise InputError(f"reference: no input is named {self.reference!r}; the inputs are {', '.join(names)}")
            return names.index(self.reference)
        if not 0 <= self.reference < len(names):
            raise InputError(f"reference {self.reference}: expected an index from 0 to {len(names) - 1}")
        return int(self.reference)
