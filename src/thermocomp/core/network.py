"""Network family: a neural net with one hidden layer; no memory."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.bounds import ENTRIES, NODES, check_count, check_finite
from thermocomp.core.exceptions import SettingError
from thermocomp.core.expression import Constant, Named, Node, Sigmoid, Sum, scale_node, sum_weighted
from thermocomp.core.model import ErrorModel

Activation = Literal["sigmoid", "tanh", "identity"]


def sigmoid(net: FloatArray) -> FloatArray:
    """Return 1 / (1 + exp(-net)) (C-25), in a form that does not overflow."""
    return 0.5 + 0.5 * np.tanh(0.5 * net)


_FUNCTIONS: dict[str, Callable[[FloatArray], FloatArray]] = {
    "sigmoid": sigmoid,
    "tanh": np.tanh,
    "identity": lambda net: net,
}


def _activated(function: Activation, net: Node) -> Node:
    match function:
        case "sigmoid":
            return Sigmoid(net)
        case "tanh":  # 2 sigmoid(2 net) - 1
            return Sum((scale_node(2.0, Sigmoid(scale_node(2.0, net))), Constant(-1.0)))
        case "identity":
            return net


@dataclass(frozen=True)
class Affine:
    """Scaling of channels: gain * value + offset.

    Parameters
    ----------
    gain, offset : tuple of float
        One each per channel. A gain of 0 disables the channel.
    """

    gain: tuple[float, ...]
    offset: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.gain) != len(self.offset):
            raise SettingError(f"scaling: {len(self.gain)} gains but {len(self.offset)} offsets")
        check_finite("scaling", gain=self.gain, offset=self.offset)

    @cached_property
    def _arrays(self) -> tuple[FloatArray, FloatArray]:
        return np.array(self.gain, dtype=np.float64), np.array(self.offset, dtype=np.float64)

    def __call__(self, values: FloatArray) -> FloatArray:
        """Return `values`, of shape (..., n_channels), scaled."""
        gain, offset = self._arrays
        return values * gain + offset


@dataclass(frozen=True)
class Perceptron:
    """Net with one hidden layer: OUT = F(NET), NET = sum x_i w_i + th, in both layers (Chen 1996, Eqs. 9-10; C-25).

    Parameters
    ----------
    hidden_weights : tuple of tuple of float
        Per hidden node, the weight of each input.
    hidden_thresholds : tuple of float
        One per hidden node.
    output_weights : tuple of tuple of float
        Per output, the weight of each hidden node.
    output_thresholds : tuple of float
        One per output.
    hidden, output : {'sigmoid', 'tanh', 'identity'}
        Activation function F of the hidden nodes and of the outputs.
    """

    hidden_weights: tuple[tuple[float, ...], ...]
    hidden_thresholds: tuple[float, ...]
    output_weights: tuple[tuple[float, ...], ...]
    output_thresholds: tuple[float, ...]
    hidden: Activation = "sigmoid"
    output: Activation = "sigmoid"

    def __post_init__(self) -> None:
        n_inputs, n_hidden, n_outputs = self.shape
        if n_hidden == 0 or n_outputs == 0 or n_hidden != len(self.hidden_weights):
            raise SettingError(
                f"net: weights of {len(self.hidden_weights)} hidden nodes and {len(self.output_weights)} outputs, but "
                f"thresholds of {n_hidden} and {n_outputs}; their numbers must be equal, and both layers need at least "
                "one node"
            )
        if any(len(w) != n_inputs for w in self.hidden_weights):
            raise SettingError(
                f"net: expected {n_inputs} weights per hidden node, one per input; found "
                f"{sorted({len(w) for w in self.hidden_weights})}"
            )
        if len(self.output_weights) != n_outputs or any(len(w) != n_hidden for w in self.output_weights):
            raise SettingError(
                f"net: expected {n_hidden} weights for each of {n_outputs} outputs, one per hidden node; found "
                f"{[len(w) for w in self.output_weights]}"
            )
        for layer in (self.hidden, self.output):
            if layer not in _FUNCTIONS:
                raise SettingError(
                    f"net: unknown activation function {layer!r}; expected one of {', '.join(_FUNCTIONS)}"
                )
        check_count("net", NODES, hidden_nodes=self.hidden_thresholds, outputs=self.output_thresholds)
        if self.n_parameters > ENTRIES:
            raise SettingError(f"net: {self.n_parameters:,} weights and thresholds, at most {ENTRIES:,} are supported")
        check_finite(
            "net",
            hidden_weights=self.hidden_weights,
            hidden_thresholds=self.hidden_thresholds,
            output_weights=self.output_weights,
            output_thresholds=self.output_thresholds,
        )

    @classmethod
    def of(
        cls,
        hidden_weights: FloatArray,
        hidden_thresholds: FloatArray,
        output_weights: FloatArray,
        output_thresholds: FloatArray,
        *,
        hidden: Activation = "sigmoid",
        output: Activation = "sigmoid",
    ) -> "Perceptron":
        """Return a net made from arrays.

        Parameters
        ----------
        hidden_weights : ndarray of shape (n_hidden, n_inputs)
        hidden_thresholds : ndarray of shape (n_hidden,)
        output_weights : ndarray of shape (n_outputs, n_hidden)
        output_thresholds : ndarray of shape (n_outputs,)
        """
        return cls(
            tuple(tuple(w) for w in hidden_weights.tolist()),
            tuple(hidden_thresholds.tolist()),
            tuple(tuple(w) for w in output_weights.tolist()),
            tuple(output_thresholds.tolist()),
            hidden,
            output,
        )

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of inputs, of hidden nodes and of outputs."""
        n_inputs = len(self.hidden_weights[0]) if self.hidden_weights else 0
        return n_inputs, len(self.hidden_thresholds), len(self.output_thresholds)

    @property
    def kind(self) -> str:
        """Activation and shape, such as ``sigmoid net 9-20-1``."""
        functions = self.hidden if self.hidden == self.output else f"{self.hidden}-{self.output}"
        return f"{functions} net {'-'.join(map(str, self.shape))}"

    def expression(self, inputs: Sequence[Node], input_scaling: "Affine", output_scaling: "Affine") -> Node:
        """Return the first output, including the scalings, as a node of an expression."""
        (gain, *_), (offset, *_) = output_scaling.gain, output_scaling.offset
        scale = zip(input_scaling.gain, inputs, input_scaling.offset, strict=True)
        given = [Sum((scale_node(g, x), Constant(o))) for g, x, o in scale]
        layer = [
            _activated(self.hidden, sum_weighted(weights, given, threshold))
            for weights, threshold in zip(self.hidden_weights, self.hidden_thresholds, strict=True)
        ]
        out = _activated(self.output, sum_weighted(self.output_weights[0], layer, self.output_thresholds[0]))
        return Sum((scale_node(gain, out), Constant(offset)))

    @property
    def n_parameters(self) -> int:
        """Number of weights and thresholds: 263 for Chen's 9-20-3 (C-26), 57 for his 5-8-1 (C-27)."""
        n_inputs, n_hidden, n_outputs = self.shape
        return (n_inputs + 1) * n_hidden + (n_hidden + 1) * n_outputs

    @cached_property
    def _arrays(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        # transposed once: (n_inputs, n_hidden) and (n_hidden, n_outputs)
        return (
            np.array(self.hidden_weights, dtype=np.float64).reshape(self.shape[1], -1).T.copy(),
            np.array(self.hidden_thresholds, dtype=np.float64),
            np.array(self.output_weights, dtype=np.float64).T.copy(),
            np.array(self.output_thresholds, dtype=np.float64),
        )

    def evaluate(self, x: FloatArray) -> FloatArray:
        """Return the outputs for scaled inputs.

        Parameters
        ----------
        x : ndarray of shape (..., n_inputs)
            Scaled inputs.

        Returns
        -------
        ndarray of shape (..., n_outputs)
            Scaled outputs.
        """
        first, first_thresholds, second, second_thresholds = self._arrays
        inner = _FUNCTIONS[self.hidden](x @ first + first_thresholds)
        return _FUNCTIONS[self.output](inner @ second + second_thresholds)


@dataclass(frozen=True, kw_only=True)
class Network(ErrorModel):
    """Deviation = intercept + the only output of a net with one hidden layer (Chen 1996, section 4; C-25).

    A sigmoid output stays between 0 and 1: the deviation saturates at the ends of its scaling,
    ``output_scaling.offset`` and ``offset + gain``, whatever the inputs.

    Parameters
    ----------
    family : str
        Name of the family in a file.
    net : Perceptron
        Net with one output.
    input_scaling : Affine
        Scaling of the inputs minus their reference to the inputs of the net.
    output_scaling : Affine
        Scaling of the output of the net to the deviation [unit].
    """

    family: Literal["network"] = "network"

    net: Perceptron
    input_scaling: Affine
    output_scaling: Affine

    def _check(self) -> None:
        owner = f"model of {self.target}"
        n_inputs, _, n_outputs = self.net.shape
        if n_inputs != len(self.inputs) or n_inputs != len(self.input_scaling.gain):
            raise SettingError(
                f"{owner}: {len(self.inputs)} inputs, scaling for {len(self.input_scaling.gain)} and a net for "
                f"{n_inputs}; their numbers must be equal"
            )
        if n_outputs != 1 or len(self.output_scaling.gain) != 1:
            raise SettingError(
                f"{owner}: a net of {n_outputs} outputs with scaling of {len(self.output_scaling.gain)}: expected 1; "
                "make one model for each output"
            )
        check_finite(owner, intercept=self.intercept)

    def _expression(self, change: Sequence[Node]) -> Node:
        names = [x.name for x in self.inputs]
        listed = f"{names[0]} .. {names[-1]}" if len(names) > 3 else ", ".join(names) or "nothing"
        net = Named(
            f"{self.net.kind} of {listed}", self.net.expression(change, self.input_scaling, self.output_scaling)
        )
        return Sum((Constant(self.intercept), net)) if self.intercept else net

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the inputs that affect the deviation through non-zero weights."""
        first, _, second, _ = self.net._arrays
        reached = (first != 0) & (second[:, 0] != 0)
        alive = reached.any(axis=1) & (np.array(self.input_scaling.gain) != 0) & (self.output_scaling.gain[0] != 0)
        return tuple(x.name for x, used in zip(self.inputs, alive.tolist(), strict=True) if used)

    def coefficients_by_name(self) -> dict[str, float]:
        """Return all weights and thresholds; ``w(T1, h2)`` connects input T1 to the second hidden node."""
        net = self.net
        found: dict[str, float] = {}
        for j, (weights, threshold) in enumerate(zip(net.hidden_weights, net.hidden_thresholds, strict=True), start=1):
            found |= {f"w({x.name}, h{j})": w for x, w in zip(self.inputs, weights, strict=True)}
            found[f"th(h{j})"] = threshold
        found |= {f"w(h{j}, out)": w for j, w in enumerate(net.output_weights[0], start=1)}
        return found | {"th(out)": net.output_thresholds[0]}
