"""The workshop's air: a day, slow wandering, layers, and a warmer side."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermocomp.simulation.machine import Air

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Climate:
    """What the air does over the days; plausible values of a workshop that is heated but not air-conditioned.

    Parameters
    ----------
    mean : float
        [degC]
    daily : float
        Amplitude of the day-night wave; warmest at 15 h [K].
    wander : float
        Standard deviation of what weather, doors and neighbours add [K].
    memory : float
        Time constant of that [s].
    layers : float
        Mean rise with height; it wanders and follows the day as well [K/m].
    sun : float
        Rise from left to right at noon, by day only [K/m].
    draught : float
        Standard deviation of what doors on either side change in that, three times as fast [K/m].
    begin : float
        Time of day at the start [h].
    """

    mean: float = 22.0
    daily: float = 1.8
    wander: float = 0.6
    memory: float = 5400.0
    layers: float = 0.5
    sun: float = 0.5
    draught: float = 0.25
    begin: float = 8.0

    @property
    def middle(self) -> Air:
        """The air on the whole."""
        return Air(self.mean, self.layers)

    def air(self, time: FloatArray, rng: np.random.Generator) -> list[Air]:
        """Return the air at each of equally spaced times [s] since the start."""
        day = 2.0 * math.pi * (time / 86400.0 + self.begin / 24.0)
        wave = np.cos(day - 2.0 * math.pi * 15.0 / 24.0)
        step = float(time[1] - time[0]) if len(time) > 1 else self.memory
        temperature = self.mean + self.daily * wave + self.wander * wandering(len(time), step / self.memory, rng)
        layers = self.layers * (1.0 + 0.4 * wave + 0.3 * wandering(len(time), step / (2 * self.memory), rng))
        side = self.sun * np.maximum(0.0, -np.cos(day)) + self.draught * wandering(
            len(time), 3.0 * step / self.memory, rng
        )
        return [Air(*values) for values in zip(temperature.tolist(), layers.tolist(), side.tolist(), strict=True)]


#: a room held at one temperature
STILL = Climate(daily=0.0, wander=0.0, layers=0.0, sun=0.0, draught=0.0)
#: a measuring room's small changes ("a relatively stable environment", P-05)
STABLE = Climate(daily=0.25, wander=0.1, layers=0.2, sun=0.0, draught=0.05)


def wandering(n: int, step: float, rng: np.random.Generator) -> FloatArray:
    """Return a smooth random path of standard deviation 1, its steps given in units of its memory.

    A first-order lag of a first-order process: without the second lag the air would jitter from row to row.
    """
    keep = math.exp(-step)
    path = np.empty(n)
    first = second = 0.0
    # Long enough before the start that the path has forgotten where it began.
    lead = min(math.ceil(8.0 / step), 100_000)
    scale = math.sqrt((1.0 - keep**2) * 2.0)
    for k, kick in enumerate(rng.standard_normal(n + lead)):
        first = keep * first + scale * kick
        second = keep * second + (1.0 - keep) * first
        if k >= lead:
            path[k - lead] = second
    return path
