"""Program and machine coordinates, and the offsets between them.

Machine = origin of the work coordinate system + rotation about Z of (program + G92 or G52) + tool offset, in mm, as
in LinuxCNC, where G92 and G52 use the same stored offset.
"""

import math
from collections.abc import Mapping

from thermocomp.nc.interpreter.block import Known, Point, Setup, triple

_ZERO: Point = (0.0, 0.0, 0.0)
_NEVER: Known = (False, False, False)
_ALL: Known = (True, True, True)

#: LinuxCNC: number of the last work coordinate system, G59.3
LAST = 9
#: Fanuc: number of the external offset, which is added to all work coordinate systems
EXTERNAL = 0


def combine_known(a: Known, b: Known) -> Known:
    """Return, per axis, whether it is marked as known in both arguments."""
    return (a[0] and b[0], a[1] and b[1], a[2] and b[2])


def replace_coordinates(point: Point, values: Mapping[int, float]) -> Point:
    """Return a point with some of its coordinates replaced."""
    return triple(values.get(i, old) for i, old in enumerate(point))


def mark_axes(known: Known, axes: Mapping[int, object], to: bool) -> Known:
    """Return `known` with some axes marked as known or unknown."""
    return triple(to if i in axes else was for i, was in enumerate(known))


class Offsets:
    """Offsets in force, and whether they are certain, per axis.

    Offsets in force before the program starts are uncertain, even if given in the setup; offsets set by the program
    are certain. After a change, a program coordinate is only known if the offset was certain both before and after the
    change.
    """

    def __init__(self, setup: Setup) -> None:
        self.system = 1
        #: the program specifies the system in force; until then G54 is assumed
        self.named = False
        self.origins: dict[int, Point] = dict(setup.offsets)
        self.rotations: dict[int, float] = dict(setup.rotations)
        self._certain_origins: dict[int, Known] = {}
        self._told_origins = set(setup.offsets)
        self.shift: Point = _ZERO
        self._kept: Point = _ZERO
        self._certain_shift: Known = _NEVER
        self._turn: tuple[float, float, float] | None = None
        self.tool: Point = _ZERO
        self.certain_tool: Known = (True, True, False)
        self._update()

    def _update(self) -> None:
        """Precompute the terms of the frequent coordinate conversions after an offset has changed."""
        origin = self.origins.get(self.system, _ZERO)
        external = self.origins.get(EXTERNAL, _ZERO)
        self.rotation = self.rotations.get(self.system, 0.0)
        turned = math.radians(self.rotation)
        self._cos, self._sin = math.cos(turned), math.sin(turned)
        x, y, z = (origin[i] + external[i] + self.tool[i] for i in range(3))
        if self._turn is not None:  # rotation within the system: its centre keeps its unrotated position
            a, b, angle = self._turn
            x, y = x + a * self._cos - b * self._sin, y + a * self._sin + b * self._cos
            self.rotation += angle
            turned = math.radians(self.rotation)
            self._cos, self._sin = math.cos(turned), math.sin(turned)
            x, y = x - a * self._cos + b * self._sin, y - a * self._sin - b * self._cos
        self._base = (x, y, z)
        #: total added to program coordinates; None while they are rotated
        self.sum: Point | None = None
        if not self.rotation:
            self.sum = (x + self.shift[0], y + self.shift[1], z + self.shift[2])

    @property
    def certain(self) -> Known:
        """Whether machine coordinates are known from program coordinates, per axis."""
        origin = self._certain_origins.get(self.system, _NEVER) if self.named else _NEVER
        return combine_known(origin, combine_known(self._certain_shift, self.certain_tool))

    @property
    def origin_told(self) -> bool:
        """Whether program or setup define the origin of the system in force."""
        return self.system in self._told_origins

    @property
    def rotation_told(self) -> bool:
        """Whether program or setup specify the rotation of the system in force."""
        alike = len({self.rotations.get(system, math.nan) for system in range(1, LAST + 1)}) == 1
        return self.system in self.rotations and (self.named or alike)

    def state(self) -> tuple[object, ...]:
        """Return all offsets in force as one value, to detect changes."""
        return (self._turn, self.system, dict(self.origins), dict(self.rotations), self.shift, self._kept, self.tool)

    def machine(self, place: Point) -> Point:
        """Return the machine coordinates of a point in program coordinates [mm]."""
        x, y, z = place
        if self.sum is not None:
            a, b, c = self.sum
            return (x + a, y + b, z + c)
        a, b, c = self._base
        x, y, z = x + self.shift[0], y + self.shift[1], z + self.shift[2]
        return (x * self._cos - y * self._sin + a, x * self._sin + y * self._cos + b, z + c)

    def program(self, point: Point) -> Point:
        """Return the program coordinates of a point in machine coordinates [mm]."""
        x, y, z = (point[i] - self._base[i] for i in range(3))
        x, y = x * self._cos + y * self._sin, y * self._cos - x * self._sin
        return (x - self.shift[0], y - self.shift[1], z - self.shift[2])

    def turn(self, centre: tuple[float, float] | None, angle: float = 0.0) -> None:
        """Execute G68: rotate X and Y of the program about a point in program coordinates [mm, deg]; None: G69."""
        self._turn = None if centre is None else (centre[0] + self.shift[0], centre[1] + self.shift[1], angle)
        self._update()

    def select(self, system: int) -> Known:
        """Execute G54 and similar codes; return, per axis, whether a known program coordinate remains known."""
        if system == self.system and self.named:
            return _ALL
        before, turned = self._certain_origins.get(self.system, _NEVER), self.rotation
        still = combine_known(before, self._certain_origins.get(system, _NEVER)) if self.named else _NEVER
        self.system, self.named = system, True
        self._update()
        # with rotated coordinates, X and Y depend on each other
        return (False, False, still[2]) if turned != self.rotation else still

    def set_origin(
        self, system: int, values: Mapping[int, float], rotation: float | None = None, add: bool = False
    ) -> None:
        """Execute G10 L2: set the origin of a system.

        Parameters
        ----------
        values : mapping of int to float
            By axis [mm].
        rotation : float or None
            Rotation [deg]; None: unchanged.
        """
        old = self.origins.get(system, _ZERO)
        if add:
            values = {i: old[i] + v for i, v in values.items()}
        else:
            certain = self._certain_origins.get(system, _NEVER)
            self._certain_origins[system] = mark_axes(certain, values, to=True)
        self.origins[system] = replace_coordinates(old, values)
        if values:
            self._told_origins.add(system)
        if rotation is not None:
            self.rotations[system] = rotation
        self._update()

    def name_origin(self, system: int, point: Point, values: Mapping[int, float], known: Known) -> None:
        """Execute G10 L20: set the origin of a system so that a machine point has the given program coordinates in it.

        Parameters
        ----------
        point : tuple of float
            Machine coordinates [mm].
        values : mapping of int to float
            Program coordinates, by axis [mm].
        """
        own = self.system
        certain = combine_known(known, self.certain)
        self.system = system
        self._update()
        wanted = replace_coordinates(self.program(point), values)
        old = self.origins.get(system, _ZERO)
        reached = self.machine(wanted)
        self.origins[system] = triple(old[i] + point[i] - reached[i] for i in range(3))
        stays = mark_axes(self._certain_origins.get(system, _NEVER), values, to=False)
        told = mark_axes(_NEVER, values, to=True)
        self._certain_origins[system] = triple(s or (t and c) for s, t, c in zip(stays, told, certain, strict=True))
        self.system = own
        self._update()

    def name_place(self, place: Point, values: Mapping[int, float], known: Known) -> None:
        """Execute G92: shift the coordinates so that a point in program coordinates has the given coordinates."""
        told = combine_known(self._certain_shift, known)
        self._certain_shift = mark_axes(self._certain_shift, {i: v for i, v in values.items() if not told[i]}, to=False)
        self._set_shift(replace_coordinates(self.shift, {i: self.shift[i] + place[i] - v for i, v in values.items()}))

    def set_shift(self, values: Mapping[int, float]) -> Known:
        """Execute G52; return, per axis, whether a known program coordinate remains known."""
        still = triple(c or i not in values for i, c in enumerate(self._certain_shift))
        self._certain_shift = mark_axes(self._certain_shift, values, to=True)
        self._set_shift(replace_coordinates(self.shift, values))
        return still

    def drop_shift(self, keep: bool) -> Known:
        """Execute G92.1, or G92.2, which keeps the values for G92.3; return whether program coordinates stay known."""
        kept, still = self._kept, self._certain_shift
        self._set_shift(_ZERO)
        self._kept = kept if keep else _ZERO
        self._certain_shift = _ALL
        return still

    def restore_shift(self) -> Known:
        """Execute G92.3; return, per axis, that program coordinates are no longer known."""
        self._set_shift(self._kept)
        self._certain_shift = _NEVER
        return _NEVER

    def _set_shift(self, shift: Point) -> None:
        self.shift = self._kept = shift
        self._update()

    def set_tool(self, tool: Point, certain: Known) -> Known:
        """Execute G43 and similar codes; return, per axis, whether a known program coordinate remains known."""
        still = combine_known(self.certain_tool, certain)
        self.tool, self.certain_tool = tool, certain
        self._update()
        return still
