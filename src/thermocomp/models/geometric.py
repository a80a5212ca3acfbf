"""The geometric part f_g of an error: a polynomial or a spline, its order chosen by points left out (C-04, C-06)."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, PPoly

from thermocomp.core.exceptions import FitError, InputError
from thermocomp.core.profile import PolynomialProfile, Profile, SplineProfile
from thermocomp.recording.profiles import MIN_POSITIONS

FloatArray = NDArray[np.float64]
Kind = Literal["polynomial", "spline"]
# of a polynomial: degree in the own coordinate and in the others; of a spline: inner knots and 0
Order = tuple[int, int]

#: beyond these no profile is told from noise
HIGHEST, HIGHEST_OTHER, MOST_KNOTS = 9, 3, 12
#: so many positions between the ends are needed to judge by them alone
FEW = 3


@dataclass(frozen=True)
class Tried:
    """A profile that was tried.

    Parameters
    ----------
    order : (int, int)
        Polynomial: degree in the axis' own coordinate and in the others. Spline: number of inner knots, and 0.
    n_terms : int
    left_out : float
        RMS error at points that were left out, one after the other [unit]; inf if the others do not determine it.
    margin : float
        Standard error of its square [unit^2].
    """

    order: Order
    n_terms: int
    left_out: float
    margin: float


@dataclass(frozen=True)
class ProfileFit:
    """A geometric profile, and what it was chosen from.

    Parameters
    ----------
    profile : Profile
    order : (int, int)
        See `Tried`.
    tried : tuple of Tried
        By rising number of terms; empty if the order was given.
    rms : float
        What the fit leaves [unit], per degree of freedom; nan if there is none.
    """

    profile: Profile
    order: Order
    tried: tuple[Tried, ...]
    rms: float


def fit_profile(
    points: FloatArray,
    values: FloatArray,
    axis: str,
    *,
    kind: Kind = "polynomial",
    order: int | Order | Literal["auto"] = "auto",
    coordinates: str | None = None,
) -> ProfileFit:
    """Fit the geometric profile f_g(x, y, z) by least squares (C-04, C-06, C-22).

    Without an order, those are tried that leave a third of the points to spare: every point between the ends of the
    axis' travel is left out in turn, with all values that were measured there, and told from the others; of the orders
    whose mean square is within one standard error of the smallest, the one with the fewest terms is taken. The ends are
    not left out: a profile is never used beyond them, and what an order does there would decide alone. Only where there
    are fewer than three positions between them, too few to judge by, they are left out too.

    Parameters
    ----------
    points : ndarray of shape (n, 3)
        x, y, z [mm]; a point may come several times.
    values : ndarray of shape (n,)
        [unit]; nan where a point was missed.
    axis : {'X', 'Y', 'Z'}
        The own one.
    kind : {'polynomial', 'spline'}
        A polynomial in all coordinates, or a cubic spline along the own one.
    order : int, (int, int) or 'auto'
        Degree in the own coordinate, or that and the degree in the others; or the number of inner knots of a spline.
    coordinates : str, optional
        Axes that the profile may depend on, such as ``YX``; all whose position varies if not given.

    Returns
    -------
    ProfileFit

    Raises
    ------
    InputError
        Kind, order or coordinates cannot be.
    FitError
        There are too few points.
    """
    there = np.isfinite(values)
    points, values = points[there], values[there]
    varying = "".join(a for k, a in enumerate("XYZ") if points.size and np.ptp(points[:, k]) > 0)
    used = varying if coordinates is None else coordinates
    if axis not in varying:
        raise FitError(f"profile along {axis}: all positions along {axis} are the same")
    if kind not in ("polynomial", "spline"):
        raise InputError(f"profile {kind!r}: choose polynomial or spline")
    if any(a not in "XYZ" for a in used) or (coordinates is not None and axis not in used):
        raise InputError(f"coordinates {used!r}: name the own axis {axis} and, if wanted, others of X, Y, Z")
    others = "".join(a for a in used if a != axis and a in varying)
    if kind == "spline" and others and coordinates is not None:
        raise InputError(f"a spline is one along {axis} alone: for {used} choose a polynomial")
    n_own = len(np.unique(points[:, "XYZ".index(axis)]))
    if n_own < MIN_POSITIONS:
        raise FitError(f"profile along {axis}: values at {n_own} positions; at least {MIN_POSITIONS} are needed")
    place = np.unique(points, axis=0, return_inverse=True)[1].ravel()
    shape = _Spline(points, axis) if kind == "spline" else _Polynomial(points, axis, others)
    tried: list[Tried] = []
    if order == "auto":
        n_places = int(place.max()) + 1
        tried = [_try(shape.columns(o), values, place, points, axis, o) for o in shape.orders(n_places)]
        if not tried or not np.isfinite(min(t.left_out for t in tried)):
            raise FitError(f"profile along {axis}: {n_places} points are too few to choose an order; give it")
        tried.sort(key=lambda t: (t.n_terms, t.order))
        best = min(tried, key=lambda t: t.left_out)
        chosen = next(t.order for t in tried if t.left_out**2 <= best.left_out**2 + best.margin)
    else:
        chosen = order if isinstance(order, tuple) else (order, 1 if others and order and kind == "polynomial" else 0)
        if min(chosen) < 0:
            raise InputError(f"order {order}: must not be negative")
    columns = shape.columns(chosen)
    n_terms = columns.shape[1]
    if np.linalg.matrix_rank(columns) < n_terms:
        raise FitError(f"profile along {axis}: {len(np.unique(place))} points do not determine {n_terms} terms")
    found: FloatArray = np.asarray(np.linalg.lstsq(columns, values)[0], dtype=np.float64)
    left = values - columns @ found
    spare = len(values) - n_terms
    rms = float(np.sqrt(left @ left / spare)) if spare > 0 else float("nan")
    return ProfileFit(shape.profile(chosen, found), chosen, tuple(tried), rms)


def _try(
    columns: FloatArray, values: FloatArray, place: NDArray[np.intp], points: FloatArray, axis: str, order: Order
) -> Tried:
    """Leave out each point between the ends in turn; by the hat matrix, without fitting anew."""
    Q, R = np.linalg.qr(columns)
    sizes = np.abs(np.diag(R))
    if sizes.min() <= 1e-10 * sizes.max():
        return Tried(order, columns.shape[1], np.inf, np.inf)
    residual = values - Q @ (Q.T @ values)
    own = points[:, "XYZ".index(axis)]
    squares = []
    inside = (own > own.min()) & (own < own.max())
    if len(np.unique(own[inside])) < FEW:
        inside[:] = True
    for k in np.unique(place[inside]):
        rows = np.flatnonzero(place == k)
        free = np.eye(len(rows)) - Q[rows] @ Q[rows].T
        if np.linalg.cond(free) > 1e10:
            return Tried(order, columns.shape[1], np.inf, np.inf)
        squares.append(float(np.mean(np.linalg.solve(free, residual[rows]) ** 2)))
    margin = float(np.std(squares, ddof=1) / np.sqrt(len(squares)))
    return Tried(order, columns.shape[1], float(np.sqrt(np.mean(squares))), margin)


class _Polynomial:
    """Terms u^i v^j w^k: i up to the own degree, j + k up to the others', i + j + k up to the larger of the two."""

    def __init__(self, points: FloatArray, axis: str, others: str) -> None:
        low, high = points.min(axis=0), points.max(axis=0)
        self.low, self.high = low, high
        self.centre = (low + high) / 2
        self.scale = np.where(high > low, (high - low) / 2, 1.0)
        self.scaled = (points - self.centre) / self.scale
        self.own = "XYZ".index(axis)
        self.others = ["XYZ".index(a) for a in others]
        self.distinct = [len(np.unique(points[:, a])) for a in range(3)]

    def orders(self, n_places: int) -> Iterator[Order]:
        """Give the orders that leave a third of the points to spare, and no degree that a coordinate cannot tell."""
        # Least squares on equidistant positions swings between them where the degree is above 2 sqrt(n).
        n_own = self.distinct[self.own]
        highest = min(n_own - 2, int(2 * n_own**0.5), HIGHEST)
        other = min(max((self.distinct[a] - 1 for a in self.others), default=0), HIGHEST_OTHER)
        for i in range(highest + 1):
            for j in range(min(other, i) + 1 if i else 1):
                if 3 * len(self.exponents((i, j))) <= 2 * n_places:
                    yield i, j

    def exponents(self, order: Order) -> list[tuple[int, int, int]]:
        found = []
        limits = [0, 0, 0]
        limits[self.own] = order[0]
        for a in self.others:
            limits[a] = min(order[1], self.distinct[a] - 1)
        for e in np.ndindex(*(n + 1 for n in limits)):
            if sum(e) - e[self.own] <= order[1] and sum(e) <= max(order):
                found.append((e[0], e[1], e[2]))
        return found

    def columns(self, order: Order) -> FloatArray:
        return np.stack([np.prod(self.scaled ** np.array(e), axis=1) for e in self.exponents(order)], axis=1)

    def profile(self, order: Order, found: FloatArray) -> PolynomialProfile:
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


class _Spline:
    """Cubic spline whose inner knots part the positions into equal numbers."""

    def __init__(self, points: FloatArray, axis: str) -> None:
        self.axis = axis
        self.position = points[:, "XYZ".index(axis)]
        self.places = np.unique(self.position)

    def orders(self, n_places: int) -> Iterator[Order]:  # noqa: ARG002 - only positions along the axis count
        """Give the numbers of knots that leave two positions to spare."""
        for n in range(min(len(self.places) - 6, MOST_KNOTS) + 1):
            yield n, 0

    def knots(self, order: Order) -> FloatArray:
        inner = np.quantile(self.places, np.linspace(0, 1, order[0] + 2))
        return np.concatenate([[inner[0]] * 3, inner, [inner[-1]] * 3])

    def columns(self, order: Order) -> FloatArray:
        return np.asarray(BSpline.design_matrix(self.position, self.knots(order), 3).toarray())

    def profile(self, order: Order, found: FloatArray) -> SplineProfile:
        knots = self.knots(order)
        pieces = PPoly.from_spline(BSpline(knots, found, 3))
        ends = knots[3:-3]
        length = np.diff(ends)
        scaled = pieces.c[::-1, 3:-3] * length ** np.arange(4)[:, None]
        return SplineProfile(
            axis=self.axis,
            knots=tuple(ends.tolist()),
            pieces=tuple((float(a), float(b), float(c), float(d)) for a, b, c, d in scaled.T),
        )
