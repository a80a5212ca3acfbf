"""Shapes of a geometric profile: terms of a polynomial, and splines along the own axis."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, CubicSpline, PPoly

from thermocomp.core.arrays import FloatArray
from thermocomp.core.profile import PolynomialProfile, SplineProfile

# polynomial: degree in the own coordinate and in the others; spline: number of inner knots and 0
Order = tuple[int, int]

#: limits of the orders, beyond which profiles cannot be distinguished from noise
HIGHEST, HIGHEST_OTHER, MOST_KNOTS = 9, 3, 12


class PolynomialShape:
    """Terms u^i v^j w^k: i up to the own degree, j + k up to that of the others, i + j + k up to the larger degree."""

    def __init__(self, points: FloatArray, axis: str, others: str) -> None:
        low, high = self.low, self.high = points.min(axis=0), points.max(axis=0)
        self.centre = (low + high) / 2
        self.scale = np.where(high > low, (high - low) / 2, 1.0)
        self.scaled = (points - self.centre) / self.scale
        self.own = "XYZ".index(axis)
        self.others = ["XYZ".index(a) for a in others]
        self.distinct = [len(np.unique(points[:, a])) for a in range(3)]

    def orders(self, n_places: int) -> Iterator[Order]:
        """Yield the orders with at most two thirds as many terms as places, and degrees determined by each axis."""
        # Least squares on equidistant positions oscillates between them if the degree exceeds 2 sqrt(n).
        n_own = self.distinct[self.own]
        highest = min(n_own - 2, int(2 * n_own**0.5), HIGHEST)
        other = min(max((self.distinct[a] - 1 for a in self.others), default=0), HIGHEST_OTHER)
        for i in range(highest + 1):
            for j in range(min(other, i) + 1 if i else 1):
                if 3 * len(self.exponents((i, j))) <= 2 * n_places:
                    yield i, j

    def exponents(self, order: Order) -> list[tuple[int, int, int]]:
        """Return the exponents of x, y and z in each term."""
        limits = [0, 0, 0]
        limits[self.own] = order[0]
        for a in self.others:
            limits[a] = min(order[1], self.distinct[a] - 1)
        possible = np.ndindex(limits[0] + 1, limits[1] + 1, limits[2] + 1)
        return [e for e in possible if sum(e) - e[self.own] <= order[1] and sum(e) <= max(order)]

    def columns(self, order: Order) -> FloatArray:
        """Return the values of the basis functions at the points, (n, n_terms)."""
        return np.stack([np.prod(self.scaled ** np.array(e), axis=1) for e in self.exponents(order)], axis=1)

    def profile(self, order: Order, found: FloatArray) -> PolynomialProfile:
        """Return the profile with the given coefficients of the basis functions."""

        def three(a: FloatArray) -> tuple[float, float, float]:
            return float(a[0]), float(a[1]), float(a[2])

        return PolynomialProfile(
            exponents=tuple(self.exponents(order)),
            coefficients=tuple(found.tolist()),
            centre=three(self.centre),
            scale=three(self.scale),
            low=three(self.low),
            high=three(self.high),
        )


class _Along:
    """Common part of the profiles that depend on the position of their own axis only."""

    def __init__(self, points: FloatArray, axis: str) -> None:
        self.axis = axis
        self.position = points[:, "XYZ".index(axis)]
        self.places = np.unique(self.position)


class SplineShape(_Along):
    """Cubic spline with inner knots that divide the positions into equal numbers."""

    def orders(self, n_places: int) -> Iterator[Order]:  # noqa: ARG002 - only positions along the axis matter
        """Yield the numbers of inner knots with which at least two degrees of freedom remain."""
        for n in range(min(len(self.places) - 6, MOST_KNOTS) + 1):
            yield n, 0

    def knots(self, order: Order) -> FloatArray:
        """Return all knots of the spline; those at the ends occur four times."""
        inner = np.quantile(self.places, np.linspace(0, 1, order[0] + 2))
        return np.concatenate([[inner[0]] * 3, inner, [inner[-1]] * 3])

    def columns(self, order: Order) -> FloatArray:
        """Return the values of the basis functions at the points, (n, n_terms)."""
        return np.asarray(BSpline.design_matrix(self.position, self.knots(order), 3).toarray())

    def profile(self, order: Order, found: FloatArray) -> SplineProfile:
        """Return the profile with the given coefficients of the basis functions."""
        knots = self.knots(order)
        pieces = PPoly.from_spline(BSpline(knots, found, 3))
        return _pieces(self.axis, knots[3:-3], pieces.c[:, 3:-3])


class ThroughMeans(_Along):
    """Natural cubic spline through the means of all positions."""

    def through(self, values: FloatArray, rows: NDArray[np.bool_] | slice = slice(None)) -> CubicSpline:
        """Return the spline through the means of selected rows."""
        places, which = np.unique(self.position[rows], return_inverse=True)
        means = np.bincount(which, values[rows]) / np.bincount(which)
        return CubicSpline(places, means, bc_type="natural")

    def columns(self, order: Order) -> FloatArray:  # noqa: ARG002 - there is only one order
        """Return a matrix with 1 where a point is at a position and 0 elsewhere, (n, n_positions)."""
        return np.asarray(self.position[:, None] == self.places, dtype=np.float64)

    def profile(self, order: Order, found: FloatArray) -> SplineProfile:  # noqa: ARG002
        """Return the profile through the given means of the positions."""
        return _pieces(self.axis, self.places, CubicSpline(self.places, found, bc_type="natural").c)


def _pieces(axis: str, knots: FloatArray, falling: FloatArray) -> SplineProfile:
    """Return a spline profile from the coefficients of its pieces in descending powers [unit/mm^k], (4, n_pieces)."""
    scaled = falling[::-1] * np.diff(knots) ** np.arange(4)[:, None]
    return SplineProfile(
        axis=axis,
        knots=tuple(knots.tolist()),
        pieces=tuple((float(a), float(b), float(c), float(d)) for a, b, c, d in scaled.T),
    )
