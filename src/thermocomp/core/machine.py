"""Machine, axes and channels: what stands on the shop floor."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from thermocomp.core.components import BY_CODE, ErrorComponent
from thermocomp.core.exceptions import InputError, SettingError
from thermocomp.core.model import ErrorModel
from thermocomp.core.position import PositionModel
from thermocomp.core.structure import Structure
from thermocomp.core.units import unit

Vector = tuple[float, float, float]
#: what may tell the value of a component: a constant [um or urad], a model of time, a model of time and position
Source = float | ErrorModel | PositionModel


@dataclass(frozen=True)
class Axis:
    """A linear axis (ISO 841).

    Parameters
    ----------
    name : {'X', 'Y', 'Z'}
        ISO 841 letter.
    travel : tuple of float
        Lowest and highest position [mm].
    reference_position : float
        Where its squareness moves nothing [mm].
    measured_at : tuple of float
        Where X, Y and Z stood while its errors were measured [mm]; its own coordinate does not matter.
    measured_tool : tuple of float
        From the spindle's gauge point to where its translations were measured, such as a reflector [mm]. This and
        `measured_at` are its reference point: there its angles move nothing.

    Raises
    ------
    SettingError
        The name is none, or the travel does not rise.
    """

    name: str
    travel: tuple[float, float]
    reference_position: float = 0.0
    measured_at: Vector = (0.0, 0.0, 0.0)
    measured_tool: Vector = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        low, high = self.travel
        if self.name not in ("X", "Y", "Z"):
            raise SettingError(f"axis name {self.name!r}: expected X, Y or Z")
        if not low < high:
            raise SettingError(f"goes from {low:g} to {high:g} mm: must rise", ("travel",))
        for key in ("travel", "measured_at", "measured_tool"):
            numbers = getattr(self, key)
            if not all(math.isfinite(v) for v in numbers):
                raise SettingError(f"{numbers}: must be finite numbers", (key,))
        if not math.isfinite(self.reference_position):
            raise SettingError(f"{self.reference_position}: must be a finite number", ("reference_position",))


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


@dataclass(frozen=True, eq=False)
class Machine:
    """A machine tool of up to three linear axes, and what is known of its errors.

    Parameters
    ----------
    name : str
        What its owners call it.
    structure : Structure
        Which axes carry the workpiece and which the tool.
    axes : tuple of Axis
        One per axis of the structure.
    components : mapping of str to Source
        By code of the component; one that is not there is zero.
    spindle_tool : tuple of float
        From the spindle's gauge point to where its drift was measured, such as the tip of a test bar [mm]: there its
        tilts move nothing.
    tool : tuple of float
        From the gauge point to the tool's tip [mm]; a tool of length L is (0, 0, -L).
    channels : tuple of Channel
        Its sensors.
    reference_temperature : float
        Temperature at which its geometry is defined [degC]; ISO 1 says 20.

    Raises
    ------
    SettingError
        Axes and structure differ, a number is not finite, or a component is unknown, belongs to an axis that is not
        there, or has a source of another unit or axis.
    """

    name: str
    structure: Structure
    axes: tuple[Axis, ...]
    components: Mapping[str, Source] = field(default_factory=dict)
    spindle_tool: Vector = (0.0, 0.0, 0.0)
    tool: Vector = (0.0, 0.0, 0.0)
    channels: tuple[Channel, ...] = ()
    reference_temperature: float = 20.0

    def __post_init__(self) -> None:
        for key, numbers in (
            ("spindle_tool", self.spindle_tool),
            ("tool", self.tool),
            ("reference_temperature", (self.reference_temperature,)),
        ):
            if not all(math.isfinite(v) for v in numbers):
                raise SettingError(f"{numbers}: must be finite numbers", (key,))
        there = [a.name for a in self.axes]
        for name in there:
            if name not in self.structure.axes:
                raise SettingError(f"axis {name} is not in the structure {self.structure.code!r}", ("axes", name))
        for name in self.structure.axes:
            if there.count(name) != 1:
                raise SettingError(
                    f"axis {name} of the structure {self.structure.code!r} is there {there.count(name)} times",
                    ("axes", name),
                )
        for code, source in self.components.items():
            if code not in BY_CODE:
                raise SettingError(f"there is no component {code!r}", ("components", code))
            try:
                self._check(BY_CODE[code], source)
            except SettingError as e:
                raise SettingError(str(e), ("components", code, *e.path)) from None

    def axis(self, name: str) -> Axis:
        """Return an axis by its letter."""
        for a in self.axes:
            if a.name == name:
                return a
        raise InputError(f"machine {self.name}: there is no axis {name!r}; there are {', '.join(self.structure.axes)}")

    def _check(self, component: ErrorComponent, source: Source) -> None:
        for name in component.axes:
            if name not in self.structure.axes:
                raise SettingError(f"{component.description}: the machine has no axis {name}")
        if isinstance(source, float | int):
            if not math.isfinite(source):
                raise SettingError(f"{source}: must be a finite number")
            return
        if source.unit != component.unit:
            raise SettingError(f"the model is in {source.unit}; {component.description} is in {component.unit}")
        if isinstance(source, PositionModel):
            if component.is_scalar:
                raise SettingError(f"{component.description} does not depend on a position; its model does")
            if source.axis != component.depends_on:
                raise SettingError(f"{component.description}: the model is one along {source.axis}")
