"""A synthetic machine whose warm-up matches the predictions of a compensator: for test vectors."""

import numpy as np
from numpy.typing import NDArray

from thermocomp.runtime.program.tables import Tables

FloatArray = NDArray[np.float64]

#: rate of temperatures without a known law [1/s]
_PACE = 1e-3


class Warming:
    """A machine at rest that is then started.

    The watch's predictions of all temperatures, each from the others, their past and the speed, are solved
    simultaneously, so the watch detects no fault. Other channels follow the speed at a common rate.

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
        self._x = np.zeros(tables.sizes["SENSORS"])
        self._memory = np.zeros(tables.sizes.get("MEMORY", 0))
        self._heat = np.zeros(tables.sizes.get("CHECKS", 0))

    def run(self, share: float, dt: float) -> FloatArray:
        """Return the values of all channels after a time step.

        Parameters
        ----------
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
        left, right = np.eye(n) - v["direct"].T, v["weight"].T @ memory
        if len(self._heat):  # the temperatures show the heat of the speed, too
            of = {k: np.array(self._values[k]) for k in ("heat_power", "heat_lag", "heat_direct", "heat_weight")}
            self._heat += -np.expm1(-dt / of["heat_lag"]) * (share ** of["heat_power"] - self._heat)
            weights = 1.0 / np.array(self._values["unseen"])
            left = np.vstack([left, of["heat_direct"].T]) * weights[:, None]
            lags = memory[: len(v["tau"]) * n]
            right = np.concatenate([right, self._heat - of["heat_weight"].T @ lags]) * weights
        self._x, *_ = np.linalg.lstsq(left, right, rcond=1e-6)
        low, high = np.array(self._values["sensor_low"]), np.array(self._values["sensor_high"])
        self._x = np.clip(self._x, low, high)
        return self._x
