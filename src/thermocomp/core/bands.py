"""Uncertainty bands of several models, evaluated together."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from thermocomp.core.arrays import FloatArray, IntArray
from thermocomp.core.band import widen

if TYPE_CHECKING:
    from thermocomp.core.model import ErrorModel


class Bands:
    """Bands of models, as `Band.half_width` of each.

    Parameters
    ----------
    models : sequence of ErrorModel
    taps : sequence of ndarray of int of shape (n_inputs,)
        Positions of the inputs of each model among the changes.
    spreads : sequence of int
        Number of spreads of each model.
    """

    def __init__(self, models: "Sequence[ErrorModel]", taps: Sequence[IntArray], spreads: Sequence[int]) -> None:
        bands = [m.band for m in models]
        self._sums = np.repeat(np.eye(len(models)), spreads, axis=0)  # (n_spread of all, n_models)
        self._floor = np.array([np.nan if b is None else b.floor for b in bands]) ** 2
        self._running, self._stopped = (
            np.array(
                [np.nan if b is None else getattr(b, name) if b.speeds else max(b.running, b.stopped) for b in bands]
            )
            for name in ("running", "stopped")
        )
        self._widening = np.array([0.0 if b is None else b.widening for b in bands])
        # models mostly have the same joint support: each distance is computed once
        apart = [
            (m.joint, tuple(own.tolist())) if w else None
            for m, own, w in zip(models, taps, self._widening, strict=True)
        ]
        self._apart = [
            (joint, np.array(own, dtype=np.intp), np.array([a == (joint, own) for a in apart]))
            for joint, own in dict.fromkeys(a for a in apart if a is not None)
            if joint is not None
        ]
        # models mostly have the same speeds: each position and threshold is compared once
        speeds = [
            {(place, m.thresholds.stopped_speed) for place in own[list(m.band.speeds)].tolist()} if m.band else set()
            for m, own in zip(models, taps, strict=True)
        ]
        each = sorted(set().union(*speeds))
        self._speeds = np.array([place for place, _ in each], dtype=np.intp)
        self._most = np.array([most for _, most in each])
        of = [one in own for one in each for own in speeds]
        self._of = np.array(of, dtype=np.bool_).reshape(len(each), len(models))

    def half_widths(self, change: FloatArray, clipped: FloatArray, spreads: FloatArray) -> FloatArray:
        """Return the half-widths, (..., n_models); nan for a model without a band.

        Parameters
        ----------
        change : ndarray of shape (..., n_positions)
            Inputs minus their reference [their units].
        clipped : ndarray of shape (..., n_positions)
            The same, clipped to the trained ranges.
        spreads : ndarray of shape (..., n_spreads)
            Spreads of all models, in their order [their units].
        """
        turns = (np.abs(clipped.take(self._speeds, axis=-1)) > self._most) @ self._of
        factor = np.where(turns, self._running, self._stopped)
        found = np.asarray(factor * np.sqrt(self._floor + spreads**2 @ self._sums))
        for joint, own, mine in self._apart:
            found[..., mine] *= widen(self._widening[mine], joint.distance(change[..., own])[..., None])
        return found
