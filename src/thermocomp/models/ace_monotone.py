"""`ace-monotone`: alternating conditional expectations with an invertible theta."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import isotonic_regression

from thermocomp.core.curves import Curve
from thermocomp.core.exceptions import InputError
from thermocomp.models.ace import TransformRegressor
from thermocomp.models.base import FloatArray

_SAME = 1e-9  # relative variation below which a channel counts as constant: no sensor has that many digits


@dataclass(kw_only=True, eq=False, repr=False)
class MonotoneACE(TransformRegressor):
    """Converged alternating conditional expectations with an increasing theta and smooth curves (E-W5, E-W8).

    The model of `thermocomp.models.ace.ACE`, adapted to unseen cycles and to controllers:

    - The conditional expectations are penalised splines (piecewise linear on equally spaced knots, second differences
      penalised) instead of a boxcar on ranks. They reproduce straight lines, whereas a boxcar flattens the ends of
      every curve; they do not depend on the number of rows or on ties (E-W4, E-W8).
    - For a given theta all phi are found at once by solving one linear system: collinear temperatures, for which
      back-fitting takes thousands of sweeps, cost nothing extra.
    - theta is made increasing in every sweep (isotonic regression of its knots), so its inverse is unique. Where theta
      is flat, the inverse has a single point: the mean of y there.
    - Outside the trained range the curves continue as straight lines over a share of its span; beyond that they are
      constant.

    Parameters
    ----------
    points : int
        Knots of each curve.
    smoothing : float
        Weight of the integrated squared second derivative, with the (extended) range of each variable scaled to 1.
        At 1e-4 it lowers a single wide arc by 1 % of its height, at 0.01 by half; at 1e-6 the curves follow every bump.
    shrinkage : float
        Weight of the mean square of the curves' knots; decides between collinear inputs.
    extend : float
        Share of the training span by which curves continue outside it: the default margin at which `Support` clips the
        inputs; 0 clips peaks as in the paper (W-07).
    tolerance : float
        Sweeps end when theta changes by less than this (root mean square; theta has norm 1).
    max_sweeps : int
        Maximum number of sweeps.
    max_rows : int
        With more rows than this, equally sized groups of consecutive rows are averaged first to stay within the limit.

    Attributes
    ----------
    psi_, theta_, phi_, sum_phi_, errors_, falling_theta_, data_min_, data_max_
        See `TransformRegressor`; based on the averaged rows, except for the trained range. ``falling_theta_`` is 0.

    References
    ----------
    Breiman, L., Friedman, J. H.: Estimating optimal transformations for multiple regression and correlation. Journal
    of the American Statistical Association 80(391), 1985, 580-598. doi:10.1080/01621459.1985.10478157

    Wessel, N., Konvicka, J., Weidemann, F., Nestmann, S., Neugebauer, R., Schwarz, U., Wessel, A., Kurths, J.:
    Predicting thermal displacements in modular tool systems. Chaos 14, 2004. doi:10.1063/1.1622351

    Eilers, P. H. C., Marx, B. D.: Flexible smoothing with B-splines and penalties. Statistical Science 11(2), 1996,
    89-121.

    Examples
    --------
    >>> import numpy as np
    >>> from thermocomp import MonotoneACE
    >>> rises = np.random.default_rng(0).uniform(0, 10, (300, 2))  # of two temperatures [degC]
    >>> model = MonotoneACE().fit(rises, (rises[:, 0] + np.sqrt(rises[:, 1])) ** 2)
    >>> print(round(model.psi_, 2), f"{model.predict([[5.0, 4.0]])[0]:.0f} um instead of {(5 + 2) ** 2} um")
    1.0 49 um instead of 49 um
    """

    points: int = 20
    smoothing: float = 1e-4
    shrinkage: float = 1e-5
    extend: float = 0.25
    tolerance: float = 1e-6
    max_sweeps: int = 1000
    max_rows: int = 10_000

    def _fit(self, change: FloatArray, deviation: FloatArray) -> None:
        if self.points < 3 or self.max_sweeps < 1 or self.max_rows < 2:
            raise InputError(
                f"MonotoneACE: expected points >= 3, max_sweeps >= 1 and max_rows >= 2, "
                f"found {self.points}, {self.max_sweeps} and {self.max_rows}"
            )
        if not (self.smoothing > 0 and self.shrinkage > 0 and self.extend >= 0 and self.tolerance >= 0):
            raise InputError(
                f"MonotoneACE: expected smoothing > 0, shrinkage > 0, extend >= 0 and tolerance >= 0, "
                f"found {self.smoothing}, {self.shrinkage}, {self.extend} and {self.tolerance}"
            )
        run = -(-len(deviation) // self.max_rows)
        self._alternate(_averaged(change, run), _averaged(deviation, run))

    def _alternate(self, X: FloatArray, y: FloatArray) -> None:
        n, k = len(y), self.points
        varied = [j for j in range(X.shape[1]) if _varies(X[:, j])]
        self.errors_ = np.empty(0)
        if not varied or not _varies(y):
            self._keep_nothing(X, y)
            return
        knots = [_Knots.over(X[:, j], k, self.extend) for j in varied]
        basis = np.hstack([at.basis(X[:, j]) for at, j in zip(knots, varied, strict=True)])
        means = basis.mean(axis=0)
        basis -= means  # each phi has zero mean
        gram = basis.T @ basis
        bending = self.smoothing * n * _bending(k)
        for start in range(0, len(gram), k):
            gram[start : start + k, start : start + k] += bending
        gram[np.diag_indices_from(gram)] += self.shrinkage * n
        factor = cho_factor(gram, overwrite_a=True)
        y_knots = _Knots.over(y, k, self.extend)
        y_basis = y_knots.basis(y)
        y_gram = y_basis.T @ y_basis + bending + 1e-9 * n * np.eye(k)
        y_factor = cho_factor(y_gram)
        theta, errors = (y - y.mean()) / y.std(), []
        while True:
            weights = cho_solve(factor, basis.T @ theta)
            total = basis @ weights
            errors.append(float(np.mean((theta - total) ** 2)))
            level = isotonic_regression(cho_solve(y_factor, y_basis.T @ total)).x
            new = y_basis @ level
            centre, norm = new.mean(), new.std()
            if not norm > _SAME:
                self._keep_nothing(X, y)
                return
            level = (level - centre) / norm
            new = (new - centre) / norm
            moved = np.sqrt(np.mean((new - theta) ** 2))
            theta = new
            if moved <= self.tolerance or len(errors) == self.max_sweeps:
                break
        weights = cho_solve(factor, basis.T @ theta)
        total = basis @ weights
        self.errors_ = np.array(errors)
        self.psi_ = float(abs(np.mean(theta * total)) / total.std())
        curves = {
            j: Curve(at.places, tuple((weights[s : s + k] - means[s : s + k] @ weights[s : s + k]).tolist()))
            for at, j, s in zip(knots, varied, range(0, len(gram), k), strict=True)
        }
        levels, group, count = np.unique(level, return_inverse=True, return_counts=True)
        places = np.bincount(group, y_knots.places) / count
        self._keep(X, y, theta, total, curves, Curve(tuple(levels.tolist()), tuple(places.tolist())))

    def _keep_nothing(self, X: FloatArray, y: FloatArray) -> None:
        self.psi_ = 0.0
        nothing = np.zeros(len(y))
        self._keep(X, y, nothing, nothing, {}, Curve((), (float(y.mean()),), "step"))


@dataclass(frozen=True)
class _Knots:
    """Equally spaced knots of a piecewise linear curve."""

    places: tuple[float, ...]

    @classmethod
    def over(cls, values: FloatArray, points: int, extend: float) -> "_Knots":
        low, high = values.min(), values.max()
        beyond = extend * (high - low)
        return cls(tuple(np.linspace(low - beyond, high + beyond, points).tolist()))

    def basis(self, values: FloatArray) -> FloatArray:
        """Return the weight of each knot for each value, shape (n_values, n_points)."""
        places = np.array(self.places)
        left = np.clip(np.searchsorted(places, values, side="right") - 1, 0, len(places) - 2)
        share = (values - places[left]) / (places[left + 1] - places[left])
        table = np.zeros((len(values), len(places)))
        rows = np.arange(len(values))
        table[rows, left] = 1 - share
        table[rows, left + 1] = share
        return table


def _bending(points: int) -> FloatArray:
    """Return the matrix of the integrated squared second derivative over a range of 1."""
    second = np.diff(np.eye(points), 2, axis=0)
    return np.asarray((points - 1) ** 3 * (second.T @ second))


def _varies(values: FloatArray) -> bool:
    low, high = values.min(), values.max()
    return bool(high - low > _SAME * max(abs(low), abs(high)))


def _averaged(values: FloatArray, run: int) -> FloatArray:
    """Return the means of groups of consecutive rows."""
    starts = np.arange(0, len(values), run)
    lengths = np.diff(np.append(starts, len(values)))
    return np.asarray((np.add.reduceat(values, starts, axis=0).T / lengths).T)
