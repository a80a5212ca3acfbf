"""A virtual horizontal machining centre: a thermal network that expands."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.exceptions import InputError
from thermocomp.simulation.expansion import Geometry
from thermocomp.simulation.heat import HeatSources
from thermocomp.simulation.machine import Air, Drive, Truth
from thermocomp.simulation.network import Network, Regime
from thermocomp.simulation.parts import LINKS, NODES

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class CentreState:
    """All that the machine remembers.

    Parameters
    ----------
    temperatures : ndarray of shape (n_nodes,)
        [degC]
    chilling : bool
        The chiller runs.
    slid : float
        How far the column's foot has slid on the bed [um].
    """

    temperatures: FloatArray
    chilling: bool
    slid: float


@dataclass(frozen=True, eq=False)
class MachiningCentre:
    """The virtual machine tool of `thermocomp.simulation.parts` (X-01); fills `VirtualMachine`.

    Time constants from half a minute (bearings) over minutes (shaft) to half a day (bed); heat that is nonlinear in
    speed and temperature; hysteresis by the chiller's thermostat and by friction under the column.

    Parameters
    ----------
    network : Network
    heat : HeatSources
    geometry : Geometry
    longest_step : float
        Heat and thermostat are looked at this often [s].
    """

    network: Network = field(default_factory=lambda: Network(NODES, LINKS))
    heat: HeatSources = field(default_factory=HeatSources)
    geometry: Geometry = field(default_factory=Geometry)
    longest_step: float = 20.0

    @property
    def places(self) -> tuple[str, ...]:
        """Names of the nodes."""
        return self.network.names

    def init(self, air: Air) -> CentreState:
        """Return the state of a machine that was switched off for long, in this air."""
        temperatures = self.network.steady(np.zeros(len(self.places)), self._air(air), Regime())
        return CentreState(temperatures, chilling=False, slid=self.geometry.wish(temperatures, self.network.index))

    def step(self, state: CentreState, drive: Drive, dt: float) -> tuple[CentreState, Truth]:
        """Advance by `dt`, in equal steps no longer than `longest_step`.

        Parameters
        ----------
        state : CentreState
        drive : Drive
            Holds during the whole of `dt`.
        dt : float
            [s]

        Returns
        -------
        state : CentreState
        truth : Truth

        Raises
        ------
        InputError
            `dt` is not positive, or the speed is beyond the top speed.
        """
        if not (dt > 0 and math.isfinite(dt)):
            raise InputError(f"step of {dt} s: must be positive")
        if not abs(drive.speed) <= self.heat.top_speed:
            raise InputError(f"spindle speed {drive.speed} 1/min is beyond the machine's {self.heat.top_speed:g} 1/min")
        index = self.network.index
        regime = Regime(self.heat.rotation(drive.speed), drive.cooled and drive.powered)
        air = self._air(drive.air)
        temperatures, chilling, slid = state.temperatures, state.chilling, state.slid
        n_steps = math.ceil(dt / self.longest_step)
        for _ in range(n_steps):
            temperatures, chilling = self._advance(temperatures, chilling, drive, air, regime, dt / n_steps)
            slid = self.geometry.slide(slid, self.geometry.wish(temperatures, index))
        ratio = abs(drive.speed) / self.heat.top_speed
        return CentreState(temperatures, chilling, slid), self.geometry.truth(temperatures, index, ratio, slid)

    def _advance(
        self, before: FloatArray, chilling: bool, drive: Drive, air: FloatArray, regime: Regime, dt: float
    ) -> tuple[FloatArray, bool]:
        """Return temperatures and whether the chiller runs after a step in which it switches once at most."""
        index, network, heat = self.network.index, self.network, self.heat
        chilling = chilling and regime.flow
        after = network.advance(before, heat.power(before, index, drive, chilling), air, regime, dt)
        if not regime.flow:
            return after, False
        coolant, bed = index["coolant"], index["bed_front"]
        share = heat.until_switch(chilling, before[coolant] - before[bed], after[coolant] - after[bed])
        if share == 1.0:
            return after, chilling
        # The chiller runs a part of the step: without it the times of switching, and the step's length, would matter.
        duty = share if chilling else 1.0 - share
        return network.advance(before, heat.power(before, index, drive, duty), air, regime, dt), not chilling

    def _air(self, air: Air) -> FloatArray:
        rise = air.stratification * (self.network.height - Air.REFERENCE_HEIGHT) + air.side * self.network.side
        return air.temperature + rise
