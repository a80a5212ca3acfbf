"""Backpropagation as the books write it: the oracle of `thermocomp.models.kernels.backprop`."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

_WORD = 2**64


def sigmoid(net: FloatArray) -> FloatArray:
    return 1 / (1 + np.exp(-net))


def shuffle(order: list[int], state: int) -> int:
    """Fisher-Yates with splitmix64."""
    for i in range(len(order) - 1, 0, -1):
        state = (state + 0x9E3779B97F4A7C15) % _WORD
        z = ((state ^ (state >> 30)) * 0xBF58476D1CE4E5B9) % _WORD
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) % _WORD
        z ^= z >> 31
        j = ((z >> 32) * (i + 1)) >> 32
        order[i], order[j] = order[j], order[i]
    return state


def layers(weights: FloatArray, n_inputs: int, n_hidden: int, n_outputs: int) -> list[FloatArray]:
    """Return W (n_inputs, n_hidden), its thresholds, V (n_hidden, n_outputs), its thresholds."""
    first, rest = np.split(weights, [(n_inputs + 1) * n_hidden])
    second, thresholds = np.split(rest, [n_outputs * n_hidden])
    first = first.reshape(n_inputs + 1, n_hidden)
    return [first[1:], first[0], second.reshape(n_outputs, n_hidden).T, thresholds]


def flat(layer: list[FloatArray]) -> FloatArray:
    W, a, V, b = layer
    return np.concatenate([a, W.ravel(), V.T.ravel(), b])


def loss(weights: FloatArray, n_hidden: int, x: FloatArray, t: FloatArray) -> float:
    """Half the sum of the squared errors over all patterns."""
    W, a, V, b = layers(weights, x.shape[1], n_hidden, t.shape[1])
    return float(0.5 * ((t - sigmoid(sigmoid(x @ W + a) @ V + b)) ** 2).sum())


def gradient(weights: FloatArray, n_hidden: int, x: FloatArray, t: FloatArray) -> tuple[FloatArray, float]:
    """Return the gradient of `loss` and the sum of the squared errors."""
    W, a, V, b = layers(weights, x.shape[1], n_hidden, t.shape[1])
    h = sigmoid(x @ W + a)
    o = sigmoid(h @ V + b)
    delta = (o - t) * o * (1 - o)
    slope = (delta @ V.T) * h * (1 - h)
    return flat([x.T @ slope, slope.sum(0), h.T @ delta, delta.sum(0)]), float(((t - o) ** 2).sum())


def train(
    weights: FloatArray,
    n_hidden: int,
    inputs: FloatArray,
    targets: FloatArray,
    rates: FloatArray,
    momentum: float,
    batch: bool,
    shuffled: bool,
    seed: int,
    goal: float,
) -> tuple[FloatArray, list[float]]:
    """Return the weights and the loss of each epoch."""
    weights, change = weights.copy(), np.zeros_like(weights)
    order = list(range(len(inputs)))
    losses = []
    for rate in rates:
        if shuffled:
            seed = shuffle(order, seed)
        total = 0.0
        for group in [order] if batch else [[p] for p in order]:
            slope, squares = gradient(weights, n_hidden, inputs[group], targets[group])
            change = momentum * change - rate * slope / len(group)
            weights = weights + change
            total += squares
        losses.append(total / targets.size)
        if losses[-1] <= goal:
            break
    return weights, losses
