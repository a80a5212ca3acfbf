"""Maximal correlation of small sets of temperatures with every displacement of every test."""

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from joblib import effective_n_jobs
from numpy.typing import ArrayLike

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.exceptions import FitError, InputError

#: distributes work: receives a function and a sequence of arguments, yields the result for each
Share = Callable[[Callable[[Any], FloatArray], Sequence[Any]], Iterable[FloatArray]]


@dataclass(frozen=True, eq=False)
class DataSet:
    """Temperatures and displacements of one test, as arrays.

    Parameters
    ----------
    temperatures : array-like of shape (n_rows, n_temperatures)
    displacements : array-like of shape (n_rows, n_displacements)
    """

    name: str
    temperatures: ArrayLike
    displacements: ArrayLike


@dataclass(frozen=True, eq=False)
class MaximalCorrelations:
    """Psi of every subset of the temperatures (Wessel 2004, Appendix B; W-10).

    Parameters
    ----------
    psi : ndarray of shape (n_displacements, n_subsets, n_tests)
        Psi; nan for models that were not computed before the work was stopped.
    subsets : tuple of tuple of int
        Indices of the temperatures.
    complete : bool
        False if the work was stopped.
    """

    psi: FloatArray
    subsets: tuple[tuple[int, ...], ...]
    tests: tuple[str, ...]
    complete: bool

    def least_size(self, level: float) -> int | None:
        """Return the smallest number of temperatures with which a subset reaches `level` on average, everywhere (W-12).

        None if no number does. For the paper `level` is 0.99, and the result is three.
        """
        sizes = np.array([len(s) for s in self.subsets])
        means = np.nanmean(self.psi, axis=2)
        for size in np.unique(sizes).tolist():
            if (means[:, sizes == size].max(axis=1) >= level).all():
                return int(size)
        return None


def subsets_up_to(n_temperatures: int, size: int | None = None) -> tuple[tuple[int, ...], ...]:
    """Return all subsets of 1 to `size` members in order of size, for example 129 of nine up to size three (W-10)."""
    largest = n_temperatures if size is None else min(size, n_temperatures)
    return tuple(s for k in range(1, largest + 1) for s in combinations(range(n_temperatures), k))


def maximal_correlations(
    tests: Sequence[DataSet],
    subsets: Sequence[Sequence[int]] | None = None,
    *,
    half_window: int = 10,
    converged: bool = True,
    tolerance: float | None = None,
    max_sweeps: int = 2000,
    jobs: int = 1,
    share: Share | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> MaximalCorrelations:
    """Compute the maximal correlation of every subset, for every test and displacement (W-10, W-12).

    The transformations are those of `thermocomp.models.ace.ACE` with its option `converged`. After a keyboard
    interrupt, the results computed so far are returned.

    Parameters
    ----------
    subsets : sequence of sequence of int, optional
        Indices of the temperatures; default: all subsets of up to three.
    tolerance : float, optional
        Root mean square change of the functions in a sweep, summed over all, at which sweeps end; the error then
        decreases by about its square per sweep. With 1e-3, the default, Psi is mostly within 1e-4 of its limit. With
        the paper's rule: the decrease of the error that counts as a failure; default 0.
    """
    if not tests:
        raise InputError("maximal correlation: no test given")
    if half_window < 1 or max_sweeps < 1 or (tolerance is not None and not tolerance >= 0):
        raise InputError(
            "maximal correlation: expected half_window >= 1, max_sweeps >= 1 and tolerance >= 0, "
            f"found {half_window}, {max_sweeps} and {tolerance}"
        )
    tables = [_checked(t, half_window) for t in tests]
    shapes = {(T.shape[1], S.shape[1]) for T, S in tables}
    if len(shapes) > 1:
        raise InputError(
            f"tests have different numbers of temperatures and displacements: {sorted(shapes)}; give tests with the "
            "same channels"
        )
    n_temperatures, n_displacements = shapes.pop()
    chosen = subsets_up_to(n_temperatures, 3) if subsets is None else tuple(tuple(s) for s in subsets)
    members = _membership(chosen, n_temperatures)
    # consecutive subsets in this order share most of their members, which the kernel requires for speed
    order = np.lexsort(members.T)
    if tolerance is None:
        tolerance = 1e-3 if converged else 0.0
    psi = np.full((n_displacements, len(chosen), len(tests)), np.nan)
    pieces = [(k, d) for k in range(len(tests)) for d in range(n_displacements)]
    how = (members[order], half_window, tolerance, max_sweeps, converged)
    work = [(tables[k][0], tables[k][1][:, d], *how) for k, d in pieces]
    complete = True
    with ThreadPoolExecutor(effective_n_jobs(jobs)) as threads:
        found = threads.map(_psi, work) if share is None else share(_psi, work)
        try:
            for (k, d), values in zip(pieces, found, strict=True):
                psi[d, order, k] = values
                progress(f"{tests[k].name} displacement {d + 1} of {n_displacements}: {len(chosen)} subsets")
        except KeyboardInterrupt:
            complete = False
            threads.shutdown(wait=False, cancel_futures=True)
    return MaximalCorrelations(psi, chosen, tuple(t.name for t in tests), complete)


def _checked(test: DataSet, half_window: int) -> tuple[FloatArray, FloatArray]:
    T = np.asarray(test.temperatures, dtype=np.float64)
    S = np.asarray(test.displacements, dtype=np.float64)
    if T.ndim != 2 or S.ndim != 2 or len(T) != len(S):
        raise InputError(
            f"{test.name}: expected temperatures and displacements as tables with the same number of rows, "
            f"found the shapes {T.shape} and {S.shape}"
        )
    if len(T) < 2 * half_window + 1:
        raise FitError(
            f"{test.name}: {len(T)} rows, but the boxcar spans {2 * half_window + 1}; use a smaller half_window"
        )
    bad = ~(np.isfinite(T).all(axis=1) & np.isfinite(S).all(axis=1))
    if bad.any():
        raise FitError(f"{test.name}: row {int(np.argmax(bad))} contains NaN or infinity; remove such rows")
    return T, S


def _membership(subsets: Sequence[tuple[int, ...]], n_temperatures: int) -> BoolArray:
    members = np.zeros((len(subsets), n_temperatures), dtype=np.bool_)
    for row, subset in zip(members, subsets, strict=True):
        if not subset or any(not 0 <= j < n_temperatures for j in subset):
            raise InputError(f"subset {subset}: expected indices of the {n_temperatures} temperatures, at least one")
        row[list(subset)] = True
    return members


def _psi(
    piece: tuple[FloatArray, FloatArray, BoolArray, int, float, int, bool],
) -> FloatArray:
    from thermocomp.models.kernels import ace_subsets, ranks  # numba is slow to import

    T, S, members, half_window, tolerance, max_sweeps, converged = piece
    ranked = ranks.rank(np.ascontiguousarray(np.vstack([T.T, S])))
    found: FloatArray = ace_subsets.correlations(*ranked, half_window, tolerance, max_sweeps, converged, members)[0]
    return found
