"""One step for many machines: machines of one kind, each with its own zero, memory and correction.

For machines that share a linear model with lags (`LinearDynamic`): the same gate for each value, model and limits as in
`Compensator.step`, as array operations over all machines at once. Tasks for individual machines (zeros, commands,
restarts, sensor faults, sources that have stopped, probings) are not included; use a `Compensator` for these.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from thermocomp.core.bounds import GAP
from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError
from thermocomp.core.lagbank import step_response
from thermocomp.core.lineardynamic import LinearDynamic
from thermocomp.runtime.gate import find_plausible_range

# any real array, with the precision of the fleet
Array = NDArray[Any]


@dataclass(eq=False)
class Fleet:
    """Machines that run one model, each relative to its own zero; initially all corrections are zero.

    Parameters
    ----------
    model : LinearDynamic
        Accepted, or approved by a person; each signal is a single input, and readings are clipped to the trained range.
    zeros : array-like of shape (n_machines, n_inputs)
        Zero of the inputs of each machine.
    limits : Limits
        Limits, the same for all machines.
    dtype : dtype
        ``float32`` halves memory and time; it differs from ``float64`` by less than 1e-3 um.

    Raises
    ------
    InputError
        The model is of another kind or must not run, or the zeros are not finite or have a wrong shape.
    """

    model: LinearDynamic
    zeros: ArrayLike
    limits: Limits = Limits()
    dtype: DTypeLike = np.float64
    corrections: Array = field(init=False)  #: (n_machines,), in force [um]

    def __post_init__(self) -> None:
        model = self.model
        if not isinstance(model, LinearDynamic) or model.support.policy != "clip" or model.unit != "um":
            raise InputError(
                f"model of {model.target}: a fleet supports only linear models with lags that predict um and clip "
                "their inputs"
            )
        if any(len(signal) != 1 for signal in model.signals):
            raise InputError(f"model of {model.target}: a fleet does not support models with products of inputs")
        model.check_may_run()
        zero = np.array(self.zeros, dtype=np.float64)
        if zero.ndim != 2 or zero.shape[1] != len(model.inputs):
            raise InputError(
                f"zeros: expected shape (n_machines, {len(model.inputs)}), one row per machine, got {zero.shape}"
            )
        if not np.isfinite(zero).all():
            raise InputError(
                f"zeros: {int(np.count_nonzero(~np.isfinite(zero)))} of {zero.size} values are not finite; "
                "remove NaN and infinity"
            )
        n, kind = len(zero), self.dtype
        ranges = [
            [find_plausible_range(i, z, model.thresholds) for z in column]
            for i, column in zip(model.inputs, zero.T, strict=True)
        ]
        bounds = np.array(ranges).reshape(len(model.inputs), n, 2)
        self._low, self._high = (np.ascontiguousarray(bounds[:, :, k], dtype=kind) for k in (0, 1))
        self._zero = np.ascontiguousarray(zero.T, dtype=kind)
        least, most = (
            model.clip(np.full(len(model.inputs), -np.inf))[0],
            model.clip(np.full(len(model.inputs), np.inf))[0],
        )
        # full arrays: numpy takes three times as long with a broadcast bound
        self._least, self._most = (np.repeat(b[:, None], n, axis=1).astype(kind) for b in (least, most))
        self._unsigned = np.array([k for k, i in enumerate(model.inputs) if i.unsigned], dtype=np.intp)
        inputs = [signal[0] for signal in model.signals]
        self._follows = np.array([inputs[k] for k in model.lag_signals], dtype=np.intp)
        self._direct = np.bincount(inputs, model.direct, len(model.inputs)).astype(kind)
        self._lagged, self._taus = np.array(model.lagged, dtype=kind), np.array(model.time_constants)
        lags = len(self._follows)
        self._memory = np.zeros((lags, n), dtype=kind)
        self._straight = np.array_equal(self._follows, np.arange(len(model.inputs)))
        self._values, self._followed = np.empty((len(model.inputs), n), dtype=kind), np.empty((lags, n), dtype=kind)
        self._begun, self._idle, self._since = np.zeros(n, dtype=np.bool_), np.zeros(n), np.zeros(n)
        self._share = (np.nan, np.zeros(lags, dtype=kind))
        self._one = np.array(model.intercept, dtype=kind)
        self.corrections = np.zeros(n, dtype=kind)

    def tick(self, readings: Array, dt: float) -> NDArray[np.bool_]:
        """Process one reading of each machine; `corrections` are in force after it.

        Parameters
        ----------
        readings : ndarray of shape (n_inputs, n_machines)
            Readings in the order of the model's inputs [their units]; nan where a value is missing.
        dt : float
            Time since the previous tick [s].

        Returns
        -------
        ndarray of bool of shape (n_machines,)
            Machines whose reading was used. Corrections of the others are held for `Limits.hold`, then fade.
        """
        if np.shape(readings) != self._values.shape or not 0.0 <= dt < np.inf:
            raise InputError(
                f"readings of shape {np.shape(readings)} after {dt} s: expected the shape {self._values.shape} and a "
                "time that is finite and not negative"
            )
        values, followed, memory = self._values, self._followed, self._memory
        with np.errstate(invalid="ignore", over="ignore"):
            values[...] = readings
            values[self._unsigned] = np.abs(values[self._unsigned])
            plausible = (values >= self._low) & (values <= self._high)
            used: NDArray[np.bool_] = np.logical_and.reduce(plausible, axis=0)
            np.subtract(values, self._zero, out=values)
            np.maximum(values, self._least, out=values)
            np.minimum(values, self._most, out=values)
            signals = values if self._straight else np.take(values, self._follows, axis=0, out=followed)
            self._since += dt
            np.subtract(signals, memory, out=followed)
            odd = ~used | ~self._begun | (self._since != dt)
            late, apart = np.flatnonzero(odd & used), followed[:, odd & used]
            followed[:, odd] = 0.0
            followed *= self._shares(dt)[:, None]
            memory += followed
            if late.size:
                self._catch_up(late, apart)
        self._since[used] = 0.0
        said = self._one + self._direct @ values + self._lagged @ memory
        self._move(said, used, min(dt, self.limits.reading_age))
        return used

    def _shares(self, dt: float) -> Array:
        if self._share[0] != dt:
            self._share = (dt, step_response(min(dt, GAP), self._taus).astype(self.dtype))
        return self._share[1]

    def _catch_up(self, rows: NDArray[np.intp], followed: Array) -> None:
        """Advance the lags of machines over the individual time since their last used reading, or from rest."""
        times = np.where(self._begun[rows], np.minimum(self._since[rows], GAP), np.inf)
        self._memory[:, rows] += step_response(times, self._taus[:, None]).astype(self.dtype) * followed
        self._begun[rows] = True

    def _move(self, said: Array, used: NDArray[np.bool_], travel: float) -> None:
        limits, before = self.limits, self.corrections
        wanted = np.clip(-said, -limits.magnitude, limits.magnitude)
        reach = self._number(limits.rate * travel)
        moved = np.clip(wanted, before - reach, before + reach)
        np.clip(moved, -limits.magnitude, limits.magnitude, out=moved)
        driven = used & np.isfinite(moved)
        if limits.dead_band:
            moved = np.where(np.abs(wanted - before) <= limits.dead_band, before, moved)
        if driven.all():
            self.corrections, self._idle[:] = moved, 0.0
            return
        self._idle = np.where(driven, 0.0, self._idle + travel)
        gone = np.clip(before * (1.0 - np.exp(-travel / limits.fade)), -reach, reach)
        held = np.where(self._idle > limits.hold, before - gone, before)
        self.corrections = np.where(driven, moved, held).astype(self.dtype)

    def _number(self, value: float) -> Any:
        return np.asarray(value, dtype=self.dtype)[()]
