"""Supervision of a spindle speed: the heat that it should cause, compared with an estimate from the temperatures."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.arrays import FloatArray
from thermocomp.core.thresholds import Thresholds

#: faults of a speed: it reads 0 (or is in another unit, such as 1/s); constant; half; far beyond the trained speeds
FaultOfSpeed = Literal["zero", "stuck", "halved", "beyond"]


@dataclass(frozen=True)
class HeatCheck:
    """Relative heat of a speed, (speed / top speed) ** power, after a lag, with its estimate from the temperatures.

    Parameters
    ----------
    input : int
        Index of the speed among the inputs of the watch.
    power : float
        Exponent of heat against speed; a small one shows only whether the spindle turns.
    lag : float
        Time constant [s].
    weights : tuple of float
        Readout coefficients of the temperatures and of their lags, lag by lag [1/degC].
    off : float
        Difference from the estimate above which the speed counts as wrong.
    unseen : float
        Cross-validation error (RMS) of the estimate, on left-out cycles.
    """

    input: int
    power: float
    lag: float
    weights: tuple[float, ...]
    off: float
    unseen: float


class HeatConstants(NamedTuple):
    """Numbers of several checks, (n_checks,) each."""

    speeds: NDArray[np.intp]  #: index of the speed among the speeds
    powers: FloatArray
    lags: FloatArray  #: [s]
    off: FloatArray
    unseen: FloatArray

    @classmethod
    def of(cls, checks: Sequence[HeatCheck], speeds: Sequence[int]) -> "HeatConstants":
        """Return the numbers of checks of the speeds at the given inputs."""
        numbers = np.array([(c.power, c.lag, c.off, c.unseen) for c in checks], dtype=np.float64).reshape(-1, 4)
        return cls(np.array([speeds.index(c.input) for c in checks], dtype=np.intp), *numbers.T)


@dataclass(frozen=True)
class SpeedFault:
    """How soon a fault of a speed is found, from its begin at many instants of the left-out cycles.

    Parameters
    ----------
    input : int
        Index of the speed among the inputs of the watch.
    fault : {'zero', 'stuck', 'halved', 'beyond'}
    found : float
        Fraction of the instants from which it is found.
    minutes : float
        Time with a speed wrong by more than a quarter of the top speed until it is found, in 95 % of the cases in which
        it is found [min]; 0 if it never is.
    """

    input: int
    fault: FaultOfSpeed
    found: float
    minutes: float


def find_limits(
    difference: FloatArray, heat: FloatArray, stored: FloatArray, of: HeatConstants, thresholds: Thresholds
) -> FloatArray:
    """Return the largest permitted difference of heats from their estimates, (..., n_checks).

    It is larger where the spindle is hotter than its speed explains, since cutting heats it as well, where a speed
    exceeds those of the training, and while it turns, since bearings that are warm from elsewhere have less friction.

    Parameters
    ----------
    difference : ndarray of shape (..., n_checks)
        Heat as read minus its estimate.
    heat : ndarray of shape (..., n_checks)
        As read.
    stored : ndarray of shape (..., n_checks)
        The same after a further lag: heat of cutting leaves the spindle slowly.
    """
    untrained = thresholds.untrained_heat * np.maximum(heat - 1.0, 0.0) + thresholds.less_heat * heat
    cutting = np.maximum(thresholds.more_heat * heat, thresholds.more_stored * stored) * np.minimum(of.powers, 1.0)
    return np.asarray(of.off + np.where(difference > 0.0, untrained, cutting))
