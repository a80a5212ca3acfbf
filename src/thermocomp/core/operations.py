"""Operations of `thermocomp.core.layers`: values in adjacent slots, for one reading or for several in succession."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.arrays import FloatArray
from thermocomp.core.forms import Forms
from thermocomp.core.ticker import Ticker

IntArray = NDArray[np.intp]


class Layer(NamedTuple):
    """Values in adjacent slots, computed by one operation on the values of each operand."""

    slots: slice
    operands: tuple[Forms, ...]
    work: Callable[..., FloatArray]

    def advance(self, values: FloatArray, _memory: FloatArray, _dt: float) -> None:
        """Compute the values."""
        values[..., self.slots] = self.work(*(f.evaluate(values) for f in self.operands))

    def follow(self, values: FloatArray, memory: FloatArray, _steps: FloatArray) -> None:
        """Compute the values of several readings, (n_readings, ..., n_slots)."""
        self.advance(values, memory, 0.0)


class Lags(NamedTuple):
    """First-order lags, in adjacent slots; rate = rest + pace * gain."""

    slots: slice
    memory: slice | IntArray
    signals: Forms
    rest: FloatArray  #: [1/s]
    gain: FloatArray  #: [1/s]
    paces: Forms | None

    def advance(self, values: FloatArray, memory: FloatArray, dt: float) -> None:
        """Move the lags towards their signals in the time `dt`; infinite: to the steady state."""
        signals = self.signals.evaluate(values)
        if dt != np.inf:
            held = memory[..., self.memory]
            signals -= held
            signals *= np.expm1(-dt * self._rates(values))
            signals = held - signals
        memory[..., self.memory] = values[..., self.slots] = signals

    def follow(self, values: FloatArray, memory: FloatArray, steps: FloatArray) -> None:
        """Move the lags through several readings, (n_readings, ..., n_slots)."""
        signals = self.signals.evaluate(values)
        shares = np.expm1(-steps.reshape(-1, *[1] * (values.ndim - 1)) * self._rates(values))
        held, found = memory[..., self.memory], values[..., self.slots]
        for k, (signal, share) in enumerate(zip(signals, shares, strict=True)):
            held = found[k] = held - (signal - held) * share
        memory[..., self.memory] = held

    def _rates(self, values: FloatArray) -> FloatArray:
        return self.rest if self.paces is None else self.rest + self.paces.evaluate(values) * self.gain


class Ticks(NamedTuple):
    """A value that is updated at fixed intervals (ticks)."""

    slots: slice
    memory: slice
    inputs: Forms
    ticker: Ticker

    def advance(self, values: FloatArray, memory: FloatArray, dt: float) -> None:
        """Make the ticks that are due; an infinite time: begin."""
        inputs = self.inputs.evaluate(values)
        if dt == np.inf:
            memory[..., self.memory] = self.ticker.begin(inputs)
            values[..., self.slots.start] = 0.0
        else:
            own, values[..., self.slots.start] = self.ticker.advance(memory[..., self.memory], inputs, dt)
            memory[..., self.memory] = own

    def follow(self, values: FloatArray, memory: FloatArray, steps: FloatArray) -> None:
        """Make the ticks of several readings, (n_readings, ..., n_slots)."""
        for reading, dt in zip(values, steps.tolist(), strict=True):
            self.advance(reading, memory, dt)
