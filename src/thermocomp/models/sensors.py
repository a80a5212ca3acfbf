"""`SensorSelector`: sensor selection methods as a step of a scikit-learn Pipeline."""

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from inspect import signature
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, clone
from sklearn.feature_selection import SelectorMixin
from sklearn.utils.validation import check_is_fitted, validate_data

from thermocomp.core.exceptions import InputError
from thermocomp.models.base import ThermalRegressor
from thermocomp.models.grouping import CorrelationGrouping
from thermocomp.models.lasso import Lasso
from thermocomp.models.partial_f import PartialF
from thermocomp.models.second_order import SecondOrderRegression
from thermocomp.models.subsets import BestSubset

#: selection methods, as on the command line
SELECTORS: dict[str, type[ThermalRegressor]] = {
    "grouping": CorrelationGrouping,
    "partial-f": PartialF,
    "stepwise": SecondOrderRegression,
    "subsets": BestSubset,
    "lasso": Lasso,
}


@dataclass(eq=False, repr=False)
class SensorSelector(SelectorMixin, BaseEstimator):
    """Transformer that keeps the sensors chosen by a method.

    Parameters
    ----------
    method : str or estimator
        ``grouping``, ``partial-f``, ``stepwise``, ``subsets``, ``lasso``; or the estimator of such a method with custom
        settings, such as ``CorrelationGrouping(threshold=0.95)``. All inputs used by its frozen model are kept.
    keep : sequence of str or int
        Names (or indices) of columns that are always kept, such as the spindle speed.
    time : {'column'} or None
        ``"column"``: the first column is the time, for a later step with a memory; it is kept.

    Attributes
    ----------
    estimator_ : ThermalRegressor
        The method, fitted to the candidate columns.
    n_features_in_ : int

    References
    ----------
    Guyon, I., Elisseeff, A.: An introduction to variable and feature selection. Journal of Machine Learning Research 3,
    2003, 1157-1182.

    Pedregosa, F., et al.: Scikit-learn: machine learning in Python. Journal of Machine Learning Research 12, 2011,
    2825-2830.

    Examples
    --------
    >>> import numpy as np
    >>> from thermocomp import SensorSelector
    >>> rng = np.random.default_rng(0)
    >>> rises = rng.uniform(0, 10, (200, 6))  # of six temperatures, two of which matter [degC]
    >>> selector = SensorSelector("partial-f").fit(rises, 5 * rises[:, 1] - 3 * rises[:, 4] + rng.normal(size=200))
    >>> print(selector.get_support(indices=True).tolist(), selector.transform(rises).shape)
    [1, 4] (200, 2)
    """

    method: str | ThermalRegressor = "subsets"
    _: KW_ONLY
    keep: Sequence[str | int] = ()
    time: Literal["column"] | None = None

    def fit(self, X: ArrayLike, y: ArrayLike, *, cycle: ArrayLike | None = None) -> "SensorSelector":
        """Select the sensors.

        Parameters
        ----------
        X : array-like of shape (n_rows, n_features)
            Inputs minus their reference.
        y : array-like of shape (n_rows,)
            Deviation.
        cycle : array-like of int of shape (n_rows,), optional
            Thermal cycle of each row, for a method that selects by left-out cycles.

        Returns
        -------
        SensorSelector

        Raises
        ------
        InputError
            The method or a column is unknown, or there are no columns to choose from.
        """
        values, deviation = validate_data(self, X, y, y_numeric=True, dtype=np.float64, ensure_min_samples=2)
        names = [str(n) for n in getattr(self, "feature_names_in_", [f"x{i}" for i in range(self.n_features_in_)])]
        given = self._kept(names)
        if self.time not in (None, "column"):
            raise InputError(f"SensorSelector: time={self.time!r}: expected 'column' or None")
        free = np.flatnonzero(~given)
        if not free.size:
            raise InputError(
                "SensorSelector: keep contains every column, so there is none to choose from; remove some from keep"
            )
        method = self._method()
        cycles = {} if cycle is None or "cycle" not in signature(method.fit).parameters else {"cycle": cycle}
        candidates = pd.DataFrame(values[:, free], columns=[names[j] for j in free])
        self.estimator_ = method.fit(candidates, deviation, **cycles)
        chosen = self.estimator_.freeze(target="y").sensors
        self._support = given | np.isin(names, chosen)
        return self

    def _get_support_mask(self) -> NDArray[np.bool_]:
        check_is_fitted(self)
        return self._support

    def _kept(self, names: Sequence[str]) -> NDArray[np.bool_]:
        """Return a mask of the columns that are always kept."""
        mask = np.zeros(len(names), dtype=np.bool_)
        mask[:1] = self.time == "column"
        for column in self.keep:
            if isinstance(column, str) and column not in names:
                raise InputError(f"SensorSelector: keep {column!r}: no such column; the columns are {', '.join(names)}")
            place = names.index(column) if isinstance(column, str) else int(column)
            if not 0 <= place < len(names):
                raise InputError(f"SensorSelector: keep {column!r}: expected an index from 0 to {len(names) - 1}")
            mask[place] = True
        return mask

    def _method(self) -> Any:
        if isinstance(self.method, ThermalRegressor):
            return clone(self.method)
        if self.method not in SELECTORS:
            raise InputError(f"SensorSelector: method {self.method!r}: expected one of {', '.join(SELECTORS)}")
        return SELECTORS[self.method]()

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.target_tags.required = True
        return tags
