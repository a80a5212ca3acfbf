"""Two temperature sensors whose connections are swapped: each takes the reading of the other."""

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.watch import Watch
from thermocomp.runtime.watchstate import GOOD, SWAPPED, WatchState

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.signedinteger]


def find_rises(state: WatchState, read: FloatArray) -> FloatArray:
    """Return the rise of each temperature since its zero, (..., n_sensors), from the rises as connected [degC]."""
    if not np.count_nonzero(state.order != np.arange(state.order.shape[-1])):
        return read
    return np.take_along_axis(np.broadcast_to(read, state.order.shape), state.order.astype(np.intp), axis=-1)


def trust(order: IntArray) -> IntArray:
    """Return the state of trusted sensors, (..., n_sensors): good, or swapped if they take the reading of another."""
    return np.where(order == np.arange(order.shape[-1]), GOOD, SWAPPED)


def exchange(watch: Watch, s: WatchState, found: BoolArray, x: FloatArray) -> WatchState:
    """Exchange the readings of two sensors, and their past in the predictions.

    Parameters
    ----------
    found : ndarray of bool of shape (..., n_sensors)
        The two sensors of a run; none in runs without a swap.
    x : ndarray of shape (..., n_sensors)
        Readings minus the reference [degC].
    """
    if not found.any():
        return s
    own = np.broadcast_to(np.arange(found.shape[-1]), found.shape)
    partner = np.where(found, (own * found).sum(axis=-1, keepdims=True) - own, own)
    order = np.take_along_axis(s.order, partner, axis=-1)
    lags = len(watch.time_constants)
    lagged, rest = np.split(s.memory, [lags * found.shape[-1]], axis=-1)
    every = np.concatenate([partner + k * found.shape[-1] for k in range(lags)], axis=-1) if lags else partner[..., :0]
    memory = np.concatenate([np.take_along_axis(lagged, every, axis=-1), rest], axis=-1)
    used = np.where(found, np.take_along_axis(x, partner, axis=-1), s.used)
    direct, weights = watch.read_out
    first, second = watch.pairs
    return s._replace(
        order=order.astype(np.int16),
        memory=memory,
        traces=np.where(np.tile(found, lags), 0.0, s.traces),
        used=used,
        predicted=used @ direct + memory @ weights,
        usual=np.where(found, 0.0, s.usual),
        fault=np.where(found, trust(order), s.fault).astype(np.int8),
        since=np.where(found, s.time, s.since),
        same=np.where(found, np.nan, s.same),
        jumped=np.where(found, np.nan, s.jumped),
        moving=np.where(found, np.nan, s.moving),
        evidence=np.where(found[..., first] & found[..., second], 0.0, s.evidence),
        off=np.where(found.any(axis=-1, keepdims=True), np.nan, s.off),
    )
