"""Paced models that share their states: the channels of one machine, evaluated jointly."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.arrays import FloatArray
from thermocomp.core.paceddynamic import PacedDynamic


class TogetherState(NamedTuple):
    """State of grouped models between two steps; leading axes, if any, are a batch of independent runs."""

    reference: FloatArray  #: (..., n_inputs), values that count as zero
    memory: FloatArray | None  #: (..., n_memory); None before the first reading
    change: FloatArray  #: (..., n_inputs), clipped changes in the last reading
    outside: NDArray[np.bool_]  #: (..., n_inputs), inputs beyond the trained range
    spread: FloatArray | None = None  #: (..., n_spread of all), differences between the structures of each model


class Together:
    """Models with the same inputs and states, each with a separate readout; each gives the same output as alone.

    Parameters
    ----------
    models : sequence of PacedDynamic
        Models with the same `key`.
    """

    def __init__(self, models: Sequence[PacedDynamic]) -> None:
        self.models = tuple(models)
        self._first = models[0]
        # rows: inputs or states; columns: the deviations, followed by the spread
        self._direct, self._weights = (
            np.column_stack([*(m.read_out[k] for m in models), *(m.spread_out[k] for m in models)]) for k in (0, 1)
        )
        self._intercept = np.array([m.intercept for m in models])
        counts = [len(m.spread) for m in models]
        self._sum = np.repeat(np.eye(len(models)), counts, axis=0)  # (n_spread of all, n_models)
        bands = [m.band for m in models]
        self._floor = np.array([np.nan if b is None else b.floor for b in bands]) ** 2
        self._running = np.array([np.nan if b is None else b.running for b in bands])
        self._stopped = np.array([np.nan if b is None else b.stopped for b in bands])

    @staticmethod
    def key(model: PacedDynamic) -> tuple[object, ...] | None:
        """Return the key shared by models that can be grouped; None for a model that is stepped individually."""
        band = model.band
        if model.support.policy != "clip" or (band is not None and not band.speeds):
            return None
        states = tuple((s.input, s.power, s.stopped, s.running) for s in model.states)
        temperatures = tuple(t.input for t in model.temperatures)
        speeds = None if band is None else band.speeds
        return model.inputs, model.support, model.time_constants, temperatures, model.top_speed, states, speeds

    def init(self) -> TogetherState:
        """Return the state of a machine that has just been zeroed: see `ErrorModel.init`."""
        zero = self._first.init()
        return TogetherState(zero.reference, None, np.zeros_like(zero.reference), zero.outside)

    def step(self, state: TogetherState, values: FloatArray, dt: float) -> tuple[TogetherState, FloatArray]:
        """Process one reading, as `ErrorModel.step` does, and return the deviations, (..., n_models)."""
        reference = state.reference if state.memory is not None else self._first.settle(state.reference, values)
        change, outside = self._first.clip(values - reference)
        if state.memory is None:
            memory = self._first.bank.signals(change)[0]
        else:
            memory = self._first.bank.advance(state.memory, change, dt)
        said, n = change @ self._direct + memory @ self._weights, len(self.models)
        return TogetherState(
            reference=reference, memory=memory, change=change, outside=outside, spread=said[..., n:]
        ), said[..., :n] + self._intercept

    def half_widths(self, state: TogetherState) -> FloatArray:
        """Return the half-widths of the bands about the deviations of the last reading, (..., n_models)."""
        if state.spread is None or self._first.band is None:
            return np.full((*state.change.shape[:-1], len(self.models)), np.nan)
        spread = state.spread**2 @ self._sum
        turning = self._first.band.turning(state.change)
        factor = np.where(turning[..., None], self._running, self._stopped)
        return np.asarray(factor * np.sqrt(self._floor + spread))
