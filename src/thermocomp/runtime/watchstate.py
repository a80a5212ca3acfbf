"""The state of the watch over the temperatures between two readings: see `thermocomp.runtime.watch`."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.watch import Watch
from thermocomp.core.zero import ZeroMean
from thermocomp.runtime import heat
from thermocomp.runtime.heat import HeatState

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int8]

#: states of a sensor, by `WatchState.fault`
WORDS = ("good", "missing", "stepped", "stuck", "off", "swapped", "unexplained")
GOOD, MISSING, STEPPED, STUCK, OFF, SWAPPED, UNEXPLAINED = range(len(WORDS))
#: no failure of a sensor for certain
UNSURE = WORDS[UNEXPLAINED]


class WatchState(NamedTuple):
    """State of the watch between two readings; arrays are (..., n_sensors) unless noted otherwise."""

    reference: FloatArray  #: (..., n_inputs), zero; nan while unknown
    averaged: ZeroMean  #: mean of the readings of an unknown zero
    time: float  #: of the last check; nan before the first [s]
    memory: FloatArray  #: (..., n_memory), of the predictions
    traces: FloatArray  #: (..., n_lags * n_sensors), lags of the differences: effect of a failure on `memory`
    used: FloatArray  #: values used, minus the reference [degC]
    predicted: FloatArray  #: minus the reference [degC]
    usual: FloatArray  #: difference between reading and prediction, low-passed [degC]
    fault: IntArray  #: see `WORDS`
    since: FloatArray  #: time at which the fault was found [s]
    bridge: FloatArray  #: offset of the substitute from the prediction, fading from `since` [degC]
    jumped: FloatArray  #: time of a jump; nan: none [s]
    off: FloatArray  #: start of a deviation; nan: none [s]
    same: FloatArray  #: constant reading since `still` [degC]
    still: FloatArray  #: start of the constant reading [s]
    then: FloatArray  #: prediction at that time [degC]
    moving: FloatArray  #: time since which its prediction has moved too far for a constant reading; nan: it has not [s]
    back: FloatArray  #: time since which one that may return agrees with its prediction; nan: it does not [s]
    evidence: FloatArray  #: (..., n_pairs), low-passed evidence that two are swapped; -inf: excluded
    fast: FloatArray  #: (...,), last time at which the spindle turned faster than in the training [s]
    heat: HeatState = HeatState()  #: supervision of the speeds
    step: FloatArray = np.empty(0)  #: smallest change between two checks: resolution, or noise; inf: unknown [degC]

    @property
    def sound(self) -> bool:
        """True if no input has failed, without the cost of `faults`."""
        return not (np.count_nonzero(self.fault) or np.count_nonzero(self.heat.fault))

    def faults(self, watch: Watch) -> IntArray:
        """Return the faults of the inputs that can fail, (..., n_failing): temperatures, then supervised speeds."""
        return (
            np.concatenate([self.fault, self.heat.fault[..., watch.deciding >= 0]], axis=-1)
            if watch.checks
            else self.fault
        )


def begin(watch: Watch, reference: FloatArray | None = None, runs: tuple[int, ...] = ()) -> WatchState:
    """Return the state of a watch before the first reading.

    Parameters
    ----------
    reference : ndarray of shape (n_inputs,), optional
        Zero of the inputs; default: determined by the first readings for inputs with ``rezero``.
    """
    zero = np.array([np.nan if i.rezero else i.reference for i in watch.inputs])
    zero = np.broadcast_to(zero if reference is None else reference, (*runs, len(watch.inputs))).copy()
    n, bank = (*runs, len(watch.sensors)), watch.bank
    nan, none = np.full(n, np.nan), np.zeros(n)
    memory = np.zeros((*runs, len(bank.rates)))
    traces = np.zeros((*runs, len(watch.time_constants) * len(watch.sensors)))
    return WatchState(
        reference=zero,
        averaged=ZeroMean(),
        time=np.nan,
        memory=memory,
        traces=traces,
        used=none,
        predicted=none,
        usual=none,
        fault=np.zeros(n, dtype=np.int8),
        since=nan,
        bridge=none,
        jumped=nan,
        off=nan,
        same=nan,
        still=nan,
        then=none,
        moving=nan,
        back=nan,
        evidence=np.zeros((*runs, len(watch.pairs[0]))),
        fast=np.full(runs, -np.inf),
        heat=heat.begin(watch, runs) if watch.checks else HeatState(),
        step=np.full(n, np.inf),
    )
