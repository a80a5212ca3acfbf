"""Sensor models: lag, bias, noise, quantisation; and sensor faults."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.exceptions import InputError, SettingError
from thermocomp.core.machine import Channel
from thermocomp.virtual.climate import DAY, filter_first_order

FloatArray = NDArray[np.float64]
FaultKind = Literal["stuck", "lost", "drift", "spike"]


@dataclass(frozen=True)
class Sensor:
    """Measurement errors of one channel; the default is a perfect sensor.

    Parameters
    ----------
    noise : float
        Standard deviation, in the channel's unit.
    lag : float
        Time constant of a first-order lag [s].
    resolution : float
        Quantisation step, in the channel's unit; 0 for none.
    bias : float
        Constant offset, in the channel's unit.
    drift : float
        Zero drift, in the channel's unit per day.
    """

    channel: Channel
    noise: float = 0.0
    lag: float = 0.0
    resolution: float = 0.0
    bias: float = 0.0
    drift: float = 0.0


def apply_lags(lags: FloatArray, felt: FloatArray, before: FloatArray, true: FloatArray, dt: float) -> FloatArray:
    """Return the true values after the first-order lags of the sensors.

    Parameters
    ----------
    lags : ndarray of shape (n_sensors,)
        Time constants [s]; 0: no lag.
    felt, before : ndarray of shape (n_sensors,)
        Sensor values, and true values, before the first step.
    true : ndarray of shape (n_steps, n_sensors)
        True values at the end of each step.
    dt : float
        [s]

    Returns
    -------
    ndarray of shape (n_steps, n_sensors)
        Exact for true values that change linearly within each step.
    """
    slow = lags > 0
    said = true.copy()
    if slow.any():
        keep = np.exp(-dt / lags[slow])
        new = 1.0 - lags[slow] / dt * (1.0 - keep)
        now = true[:, slow]
        past = np.vstack([before[slow], now[:-1]])
        said[:, slow] = filter_first_order(keep, new * now + (1.0 - keep - new) * past, felt[slow])
    return said


def read(sensors: Sequence[Sensor], felt: FloatArray, time: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return the sensor readings, with bias, zero drift, noise and quantisation.

    Parameters
    ----------
    felt : ndarray of shape (n_rows, n_sensors)
        Output of `apply_lags`, in house units.
    time : ndarray of shape (n_rows,)
        [s]

    Returns
    -------
    ndarray of shape (n_rows, n_sensors)
    """
    noise, bias, drift, steps = np.array([(s.noise, s.bias, s.drift, s.resolution) for s in sensors]).T
    said: FloatArray = felt + bias + np.outer(time / DAY, drift) + noise * rng.standard_normal(felt.shape)
    stepped = steps > 0
    # The second rounding removes binary residues, such as 21.900000000000002 instead of 21.9.
    said[:, stepped] = np.round(np.round(said[:, stepped] / steps[stepped]) * steps[stepped], 9)
    return said


@dataclass(frozen=True)
class SensorFault:
    """A sensor fault (C-34).

    Parameters
    ----------
    channel : str
        Name of the channel.
    kind : {'stuck', 'lost', 'drift', 'spike'}
        The sensor keeps its last value; gives no value (nan); drifts; or jumps.
    start : float
        Start time [s].
    end : float or None
        End time [s]; None: no end, except that a spike lasts one row.
    size : float
        Drift per hour, or height of the spike, in the channel's unit.
    """

    channel: str
    kind: FaultKind
    start: float
    end: float | None = None
    size: float = 5.0

    def __post_init__(self) -> None:
        if self.kind not in get_args(FaultKind):
            raise SettingError(
                f"fault of {self.channel}: unknown kind {self.kind!r}; known are {', '.join(get_args(FaultKind))}"
            )
        if not math.isfinite(self.start) or (self.end is not None and not self.end > self.start):
            raise SettingError(
                f"fault of {self.channel}: start {self.start} s must be finite and before end {self.end} s"
            )


def with_faults(
    time: FloatArray, channels: Sequence[Channel], values: FloatArray, faults: Sequence[SensorFault]
) -> FloatArray:
    """Return readings with sensor faults applied.

    Parameters
    ----------
    time : ndarray of shape (n_rows,)
        [s]
    values : ndarray of shape (n_rows, n_channels)
        Not modified.

    Returns
    -------
    ndarray of shape (n_rows, n_channels)
    """
    values = values.copy()
    names = [c.name for c in channels]
    for fault in faults:
        if fault.channel not in names:
            near = get_close_matches(fault.channel, names, n=3, cutoff=0.4) or names
            raise InputError(f"fault: no channel is named {fault.channel!r}; the nearest are {', '.join(near)}")
        column = values[:, names.index(fault.channel)]
        first = int(np.searchsorted(time, fault.start))
        if first == len(time):
            continue
        if fault.end is None:
            stop = first + 1 if fault.kind == "spike" else len(time)
        else:
            stop = int(np.searchsorted(time, fault.end))
        rows = slice(first, stop)
        if fault.kind == "stuck":
            column[rows] = column[max(first - 1, 0)]
        elif fault.kind == "lost":
            column[rows] = np.nan
        elif fault.kind == "drift":
            column[rows] += fault.size * (time[rows] - fault.start) / 3600.0
        else:
            column[rows] += fault.size
    return values
