"""Additive family: one curve per variable and one response curve applied to their sum; no memory."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import ClassVar, Literal

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.bounds import NODES, check_count, check_finite
from thermocomp.core.exceptions import SettingError
from thermocomp.core.expression import Constant, Lookup, Node, Sum
from thermocomp.core.model import ErrorModel
from thermocomp.core.terms import Variable


@dataclass(frozen=True)
class Curve:
    """A function of one variable, constant beyond its ends.

    ``linear`` joins the points (x, y) by straight lines. ``step`` is constant between the breaks x: ``y[0]``
    below ``x[0]``, ``y[i]`` from ``x[i-1]`` on. The step form represents a k-nearest-neighbour estimate from a table of
    one variable exactly: the set of neighbours changes only midway between two entries that are k apart.

    Parameters
    ----------
    x : tuple of float
        Strictly increasing.
    y : tuple of float
        Same length as `x`; one more value for ``step``.

    Raises
    ------
    InputError
        Values are not finite, not increasing, or too few.
    """

    x: tuple[float, ...]
    y: tuple[float, ...]
    kind: Literal["linear", "step"] = "linear"

    def __post_init__(self) -> None:
        check_finite(f"{self.kind} curve", x=self.x, y=self.y)
        if len(self.y) != len(self.x) + (self.kind == "step") or not self.y:
            more = ", and one more than x values" if self.kind == "step" else ", and as many as x values"
            raise SettingError(
                f"{self.kind} curve has {len(self.x)} x values and {len(self.y)} y values: expected at least one y "
                f"value{more}"
            )
        if any(not a < b for a, b in pairwise(self.x)):
            raise SettingError(f"{self.kind} curve: x must increase strictly")
        if not np.isfinite(self._pieces[2]).all():
            raise SettingError(
                f"{self.kind} curve: two x values are too close together: the slope between them is not finite"
            )

    @cached_property
    def _pieces(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return the break points, and per piece the value at its left end, its slope and its left end."""
        x, y = np.array(self.x, dtype=np.float64), np.array(self.y, dtype=np.float64)
        if self.kind == "step":
            return x, y, np.zeros(len(y)), np.zeros(len(y))
        with np.errstate(over="ignore"):
            slope = np.concatenate([[0.0], np.diff(y) / np.diff(x), [0.0]])
        return x, np.concatenate([y[:1], y]), slope, np.concatenate([x[:1], x])

    @property
    def constant(self) -> bool:
        """True if the variable has no effect."""
        return min(self.y) == max(self.y)

    @property
    def span(self) -> float:
        """Maximum minus minimum value."""
        return max(self.y) - min(self.y)

    def expression(self, of: Node, name: str) -> Lookup:
        """Return the curve as a node of an expression."""
        return Lookup(of=of, x=self.x, y=self.y, kind=self.kind, name=name)

    def __call__(self, variable: FloatArray) -> FloatArray:
        """Return the values at `variable` element by element; scalar and batch results are bit-identical."""
        breaks, value, slope, left = self._pieces
        piece = breaks.searchsorted(variable, side="right")
        if self.kind == "step":
            return np.asarray(value[piece])
        return np.asarray(value[piece] + slope[piece] * (variable - left[piece]))


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
    remembers: ClassVar[bool] = False

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

    def _begin(self, change: FloatArray) -> FloatArray:
        return np.empty((*change.shape[:-1], 0))

    def _advance(self, memory: FloatArray, change: FloatArray, dt: float) -> tuple[FloatArray, FloatArray]:  # noqa: ARG002
        # Sum term by term: a matrix product rounds a single reading differently from a batch.
        total = np.zeros(change.shape[:-1])
        for v, curve in zip(self.variables, self.curves, strict=True):
            (first, weight), *others = v.weights
            value = change[..., first] if weight == 1.0 else weight * change[..., first]
            for i, w in others:
                value = value + w * change[..., i]
            total = total + curve(value)
        if self.response is not None:
            total = self.response(total)
        return memory, total + self.intercept

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
