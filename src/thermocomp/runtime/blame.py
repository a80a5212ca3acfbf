"""Failure that explains the residuals of readings: of one sensor, or of two that are swapped."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thermocomp.core import lagbank
from thermocomp.core.watch import Watch

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

#: how slow what is usual of a difference is [s]
USUAL = 1800.0
#: two are not swapped if exchanging them ever left so much more than not, per sensor, in units of the unseen errors
AGAINST = 0.1


class Blamed(NamedTuple):
    """The likeliest failure of a kind, per run."""

    sensors: BoolArray  #: (..., n_sensors), who would have failed
    rest: FloatArray  #: (...,), sum of squares of what it leaves, in units of the unseen errors; inf: there is none
    worst: FloatArray  #: (...,), the largest of what it leaves, in units of the limits


def one_fails(watch: Watch, difference: FloatArray, able: BoolArray) -> Blamed:
    """Return the sensor whose failure, at once or after the lags, leaves least of the differences.

    Parameters
    ----------
    watch : Watch
    difference : ndarray of shape (..., n_sensors)
        Between reading and prediction; 0 where there is none [degC].
    able : ndarray of bool of shape (..., n_sensors)
        Sensors that can have failed.
    """
    weights = watch.limits("unseen")
    scaled = difference / weights
    found = _nobody(able)
    for shape in watch.signatures / weights[:, None]:  # (n, n_faulty)
        amount = np.einsum("...i,ij->...j", scaled, shape) / (shape**2).sum(axis=0)
        left = np.swapaxes(scaled[..., :, None] - shape * amount[..., None, :], -1, -2) * weights
        rest = np.where(able, ((left / weights) ** 2).sum(axis=-1), np.inf)
        one = _least(rest, np.abs(left / watch.limits("off")).max(axis=-1), np.eye(len(weights), dtype=np.bool_))
        better = one.rest < found.rest
        found = Blamed(
            np.where(better[..., None], one.sensors, found.sensors),
            np.where(better, one.rest, found.rest),
            np.where(better, one.worst, found.worst),
        )
    return found


def weigh_swaps(
    watch: Watch,
    evidence: FloatArray,
    x: FloatArray,
    memory: FloatArray,
    able: BoolArray,
    dt: FloatArray,
) -> tuple[FloatArray, Blamed]:
    """Weigh whether two sensors have been swapped since the start.

    What a sensor counts from was read at its terminals: exchanged are the changes, and their lags. Of two whose
    responses differ, that soon speaks against it where all is well; a sensor that fails later is then alone.

    Parameters
    ----------
    watch : Watch
    evidence : ndarray of shape (..., n_pairs)
        For every two, low-passed; -inf once it spoke against them.
    x : ndarray of shape (..., n_sensors)
        Readings, or their substitutes, minus the reference [degC].
    memory : ndarray of shape (..., n_memory)
        See `thermocomp.runtime.watch.WatchState`.
    able : ndarray of bool of shape (..., n_sensors)
        Sensors whose readings and predictions can be gone by.
    dt : ndarray of shape (..., 1)
        Since `evidence` was given; 0 where predictions are not known to hold [s].

    Returns
    -------
    evidence : ndarray of shape (..., n_pairs)
    both : Blamed
        The two that leave least.
    """
    n, (direct, states) = len(watch.sensors), watch.read_out
    first, second = watch.pairs
    mine = np.isfinite(evidence) & able[..., first] & able[..., second]
    if not mine.any():
        return evidence, _nobody(able)
    # most are spoken against soon: only what is open is computed, one row for each two of each run
    *run, pair = np.nonzero(mine)
    one, other, of = first[pair], second[pair], tuple(run)
    own = np.eye(n) - direct
    difference = x @ own - memory @ states
    left = difference[of] + (x[*of, other] - x[*of, one])[:, None] * (own[one] - own[other])
    for k in range(0, n * len(watch.time_constants), n):
        weights = states[k : k + n]
        left -= (memory[*of, k + other] - memory[*of, k + one])[:, None] * (weights[one] - weights[other])
    left = np.where(able[of], left, 0.0)
    unseen = watch.limits("unseen")
    rest = ((left / unseen) ** 2).sum(axis=-1)
    better = (np.where(able, difference / unseen, 0.0) ** 2).sum(axis=-1)[of] - rest
    step = np.broadcast_to(dt / USUAL, mine.shape)[mine]
    after = lagbank.follow(evidence[mine], better, step)
    evidence = evidence.copy()
    evidence[mine] = np.where(after > -AGAINST * n, after, -np.inf)
    rests, worst = np.full(mine.shape, np.inf), np.full(mine.shape, np.inf)
    rests[mine], worst[mine] = rest, np.abs(left / watch.limits("off")).max(axis=-1)
    each = np.eye(n, dtype=np.bool_)
    return evidence, _least(rests, worst, each[first] | each[second])


def _nobody(able: BoolArray) -> Blamed:
    nothing = np.full(able.shape[:-1], np.inf)
    return Blamed(np.zeros(able.shape, dtype=np.bool_), nothing, nothing)


def _least(rest: FloatArray, worst: FloatArray, sensors: BoolArray) -> Blamed:
    """Return the failure of smallest residual; `sensors` (n_failures, n_sensors), the others (..., n_failures)."""
    place = rest.argmin(axis=-1)[..., None]
    return Blamed(
        sensors[place[..., 0]],
        np.take_along_axis(rest, place, axis=-1)[..., 0],
        np.take_along_axis(worst, place, axis=-1)[..., 0],
    )
