"""A made-up machine that warms up as a compensator knows machines to do: for test vectors."""

import numpy as np
from numpy.typing import NDArray

from thermocomp.export.block.tables import Tables

FloatArray = NDArray[np.float64]

#: how fast a temperature follows where nothing is known of it [1/s]
_PACE = 1e-3


class Warming:
    """A machine at rest, which is then run.

    What a watch predicts of each temperature from the others, their past and the speed is solved for all of them at
    once: so it finds nothing wrong with them. Other channels follow the speed at a common pace.

    Parameters
    ----------
    tables : Tables
        Tables of the compensator.
    """

    def __init__(self, tables: Tables) -> None:
        channels = tables.channels
        self._values = tables.values if tables.sensors else None
        self.rest = np.array([i.reference + min(max(0.0, i.low), i.high) for i in channels])
        self.low = np.array([i.reference + i.low for i in channels])
        self.high = np.array([i.reference + i.high for i in channels])
        self.heat = np.array([i.quantity == "temperature" for i in channels])
        self._now = self.rest.copy()
        self._x = np.zeros(len(tables.sensors))
        self._memory = np.zeros(tables.sizes.get("MEMORY", 0))

    def run(self, share: float, dt: float) -> FloatArray:
        """Return the values of all channels after a while.

        Parameters
        ----------
        share : float
            Fraction of the top speed.
        dt : float
            Duration [s].
        """
        goal = self.rest + share * (self.high - self.rest)
        slow = self._now + -np.expm1(-_PACE * dt) * (goal - self._now)
        self._now = np.where(self.heat, slow, goal)
        if self._values is not None:
            sensors = self._values["sensor_channel"]
            self._now[sensors] = self.rest[sensors] + self._warm(share, dt)
        return self._now.copy()

    def _warm(self, share: float, dt: float) -> FloatArray:
        assert self._values is not None
        v = {n: np.array(self._values[n]) for n in ("direct", "weight", "tau", "power", "resting_rate", "gain")}
        n, memory = len(self._x), self._memory
        for k, tau in enumerate(v["tau"]):
            lag = memory[k * n : (k + 1) * n]
            lag += -np.expm1(-dt / tau) * (self._x - lag)
        states = memory[len(v["tau"]) * n :]
        states += -np.expm1(-(v["resting_rate"] + share * v["gain"]) * dt) * (share ** v["power"] - states)
        self._x, *_ = np.linalg.lstsq(np.eye(n) - v["direct"].T, v["weight"].T @ memory, rcond=1e-6)
        low, high = np.array(self._values["sensor_low"]), np.array(self._values["sensor_high"])
        self._x = np.clip(self._x, low, high)
        return self._x
