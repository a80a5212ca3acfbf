"""A virtual machine whose answers can be told in advance: it warms with the turns that its spindle has made."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from thermocomp.virtual.kits import CENTRE
from thermocomp.virtual.machine import Air, FeedDrive, Truth

FloatArray = NDArray[np.float64]


class FakeMachine:
    """Every place is 0.001 K per turn warmer than the air, every observable is its own share of that in um."""

    places = tuple(p for p in (*CENTRE.places, *CENTRE.inner) if p not in CENTRE.air)
    observables = CENTRE.observables

    def __init__(self) -> None:
        self.steps: list[int] = []

    def init(self, air: Air) -> float:
        return 0.0 * air.temperature

    def run(self, state: float, drives: Sequence[FeedDrive], air: FloatArray, dt: float) -> tuple[float, Truth]:
        self.steps.append(len(drives))
        warm = state + 0.001 * dt / 60.0 * np.cumsum([d.speed for d in drives])
        temperatures = np.repeat((air[:, 0] + warm)[:, None], len(self.places), axis=1)
        shares = 1.0 + np.arange(len(self.observables))
        return float(warm[-1]), Truth(temperatures, np.outer(warm, shares))
