"""Profiles: a position-dependent error over the work volume in one thermal state (Chen 1996, Eq. 2: f_g)."""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.bounds import (
    EXPONENT,
    LEAST,
    NODES,
    POSITION,
    POWER_OF_TEN,
    check_between,
    check_count,
    check_finite,
)
from thermocomp.core.exceptions import SettingError

FloatArray = NDArray[np.float64]
Vector = tuple[float, float, float]
Numbers = float | FloatArray
Coordinates = tuple[Numbers, Numbers, Numbers]


@dataclass(frozen=True, kw_only=True)
class PolynomialProfile:
    """Sum of coefficient * u^i v^j w^k, with u = (x - centre_x) / scale_x and so on (C-04, C-06).

    Parameters
    ----------
    kind : str
        Name of the kind in a file.
    exponents : tuple of (int, int, int)
        i, j, k of each term.
    coefficients : tuple of float
        Coefficient of each term [unit of the error].
    centre, scale : tuple of float
        For x, y, z [mm]; a polynomial in mm has centre 0 and scale 1.
    low, high : tuple of float
        Measured range, x, y, z [mm]; outside, the value at the border applies.
    """

    kind: Literal["polynomial"] = "polynomial"

    exponents: tuple[tuple[int, int, int], ...]
    coefficients: tuple[float, ...]
    centre: Vector = (0.0, 0.0, 0.0)
    scale: Vector = (1.0, 1.0, 1.0)
    low: Vector
    high: Vector

    def __post_init__(self) -> None:
        if len(self.exponents) != len(self.coefficients):
            raise SettingError(f"profile: {len(self.exponents)} terms but {len(self.coefficients)} coefficients")
        for term in self.exponents:
            if len(term) != 3 or not 0 <= min(term) <= max(term) <= EXPONENT:
                raise SettingError(f"profile: exponents {list(term)}: expected three from 0 to {EXPONENT}")
        check_count("profile", NODES, terms=self.exponents)
        check_between("profile", LEAST, POSITION, scale=self.scale)
        check_finite("profile", coefficients=self.coefficients)
        check_finite("profile", POSITION, centre=self.centre, low=self.low, high=self.high)
        _check_range(self.low, self.high)
        corner = np.abs([self.low, self.high] - np.array(self.centre)).max(axis=0) / self.scale
        for term in self.exponents:
            if np.dot(term, np.log10(np.maximum(corner, 1.0))) > POWER_OF_TEN:
                raise SettingError(
                    f"profile: the term of exponents {list(term)} overflows at an end of the range: check centre and "
                    "scale"
                )

    @cached_property
    def _axes(self) -> tuple[int, ...]:
        """Indices of the coordinates used by the profile."""
        return tuple(a for a in range(3) if any(e[a] for e in self.exponents))

    def ranges(self) -> dict[str, tuple[float, float]]:
        """Return the measured range along each axis used by the profile [mm]."""
        return {"XYZ"[a]: (self.low[a], self.high[a]) for a in self._axes}

    @cached_property
    def _along_one(self) -> tuple[int, tuple[float, ...]] | None:
        """Coordinate, and coefficients by descending degree, of a polynomial in one coordinate."""
        if len(self._axes) > 1:
            return None
        axis = self._axes[0] if self._axes else 0
        by_degree = [0.0] * (1 + max((e[axis] for e in self.exponents), default=0))
        for e, c in zip(self.exponents, self.coefficients, strict=True):
            by_degree[e[axis]] += c
        return axis, tuple(reversed(by_degree))

    def at(self, points: FloatArray) -> FloatArray:
        """Return the values of the profile.

        Parameters
        ----------
        points : ndarray of shape (..., 3)
            x, y, z [mm].

        Returns
        -------
        ndarray of shape (...,)
        """
        return np.asarray(self.value(coordinates(points)))

    def value(self, xyz: Coordinates) -> Numbers:
        """Return the values of the profile at points prepared by `coordinates`."""
        along = self._along_one
        if along is not None:
            axis, coefficients = along
            u = self._scaled(xyz, axis)
            value = 0.0 * u + coefficients[0]
            for c in coefficients[1:]:
                value *= u
                value += c
            return value
        scaled = {axis: self._scaled(xyz, axis) for axis in self._axes}
        total: Numbers = 0.0
        for e, c in zip(self.exponents, self.coefficients, strict=True):
            term: Numbers = c
            for axis in self._axes:
                if e[axis]:
                    term = term * scaled[axis] ** e[axis]
            total = total + term
        return total

    def _scaled(self, xyz: Coordinates, axis: int) -> Numbers:
        return (clamp(xyz[axis], self.low[axis], self.high[axis]) - self.centre[axis]) / self.scale[axis]


@dataclass(frozen=True, kw_only=True)
class SplineProfile:
    """Piecewise cubic profile along one axis.

    Parameters
    ----------
    kind : str
        Name of the kind in a file.
    knots : tuple of float
        Ends of the pieces, increasing [mm]; outside, the value at the nearer end applies.
    pieces : tuple of (float, float, float, float)
        Per piece, the coefficients of ((p - first knot) / length)^0..3 [unit of the error].
    """

    kind: Literal["spline"] = "spline"

    axis: str
    knots: tuple[float, ...]
    pieces: tuple[tuple[float, float, float, float], ...]

    def __post_init__(self) -> None:
        if self.axis not in ("X", "Y", "Z"):
            raise SettingError(f"profile: axis {self.axis!r}: expected X, Y or Z")
        if len(self.knots) != len(self.pieces) + 1 or len(self.pieces) < 1:
            raise SettingError(
                f"profile: {len(self.knots)} knots for {len(self.pieces)} pieces; expected one knot more than pieces, "
                "and at least one piece"
            )
        for a, b in zip(self.knots, self.knots[1:], strict=False):
            if not b > a:
                raise SettingError(f"profile: knots must increase, but {b:g} mm follows {a:g} mm")
        check_finite("profile", POSITION, knots=self.knots)
        check_finite("profile", pieces=self.pieces)

    def ranges(self) -> dict[str, tuple[float, float]]:
        """Return the measured range [mm], by axis."""
        return {self.axis: (self.knots[0], self.knots[-1])}

    @cached_property
    def _arrays(self) -> tuple[FloatArray, FloatArray]:
        return np.asarray(self.knots, dtype=np.float64), np.asarray(self.pieces, dtype=np.float64)

    def at(self, points: FloatArray) -> FloatArray:
        """Return the values of the profile.

        Parameters
        ----------
        points : ndarray of shape (..., 3)
            x, y, z [mm].

        Returns
        -------
        ndarray of shape (...,)
        """
        return np.asarray(self.value(coordinates(points)))

    def value(self, xyz: Coordinates) -> Numbers:
        """Return the values of the profile at points prepared by `coordinates`."""
        p = clamp(xyz["XYZ".index(self.axis)], self.knots[0], self.knots[-1])
        if isinstance(p, float):
            i = min(bisect_right(self.knots, p), len(self.pieces)) - 1
            return _cubic(self.pieces[i], (p - self.knots[i]) / (self.knots[i + 1] - self.knots[i]))
        knots, pieces = self._arrays
        k = np.minimum(np.searchsorted(knots, p, side="right"), len(pieces)) - 1
        return _cubic(np.moveaxis(pieces[k], -1, 0), (p - knots[k]) / (knots[k + 1] - knots[k]))


Profile = PolynomialProfile | SplineProfile


def coordinates(points: FloatArray) -> Coordinates:
    """Return x, y and z of points of shape (..., 3), separately.

    For a single point they are floats: live, float arithmetic is ten times faster than that of one-element arrays.
    """
    if points.ndim == 1:
        x, y, z = points.tolist()
        return x, y, z
    return points[..., 0], points[..., 1], points[..., 2]


def clamp(value: Numbers, low: float, high: float) -> Numbers:
    """Return coordinates clipped to a lower and an upper bound."""
    return min(max(value, low), high) if isinstance(value, float) else np.clip(value, low, high)


def _cubic(c: Sequence[float] | FloatArray, u: Numbers) -> Numbers:
    value: Numbers = ((c[3] * u + c[2]) * u + c[1]) * u + c[0]
    return value


def _check_range(low: Vector, high: Vector) -> None:
    if not all(a <= b for a, b in zip(low, high, strict=True)):
        raise SettingError(f"profile: range from {low} to {high} mm: the lower end must not exceed the upper end")
