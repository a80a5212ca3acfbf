"""Nets with one hidden layer, trained by backpropagation (Chen 1996, section 4), and their scaling."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.exceptions import FitError, InputError
from thermocomp.core.network import Affine, Perceptron

#: range to which inputs and targets are scaled (C-28)
LOW, HIGH = 0.1, 0.9
#: bound of the initial weights (C-29)
INITIAL = 0.3


def scaling_in(low: FloatArray, high: FloatArray) -> Affine:
    """Return the scaling of channels from their ranges to 0.1 .. 0.9 (C-28).

    A channel that varies only by rounding counts as constant: it is always scaled to 0.5, so the net cannot react to
    it.

    Parameters
    ----------
    low, high : ndarray of shape (n_channels,)
    """
    still = constant(low, high)
    gain = np.divide(HIGH - LOW, high - low, out=np.zeros(len(low)), where=~still)
    return Affine(tuple(gain.tolist()), tuple(np.where(still, 0.5, LOW - gain * low).tolist()))


def scaling_out(low: FloatArray, high: FloatArray) -> Affine:
    """Return the scaling of channels from 0.1 .. 0.9 back to their ranges; a constant channel keeps its value.

    Parameters
    ----------
    low, high : ndarray of shape (n_channels,)
    """
    still = constant(low, high)
    gain = np.where(still, 0.0, (high - low) / (HIGH - LOW))
    return Affine(tuple(gain.tolist()), tuple(np.where(still, low, low - gain * LOW).tolist()))


def constant(low: FloatArray, high: FloatArray) -> BoolArray:
    """Return a mask of the channels that are constant up to rounding."""
    return np.asarray(high - low <= 1e-12 * np.maximum(np.abs(low), np.abs(high)))


def learning_rates(n_epochs: int, start: float, end: float, schedule: str) -> FloatArray:
    """Return the learning rate of each epoch, decreasing from `start` to `end`.

    Parameters
    ----------
    schedule : {'geometric', 'harmonic'}
        Decrease by the same factor in every epoch, or as 1 / (1 + c epoch), fast at first and slowly later.

    Returns
    -------
    ndarray of shape (n_epochs,)
    """
    if n_epochs < 1 or not 0 < end <= start < np.inf:
        raise InputError(
            f"{n_epochs} epochs with learning rates from {start} to {end}: expected at least one epoch and start >= "
            "end > 0"
        )
    part = np.linspace(0.0, 1.0, n_epochs)
    if schedule == "geometric":
        return np.asarray(start * (end / start) ** part)
    if schedule == "harmonic":
        return np.asarray(start / (1.0 + (start / end - 1.0) * part))
    raise InputError(f"learning rate schedule {schedule!r}: expected 'geometric' or 'harmonic'")


@dataclass(frozen=True)
class TrainedNet:
    """Result of `train_net`.

    Parameters
    ----------
    net : Perceptron
        Net from scaled inputs to scaled outputs.
    losses : ndarray of shape (n_epochs run,)
        Mean squared error in each epoch [scaled units]; each pattern is evaluated before the weight update for it.
    """

    net: Perceptron
    losses: FloatArray


def train_net(
    inputs: FloatArray,
    targets: FloatArray,
    n_hidden: int,
    *,
    rng: np.random.Generator,
    rates: FloatArray,
    update: Literal["pattern", "batch"] = "pattern",
    order: Literal["shuffled", "fixed"] = "shuffled",
    momentum: float = 0.0,
    goal: float = 0.0,
) -> TrainedNet:
    """Train a net with sigmoids in both layers by backpropagation (C-25 to C-30).

    The squared error between outputs and targets is what the weights reduce; the sentence of the paper that says so is
    incomplete (E-C11).

    The function releases the interpreter lock (GIL), so that nets can be trained in threads.

    Parameters
    ----------
    inputs : ndarray of shape (n_patterns, n_inputs)
        Scaled inputs, see `scaling_in`.
    targets : ndarray of shape (n_patterns, n_outputs)
        Scaled targets.
    rng : numpy.random.Generator
        Generator of the initial weights and thresholds, uniform in -0.3 .. 0.3 (C-29), and of the shuffling seed.
    rates : ndarray of shape (n_epochs,)
        Learning rate of each epoch, see `learning_rates`.
    update : {'pattern', 'batch'}
        Change the weights after every pattern, or once per epoch by the mean over the patterns (C-30).
    order : {'shuffled', 'fixed'}
        New random order of the patterns in every epoch, or the given order. In the given order, consecutive rows of a
        drift test are nearly equal, and a net with a learning rate of 0.5 forgets the beginning of the test by its end.
    """
    from thermocomp.models.kernels import backprop  # numba is slow to import

    inputs, targets = (np.ascontiguousarray(a, dtype=np.float64) for a in (inputs, targets))
    if inputs.ndim != 2 or targets.ndim != 2 or not 0 < len(inputs) == len(targets) or targets.shape[1] == 0:
        raise FitError(
            f"net: inputs of shape {inputs.shape} and targets of shape {targets.shape}; expected the same number of "
            "rows"
        )
    if not (np.isfinite(inputs).all() and np.isfinite(targets).all()):
        raise FitError("net: inputs and targets must be finite numbers")
    if n_hidden < 1:
        raise InputError(f"{n_hidden} hidden nodes: expected at least one")
    if update not in ("pattern", "batch") or order not in ("shuffled", "fixed") or not 0 <= momentum < 1:
        raise InputError(
            f"update {update!r}, order {order!r}, momentum {momentum}: expected 'pattern' or 'batch', 'shuffled' or "
            "'fixed', and 0 <= momentum < 1"
        )
    n_inputs, n_outputs = inputs.shape[1], targets.shape[1]
    split = (n_inputs + 1) * n_hidden
    weights = rng.uniform(-INITIAL, INITIAL, split + n_outputs * (n_hidden + 1))
    seed = rng.integers(2**64, dtype=np.uint64)
    losses = backprop.train(
        weights, n_hidden, inputs, targets, rates, momentum, update == "batch", order == "shuffled", seed, goal
    )
    first = weights[:split].reshape(n_inputs + 1, n_hidden)
    second = weights[split:-n_outputs].reshape(n_outputs, n_hidden)
    return TrainedNet(Perceptron.of(first[1:].T, first[0], second, weights[-n_outputs:]), losses)
