"""`subsets`: exact best set of temperatures, with its size chosen by cross-validation over cycles or by a criterion."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thermocomp.core.exceptions import FitError, InputError
from thermocomp.models.base import FloatArray, IntArray
from thermocomp.models.linear import TermRegressor
from thermocomp.models.numerics.leastsquares import join_columns, solve, triangle
from thermocomp.models.selection.subsets import Subsets, best_subsets

Criterion = Literal["mse", "adjr2", "cp", "bic", "cycles"]


def scores(found: Subsets) -> dict[str, FloatArray]:
    """Return the criteria of the best sets, one number for each of ``found.best``.

    With n rows, s columns, residual sum of squares SSE and R2 (uncentred if there is no intercept):

    - ``mse``: SSE / (n - s - 1), without intercept SSE / (n - s) (H-05);
    - ``adjr2``: adjusted R2, the greater the better; it ranks the sizes like ``mse``;
    - ``cp``: Mallows' SSE / s2 + 2 (s + 1) - n with s2 from the model of all columns;
    - ``bic``: n log(1 - R2) + (s + 1) log n.

    All are defined as in the R package leaps, and all treat the rows as independent.

    Returns
    -------
    dict of str to ndarray of shape (n_best,)
        nan where no degree of freedom remains.
    """
    n, one = found.n_rows, int(found.intercept)
    rss = np.array([s.rss for s in found.best])
    size = np.array([len(s.columns) for s in found.best], dtype=np.float64)
    left = found.dof - size
    left[left <= 0] = np.nan
    full = found.dof - found.rank
    share = rss / found.total if found.total > 0 else np.full(len(rss), np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):  # in case of a perfect fit
        return {
            "mse": rss / left,
            "adjr2": 1 - share * found.dof / left,
            "cp": rss / (np.float64(found.full_rss) / full if full > 0 else np.nan) + 2 * (size + one) - n,
            "bic": n * np.log(share) + (size + one) * np.log(n),
        }


@dataclass(kw_only=True, eq=False, repr=False)
class BestSubset(TermRegressor):
    """Linear least squares on the best of all possible sets of temperatures (H-05, H-07).

    For every size the set with the smallest residual sum of squares is found exactly, or the certificate states "not
    proven" (`thermocomp.models.selection.subsets.best_subsets`). The size is chosen by the criterion. ``cycles``: the
    search is repeated with each thermal cycle left out in turn, so that the cycle is unseen by the selection as well,
    and the size with the smallest RMS over all left-out cycles is chosen.

    ``mse``, ``adjr2``, ``cp`` and ``bic`` treat the rows as independent. The rows of a time series are not (E-C12), and
    all four, including BIC, then select far too many temperatures; prefer ``cycles``.

    Parameters
    ----------
    criterion : {'cycles', 'bic', 'cp', 'adjr2', 'mse'}, optional
        Default: ``cycles`` if `fit` receives cycles, else ``bic``. If ``cycles`` is requested without cycles, five
        blocks of equal length replace them.
    size : int, optional
        Fixed number of temperatures, or the largest possible number if smaller. Default: chosen by `criterion`.
    max_size : int, optional
        Largest size to search; required for more than about 50 temperatures, or for at least as many as there are rows.
    rule : {'minimum', 'one-standard-error'}
        For ``cycles``: the best size, or the smallest size whose mean square error over the cycles is within one
        standard error of the best.
    fit_intercept : bool
        False: the model returns zero in the reference state.
    jobs : int
        Number of threads.
    nodes : int, optional
        Stop each search after about this number of sets.
    seconds : float, optional
        Time limit of each search, approximate [s].
    progress : callable, optional
        Called about once a second with a line of text.

    Attributes
    ----------
    subsets_ : Subsets
        Best set of every size, with its certificate.
    scores_ : dict of str to ndarray
        Criteria of ``subsets_.best``, see `scores`; for ``cycles`` the RMS over the left-out cycles [unit of y].
    selected_ : tuple of int
        Features in the model, in ascending order.
    proven_ : bool
        Whether it is proven that no other set of that size fits as well.
    criterion_ : str
        Criterion that determined the size; ``size`` if the size was given. After a KeyboardInterrupt the search stops
        with its present result, and ``bic`` replaces ``cycles``.
    chosen_by_ : str
        Description of the cross-validation folds; empty if there were none.
    terms_, coef_, intercept_, r_squared_, adjusted_r_squared_, standard_error_, n_effective_, condition_
        See `thermocomp.models.linear.TermRegressor`.

    References
    ----------
    Furnival, G. M., Wilson, R. W.: Regressions by leaps and bounds. Technometrics 16(4), 1974, 499-511.
    doi:10.1080/00401706.1974.10489231

    Gatu, C., Kontoghiorghes, E. J.: Branch-and-bound algorithms for computing the best-subset regression models.
    Journal of Computational and Graphical Statistics 15(1), 2006, 139-156.

    Hwang, S.-H., Lee, J.-H., Yang, S.-H.: Optimal Variable Selection in a Thermal Error Model for Real Time Error
    Compensation (in Korean). From a study that was funded in 1997.

    Examples
    --------
    >>> import numpy as np
    >>> from thermocomp import BestSubset
    >>> rng = np.random.default_rng(0)
    >>> rises = rng.uniform(0, 10, (100, 8))  # of eight temperatures, two of which matter [degC]
    >>> y = 5 * rises[:, 1] - 3 * rises[:, 6] + rng.normal(size=100)
    >>> model = BestSubset(rule="one-standard-error").fit(rises, y, cycle=np.arange(100) // 20)
    >>> print(model.selected_, model.proven_, model.coef_.round(1).tolist())
    (1, 6) True [5.0, -3.0]
    """

    criterion: Criterion | None = None
    size: int | None = None
    max_size: int | None = None
    rule: Literal["minimum", "one-standard-error"] = "minimum"
    fit_intercept: bool = True
    jobs: int = 1
    nodes: int | None = None
    seconds: float | None = None
    progress: Callable[[str], None] | None = None

    def fit(self, X: ArrayLike, y: ArrayLike, *, cycle: ArrayLike | None = None) -> "BestSubset":
        """Search, choose the size, and fit.

        Parameters
        ----------
        X : array-like of shape (n_rows, n_features)
            Temperatures minus their reference.
        y : array-like of shape (n_rows,)
            Deviation.
        cycle : array-like of int of shape (n_rows,), optional
            Thermal cycle of each row; rows with -1 are not used for training.

        Returns
        -------
        BestSubset

        Raises
        ------
        FitError
            Fewer than two training rows.
        InputError
            A setting is out of range, or there are too many dependent columns (see `max_size`).
        KeyboardInterrupt
            Interrupted during the cross-validation. An interrupt before that ends only the search, and the fit
            continues with the present result.
        """
        criterion = self.criterion or ("bic" if cycle is None else "cycles")
        if criterion not in {"mse", "adjr2", "cp", "bic", "cycles"} or (self.size is not None and self.size < 1):
            raise InputError(
                f"criterion {criterion!r}, size {self.size}: expected mse, adjr2, cp, bic or cycles, and a size of at "
                "least 1"
            )
        change, deviation, folds, left_out = self._learned(X, y, cycle)
        sizes = self.size or self.max_size
        self.selected_: tuple[int, ...] = ()
        self.proven_, self.criterion_, self.chosen_by_ = True, "none", ""
        self.scores_: dict[str, FloatArray] = {}
        with suppress(FitError):  # if all columns are constant, the model is the mean
            self.subsets_ = self._search(change, deviation, sizes)
            if not self.subsets_.best:
                raise InputError("best subsets: stopped before a set was found; increase nodes or seconds")
            self.scores_ = scores(self.subsets_)
            self.criterion_ = "size" if self.size is not None else criterion
            place = -1
            if self.criterion_ == "cycles":
                try:
                    place, self.chosen_by_ = self._by_cycles(change, deviation, folds), left_out
                except KeyboardInterrupt:  # keep the present result
                    self.criterion_ = "bic"
            if self.criterion_ in ("mse", "adjr2", "cp", "bic"):
                score = self.scores_[self.criterion_] * (-1 if self.criterion_ == "adjr2" else 1)
                place = int(np.nanargmin(score)) if not np.isnan(score).all() else 0
            chosen = self.subsets_.best[place]
            self.selected_, self.proven_ = chosen.columns, chosen.proven
        self._regress(change, deviation, self.selected_)
        return self

    def _search(self, X: FloatArray, y: FloatArray, sizes: int | None) -> Subsets:
        return best_subsets(
            X,
            y,
            intercept=self.fit_intercept,
            max_size=sizes,
            jobs=self.jobs,
            nodes=self.nodes,
            seconds=self.seconds,
            progress=self.progress,
        )

    def _by_cycles(self, X: FloatArray, y: FloatArray, folds: IntArray) -> int:
        """Return the index in ``subsets_.best`` of the set that best predicts cycles unseen by both search and fit."""
        if self.subsets_.stopped == "interrupted":
            raise KeyboardInterrupt
        sizes = [len(s.columns) for s in self.subsets_.best]
        n_folds = int(folds.max()) + 1
        squares = np.full((len(sizes), n_folds), np.nan)
        if n_folds > 1:
            for k in range(n_folds):
                squares[:, k] = self._unseen(X, y, folds == k, sizes)
        pooled = np.sqrt(squares.sum(axis=1) / len(y))
        self.scores_["cycles"] = pooled
        if np.isnan(pooled).all():
            return 0
        best = int(np.nanargmin(pooled))
        if self.rule == "one-standard-error":
            mean = squares / np.bincount(folds)
            limit = mean[best].mean() + mean[best].std(ddof=1) / np.sqrt(n_folds)
            best = int(np.flatnonzero(mean.mean(axis=1) <= limit)[0])
        return best

    def _unseen(self, X: FloatArray, y: FloatArray, out: NDArray[np.bool_], sizes: list[int]) -> FloatArray:
        """Return the sum of squared errors on the left-out rows, for each size; nan if there is no set of that size."""
        errors = np.full(len(sizes), np.nan)
        train, known = X[~out], y[~out]
        try:
            found = self._search(train, known, max(sizes))
        except FitError:
            return errors
        if found.stopped == "interrupted":
            raise KeyboardInterrupt
        tri = triangle(join_columns(train, known), intercept=self.fit_intercept)
        for best in found.best:
            if len(best.columns) in sizes:
                model: Any = solve(train, known, tri, columns=best.columns)
                missed = y[out] - model.intercept - X[out][:, best.columns] @ model.coefficients
                errors[sizes.index(len(best.columns))] = missed @ missed
        return errors
