"""Curves: functions of one variable as a table."""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Literal

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.bounds import check_finite
from thermocomp.core.exceptions import SettingError
from thermocomp.core.expression import Lookup, Node


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
        for a, b in pairwise(self.x):
            if not a < b:
                raise SettingError(f"{self.kind} curve: x must increase strictly, but {b:g} follows {a:g}")
        if not np.isfinite(self.pieces[2]).all():
            raise SettingError(
                f"{self.kind} curve: two x values are too close together: the slope between them is not finite"
            )

    @cached_property
    def pieces(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return the break points, and per piece the value at its left end, its slope and its left end."""
        x, y = np.array(self.x, dtype=np.float64), np.array(self.y, dtype=np.float64)
        if self.kind == "step":
            return x, y, np.zeros(len(y)), np.zeros(len(y))
        with np.errstate(over="ignore"):
            slope = np.concatenate([[0.0], np.diff(y) / np.diff(x), [0.0]])
        return x, np.concatenate([y[:1], y]), slope, np.concatenate([x[:1], x])

    @property
    def constant(self) -> bool:
        """True if the curve has the same value everywhere."""
        return min(self.y) == max(self.y)

    @property
    def span(self) -> float:
        """Maximum minus minimum value of the curve."""
        return max(self.y) - min(self.y)

    def expression(self, of: Node, name: str) -> Lookup:
        """Return the curve as a node of an expression."""
        return Lookup(of=of, x=self.x, y=self.y, kind=self.kind, name=name)

    def __call__(self, variable: FloatArray) -> FloatArray:
        """Return the values at `variable` element by element; scalar and batch results are bit-identical."""
        breaks, value, slope, left = self.pieces
        piece = breaks.searchsorted(variable, side="right")
        if self.kind == "step":
            return np.asarray(value[piece])
        return np.asarray(value[piece] + slope[piece] * (variable - left[piece]))
