"""`ppr`: projection pursuit regression."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from thermocomp.core.additive import Additive
from thermocomp.core.curves import Curve
from thermocomp.core.exceptions import InputError
from thermocomp.core.inputs import Input
from thermocomp.core.terms import Variable
from thermocomp.models.base import CycledRegressor, FloatArray, IntArray
from thermocomp.models.shrinkage import Rule, choose, scaling

_KNOTS = 25  # knots of a curve, equally spaced along its projection; smoothness comes from the penalty
_DAMPING = 1e-4  # of a Gauss-Newton step, relative to the mean curvature; needed for collinear inputs
_HALVINGS = 4  # step halvings if a step increases the error
_STEPS = 20  # Gauss-Newton steps for a new term; one per term in a backfitting sweep
_SWEEPS = 20  # backfitting sweeps after each new term
_GAIN = 1e-3  # stop if a step or sweep reduces the residual sum of squares by a smaller share


@dataclass(kw_only=True, eq=False, repr=False)
class ProjectionPursuit(CycledRegressor):
    """Projection pursuit regression (Friedman and Stuetzle 1981), the comparison method of stepwise2017 (T-08).

    Deviation = intercept + f1(a1 . x) + f2(a2 . x) + ... Terms are added one at a time, each fitted to the residual of
    the others: the direction by Gauss-Newton steps, the curve by a smoother. After each new term all terms are refitted
    in turn (backfitting), as in Friedman's SMART (1984) and R's ``ppr``. Differences: the curves are penalised linear
    splines, so that the frozen model represents them exactly and tied temperatures need no rule; terms are only added,
    never dropped; and the number of terms and the smoothness are chosen by cross-validation over thermal cycles.

    A curve is constant outside the range of its projection in training.

    Parameters
    ----------
    max_terms : int
    degrees : sequence of float
        Degrees of freedom to choose from, the same for all curves, above 2 (a straight line).
    rule : {'one-standard-error', 'minimum'}
        Rule for the choice of the number of terms, with the best degrees of freedom.

    Attributes
    ----------
    n_terms_ : int
        Chosen number of terms; smaller if no residual remains to be explained.
    degrees_ : float
        Chosen degrees of freedom of each curve.
    intercept_ : float
    directions_ : ndarray of shape (n_terms, n_features)
        Directions in terms of the unscaled inputs.
    curves_ : tuple of Curve
        One curve per direction.
    r_squared_ : float
        On the training data; nan if the deviation is constant.
    cv_rms_ : float
        Mean of the RMS values of the left-out cycles with the chosen settings [unit of y].
    chosen_by_ : str
        Description of the cross-validation folds.
    data_min_, data_max_ : ndarray of shape (n_features,)
        Trained range.

    References
    ----------
    Friedman, J. H., Stuetzle, W.: Projection pursuit regression. Journal of the American Statistical Association
    76(376), 1981, 817-823. doi:10.1080/01621459.1981.10477729

    Friedman, J. H.: SMART user's guide. Stanford University, Laboratory for Computational Statistics, report 1, 1984.

    Li, K.-C.: On principal Hessian directions for data visualization and dimension reduction: another application of
    Stein's lemma. Journal of the American Statistical Association 87(420), 1992, 1025-1039.

    Examples
    --------
    >>> import numpy as np
    >>> from thermocomp import ProjectionPursuit
    >>> rises = np.random.default_rng(0).uniform(0, 10, (120, 3))  # of three temperatures [degC]
    >>> model = ProjectionPursuit(max_terms=1, degrees=(6.0,)).fit(rises, (rises[:, 0] - rises[:, 1]) ** 2)
    >>> along = model.directions_[0] / model.directions_[0, 0]
    >>> print((along.round(2) + 0.0).tolist(), round(model.r_squared_, 3))
    [1.0, -1.0, 0.0] 0.999
    """

    max_terms: int = 5
    degrees: Sequence[float] = (3.0, 6.0)
    rule: Rule = "one-standard-error"

    def _fit(self, change: FloatArray, deviation: FloatArray, folds: IntArray) -> None:
        degrees = self._settings()
        rms = np.empty((len(degrees), self.max_terms, int(folds.max()) + 1))
        for k in range(rms.shape[2]):
            out = folds == k
            for i, df in enumerate(degrees):
                for j, model in enumerate(_path(change[~out], deviation[~out], self.max_terms, df)):
                    rms[i, j, k] = np.sqrt(np.mean((deviation[out] - model.predict(change[out])) ** 2))
        which, setting = choose(rms, self.rule)
        self.cv_rms_ = float(rms[which, setting].mean())
        self.degrees_ = degrees[which]
        found = _path(change, deviation, setting + 1, self.degrees_)[-1]
        self.intercept_, self.directions_, self.curves_ = found.intercept, found.directions, found.curves
        self.n_terms_ = len(self.curves_)
        total = float(np.sum((deviation - deviation.mean()) ** 2))
        residual = deviation - found.predict(change)
        self.r_squared_ = 1 - float(residual @ residual) / total if total > 0 else float("nan")

    def _predict(self, change: FloatArray) -> FloatArray:
        return _Model(self.intercept_, self.directions_, self.curves_).predict(change)

    def _settings(self) -> tuple[float, ...]:
        degrees = tuple(float(d) for d in self.degrees)
        if self.max_terms < 1:
            raise InputError(f"max_terms {self.max_terms}: expected at least 1")
        if not degrees or not all(2 < d < _KNOTS for d in degrees):
            raise InputError(f"degrees {self.degrees}: expected degrees of freedom above 2 and below {_KNOTS}")
        return degrees

    def _frozen(self, inputs: Sequence[Input], header: dict[str, Any]) -> Additive:
        sensors = np.flatnonzero(self.directions_.any(axis=0)).tolist()
        variables = []
        for direction in self.directions_.tolist():
            weights = tuple((k, direction[i]) for k, i in enumerate(sensors) if direction[i] != 0)
            name = " ".join(f"{w:+.3g} {inputs[sensors[k]].name}" for k, w in weights)
            variables.append(Variable(name.removeprefix("+"), weights))
        return Additive(
            **header,
            inputs=tuple(inputs[i] for i in sensors),
            variables=tuple(variables),
            curves=self.curves_,
            intercept=self.intercept_,
        )


@dataclass(frozen=True)
class _Model:
    """Fitted model in terms of the unscaled inputs."""

    intercept: float
    directions: FloatArray
    curves: tuple[Curve, ...]

    def predict(self, X: FloatArray) -> FloatArray:
        total = np.full(len(X), self.intercept)
        for direction, curve in zip(self.directions, self.curves, strict=True):
            total += curve(X @ direction)
        return total


@dataclass(frozen=True)
class _Smooth:
    """A curve fitted to scattered data: range, values at its knots, and values and slopes at the rows."""

    low: float
    high: float
    knots: FloatArray
    values: FloatArray
    slopes: FloatArray


@dataclass(frozen=True)
class _Term:
    """Direction in standardised inputs, the curve along it, and the penalty used for its fit."""

    direction: FloatArray
    smooth: _Smooth
    penalty: float


_BEND = np.diff(np.eye(_KNOTS), 2, axis=0)  # second differences of a curve's values at its knots
_BENDING = _BEND.T @ _BEND
_BANDS = np.array([np.r_[np.zeros(2 - k), np.diag(_BENDING, 2 - k)] for k in range(3)])
_SLOPES = np.gradient(np.eye(_KNOTS), axis=0)
_PENALTIES = np.logspace(-10, 6, 65)


def _normal(u: FloatArray) -> tuple[FloatArray, NDArray[np.intp], FloatArray]:
    """Return the upper bands of the normal matrix of a linear spline, and each row's position between its knots."""
    low, high = u.min(), u.max()
    place = (u - low) * ((_KNOTS - 1) / (high - low))
    piece = np.minimum(place.astype(np.intp), _KNOTS - 2)
    share = place - piece
    rest = 1 - share
    bands = np.zeros((3, _KNOTS))
    bands[2] = np.bincount(piece, rest * rest, _KNOTS)
    bands[2, 1:] += np.bincount(piece, share * share, _KNOTS)[:-1]
    bands[1, 1:] = np.bincount(piece, share * rest, _KNOTS)[:-1]
    bands /= len(u)
    bands[2] += 1e-9 / _KNOTS  # keeps the matrix regular if the values lie in a few intervals only
    return bands, piece, share


def _penalty(u: FloatArray, degrees: float) -> float:
    """Return the curvature penalty for which a curve has a given number of degrees of freedom."""
    bands = _normal(u)[0]
    gram = np.diag(bands[2]) + np.diag(bands[1, 1:], 1) + np.diag(bands[1, 1:], -1)
    bending = linalg.eigh(_BENDING, gram, eigvals_only=True)
    free = np.sum(1 / (1 + _PENALTIES[:, None] * np.maximum(bending, 0.0)), axis=1)
    return float(np.exp(np.interp(-degrees, -free, np.log(_PENALTIES))))


def _smooth(u: FloatArray, r: FloatArray, penalty: float) -> _Smooth:
    """Smooth scattered data by a penalised linear spline with zero mean."""
    bands, piece, share = _normal(u)
    right = np.bincount(piece, (1 - share) * r, _KNOTS)
    right[1:] += np.bincount(piece, share * r, _KNOTS)[:-1]
    knots: FloatArray = linalg.solveh_banded(bands + penalty * _BANDS, right / len(u), check_finite=False)
    low, high = float(u.min()), float(u.max())
    slopes = _SLOPES @ knots * ((_KNOTS - 1) / (high - low))
    values = knots[piece] + share * np.diff(knots)[piece]
    mean = values.mean()
    return _Smooth(
        low=low,
        high=high,
        knots=knots - mean,
        values=values - mean,
        slopes=slopes[piece] + share * np.diff(slopes)[piece],
    )


def _bends(u: FloatArray) -> bool:
    """Return whether a projection varies by more than rounding, so that a curve can be fitted."""
    low, high = u.min(), u.max()
    return bool(high - low > 1e-12 * max(abs(low), abs(high)))


def _pursue(Z: FloatArray, r: FloatArray, term: _Term, steps: int) -> _Term:
    """Improve the direction of a term by Gauss-Newton steps, refitting its curve after each."""
    residual = r - term.smooth.values
    rss = float(residual @ residual)
    for _ in range(steps):
        weighted = Z * term.smooth.slopes[:, None]
        curvature = weighted.T @ weighted
        mean = float(np.trace(curvature)) / len(curvature)
        if not mean > 0:
            break
        curvature.flat[:: len(curvature) + 1] += _DAMPING * mean
        turn = np.linalg.solve(curvature, weighted.T @ residual)
        better = None
        for halving in range(_HALVINGS + 1):
            direction = term.direction + turn / 2**halving
            direction /= np.linalg.norm(direction)
            u = Z @ direction
            if not _bends(u):
                continue
            smooth = _smooth(u, r, term.penalty)
            left = r - smooth.values
            if (new := float(left @ left)) < rss:
                better = _Term(direction, smooth, term.penalty)
                break
        if better is None:
            break
        gain = rss - new
        term, residual, rss = better, left, new
        if gain < _GAIN * rss:
            break
    return term


def _starts(Z: FloatArray, r: FloatArray) -> list[FloatArray]:
    """Return starting directions: steepest slope of the residual, and its strongest curvature (Li 1992)."""
    gram = Z.T @ Z / len(Z)
    values, vectors = linalg.eigh(gram)
    kept = values > 1e-6 * values[-1]
    white = vectors[:, kept] / np.sqrt(values[kept])
    rise = white @ (white.T @ (Z.T @ r))
    W = Z @ white
    bends, axes = linalg.eigh((W * r[:, None]).T @ W)
    strongest = white @ axes[:, np.argmax(np.abs(bends))]
    return [d / np.linalg.norm(d) for d in (rise, strongest) if np.linalg.norm(d) > 0]


def _new_term(Z: FloatArray, r: FloatArray, degrees: float) -> _Term | None:
    """Return the term that explains most of the residual; None if no projection varies."""
    found = []
    for direction in _starts(Z, r):
        u = Z @ direction
        if _bends(u):
            penalty = _penalty(u, degrees)
            found.append(_pursue(Z, r, _Term(direction, _smooth(u, r, penalty), penalty), _STEPS))
    return min(found, key=lambda t: float(np.sum((r - t.smooth.values) ** 2)), default=None)


def _path(X: FloatArray, y: FloatArray, max_terms: int, degrees: float) -> list[_Model]:
    """Return models with 1, 2, ... terms; the last model is repeated if no residual remains to be explained."""
    centre, scale = scaling(X)
    Z = (X - centre) / scale
    mean = float(y.mean())
    left = y - mean
    enough = 1e-24 * float(y @ y)
    terms: list[_Term] = []
    models: list[_Model] = []
    for _ in range(max_terms):
        new = _new_term(Z, left, degrees) if Z.any() and left @ left > enough else None
        if new is not None:
            terms.append(new)
            left = left - new.smooth.values
            left = _backfit(Z, left, terms)
        models.append(_raw(terms, mean, centre, scale))
    return models


def _backfit(Z: FloatArray, left: FloatArray, terms: list[_Term]) -> FloatArray:
    """Refit all terms in turn, each to the residual of the others; return the final residual."""
    for _ in range(_SWEEPS if len(terms) > 1 else 0):
        before = float(left @ left)
        for k, term in enumerate(terms):
            r = left + term.smooth.values
            again = _Term(term.direction, _smooth(Z @ term.direction, r, term.penalty), term.penalty)
            terms[k] = _pursue(Z, r, again, 1)
            left = r - terms[k].smooth.values
        if before - float(left @ left) < _GAIN * before:
            break
    return left


def _raw(terms: Sequence[_Term], mean: float, centre: FloatArray, scale: FloatArray) -> _Model:
    """Return the model in terms of the unscaled inputs."""
    directions = np.array([t.direction / scale for t in terms]).reshape(len(terms), len(scale))
    curves = []
    for direction, t in zip(directions, terms, strict=True):
        x = np.linspace(t.smooth.low, t.smooth.high, _KNOTS) + direction @ centre
        curves.append(Curve(tuple(x.tolist()), tuple(t.smooth.knots.tolist())))
    return _Model(mean, directions, tuple(curves))
