"""`pcr-traversal`: principal component regression on the best of all small sets of temperatures."""

from dataclasses import dataclass
from itertools import combinations, pairwise
from math import comb

import numpy as np

from thermocomp.core.exceptions import InputError
from thermocomp.models.base import FloatArray
from thermocomp.models.shrinkage import ShrunkRegressor, choose

#: largest number of sets of temperatures
MOST_SETS = 20_000
#: share of the largest variance below which a component is rounding
_ROUNDING = 1e-12


@dataclass(kw_only=True, eq=False, repr=False)
class TraversedComponents(ShrunkRegressor):
    """Principal component regression with traversal of the temperature measuring points, as by Miao et al. (T-10).

    Every set of up to `max_points` temperatures is tried, each with every number of principal components, in order of
    variance. The paper that cites Miao et al. names the traversal, but neither its criterion nor the number of
    components; here both set and number are chosen by cross-validation over thermal cycles: of each size the set with
    the smallest error; among these the size by `rule`, and then the number of components by `rule`.

    Parameters
    ----------
    rule : {'one-standard-error', 'minimum'}
        Rule for the choice of the number of temperatures and of components.
    fit_intercept : bool
        False: the model returns zero in the reference state, and the components are computed about zero.
    max_points : int
        Largest number of temperatures; fewer if there are more than `MOST_SETS` sets (5 of 24 temperatures are 55,454
        sets, 4 are 12,950).

    Attributes
    ----------
    n_components_ : int
        Chosen number.
    selected_ : tuple of str
        Names of the chosen temperatures.
    cv_rms_, chosen_by_ : float, str
        See `thermocomp.models.shrinkage.ShrunkRegressor`; `cv_rms_` is the smallest of many sets, so it is optimistic.

    Raises
    ------
    InputError
        `max_points` is below 1.

    References
    ----------
    The Open Mechanical Engineering Journal 11, 2017: the study of temperature measurement points by stepwise regression
    that is called stepwise2017 here, section 1.

    Examples
    --------
    >>> import numpy as np
    >>> from thermocomp import TraversedComponents
    >>> rng = np.random.default_rng(0)
    >>> rises = rng.uniform(0, 10, (200, 6))  # of six temperatures, two of which matter [degC]
    >>> model = TraversedComponents().fit(rises, 5 * rises[:, 1] - 3 * rises[:, 4] + rng.normal(size=200))
    >>> print(model.selected_, model.n_components_)
    ('x1', 'x4') 2
    """

    max_points: int = 4

    def _paths(self, Z: FloatArray, y: FloatArray) -> FloatArray:
        most = _most_points(self.max_points, Z.shape[1])
        products, moments = Z.T @ Z, Z.T @ y
        found = []
        for size in range(1, most + 1):
            sets = np.array(list(combinations(range(Z.shape[1]), size)))
            values, axes = np.linalg.eigh(products[sets[:, :, None], sets[:, None, :]])
            used = values > _ROUNDING * values.max()
            along = np.einsum("sik,si->sk", axes, moments[sets])
            along = np.divide(along, values, out=np.zeros(values.shape), where=used)
            path = np.cumsum((axes * along[:, None, :])[:, :, ::-1], axis=2)  # with the first, the first two ...
            weights = np.zeros((len(sets), most, Z.shape[1]))
            for k in range(most):
                weights[np.arange(len(sets))[:, None], k, sets] = path[:, :, min(k, size - 1)]
            found.append(weights)
        return np.concatenate(found)

    def _choose(self, rms: FloatArray) -> tuple[int, int]:
        ends = np.cumsum([0, *(comb(self.n_features_in_, size) for size in range(1, rms.shape[1] + 1))]).tolist()
        least = rms.mean(axis=2).min(axis=1)
        best = [begin + int(np.argmin(least[begin:end])) for begin, end in pairwise(ends)]
        by_size = np.array([rms[which, rms[which].mean(axis=1).argmin()] for which in best])
        _, size = choose(by_size[None], self.rule)
        _, setting = choose(rms[best[size]][None], self.rule)
        return best[size], setting

    def _conclude(self, X: FloatArray, y: FloatArray, weights: FloatArray, intercept: float) -> None:
        super()._conclude(X, y, weights, intercept)
        self.selected_ = tuple(name for name, c in zip(self.terms_, self.coef_, strict=True) if c)

    def _note(self, which: int, setting: int) -> None:  # noqa: ARG002 - the set is seen from the coefficients
        self.n_components_ = setting + 1


def _most_points(max_points: int, n_features: int) -> int:
    """Return the largest number of temperatures in a set."""
    if max_points < 1:
        raise InputError(f"max_points {max_points}: expected at least 1")
    sets = np.cumsum([comb(n_features, size) for size in range(1, min(max_points, n_features) + 1)])
    return max(1, int(np.count_nonzero(sets <= MOST_SETS)))
