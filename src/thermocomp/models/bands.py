"""Uncertainty bands from the errors on thermal cycles that were left out of the training in turn."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from scipy import stats

from thermocomp.core.arrays import BoolArray, FloatArray, IntArray
from thermocomp.core.band import CONFORMAL, Band
from thermocomp.models.numerics.folds import APART

#: share of the rows of unseen cycles that a band should cover
LEVEL = 0.9
#: relative increase of the half-width per unit of distance outside the joint support
WIDENING = 0.33
#: minimum spread used, relative to its root mean square on the left-out cycles
FLOOR = 0.5
_LEAST = 1e-6  # lower limit of divisors [unit], and of a size relative to that


def find_band(
    residual: FloatArray,
    spread: FloatArray,
    cycle: IntArray,
    turning: BoolArray,
    speeds: Sequence[int] = (),
    level: float = LEVEL,
) -> Band | None:
    """Return the uncertainty band of a model from the errors on its left-out training cycles.

    The error is expressed in units of ``sqrt(floor^2 + spread^2)``; its size in these units differs between a running
    and a stopped spindle. Errors within a cycle are dependent, so n cycles count as n independent values. The size for
    one further cycle is that of the prediction interval of a sample: Student's t with n - 1 degrees of freedom, with
    fewer than `APART` cycles times sqrt(1 + 1/n), since their neighbours were not left out. From `CONFORMAL` cycles
    onwards, the only assumption is that the cycles are exchangeable: the quantile of the errors, with equal weight for
    each cycle and for one additional unknown cycle.

    Parameters
    ----------
    residual : ndarray of shape (n_rows,)
        Error on rows whose cycle was left out of the training [unit].
    spread : ndarray of shape (n_rows,)
        Spread of the averaged regressions in these rows [unit].
    cycle : ndarray of int of shape (n_rows,)
    turning : ndarray of bool of shape (n_rows,)
        Whether the spindle turns.

    Returns
    -------
    Band or None
        None with fewer than two cycles: the error on an unseen cycle is then unknown.

    References
    ----------
    Dunn, R., Wasserman, L., Ramdas, A.: Distribution-free prediction sets for two-layer hierarchical models. Journal of
    the American Statistical Association 118(544), 2023, 2491-2502. doi:10.1080/01621459.2022.2060112
    """
    rows = [cycle == c for c in np.unique(cycle)]
    n = len(rows)
    if n < 2:
        return None
    floor = max(FLOOR * float(np.sqrt(np.mean([np.mean(spread[mine] ** 2) for mine in rows]))), _LEAST)
    own = residual / np.hypot(floor, spread)
    stopped, running = (_size(own, rows, phase) for phase in (~turning, turning))
    basis: Literal["assumption", "conformal"] = "conformal" if n >= CONFORMAL else "assumption"
    if basis == "conformal":
        scores = np.abs(own) / np.maximum(np.where(turning, running, stopped), _LEAST)
        weights = sum(mine / mine.sum() for mine in rows) / (n + 1)
        order = np.argsort(scores)
        place = int(np.searchsorted(np.cumsum(weights[order]), level - 1e-9))
        factor = float(scores[order][min(place, len(order) - 1)])
    else:
        factor = float(stats.t.ppf(0.5 + level / 2, n - 1) * (np.sqrt(1 + 1 / n) if n < APART else 1.0))
    running, stopped = (max(factor * size, _LEAST) for size in (running, stopped))
    return Band(
        level=level,
        basis=basis,
        cycles=n,
        floor=floor,
        running=running,
        stopped=stopped,
        speeds=tuple(speeds),
        widening=WIDENING,
    )


def _size(errors: FloatArray, rows: Sequence[BoolArray], phase: BoolArray) -> float:
    """Return the root mean square of errors in a phase, with equal weight for each cycle.

    It is shrunk towards the value over all phases, which has the weight of one additional cycle.
    """
    squares = [np.mean(errors[mine & phase] ** 2) for mine in rows if (mine & phase).any()]
    squares.append(np.mean([np.mean(errors[mine] ** 2) for mine in rows]))
    return float(np.sqrt(np.mean(squares)))
