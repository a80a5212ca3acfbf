"""Autoregressive families: the deviation from its own past and from inputs, in steps of a fixed interval (P-01).

The model's clock ticks every `interval`; readings may come at any time:

- A reading represents the time since the previous reading, as for the lags of `thermocomp.core.lagbank`. The input of
  a tick is the mean of the inputs over the interval that ends at the tick. With one reading per interval, this is the
  reading itself.
- Ticks are computed when they are due, several at once after a gap. The work is bounded: once the stored inputs are all
  equal, the rest of a gap is one matrix power (for a net, the loop ends once its output has settled).
- Between two ticks the deviation is interpolated linearly from the last tick towards the next one, which is computed
  with the mean of the inputs since the last tick. The deviation is continuous in time, so that a reading at 14.9 s
  instead of 15.1 s makes no significant difference; at the tick it is exact.

The past deviations are those of the model, never measured ones (P-05, E-P3). `ErrorModel.init` starts cold: zero
deviation and zero inputs before the first reading. The effect of an earlier job (E-P5) is carried over either by
continuing with its `State`, or by `begin_at`.
"""

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike

from thermocomp.core.arrays import FloatArray
from thermocomp.core.bounds import GAP, ORDER, TICK, check_between, check_count, check_finite
from thermocomp.core.exceptions import InputError, SettingError
from thermocomp.core.expression import Constant, Mean, Named, Node, Past, Recurrence, Sum, sum_weighted
from thermocomp.core.model import ErrorModel
from thermocomp.core.network import Affine, Perceptron
from thermocomp.core.state import State

#: fraction of the interval by which a reading may come early and still trigger the tick; covers rounding of clocks
EARLY = 1e-6
#: smallest admissible 1 - sum(a); the settled deviation is the drive divided by it
SETTLES = 1e-9
#: maximum number of ticks of a net made at once: one day at 15 s; after that the net is assumed to have settled
MOST_TICKS = 5760


def find_largest_root(a: ArrayLike) -> float:
    """Return the largest modulus of the roots of z^k - a_1 z^(k-1) - ... - a_k; below 1, the free run is stable."""
    roots = np.linalg.eigvals(companion(np.asarray(a, dtype=np.float64)))
    return float(np.abs(roots).max(initial=0.0))


def companion(a: FloatArray) -> FloatArray:
    """Return the matrix that advances the last k deviations by one tick, without inputs."""
    matrix = np.eye(len(a), k=-1)
    matrix[:1] = a
    return matrix


@dataclass(frozen=True, kw_only=True)
class Ticking(ErrorModel):
    """Common part of the autoregressive families: the clock and the memory.

    The runs of a batch share one clock.

    Parameters
    ----------
    interval : float
        h, time between two ticks [s].
    """

    remembers: ClassVar[bool] = True

    interval: float

    @property
    @abstractmethod
    def orders(self) -> tuple[int, int]:
        """Number of past deviations (k) and past values of each input (m) used in one tick."""

    @abstractmethod
    def _tick(self, regressors: FloatArray) -> FloatArray:
        """Return the next deviation from [dz(t-h) .. dz(t-kh), inputs(t), inputs(t-h) .. inputs(t-mh)]."""

    @abstractmethod
    def _coast(self, own: FloatArray, driven: FloatArray, ticks: int) -> FloatArray:
        """Return the last deviations after `ticks` more ticks at constant inputs `driven`."""

    def begin_at(
        self, deviation: ArrayLike, inputs: ArrayLike | None = None, reference: ArrayLike | None = None
    ) -> State:
        """Return the state of a machine whose deviation is known, such as after an earlier job (E-P5).

        Parameters
        ----------
        deviation : array-like of shape (...)
            Known deviation, assumed constant over the whole memory of the model [unit].
        inputs : array-like of shape (..., n_inputs), optional
            Input values over the same time. Default: their reference values.
        reference : array-like of shape (n_inputs,), optional
            Values that count as zero. Default: those stored in the model.
        """
        zero = np.array([i.reference for i in self.inputs]) if reference is None else np.asarray(reference, np.float64)
        given = zero if inputs is None else np.asarray(inputs, dtype=np.float64)
        known = np.asarray(deviation, dtype=np.float64)
        if zero.shape != (len(self.inputs),) or given.shape[-1:] != zero.shape:
            raise InputError(
                f"start of the model of {self.target}: expected {len(self.inputs)} inputs and {len(self.inputs)} "
                "reference values"
            )
        if not (np.isfinite(zero).all() and np.isfinite(given).all() and np.isfinite(known).all()):
            raise InputError(
                f"start of the model of {self.target}: deviation, inputs and reference must be finite; remove NaN and "
                "infinity"
            )
        change, _ = self.clip(given - zero)
        k, m = self.orders
        shape = np.broadcast_shapes(known.shape, change.shape[:-1])
        own = np.broadcast_to(known[..., None], (*shape, max(k, 1)))
        past = np.broadcast_to(np.tile(change, m), (*shape, m * len(self.inputs)))
        clock = np.zeros((*shape, 1 + len(self.inputs)))
        memory = np.concatenate([clock, own, past], axis=-1)
        return State(zero, memory, own[..., 0].copy(), np.zeros(len(self.inputs), dtype=np.bool_))

    def _check_interval(self) -> None:
        check_between(f"model of {self.target}", TICK, GAP, interval=self.interval)

    def _begin(self, change: FloatArray) -> FloatArray:
        # [time since the last tick, integral of the inputs since then, past deviations, inputs of the last m ticks]
        k, m = self.orders
        n = len(self.inputs)
        memory = np.zeros((*change.shape[:-1], 1 + n + max(k, 1) + m * n))
        if m:
            memory[..., -m * n : memory.shape[-1] - (m - 1) * n] = change
        return memory

    def _advance(self, memory: FloatArray, change: FloatArray, dt: float) -> tuple[FloatArray, FloatArray]:
        if change.shape[:-1] != memory.shape[:-1]:  # one initial state for many runs, or many for the same inputs
            shape = np.broadcast_shapes(change.shape[:-1], memory.shape[:-1])
            memory = np.broadcast_to(memory, (*shape, memory.shape[-1]))
            change = np.broadcast_to(change, (*shape, change.shape[-1]))
        n, (k, m) = len(self.inputs), self.orders
        phase = self._phase(memory)
        total, own, past = (
            memory[..., 1 : 1 + n],
            memory[..., 1 + n : 1 + n + max(k, 1)],
            memory[..., 1 + n + max(k, 1) :],
        )
        h = self.interval
        ticks = math.floor((phase + dt) / h + EARLY)
        if ticks == 0:
            phase, total = phase + dt, total + dt * change
        else:
            mean = (total + (h - phase) * change) / h  # over the interval that ends at the first tick
            for _ in range(min(ticks, m + 1)):
                own, past = self._one(own, mean, past)
                mean = change
            if ticks > m + 1:
                own = self._coast(own, np.concatenate([change, past], axis=-1), ticks - m - 1)
            phase = min(max(phase + dt - ticks * h, -EARLY * h), h)  # clipped: rounding over a very long gap
            total = phase * change
        deviation = own[..., 0]
        if phase > EARLY * h:
            ahead = self._tick(np.concatenate([own[..., :k], total / phase, past], axis=-1))
            deviation = deviation + (phase / h) * (ahead - deviation)
        clock = np.full((*own.shape[:-1], 1), phase)
        return np.concatenate([clock, total, own, past], axis=-1), deviation

    def _one(self, own: FloatArray, mean: FloatArray, past: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Compute one tick; return the past deviations and the inputs of the last m ticks, newest first."""
        k, m = self.orders
        value = self._tick(np.concatenate([own[..., :k], mean, past], axis=-1))
        own = np.concatenate([value[..., None], own[..., :-1]], axis=-1)
        return own, np.concatenate([mean, past], axis=-1)[..., : m * len(self.inputs)]

    def _phase(self, memory: FloatArray) -> float:
        """Return the time since the last tick."""
        clocks = memory[..., 0]
        if clocks.ndim == 0:
            return float(clocks)
        first = float(clocks.flat[0]) if clocks.size else 0.0
        if (clocks != first).any():
            raise InputError(f"model of {self.target}: the runs of a batch must have been started at the same time")
        return first

    def _regressor_names(self) -> list[str]:
        """Return the names of the arguments of `_tick`, such as ``dz(t-1)`` and ``n(t-2)``, with time in ticks."""
        k, m = self.orders
        return [f"dz(t-{i})" for i in range(1, k + 1)] + [
            f"{x.name}(t-{i})" if i else f"{x.name}(t)" for i in range(m + 1) for x in self.inputs
        ]

    def _regressors(self, change: Sequence[Node]) -> list[Node]:
        """Return the arguments of `_tick` as nodes of an expression."""
        k, m = self.orders
        own: list[Node] = [Past(i) for i in range(1, k + 1)]
        return own + [Mean(x, i) for i in range(m + 1) for x in change]


@dataclass(frozen=True, kw_only=True)
class Autoregressive(Ticking):
    """dz(t) = intercept + sum_i a_i dz(t - ih) + sum over inputs j, sum_i b_ji n_j(t - ih) (P-01).

    An unstable polynomial is rejected: its free run would diverge.

    Parameters
    ----------
    family : str
        Name of the family in a file.
    a : tuple of float
        a_1 .. a_k, coefficients of the past deviations.
    b : tuple of tuple of float
        b_0 .. b_m of each input [unit per unit of the input].
    """

    family: Literal["autoregressive"] = "autoregressive"

    a: tuple[float, ...]
    b: tuple[tuple[float, ...], ...]

    def _check(self) -> None:
        owner = f"model of {self.target}"
        self._check_interval()
        if len(self.b) != len(self.inputs) or not self.b or len({len(b) for b in self.b}) != 1 or not self.b[0]:
            raise SettingError(
                f"{owner}: expected coefficients b_0 .. b_m for each of {len(self.inputs)} inputs, at least one and "
                "the same number for each"
            )
        check_count(owner, ORDER, past_deviations=self.a, past_inputs=self.b[0][1:])
        check_finite(owner, a=self.a, b=self.b, intercept=self.intercept)
        largest = find_largest_root(self.a)
        if not largest < 1:
            raise SettingError(
                f"{owner}: its free run does not decay: the largest root of its polynomial is {largest:.6g}, "
                "expected < 1"
            )
        if not 1.0 - sum(self.a) > SETTLES:
            raise SettingError(f"{owner}: its free run has no steady state: its coefficients a add up to 1")

    @property
    def orders(self) -> tuple[int, int]:
        """Orders k and m."""
        return len(self.a), len(self.b[0]) - 1

    @cached_property
    def _weights(self) -> FloatArray:
        return np.concatenate([np.array(self.a, dtype=np.float64), np.array(self.b, dtype=np.float64).T.ravel()])

    @cached_property
    def _companion(self) -> FloatArray:
        return companion(np.array(self.a or (0.0,), dtype=np.float64))

    def _tick(self, regressors: FloatArray) -> FloatArray:
        value: FloatArray = regressors @ self._weights + self.intercept
        return value

    def _coast(self, own: FloatArray, driven: FloatArray, ticks: int) -> FloatArray:
        # the difference from the settled value decays with the companion matrix
        settled = (driven @ self._weights[len(self.a) :] + self.intercept) / (1.0 - sum(self.a))
        rest = own - settled[..., None]
        left: FloatArray = rest @ np.linalg.matrix_power(self._companion, ticks).T
        return settled[..., None] + left

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the inputs that affect the deviation."""
        return tuple(x.name for x, b in zip(self.inputs, self.b, strict=True) if any(b))

    def coefficients_by_name(self) -> dict[str, float]:
        """Return a_i as ``dz(t-i)`` and b_i as ``input(t-i)``; time is counted in intervals."""
        return {n: c for n, c in zip(self._regressor_names(), self._weights.tolist(), strict=True) if c != 0}

    def _expression(self, change: Sequence[Node]) -> Node:
        return Recurrence(sum_weighted(self._weights.tolist(), self._regressors(change), self.intercept), self.interval)


@dataclass(frozen=True, kw_only=True)
class AutoregressiveNet(Ticking):
    """dz(t) = intercept + the output of a net for dz(t-h) .. dz(t-kh) and each input at t .. t-mh (P-03, E-P2).

    The output must be a sigmoid or tanh: it is bounded by its scaling, so the free run cannot diverge.

    Parameters
    ----------
    family : str
        Name of the family in a file.
    k, m : int
        Number of past deviations, and of past values of each input.
    net : Perceptron
        Net with one output; its inputs are dz(t-h) .. dz(t-kh), all inputs at t, all inputs at t-h, ...
    input_scaling : Affine
        Scaling of these values to the inputs of the net.
    output_scaling : Affine
        Scaling of the output of the net to the deviation [unit].
    """

    family: Literal["autoregressive-network"] = "autoregressive-network"

    k: int
    m: int
    net: Perceptron
    input_scaling: Affine
    output_scaling: Affine

    def _check(self) -> None:
        owner = f"model of {self.target}"
        self._check_interval()
        check_finite(owner, intercept=self.intercept)
        check_between(owner, 0, ORDER, k=self.k, m=self.m)
        wanted = self.k + (self.m + 1) * len(self.inputs)
        n_inputs, _, n_outputs = self.net.shape
        if not self.inputs or not n_inputs == wanted == len(self.input_scaling.gain):
            raise SettingError(
                f"{owner}: k = {self.k}, m = {self.m} and {len(self.inputs)} inputs need a net of {wanted} inputs; "
                f"found {n_inputs}, and scaling of {len(self.input_scaling.gain)}"
            )
        if n_outputs != 1 or len(self.output_scaling.gain) != 1:
            raise SettingError(f"{owner}: expected one output, found {n_outputs}")
        if self.net.output == "identity":
            raise SettingError(
                f"{owner}: an identity output is not bounded, so the free run could diverge; use another output "
                "function"
            )

    @property
    def orders(self) -> tuple[int, int]:
        """Orders k and m."""
        return self.k, self.m

    def _tick(self, regressors: FloatArray) -> FloatArray:
        scaled = self.net.evaluate(self.input_scaling(regressors))
        return self.output_scaling(scaled)[..., 0] + self.intercept

    def _coast(self, own: FloatArray, driven: FloatArray, ticks: int) -> FloatArray:
        past = driven[..., len(self.inputs) :]
        for _ in range(min(ticks, MOST_TICKS)):
            before = own
            own, _ = self._one(own, driven[..., : len(self.inputs)], past)
            if np.array_equal(own, before):
                break
        return own

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the inputs that affect the deviation through non-zero weights."""
        out = np.array(self.net.output_weights[0]) != 0
        reached = (np.array(self.net.hidden_weights)[out] != 0).any(axis=0) & (np.array(self.input_scaling.gain) != 0)
        alive = reached[self.k :].reshape(self.m + 1, -1).any(axis=0) & (self.output_scaling.gain[0] != 0)
        return tuple(x.name for x, used in zip(self.inputs, alive.tolist(), strict=True) if used)

    def coefficients_by_name(self) -> dict[str, float]:
        """Return all weights and thresholds; ``w(dz(t-1), h2)`` connects the last deviation to hidden node 2."""
        names, net = self._regressor_names(), self.net
        found: dict[str, float] = {}
        for j, (weights, threshold) in enumerate(zip(net.hidden_weights, net.hidden_thresholds, strict=True), start=1):
            found |= {f"w({x}, h{j})": w for x, w in zip(names, weights, strict=True)}
            found[f"th(h{j})"] = threshold
        found |= {f"w(h{j}, out)": w for j, w in enumerate(net.output_weights[0], start=1)}
        return found | {"th(out)": net.output_thresholds[0]}

    def _expression(self, change: Sequence[Node]) -> Node:
        name = f"{self.net.kind} of {', '.join(self._regressor_names())}"
        net = self.net.expression(self._regressors(change), self.input_scaling, self.output_scaling)
        tick: Node = Named(name, net)
        return Recurrence(Sum((Constant(self.intercept), tick)) if self.intercept else tick, self.interval)
