"""Geometric part f_g of an error: a polynomial or a spline; its order is chosen by cross-validation (C-04, C-06)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as fisher

from thermocomp.core.arrays import FloatArray
from thermocomp.core.exceptions import FitError, InputError
from thermocomp.core.profile import Profile
from thermocomp.recordings.profiles import MIN_POSITIONS
from thermocomp.volumetric.models.shapes import Order, PolynomialShape, SplineShape, ThroughMeans

Kind = Literal["polynomial", "spline"]

#: minimum number of positions between the ends for cross-validation without the ends
FEW = 3
#: A spline through all means is used if its mean square at left-out points is below this share of a polynomial's. With
#: few positions, leaving one out doubles the spacing and overestimates its error: a larger share is then allowed, and
#: any share compared with a constant, which only noise can favour.
CLEARLY, BARELY, FEW_POSITIONS = 0.5, 1.25, 8
#: significance level of the test whether a fit leaves more than the scatter of repeated values
LEVEL = 0.01


@dataclass(frozen=True)
class Tried:
    """A candidate for the profile of an error component.

    Parameters
    ----------
    order : (int, int)
        Polynomial: degree in the axis' own coordinate and in the others. Spline: number of inner knots, and 0.
    left_out : float
        Cross-validation error (RMS), with each point left out in turn [unit]; inf if the remaining points do not
        determine the profile.
    margin : float
        Standard error of the mean square [unit^2].
    misfit : float
        Probability that a fit whose residual is only noise exceeds the scatter of repeated values by this much (F test
        for lack of fit); nan if the noise is unknown.
    through : bool
        True for the natural spline through the means of all positions, whose order is (positions - 2, 0).
    """

    order: Order
    n_terms: int
    left_out: float
    margin: float
    misfit: float = float("nan")
    through: bool = False


@dataclass(frozen=True)
class ProfileFit:
    """A geometric profile and the candidates considered.

    Parameters
    ----------
    order : (int, int)
        See `Tried`.
    tried : tuple of Tried
        Candidates by increasing number of terms; empty if the order was given.
    rms : float
        Residual of the fit per degree of freedom [unit]; nan without degrees of freedom.
    noise : float
        Standard deviation of repeated values at one point [unit]; nan if no point is repeated, or only with equal
        values.
    misfit : float
        See `Tried`.
    through : bool
        True for the natural spline through the means of all positions.
    """

    profile: Profile
    order: Order
    tried: tuple[Tried, ...]
    rms: float
    noise: float = float("nan")
    misfit: float = float("nan")
    through: bool = False

    @property
    def leaves_more(self) -> bool:
        """True if the residual clearly exceeds the noise, which is known only if points are repeated."""
        return self.misfit < LEVEL

    @property
    def words(self) -> str:
        """Return cautions about the fit of the profile, as text; empty if there are none."""
        if self.leaves_more:
            return (
                f"leaves a residual of {self.rms:.3g}, but repeated values differ only by {self.noise:.3g}: it misses "
                "part of the shape"
            )
        return ""


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

    Without a given order, the candidates are those with at most two thirds as many terms as points. Each point between
    the ends of the axis' travel is left out in turn, with all its values, and predicted from the others; of the orders
    whose mean square is within one standard error of the smallest, the one with the fewest terms is used. The ends are
    not left out: a profile is never used beyond them, and extrapolation there would dominate the choice. If there are
    fewer than three positions between the ends, the ends are left out as well.

    If points are repeated, the noise is known: orders whose residual clearly exceeds it are not used (`LEVEL`).

    With 5 to 8 positions there may be no order that follows the profile. Along one coordinate a natural spline through
    the means of all positions therefore competes, from 4 positions on. It is used if no order fits, or if it predicts
    left-out points clearly better (`CLEARLY`); with few positions and unknown noise also if about as well (`BARELY`),
    or better than a constant. It follows the noise, but misses little of the shape.

    Parameters
    ----------
    points : ndarray of shape (n, 3)
        x, y, z [mm]; points may be repeated.
    values : ndarray of shape (n,)
        [unit]; nan where a value is missing.
    axis : {'X', 'Y', 'Z'}
        Axis of the error component (own coordinate).
    kind : {'polynomial', 'spline'}
        Polynomial in all coordinates, or cubic spline along the own coordinate.
    coordinates : str, optional
        Axes that the profile may depend on, such as ``YX``. Default: all axes whose position varies.
    """
    there = np.isfinite(values)
    points, values = points[there], values[there]
    others, n_own = _suited(points, axis, kind, coordinates)
    place = np.unique(points, axis=0, return_inverse=True)[1].ravel()
    shape = SplineShape(points, axis) if kind == "spline" else PolynomialShape(points, axis, others)
    tried: list[Tried] = []
    through = False
    if order == "auto":
        n_places = int(place.max()) + 1
        tried = [_try(shape.columns(o), values, place, points, axis, o) for o in shape.orders(n_places)]
        if n_own > MIN_POSITIONS and (kind == "spline" or not others):
            tried.append(_try_through(ThroughMeans(points, axis), values, place, points, axis))
        if not tried or not np.isfinite(min(t.left_out for t in tried)):
            raise FitError(f"profile along {axis}: {n_places} points are too few to choose an order; give the order")
        tried.sort(key=lambda t: (t.n_terms, t.order))
        best = _choose(tried, n_own)
        chosen, through = best.order, best.through
    else:
        chosen = order if isinstance(order, tuple) else (order, 1 if others and order and kind == "polynomial" else 0)
        if min(chosen) < 0:
            raise InputError(f"order {order}: must not be negative")
    taken = ThroughMeans(points, axis) if through else shape
    columns = taken.columns(chosen)
    n_terms = columns.shape[1]
    if np.linalg.matrix_rank(columns) < n_terms:
        raise FitError(
            f"profile along {axis}: {len(np.unique(place))} different points do not determine {n_terms} terms; "
            "choose a lower order"
        )
    found: FloatArray = np.asarray(np.linalg.lstsq(columns, values)[0], dtype=np.float64)
    left = values - columns @ found
    spare = len(values) - n_terms
    return ProfileFit(
        profile=taken.profile(chosen, found),
        order=chosen,
        tried=tuple(tried),
        rms=float(np.sqrt(left @ left / spare)) if spare > 0 else float("nan"),
        noise=float(np.sqrt(_noise(values, place)[0])),
        misfit=_misfit(left, values, place, n_terms),
        through=through,
    )


def _suited(points: FloatArray, axis: str, kind: Kind, coordinates: str | None) -> tuple[str, int]:
    """Return the other axes of the profile and the number of positions along its own; raise an error for bad points."""
    varying = "".join(a for k, a in enumerate("XYZ") if points.size and np.ptp(points[:, k]) > 0)
    used = varying if coordinates is None else coordinates
    if axis not in varying:
        raise FitError(f"profile along {axis}: all positions along {axis} are the same")
    if kind not in ("polynomial", "spline"):
        raise InputError(f"profile {kind!r}: choose polynomial or spline")
    if any(a not in "XYZ" for a in used) or (coordinates is not None and axis not in used):
        raise InputError(f"coordinates {used!r}: name the axis {axis} itself and, if required, others of X, Y, Z")
    others = "".join(a for a in used if a != axis and a in varying)
    if kind == "spline" and others and coordinates is not None:
        raise InputError(f"a spline depends on {axis} only; choose a polynomial for the coordinates {used}")
    n_own = len(np.unique(points[:, "XYZ".index(axis)]))
    if n_own < MIN_POSITIONS:
        raise FitError(f"profile along {axis}: values at {n_own} positions; at least {MIN_POSITIONS} are needed")
    return others, n_own


def _choose(tried: Sequence[Tried], n_own: int) -> Tried:
    """Choose among candidates sorted by their number of terms."""
    through = next((t for t in tried if t.through), None)
    orders = [t for t in tried if not t.through and np.isfinite(t.left_out)]
    fitting = [t for t in orders if not t.misfit < LEVEL]
    if through is not None and np.isfinite(through.left_out) and not fitting:
        return through
    best = min(fitting or orders, key=lambda t: t.left_out)
    chosen = next(t for t in fitting or orders if t.left_out**2 <= best.left_out**2 + best.margin)
    if through is None:
        return chosen
    hard = n_own <= FEW_POSITIONS and np.isnan(chosen.misfit)
    share = CLEARLY if not hard else BARELY if chosen.n_terms > 1 else 1.0
    return through if through.left_out**2 < share * chosen.left_out**2 else chosen


def _noise(values: FloatArray, place: NDArray[np.intp]) -> tuple[float, int]:
    """Return the variance of repeated values and its degrees of freedom; nan and 0 if unknown."""
    count = np.bincount(place)
    within = values - (np.bincount(place, values) / count)[place]
    spare = len(values) - len(count)
    # identical values are copies of one measurement, not repetitions
    if np.abs(within).max() <= 1e-9 * np.abs(values).max():
        return float("nan"), 0
    return float(within @ within / spare), spare


def _misfit(left: FloatArray, values: FloatArray, place: NDArray[np.intp], n_terms: int) -> float:
    """Return the probability of the F test for lack of fit, from the residual of a fit."""
    noise, spare = _noise(values, place)
    free = int(place.max()) + 1 - n_terms
    if not spare or free <= 0:
        return 1.0 if spare else float("nan")
    lack = max(float(left @ left) - noise * spare, 0.0) / free
    return float(fisher.sf(lack / noise, free, spare))


def _left_out(points: FloatArray, place: NDArray[np.intp], axis: str) -> NDArray[np.intp]:
    """Return the points to leave out in turn: those between the ends."""
    own = points[:, "XYZ".index(axis)]
    inside = (own > own.min()) & (own < own.max())
    return np.unique(place[inside] if len(np.unique(own[inside])) >= FEW else place)


def _try(
    columns: FloatArray, values: FloatArray, place: NDArray[np.intp], points: FloatArray, axis: str, order: Order
) -> Tried:
    """Return the result of leaving out each point between the ends in turn, by the hat matrix without refitting."""
    n_terms = columns.shape[1]
    Q, R = np.linalg.qr(columns)
    sizes = np.abs(np.diag(R))
    if sizes.min() <= 1e-10 * sizes.max():
        return Tried(order, n_terms, np.inf, np.inf)
    residual = values - Q @ (Q.T @ values)
    squares = []
    for k in _left_out(points, place, axis):
        rows = np.flatnonzero(place == k)
        free = np.eye(len(rows)) - Q[rows] @ Q[rows].T
        if np.linalg.cond(free) > 1e10:
            return Tried(order, n_terms, np.inf, np.inf)
        squares.append(float(np.mean(np.linalg.solve(free, residual[rows]) ** 2)))
    left_out, margin = _mean(squares)
    misfit = _misfit(residual, values, place, n_terms)
    return Tried(order=order, n_terms=n_terms, left_out=left_out, margin=margin, misfit=misfit)


def _try_through(
    spline: ThroughMeans, values: FloatArray, place: NDArray[np.intp], points: FloatArray, axis: str
) -> Tried:
    """Return the result of leaving out each point between the ends in turn, with a spline through the others."""
    squares = []
    for k in _left_out(points, place, axis):
        out = place == k
        told = spline.through(values, ~out)(spline.position[out])
        squares.append(float(np.mean((values[out] - told) ** 2)))
    n_terms = len(spline.places)
    residual = values - spline.through(values)(spline.position)
    misfit = _misfit(residual, values, place, n_terms)
    left_out, margin = _mean(squares)
    return Tried(order=(n_terms - 2, 0), n_terms=n_terms, left_out=left_out, margin=margin, misfit=misfit, through=True)


def _mean(squares: Sequence[float]) -> tuple[float, float]:
    """Return the root of the mean of squares, and the standard error of the mean."""
    return float(np.mean(squares) ** 0.5), float(np.std(squares, ddof=1) / len(squares) ** 0.5)
