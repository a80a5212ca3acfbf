"""A value that is updated at fixed intervals, whatever the times of the readings (P-01).

There is a tick every `interval`; readings may come at any time:

- A reading is assigned to the time since the previous reading, as for the lags of `thermocomp.core.lagbank`. The input
  of a tick is the mean of the inputs over the interval that ends at the tick. With one reading per interval, this is
  the reading itself.
- Ticks are computed when they are due, several at once after a gap. The work is bounded: once the stored inputs are all
  equal, the rest of a gap is one matrix power (for a net, the loop ends once its output has settled).
- Between two ticks the value is interpolated linearly from the last tick towards the next one, which is computed
  with the mean of the inputs since the last tick. The value is continuous in time, so that a reading at 14.9 s
  instead of 15.1 s makes no significant difference; at the tick it is exact.
"""

import math
from collections.abc import Callable

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.exceptions import InputError

#: fraction of the interval by which a reading may come early and still trigger the tick; covers rounding of clocks
EARLY = 1e-6
#: maximum number of ticks computed at once if the next value is not a linear form: one day at 15 s; it has settled then
MOST_TICKS = 5760


class Ticker:
    """A value updated at every tick, for one reading or many; the runs of a batch have their ticks at the same times.

    Parameters
    ----------
    tick : callable
        Returns the next value, (...), from the last `k` values, the means of the inputs over the interval that ends now
        and over each of the last `m` intervals, newest first: (..., k + (m + 1) n_inputs).
    linear : tuple of (ndarray of shape (k + (m + 1) n_inputs,), float) or None
        Weights and constant, if the next value is a linear form: a long gap is then one matrix power.
    interval : float
        Time between two ticks [s].
    k, m, n_inputs : int
    """

    def __init__(
        self,
        tick: Callable[[FloatArray], FloatArray],
        linear: tuple[FloatArray, float] | None,
        interval: float,
        k: int,
        m: int,
        n_inputs: int,
    ) -> None:
        self._tick, self._linear, self._interval = tick, linear, interval
        self._k, self._m, self._n = k, m, n_inputs
        #: time since the last tick, integral of the inputs since then, last values, means over the last m intervals
        self.n_memory = 1 + n_inputs + max(k, 1) + m * n_inputs

    def begin(self, inputs: FloatArray) -> FloatArray:
        """Return the memory, (..., n_memory), of a cold start: value and inputs were zero until now."""
        memory = np.zeros((*inputs.shape[:-1], self.n_memory))
        if self._m:
            first = 1 + self._n + max(self._k, 1)
            memory[..., first : first + self._n] = inputs
        return memory

    def begin_at(self, value: FloatArray, inputs: FloatArray) -> FloatArray:
        """Return the memory of a value, (...), and inputs, (..., n_inputs), that have long been constant."""
        clock = np.zeros((*value.shape, 1 + self._n))
        own = np.broadcast_to(value[..., None], (*value.shape, max(self._k, 1)))
        return np.concatenate([clock, own, np.tile(inputs, self._m)], axis=-1)

    def advance(self, memory: FloatArray, inputs: FloatArray, dt: float) -> tuple[FloatArray, FloatArray]:
        """Return the memory and the value `dt` seconds later; between two ticks it is interpolated."""
        n, m, h = self._n, self._m, self._interval
        phase, total = self._phase(memory), memory[..., 1 : 1 + n]
        own, past = memory[..., 1 + n : 1 + n + max(self._k, 1)], memory[..., 1 + n + max(self._k, 1) :]
        ticks = math.floor((phase + dt) / h + EARLY)
        if ticks == 0:
            phase, total = phase + dt, total + dt * inputs
        else:
            mean = (total + (h - phase) * inputs) / h  # over the interval that ends at the first tick
            for _ in range(min(ticks, m + 1)):
                own, past = self._one(own, mean, past)
                mean = inputs
            if ticks > m + 1:
                own = self._coast(own, inputs, past, ticks - m - 1)
            phase = min(max(phase + dt - ticks * h, -EARLY * h), h)  # clipped: rounding over a very long gap
            total = phase * inputs
        value = own[..., 0]
        if phase > EARLY * h:
            ahead = self._tick(np.concatenate([own[..., : self._k], total / phase, past], axis=-1))
            value = value + (phase / h) * (ahead - value)
        clock = np.full((*own.shape[:-1], 1), phase)
        return np.concatenate([clock, total, own, past], axis=-1), value

    def _one(self, own: FloatArray, mean: FloatArray, past: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Compute one tick; return the last values and the means over the last m intervals, newest first."""
        value = self._tick(np.concatenate([own[..., : self._k], mean, past], axis=-1))
        own = np.concatenate([value[..., None], own[..., :-1]], axis=-1)
        return own, np.concatenate([mean, past], axis=-1)[..., : self._m * self._n]

    def _coast(self, own: FloatArray, inputs: FloatArray, past: FloatArray, ticks: int) -> FloatArray:
        """Return the last values after further ticks at constant inputs; all inputs in `past` are equal."""
        if self._linear is None:
            for _ in range(min(ticks, MOST_TICKS)):
                before = own
                own, _ = self._one(own, inputs, past)
                if np.array_equal(own, before):
                    break
            return own
        weights, constant = self._linear  # the difference from the settled value decays with the companion matrix
        a = weights[: self._k]
        driven = np.concatenate([inputs, past], axis=-1) @ weights[self._k :] + constant
        settled = driven / (1.0 - a.sum())
        rest = own - settled[..., None]
        return np.asarray(settled[..., None] + rest @ np.linalg.matrix_power(companion(a), ticks).T)

    @staticmethod
    def _phase(memory: FloatArray) -> float:
        """Return the time since the last tick [s]."""
        clocks = memory[..., 0]
        first = float(clocks.flat[0]) if clocks.size else 0.0
        if (clocks != first).any():
            raise InputError(
                f"the runs of a batch must have started at the same time; {first:g} and "
                f"{clocks[clocks != first][0]:g} s have passed since their last clock ticks"
            )
        return first


def companion(a: FloatArray) -> FloatArray:
    """Return the matrix that advances the last values by one tick, without inputs."""
    matrix = np.eye(max(len(a), 1), k=-1)
    matrix[0, : len(a)] = a
    return matrix
