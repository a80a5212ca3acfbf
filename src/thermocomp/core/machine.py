"""Machine, axes and channels: what stands on the shop floor."""

from dataclasses import dataclass

from thermocomp.core.exceptions import InputError
from thermocomp.core.units import unit


@dataclass(frozen=True)
class Axis:
    """A linear axis (ISO 841).

    Parameters
    ----------
    name : {'X', 'Y', 'Z'}
        ISO 841 letter.
    travel : tuple of float
        Lowest and highest position [mm].
    """

    name: str
    travel: tuple[float, float]

    def __post_init__(self) -> None:
        low, high = self.travel
        if self.name not in ("X", "Y", "Z"):
            raise InputError(f"axis name {self.name!r}: expected X, Y or Z")
        if not low < high:
            raise InputError(f"axis {self.name}: travel {self.travel} mm must rise")


@dataclass(frozen=True)
class Channel:
    """A measured quantity: one column of a recording, one sensor of a machine.

    Parameters
    ----------
    name : str
        Name without unit, such as ``t5``.
    quantity : str
        A key of `thermocomp.core.units.HOUSE_UNITS`: ``temperature``, ``displacement``, ``spindle_speed`` ...
    unit : str
        House unit of the quantity.
    place : str
        Where the sensor sits, in words; empty if unknown.
    """

    name: str
    quantity: str
    unit: str
    place: str = ""

    def __post_init__(self) -> None:
        unit(self.unit, self.quantity)


@dataclass(frozen=True)
class Machine:
    """A machine tool.

    Parameters
    ----------
    name : str
        What its owners call it.
    structure : str
        Structure code (ISO 10791), such as ``w X' b Y Z (C1) t``.
    axes : tuple of Axis
        Its linear axes.
    channels : tuple of Channel
        Its sensors.
    reference_temperature : float
        Temperature at which its geometry is defined [degC]; ISO 1 says 20.
    """

    name: str
    structure: str = ""
    axes: tuple[Axis, ...] = ()
    channels: tuple[Channel, ...] = ()
    reference_temperature: float = 20.0
