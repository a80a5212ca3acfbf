"""States of a `PacedDynamic`: lags of temperatures and of powers of the speed, with speed-dependent time constants."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thermocomp.core import lagbank

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


class Bank(NamedTuple):
    """Inputs and time constants of the states of a `PacedDynamic`."""

    temperatures: IntArray  #: (n_temperatures,), inputs that are temperatures
    taus: int  #: lags per temperature
    speeds: IntArray  #: (n_states,), inputs of the speed states
    powers: FloatArray  #: (n_states,)
    rates: FloatArray  #: (n_lags + n_states,), at rest [1/s]
    gain: FloatArray  #: (n_states,), increase of the rate from rest to top speed [1/s]
    top: float  #: [1/min]

    def signals(self, change: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the inputs of the states, (..., n_memory), and the fraction of top speed of each speed state."""
        share = np.abs(change.take(self.speeds, axis=-1)) / self.top
        temperatures = change.take(self.temperatures, axis=-1)
        return np.concatenate((*(temperatures,) * self.taus, share**self.powers), axis=-1), share

    def advance(self, memory: FloatArray, change: FloatArray, dt: float) -> FloatArray:
        """Return the states `dt` seconds later, after the inputs changed to `change`."""
        signals, share = self.signals(change)
        lags = len(self.rates) - len(self.gain)
        rates = np.empty(signals.shape)
        rates[..., :lags] = self.rates[:lags]
        rates[..., lags:] = self.rates[lags:] + share * self.gain
        return lagbank.follow(memory, signals, dt * rates)
