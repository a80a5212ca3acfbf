"""Air of the workshop: daily cycle, slow fluctuations, stratification, and lateral gradient."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.exceptions import SettingError
from thermocomp.virtual.machine import Air

FloatArray = NDArray[np.float64]
DAY = 86400.0


@dataclass(frozen=True)
class Climate:
    """Air temperature over several days; plausible values of a workshop that is heated but not air-conditioned.

    Parameters
    ----------
    mean : float
        [degC]
    daily : float
        Amplitude of the daily cycle; maximum at 15 h [K].
    wander : float
        Standard deviation of the fluctuations due to weather, doors and neighbouring machines [K].
    memory : float
        Time constant of these fluctuations [s].
    layers : float
        Mean temperature rise with height; it fluctuates and follows the daily cycle [K/m].
    sun : float
        Temperature rise from left to right at noon, in daylight only [K/m].
    draught : float
        Standard deviation of the fluctuations of the lateral gradient due to open doors, with a third of the time
        constant [K/m].
    begin : float
        Time of day at the start, from midnight [s].
    """

    mean: float = 22.0
    daily: float = 1.8
    wander: float = 0.6
    memory: float = 5400.0
    layers: float = 0.5
    sun: float = 0.5
    draught: float = 0.25
    begin: float = 8 * 3600.0

    def __post_init__(self) -> None:
        if not self.memory > 0:
            raise SettingError(f"expected a positive time, found {self.memory:g} s", ("memory",))
        if not -30.0 <= self.mean <= 60.0:
            raise SettingError(f"{self.mean:g} degC: must be from -30 to 60", ("mean",))
        for name in ("wander", "draught"):
            if not (value := getattr(self, name)) >= 0:
                raise SettingError(f"expected at least 0, found {value:g}", (name,))

    @property
    def middle(self) -> Air:
        """State of the air averaged over time: mean temperature and stratification."""
        return Air(self.mean, self.layers)

    def init(self, rng: np.random.Generator) -> FloatArray:
        """Return the initial state of the random fluctuations, which `air` advances."""
        first, second = rng.standard_normal((2, 3))
        return np.array([math.sqrt(2.0) * first, first / math.sqrt(2.0) + second / math.sqrt(2.0)])

    def air(
        self, state: FloatArray, start: float, step: float, n_steps: int, rng: np.random.Generator
    ) -> tuple[FloatArray, FloatArray]:
        """Return the state of the air at the end of each of several equal steps.

        Parameters
        ----------
        state : ndarray of shape (2, 3)
            From `init`, or from the preceding steps.
        start : float
            Start of the first step, since the start of the test [s].
        step : float
            [s]

        Returns
        -------
        state : ndarray of shape (2, 3)
        air : ndarray of shape (n_steps, 3)
            Rows of `Air.values`.
        """
        # Temperature, stratification (slower) and lateral gradient (faster) fluctuate independently.
        keep = np.exp(-step / (self.memory * np.array([1.0, 2.0, 1.0 / 3.0])))
        state, path = wandering(state, keep, rng.standard_normal((n_steps, 3)))
        day = 2.0 * math.pi * ((start + step * np.arange(1, n_steps + 1) + self.begin) / DAY)
        wave = np.cos(day - 2.0 * math.pi * 15.0 / 24.0)
        air = np.empty((n_steps, 3))
        air[:, 0] = self.mean + self.daily * wave + self.wander * path[:, 0]
        air[:, 1] = self.layers * (1.0 + 0.4 * wave + 0.3 * path[:, 1])
        air[:, 2] = self.sun * np.maximum(0.0, -np.cos(day)) + self.draught * path[:, 2]
        return state, air


#: a room with a constant temperature
STILL = Climate(daily=0.0, wander=0.0, layers=0.0, sun=0.0, draught=0.0)
#: small changes in a measuring room ("a relatively stable environment", P-05)
STABLE = Climate(daily=0.25, wander=0.1, layers=0.2, sun=0.0, draught=0.05)
#: climates by their names in protocols
CLIMATES: dict[str, Climate] = {"workshop": Climate(), "stable": STABLE, "still": STILL}


def wandering(state: FloatArray, keep: FloatArray, kicks: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return smooth random paths of standard deviation 1: a first-order lag of a first-order process.

    Without the second lag the air would jitter from row to row.

    Parameters
    ----------
    state : ndarray of shape (2, n_paths)
        The process and its lagged value before the first step.
    keep : ndarray of shape (n_paths,)
        Share of both that remains after a step.
    kicks : ndarray of shape (n_steps, n_paths)
        Standard normal numbers.

    Returns
    -------
    state : ndarray of shape (2, n_paths)
        State after the last step.
    paths : ndarray of shape (n_steps, n_paths)
    """
    first = filter_first_order(keep, np.sqrt((1.0 - keep**2) * (1.0 + keep) ** 2 / (1.0 + keep**2)) * kicks, state[0])
    second = filter_first_order(keep, (1.0 - keep) * first, state[1])
    return np.array([first[-1], second[-1]]), second


def filter_first_order(keep: FloatArray, added: FloatArray, before: FloatArray) -> FloatArray:
    """Return ``y[k] = keep y[k-1] + added[k]`` with ``y[-1] = before``, without a loop over the steps.

    Parameters
    ----------
    keep : ndarray of shape (n,)
        From 0 to 1.
    added : ndarray of shape (n_steps, n)
    before : ndarray of shape (n,)

    Returns
    -------
    ndarray of shape (n_steps, n)
    """
    y = added.copy()
    y[0] += keep * before
    # Each pass doubles the length of the sums, until the remaining share is negligible.
    reach, left = 1, keep
    while reach < len(y) and np.any(left > 1e-18):
        y[reach:] += left * y[:-reach]
        reach, left = 2 * reach, left * left
    return y
