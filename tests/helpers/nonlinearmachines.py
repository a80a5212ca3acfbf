"""What tests of the nonlinear machines ask them for."""

import numpy as np
from numpy.typing import NDArray

from thermocomp.virtual.centre import MachiningCentre
from thermocomp.virtual.machine import Air, FeedDrive, Truth
from thermocomp.virtual.toolsystem import RestingTool

FloatArray = NDArray[np.float64]
AIR = Air(22.0)
HEATED = FeedDrive(loads={"heater": 60.0, "tip": 5.0})


def steps(n: int, air: Air = AIR) -> FloatArray:
    return np.tile(air.values, (n, 1))


def at(machine: RestingTool | MachiningCentre, truth: Truth, name: str) -> FloatArray:
    if name in machine.places:
        return truth.temperatures[:, machine.places.index(name)]
    return truth.observables[:, machine.observables.index(name)]
