"""Common part of the stepwise regressions: selection, and log in the style of SYSTAT 5.0 (Chen 1996, Fig. 2)."""

import math
import re
from abc import abstractmethod
from collections.abc import Sequence
from textwrap import fill

from thermocomp.models.base import StaticRegressor
from thermocomp.models.linear import TermRegressor
from thermocomp.models.numerics.leastsquares import Triangle
from thermocomp.models.numerics.stepwise import Rule, StepwiseStep, stepwise


class StepwiseRegressor(StaticRegressor, TermRegressor):
    """Linear regression with stepwise selection of terms.

    Attributes
    ----------
    selected_ : tuple of int
        Terms in the model, in ascending order.
    log_ : tuple of StepwiseStep
        Each entry and deletion.
    cycled_ : bool
        True if the selection stopped because a model occurred for the second time.
    """

    selected_: tuple[int, ...]
    log_: tuple[StepwiseStep, ...]

    def log_text(self, target: str = "Y") -> str:
        """Return the rule, the steps, the fit and the coefficients as text (C-16).

        In addition to SYSTAT's columns, the text contains the partial F, the corresponding significance, the change of
        R2 (E-T3), the kind of R2 (E-C10) and the effective sample size (E-C12).
        """
        wide = len(max((s.term for s in self.log_), key=len, default=""))
        lines = [f"STEPWISE REGRESSION WITH {self._rule_text()}", ""]
        lines += [
            f"STEP={s.number:3d}  {s.action.upper():<6}  {s.term:<{wide}}  R= {_three(s.r)}"
            f"  RSQUARE= {_three(s.r_squared)}  F= {s.f:<9.4g}  ALPHA= {s.alpha:<8.2g}"
            f"  CHANGE OF RSQUARE= {s.r_squared_step:+.2e}"
            for s in self.log_
        ]
        if self.cycled_:
            lines.append("STOPPED: THIS MODEL HAS OCCURRED BEFORE")
        lines += ["", "THE SUBSET MODEL INCLUDES THE FOLLOWING PREDICTORS:", ""]
        lines.append(fill(", ".join(self.terms_) or "NONE", 100, break_long_words=False, break_on_hyphens=False))
        lines += [
            "",
            f"DEP VAR: {target}   N: {self.n_rows_}   MULTIPLE R: {_three(math.sqrt(max(self.r_squared_, 0.0)))}"
            f"   SQUARED MULTIPLE R: {_three(self.r_squared_)}",
            f"ADJUSTED SQUARED MULTIPLE R: {_three(self.adjusted_r_squared_)}"
            f"   STANDARD ERROR OF ESTIMATE: {self.standard_error_:.3f}",
            f"R-SQUARES ARE {self.r_squared_kind_.upper()}   EFFECTIVE SAMPLE SIZE: {self.n_effective_:.1f}",
            "",
        ]
        lines += self._coefficient_lines()
        return "\n".join(lines) + "\n"

    @abstractmethod
    def _rule(self) -> Rule:
        """Return the thresholds for entering and deleting a term."""

    def _rule_text(self) -> str:
        """Return the thresholds for entering and deleting a term as text."""
        return str(self._rule())

    def _select(
        self, tri: Triangle, names: Sequence[str], needs: Sequence[frozenset[int]] | None = None
    ) -> tuple[int, ...]:
        """Store the selection and its steps; return the selected columns of `tri`."""
        chosen = stepwise(tri, self._rule(), names, needs=needs)
        self.selected_, self.log_, self.cycled_ = chosen.selected, chosen.steps, chosen.cycled
        return self.selected_


def _three(value: float) -> str:
    """Format a number like SYSTAT: three decimals, no zero before the decimal point."""
    return re.sub(r"^(-?)0", r"\1", f"{value:.3f}")
