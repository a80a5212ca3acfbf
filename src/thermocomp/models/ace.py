"""`ace`: alternating conditional expectations on ranks, as in Wessel 2004."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thermocomp.core.additive import Additive
from thermocomp.core.curves import Curve
from thermocomp.core.exceptions import InputError
from thermocomp.core.inputs import Input
from thermocomp.core.terms import Variable
from thermocomp.models.ace_thinning import sum_curves, thin
from thermocomp.models.base import FloatArray, StaticRegressor

_NOTHING = Curve((), (0.0,), "step")


@dataclass(frozen=True)
class SampledFunction:
    """A function of one variable, sampled for plots.

    Parameters
    ----------
    x : ndarray of shape (n_rows,)
        Training values, sorted in ascending order.
    y : ndarray of shape (n_rows,)
    """

    x: FloatArray
    y: FloatArray


class TransformRegressor(StaticRegressor):
    """Both sides transformed: theta(y) = phi_1(x_1) + phi_2(x_2) + ... (Wessel 2004, Eq. 2; W-01).

    theta has zero mean and unit variance, each phi has zero mean (E-W3). A constant input has phi = 0. If there is no
    dependence at all (for example, if y is constant), psi is 0 and the mean of y is predicted.

    Attributes
    ----------
    psi_ : float
        Maximal correlation ``|corr(theta, sum phi)|`` that was reached (W-02).
    theta_ : SampledFunction
        theta as a function of y.
    phi_ : tuple of SampledFunction
        phi as a function of each input.
    sum_phi_ : SampledFunction
        Sum of phi against theta for each training row, sorted by y: a straight line if the model holds.
    errors_ : ndarray of shape (n_sweeps,)
        E[(theta - sum phi)^2] after each sweep.
    falling_theta_ : float
        Share of the steps between neighbouring values of y over which theta decreases: there its inverse is not unique,
        and an average of neighbours mixes branches (E-W5).
    data_min_, data_max_ : ndarray of shape (n_features,)
        Trained range; all curves are constant outside it (W-07).
    """

    def _predict(self, change: FloatArray) -> FloatArray:
        return self._inverse(sum_curves(self._curves, list(change.T)))

    def outside(self, X: ArrayLike) -> NDArray[np.bool_]:
        """Return a mask of the values outside the trained range, where the prediction is clipped (W-07).

        Parameters
        ----------
        X : array-like of shape (n_rows, n_features)

        Returns
        -------
        ndarray of bool of shape (n_rows, n_features)
        """
        change = self._checked(X)
        return np.asarray((change < self.data_min_) | (change > self.data_max_))

    def _frozen(self, inputs: Sequence[Input], header: dict[str, Any]) -> Additive:
        active = [j for j, curve in enumerate(self._curves) if curve != _NOTHING]
        curves, response = thin([self._curves[j] for j in active], self._inverse, [self._rows[:, j] for j in active])
        return Additive(
            **header,
            inputs=tuple(inputs[j] for j in active),
            variables=tuple(Variable.single(inputs[j].name, k) for k, j in enumerate(active)),
            curves=curves,
            response=response,
        )

    def _keep(
        self,
        X: FloatArray,
        y: FloatArray,
        theta: FloatArray,
        total: FloatArray,
        curves: dict[int, Curve],
        inverse: Curve,
    ) -> None:
        """Store the transformations; `theta` and `total` (the sum of phi) are per row, `curves` per input."""
        self._curves = tuple(curves.get(j, _NOTHING) for j in range(X.shape[1]))
        self._inverse = inverse
        self._rows = X  # the frozen model must predict the same for these rows
        by_y = np.argsort(y, kind="stable")
        self.theta_ = SampledFunction(y[by_y], theta[by_y])
        self.sum_phi_ = SampledFunction(theta[by_y], total[by_y])
        tables = []
        for j, curve in enumerate(self._curves):
            rising = np.sort(X[:, j])
            tables.append(SampledFunction(rising, curve(rising)))
        self.phi_ = tuple(tables)
        steps = np.diff(self.theta_.y)[np.diff(self.theta_.x) > 0]
        self.falling_theta_ = float(np.mean(steps < 0)) if steps.size else 0.0


@dataclass(kw_only=True, eq=False, repr=False)
class ACE(TransformRegressor):
    """Alternating conditional expectations with a boxcar on ranks and nearest neighbours (Wessel 2004; W-01 to W-05).

    Follows Appendix A (unless `converged`); details that the paper leaves open are settled as follows. All inputs but
    the first start with phi = 0; if E[y|x_1] = 0 for the first input, the first input with a non-zero expectation
    replaces it. theta is normalised, phi is not (E-W3). At the ends of the rank list the boxcar contains only the
    existing ranks; tied values, kept in row order, receive the mean of their boxcar results (E-W4). The functions are
    those of the last sweep.

    In a frozen model, large step tables are thinned (`thermocomp.models.ace_thinning`).

    theta need not be monotonic, and then has no inverse: see ``falling_theta_`` (E-W5) and
    `thermocomp.models.ace_monotone.MonotoneACE`.

    Parameters
    ----------
    half_window : int
        N: the boxcar contains 2N + 1 ranks (W-04). With n rows, N is limited to (n - 1) / 4, so that the window covers
        at most half of the data, but N is at least 1.
    window_share : float, optional
        N as a share of the number of rows, instead of `half_window`: ten ranks are a wide window in 199 rows, but
        follow only noise in 10,000 (E-W8).
    neighbours : int
        k of the nearest-neighbour estimate of phi and of theta^-1 (W-05). With fewer rows, all are used.
    tolerance : float
        Sweeps end when E[(theta - sum phi)^2] fails to decrease by more than this; 0 is the paper's rule (W-03). With
        `converged`: sweeps end when a sweep changes all phi together by no more than this (root mean square; theta has
        norm 1).
    max_sweeps : int
        Maximum number of sweeps. The paper's rule may need thousands: see ``errors_``.
    converged : bool
        Iterate to convergence, with acceleration. With the paper's boxcar the sweeps have no limit when more than five
        inputs increase together: the equations become singular and the sweeps diverge, so the paper's rule stops after
        a few. Here the boxcar is replaced by one of half the width, applied twice, mirrored at the ends, and averaged
        over ties before and after: this operator is symmetric, with eigenvalues from 0 to 1.

    Attributes
    ----------
    psi_, theta_, phi_, sum_phi_, errors_, falling_theta_, data_min_, data_max_
        See `TransformRegressor`.
    half_window_ : int
        N used in the fit.

    References
    ----------
    Breiman, L., Friedman, J. H.: Estimating optimal transformations for multiple regression and correlation. Journal
    of the American Statistical Association 80(391), 1985, 580-598. doi:10.1080/01621459.1985.10478157

    Wessel, N., Konvicka, J., Weidemann, F., Nestmann, S., Neugebauer, R., Schwarz, U., Wessel, A., Kurths, J.:
    Predicting thermal displacements in modular tool systems. Chaos 14, 2004. doi:10.1063/1.1622351

    Examples
    --------
    >>> import numpy as np
    >>> from thermocomp import ACE
    >>> rises = np.random.default_rng(0).uniform(0, 10, (300, 2))  # of two temperatures [degC]
    >>> model = ACE().fit(rises, (rises[:, 0] + np.sqrt(rises[:, 1])) ** 2)
    >>> print(round(model.psi_, 2), f"{model.predict([[5.0, 4.0]])[0]:.0f} um instead of {(5 + 2) ** 2} um")
    1.0 49 um instead of 49 um
    """

    half_window: int = 10
    window_share: float | None = None
    neighbours: int = 2
    tolerance: float = 0.0
    max_sweeps: int = 300
    converged: bool = False

    def _fit(self, change: FloatArray, deviation: FloatArray) -> None:
        if self.neighbours < 1 or self.max_sweeps < 1 or not self.tolerance >= 0:
            raise InputError(
                f"ACE: expected neighbours >= 1, max_sweeps >= 1 and tolerance >= 0, "
                f"found {self.neighbours}, {self.max_sweeps} and {self.tolerance}"
            )
        self.half_window_ = half_window(len(deviation), self.half_window, self.window_share)
        self._alternate(change, deviation)

    def _alternate(self, X: FloatArray, y: FloatArray) -> None:
        from thermocomp.models.kernels import ace as kernel  # importing numba is slow
        from thermocomp.models.kernels import ranks

        varied = np.flatnonzero(self.data_max_ > self.data_min_)
        order, bounds, groups, start = ranks.rank(np.ascontiguousarray(np.vstack([X[:, varied].T, y])))
        by_rank, phi, self.psi_, self.errors_ = kernel.solve(
            order, bounds, groups, start, self.half_window_, self.tolerance, self.max_sweeps, self.converged
        )
        by_y = order[-1]
        theta, total = np.empty(len(y)), np.zeros(len(y))
        theta[by_y] = by_rank
        curves, tables = {}, {}
        for k, j in enumerate(varied.tolist()):
            rows = by_y[order[k]]
            total[rows] += phi[k]
            tables[j] = SampledFunction(X[rows, j], phi[k])
            curves[j] = nearest(tables[j], self.neighbours)
        by_theta = np.argsort(theta, kind="stable")
        inverse = nearest(SampledFunction(theta[by_theta], y[by_theta]), self.neighbours)
        if self.psi_ == 0.0:
            curves, inverse = {}, Curve((), (float(y.mean()),), "step")
        self._keep(X, y, theta, total, curves, inverse)
        self.phi_ = tuple(tables.get(j, t) for j, t in enumerate(self.phi_))  # as found, not from the curves


def half_window(n_rows: int, fixed: int, share: float | None) -> int:
    """Return the half width of the boxcar, at most a quarter of the rows."""
    if share is None:
        if fixed < 1:
            raise InputError(f"half_window {fixed}: expected at least 1")
        wanted = fixed
    else:
        if not 0 < share <= 0.25:
            raise InputError(
                f"window_share {share}: expected more than 0 and at most 0.25 (a window of half of the rows)"
            )
        wanted = round(share * n_rows)
    return max(1, min(wanted, (n_rows - 1) // 4))


def nearest(table: SampledFunction, k: int) -> Curve:
    """Return the mean of the k nearest entries as a function of x, in the form of a step curve.

    The k nearest of sorted entries are contiguous; entry i + k replaces entry i half way between them, and at that
    point entry i + k counts as the nearer one. Entries with equal x are averaged first.
    """
    _, group, count = np.unique(table.x, return_inverse=True, return_counts=True)
    y = (np.bincount(group, table.y) / count)[group]
    k = min(k, len(y))
    # halve each first: the sum of two large numbers may overflow
    breaks = table.x[:-k] / 2 + table.x[k:] / 2
    means = np.lib.stride_tricks.sliding_window_view(y, k).mean(axis=1)
    wide = np.append(np.diff(breaks, prepend=-np.inf) > 0, True)
    return Curve(tuple(np.unique(breaks).tolist()), tuple(means[wide].tolist()), "step")
