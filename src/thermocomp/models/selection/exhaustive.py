"""Exhaustive searches by the residual mean square: all subsets, and all combinations of one member of each group.

Hwang, sections 2.3 and 2.4 (H-05 to H-07). Columns are identified by their indices. All computations use the small
triangular factor (`thermocomp.models.numerics.leastsquares.triangle`), never a Gram matrix, because the method is
intended for nearly collinear sensors.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.exceptions import FitError
from thermocomp.models.numerics.leastsquares import Triangle

#: maximum number of subsets (or combinations) that are searched
LIMIT = 2**20
#: sums of squares that differ by a smaller share count as equal, and the first is chosen regardless of rounding
SAME = 1e-10
_BATCH = 2**12  # candidates processed at once: bounds the memory


@dataclass(frozen=True)
class Subset:
    """A set of variables.

    Parameters
    ----------
    mse : float
        MSE_p = SSE_p / (n - p - 1) (Eq. 4), n - p without an intercept [square of the unit of y].
    """

    columns: tuple[int, ...]
    mse: float


@dataclass(frozen=True)
class Search:
    """Result of a search.

    Parameters
    ----------
    best : Subset
        Set with the smallest MSE_p.
    curve : tuple of Subset
        Best set for each number of variables 1, 2, ... (Fig. 4) that leaves a degree of freedom.
    count : int
        Number of sets examined.
    """

    best: Subset
    curve: tuple[Subset, ...]
    count: int


def search_subsets(tri: Triangle, columns: Sequence[int], *, limit: int = LIMIT) -> Search:
    """Find the subset with the smallest MSE_p among all non-empty subsets (Hwang, Eq. 5; H-05, H-07).

    Of equally good subsets the smaller one is chosen, then the one with the earlier columns. The search is exact and
    not slower for collinear sensors: a sensor that adds only rounding leaves the sum of squares unchanged.

    Parameters
    ----------
    tri : Triangle
        Triangular factor of [X y].
    """
    g = len(columns)
    count = 2**g - 1
    if count > limit:
        raise FitError(
            f"{g} representatives have {count} subsets, more than {limit}: lower the threshold of the correlation, so "
            "that there are fewer groups"
        )
    free = _free(tri, 1)
    squares = _squares(tri, [(c,) for c in columns], skip=True)
    sizes = g - np.bitwise_count(np.arange(2**g))  # a bit of 1 denotes an omitted column
    curve = []
    for p in range(1, min(g, free - 1) + 1):
        mine = np.flatnonzero(sizes == p)
        place = int(mine[_first(squares[mine])])
        taken = tuple(c for k, c in enumerate(columns) if not place >> (g - 1 - k) & 1)
        curve.append(Subset(taken, float(squares[place]) / (free - p)))
    best = curve[_first(np.array([s.mse for s in curve]))]
    return Search(best, tuple(curve), count)


def search_members(tri: Triangle, groups: Sequence[Sequence[int]], *, limit: int = LIMIT) -> Search:
    """Find the best combination of one member of each group (Hwang, section 2.4 and Fig. 2; H-06).

    Of equally good combinations the first is chosen.

    Parameters
    ----------
    tri : Triangle
        Triangular factor of [X y].
    """
    count = math.prod(len(g) for g in groups)
    if count > limit:
        raise FitError(
            f"the groups in use have {count} combinations of members, more than {limit}: raise the threshold "
            "of the correlation, so that the groups are smaller, or leave sensors out"
        )
    free = _free(tri, len(groups))
    squares = _squares(tri, groups, skip=False)
    place = _first(squares)
    members = np.unravel_index(place, [len(g) for g in groups])
    taken = tuple(g[int(k)] for g, k in zip(groups, members, strict=True))
    best = Subset(taken, float(squares[place]) / (free - len(groups)))
    return Search(best, (best,), count)


def _free(tri: Triangle, needed: int) -> int:
    """Return the number of rows minus the constant; raise if `needed` variables leave no degree of freedom."""
    free = tri.n_rows - int(tri.intercept)
    if free <= needed:
        raise FitError(
            f"{tri.n_rows} rows are too few for {needed} variables: expected at least {needed + 1 + int(tri.intercept)}"
        )
    return free


def _first(values: FloatArray) -> int:
    """Return the index of the smallest value; of values equal within rounding, the first."""
    return int(np.argmax(values <= values.min() * (1 + SAME)))


def _squares(tri: Triangle, levels: Sequence[Sequence[int]], *, skip: bool) -> FloatArray:
    """Return the residual sums of squares for one column of each level; with `skip`, also for none of a level (last).

    Shape (n_choices of level 0 * n_choices of level 1 * ...,), with the last level varying fastest; 0 for values that
    are indistinguishable from rounding.
    """
    columns = [c for level in levels for c in level]
    least = tri.noise[columns] ** 2
    left = tri.factor[None][:, :, [*columns, -1]]
    found = _deflated(left, [len(level) for level in levels], least, skip)
    found[found <= tri.noise[-1] ** 2] = 0.0
    return found


def _deflated(left: FloatArray, sizes: Sequence[int], least: FloatArray, skip: bool) -> FloatArray:
    """Project each column of the first level out of the later levels and of y (modified Gram-Schmidt).

    `left`, of shape (n_choices_so_far, n_rows, n_columns + 1), contains the remainders of the columns and of y after
    the earlier choices.
    """
    if not sizes:
        return np.asarray(np.einsum("sm,sm->s", left[:, :, -1], left[:, :, -1]))
    own, rest = left[:, :, : sizes[0]], left[:, :, sizes[0] :]
    parts = []
    for k in range(sizes[0]):
        v = own[:, :, k]
        square = np.einsum("sm,sm->s", v, v)
        share = np.einsum("sm,smw->sw", v, rest) / np.where(square > least[k], square, np.inf)[:, None]
        parts.append(rest - v[:, :, None] * share[:, None, :])
    if skip:
        parts.append(rest)
    later, least = sizes[1:], least[sizes[0] :]
    if len(left) * len(parts) > _BATCH:
        done = [_deflated(part, later, least, skip).reshape(len(left), -1) for part in parts]
        return np.stack(done, axis=1).ravel()
    return _deflated(np.stack(parts, axis=1).reshape(-1, *rest.shape[1:]), later, least, skip)
