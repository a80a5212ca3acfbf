"""What the sensors make of the truth: lag, bias, noise, steps; and what they do when they fail."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.exceptions import InputError
from thermocomp.core.machine import Channel

FloatArray = NDArray[np.float64]
FaultKind = Literal["stuck", "lost", "drift", "spike"]


@dataclass(frozen=True)
class Sensor:
    """How one channel differs from the truth; the default is a perfect sensor.

    Parameters
    ----------
    channel : Channel
    noise : float
        Standard deviation, in the channel's unit.
    lag : float
        Time constant of a first-order lag [s].
    resolution : float
        Step of the reading, in the channel's unit; 0 for none.
    bias : float
        In the channel's unit.
    """

    channel: Channel
    noise: float = 0.0
    lag: float = 0.0
    resolution: float = 0.0
    bias: float = 0.0


def measure(sensors: Sequence[Sensor], true: FloatArray, dt: float, every: int, rng: np.random.Generator) -> FloatArray:
    """Return what the sensors say.

    Parameters
    ----------
    sensors : sequence of Sensor
    true : ndarray of shape (n_ticks, n_sensors)
        In house units; the sensors rest at its first row before it begins.
    dt : float
        Time between two rows of `true` [s].
    every : int
        One reading is taken every so many ticks, from the first.
    rng : Generator
        Of the noise.

    Returns
    -------
    ndarray of shape (n_readings, n_sensors)
    """
    keep = np.array([math.exp(-dt / s.lag) if s.lag > 0 else 0.0 for s in sensors])
    # Exact for a truth that changes linearly between two ticks.
    lag = np.array([s.lag for s in sensors])
    new = 1.0 - lag / dt * (1.0 - keep)
    old = 1.0 - keep - new
    readings = np.empty(true[::every].shape)
    felt = true[0]
    readings[0] = felt
    for k in range(1, len(true)):
        felt = keep * felt + new * true[k] + old * true[k - 1]
        if k % every == 0:
            readings[k // every] = felt
    noise = np.array([s.noise for s in sensors])
    readings += np.array([s.bias for s in sensors]) + noise * rng.standard_normal(readings.shape)
    steps = np.array([s.resolution if s.resolution > 0 else np.nan for s in sensors])
    return np.where(np.isnan(steps), readings, np.round(readings / steps) * steps)


@dataclass(frozen=True)
class Fault:
    """A sensor that fails (C-34).

    Parameters
    ----------
    channel : str
        Name of the channel.
    kind : {'stuck', 'lost', 'drift', 'spike'}
        It keeps its last value; gives no value (nan); runs away; or jumps.
    start : float
        When it begins [s].
    end : float or None
        When it is over [s]; None: never, but a spike after one row.
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
            raise InputError(
                f"fault of {self.channel}: unknown kind {self.kind!r}; known are {', '.join(get_args(FaultKind))}"
            )
        if not math.isfinite(self.start) or (self.end is not None and not self.end > self.start):
            raise InputError(
                f"fault of {self.channel}: start {self.start} s must be finite and before end {self.end} s"
            )


def with_faults(
    time: FloatArray, channels: Sequence[Channel], values: FloatArray, faults: Sequence[Fault]
) -> FloatArray:
    """Return readings in which some sensors fail.

    Parameters
    ----------
    time : ndarray of shape (n_rows,)
        [s]
    channels : sequence of Channel
    values : ndarray of shape (n_rows, n_channels)
        Left as they are.
    faults : sequence of Fault
        Applied in turn; a fault that begins after the last row changes nothing.

    Returns
    -------
    ndarray of shape (n_rows, n_channels)

    Raises
    ------
    InputError
        There is no such channel.
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
