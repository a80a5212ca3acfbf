"""Autoregressive families: the deviation from its own past and from inputs, in steps of a fixed interval (P-01).

The past deviations are those of the model, never measured ones (P-05, E-P3). `ErrorModel.init` starts cold: zero
deviation and zero inputs before the first reading. The effect of an earlier job (E-P5) is carried over either by
continuing with its `State`, or by `begin_at`.
"""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from thermocomp.core.arrays import FloatArray
from thermocomp.core.bounds import GAP, ORDER, TICK, check_between, check_count, check_finite
from thermocomp.core.exceptions import InputError, SettingError
from thermocomp.core.expression import Constant, Mean, Named, Node, Past, Recurrence, Sum, sum_weighted
from thermocomp.core.model import ErrorModel
from thermocomp.core.network import Affine, Perceptron
from thermocomp.core.state import State
from thermocomp.core.ticker import companion

#: smallest admissible 1 - sum(a); the steady-state deviation is the contribution of the inputs divided by it
SETTLES = 1e-9


def find_largest_root(a: ArrayLike) -> float:
    """Return the largest modulus of the roots of z^k - a_1 z^(k-1) - ... - a_k; the free run is stable if below 1."""
    roots = np.linalg.eigvals(companion(np.asarray(a, dtype=np.float64)))
    return float(np.abs(roots).max(initial=0.0))


@dataclass(frozen=True, kw_only=True)
class Ticking(ErrorModel):
    """Common part of the autoregressive families: the time steps (ticks) and the memory.

    All runs of a batch have their ticks at the same times.

    Parameters
    ----------
    interval : float
        h, time between two ticks [s].
    """

    interval: float

    @property
    @abstractmethod
    def orders(self) -> tuple[int, int]:
        """Number of past deviations (k) and past values of each input (m) used in one tick."""

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
                f"start of the model of {self.target}: expected {len(self.inputs)} inputs and as many reference "
                f"values, found arrays of shape {given.shape} and {zero.shape}"
            )
        if not (np.isfinite(zero).all() and np.isfinite(given).all() and np.isfinite(known).all()):
            raise InputError(
                f"start of the model of {self.target}: deviation, inputs and reference must be finite; remove NaN and "
                "infinity"
            )
        change, _ = self.clip(given - zero)
        shape = np.broadcast_shapes(known.shape, change.shape[:-1])
        known = np.broadcast_to(known, shape).copy()
        memory = self._layers.begin_at(np.broadcast_to(change, (*shape, len(self.inputs))), known)
        return State(zero, memory, known, np.zeros(len(self.inputs), dtype=np.bool_))

    def _check_interval(self) -> None:
        check_between(f"model of {self.target}", TICK, GAP, interval=self.interval)

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
                f"the same number for each; found {[len(b) for b in self.b]}"
            )
        check_count(owner, ORDER, past_deviations=self.a, past_inputs=self.b[0][1:])
        check_finite(owner, a=self.a, b=self.b, intercept=self.intercept)
        largest = find_largest_root(self.a)
        if not largest < 1:
            raise SettingError(
                f"{owner}: its free run does not decay: the largest root of its polynomial has the magnitude "
                f"{largest:.6g}, expected < 1"
            )
        if not 1.0 - sum(self.a) > SETTLES:
            raise SettingError(f"{owner}: its free run has no steady state: its coefficients a add up to 1")

    @property
    def orders(self) -> tuple[int, int]:
        """Orders k (past deviations) and m (past values of each input)."""
        return len(self.a), len(self.b[0]) - 1

    @cached_property
    def _weights(self) -> FloatArray:
        return np.concatenate([np.array(self.a, dtype=np.float64), np.array(self.b, dtype=np.float64).T.ravel()])

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
                f"found {n_inputs}, and scaling for {len(self.input_scaling.gain)}"
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
        """Orders k (past deviations) and m (past values of each input)."""
        return self.k, self.m

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
