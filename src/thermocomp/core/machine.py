"""Machine, axes and channels: the equipment on the shop floor."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from thermocomp.core.components import BY_CODE, ErrorComponent
from thermocomp.core.exceptions import InputError, SettingError
from thermocomp.core.model import ErrorModel
from thermocomp.core.position import PositionModel
from thermocomp.core.profile import SplineProfile
from thermocomp.core.structure import Structure
from thermocomp.core.units import find_unit

Vector = tuple[float, float, float]
#: source of the value of a component: a constant [um or urad], a model of time, a model of time and position
Source = float | ErrorModel | PositionModel
#: a larger constant (10 mm or 10 mrad) is assumed to be in a wrong unit [um or urad]
PLAUSIBLE = 10_000.0


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
        Position at which its squareness has no effect [mm].
    measured_at : tuple of float
        Positions of X, Y and Z during the measurement of the errors [mm]; the coordinate of the axis itself matters
        only for a measurement on the workpiece side.
    measured_tool : tuple of float
        Vector from the spindle's gauge point to the point where the translations were measured, such as a reflector
        [mm]. With `measured_at` it defines the reference point of the axis, where its angles cause no displacement.
    measured_on : {'tool', 'workpiece'}
        Side that carried the measuring point while the axis moved: the tool side, such as a probe or a reflector in the
        spindle, or the workpiece side, such as a reflector on the table. In the second case the tool was at this point
        with the axis at its coordinate of `measured_at`, and travel of the axis from there adds to the lever.
    rapid : float or None
        Maximum speed [mm/min]; None: unknown.
    acceleration : float or None
        Maximum acceleration and deceleration [mm/s2]; None: unknown.

    Raises
    ------
    SettingError
        The name is invalid, the travel is not increasing, `measured_on` is invalid, or a speed or an acceleration is
        not positive.
    """

    name: str
    travel: tuple[float, float]
    reference_position: float = 0.0
    measured_at: Vector = (0.0, 0.0, 0.0)
    measured_tool: Vector = (0.0, 0.0, 0.0)
    measured_on: Literal["tool", "workpiece"] = "tool"
    rapid: float | None = None
    acceleration: float | None = None

    def __post_init__(self) -> None:
        low, high = self.travel
        if self.name not in ("X", "Y", "Z"):
            raise SettingError(f"axis name {self.name!r}: expected X, Y or Z")
        if not low < high:
            raise SettingError(f"lower limit {low:g} mm must be less than upper limit {high:g} mm", ("travel",))
        for key in ("travel", "measured_at", "measured_tool"):
            numbers = getattr(self, key)
            if not all(math.isfinite(v) for v in numbers):
                raise SettingError(f"{numbers}: must be finite numbers", (key,))
        if not math.isfinite(self.reference_position):
            raise SettingError(f"{self.reference_position}: must be a finite number", ("reference_position",))
        if self.measured_on not in ("tool", "workpiece"):
            raise SettingError(f"{self.measured_on!r}: must be 'tool' or 'workpiece'", ("measured_on",))
        for key in ("rapid", "acceleration"):
            most = getattr(self, key)
            if most is not None and not 0 < most < math.inf:
                raise SettingError(f"{most:g}: must be positive", (key,))


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
        Location of the sensor as text; empty if unknown.
    """

    name: str
    quantity: str
    unit: str
    place: str = ""

    def __post_init__(self) -> None:
        find_unit(self.unit, self.quantity)


@dataclass(frozen=True, eq=False)
class Machine:
    """A machine tool with up to three linear axes, and its known errors.

    Parameters
    ----------
    name : str
        Name given by the owner.
    structure : Structure
        Axes that carry the workpiece, and axes that carry the tool.
    axes : tuple of Axis
        One per axis of the structure.
    components : mapping of str to Source
        By code of the component; missing components are zero.
    spindle_tool : tuple of float
        Vector from the spindle's gauge point to the point where its drift was measured, such as the tip of a test bar
        [mm]; there its tilts cause no displacement.
    tool : tuple of float
        Vector from the gauge point to the tool tip [mm]; (0, 0, -L) for a tool of length L.
    channels : tuple of Channel
        Sensors of the machine.
    reference_temperature : float
        Temperature at which the geometry is defined [degC]; 20 according to ISO 1.

    Raises
    ------
    SettingError
        Axes and structure differ, a number is not finite, or a component is unknown, belongs to a missing axis, has a
        source with another unit or axis, was measured outside the travel of the axis, or has an implausible constant.
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
                    f"axis {name} of the structure {self.structure.code!r} occurs {there.count(name)} times, expected "
                    "once",
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
        if isinstance(source, bool) or not isinstance(source, float | int | ErrorModel | PositionModel):
            raise SettingError(f"{source!r}: must be a number or a model")
        if isinstance(source, float | int):
            if not math.isfinite(source):
                raise SettingError(f"{source}: must be a finite number")
            if abs(source) > PLAUSIBLE:
                most = "10 mm" if component.unit == "um" else "10 mrad"
                raise SettingError(f"{source:g} {component.unit} is more than {most}: check the unit")
            return
        if source.unit != component.unit:
            raise SettingError(f"the model is in {source.unit}; {component.description} is in {component.unit}")
        if isinstance(source, PositionModel):
            if component.is_scalar:
                raise SettingError(f"{component.description} does not depend on a position, but its model does")
            if source.axis != component.depends_on:
                raise SettingError(
                    f"{component.description}: expected a model along {component.depends_on}, found one along "
                    f"{source.axis}"
                )
            self._check_ranges(component, source)

    def _check_ranges(self, component: ErrorComponent, source: PositionModel) -> None:
        profile = source.profile
        if isinstance(profile, SplineProfile) and profile.axis != source.axis:
            raise SettingError(
                f"{component.description}: its profile is along {profile.axis}, but its model is along {source.axis}"
            )
        for what, name, (low, high) in source.ranges():
            if name not in self.structure.axes:
                raise SettingError(
                    f"{component.description}: its {what} depends on axis {name}, which this machine does not have; "
                    f"use a model for the axes of this machine, or add axis {name} to the machine file"
                )
            first, last = self.axis(name).travel
            if high < first or low > last:
                raise SettingError(
                    f"{component.description}: its {what} is known for {name} = {low:g} to {high:g} mm, but the axis "
                    f"travels from {first:g} to {last:g} mm: check the unit and the zero of the positions"
                )
