"""Backpropagation for a net with one hidden layer and sigmoids in both layers (Chen 1996, section 4; C-25, C-30).

Every inner loop runs along a contiguous row of hidden nodes and writes to a single array, so that LLVM can vectorise
it; the exponential function is a polynomial for the same reason.
"""

from typing import Any

import numpy as np
from numba import njit, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from thermocomp.core.arrays import FloatArray

_LOG2E = 1.4426950408889634
_LN2_HIGH = 6.93147180369123816490e-01  # ends in zeros: its product with a small integer is exact
_LN2_LOW = 1.90821492927058770002e-10
_MAGIC = 6755399441055744.0  # 1.5 * 2**52: adding it rounds to an integer, stored in the last bits

_CONTRACT = {"contract"}  # a multiplication and an addition may be fused
_SUMS = {"contract", "reassoc", "nsz"}  # and sums may be reordered: only the last digit may change


@intrinsic
def _bits(_context: Any, _value: Any) -> Any:
    def generate(context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        return builder.bitcast(args[0], context.get_value_type(types.int64))

    return types.int64(types.float64), generate


@intrinsic
def _double(_context: Any, _bits: Any) -> Any:
    def generate(context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        return builder.bitcast(args[0], context.get_value_type(types.float64))

    return types.float64(types.int64), generate


# error_model="numpy": a check for division by zero would prevent vectorisation
@njit(cache=True, nogil=True, error_model="numpy", fastmath=_CONTRACT)
def sigmoid(net: FloatArray) -> None:
    """Replace each number x by 1 / (1 + exp(-x)), with a relative error below 5e-16; x is clipped to -700 .. 700."""
    for j in range(net.size):
        x = -net[j]
        x = x if x < 700.0 else 700.0
        x = x if x > -700.0 else -700.0
        # exp(x) = 2^k exp(r), |r| <= ln(2) / 2, with the Taylor polynomial of degree 13
        shifted = x * _LOG2E + _MAGIC
        k = shifted - _MAGIC
        r = x - k * _LN2_HIGH - k * _LN2_LOW
        p = 1 / 6227020800.0
        p = p * r + 1 / 479001600.0
        p = p * r + 1 / 39916800.0
        p = p * r + 1 / 3628800.0
        p = p * r + 1 / 362880.0
        p = p * r + 1 / 40320.0
        p = p * r + 1 / 5040.0
        p = p * r + 1 / 720.0
        p = p * r + 1 / 120.0
        p = p * r + 1 / 24.0
        p = p * r + 1 / 6.0
        p = p * r + 0.5
        p = p * r + 1.0
        p = p * r + 1.0
        net[j] = 1.0 / (1.0 + _double(_bits(p) + (_bits(shifted) << 52)))  # type: ignore[call-arg]


@njit(cache=True, nogil=True)
def _shuffle(order: NDArray[np.int64], state: np.uint64) -> np.uint64:
    """Shuffle `order` (Fisher-Yates, numbers from splitmix64) and return the new state of the generator."""
    for i in range(order.size - 1, 0, -1):
        state += np.uint64(0x9E3779B97F4A7C15)
        z = (state ^ (state >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        z ^= z >> np.uint64(31)
        j = np.int64(((z >> np.uint64(32)) * np.uint64(i + 1)) >> np.uint64(32))
        order[i], order[j] = order[j], order[i]
    return state


@njit(cache=True, nogil=True, error_model="numpy", fastmath=_SUMS)
def train(  # noqa: PLR0912, PLR0915 - a single function is a sixth faster
    weights: FloatArray,
    n_hidden: int,
    inputs: FloatArray,
    targets: FloatArray,
    rates: FloatArray,
    momentum: float,
    batch: bool,
    shuffled: bool,
    seed: np.uint64,
    goal: float,
) -> FloatArray:
    """Descend along the gradient of half the squared error, in place.

    A change is `momentum` times the previous change minus the rate times the gradient, either of one pattern or, if
    `batch`, the mean over all patterns.

    Parameters
    ----------
    weights : ndarray of shape ((n_inputs + 1) * n_hidden + n_outputs * n_hidden + n_outputs,)
        First the hidden layer, (n_inputs + 1, n_hidden), with the thresholds in row 0; then the weights of the outputs,
        (n_outputs, n_hidden); then their thresholds. Modified in place.
    inputs : ndarray of shape (n_patterns, n_inputs), C order
        Scaled inputs.
    targets : ndarray of shape (n_patterns, n_outputs), C order
        Scaled targets.
    rates : ndarray of shape (n_epochs,)
        Learning rate of each epoch.

    Returns
    -------
    ndarray of shape (n_epochs run,)
        Loss of each epoch: mean squared error, each pattern evaluated before the weight update for it.
    """
    n_patterns, n_inputs = inputs.shape
    n_outputs = targets.shape[1]
    split = (n_inputs + 1) * n_hidden
    end = split + n_outputs * n_hidden
    first = weights[:split].reshape(n_inputs + 1, n_hidden)
    second = weights[split:end].reshape(n_outputs, n_hidden)
    threshold = weights[end:]
    # array in which changes accumulate: the weights themselves if no previous change is needed
    direct = not batch and momentum == 0.0
    change = weights if direct else np.zeros_like(weights)
    first_change = change[:split].reshape(n_inputs + 1, n_hidden)
    second_change = change[split:end].reshape(n_outputs, n_hidden)
    threshold_change = change[end:]
    # a multiple of the vector width for the sigmoid; elements beyond n_hidden are unused
    hidden, slope = np.zeros(-(-n_hidden // 8) * 8), np.empty(n_hidden)
    out, delta = np.empty(n_outputs), np.empty(n_outputs)
    order = np.arange(n_patterns)
    losses = np.empty(rates.size)
    for epoch in range(rates.size):
        if shuffled:
            seed = _shuffle(order, seed)
        rate = rates[epoch] / n_patterns if batch else rates[epoch]
        if batch:
            for m in range(change.size):
                change[m] *= momentum
        loss = 0.0
        for place in range(n_patterns):
            pattern = order[place]
            # forward
            for j in range(n_hidden):
                hidden[j] = first[0, j]
            for i in range(n_inputs):
                x = inputs[pattern, i]
                for j in range(n_hidden):
                    hidden[j] += x * first[i + 1, j]
            sigmoid(hidden)
            for k in range(n_outputs):
                net = threshold[k]
                for j in range(n_hidden):
                    net += second[k, j] * hidden[j]
                out[k] = net
            sigmoid(out)
            # backward: delta and slope are minus the rate times the derivatives with respect to NET
            for k in range(n_outputs):
                error = targets[pattern, k] - out[k]
                loss += error * error
                delta[k] = rate * error * out[k] * (1.0 - out[k])
            for j in range(n_hidden):
                slope[j] = delta[0] * second[0, j]
            for k in range(1, n_outputs):
                d = delta[k]
                for j in range(n_hidden):
                    slope[j] += d * second[k, j]
            for j in range(n_hidden):
                slope[j] *= hidden[j] * (1.0 - hidden[j])
            # change
            if not batch and not direct:
                for m in range(change.size):
                    change[m] *= momentum
            for k in range(n_outputs):
                d = delta[k]
                for j in range(n_hidden):
                    second_change[k, j] += d * hidden[j]
                threshold_change[k] += d
            for j in range(n_hidden):
                first_change[0, j] += slope[j]
            for i in range(n_inputs):
                x = inputs[pattern, i]
                for j in range(n_hidden):
                    first_change[i + 1, j] += x * slope[j]
            if not batch and not direct:
                for m in range(change.size):
                    weights[m] += change[m]
        if batch:
            for m in range(change.size):
                weights[m] += change[m]
        losses[epoch] = loss / (n_patterns * n_outputs)
        if losses[epoch] <= goal:
            return losses[: epoch + 1]
    return losses
