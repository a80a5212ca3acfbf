"""Joint support of a training set: a few representative states, and a limit calibrated on left-out cycles.

States: farthest-point cover (Gonzalez 1985, Clustering to minimize the maximum intercluster distance): each new point
is the training state farthest from the existing points. Limit: the distance within which `SHARE` of the rows of
left-out cycles lie from a cover of the other cycles, but at least the largest distance of a training row to the cover.
"""

from collections.abc import Sequence

import numpy as np

from thermocomp.core.arrays import FloatArray, IntArray
from thermocomp.core.joint import JointSupport
from thermocomp.core.machine import Channel

#: share of the rows of left-out cycles that must lie inside
SHARE = 0.95
#: a speed this close to a trained one counts as known, relative to the span of the trained speeds and standstill
NEAR = 0.1
#: maximum count of numbers in all points together: adds less than 8 KB to the model file
NUMBERS = 360
#: maximum number of inputs compared, those with the largest changes first
COLUMNS = 40
_ROWS = 600  # maximum number of training rows from which points are selected
_BLOCKS = 8  # maximum number of blocks left out


def find_joint_support(change: FloatArray, channels: Sequence[Channel], cycle: IntArray) -> JointSupport | None:
    """Return the joint support of training rows.

    Parameters
    ----------
    change : ndarray of shape (n_rows, n_inputs)
        Inputs minus their reference, finite [their units].
    cycle : ndarray of int of shape (n_rows,)
        Thermal cycle of each row; with a single cycle, its quarters are left out in turn.

    Returns
    -------
    JointSupport or None
        None if no input changes.
    """
    driven = [j for j, c in enumerate(channels) if c.quantity in ("spindle_speed", "feed")]
    spread = change.std(axis=0)
    others = [j for j in np.argsort(-spread, kind="stable").tolist() if spread[j] > 0 and j not in driven]
    columns = sorted(others[:COLUMNS])
    speeds = [j for j in driven if np.ptp(change[:, j]) > 0]
    if not columns and not speeds:
        return None
    levels, tolerances = [], []
    for j in speeds:
        tolerance = NEAR * float(max(change[:, j].max(), 0.0) - min(change[:, j].min(), 0.0))
        levels.append(_levels(change[:, j], 0.5 * tolerance))
        tolerances.append(tolerance)
    scale = np.array([float(f"{v:.5g}") for v in spread[columns]])
    points, limit = np.empty((0, 0)), 1.0
    if columns:
        states = change[:, columns] / scale
        n_points = int(np.clip(NUMBERS // len(columns), 8, 40))
        points = np.round(_points(states, n_points), 3)
        limit = float(np.ceil(1e4 * max(_calibrated(states, cycle, n_points), _nearest(states, points).max())) / 1e4)
    return JointSupport(
        columns=tuple(columns),
        scale=tuple(scale.tolist()),
        points=tuple(map(tuple, points.tolist())),
        limit=max(limit, 1e-3),
        speeds=tuple(speeds),
        levels=tuple(levels),
        tolerances=tuple(tolerances),
    )


def _calibrated(states: FloatArray, cycle: IntArray, n_points: int) -> float:
    """Return the distance within which `SHARE` of the rows of left-out cycles lie from a cover of the others."""
    names, block = np.unique(cycle, return_inverse=True)
    if len(names) == 1:
        block = np.arange(len(states)) * 4 // len(states)
    elif len(names) > _BLOCKS:
        block = block * _BLOCKS // len(names)
    found = []
    for k in np.unique(block):
        mine, rest = states[block == k], states[block != k]
        if len(rest):
            found.append(_nearest(_thinned(mine), _points(rest, n_points)))
    return float(np.quantile(np.concatenate(found), SHARE)) if found else 0.0


def _points(states: FloatArray, n_points: int) -> FloatArray:
    """Return states that represent all: the one nearest to the mean, then repeatedly the farthest from those chosen."""
    pool = _thinned(states)
    taken = [int(np.argmin(((pool - pool.mean(axis=0)) ** 2).sum(axis=1)))]
    far = _nearest(pool, pool[taken])
    while len(taken) < n_points and far.max() > 0:
        taken.append(int(np.argmax(far)))
        far = np.minimum(far, _nearest(pool, pool[taken[-1:]]))
    return pool[taken]


def _nearest(states: FloatArray, points: FloatArray) -> FloatArray:
    """Return the distance of each state to its nearest point, (n_states,): root mean square over the inputs."""
    square = np.full(len(states), np.inf)
    for p in points:
        away = states - p
        np.minimum(square, np.einsum("ij,ij->i", away, away), out=square)
    return np.asarray(np.sqrt(square / states.shape[1]))


def _thinned(states: FloatArray) -> FloatArray:
    return states[:: max(1, -(-len(states) // _ROWS))]


def _levels(values: FloatArray, radius: float) -> tuple[float, ...]:
    """Return values such that every element of `values` is within `radius` of one of them."""
    found: list[float] = []
    for v in np.unique(values).tolist():
        if not found or v - found[-1] > radius:
            found.append(v)
    return tuple(found)
