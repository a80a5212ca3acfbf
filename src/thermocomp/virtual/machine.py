"""Interface of a virtual machine tool: state in, state out.

It is implemented by reduced finite-element models (`thermocomp.virtual.centre`, `thermocomp.virtual.toolsystem`).
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.exceptions import InputError
from thermocomp.virtual.axes import AXES, TRAVEL

FloatArray = NDArray[np.float64]
S = TypeVar("S")


@dataclass(frozen=True)
class Air:
    """Air around the machine.

    Parameters
    ----------
    temperature : float
        Temperature at the middle of the machine, `REFERENCE_HEIGHT` above the floor [degC].
    stratification : float
        Rise with height [K/m].
    side : float
        Rise from left to right, along +X [K/m].
    """

    temperature: float = 20.0
    stratification: float = 0.0
    side: float = 0.0

    #: height above the floor to which `temperature` refers [m]
    REFERENCE_HEIGHT = 1.2

    @property
    def values(self) -> FloatArray:
        """Temperature, stratification and side gradient: one row of the `air` of `VirtualMachine.run`."""
        return np.array([self.temperature, self.stratification, self.side])


@dataclass(frozen=True)
class FeedDrive:
    """Commands to the machine during one step.

    Parameters
    ----------
    speed : float
        Spindle speed [1/min].
    feed : tuple of float
        Mean feed rates of X, Y, Z [mm/min].
    stroke : tuple of (tuple of float or None)
        Start and end of the movements of X, Y and Z [mm]; None: over the whole travel.
    loads : mapping of str to float
        Additional heat by place, such as heat of cutting [W].
    cooled : bool
        Whether the coolant loop runs.
    powered : bool
        Whether the machine is switched on; if not there is no heat and no coolant flow.

    Raises
    ------
    InputError
        A number is not finite, a stroke is beyond the travel, or a machine that is switched off is commanded to move.
    """

    speed: float = 0.0
    feed: tuple[float, float, float] = (0.0, 0.0, 0.0)
    stroke: tuple[tuple[float, float] | None, tuple[float, float] | None, tuple[float, float] | None] = (None,) * 3
    loads: Mapping[str, float] = field(default_factory=dict)
    cooled: bool = True
    powered: bool = True

    def __post_init__(self) -> None:
        numbers = {"speed": self.speed, **dict(zip(AXES, self.feed, strict=True)), **self.loads}
        for name, value in numbers.items():
            if not math.isfinite(value):
                raise InputError(f"drive: {name} = {value}: must be a finite number")
        for axis, stroke in zip(AXES, self.stroke, strict=True):
            if stroke is not None and not all(0.0 <= p <= TRAVEL[axis] for p in stroke):
                raise InputError(f"drive: stroke {stroke} mm of {axis.upper()} is beyond 0 to {TRAVEL[axis]:g} mm")
        if not self.powered and (self.speed or any(self.feed)):
            raise InputError("drive: a machine that is switched off neither turns nor moves")


@dataclass(frozen=True, eq=False)
class Truth:
    """True state of the machine, without sensors: one row per step.

    Parameters
    ----------
    temperatures : ndarray of shape (n_steps, n_places)
        In the order of `VirtualMachine.places` [degC].
    observables : ndarray of shape (n_steps, n_observables)
        In the order of `VirtualMachine.observables` [um], angles [urad]. Deviations of the tool point relative to the
        workpiece, actual minus commanded, in machine coordinates (ISO 841): a spindle that grows towards the workpiece
        has a negative z.
    """

    temperatures: FloatArray
    observables: FloatArray


class VirtualMachine(Protocol[S]):
    """A machine tool that warms up."""

    @property
    def places(self) -> tuple[str, ...]:
        """Names of the places with known temperatures."""
        ...

    @property
    def observables(self) -> tuple[str, ...]:
        """Names of the deviations that the machine model outputs."""
        ...

    def init(self, air: Air) -> S:
        """Return the equilibrium state of a machine that has been switched off in this air for a long time."""
        ...

    def run(self, state: S, drives: Sequence[FeedDrive], air: FloatArray, dt: float) -> tuple[S, Truth]:
        """Return the state after `n_steps` steps of `dt`, and the true values at the end of each step.

        Parameters
        ----------
        air : ndarray of shape (n_steps, 3)
            `Air.values` of each step.
        dt : float
            [s]
        """
        ...


def check(drives: Sequence[FeedDrive], air: FloatArray, dt: float) -> None:
    """Raise an error for invalid arguments of `VirtualMachine.run`.

    Parameters
    ----------
    air : ndarray of shape (n_steps, 3)
    dt : float
        [s]
    """
    if not (dt > 0 and math.isfinite(dt)):
        raise InputError(f"step of {dt} s: must be positive")
    if not drives or np.shape(air) != (len(drives), 3):
        raise InputError(
            f"{len(drives)} drives and air of shape {np.shape(air)}: expected one row of three numbers per drive"
        )
    if not np.isfinite(air).all():
        raise InputError("air: temperatures must be finite; remove NaN and infinity")


def stretches(drives: Sequence[FeedDrive]) -> Iterator[tuple[int, int]]:
    """Yield start and end of each run of steps with a constant drive."""
    first = 0
    for k in range(1, len(drives) + 1):
        if k == len(drives) or (drives[k] is not drives[first] and drives[k] != drives[first]):
            yield first, k
            first = k
