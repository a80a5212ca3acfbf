"""Additive family: one curve per variable and one response curve applied to their sum; no memory."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from thermocomp.core.bounds import NODES, check_count, check_finite
from thermocomp.core.curves import Curve
from thermocomp.core.exceptions import SettingError
from thermocomp.core.expression import Constant, Node, Sum
from thermocomp.core.model import ErrorModel
from thermocomp.core.terms import Variable


@dataclass(frozen=True, kw_only=True)
class Additive(ErrorModel):
    """Deviation = intercept + response(curve_1(variable_1) + curve_2(variable_2) + ...) (Wessel 2004, Eq. 5; W-05).

    Curves are constant beyond their ends: peaks outside the trained range are cropped (W-07), and ``State.outside``
    marks the inputs concerned.

    Parameters
    ----------
    family : str
        Name of the family in a file.
    variables : tuple of Variable
        Linear combinations of the inputs: single sensors, or projections.
    curves : tuple of Curve
        One per variable.
    response : Curve or None
        Curve applied to the sum, such as the inverse of theta; None: the sum itself.
    """

    family: Literal["additive"] = "additive"

    variables: tuple[Variable, ...]
    curves: tuple[Curve, ...]
    response: Curve | None = None

    def _check(self) -> None:
        owner = f"model of {self.target}"
        if len(self.variables) != len(self.curves):
            raise SettingError(f"{owner}: {len(self.variables)} variables but {len(self.curves)} curves")
        check_count(owner, NODES, variables=self.variables)
        check_finite(owner, intercept=self.intercept)
        for v in self.variables:
            v.check_inputs(len(self.inputs))

    def _expression(self, change: Sequence[Node]) -> Node:
        curves = zip(self.variables, self.curves, strict=True)
        parts = [c.expression(v.expression(change), f"phi{k}") for k, (v, c) in enumerate(curves, start=1)]
        total: Node = Sum(tuple(parts))
        if self.response is not None:
            total = self.response.expression(total, "theta^-1")
        return Sum((Constant(self.intercept), total)) if self.intercept else total

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the inputs that affect the deviation."""
        if self.response is not None and self.response.constant:
            return ()
        active = [v for v, c in zip(self.variables, self.curves, strict=True) if not c.constant]
        used = {i for v in active for i, w in v.weights if w != 0}
        return tuple(self.inputs[i].name for i in sorted(used))

    def coefficients_by_name(self) -> dict[str, float]:
        """Return the span (maximum minus minimum) of each curve, before the response."""
        return {name: c.span for name, c in zip(self._names(), self.curves, strict=True)}

    def _names(self) -> list[str]:
        return [f"phi{k}({v.name})" for k, v in enumerate(self.variables, start=1)]
