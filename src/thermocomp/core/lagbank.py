"""First-order lags, one step at a time or over a whole recording, with the same code for both."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def step_response(dt: float | FloatArray, time_constants: FloatArray) -> FloatArray:
    """Return 1 - exp(-dt / tau): the fraction of a step that a first-order lag reaches within `dt`."""
    return -np.expm1(-dt / time_constants)


def advance(memory: FloatArray, signals: FloatArray, dt: float, time_constants: FloatArray) -> FloatArray:
    """Advance a bank of first-order lags with signals that are constant over the step.

    Parameters
    ----------
    memory : ndarray of shape (..., n_lags)
    signals : ndarray of shape (..., n_lags)
        Signal followed by each lag, at the end of the step.
    dt : float
        [s]
    time_constants : ndarray of shape (n_lags,)
        [s]

    Returns
    -------
    ndarray of shape (..., n_lags)
    """
    return memory + step_response(dt, time_constants) * (signals - memory)


def follow(memory: FloatArray, signals: FloatArray, paces: FloatArray) -> FloatArray:
    """Advance a bank of lags whose time constants change from step to step.

    Parameters
    ----------
    memory, signals : ndarray of shape (..., n_lags)
        As in `advance`.
    paces : ndarray of shape (..., n_lags)
        Time step divided by time constant.

    Returns
    -------
    ndarray of shape (..., n_lags)
    """
    return memory - np.expm1(-paces) * (signals - memory)


def run(
    signals: FloatArray, dt: FloatArray, time_constants: FloatArray, memory: FloatArray | None = None
) -> FloatArray:
    """Run a bank of lags over a recording.

    Parameters
    ----------
    signals : ndarray of shape (n_rows, n_lags)
    dt : ndarray of shape (n_rows,)
        Time since the previous row [s]. ``inf`` restarts the lags at steady state: the first row of each test.
    time_constants : ndarray of shape (n_lags,) or (n_rows, n_lags)
        [s]; one row each if they vary.
    memory : ndarray of shape (n_lags,), optional
        State before the first row. Default: steady state in the first row.

    Returns
    -------
    ndarray of shape (n_rows, n_lags)
    """
    out = np.empty_like(signals)
    if np.isinf(dt).all():  # every row restarts at steady state
        out[:] = signals
        return out
    if time_constants.ndim == 1:
        steps, where = np.unique(dt, return_inverse=True)  # few distinct steps even in a long recording
    else:
        steps, where = dt, np.arange(len(dt))
    shares = step_response(steps[:, None], time_constants)
    current = signals[0] if memory is None else memory
    for k in range(len(signals)):
        current = current + shares[where[k]] * (signals[k] - current)
        out[k] = current
    return out
