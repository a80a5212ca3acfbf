"""Which failure explains how readings differ from their predictions: of one sensor, or of two that are swapped."""

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
        one = _least(watch, left, able, np.eye(len(weights), dtype=np.bool_))
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
        Readings, or what stands in for them, minus the reference [degC].
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
    open_ = np.flatnonzero(np.isfinite(evidence).any(axis=tuple(range(evidence.ndim - 1))))
    if not open_.size:
        return evidence, _nobody(able)
    first, second = (of[open_] for of in watch.pairs)
    own = np.eye(n) - direct
    difference = x @ own - memory @ states
    left = difference[..., None, :] + (x[..., second] - x[..., first])[..., None] * (own[first] - own[second])
    for k in range(0, n * len(watch.time_constants), n):
        lag, weights = memory[..., k : k + n], states[k : k + n]
        left -= (lag[..., second] - lag[..., first])[..., None] * (weights[first] - weights[second])
    left = np.where(able[..., None, :], left, 0.0)
    unseen = watch.limits("unseen")
    better = (np.where(able, difference / unseen, 0.0) ** 2).sum(axis=-1, keepdims=True) - ((left / unseen) ** 2).sum(
        -1
    )
    still = np.isfinite(evidence[..., open_])
    mine = still & able[..., first] & able[..., second]
    before = np.where(still, evidence[..., open_], 0.0)
    after = np.where(mine, lagbank.follow(before, better, np.broadcast_to(dt / USUAL, better.shape)), before)
    evidence = evidence.copy()
    evidence[..., open_] = np.where(still & (after > -AGAINST * n), after, -np.inf)
    each = np.eye(n, dtype=np.bool_)
    return evidence, _least(watch, left, mine, each[first] | each[second])


def _nobody(able: BoolArray) -> Blamed:
    nothing = np.full(able.shape[:-1], np.inf)
    return Blamed(np.zeros(able.shape, dtype=np.bool_), nothing, nothing)


def _least(watch: Watch, left: FloatArray, able: BoolArray, sensors: BoolArray) -> Blamed:
    """Return which failure leaves least; `sensors` (n_failures, n_sensors), `left` (..., n_failures, n_sensors)."""
    rest = ((left / watch.limits("unseen")) ** 2).sum(axis=-1)
    rest[~able] = np.inf
    place = rest.argmin(axis=-1)[..., None]
    most = np.abs(left / watch.limits("off")).max(axis=-1)
    return Blamed(
        sensors[place[..., 0]],
        np.take_along_axis(rest, place, axis=-1)[..., 0],
        np.take_along_axis(most, place, axis=-1)[..., 0],
    )
