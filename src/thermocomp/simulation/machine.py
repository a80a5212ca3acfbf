"""The interface of a virtual machine tool: state in, state out.

A machine with a handful of lumped capacities (`thermocomp.simulation.centre`) fills it, and a reduced finite-element
model can: both are asked the same and answer the same.
"""

from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.correction import Deviation

FloatArray = NDArray[np.float64]
S = TypeVar("S")


@dataclass(frozen=True)
class Air:
    """Air round the machine.

    Parameters
    ----------
    temperature : float
        In the middle of the machine, `REFERENCE_HEIGHT` above the floor [degC].
    stratification : float
        Rise with height [K/m].
    side : float
        Rise from left to right, along +X [K/m].
    """

    temperature: float = 20.0
    stratification: float = 0.0
    side: float = 0.0

    #: height above the floor at which `temperature` holds [m]
    REFERENCE_HEIGHT = 1.2

    def at(self, height: float, side: float = 0.0) -> float:
        """Temperature [degC] at a height above the floor [m] and a distance to the right of the middle [m]."""
        return self.temperature + self.stratification * (height - self.REFERENCE_HEIGHT) + self.side * side


@dataclass(frozen=True)
class Drive:
    """What is done to the machine during one step.

    Parameters
    ----------
    air : Air
    speed : float
        Spindle speed [1/min].
    feed : tuple of float
        Mean feed rates of X, Y, Z [mm/min].
    cooled : bool
        The coolant loop runs.
    powered : bool
        The machine is switched on; if not there is no heat at all, and no coolant loop.
    """

    air: Air
    speed: float = 0.0
    feed: tuple[float, float, float] = (0.0, 0.0, 0.0)
    cooled: bool = True
    powered: bool = True


@dataclass(frozen=True, eq=False)
class Truth:
    """What the machine really does, before any sensor.

    Parameters
    ----------
    temperatures : ndarray of shape (n_places,)
        In the order of `VirtualMachine.places` [degC].
    x, y, z : Deviation
        Tool point against the workpiece, actual minus commanded, in machine coordinates (ISO 841): a spindle that
        grows towards the workpiece has a negative z. Offset [um], slope along the axis [um/m].
    tilt_a, tilt_b : float
        Rotation of the spindle axis about X and Y [urad] (A0C, B0C; C-01).
    """

    temperatures: FloatArray
    x: Deviation
    y: Deviation
    z: Deviation
    tilt_a: float
    tilt_b: float


class VirtualMachine(Protocol[S]):
    """A machine tool that warms up."""

    @property
    def places(self) -> tuple[str, ...]:
        """Where temperatures are known, as names."""
        ...

    def init(self, air: Air) -> S:
        """Return the state of a machine that has long been at rest in this air."""
        ...

    def step(self, state: S, drive: Drive, dt: float) -> tuple[S, Truth]:
        """Return the state after `dt` [s] of `drive`, and what is true then."""
        ...
